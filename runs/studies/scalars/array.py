#!/usr/bin/env python3
"""Effective conductivity of a square array of discs: multipoles of one disc and lattice sums (Rayleigh 1892; Perrins et al. 1979).

array.py RATIO FRACTION: conductivity of the discs over that of the matrix, fraction of the area. Unit cell, matrix 1."""

import sys
import numpy as np
from math import comb, gamma, pi, sqrt


def lattice_sums(most):
    """S_n = sum of (x + i y)^-n over the lattice but its origin, n = 2, 4, .. most; n = 2 by Rayleigh's order (strips along the gradient).

    S_4 in closed form; c_n = (2n - 1) S_2n has the recurrence of the Laurent series of Weierstrass's function."""
    c = {2: 3 * gamma(0.25) ** 8 / (960 * pi**2), 3: 0.0}
    for n in range(4, most // 2 + 1):
        c[n] = 3 / ((2 * n + 1) * (n - 3)) * sum(c[m] * c[n - m] for m in range(2, n - 1))
    return {2: pi} | {2 * n: value / (2 * n - 1) for n, value in c.items()}


def effective(ratio, fraction, orders=40):
    a = sqrt(fraction / pi)
    t = (ratio - 1) / (ratio + 1)
    odd = np.arange(1, 2 * orders, 2)
    sums = lattice_sums(4 * orders)
    # outside T = x + ..., poles b_n r^-n cos n phi: b_n/(t a^2n) + sum_m C(n + m - 1, n) S_(n + m) b_m = -delta_n1
    M = np.zeros((orders, orders))
    scale = a ** odd.astype(float)  # b_n = scale beta_n
    for i, n in enumerate(odd):
        for j, m in enumerate(odd):
            M[i, j] = comb(int(n + m - 1), int(n)) * sums[int(n + m)] * scale[i] * scale[j]
        M[i, i] -= 1 / t
    rhs = np.zeros(orders)
    rhs[0] = scale[0]
    beta = np.linalg.solve(M, rhs)
    return 1 - 2 * pi * beta[0] * scale[0]


if __name__ == "__main__":
    print(f"{effective(float(sys.argv[1]), float(sys.argv[2])):.6f}")
