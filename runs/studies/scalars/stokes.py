#!/usr/bin/python3
"""Nusselt number (by diameter) of a sphere at a value in a Stokes flow, a spectral solution to compare with.

  stokes.py [OUTER [Pe ...]]   Pe = U d/D; value 0 at OUTER radii, where the fluid passes with the velocity of free space

Legendre modes of the value, Chebyshev points in log r (../swimmers/inertia.py). Beside it the series of Acrivos & Taylor 1962, free space.
"""

import math
import sys
from pathlib import Path

import numpy as np
from numpy.polynomial import legendre

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "swimmers"))
from inertia import differentiate  # noqa: E402

RADIAL, MODES = 48, 28


def nusselt(peclet, outer, radial=RADIAL, modes=MODES):
    """Heat over that of conduction into free space, times 2"""
    s, D = differentiate(radial, math.log(outer))
    r = np.exp(s)
    D = D / r[:, None]
    x, weight = legendre.leggauss(2 * modes)
    P = np.array([legendre.legval(x, np.eye(modes)[k]) for k in range(modes)])
    V = np.array([-np.sqrt(1 - x**2) * legendre.legval(x, legendre.legder(np.eye(modes)[k])) for k in range(modes)])
    scale = (2 * np.arange(modes) + 1) / 2
    along = np.einsum("kq,q,nq->kn", P * weight * scale[:, None], x, P)  # of cos theta P_n
    across = np.einsum("kq,q,nq->kn", P * weight * scale[:, None], np.sqrt(1 - x**2), V)
    ur, ut = 1 - 1.5 / r + 0.5 / r**3, -(1 - 0.75 / r - 0.25 / r**3)
    size, A = radial + 1, np.zeros((modes, radial + 1, modes, radial + 1))
    for k in range(modes):
        A[k, :, k] += D @ D + 2 * D / r[:, None] - np.diag(k * (k + 1) / r**2)
        for n in range(max(0, k - 1), min(modes, k + 2)):
            A[k, :, n] -= peclet / 2 * (along[k, n] * ur[:, None] * D + across[k, n] * np.diag(ut / r))
        A[k, [0, -1]] = 0
        A[k, 0, k, 0] = A[k, -1, k, -1] = 1
    b = np.zeros((modes, size))
    b[0, 0] = 1
    T = np.linalg.solve(A.reshape(modes * size, -1), b.reshape(-1)).reshape(modes, size)
    return -2 * (D @ T[0])[0]


def series(peclet):
    e = peclet / 2
    return 2 * (1 + e / 2 + e**2 / 2 * math.log(e) + 0.41465 * e**2 + e**3 / 4 * math.log(e))


if __name__ == "__main__":
    outer = float(sys.argv[1]) if len(sys.argv) > 1 else 4
    for peclet in [float(a) for a in sys.argv[2:]] or (0.1, 1, 10):
        print(f"Pe {peclet:g}: {nusselt(peclet, outer):.5f}, series {series(peclet):.5f}")
