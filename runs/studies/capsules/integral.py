#!/usr/bin/env python3
"""Deformation of a neo-Hookean capsule in unbounded shear by a boundary integral of its own, to compare with the program.

    python3 runs/studies/capsules/integral.py NUMBER [LEVEL [STEP [TIME [LAW]]]]      # capillary number by the surface Young modulus

LAW neo-hookean: W = G/2 (I1 - 1 + 1/(I2 + 1)), or zero-thickness: G/2 (I1 - log(I2 + 1) + log(I2 + 1)^2/2), stiffer
where the area grows; both have the surface Young modulus 3 G. I1 = tr C - 2, I2 = det C - 1.

Stokes flow, the same fluid on both sides: u = (y, 0, 0) + int (1/r + r r/r^3) f dS / 8 pi, f the load of the membrane (Pozrikidis 1992).
Flat triangles (an icosahedron, each side divided LEVEL times), f linear in each, from the forces of the nodes through the mass matrix;
six points a triangle, radial coordinates where a node is a corner. Midpoint rule, explicit: STEP at most .125 NUMBER at level 3.
The volume is kept by scaling. Printed: time, (a - c)/(a + c) of the ellipsoid with the second moments and by the radii, the least
principal tension over the Young modulus, the largest stretch, the volume that was lost before scaling.
"""
import sys

import numpy as np

POINTS = np.array([np.roll([1 - 2 * a, a, a], k) for a in (0.445948490915965, 0.091576213509771) for k in range(3)])
WEIGHTS = np.repeat([0.223381589678011, 0.109951743655322], 3)
GAUSS, GAUSS_WEIGHT = (a / 2 for a in np.polynomial.legendre.leggauss(5))
RADIAL = np.array([(1 - r, r * (1 - s), r * s) for r in GAUSS + 0.5 for s in GAUSS + 0.5])
RADIAL_WEIGHT = np.array([2 * w * v * r for r, w in zip(GAUSS + 0.5, GAUSS_WEIGHT) for v in GAUSS_WEIGHT])
NODES_AT_ONCE = 64
LAWS = {"neo-hookean": lambda det: -1 / det, "zero-thickness": lambda det: np.log(det) - 1} # S = G (1 + law C^-1)


def sphere(level):
    """Nodes and triangles, normals outwards; the volume that of a sphere of radius 1."""
    golden = (1 + 5**0.5) / 2
    nodes = [np.roll([0, a, b * golden], k) for k in range(3) for a in (-1, 1) for b in (-1, 1)]
    near = [[j for j in range(12) if 0 < np.linalg.norm(nodes[i] - nodes[j]) < 2.1] for i in range(12)]
    faces = [(i, j, k) for i in range(12) for j in near[i] for k in near[j] if i < j < k and k in near[i]]
    nodes = [x / np.linalg.norm(x) for x in nodes]
    faces = [f if np.linalg.det([nodes[i] for i in f]) > 0 else f[::-1] for f in faces]
    for _ in range(level):
        middle = {}
        for a, b, c in faces:
            for side in ((a, b), (b, c), (c, a)):
                if tuple(sorted(side)) not in middle:
                    middle[tuple(sorted(side))] = len(nodes)
                    x = nodes[side[0]] + nodes[side[1]]
                    nodes.append(x / np.linalg.norm(x))
        faces = [f for a, b, c in faces for ab, bc, ca in [[middle[tuple(sorted(s))] for s in ((a, b), (b, c), (c, a))]]
                 for f in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))]
    x, t = np.array(nodes), np.array(faces)
    return x * (4 * np.pi / 3 / volumes(x, t).sum()) ** (1 / 3), t


def volumes(x, t):
    return np.einsum("ti,ti->t", x[t[:, 0]], np.cross(x[t[:, 1]], x[t[:, 2]])) / 6


def areas(x, t):
    return np.linalg.norm(np.cross(x[t[:, 1]] - x[t[:, 0]], x[t[:, 2]] - x[t[:, 0]]), axis=1) / 2


def stokeslet(r, f):
    """(1/r + r r/r^3) f"""
    inverse = 1 / np.sqrt(np.einsum("...i,...i", r, r))
    return f * inverse[..., None] + r * (np.einsum("...i,...i", r, f) * inverse**3)[..., None]


class Capsule:
    def __init__(self, number, level, law="neo-hookean"):
        self.modulus, self.law = 1 / (3 * number), LAWS[law]
        self.x, self.t = x, t = sphere(level)
        self.area = areas(x, t)
        a, b = x[t[:, 1]] - x[t[:, 0]], x[t[:, 2]] - x[t[:, 0]]
        length = np.linalg.norm(a, axis=1)
        frame = np.zeros((len(t), 2, 2))
        frame[:, 0, 0], frame[:, 0, 1], frame[:, 1, 1] = length, (a * b).sum(1) / length, 2 * self.area / length
        self.inverse = np.linalg.inv(frame)

    def gradient(self, x):
        return np.stack([x[self.t[:, k]] - x[self.t[:, 0]] for k in (1, 2)], axis=2) @ self.inverse

    def load(self, x):
        """Force per area at the nodes."""
        t, F = self.t, self.gradient(x)
        C = np.swapaxes(F, 1, 2) @ F
        S = self.modulus * (np.eye(2) + self.law(np.linalg.det(C))[:, None, None] * np.linalg.inv(C))
        pull = -self.area[:, None, None] * (F @ S @ np.swapaxes(self.inverse, 1, 2))
        force, mass, area = np.zeros_like(x), np.zeros((len(x), len(x))), areas(x, t)
        for k, of_corner in enumerate((-pull.sum(2), pull[:, :, 0], pull[:, :, 1])):
            np.add.at(force, t[:, k], of_corner)
            for m in range(3):
                np.add.at(mass, (t[:, k], t[:, m]), area / (6 if k == m else 12))
        return np.linalg.solve(mass, force)

    def induced(self, x, f):
        """Velocity at the nodes that the load f brings."""
        t, area, u = self.t, areas(x, self.t), np.zeros_like(x)
        at = np.einsum("qk,tki->tqi", POINTS, x[t]).reshape(-1, 3)
        source = (np.einsum("qk,tki->tqi", POINTS, f[t]) * (area[:, None] * WEIGHTS)[..., None]).reshape(-1, 3)
        for i in range(0, len(x), NODES_AT_ONCE):
            u[i:i + NODES_AT_ONCE] = stokeslet(x[i:i + NODES_AT_ONCE, None] - at, source[None]).sum(1)
        for k in range(3): # where the node is a corner: radial points instead
            for points, weights, sign in ((POINTS, WEIGHTS, -1), (RADIAL, RADIAL_WEIGHT, 1)):
                corners = np.roll(t, -k, axis=1)
                r = x[t[:, k]][:, None] - np.einsum("qk,tki->tqi", points, x[corners])
                part = stokeslet(r, np.einsum("qk,tki->tqi", points, f[corners]))
                np.add.at(u, t[:, k], sign * area[:, None] * np.einsum("q,tqi->ti", weights, part))
        return u / (8 * np.pi)

    def velocity(self, x):
        u = self.induced(x, self.load(x))
        u[:, 0] += x[:, 1]
        return u

    def step(self, dt):
        """Returns the volume before it is scaled, over that of the sphere."""
        self.x = self.x + dt * self.velocity(self.x + dt / 2 * self.velocity(self.x))
        volume = volumes(self.x, self.t).sum() / (4 * np.pi / 3)
        self.x *= volume ** (-1 / 3)
        return volume

    def measure(self):
        x, t, v = self.x, self.t, volumes(self.x, self.t)
        corners = [x[t[:, k]] for k in range(3)]
        second = sum(np.einsum("t,ti,tj->ij", v / 20, y, y) for y in corners + [sum(corners)])
        axes, radii = np.sqrt(np.linalg.eigvalsh(second)), np.linalg.norm(x, axis=1)
        F = self.gradient(x)
        stretch = np.sqrt(np.linalg.eigvalsh(np.swapaxes(F, 1, 2) @ F))
        J = stretch.prod(1)
        taylor = [(max(a) - min(a)) / (max(a) + min(a)) for a in (axes, radii)]
        return *taylor, ((stretch[:, 0] ** 2 + self.law(J**2)) / J).min() / 3, stretch.max()


def main():
    number, level, step, time, law = sys.argv[1:] + ["0.2", "2", "0.04", "4", "neo-hookean"][len(sys.argv) - 1:]
    capsule, lost, step, time = Capsule(float(number), int(level), law), 0.0, float(step), float(time)
    every, steps = max(1, round(0.2 / step)), round(time / step)
    for n in range(1, steps + 1):
        lost += 1 - capsule.step(step)
        if n % every == 0 or n == steps:
            print("%6.3f  D %.4f, by radii %.4f  tension %8.4f  stretch %.3f  volume lost %.1e" % (n * step, *capsule.measure(), lost), flush=True)


if __name__ == "__main__":
    main()
