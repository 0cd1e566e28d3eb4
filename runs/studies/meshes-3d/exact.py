"""Force on a sphere (radius 1) in the middle of a container (radius 2) that is set into motion by one step of implicit Euler, or oscillates.

With du/dt = c u the step is Brinkman's equation, k^2 = c/nu: stream function sin^2(theta) F(r)/2, F = A r^2 + B/r + G(r), G the two
solutions of G'' - 2 G/r^2 = k^2 G; F = r^2, F' = 2 r at r = 1, F = F' = 0 at r = 2. Force = 4/3 pi density c (1 - 3/2 B).
One step from rest has c = 1/dt: dt -> infinity gives the steady drag (7.29412 of Stokes'), dt -> 0 the added mass 5/7 of the displaced
fluid. An oscillation (Stokes 1851) has c = i omega; what bdf2 makes of it with steps dt is the same with c = (3 - 4 z + z^2)/(2 dt),
z = exp(-i omega dt): a solution that is exact in space with the error of the step in it.

exact.py step dt...                          prints dt, force for viscosity, density and speed 1
exact.py oscillation omega n [bodies.csv v]  drag over Stokes' (in phase with the velocity v sin(omega t)) and added mass over the displaced
                                             fluid: exact, with n steps a period, and of the last period of a run, off %"""
import csv
import sys

import numpy as np

STOKES, DISPLACED = 6 * np.pi, 4 / 3 * np.pi


def parts(r, k):
    x = k * (r - 2)
    return [r * r, 1 / r, np.cosh(x) - np.sinh(x) / (k * r), np.sinh(x) - np.cosh(x) / (k * r)]


def slopes(r, k):
    x, s = k * (r - 2), k * r * r
    return [2 * r, -1 / r**2, k * np.sinh(x) - np.cosh(x) / r + np.sinh(x) / s, k * np.cosh(x) - np.sinh(x) / r + np.cosh(x) / s]


def force(c):
    k = np.sqrt(c)
    b = np.linalg.solve(np.array([parts(1, k), slopes(1, k), parts(2, k), slopes(2, k)]), [1, 2, 0, 0])[1]
    return DISPLACED * c * (1 - 1.5 * b)


def of_run(file, omega, n, speed):
    with open(file) as lines:
        rows = list(csv.DictReader(lines))[-n:]
    t, f = (np.array([float(row[name]) for row in rows]) for name in ("time", "force_z"))
    return np.linalg.lstsq(np.array([np.sin(omega * t), np.cos(omega * t)]).T, f / speed, rcond=None)[0] @ [1, 1j]


def oscillation(omega, n, *run):
    dt = 2 * np.pi / (omega * n)
    z = np.exp(-1j * omega * dt)
    steps = force((3 - 4 * z + z * z) / (2 * dt))
    values = {"exact": force(1j * omega), "exact in space": steps}
    if run:
        values["run"] = of_run(run[0], omega, n, float(run[1]))
    for name, f in values.items():
        print(f"{name:15} drag {-f.real / STOKES:.5f} added mass {-f.imag / omega / DISPLACED:.5f}")
    if run:
        f = values["run"]
        print(f"run, off % of exact in space: drag {100 * (f.real / steps.real - 1):+.3f} added mass {100 * (f.imag / steps.imag - 1):+.3f} "
              f"size of the force {100 * (abs(f / steps) - 1):+.3f} whole {100 * abs(f / steps - 1):.3f}")


if sys.argv[1] == "step":
    for text in sys.argv[2:]:
        print(text, force(1 / float(text)))
else:
    oscillation(float(sys.argv[2]), int(sys.argv[3]), *sys.argv[4:])
