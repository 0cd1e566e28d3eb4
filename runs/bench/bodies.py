#!/usr/bin/env python3
"""What bodies cost: the method's own table, and the bodies alone.

  runs/bench/bodies.py alone                     10^3 .. 10^6 discs without a flow (bodies-only.yaml)
  runs/bench/bodies.py bonds                     the same discs, each bonded to its neighbours, a bond that a step resolves; without contact
  runs/bench/bodies.py flow                      NSE, Force, Particle, Total with 0 .. 10,000 discs on three meshes (bodies.yaml)
  runs/bench/bodies.py flow --cells 13924 --bodies 0,1000
  runs/bench/bodies.py --show                    the rows of bodies.csv as tables

Each run appends one line to bodies.csv. Times are medians over the steps after the first four; cpu_s is the processor time of a step (difference of two runs of different
length, output included, which other programs on the machine disturb less; empty where it is too small to tell). At 30 % area fraction each for 10,000 discs, 1000 and fewer discs have the radius of 1000.
"""

import argparse
import csv
import os
import statistics
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1] / "tools"))
from toolbox import append_row, check_columns, children_seconds, machine_name, print_table, run_scene  # noqa: E402

RESULTS = HERE / "bodies.csv"
COLUMNS = "case,commit,machine,load,cells,unknowns,bodies,search,steps,nse_s,force_s,particle_s,total_s,cpu_s,outer_mean,memory_mb,bytes_per_body".split(",")
SKIP = 4
ALONE = [1000, 10_000, 100_000, 1_000_000]
SIDES = [118, 235, 470]
COUNTS = [0, 10, 1000, 10_000]


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False)
    parser.add_argument("what", nargs="?", choices=["alone", "bonds", "flow"], help="which table")
    parser.add_argument("--bodies", metavar="N[,N]", help="these numbers of bodies")
    parser.add_argument("--cells", metavar="N[,N]", help="these meshes (flow; default: %s)" % ",".join(str(n * n) for n in SIDES))
    parser.add_argument("--steps", type=int, default=12, metavar="N", help="steps of a run, at least 9 (default: %(default)s)")
    parser.add_argument("--show", action="store_true", help="print the tables of bodies.csv and stop")
    parser.add_argument("--build", default="build", metavar="FOLDER", help="where the program is (default: %(default)s)")
    return parser, parser.parse_args()


def numbers(text, default):
    return [int(word) for word in text.split(",")] if text else default


def run_timed(scene, options, build, folder):
    """The run, and the processor seconds of its processes."""
    before = children_seconds()
    run = run_scene(scene, options, 1, folder, build)
    if not run.summary:
        sys.exit(f"bodies.py: {run.ended}: {run.message}")
    return run, children_seconds() - before


def measure(case, scene, options, steps, args):
    """One row."""
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory(prefix="tumble-bodies-") as folder:
        common = {**options, "output_every": "0"}
        short, cpu_short = run_timed(scene, {**common, "sim_steps": SKIP}, args.build, folder)
        run, cpu = run_timed(scene, {**common, "sim_steps": steps}, args.build, folder)
        rows = run.series()[SKIP:]
    summary = run.summary
    return {
        "case": case,
        "commit": summary["commit"],
        "machine": machine_name(),
        "load": f"{load:.2f}",
        "cells": summary["cells"],
        "unknowns": summary["unknowns"],
        "bodies": summary["bodies"],
        "search": "cells",  # the other one, all against all, is gone
        "steps": len(rows),
        **{f"{key}_s": f"{statistics.median(row[f'seconds_{key}'] for row in rows):.4g}" for key in ("nse", "force", "particle")},
        "total_s": f"{statistics.median(row['seconds'] for row in rows):.4g}",
        "cpu_s": f"{(cpu - cpu_short) / (steps - SKIP):.4g}" if cpu - cpu_short > 0.02 else "",
        "outer_mean": f"{statistics.mean(row['outer_iterations'] for row in rows):.3g}",
        "memory_mb": f"{summary['memory_mb']:.0f}",
    }


def bed_options(count):
    """60 % packing, all lattice neighbours within the range of contact, one sub-step a step."""
    return {"particle_bed_count": count, "particle_bed_radius": 0.43702 / count**0.5, "contact_range": 0.13 / count**0.5, "sim_dt": 1e-4 / count**0.5}


def bond_options(count):
    """In place of contact: two bonds a disc, stiffness dt^2/mass .4, bending alike."""
    options = {**bed_options(count), "contact_law": "none", "contact_bond_law": "spring", "contact_bond_stiffness": 2.4e7}
    return {**options, "contact_bond_bending": 2.3e6 / count, "contact_bond_gap": options["contact_range"]}


def disc_options(count, side):
    return {"mesh_cells": f"{side},{side}", "particle_bed_count": count, "particle_bed_radius": 0.309 / max(count, 1000) ** 0.5}


def run_alone(args):
    base, options = None, bed_options if args.what == "alone" else bond_options
    for count in numbers(args.bodies, ALONE):
        row = measure(args.what, HERE / "bodies-only.yaml", options(count), args.steps, args)
        if base is None:
            base = float(row["memory_mb"])  # of the program, nearly
        else:
            row["bytes_per_body"] = f"{(float(row['memory_mb']) - base) * 2**20 / count:.0f}"
        finish(row)


def run_flow(args):
    for cells in numbers(args.cells, [side * side for side in SIDES]):
        side = round(cells**0.5)
        for count in numbers(args.bodies, COUNTS):
            if 2 * 0.309 / max(count, 1000) ** 0.5 * side < 1.5:
                print(f"{count} discs on {cells} cells: a disc would cover too few nodes, left out")
                continue
            finish(measure("flow", HERE / "bodies.yaml", disc_options(count, side), args.steps, args))


def finish(row):
    append_row(RESULTS, COLUMNS, row)
    print(" ".join(f"{name}={row.get(name, '')}" for name in COLUMNS if name not in ("machine", "commit")), flush=True)


def show():
    with open(RESULTS, newline="") as file:
        rows = list(csv.DictReader(file))
    alone = "commit,load,bodies,search,particle_s,cpu_s,memory_mb,bytes_per_body"
    for case, names in (("alone", alone), ("bonds", alone), ("flow", "commit,load,cells,bodies,search,nse_s,force_s,particle_s,total_s,cpu_s,outer_mean")):
        chosen = [row for row in rows if row["case"] == case]
        if chosen:
            print(f"\n{case}\n")
            print_table(names.split(","), [[row[name] for name in names.split(",")] for row in chosen])


def main():
    parser, args = parse_arguments()
    if args.show:
        show()
        return
    if not args.what:
        parser.error("which table: alone, bonds or flow?")
    if args.steps < SKIP + 5:
        parser.error(f"--steps {args.steps}: at least {SKIP + 5}")
    check_columns(RESULTS, COLUMNS)
    (run_flow if args.what == "flow" else run_alone)(args)


if __name__ == "__main__":
    main()
