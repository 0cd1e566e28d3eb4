#!/usr/bin/env python3
"""Drag on an ellipse held broadside on in a channel that moves past it, on meshes around the ellipse, and the speed at which drag balances weight.

  runs/studies/ellipse-speed/study.py [--build build]    writes drag.csv and balance.csv beside this file and prints the table of README.md (a minute)
"""

import argparse
import csv
import math
import subprocess
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent.parent
WIDTH, CENTRE, A, B = 0.4, (0.2, 0.6), 0.05, 0.025
WEIGHT = 0.1 * 981 * math.pi * A * B  # density difference 0.1
BOUNDARIES = ["left", "right", "bottom", "top", "ellipse"]
SPEEDS = (1.25, 1.29)
# cells across the channel, cells from ellipse to wall, length of the channel, outward shift of the surface
MESHES = [(8, 8, 1.6, 0), (16, 14, 1.6, 0), (24, 20, 1.6, 0), (32, 26, 1.6, 0), (24, 20, 2.4, 0), (24, 20, 1.6, 5e-4), (24, 20, 1.6, 1e-3), (24, 20, 1.6, 1.5e-3)]

SCENE = """\
mesh: {{kind: file, file: {mesh}}}
flow:
  density: 1
  viscosity: 0.01
  bc_left: &wall {{type: moving_wall, velocity: [0, {speed}]}}
  bc_right: *wall
  bc_bottom: {{type: inflow, velocity: [0, {speed}]}}
  bc_top: {{type: outflow}}
particle:
  groups: ellipse
  ellipse: {{shape: ellipse, a: {a}, b: {b}, position: [{x}, {y}], free: none}}
sim: {{steady: true}}
"""


class Mesh:
    """Quadrilaterals in Gmsh's format: a ring from the ellipse to a square as wide as the channel, and a block below and above it."""

    def __init__(self, n, m, length, shift):
        self.points, self.cells, self.edges = {}, [], {name: [] for name in BOUNDARIES}
        self.ring(n, m, A + shift, B + shift)
        self.block(n, 0, CENTRE[1] - WIDTH / 2, "bottom")
        self.block(n, CENTRE[1] + WIDTH / 2, length, "top")

    def node(self, x, y):
        return self.points.setdefault((round(x, 10), round(y, 10)), len(self.points) + 1)

    def ring(self, n, m, a, b):
        half, (x, y) = WIDTH / 2, CENTRE
        side = [-half + WIDTH * i / n for i in range(n)]
        square = [(s, -half) for s in side] + [(half, s) for s in side] + [(-s, half) for s in side] + [(-half, -s) for s in side]
        steps = [6 ** (j / (m - 1)) for j in range(m)]  # the outermost layer is six times as thick as the innermost
        depth = [sum(steps[:j]) / sum(steps) for j in range(m + 1)]
        rows = []
        for t in depth:
            rows.append([])
            for u, v in square:
                angle = math.atan2(v, u)
                rows[-1].append(self.node(x + (1 - t) * a * math.cos(angle) + t * u, y + (1 - t) * b * math.sin(angle) + t * v))
        for inner, outer in zip(rows, rows[1:]):
            self.cells += [(inner[i - 1], outer[i - 1], outer[i], inner[i]) for i in range(4 * n)]
        self.edges["ellipse"] += [(rows[0][i - 1], rows[0][i]) for i in range(4 * n)]
        for name, start in (("right", n), ("left", 3 * n)):
            self.edges[name] += [(rows[m][i], rows[m][(i + 1) % (4 * n)]) for i in range(start, start + n)]

    def block(self, n, low, high, end):
        m = round(n * (high - low) / WIDTH)
        rows = [[self.node(WIDTH * i / n, low + (high - low) * j / m) for i in range(n + 1)] for j in range(m + 1)]
        for one, two in zip(rows, rows[1:]):
            self.cells += [(one[i], one[i + 1], two[i + 1], two[i]) for i in range(n)]
            self.edges["left"].append((one[0], two[0]))
            self.edges["right"].append((one[n], two[n]))
        self.edges[end] += list(zip(rows[0 if end == "bottom" else -1], rows[0 if end == "bottom" else -1][1:]))

    def write(self, path):
        elements = [(1, k + 1, edge) for k, name in enumerate(BOUNDARIES) for edge in self.edges[name]] + [(3, 9, cell) for cell in self.cells]
        lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(BOUNDARIES) + 1)]
        lines += [f'1 {k + 1} "{name}"' for k, name in enumerate(BOUNDARIES)] + ['2 9 "fluid"', "$EndPhysicalNames", "$Nodes", str(len(self.points))]
        lines += [f"{k} {x} {y} 0" for (x, y), k in self.points.items()] + ["$EndNodes", "$Elements", str(len(elements))]
        lines += [f"{k + 1} {kind} 2 {tag} {tag} " + " ".join(map(str, nodes)) for k, (kind, tag, nodes) in enumerate(elements)]
        path.write_text("\n".join([*lines, "$EndElements", ""]))


def drag(folder, shift, speed, build):
    scene = folder / "ellipse.yaml"
    scene.write_text(SCENE.format(mesh=folder / "ellipse.msh", speed=speed, a=A + shift, b=B + shift, x=CENTRE[0], y=CENTRE[1]))
    program = [str(ROOT / build / "tumble"), str(scene), "-output_dir", str(folder / "out"), "-output_overwrite"]
    subprocess.run(program, check=True, capture_output=True, cwd=ROOT)
    with open(folder / "out" / "bodies.csv") as file:
        return float(list(csv.DictReader(file))[-1]["force_y"])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False)
    parser.add_argument("--build", default="build", metavar="FOLDER", help="where the program is (default: %(default)s)")
    args = parser.parse_args()
    forces, balances = [], []
    with tempfile.TemporaryDirectory() as name:
        for n, m, length, shift in MESHES:
            mesh = Mesh(n, m, length, shift)
            mesh.write(Path(name) / "ellipse.msh")
            force = [drag(Path(name), shift, speed, args.build) for speed in SPEEDS]
            forces += [[n, m, length, shift, speed, f] for speed, f in zip(SPEEDS, force)]
            speed = SPEEDS[0] + (SPEEDS[1] - SPEEDS[0]) * (WEIGHT - force[0]) / (force[1] - force[0])
            balances.append([n, len(mesh.cells), length, shift, round(speed, 5), round(10 * speed, 3)])
            print("| " + " | ".join(map(str, balances[-1])) + " |", flush=True)
    for name, heading, rows in (("drag.csv", "across,radial,length,shift,speed,drag", forces), ("balance.csv", "across,cells,length,shift,speed,reynolds", balances)):
        with open(HERE / name, "w", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([heading.split(","), *rows])


if __name__ == "__main__":
    main()
