#!/usr/bin/env python3
"""Solver fast around moving bodies: how far from the step solved whole after so many outer iterations, and at what cost.

usage: study.py [SCENE ...] [--repeats 3] [--build build] [--single BUILD] [--work out/fast]; writes data.csv beside itself and prints the table.
Deviation: largest difference of a body's velocity from the run solved to 1e-10, as share of the largest speed. Cost: processor seconds of a step without the first one, medians of runs in turn (of a fixed number of iterations: one run).
--single: build folder of a version whose solver fast is the single projection sweep (0.2 and before).
"""
import argparse
import csv
import statistics
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[2] / "tools"))
from toolbox import ROOT, children_seconds, print_table, read_numbers, read_options, run_scene  # noqa: E402

RISING = "-particle_disc_position 1,1"
SCENES = {
    "settling disc, 8 cells, CFL 1.8": ("sedimentation", "-sim_time 0.4"),
    "settling disc, 8 cells, CFL 0.9": ("sedimentation", "-sim_dt 0.005 -sim_time 0.3"),
    "settling disc, 6 cells, CFL 1.3": ("sedimentation", "-mesh_cells 48,144 -sim_time 0.4"),
    "settling disc, 6 cells, CFL 0.6": ("sedimentation", "-mesh_cells 48,144 -sim_dt 0.005 -sim_time 0.3"),
    "two discs to before the kiss, 8 cells": ("dkt", "-sim_time 0.12"),
    "light disc, density 0.1": ("sedimentation", f"-mesh_cells 48,144 -sim_dt 0.005 -sim_time 0.1 -particle_disc_density 0.1 {RISING}"),
    "light disc, density 0.001": ("sedimentation", f"-mesh_cells 48,144 -sim_dt 0.002 -sim_time 0.04 -particle_disc_density 0.001 {RISING}"),
    "heavy disc, density 10": ("sedimentation", "-mesh_cells 48,144 -sim_dt 0.002 -sim_time 0.06 -particle_disc_density 10"),
    "heavy and small balls": ("heavy-balls", "-sim_steps 30 -couple_method penalty -flow_ksp_rtol 1e-8"),
    "light and heavy, CFL 3": ("light-and-heavy", "-sim_time 0.12"),
}
EXACTLY = "-flow_solver fast -flow_rtol_start 1 -flow_min_it "
SOLVERS = {"1 iteration": EXACTLY + "1", "fast": "-flow_solver fast", "3 iterations": EXACTLY + "3", "balanced": "-flow_solver balanced"}
ONCE = "1 iteration", "3 iterations"
WHOLE = "-flow_solver balanced -flow_ksp_rtol 1e-10 -flow_rtol_start 0"
COLUMNS = ["scene", "solver", "steps", "iterations", "deviation", "ms_a_step", "ended"]


def run(scene, options, folder, build):
    """The run, its folder, its processor seconds."""
    name, own = SCENES[scene]
    before = children_seconds()
    done = run_scene(ROOT / "runs" / f"{name}.yaml", read_options(f"{own} -output_every 0") | read_options(options), 1, folder, build)
    return done, children_seconds() - before


def velocities(folder):
    """{body: {step: (u, v)}}"""
    found = {}
    for row in read_numbers(folder / "bodies.csv"):
        found.setdefault(row["body"], {})[row["step"]] = row["u"], row["v"]
    return found


def deviation(mine, right):
    worst = 0.0
    size = max(abs(u) for steps in right.values() for both in steps.values() for u in both)
    for body, steps in right.items():
        worst = max([worst] + [abs(a - b) for step in mine[body].keys() & steps.keys() for a, b in zip(mine[body][step], steps[step])])
    return worst / size


def study(scene, args):
    solvers = {name: (options, args.build) for name, options in SOLVERS.items()}
    if args.single:
        solvers = {"single sweep": ("-flow_solver fast", args.single)} | solvers
    folder = args.work / scene.replace(" ", "-").replace(",", "")
    whole, _ = run(scene, WHOLE, folder / "whole", args.build)
    right = velocities(whole.folder)
    seconds, results = {name: [] for name in solvers}, {}
    for turn in range(args.repeats):
        for name, (options, build) in solvers.items():
            if turn and name in ONCE:
                continue
            _, start = run(scene, f"{options} -sim_steps 1", folder / "start", build)
            done, spent = run(scene, options, folder / name, build)
            results[name] = done
            seconds[name].append((spent - start) / (len(read_numbers(done.folder / "series.csv")) - 1))
    for name, done in results.items():
        series = read_numbers(done.folder / "series.csv")
        iterations = sum(row["outer_iterations"] for row in series) / len(series)
        cost = 1e3 * statistics.median(seconds[name])
        ended = "" if done.ended == "ok" else f"{done.ended} in step {len(series) + 1}"
        yield [scene, name, len(series), f"{iterations:.1f}", f"{deviation(velocities(done.folder), right):.1e}", f"{cost:.1f}", ended]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="beginnings of names (default: all)")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--build", default="build")
    parser.add_argument("--single", metavar="BUILD")
    parser.add_argument("--work", type=Path, default=ROOT / "out" / "fast")
    args = parser.parse_args()
    rows = []
    for scene in SCENES:
        if not args.scenes or scene.startswith(tuple(args.scenes)):
            rows += study(scene, args)
            print_table(COLUMNS, rows)
            sys.stdout.flush()
    if not args.scenes:
        with open(HERE / "data.csv", "w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerows([COLUMNS, *rows])


if __name__ == "__main__":
    main()
