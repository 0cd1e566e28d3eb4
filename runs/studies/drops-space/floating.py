#!/usr/bin/env python3
"""Depth of a sphere that floats at an interface without walls, exact: floating.py ANGLE DENSITY [VOLUME] (deg; of the sphere; of the water).

Other numbers are those of the study (README.md). With the contact line at an angle alpha from the lowest point of the sphere the
interface leaves it with a slope psi = alpha + theta - pi and follows dpsi/ds + sin(psi)/r = (rho_1 - rho_2) g y/sigma outwards, where it
becomes level (y: above the place without a jump of pressure). alpha is where weight, pressure and the pull 2 pi r sigma sin(psi) balance.
In a box as wide as AREA says the level follows from the volume of the water: what the interface holds above it is that pull over
(rho_1 - rho_2) g."""

import math
import sys

R, HEAVY, LIGHT, TENSION, AREA, FLOOR = 0.25, 1.0, 0.1, 0.028125, 2.25, -0.5
LENGTH = math.sqrt(TENSION / (HEAVY - LIGHT))
FAR, STEPS = 12 * LENGTH, 2000


def bisect(function, low, high):
    sign = function(low) > 0
    for _ in range(60):
        middle = (low + high) / 2
        if (function(middle) > 0) == sign:
            low = middle
        else:
            high = middle
    return (low + high) / 2


def slope(r, y, psi):
    psi = max(-1.5, min(1.5, psi))
    return math.tan(psi), (y / LENGTH**2 - math.sin(psi) / r) / math.cos(psi)


def follow(end, size):
    """Height and slope at r = end of the interface with size e^(-r)/sqrt(r) far away (Runge-Kutta in r, inwards)"""
    r, h = FAR, (end - FAR) / STEPS
    y = size * math.exp(-r / LENGTH) * math.sqrt(LENGTH / r)
    psi = -y / LENGTH * (1 + LENGTH / (2 * r))
    for _ in range(STEPS):
        k1 = slope(r, y, psi)
        k2 = slope(r + h / 2, y + h / 2 * k1[0], psi + h / 2 * k1[1])
        k3 = slope(r + h / 2, y + h / 2 * k2[0], psi + h / 2 * k2[1])
        k4 = slope(r + h, y + h * k3[0], psi + h * k3[1])
        y += h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
        psi += h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
        r += h
        if abs(psi) > 1.5:
            return y, math.copysign(2, psi)
    return y, psi


def contact_height(alpha, theta):
    psi, r = alpha + theta - math.pi, R * math.sin(alpha)
    size = bisect(lambda s: follow(r, s)[1] - psi, -50 * R, 50 * R)
    return follow(r, size)[0]


def parts(alpha, theta):
    """Height of the contact line, volume of the sphere below it, pull upwards"""
    r, c = R * math.sin(alpha), math.cos(alpha)
    return contact_height(alpha, theta), math.pi * R**3 * (1 - c) ** 2 * (2 + c) / 3, 2 * math.pi * r * TENSION * math.sin(alpha + theta - math.pi)


def force(alpha, theta, density):
    y, cap, pull = parts(alpha, theta)
    return (LIGHT - density) * 4 / 3 * math.pi * R**3 + (HEAVY - LIGHT) * (cap - math.pi * (R * math.sin(alpha)) ** 2 * y) + pull


def floats(theta, density):
    """Depth of the centre below the level; volume that water has less for the sphere and the meniscus"""
    alpha = bisect(lambda a: force(a, theta, density), max(0.3, math.pi - theta - 1.2), min(2.9, math.pi - theta + 1.2))
    y, cap, pull = parts(alpha, theta)
    lacks = cap - math.pi * (R * math.sin(alpha)) ** 2 * y + pull / (HEAVY - LIGHT)
    return -(y + R * math.cos(alpha)), lacks, alpha


if __name__ == "__main__":
    depth, lacks, alpha = floats(math.radians(float(sys.argv[1])), float(sys.argv[2]))
    print(f"depth {depth:.6f}, contact line at {math.degrees(alpha):.2f} degrees from below")
    if len(sys.argv) > 3:
        print(f"centre at {FLOOR + (float(sys.argv[3]) + lacks) / AREA - depth:.6f}")
