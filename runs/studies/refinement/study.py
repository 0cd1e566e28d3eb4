#!/usr/bin/env python3
"""Cells where the bodies are: error against unknowns and CPU seconds. `study.py run [SCENE ...]` fills the rows of data.csv (but dkt), `study.py` draws figure.png."""
import csv
import json
import math
import resource
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent.parent
BOX = "cylinder-2d1.yaml -mesh_kind box -mesh_upper 2.2,0.41 -output_every 0 -couple_method"
CHANNEL = "cylinder-2d1.yaml -mesh_kind channel -output_every 0 -couple_method aligned -mesh_resolution"
ADAPTIVE = "cylinder-adaptive.yaml -output_every 0 -couple_method"
DISC = "sedimentation.yaml -couple_method penalty -sim_dt 0.005 -sim_time 0.2 -output_every 0"
ELLIPSE = "ellipse-shear.yaml -couple_method penalty -sim_time 4 -output_every 0"
SPHERE = "sphere-array.yaml -couple_method penalty -output_every 0"
CASES = [
    ("2d1", "refined", "44x8 + 2", f"{BOX} penalty -mesh_cells 44,8 -mesh_levels 2"),
    ("2d1", "refined", "44x8 + 3", f"{BOX} penalty -mesh_cells 44,8 -mesh_levels 3"),
    ("2d1", "refined", "44x8 + 3, band 2.6", f"{BOX} penalty -mesh_cells 44,8 -mesh_levels 3 -mesh_refine_distance 2.6"),
    ("2d1", "refined", "88x16 + 3", f"{BOX} penalty -mesh_cells 88,16 -mesh_levels 3"),
    ("2d1", "uniform", "88x16", f"{BOX} penalty -mesh_cells 88,16"),
    ("2d1", "uniform", "176x32", f"{BOX} penalty -mesh_cells 176,32"),
    ("2d1", "deformed", "88x16", f"{BOX} penalty -mesh_cells 88,16 -mesh_deform"),
    ("2d1", "adaptive", "22x4, to 12,000", f"{ADAPTIVE} penalty -mesh_levels 7 -mesh_adapt_unknowns 12000"),
    ("2d1", "adaptive", "22x4, to 30,000", f"{ADAPTIVE} penalty -mesh_levels 7 -mesh_adapt_unknowns 30000"),
    ("2d1-nodal", "refined", "44x8 + 2", f"{BOX} nodal -mesh_cells 44,8 -mesh_levels 2"),
    ("2d1-nodal", "refined", "44x8 + 3", f"{BOX} nodal -mesh_cells 44,8 -mesh_levels 3"),
    ("2d1-nodal", "uniform", "88x16", f"{BOX} nodal -mesh_cells 88,16"),
    ("2d1-nodal", "uniform", "176x32", f"{BOX} nodal -mesh_cells 176,32"),
    ("2d1-nodal", "deformed", "88x16", f"{BOX} nodal -mesh_cells 88,16 -mesh_deform"),
    ("2d1-aligned", "refined", "channel 5 + 1", f"{CHANNEL} 5 -mesh_levels 1"),
    ("2d1-aligned", "refined", "channel 5 + 2, band 2.8", f"{CHANNEL} 5 -mesh_levels 2 -mesh_growth 0.12,0.15 -mesh_refine_distance 2.8"),
    ("2d1-aligned", "uniform", "channel 10", f"{CHANNEL} 10"),
    ("2d1-aligned", "uniform", "channel 20", f"{CHANNEL} 20"),
    ("2d1-aligned", "adaptive", "22x4, to 11,000", f"{ADAPTIVE} aligned -mesh_adapt_unknowns 11000"),
    ("2d1-aligned", "adaptive", "22x4, to 14,000", f"{ADAPTIVE} aligned -mesh_adapt_unknowns 14000"),
    ("settling", "following", "8x24 + 3", f"{DISC} -mesh_cells 8,24 -mesh_levels 3 -mesh_track"),
    ("settling", "following", "8x24 + 4", f"{DISC} -mesh_cells 8,24 -mesh_levels 4 -mesh_track"),
    ("settling", "uniform", "32x96", f"{DISC} -mesh_cells 32,96"),
    ("settling", "uniform", "64x192", f"{DISC} -mesh_cells 64,192"),
    ("ellipse", "following", "16x8 + 2", f"{ELLIPSE} -mesh_cells 16,8 -mesh_levels 2 -mesh_track"),
    ("ellipse", "following", "16x8 + 3", f"{ELLIPSE} -mesh_cells 16,8 -mesh_levels 3 -mesh_track"),
    ("ellipse", "uniform", "64x32", f"{ELLIPSE} -mesh_cells 64,32"),
    ("ellipse", "uniform", "128x64", f"{ELLIPSE} -mesh_cells 128,64"),
    ("sphere", "refined", "6 + 1", f"{SPHERE} -mesh_cells 6,6,6 -mesh_levels 1 -mesh_refine_distance 1"),
    ("sphere", "uniform", "6", f"{SPHERE} -mesh_cells 6,6,6"),
    ("sphere", "uniform", "12", f"{SPHERE} -mesh_cells 12,12,12"),
]
REFERENCE = {
    "2d1": ("cD", 5.57953523384, "2D-1, penalty"),
    "2d1-nodal": ("cD", 5.57953523384, "2D-1, nodal"),
    "2d1-aligned": ("cD", 5.57953523384, "2D-1, aligned"),
    "settling": ("v(0.2)", 5.184, "settling disc, penalty"),
    "ellipse": ("slowest rate", 0.1788, "ellipse in shear, penalty"),
    "sphere": ("K", 2.8102, "array of spheres, penalty"),
}
MARKS = {"uniform": "s", "deformed": "D", "refined": "o", "adaptive": "^", "following": "o"}
FIELDS = ["scene", "cells of", "mesh", "cells", "unknowns", "value", "cpu"]


def read_value(scene, folder, quantities):
    """What the scene is compared by."""
    if scene.startswith("2d1"):
        return quantities["cd"]
    name, column = {"settling": ("bodies", "v"), "ellipse": ("bodies", "omega_z_rad_per_s"), "sphere": ("series", "mean_velocity_x")}[scene]
    with open(folder / f"{name}.csv", newline="") as table:
        rows = list(csv.DictReader(table))
    column = column if column in rows[0] else next(key for key in rows[0] if key.startswith("omega_z"))
    if scene == "settling":
        return -float(rows[-1][column])
    if scene == "ellipse":
        return -max(float(row[column]) for row in rows if float(row["time"]) >= 2)
    return 1 / (6 * math.pi * 0.2481402 * float(rows[-1][column]))


def run_case(scene, kind, mesh, words, folder):
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    file, *options = words.split()
    subprocess.run([ROOT / "build" / "tumble", ROOT / "runs" / file, *options, "-output_dir", folder, "-output_overwrite"], check=True, stdout=subprocess.DEVNULL)
    cpu = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    summary = json.loads((folder / "summary.json").read_text())
    value = read_value(scene, folder, summary["quantities"])
    return [scene, kind, mesh, summary["cells"], summary["unknowns"], f"{value:.6g}", f"{cpu:.2f}"]


def draw():
    import matplotlib
    import matplotlib.ticker

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    with open(HERE / "data.csv", newline="") as table:
        rows = [row for row in csv.DictReader(table) if row["scene"] in REFERENCE and row["cpu"]]
    figure, axes = plt.subplots(len(REFERENCE), 2, figsize=(8, 2.7 * len(REFERENCE)), constrained_layout=True)
    for i, (scene, (name, reference, title)) in enumerate(REFERENCE.items()):
        for k, (column, label) in enumerate((("unknowns", "unknowns"), ("cpu", "CPU seconds"))):
            for kind, mark in MARKS.items():
                mine = sorted((float(r[column]), 100 * abs(float(r["value"]) / reference - 1)) for r in rows if r["scene"] == scene and r["cells of"] == kind)
                if mine:
                    axes[i][k].loglog(*zip(*mine), mark + "-", label=kind)
            axes[i][k].set(xlabel=label, ylabel=f"error of {name} [%]", title=title)
            axes[i][k].xaxis.set_minor_formatter(matplotlib.ticker.NullFormatter())
            axes[i][k].legend()
    figure.savefig(HERE / "figure.png", dpi=110)


if sys.argv[1:2] == ["run"]:
    chosen = set(sys.argv[2:]) or set(REFERENCE)
    with open(HERE / "data.csv", newline="") as old:
        kept = [row for row in csv.reader(old) if row[0] not in chosen | {FIELDS[0]}]
    fresh = [run_case(*case, ROOT / "out" / "refinement" / f"{i}") for i, case in enumerate(CASES) if case[0] in chosen]
    with open(HERE / "data.csv", "w", newline="") as new:
        table = csv.writer(new, lineterminator="\n")
        table.writerow(FIELDS)
        table.writerows(fresh + kept)
draw()
