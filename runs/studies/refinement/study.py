#!/usr/bin/env python3
"""Cells where the bodies are: error against unknowns and CPU seconds. `study.py run` fills data.csv (but for dkt), `study.py` draws figure.png."""
import csv
import json
import resource
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent.parent
CYLINDER = "cylinder-2d1.yaml -mesh_kind box -mesh_upper 2.2,0.41 -couple_boundary penalty"
DISC = "sedimentation.yaml -couple_boundary penalty -sim_dt 0.005 -sim_time 0.2 -output_every 0"
CASES = [
    ("2d1", "refined", "44x8 + 2", f"{CYLINDER} -mesh_cells 44,8 -mesh_levels 2"),
    ("2d1", "refined", "44x8 + 3", f"{CYLINDER} -mesh_cells 44,8 -mesh_levels 3"),
    ("2d1", "refined", "88x16 + 3", f"{CYLINDER} -mesh_cells 88,16 -mesh_levels 3"),
    ("2d1", "uniform", "88x16", f"{CYLINDER} -mesh_cells 88,16"),
    ("2d1", "uniform", "176x32", f"{CYLINDER} -mesh_cells 176,32"),
    ("settling", "following", "8x24 + 3", f"{DISC} -mesh_cells 8,24 -mesh_levels 3 -mesh_follow"),
    ("settling", "following", "8x24 + 4", f"{DISC} -mesh_cells 8,24 -mesh_levels 4 -mesh_follow"),
    ("settling", "uniform", "32x96", f"{DISC} -mesh_cells 32,96"),
    ("settling", "uniform", "64x192", f"{DISC} -mesh_cells 64,192"),
]
REFERENCE = {"2d1": ("cD", 5.57953523384), "settling": ("v(0.2)", 5.184)}
FIELDS = ["scene", "cells of", "mesh", "cells", "unknowns", "value", "cpu"]


def run_case(scene, kind, mesh, words, folder):
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    file, *options = words.split()
    subprocess.run([ROOT / "build" / "tumble", ROOT / "runs" / file, *options, "-output_dir", folder, "-output_overwrite"], check=True, stdout=subprocess.DEVNULL)
    cpu = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    summary = json.loads((folder / "summary.json").read_text())
    if scene == "2d1":
        value = summary["quantities"]["cd"]
    else:
        with open(folder / "bodies.csv", newline="") as table:
            value = -float(list(csv.DictReader(table))[-1]["v"])
    return [scene, kind, mesh, summary["cells"], summary["unknowns"], f"{value:.6g}", f"{cpu:.2f}"]


def draw():
    import matplotlib
    import matplotlib.ticker

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    with open(HERE / "data.csv", newline="") as table:
        rows = [row for row in csv.DictReader(table) if row["scene"] in REFERENCE and row["cpu"]]
    figure, axes = plt.subplots(2, 2, figsize=(8, 6), constrained_layout=True)
    for i, (scene, (name, reference)) in enumerate(REFERENCE.items()):
        for k, (column, label) in enumerate((("unknowns", "unknowns"), ("cpu", "CPU seconds"))):
            for kind, mark in (("uniform", "s"), ("refined", "o"), ("following", "o")):
                mine = sorted((float(r[column]), 100 * abs(float(r["value"]) / reference - 1)) for r in rows if r["scene"] == scene and r["cells of"] == kind)
                if mine:
                    axes[i][k].loglog(*zip(*mine), mark + "-", label=kind)
            axes[i][k].set(xlabel=label, ylabel=f"error of {name} [%]", title=scene)
            axes[i][k].xaxis.set_minor_formatter(matplotlib.ticker.NullFormatter())
            axes[i][k].legend()
    figure.savefig(HERE / "figure.png", dpi=110)


if sys.argv[1:] == ["run"]:
    with open(HERE / "data.csv", newline="") as old:
        kept = [row for row in csv.reader(old) if row[0] == "dkt"]
    with open(HERE / "data.csv", "w", newline="") as new:
        table = csv.writer(new, lineterminator="\n")
        table.writerow(FIELDS)
        table.writerows(run_case(*case, ROOT / "out" / "refinement" / f"{i}") for i, case in enumerate(CASES))
        table.writerows(kept)
draw()
