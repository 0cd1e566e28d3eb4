#!/usr/bin/env python3
"""A vesicle in unbounded shear in the plane, by a boundary integral of its own, to compare with the program.

    /usr/bin/python3 runs/studies/capsules/vesicle.py A B BENDING RATIO [NODES [STEP [TIME]]]

The membrane has the length and area of an ellipse of half axes A, B, cannot be stretched anywhere, and bends; the fluid inside is RATIO times as
viscous. Stokes flow at rate and viscosity 1 (Pozrikidis 1992): (1 + RATIO)/2 u = (y, 0) + int G f ds/(4 pi) + (1 - RATIO) int u T n ds/(4 pi), f
the membrane's force, bending and tension; the tension is what keeps x_s . u_s = 0. Trigonometric polynomials through an odd number of NODES,
logarithms integrated exactly (Kress 1991), midpoint rule, bending implicit. Printed: time, inclination and (a - b)/(a + b) of the ellipse with
the second moments, mean rate at which the skin goes round (2 pi mean tangential velocity over the length), area and length over those at the start.

    vesicle.py ellipse A B RATIO        # Keller & Skalak (1982) for the ellipse in the plane, in closed form
    vesicle.py check                    # a circle without membrane in strain: rate 2/(1 + RATIO)

Keller & Skalak: the shape stays, the skin moves with nu (-a/b y, b/a x) in its axes, nu = -rate cos(2 angle) a b/(a^2 - b^2)/(1 + g (RATIO - 1)),
g = (a^2 + b^2)/(a + b)^2 (what the flow does on the skin is lost inside), and the angle changes by
-1/2 + cos(2 angle) (a^2 - b^2)/(a^2 + b^2)/2 - nu 2 a b/(a^2 + b^2). With RATIO 1 the angle is atan(b/a).
"""
import sys

import numpy as np


def derivative(n):
    """Of trigonometric polynomials through n (odd) nodes"""
    k = np.arange(n)
    d = k[:, None] - k[None, :]
    with np.errstate(divide="ignore"):
        return np.where(d == 0, 0, 0.5 * (-1.0) ** d / np.sin(np.where(d == 0, 1, d * np.pi / n)))


class Curve:
    """Operators on a closed curve, counter-clockwise: D by arc length, single layer S, double layer T, on values (x of all, y of all)"""

    def __init__(self, x, D):
        n = x.shape[1]
        h = 2 * np.pi / n
        xt = x @ D.T
        self.speed = np.hypot(*xt)
        self.t = xt / self.speed
        self.n = np.array([self.t[1], -self.t[0]])
        self.D = D / self.speed[:, None]
        curvature = -np.sum(self.n * (self.t @ self.D.T), axis=0)
        self.ds = h * self.speed
        r = x[:, None, :] - x[:, :, None]  # from the point in question
        r2 = np.sum(r * r, axis=0)
        k = np.arange(n)
        away = k[:, None] != k[None, :]
        sine = np.where(away, 4 * np.sin((k[:, None] - k[None, :]) * np.pi / n) ** 2, 1)
        m = np.arange(1, (n - 1) // 2 + 1)
        kress = -2 * h * np.cos(np.outer(2 * np.pi * k / n, m)) @ (1 / m)
        safe = np.where(away, r2, 1)
        log = 0.5 * kress[np.abs(k[:, None] - k[None, :])] + 0.5 * h * np.log(np.where(away, safe / sine, self.speed**2))
        S, T = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, 2 * n))
        rn = np.sum(r * self.n[:, None, :], axis=0)
        for a in range(2):
            for b in range(2):
                rr = np.where(away, r[a] * r[b] / safe, (self.t[a] * self.t[b])[None, :])
                S[a * n : (a + 1) * n, b * n : (b + 1) * n] = (h * rr - (a == b) * log) * self.speed / (4 * np.pi)
                ratio = np.where(away, rn / safe, (0.5 * curvature)[None, :])
                T[a * n : (a + 1) * n, b * n : (b + 1) * n] = -rr * ratio * self.ds / np.pi
        self.S, self.T = S, T


def both(M):
    return np.kron(np.eye(2), M)


def velocity(x, D, bending, ratio, implicit, about, membrane=True, far=lambda x: np.array([x[1], 0 * x[1]])):
    """u at the nodes x; the bending force is that at about + implicit u"""
    n, c = x.shape[1], Curve(x, D)
    A = 0.5 * (1 + ratio) * np.eye(2 * n) - (1 - ratio) * c.T
    if not membrane:
        return np.linalg.solve(A, far(x).ravel()).reshape(2, n)
    D4 = both(np.linalg.matrix_power(c.D, 4))
    stretch = np.hstack([np.diag(c.t[0]), np.diag(c.t[1])]) @ both(c.D)
    pull = both(c.D) @ np.vstack([np.diag(c.t[0]), np.diag(c.t[1])])
    M = np.block([[A + bending * implicit * c.S @ D4, -c.S @ pull], [stretch, np.zeros((n, n))]])
    b = np.concatenate([far(x).ravel() - bending * c.S @ D4 @ about.ravel(), np.zeros(n)])
    return np.linalg.lstsq(M, b, rcond=1e-12)[0][: 2 * n].reshape(2, n)


def ellipse(a, b, n):
    """n nodes at equal distances along it"""
    fine = 20000
    p = 2 * np.pi * np.arange(fine + 1) / fine
    s = np.concatenate([[0], np.cumsum(np.hypot(a * np.diff(np.cos(p)), b * np.diff(np.sin(p))))])
    p = np.interp(np.arange(n) / n * s[-1], s, p)
    return np.array([a * np.cos(p), b * np.sin(p)])


def measure(x, D):
    """Inclination, deformation, area, length"""
    c = Curve(x, D)
    area = 0.5 * np.sum(c.ds * np.sum(x * c.n, axis=0))
    centre = np.array([np.sum(c.ds * 0.5 * x[a] ** 2 * c.n[a]) for a in range(2)]) / area
    y = x - centre[:, None]
    xx, yy = (np.sum(c.ds * y[a] ** 3 / 3 * c.n[a]) for a in range(2))
    xy = np.sum(c.ds * 0.5 * y[0] ** 2 * y[1] * c.n[0])
    root = np.hypot(0.5 * (xx - yy), xy)
    long, short = np.sqrt(0.5 * (xx + yy) + root), np.sqrt(0.5 * (xx + yy) - root)
    return 0.5 * np.arctan2(2 * xy, xx - yy), (long - short) / (long + short), area, np.sum(c.ds)


def run(a, b, bending, ratio, n=65, dt=0.02, time=8):
    D = derivative(n)
    x = ellipse(a, b, n)
    first = measure(x, D)
    print(f"reduced area {4 * np.pi * first[2] / first[3] ** 2:.4f}")
    for step in range(int(round(time / dt))):
        middle = x + 0.5 * dt * velocity(x, D, bending, ratio, 0.5 * dt, x)
        u = velocity(middle, D, bending, ratio, 0.5 * dt, x)
        x = x + dt * u
        if (step + 1) % max(1, int(round(0.5 / dt))) == 0:
            angle, taylor, area, length = measure(x, D)
            c = Curve(middle, D)
            round_ = 2 * np.pi * np.sum(c.ds * np.sum(c.t * u, axis=0)) / np.sum(c.ds) ** 2
            print(f"{(step + 1) * dt:6.2f} {angle:9.5f} {taylor:9.5f} {round_:9.5f} {area / first[2] - 1:10.2e} {length / first[3] - 1:10.2e}", flush=True)


def keller_skalak(a, b, ratio):
    """Angle (None: it tumbles) and rate of the skin"""
    g = (a * a + b * b) / (a + b) ** 2
    softness = a * b / (a * a - b * b) / (1 + g * (ratio - 1))
    B = (a * a - b * b) / (a * a + b * b) / 2 + softness * 2 * a * b / (a * a + b * b)
    if 2 * B < 1:
        return None, None
    return 0.5 * np.arccos(0.5 / B), -0.5 / B * softness


def check():
    D = derivative(33)
    for ratio in (0.2, 1, 7):
        x = ellipse(1, 1, 33)
        u = velocity(x, D, 0, ratio, 0, x, membrane=False, far=lambda x: np.array([x[0], -x[1]]))
        print(ratio, np.max(np.abs(u - 2 / (1 + ratio) * np.array([x[0], -x[1]]))))


if __name__ == "__main__":
    if sys.argv[1:] == ["check"]:
        check()
    elif sys.argv[1:2] == ["ellipse"]:
        print(*keller_skalak(*map(float, sys.argv[2:5])))
    else:
        values = [float(v) for v in sys.argv[1:]]
        run(*values[:4], *(int(v) for v in values[4:5]), *values[5:])
