#!/usr/bin/env python3
"""What pull holds two touching spheres together in a shear flow (Goren 1971)? By symmetry that of the axisymmetric part of the strain,
rate/2 along the line of centres at 45 degrees. Stokes flow past two fixed spheres, in Sampson's multipoles of both (stream functions
r^(1-n) J_n and r^(3-n) J_n about each centre), matched on the surface by least squares; the force is 4 pi times the stokeslet."""
import numpy as np
from numpy.polynomial import legendre


def legendre_of(n, x):
    return legendre.legval(x, [0] * n + [1])


def velocity(n, power, rho, z):
    """Of the stream function r^power J_n(cos theta), J_n = (P_(n-2) - P_n)/(2 n - 1): along rho and z."""
    r = np.hypot(rho, z)
    cos, sin = z / r, rho / r
    outward = -r ** (power - 2) * legendre_of(n - 1, cos)
    around = power * r ** (power - 2) * (legendre_of(n - 2, cos) - legendre_of(n, cos)) / (2 * n - 1) / sin
    return outward * sin + around * cos, outward * cos - around * sin


def pull(gap, orders, points=400):
    """Force in mu a^2 rate of a shear flow, gap in radii; and the mean error of the velocity on the surface."""
    theta = np.pi * (np.arange(points) + 0.5) / points
    rho, height = np.sin(theta), 1 + gap / 2 + np.cos(theta)
    columns = []
    for n in range(2, orders + 2):
        for power in 1 - n, 3 - n:
            own, mirrored = velocity(n, power, rho, np.cos(theta)), velocity(n, power, rho, -height - 1 - gap / 2)
            columns.append(np.concatenate([own[0] + mirrored[0], own[1] - mirrored[1]]))
    weight = np.sqrt(np.tile(np.sin(theta), 2))
    matrix, target = np.array(columns).T * weight[:, None], np.concatenate([0.5 * rho, -height]) * weight
    scale = np.linalg.norm(matrix, axis=0)
    solution = np.linalg.lstsq(matrix / scale, target, rcond=1e-14)[0]
    return 2 * np.pi * abs(solution[1] / scale[1]), np.sqrt(np.mean((matrix / scale @ solution - target) ** 2))


if __name__ == "__main__":
    for gap in 0, 1e-3, 1e-2:
        for orders in 10, 20, 40:
            force, error = pull(gap, orders)
            print(f"gap {gap:5g}, {orders} orders: {force:.6f} = {force / np.pi:.6f} pi, velocity within {error:.0e}")
