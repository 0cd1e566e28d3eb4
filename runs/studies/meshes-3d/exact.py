"""Force on a sphere (radius 1) that is set into motion in the middle of a container (radius 2) by one step of implicit Euler.

With c = 1/dt the step is Brinkman's equation, k^2 = c/nu: stream function sin^2(theta) F(r)/2, F = A r^2 + B/r + G(r), G the two
solutions of G'' - 2 G/r^2 = k^2 G; F = r^2, F' = 2 r at r = 1, F = F' = 0 at r = 2. Force = 4/3 pi density c (1 - 3/2 B):
dt -> infinity gives the steady drag (7.29412 of Stokes'), dt -> 0 the added mass 5/7 of the displaced fluid.

exact.py dt...  prints dt, force for viscosity, density and speed 1."""
import sys

import numpy as np


def parts(r, k):
    return np.array([r * r, 1 / r, np.cosh(k * (r - 2)) - np.sinh(k * (r - 2)) / (k * r), np.sinh(k * (r - 2)) - np.cosh(k * (r - 2)) / (k * r)])


def force(dt):
    k = dt**-0.5

    def slope(r, h=1e-6):
        return (parts(r + h, k) - parts(r - h, k)) / (2 * h)

    b = np.linalg.solve(np.array([parts(1, k), slope(1), parts(2, k), slope(2)]), [1, 2, 0, 0])[1]
    return 4 / 3 * np.pi / dt * (1 - 1.5 * b)


for text in sys.argv[1:]:
    print(text, force(float(text)))
