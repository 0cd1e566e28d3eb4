"""Dipole of a sphere that conducts, under penalty: python3 runs/studies/scalars/dipole.py [cells a diameter ...] prints what it is off, in
per cent, for conductivities .001, .1, 10, 1000 of the fluid's (notes.md, "Spheres").

A sphere in a uniform gradient, exact values x (1 - b a^3/r^3), b = (k - 1)/(k + 2), on the sides of a cube of 4 radii; the strength b by
least squares between 1.15 and 1.9 radii."""

import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parents[3]
A, PLACE = 0.5, np.array([0.013, 0.007, 0.01])
SQUARE = "(" + "+".join(f"({axis}-{at})^2" for axis, at in zip("xyz", PLACE)) + ")"
SCENE = f"""mesh: {{cells: [N, N, N], lower: [-1, -1, -1], upper: [1, 1, 1]}}
flow: {{density: 1, viscosity: 1}}
scalars: heat
scalar: {{heat: {{conductivity: 1, bc: {{left: &far {{value: "(x-{PLACE[0]})*(1-STRENGTH*{A**3}/({SQUARE}*sqrt({SQUARE})))"}},
  right: *far, bottom: *far, top: *far, front: *far, back: *far}}}}}}
particle: {{groups: ball, ball: {{shape: circle, radius: {A}, position: {list(map(float, PLACE))}, free: none, heat: {{conductivity: RATIO}}}}}}
couple: {{method: penalty}}
sim: {{steady: true}}
output: {{every: 1}}
"""


def measure(build, cells, ratio):
    """By how much of it the dipole is off"""
    strength = (ratio - 1) / (ratio + 2)
    with tempfile.TemporaryDirectory() as folder:
        scene, out = Path(folder) / "scene.yaml", Path(folder) / "out"
        scene.write_text(SCENE.replace("N,", f"{2 * cells},").replace("N]", f"{2 * cells}]").replace("STRENGTH", repr(strength)).replace("RATIO", repr(ratio)))
        subprocess.run([Path(build) / "tumble", scene, "-output_dir", out], check=True, stdout=subprocess.DEVNULL)
        with h5py.File(next(out.glob("mesh*.h5"))) as mesh, h5py.File(out / "fields_1.h5") as fields:
            x, T = mesh["coordinates"][:] - PLACE, np.ravel(fields["heat"][:])
    r = np.linalg.norm(x, axis=1)
    near = (r > 1.15 * A) & (r < 1.9 * A)
    dipole = -A**3 * x[near, 0] / r[near]**3
    return np.dot(dipole, T[near] - x[near, 0]) / np.dot(dipole, dipole) / strength - 1


def main():
    for cells in map(int, sys.argv[1:] or ["8", "10"]):
        print(cells, *(f"{100 * measure(ROOT / 'build', cells, ratio):.2f}" for ratio in (0.001, 0.1, 10, 1000)))


if __name__ == "__main__":
    main()
