#!/usr/bin/python3
"""What a mesh that follows the body gives: the settling disc, its speed at 0.2 s and the noise of its acceleration over three places of the disc between the lines of the mesh.

usage: moving.py [--build build] [--read]; writes moving.csv and moving.png (with the mesh at the end) beside itself (--read: the figure from moving.csv, without the mesh).
"""
# Debian's interpreter by name: it has matplotlib
import argparse
import csv
import sys
import tempfile
from pathlib import Path

import h5py
import matplotlib
import numpy

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.collections import PolyCollection

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[2] / "tools"))
from toolbox import ROOT, children_seconds, run_scene  # noqa: E402

REFERENCE = ("aligned", 16, "no", 0)  # method, cells a diameter, deformed, shift
DIAMETER = 0.25
COLUMNS = "method,cells,deform,shift,speed,noise_percent,cpu_s,steps_s,area_least,area_largest,jacobian,ended".split(",")
WEIGHT = 0.25 / 1.25 * 981  # of the disc in the fluid over its mass


def measure(folder):
    """Speed at the end, and what the acceleration of the last half has beside a parabola, root mean square."""
    with open(Path(folder) / "bodies.csv", newline="") as file:
        rows = [(float(row["time"]), -float(row["v"])) for row in csv.DictReader(file)]
    t, v = numpy.array(rows).T
    a, middle = numpy.diff(v) / numpy.diff(t), 0.5 * (t[1:] + t[:-1])
    late = middle > 0.5 * t[-1]
    smooth = numpy.polyval(numpy.polyfit(middle[late], a[late], 2), middle[late])
    return v[-1], 100 * numpy.sqrt(numpy.mean((a[late] - smooth) ** 2)) / WEIGHT


def run(case, build, mesh=None):
    method, cells, deform, shift = case
    h = DIAMETER / cells
    options = {"mesh_cells": f"{8 * cells},{24 * cells}", "couple_method": method, "sim_dt": "0.005", "sim_time": "0.2", "output_every": "40",
               "particle_disc_position": f"{1 + shift * h / 3:.9f},{4 - shift * h / 3:.9f}", **({"mesh_deform": "true"} if deform == "yes" else {})}  # fmt: skip
    row = {**dict.fromkeys(COLUMNS, ""), "method": method, "cells": cells, "deform": deform, "shift": shift}
    with tempfile.TemporaryDirectory(prefix="tumble-moving-") as folder:
        before = children_seconds()
        done = run_scene("runs/sedimentation.yaml", options, 1, folder, build, cwd=ROOT)
        row["cpu_s"], row["ended"] = f"{children_seconds() - before:.1f}", done.ended
        if done.ended != "ok":
            return row
        out = next(Path(folder).rglob("bodies.csv")).parent
        speed, noise = measure(out)
        row["speed"], row["noise_percent"] = f"{speed:.5f}", f"{noise:.4f}"
        row["steps_s"] = f"{done.summary['seconds']['total'] - done.summary['seconds']['setup']:.1f}"
        if deform == "yes":
            with open(out / "series.csv", newline="") as file:
                series = list(csv.DictReader(file))
            row["area_least"], row["jacobian"] = (f"{min(float(r[name]) for r in series):.3f}" for name in ("deform_area_min", "deform_jacobian"))
            row["area_largest"] = f"{max(float(r['deform_area_max']) for r in series):.3f}"
        if mesh is not None:
            with h5py.File(next(out.glob("mesh*.h5"))) as file:
                mesh.append(file["coordinates"][:][:, :2][file["cells"][:][:, :4]])
    print(row, flush=True)
    return row


def draw(rows, mesh):
    figure, axes = plt.subplots(1, 3, figsize=(12, 4.6), constrained_layout=True)
    exact = next(float(row["speed"]) for row in rows if row["method"] == REFERENCE[0])
    kinds = list(dict.fromkeys((row["method"], row["deform"]) for row in rows if row["method"] != REFERENCE[0]))
    for method, deform in kinds:
        mine = [row for row in rows if (row["method"], row["deform"]) == (method, deform) and row["speed"]]
        label = method + (", follows" if deform == "yes" else "")
        style = ("o" if method == "nodal" else "s", None if deform == "yes" else "none")
        x = [float(row["cpu_s"]) for row in mine]
        axes[0].plot(x, [100 * (float(row["speed"]) / exact - 1) for row in mine], style[0], mfc=style[1], label=label)
        axes[1].loglog(x, [float(row["noise_percent"]) for row in mine], style[0], mfc=style[1], label=label)
    axes[0].axhline(0, color="0.8", lw=1)
    axes[0].set(xscale="log", xlabel="CPU time [s]", ylabel="error of the speed at 0.2 s [%]")
    axes[1].set(xlabel="CPU time [s]", ylabel="noise of the acceleration [% of the weight in the fluid]")
    axes[0].legend(fontsize=8)
    if mesh:
        axes[2].add_collection(PolyCollection(mesh[0], facecolors="none", edgecolors="k", lw=0.4))
        axes[2].set(xlim=(0.4, 1.6), ylim=(2.7, 4.1), aspect="equal", title="mesh at 0.2 s, 4 cells a diameter")
    figure.savefig(HERE / "moving.png", dpi=120)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default="build")
    parser.add_argument("--read", action="store_true")
    args = parser.parse_args()
    mesh = []
    if not args.read:
        cases = [(method, cells, deform, shift) for cells in (4, 8) for method in ("nodal", "penalty") for deform in ("no", "yes") for shift in range(3 if method == "nodal" else 1)]
        rows = [run(case, args.build, mesh if case == ("nodal", 4, "yes", 0) else None) for case in [*cases, REFERENCE]]
        with open(HERE / "moving.csv", "w", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
    with open(HERE / "moving.csv", newline="") as file:
        draw(list(csv.DictReader(file)), mesh)


if __name__ == "__main__":
    main()
