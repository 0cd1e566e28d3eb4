"""Run the benchmarks of runs/bench/cases.toml and append what they cost to runs/bench/results.csv.

  tools/bench                    everything, smallest size first (make bench)
  tools/bench --quick            the sizes marked quick: some minutes
  tools/bench --only cavity --cells 55225 --ranks 1 --vary flow_solver=fast
  tools/bench --list             the commands, without running them
  tools/bench --show             the last commit's rows of results.csv as a table

The first step of a run is not counted; a row holds the median over the others and their spread (from the first to the third
quartile). Bandwidth (STREAM triad, on one rank alone and on all at once) and one product with the velocity matrix (a "sweep")
are measured in the same run, so that the cost in sweeps means something on another machine. A build without optimisation is refused.
With --device, three steps more give a table of the kernels (-device_table) and the memory there an unknown.
"""

import itertools
import os
import re
import statistics
import sys
import tempfile
from pathlib import Path

from toolbox import ROOT, append_row, check_columns, choose, launcher, make_parser, option_text, print_table, printable, read_rows, read_toml, run_scene, split_words

CASES = ROOT / "runs" / "bench" / "cases.toml"
RESULTS = ROOT / "runs" / "bench" / "results.csv"
FEWEST = 5  # counted steps of a run
COLUMNS = (
    "case,commit,machine,petsc,ranks,pinned,load,cells,unknowns,bodies,options,steps,nse_s,force_s,particle_s,total_s,spread,"
    "unknowns_per_s,bytes_per_unknown,outer_mean,outer_max,setup_s,memory_mb,triad_one_gbs,triad_all_gbs,sweep_ms,sweeps_per_step"
).split(",")
PROBE = {"mesh_cells": "8,8", "sim_steps": "1"}


def parse_arguments():
    parser = make_parser(__doc__, limit=1800)
    parser.add_argument("--quick", action="store_true", help="only the smaller sizes")
    parser.add_argument("--only", metavar="CASE[,CASE]", help="these cases")
    parser.add_argument("--cells", metavar="N[,N]", help="these sizes")
    parser.add_argument("--ranks", metavar="N[,N]", help="these numbers of ranks")
    parser.add_argument("--vary", metavar="OPTION=VALUE[/VALUE]", action="append", default=[], help="these values instead of those of the case")
    parser.add_argument("--steps", type=int, metavar="N", help="steps a run, at least %d are counted" % FEWEST)
    parser.add_argument("--device", metavar="WORD", help="cases that a device carries (-device WORD, on one rank), beside the same without it")
    parser.add_argument("--list", action="store_true", help="print the commands only")
    parser.add_argument("--show", action="store_true", help="print the table of the last commit and stop")
    parser.add_argument("--cases", default=str(CASES), metavar="FILE", help="list of cases (default: runs/bench/cases.toml)")
    parser.add_argument("--results", default=str(RESULTS), metavar="FILE", help="table to append to (default: runs/bench/results.csv)")
    return parser, parser.parse_args()


def read_cases(parser, args):
    cases = read_toml(parser, args.cases)
    chosen = choose(parser, "case", cases, split_words(args.only))
    if args.device:
        chosen = {name: case for name, case in chosen.items() if case.get("device")}
    for name, case in cases.items():
        steps = args.steps or case["steps"]
        if steps - case["skip"] < FEWEST:
            parser.error(f"{name}: {steps} steps less {case['skip']} uncounted ones are fewer than {FEWEST}: give more --steps")
    return chosen


def choose_sizes(case, args):
    sizes = case["sizes"]
    if args.cells:
        return [size for size in sizes if str(size["cells"]) in args.cells.split(",")]
    return sizes[: case["quick"]] if args.quick else sizes


def plan(parser, args, cases):
    """(name, case, options, ranks) of every run, smallest size first."""
    forced = dict(word.split("=", 1) for word in args.vary if "=" in word)
    if len(forced) != len(args.vary):
        parser.error("--vary wants OPTION=VALUE")
    ranks = [int(word) for word in args.ranks.split(",")] if args.ranks else None
    runs = []
    for name, case in cases.items():
        vary = {option: [str(value) for value in values] for option, values in case.get("vary", {}).items()}
        vary.update({option: values.split("/") for option, values in forced.items()})
        for size in choose_sizes(case, args):
            fixed = {option: str(value) for option, value in size.items() if option != "cells"}
            for values in itertools.product(*vary.values()):
                for n in ranks or case["ranks"]:
                    runs.append((size["cells"], name, case, {**fixed, **dict(zip(vary, values))}, n))
                if args.device:
                    runs.append((size["cells"], name, case, {**fixed, **dict(zip(vary, values)), "device": args.device}, 1))
    if not runs:
        parser.error("nothing to run: no case has such a size")
    runs.sort(key=lambda run: run[0])  # stable: within a size in the order of the list
    return [run[1:] for run in runs]


def program_options(case, options, args):
    steps = args.steps or case["steps"]
    return {**options, "sim_steps": str(steps), "output_every": "0", "output_bandwidth": None}


def refuse_slow_builds(args, folder):
    probe = run_scene(ROOT / "runs" / "bench" / "cavity.yaml", PROBE, 1, folder, args.build, 60)
    if not probe.summary:
        sys.exit(f"bench: the program does not run: {probe.message}\n  {printable(probe.command)}")
    probe.refuse_slow("bench")


def quartile_spread(values):
    """Distance between first and third quartile over the median."""
    low, middle, high = statistics.quantiles(values, n=4, method="inclusive")
    return (high - low) / middle


def evaluate(name, case, options, run):
    summary, yard = run.summary, run.summary["bandwidth"]
    steps, measured = run.series()[case["skip"] :], run.measured(case["skip"])
    middle = measured["total_s"]
    return {
        **measured,
        **{name: f"{measured[name]:.4g}" for name in ("nse_s", "force_s", "particle_s", "total_s")},
        "case": name,
        "petsc": summary["versions"]["petsc"],
        "options": " ".join(f"{option}={value}" for option, value in options.items()),
        "steps": len(steps),
        "spread": f"{quartile_spread([row['seconds'] for row in steps]):.3f}",
        "unknowns_per_s": f"{summary['unknowns'] / middle:.4g}",
        "bytes_per_unknown": f"{summary['memory_mb'] * 2**20 / summary['unknowns']:.0f}",
        "outer_max": f"{max(row['outer_iterations'] for row in steps):.0f}",
        "setup_s": f"{summary['seconds']['setup']:.4g}",
        "triad_one_gbs": f"{yard['triad_one'] / 1e9:.3g}",
        "sweep_ms": f"{yard['sweep'] * 1e3:.4g}",
        "sweeps_per_step": f"{middle / yard['sweep']:.4g}",
    }


def print_kernels(case, options, args, folder):
    """Of steps of their own, whose kernels are waited for: the kernels by what they move, and memory there an unknown."""
    run = run_scene(ROOT / case["scene"], {**options, "sim_steps": "3", "output_every": "0", "device_table": None}, 1, folder, args.build, args.limit)
    rows = [line for line in run.out.splitlines() if line.startswith("| ")]
    if not run.summary or not rows:
        print(f"bench: no table of kernels: {run.ended}: {run.message}")
        return 1
    megabytes, note = re.search(r"^Memory there: (\S+) MB at most(.*)", run.out, re.M).groups()
    print("\n" + "\n".join(rows) + f"\n\n{1e6 * float(megabytes) / run.summary['unknowns']:.0f} bytes an unknown there{note}\n", flush=True)
    return 0


SHOWN = "case,options,ranks,cells,unknowns,bodies,nse_s,force_s,particle_s,total_s,spread,unknowns_per_s,bytes_per_unknown,outer_mean,triad_all_gbs,sweeps_per_step,kb_per_cell".split(",")


def show(path):
    rows = read_rows(path)
    rows = [row for row in rows if row["commit"] == rows[-1]["commit"]]
    for row in rows:  # what the triad moves in the time of a step
        row["kb_per_cell"] = f"{1e6 * float(row['total_s']) * float(row['triad_all_gbs']) / float(row['cells']):.3g}"
    print(f"commit {rows[-1]['commit']}, {rows[-1]['machine']}, PETSc {rows[-1]['petsc']}\n")
    print_table(SHOWN, [[row[name] for name in SHOWN] for row in rows])


def main():
    parser, args = parse_arguments()
    if args.show:
        show(args.results)
        return 0
    runs = plan(parser, args, read_cases(parser, args))
    failed = 0
    with tempfile.TemporaryDirectory(prefix="tumble-bench-") as folder:
        if not args.list:
            check_columns(args.results, COLUMNS)
            refuse_slow_builds(args, Path(folder) / "probe")
            print(" ".join(f"{name:>12}" for name in ("case", "ranks", "unknowns", "total_s", "spread", "sweeps", "outer")) + "  options", flush=True)
        for name, case, options, ranks in runs:
            wanted = program_options(case, options, args)
            if args.list:
                print(f"mpiexec -n {ranks} {args.build}/tumble {case['scene']} {option_text(wanted)}")
                continue
            load = os.getloadavg()[0]
            run = run_scene(ROOT / case["scene"], wanted, ranks, Path(folder) / "run", args.build, args.limit, launcher(ranks, pinned=True))
            if not run.summary:
                failed += 1
                print(f"{name:>12} {ranks:>12} {run.ended}: {run.message}\n  {printable(run.command)}", flush=True)
                continue
            row = {**evaluate(name, case, options, run), "load": f"{load:.2f}"}
            append_row(args.results, COLUMNS, row)
            print(" ".join(f"{row[key]:>12}" for key in ("case", "ranks", "unknowns", "total_s", "spread", "sweeps_per_step", "outer_mean")) + "  " + row["options"], flush=True)
            if "device" in options:
                failed += print_kernels(case, options, args, Path(folder) / "kernels")
    return 1 if failed else 0
