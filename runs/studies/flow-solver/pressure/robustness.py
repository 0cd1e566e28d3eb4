#!/usr/bin/env python3
"""Outer iterations of the coupled solve (rtol 1e-6) over time steps, viscosities, aspect ratios of the cells and levels of refinement.

A closed cavity [0, A] x [0, 1] of N x N cells (aspect ratio A), lid velocity 1 from rest; dt = CFL h with h = 1/N, the short edge of the cells.
A few steps each; the largest number of iterations counts, or the message of the failure. Prints, and writes with --save,
  nu x CFL at every aspect ratio (32 x 32 cells), and nu x CFL at every level (2 x 2 cells refined).

  runs/studies/flow-solver/pressure/robustness.py [--build build] [--part aspect|level] [--ratios 1 5 20] [--levels 1 2 3 4 5 6 7] [--bar 12] [--save FILE] [-flow_option value ...]
"""

import argparse
import csv
import itertools
import subprocess
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[3]
CFL = [0.01, 0.1, 1, 10, 50]
NU = [1e-6, 1e-4, 1e-2, 1, 100]
ASPECT = [1, 5, 20]
LEVEL = [1, 2, 3, 4, 5, 6, 7]
STEPS = 4
SCENE = """\
mesh: {cells: [2, 2], lower: [0, 0]}
flow: {density: 1, bc_top: {type: moving_wall, velocity: [1, 0]}}
output: {every: 0}
"""


def run(build, level, aspect, nu, cfl, options):
    """Iterations of the steps, and the message if one failed."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "cavity.yaml").write_text(SCENE)
        words = {"mesh_upper": f"{aspect},1", "dm_refine": level, "flow_viscosity": nu, "sim_dt": cfl / 2 ** (level + 1), "flow_ksp_rtol": 1e-6, "sim_steps": STEPS, "output_dir": "run"}
        command = [str(ROOT / build / "tumble"), "cavity.yaml", *(w for k, v in words.items() for w in (f"-{k}", str(v))), *options]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        its = []
        if (folder / "run/series.csv").exists():
            with open(folder / "run/series.csv") as file:
                its = [int(row["outer_iterations"]) for row in csv.DictReader(file)]
        message = "" if done.returncode == 0 else next((line for line in (done.stdout + done.stderr).splitlines() if "error:" in line), "no message")
        return its, message


def entry(row):
    return "stopped" if row["message"] else f"{row['largest']}"


def print_block(title, rows):
    print(f"\n{title}\n\n| nu \\ CFL | " + " | ".join(f"{c:g}" for c in CFL) + " |\n|" + " --- |" * (len(CFL) + 1))
    for nu in NU:
        print(f"| {nu:g} | " + " | ".join(entry(row) for cfl in CFL for row in rows if row["nu"] == nu and row["cfl"] == cfl) + " |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False)
    parser.add_argument("--build", default="build")
    parser.add_argument("--part", choices=["aspect", "level"], help="only this part")
    parser.add_argument("--save", metavar="FILE", help="write the rows there")
    parser.add_argument("--ratios", type=int, nargs="+", default=ASPECT)
    parser.add_argument("--levels", type=int, nargs="+", default=LEVEL)
    parser.add_argument("--bar", type=int, default=12)
    known, options = parser.parse_known_args()
    blocks = [("aspect", 4, a) for a in known.ratios if known.part != "level"] + [("level", level, 1) for level in known.levels if known.part != "aspect"]
    rows = []
    for part, level, aspect in blocks:
        block = []
        for nu, cfl in itertools.product(NU, CFL):
            its, message = run(known.build, level, aspect, nu, cfl, options)
            block.append({"part": part, "cells": 2 ** (level + 1), "aspect": aspect, "nu": nu, "cfl": cfl, "largest": max(its, default=-1), "its": " ".join(map(str, its)), "message": message})
        print_block(f"{2 ** (level + 1)} x {2 ** (level + 1)} cells, aspect ratio {aspect}", block)
        rows += block
    if known.save:
        with open(known.save, "w", newline="") as file:
            table = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            table.writeheader()
            table.writerows(rows)
    above = [row for row in rows if row["message"] or row["largest"] > known.bar]
    print(f"\n{len(rows)} combinations, {len(above)} with more than {known.bar} iterations or stopped")
    for row in above:
        print(f"  {row['cells']} cells, aspect {row['aspect']}, nu {row['nu']:g}, CFL {row['cfl']:g}: {row['its']} {row['message'][:160]}")


if __name__ == "__main__":
    main()
