#!/usr/bin/env python3
"""Depth of a disc that floats at an interface between smooth walls, exact in the plane: floating.py ANGLE DENSITY (deg; of the disc).

Other numbers are those of runs/disc-at-interface.yaml. With the contact line at an angle alpha from the lowest point of the disc the interface
leaves it with a slope psi = alpha + theta - pi, and follows dpsi/ds = (rho_1 - rho_2) g y/sigma to the wall, where it is level (y: above the place
without a jump of pressure). alpha is where weight, pressure and the pull 2 sigma sin(psi) balance."""

import math
import sys

R, HEAVY, LIGHT, TENSION, HALF = 0.25, 1.0, 0.1, 0.1125, 1.0
STEP = 4e-3


def follow(x, y, psi):
    """Slope and height at the wall (Runge-Kutta in x; steep interfaces do not get there)"""
    rate = (HEAVY - LIGHT) / TENSION
    steps = math.ceil((HALF - x) / STEP)
    h = (HALF - x) / steps
    for _ in range(steps):
        slopes = []
        at = (y, psi)
        for weight in (0.5, 0.5, 1, 0):
            if abs(at[1]) > 1.5:
                return at[1], at[0]
            slopes.append((math.tan(at[1]), rate * at[0] / math.cos(at[1])))
            at = (y + weight * h * slopes[-1][0], psi + weight * h * slopes[-1][1])
        y, psi = (v + h / 6 * (a + 2 * b + 2 * c + d) for v, a, b, c, d in zip((y, psi), *slopes))
    return psi, y


def bisect(function, low, high):
    sign = function(low) > 0
    for _ in range(60):
        middle = (low + high) / 2
        if (function(middle) > 0) == sign:
            low = middle
        else:
            high = middle
    return (low + high) / 2


def contact_height(alpha, theta):
    return bisect(lambda y: follow(R * math.sin(alpha), y, alpha + theta - math.pi)[0], -0.5, 0.5)


def force(alpha, theta, density):
    submerged = R * R * (alpha - math.sin(alpha) * math.cos(alpha)) - 2 * R * math.sin(alpha) * contact_height(alpha, theta)
    return (LIGHT - density) * math.pi * R * R + (HEAVY - LIGHT) * submerged + 2 * TENSION * math.sin(alpha + theta - math.pi)


def depth(theta, density):
    alpha = bisect(lambda a: force(a, theta, density), max(0.1, math.pi - theta - 1.3), min(3.0, math.pi - theta + 1.3))
    y = contact_height(alpha, theta)
    return follow(R * math.sin(alpha), y, alpha + theta - math.pi)[1] - y - R * math.cos(alpha)


if __name__ == "__main__":
    print(f"{depth(math.radians(float(sys.argv[1])), float(sys.argv[2])):.6f}")
