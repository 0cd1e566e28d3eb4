#!/usr/bin/env python3
"""What the solvers leave unsolved in a step, beside what the time step leaves out.

Lid-driven cavity at Re 100, N x N cells, bdf2, the lid starts smoothly over half a time unit; fields at t = 1 (the state is still changing) in the L2 norm of nodal
velocities and of cell pressures. For every solver and time step: the difference to the coupled solution to 1e-10 of the same step (error of the solver: for `fast`, of the splitting),
and the difference of that solution to the one of the smallest step / 4 (error of the step). Writes splitting.csv and prints a table.

  runs/studies/flow-solver/stopping/splitting.py [--cells 48] [--build build] [-flow_option value ...]
"""

import argparse
import csv
import json
import subprocess
import tempfile
from pathlib import Path

import h5py
import numpy

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[3]
STEPS = [0.04, 0.02, 0.01, 0.005]
SOLVERS = {"fast": [], "balanced": [], "accurate": []}
SCENE = """\
flow: {density: 1, viscosity: 0.01, time: bdf2, bc_top: {type: moving_wall, velocity: [1, 0], ramp: 0.5}}
"""


def solve(args, dt, options):
    """(velocity, pressure without its mean, mean outer iterations) at t = 1."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "cavity.yaml").write_text(SCENE)
        words = {"mesh_cells": f"{args.cells},{args.cells}", "sim_dt": dt, "sim_time": 1, "output_every": round(1 / dt), "output_dir": "run"}
        command = [str(ROOT / args.build / "tumble"), "cavity.yaml", *(w for k, v in words.items() for w in (f"-{k}", str(v))), *options]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode:
            print(f"dt {dt:g} {' '.join(options)}: {next((line for line in (done.stdout + done.stderr).splitlines() if 'error:' in line), 'failed')[:200]}")
            return None
        with h5py.File(folder / "run" / f"fields_{round(1 / dt)}.h5") as file:
            velocity, pressure = numpy.array(file["velocity"]), numpy.array(file["pressure_mean"])
        with open(folder / "run/series.csv") as file:
            its = [int(row["outer_iterations"]) for row in csv.DictReader(file)]
    return velocity, pressure - pressure.mean(), sum(its) / len(its)


def distance(a, b, reference):
    return float(numpy.linalg.norm(a - b) / numpy.linalg.norm(reference))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False)
    parser.add_argument("--build", default="build")
    parser.add_argument("--cells", type=int, default=48)
    args, options = parser.parse_known_args()
    tight = ["-flow_ksp_rtol", "1e-10"]
    limit = solve(args, STEPS[-1] / 4, tight)
    rows = []
    for dt in STEPS:
        exact = solve(args, dt, tight)
        row = {"dt": dt, "step_u": distance(exact[0], limit[0], limit[0]), "step_p": distance(exact[1], limit[1], limit[1])}
        for solver, extra in SOLVERS.items():
            found = solve(args, dt, ["-flow_solver", solver, *extra, *options])
            row |= {f"{solver}_{name}": distance(found[i], exact[i], limit[i]) if found else None for i, name in enumerate("up")}
            row[f"{solver}_its"] = found[2] if found else None
        rows.append(row)
        print(json.dumps(row), flush=True)
    if not options:
        with open(HERE / "splitting.csv", "w", newline="") as file:
            table = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            table.writeheader()
            table.writerows(rows)
    print("\n| dt | error of the step, u / p | " + " | ".join(f"{name}, u / p | its" for name in SOLVERS) + " |\n|" + " --- |" * (2 + 2 * len(SOLVERS)))
    for row in rows:
        cells = [f"{row['dt']:g}", f"{row['step_u']:.1e} / {row['step_p']:.1e}"]
        for name in SOLVERS:
            cells += [f"{row[f'{name}_u']:.1e} / {row[f'{name}_p']:.1e}", f"{row[f'{name}_its']:.1f}"] if row[f"{name}_u"] is not None else ["stopped", ""]
        print("| " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
