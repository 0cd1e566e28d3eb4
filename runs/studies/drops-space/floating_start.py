#!/usr/bin/python3
"""A scene of a quarter box in which a sphere floats at its exact place with the exact meniscus: floating_start.py ANGLE DENSITY CELLS (deg; of the
sphere; a radius). Where it goes is what the program is off. The meniscus is a sum of bells, least squares within 4e-5 outside of the sphere."""

import math
import sys

import numpy as np

from floating import FAR, LENGTH, R, bisect, floats, follow, slope

WIDTHS = np.array([0.1, 0.14, 0.18, 0.22, 0.26, 0.31, 0.36, 0.43, 0.5, 0.7])


def meniscus(contact, psi):
    """Rows of place, height and slope from the contact line outwards"""
    size = bisect(lambda s: follow(contact, s)[1] - psi, -50 * R, 50 * R)
    r, h = FAR, (contact - FAR) / 8000
    y = size * math.exp(-r / LENGTH) * math.sqrt(LENGTH / r)
    at = (y, -y / LENGTH * (1 + LENGTH / (2 * r)))
    rows = []
    for _ in range(8000):
        k1 = slope(r, *at)
        k2 = slope(r + h / 2, *(v + h / 2 * k for v, k in zip(at, k1)))
        at, r = [v + h * k for v, k in zip(at, k2)], r + h
        rows.append((r, at[0], math.tan(at[1])))
    return np.array([row for row in rows if row[0] < 1.2][::-1])


def bells(contact, psi):
    rows = meniscus(contact, psi)
    r, y, dy = rows.T
    inside = np.linspace(0, contact, 60)
    flat = y[0] - math.tan(psi) * contact / 2 * (1 - (inside / contact) ** 2)
    bell = np.exp(-((r[:, None] / WIDTHS) ** 2))
    parts = [bell, 0.05 * bell * (-2 * r[:, None] / WIDTHS**2), 0.01 * np.exp(-((inside[:, None] / WIDTHS) ** 2)), 1e-5 * np.eye(len(WIDTHS))]
    return np.linalg.lstsq(np.vstack(parts), np.concatenate([y, 0.05 * dy, 0.01 * flat, 0 * WIDTHS]), rcond=None)[0]


if __name__ == "__main__":
    angle, density, cells = map(float, sys.argv[1:4])
    theta, h = math.radians(angle), R / cells
    depth, _, alpha = floats(theta, density)
    height = " + ".join(f"({a:.8g})*exp(-(x*x + z*z)/{w * w:.8g})" for a, w in zip(bells(R * math.sin(alpha), alpha + theta - math.pi), WIDTHS))
    side, below, above = (math.ceil(length / h - 1e-9) * h for length in (0.42, 0.45, 0.27))
    print(f"""mesh: {{lower: [0, -0.5, 0], upper: [0.75, 0.6666666666666667, 0.75], focus: [0, {-below}, 0, {side}, {above}, {side}], focus_h: {h}, growth: [0.3, 0.3, 0.3]}}
flow: {{density: 0.1, viscosity: 0.008, gravity: [0, -1, 0], solver: balanced, bc_left: &s {{type: slip}}, bc_right: *s, bc_bottom: *s, bc_top: *s, bc_back: *s, bc_front: *s}}
couple: {{method: penalty}}
particle:
  groups: water, ball
  water: {{region: "y - ({height})", material: fluid, density: 1, viscosity: 0.04, surface_tension: 0.028125, contact_angle: 90 deg}}
  ball: {{shape: circle, radius: {R}, density: {0.1 + (density - 0.1) / 4}, position: [0, {-depth:.8f}, 0], contact_angle: {angle} deg, free: y}}
sim: {{dt: 0.1, time: 3}}
monitor: {{momentum: true}}
output: {{every: 0}}""")
