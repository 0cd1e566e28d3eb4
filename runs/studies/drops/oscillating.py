#!/usr/bin/env python3
"""Frequency and decay of mode 2 of a drop in a gas, in the plane, over Lamb's: exact for small amplitudes, and of a run.

oscillating.py WALL (radius of a smooth round wall around drop and gas; inf: none); oscillating.py drops.csv (fit of a damped cosine).
Numbers are those of runs/drop-oscillating.yaml. In both fluids the velocity is that of a potential and of a vorticity that diffuses,
r^+-2 and Bessel functions of r sqrt(s rho/mu), all times exp(s t); s is where velocity, shear stress, and normal stress less that of the
tension are continuous at the interface (Miller & Scriven 1968 for spheres), and the gas slips along the wall."""

import csv
import math
import sys

import numpy as np

N, R, TENSION = 2, 0.25, 1.0
DROP, GAS = (1.0, 0.005), (0.001, 5e-5)  # density, viscosity
OMEGA = math.sqrt(N * (N * N - 1) * TENSION / ((DROP[0] + GAS[0]) * R**3))
DECAY = 2 * N * (N - 1) * DROP[1] / (DROP[0] * R**2)


def bessel(kind, n, z):
    """I_n exp(-z) or K_n exp(z) by their integrals"""
    x = np.linspace(0, math.pi if kind == "I" else 12, 4001 if kind == "I" else 60001)
    grow = np.cos(x) - 1 if kind == "I" else 1 - np.cosh(x)
    value = np.exp(z * grow) * (np.cos(n * x) / math.pi if kind == "I" else np.cosh(n * x))
    return np.sum(value[1:] + value[:-1]) * (x[1] - x[0]) / 2


def radial(kind, k, r, at):
    """A function of r and its two derivatives; Bessel functions as at radius `at`, about"""
    if kind in (N, -N):
        return r**kind, kind * r ** (kind - 1), kind * (kind - 1) * r ** (kind - 2)
    sign, size = (1, np.exp(k * (r - at))) if kind == "I" else (-1, np.exp(-k * (r - at)))
    f = bessel(kind, N, k * r) * size
    d = sign * k * (bessel(kind, N - 1, k * r) + bessel(kind, N + 1, k * r)) / 2 * size
    return f, d, (k * k + N * N / r**2) * f - d / r


def flow(kind, fluid, s, r, at):
    """Of a potential or a stream function: velocity (r, theta), shear stress, normal stress"""
    rho, mu = fluid
    f, d, dd = radial(kind, np.sqrt(s * rho / mu), r, at)
    potential = kind in (N, -N)
    u = (d, -N * f / r) if potential else (N * f / r, -d)
    slope = (dd, -N * (d / r - f / r**2)) if potential else (N * (d / r - f / r**2), -dd)
    return np.array([*u, mu * (slope[1] - u[1] / r - N * u[0] / r), 2 * mu * slope[0] + (rho * s * f if potential else 0)])


def defect(s, wall):
    """Determinant of the conditions"""
    kinds = [(N, DROP, R), ("I", DROP, R), (-N, GAS, R), ("K", GAS, R), (N, GAS, wall), ("I", GAS, wall)][: 6 if wall < math.inf else 4]
    m = np.zeros((len(kinds), len(kinds)), complex)
    for j, (kind, fluid, at) in enumerate(kinds):
        side = flow(kind, fluid, s, R, at)
        if fluid is DROP:
            side[3] += TENSION * (N * N - 1) / R**2 * side[0] / s
        m[:4, j] = side if fluid is DROP else -side
        if wall < math.inf and fluid is GAS:
            m[4:, j] = flow(kind, fluid, s, wall, at)[[0, 2]]
    m /= np.abs(m).max(0)
    return np.linalg.det(m / np.abs(m).max(1)[:, None])


def exact(wall):
    s = -DECAY + 1j * OMEGA
    for _ in range(50):
        now, step = defect(s, wall), 1e-6 * abs(s)
        change = -now * step / (defect(s + step, wall) - now)
        s += change
        if abs(change) < 1e-11 * abs(s):
            break
    return s


def fit(path):
    """Least squares of exp(-g t) (a cos w t + b sin w t) + c"""
    with open(path) as file:
        rows = [{name: float(row[name]) for name in ("time", "deformation", "angle")} for row in csv.DictReader(file)]
    t = np.array([row["time"] for row in rows])
    y = np.array([row["deformation"] * math.cos(2 * row["angle"]) for row in rows])
    s = np.array([DECAY, OMEGA])
    for _ in range(30):
        wave = np.exp(-s[0] * t) * np.array([np.cos(s[1] * t), np.sin(s[1] * t)])
        a, b, c = np.linalg.lstsq(np.vstack([wave, np.ones_like(t)]).T, y, rcond=None)[0]
        slopes = np.vstack([wave, np.ones_like(t), -t * (a * wave[0] + b * wave[1]), t * (b * wave[0] - a * wave[1])]).T
        change = np.linalg.lstsq(slopes, y - a * wave[0] - b * wave[1] - c, rcond=None)[0]
        s += change[3:]
    return -s[0] + 1j * s[1]


if __name__ == "__main__":
    given = sys.argv[1]
    s = fit(given) if given.endswith(".csv") else exact(float(given))
    print(f"frequency {s.imag / OMEGA:.5f} decay {-s.real / DECAY:.5f}")
