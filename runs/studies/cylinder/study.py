#!/usr/bin/env python3
"""Convergence of the cylinder benchmarks in mesh and time step. Runs what is missing in out/studies/cylinder (or --keep FOLDER), writes
steady.csv, periodic.csv, pulsating.csv beside itself and prints them; figures.py draws them.

  runs/studies/cylinder/study.py steady             minutes
  runs/studies/cylinder/study.py periodic pulsating hours: each run is listed with its command by --list and can be started alone by --only NAME
"""

import argparse
import csv
import json
import math
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
sys.path.insert(0, str(ROOT / "tools"))

from toolbox import launcher, option_words, print_table, printable, read_numbers, run_scene  # noqa: E402

STEADY = {"cd": 5.57953523384, "cl": 0.010618948146, "dp": 0.11752016697}
PERIODIC = {"cd_max": 3.2274, "cl_max": 0.9866, "strouhal": 0.30184, "dp_half_period": 2.4829}
PULSATING = {"cd_max": 2.950921575, "cd_max_time": 3.93625, "cl_max": 0.47795, "cl_max_time": 5.693125, "dp(8)": -0.1116}


def steady_runs():
    for resolution, refine in ((4, 0), (8, 0), (16, 0), (16, 1), (16, 2)):
        yield f"fitted-{resolution << refine}", {"mesh_resolution": resolution, "dm_refine": refine}
    for resolution in (10, 20):
        for method in ("nodal", "penalty"):
            yield f"{method}-{resolution}", {"mesh_kind": "channel", "mesh_resolution": resolution, "couple_method": method}


CN = {"flow_time": "cn", "dm_refine": 0}
RAMP = {"flow_bc_left_ramp": 0.5}
TAIL = "fitted-24-tail"  # continues the run before it, beyond the extrema


def periodic_runs():
    """Developed with long steps from rest to t = 5, then continued with the steps that are compared."""
    yield "develop-24", {**CN, **RAMP, "mesh_resolution": 24, "flow_extrapolation": "linear", "sim_dt": 0.005, "sim_time": 5, "flow_ksp_rtol": "1e-6", "checkpoint_every": 500}
    for extrapolation, until, since in (("linear", 7.5, 6.5), ("quadratic", 7.2, 6.7)):
        yield f"fitted-24-0.0025-{extrapolation}", {
            **CN, **RAMP, "mesh_resolution": 24, "flow_extrapolation": extrapolation, "sim_dt": 0.0025, "sim_time": until, "monitor_from": since,
            "flow_ksp_rtol": "1e-7", "sim_restart": "develop-24/checkpoint_1000.h5",
        }  # fmt: skip


def pulsating_runs():
    runs = ((12, 0.005, "linear", 1e-5), (12, 0.005, "linear", 1e-8), (12, 0.0025, "linear", 1e-7), (12, 0.005, "quadratic", 1e-7))
    for resolution, dt, extrapolation, rtol in runs:
        yield f"fitted-{resolution}-{dt:g}-{extrapolation}-{rtol:g}", {
            **CN, "mesh_resolution": resolution, "flow_extrapolation": extrapolation, "sim_dt": dt, "sim_time": 8 + dt, "flow_ksp_rtol": f"{rtol:g}",
        }  # fmt: skip
    fine = {**CN, "mesh_resolution": 24, "flow_ksp_rtol": "1e-7"}
    yield "fitted-24-0.00167-linear-1e-07", {**fine, "flow_extrapolation": "linear", "sim_dt": f"{1 / 600:.15g}", "sim_time": 5.785, "checkpoint_every": 3471}
    yield TAIL, {**fine, "flow_extrapolation": "quadratic", "sim_dt": 0.005, "sim_time": 8.005, "sim_restart": "fitted-24-0.00167-linear-1e-07/checkpoint_3471.h5"}


STUDIES = {
    "steady": ("runs/cylinder-2d1.yaml", steady_runs, STEADY),
    "periodic": ("runs/cylinder-2d2.yaml", periodic_runs, PERIODIC),
    "pulsating": ("runs/cylinder-2d3.yaml", pulsating_runs, PULSATING),
}


def command_words(scene, options):
    return [*launcher(1), str(ROOT / "build" / "tumble"), scene, *option_words(options)]


def summary_of(scene, options, folder, run):
    """The summary of a run, done now if it is not there and `run`; None without."""
    path = folder / "summary.json"
    if path.is_file():
        return json.loads(path.read_text())
    if not run:
        return None
    print("running", folder.name, file=sys.stderr, flush=True)
    done = run_scene(scene, {**options, "output_every": 0}, 1, folder, cwd=ROOT)
    if done.summary is None:
        print(f"{folder.name}: {done.ended}: {done.message}", file=sys.stderr)
    return done.summary


def pressure_at(folder, time):
    """dp at a time, from the two lines around it or the last two; under cn a line holds the middle of its step."""
    rows = read_numbers(folder / "series.csv")
    middle = [row["time"] - 0.5 * row["dt"] for row in rows]
    i = min(max(1, sum(t < time for t in middle)), len(rows) - 1)
    if time - middle[i] > rows[i]["dt"]:
        return math.nan  # the run was ended before
    return rows[i]["dp"] + (rows[i]["dp"] - rows[i - 1]["dp"]) * (time - middle[i]) / (middle[i] - middle[i - 1])


def table(name, keep, run, only):
    scene, runs, reference = STUDIES[name]
    rows = []
    for label, options in runs():
        folder = keep / name / label
        if "sim_restart" in options:
            options = {**options, "sim_restart": str(keep / name / options["sim_restart"])}
        summary = summary_of(scene, options, folder, run and only in (None, label))
        if summary is None or label.startswith("develop"):
            continue
        q = summary["quantities"]
        if "dp(8)" in reference:
            q["dp(8)"] = pressure_at(folder, 8)
        found = {k: q[k] if label != TAIL or k == "dp(8)" else math.nan for k in reference}
        row = [f"{found[k]:.8g}" for k in reference] + [f"{found[k] - v:.2g}" for k, v in reference.items()]
        rows.append([label, summary["unknowns"], f"{options['sim_dt']:.3g}" if isinstance(options.get("sim_dt"), float) else options.get("sim_dt", "")[:7], *("" if cell == "nan" else cell for cell in row)])
    heading = ["run", "unknowns", "dt", *reference, *(f"{k} - reference" for k in reference)]
    with open(HERE / f"{name}.csv", "w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([heading, *rows, ["reference", "", "", *reference.values(), *("" for _ in reference)]])
    print_table(heading, rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("studies", nargs="+", choices=list(STUDIES))
    parser.add_argument("--keep", default=str(ROOT / "out" / "studies" / "cylinder"), metavar="FOLDER")
    parser.add_argument("--only", metavar="NAME", help="run this one only")
    parser.add_argument("--list", action="store_true", help="print the commands")
    parser.add_argument("--show", action="store_true", help="tables of the runs that are there")
    args = parser.parse_args()
    for name in args.studies:
        if args.list:
            for label, options in STUDIES[name][1]():
                print(f"{label}: {printable(command_words(STUDIES[name][0], options))}")
        else:
            table(name, Path(args.keep).resolve(), not args.show, args.only)


if __name__ == "__main__":
    main()
