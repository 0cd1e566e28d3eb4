#!/usr/bin/python3
"""How fragments shrink with the shear stress: runs/studies/aggregates/run.py [--build build] writes fragments.csv and prints the fits.

Aggregates of tools/aggregate in aggregates.yaml; per dimension, seed and strength the mean size after a strain of 15: by number, and by mass.
"""
import argparse
import csv
import math
import os
import subprocess
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
DRAG = 6 * math.pi  # of a sphere of radius 1 a speed, viscosity 1
STRENGTHS = [20, 40, 80, 160, 320, 640]
GEOMETRY = {1.8: [1, 2], 2.4: [1, 2]}


def write_table(folder, dimension, seed):
    """The aggregate, turning with the flow."""
    subprocess.run([ROOT / "tools/aggregate", "200", "--dimension", str(dimension), "--seed", str(seed), "--gap", "0.002", "--output", folder / "raw.csv"], check=True)
    x = np.loadtxt(folder / "raw.csv", delimiter=",", skiprows=1)
    rows = [(*at, 0.5 * at[1], -0.5 * at[0], 0, -0.5) for at in x]
    (folder / "floc.csv").write_text("x,y,z,u,v,w,omega\n" + "\n".join(",".join(f"{v:.10g}" for v in row) for row in rows) + "\n")


def sizes(folder):
    """Mean size of fragments by number and by mass, from the bonds that hold."""
    rows = list(csv.DictReader(open(folder / "bonds.csv")))
    held = {(row["body"], row["partner"]) for row in rows if row["event"] == "start"} - {(row["body"], row["partner"]) for row in rows if row["event"] != "start"}
    root = list(range(200))

    def find(k):
        while root[k] != k:
            k = root[k]
        return k

    for i, j in held:
        root[find(int(i))] = find(int(j))
    count = np.bincount([find(k) for k in range(200)], minlength=200)
    count = count[count > 0]
    return count.mean(), (count**2).sum() / 200, count.max()


def run(build, dimension, seed, strength, scene="aggregates.yaml"):
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_table(folder, dimension, seed)
        (folder / scene).write_text((HERE / scene).read_text())
        subprocess.run([build / "tumble", scene, "-output_dir", "out", "-contact_bond_tension", str(strength)], cwd=folder, check=True, stdout=subprocess.DEVNULL)
        return dimension, seed, strength, DRAG / strength, *sizes(folder / "out")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=Path, default=ROOT / "build")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--output", type=Path, default=HERE / "fragments.csv")
    options = parser.parse_args()
    os.environ["OMP_NUM_THREADS"] = "1"
    cases = [(dimension, seed, strength) for dimension, seeds in GEOMETRY.items() for seed in seeds for strength in STRENGTHS]
    with open(options.output, "w") as file, ThreadPoolExecutor(options.jobs) as pool:
        file.write("dimension,seed,strength,stress_over_strength,mean_by_number,mean_by_mass,largest\n")
        rows = []
        for row in pool.map(lambda case: run(options.build.resolve(), *case), cases):
            rows.append(row)
            file.write(",".join(f"{value:.6g}" for value in row) + "\n")
            file.flush()
    table = np.array(rows)
    for dimension in GEOMETRY:
        mine = table[(table[:, 0] == dimension) & (table[:, 4] > 2) & (table[:, 4] < 100)]
        by_number, by_mass = (np.polyfit(np.log(mine[:, 3]), np.log(mine[:, k]), 1)[0] for k in (4, 5))
        print(f"D {dimension}: mean size ~ (stress/strength)^{by_number:.3f} by number, ^{by_mass:.3f} by mass; chains without interaction {-dimension / (dimension + 1):.3f}")


if __name__ == "__main__":
    main()
