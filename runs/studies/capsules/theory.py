#!/usr/bin/env python3
"""A spherical capsule that starts in unbounded shear, to first order in its deformation: (a - c)/(a + c) in time.

    python3 runs/studies/capsules/theory.py NUMBER [RATIO [TIME]]      # viscosity inside over outside

Stokes flow about a unit sphere in the strain E: inside a E x + b (5 r^2 E x - 2 x q), outside E x + c x q/r^5 + d (2 E x/r^5 - 5 x q/r^7),
q = x E x; a sheet of surface modulus G and Poisson number 1/2 displaced by s E n + t n q has the energy 4 pi G (.6 s^2 - .8 s t + .8 t^2) E : E.
Both turn with the flow (complex: components 11 and 12 of a tensor in the plane of shear). At rest 6.25 NUMBER where that is small
(Barthes-Biesel & Rallison 1981).
"""
import sys

import numpy as np


def rates(ratio):
    """(s, t)' = B (f1, f2) + e: what a load f1 E n + f2 n q and the strain itself make of the surface."""
    # unknowns a, b, c, d: velocity the same on both sides, load = traction inside - outside
    A = np.array([[1, 5, 0, -2], [0, -2, -1, 5], [2 * ratio, 16 * ratio, -2, 16], [0, -19 * ratio, 8, -40]], dtype=float)
    solve = np.linalg.inv(A)
    surface = np.array([[1, 5, 0, 0], [0, -2, 0, 0]])
    return surface @ solve[:, 2:], surface @ solve @ [1, 0, 2, 0]


def deformations(number, ratio, times):
    B, e = rates(ratio)
    modulus = 1 / (3 * number)
    work = np.array([[1 / 3, 2 / 15], [2 / 15, 2 / 15]])
    M = B @ np.linalg.solve(work, -modulus * np.array([[1.2, -0.8], [-0.8, 1.6]])) - 1j * np.eye(2)
    source = e * 0.5j
    rest, (value, vector) = -np.linalg.solve(M, source), np.linalg.eig(M)
    part = np.linalg.solve(vector, -rest)
    return [abs((rest + vector @ (part * np.exp(value * t))).sum()) for t in times]


def main():
    number, ratio, time = (float(a) for a in sys.argv[1:] + ["0.0125", "1", "1"][len(sys.argv) - 1:])
    for t in np.linspace(0, time, 11)[1:]:
        print("%7.4f  D %.6f" % (t, deformations(number, ratio, [t])[0]))


if __name__ == "__main__":
    main()
