"""Steady drag and lift of bodies held in a stream on four meshes, lined up with them and by the penalty: how thick must a boundary layer be in cells?

    python3 runs/studies/boundary/layer.py [build/tumble [WORD]]      # writes layer.csv; with WORD bodies with that in their names, rows of others stay

Cells: sqrt(d nu / U) / h by the size d that the presets go by (src/run/stream.h). Off: from the finest mesh, lined up.
"""
import csv
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
PROGRAM = sys.argv[1] if len(sys.argv) > 1 else str(HERE.parents[2] / "build" / "tumble")
SCENE = """\
mesh: {{cells: [30, 20], lower: [-2, -2], upper: [4, 2], levels: {levels}, refine: [bodies, near], refine_distance: 4,
       box_near: {{corners: [-0.8, -0.6, 1.6, 0.6], levels: {near}}}}}
flow: {{density: 1, viscosity: {viscosity}, solver: direct, bc_left: {{type: inflow, velocity: [1, 0]}}, bc_right: {{type: outflow}},
       bc_bottom: {{type: slip}}, bc_top: {{type: slip}}}}
particle: {{groups: s, s: {{{body}, position: [0.013, 0.021], free: none}}}}
couple: {{method: {method}}}
sim: {{steady: true}}
output: {{every: 0}}
"""
FLAG = "shape: composite, parts: [cyl, flag], cyl: {shape: circle, radius: 0.125}, flag: {shape: box, size: [0.75, WIDE], offset: [0.4, 0]}"
# name, size d, viscosity, body
BODIES = [
    ("cylinder with a thin flag", 0.25, 0.005, FLAG.replace("WIDE", "0.06")),
    ("cylinder with a thick flag", 0.25, 0.005, FLAG.replace("WIDE", "0.11")),
    ("ellipse along the stream", 1, 0.005, "shape: ellipse, a: 0.5, b: 0.125"),
    ("plate along the stream", 1, 0.005, "shape: box, size: [1, 0.1]"),
    ("airfoil along the stream", 0.81, 0.005, "shape: airfoil"),
    ("ellipse at 45 degrees", 0.25, 0.02, "shape: ellipse, a: 0.5, b: 0.125, angle: 45 deg"),
    ("ellipse across the stream", 0.25, 0.02, "shape: ellipse, a: 0.5, b: 0.125, angle: 90 deg"),
    ("plate at 30 degrees", 0.1, 0.02, "shape: box, size: [1, 0.1], angle: 30 deg"),
    ("plate across the stream", 0.1, 0.02, "shape: box, size: [0.1, 1]"),
    ("airfoil at 10 degrees", 0.12, 0.02, "shape: airfoil, angle: -10 deg"),
]


def solve(levels, method, viscosity, body):
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "scene.yaml"
        scene.write_text(SCENE.format(levels=levels, near=max(1, levels - 1), viscosity=viscosity, body=body, method=method))
        subprocess.run([PROGRAM, scene, "-monitor_accuracy", "false", "-output_dir", f"{folder}/out"], check=True, capture_output=True)
        row = list(csv.DictReader(open(f"{folder}/out/bodies.csv")))[-1]
        return float(row["force_x"]), float(row["force_y"])


def main():
    word = sys.argv[2] if len(sys.argv) > 2 else ""
    table = HERE / "layer.csv"
    before = list(csv.reader(table.open()))[1:] if word and table.exists() else []
    rows = []
    for name, size, viscosity, body in BODIES:
        if word not in name:
            rows += [row for row in before if row[0] == name]
            continue
        finest = solve(4, "aligned", viscosity, body)
        for levels in 1, 2, 3:
            for method in "aligned", "penalty":
                drag, lift = solve(levels, method, viscosity, body)
                off = [f"{100 * (drag / finest[0] - 1):+.3f}", f"{100 * (lift / finest[1] - 1):+.3f}" if abs(finest[1]) > 0.1 * finest[0] else ""]
                rows.append([name, f"{(size * viscosity) ** 0.5 * 2 ** levels / 0.2:.2f}", method, *off])
                print(*rows[-1], sep=" | ", flush=True)
    with table.open("w") as file:
        csv.writer(file, lineterminator="\n").writerows([["body", "cells", "method", "drag_off_percent", "lift_off_percent"], *rows])


if __name__ == "__main__":
    main()
