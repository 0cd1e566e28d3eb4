#!/usr/bin/python3
"""Speed and power of a spherical squirmer with inertia, steady and axisymmetric: a spectral solution to compare with.

  inertia.py [Re ...]      Re = rho a (2 B1/3)/mu; prints U/(2 B1/3) and power/(mu a B1^2) for B2/B1 = -3, -1, 0, 1, 3

In the frame of the body u = curl curl (r Phi), Phi and the azimuthal vorticity in Legendre modes; log r by Chebyshev collocation to r = OUTER,
where what the body does to the flow ends. The speed is that without force.
"""

import sys

import numpy as np
from numpy.polynomial import legendre

OUTER, RADIAL, MODES = 100.0, 64, 9


def differentiate(n, length):
    """Chebyshev points on 0 to length and the matrix that differentiates there."""
    k = np.arange(n + 1)
    x = -np.cos(np.pi * k / n)
    c = np.where((k == 0) | (k == n), 2.0, 1.0) * (-1.0) ** k
    d = x[:, None] - x[None, :] + np.eye(n + 1)
    D = np.outer(c, 1 / c) / d
    D -= np.diag(D.sum(axis=1))
    return (x + 1) * length / 2, D * 2 / length


class Squirmer:
    def __init__(self, modes=MODES, radial=RADIAL, outer=OUTER):
        self.n = np.arange(1, modes + 1)
        s, D = differentiate(radial, np.log(outer))
        self.r = np.exp(s)
        self.D = D / self.r[:, None]  # d/dr
        self.x, self.weight = legendre.leggauss(3 * modes)
        sine = np.sqrt(1 - self.x**2)
        self.P = np.array([legendre.legval(self.x, np.eye(modes + 2)[k]) for k in self.n])
        self.V = np.array([-sine * legendre.legval(self.x, legendre.legder(np.eye(modes + 2)[k])) for k in self.n])  # dP/dtheta
        self.W = np.array([-k * (k + 1) * p for k, p in zip(self.n, self.P)]) - self.x / sine * self.V  # d2P/dtheta2
        self.sine = sine
        self.L = [self.laplace(k) for k in self.n]
        each = np.eye(modes * (radial + 1)).reshape(-1, modes, radial + 1)
        self.basis = [np.array(f) for f in zip(*((*self.velocity(v), v.T @ self.V) for v in each))]
        zero = 0 * each[0]
        self.load = np.array([self.force(v, zero, 0)[0] for v in each] + [self.force(zero, v, 0)[0] for v in each])

    def laplace(self, k):
        return self.D @ self.D + 2 * self.D / self.r[:, None] - np.diag(k * (k + 1) / self.r**2)

    def velocity(self, phi):
        """u_r, u_theta [radial][theta]"""
        rows = self.n * (self.n + 1)
        return (phi / self.r[None, :] * rows[:, None]).T @ self.P, (np.array([self.D @ (self.r * p) / self.r for p in phi])).T @ self.V

    def curls(self, fields, others):
        """Modes of curl (u x omega), azimuthal, u of the one (u_r, u_theta, omega) and omega of the other; any number of flows"""
        ur, ut, w = fields[0], fields[1], others[2]
        norm = 2 * self.n * (self.n + 1) / (2 * self.n + 1)
        polar = np.einsum("kq,...rq->...kr", self.V * self.weight / norm[:, None], -ur * w)  # of V
        radial = np.einsum("kq,...rq->...kr", self.P * self.weight * ((2 * self.n + 1) / 2)[:, None], ut * w)  # of P, whose d/dtheta is V
        return (polar * self.r) @ self.D.T / self.r - radial / self.r

    def force(self, phi, w, reynolds):
        """Along the axis over the surface, of stress; mu = a = 1. And shear stress times slip."""
        ut = self.velocity(phi)[1]
        ur_r = (self.n * (self.n + 1) * np.array([(self.D @ (p / self.r))[0] for p in phi])) @ self.P
        ut_r = np.array([(self.D @ (self.D @ (self.r * p) / self.r))[0] for p in phi]) @ self.V
        curl = np.array([(self.D @ (self.r * m))[0] for m in w]) @ self.V
        ut_theta = np.array([(self.D @ (self.r * p) / self.r)[0] for p in phi]) @ self.W
        p_theta = curl - reynolds * ut[0] * ut_theta
        shear = ut_r - ut[0]
        # -int p cos sin dtheta = 1/2 int p_theta sin^2 dtheta
        return 2 * np.pi * np.sum(self.weight * (0.5 * p_theta * self.sine + 2 * ur_r * self.x - shear * self.sine)), shear * ut[0]

    def equations(self, slips):
        """Of phi, vorticity w and the speed, without inertia: L phi = w, L w = 0; no force. At the surface phi is 0 and u_theta the slip, outside
        the fluid passes with the speed and has no vorticity."""
        modes, size = len(self.n), len(self.r)
        half = modes * size
        A, b, one = np.zeros((2 * half + 1, 2 * half + 1)), np.zeros(2 * half + 1), np.eye(size)
        for k, L in enumerate(self.L):
            at = slice(k * size, (k + 1) * size)
            of_w = slice(half + at.start, half + at.stop)
            A[at, at], A[at, of_w], A[of_w, of_w] = L, -one, L
            A[[at.start, at.stop - 1, of_w.start, of_w.stop - 1]] = 0
            A[at.start, at], A[at.stop - 1, at], A[of_w.start, at], A[of_w.stop - 1, of_w] = one[0], one[-1], self.D[0], one[-1]
            b[of_w.start] = -slips[k]
        A[size - 1, -1] = self.r[-1] / 2  # phi_1 = -U r/2
        A[-1, :-1] = self.load
        return A, b

    def swim(self, beta, reynolds):
        """Speed over 2 B1/3, power over mu a B1^2; B1 = 3/2, so that the speed is about 1. Newton's method."""
        modes, size = len(self.n), len(self.r)
        slips = np.zeros(modes)
        slips[0], slips[1] = 1.5, 1.5 * beta / 3  # of -dP_n/dtheta: B_n 2/(n (n + 1))
        half = modes * size
        equations, b = self.equations(slips)
        phi = -slips[:, None] * (self.r - 1)
        b[-1] = self.force(phi, 0 * phi, 0)[0] - self.force(phi, 0 * phi, reynolds)[0]  # its inertial part goes by the slip alone
        rows = np.array([k * size + i for k in range(modes) for i in range(1, size - 1)])
        inner = half + rows
        x = np.linalg.solve(equations, b)
        for sweep in range(20 if reynolds else 0):
            phi, w = x[:-1].reshape(2, modes, size)
            here = [f[None] for f in (*self.velocity(phi), w.T @ self.V)]
            A, f = equations.copy(), b.copy()
            A[inner, :half] += reynolds * self.curls(self.basis, here).reshape(half, half).T[rows]
            A[inner, half:-1] += reynolds * self.curls(here, self.basis).reshape(half, half).T[rows]
            f[inner] += reynolds * self.curls(here, here).reshape(-1)[rows]
            last, x = x, np.linalg.solve(A, f)
            if abs(x[-1] - last[-1]) < 1e-10:
                break
        phi, w = x[:-1].reshape(2, modes, size)
        return x[-1], -2 * np.pi * np.sum(self.weight * self.force(phi, w, reynolds)[1]) / 1.5**2


def main():
    flow = Squirmer()
    betas = (-3, -1, 0, 1, 3)
    for reynolds in [float(a) for a in sys.argv[1:]] or (0.01, 0.1, 0.3, 1.0):
        row = [flow.swim(beta, reynolds) for beta in betas]
        print(f"Re {reynolds:g}:", ", ".join(f"{beta:g}: {u:.5f} {p:.3f}" for beta, (u, p) in zip(betas, row)))


if __name__ == "__main__":
    main()
