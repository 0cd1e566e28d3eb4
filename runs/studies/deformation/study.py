#!/usr/bin/python3
"""What a mesh that is concentrated at the body gives the nodal method: 2D-1 at 10 cells a diameter over random shifts of the mesh.

usage: study.py [--shifts 10] [--build build] [--read]; writes data.csv and figure.png beside itself (--read: the figure from data.csv).
"""
# Debian's interpreter by name: it has matplotlib
import argparse
import csv
import re
import sys
import tempfile
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[2] / "tools"))
from toolbox import ROOT, children_seconds, run_scene  # noqa: E402

CD = 5.57953523384  # reference of the benchmark
OPTIONS = {"mesh_kind": "channel", "mesh_resolution": "10", "couple_method": "nodal", "flow_snes_rtol": "1e-6", "output_every": "0"}
SIZES = ["none", "0.4", "0.35", "0.3"]  # -mesh_deform_size; the width is the default, the radius
COLUMNS = "size,shift,cd_error,cpu_s,area_least,area_largest,jacobian,ended".split(",")


def run(size, shift, build):
    options = {**OPTIONS, "mesh_shift_seed": str(shift), **({} if size == "none" else {"mesh_deform": "true", "mesh_deform_size": size})}
    with tempfile.TemporaryDirectory(prefix="tumble-deformation-") as folder:
        before = children_seconds()
        done = run_scene("runs/cylinder-2d1.yaml", options, 1, folder, build, cwd=ROOT)
    row = {**dict.fromkeys(COLUMNS, ""), "size": size, "shift": shift, "cpu_s": f"{children_seconds() - before:.2f}", "ended": done.ended}
    if done.ended == "ok":
        row["cd_error"] = f"{done.summary['quantities']['cd'] / CD - 1:.5f}"
        if found := re.search(r"sizes of cells (\S+) to (\S+) of the wanted ones, smallest Jacobian (\S+)", done.out):
            row["area_least"], row["area_largest"], row["jacobian"] = found.groups()
    return row


def draw(rows):
    figure, axes = plt.subplots(figsize=(6, 3.5), constrained_layout=True)
    sizes = list(dict.fromkeys(row["size"] for row in rows))
    for i, size in enumerate(sizes):
        errors = [100 * float(row["cd_error"]) for row in rows if row["size"] == size and row["cd_error"]]
        axes.plot([i] * len(errors), errors, "o", ms=5, mfc="none")
        axes.annotate(f"worst {max(map(abs, errors)):.2f}", (i, max(errors)), xytext=(12, 0), textcoords="offset points", fontsize=8)
    axes.axhline(0, color="0.8", lw=1)
    axes.set_xticks(range(len(sizes)), ["regular" if size == "none" else f"size {size}" for size in sizes])
    axes.set(ylabel="error of cD [%]", title="2D-1, method nodal, 10 cells a diameter, shifts of the mesh", xlim=(-0.5, len(sizes) - 0.2))
    figure.savefig(HERE / "figure.png", dpi=120)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shifts", type=int, default=10)
    parser.add_argument("--build", default="build")
    parser.add_argument("--read", action="store_true")
    args = parser.parse_args()
    if not args.read:
        rows = [run(size, shift, args.build) for size in SIZES for shift in range(1, args.shifts + 1)]
        with open(HERE / "data.csv", "w", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
    with open(HERE / "data.csv", newline="") as file:
        draw(list(csv.DictReader(file)))


if __name__ == "__main__":
    main()
