#!/usr/bin/python3
"""Adaptive against fixed time steps at equal error: cylinder in a pulsating stream, a disc that falls to the floor, two discs that meet.

usage: study.py [--only NAME] [--build build] [--work out/adaptive-step]; runs that are in the work folder already are not repeated. Writes data.csv and figure.png beside itself.
The error is the largest difference to a run with a much smaller fixed step, over the whole time: of cd and cl in units of their largest value, of positions in diameters.
"""
# Debian's interpreter by name: it has matplotlib
import argparse
import csv
import json
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[2] / "tools"))
from toolbox import ROOT, children_seconds, read_numbers, run_scene  # noqa: E402

FALL = {"mesh_cells": "32,64", "mesh_upper": "2,4", "couple_method": "aligned"}
SCENES = {
    "pulsating stream": {
        "scene": "runs/cylinder-2d3.yaml",
        "options": {"mesh_resolution": "6"},
        "table": "series",
        "columns": {"cd": None, "cl": None},  # None: in units of the largest value
        "since": 0.8,  # the coefficients of the first instants are those of a stream that hardly moves
        "reference": 0.0025,
        "fixed": [0.04, 0.02, 0.01, 0.005],
        "adaptive": {"sim_dt": 0.01},
        "tolerances": [3e-4, 1e-4, 3e-5, 1e-5],
        "cfl": [2, 1.4, 1, 0.7],  # the lift grows out of what the steps before the shedding leave behind: the CFL number falls with the tolerance
    },
    "falling disc": {
        "scene": "runs/sedimentation.yaml",
        "options": {**FALL, "particle_disc_position": "1,3", "sim_time": 1.2},
        "table": "bodies",
        "columns": {"y": 0.25},
        "since": 0,
        "reference": 0.0025,
        "fixed": [0.04, 0.02, 0.01, 0.005],
        "adaptive": {"sim_dt": 0.0025},
        "tolerances": [1e-2, 3e-3, 1e-3, 3e-4],
    },
    "two discs": {
        "scene": "runs/dkt.yaml",
        "options": {**FALL, "flow_viscosity": "0.05", "particle_leader_position": "0.999,3", "particle_trailer_position": "1.001,3.35", "sim_time": 0.1, "couple_method": "penalty"},
        "table": "bodies",
        "columns": {"x": 0.25, "y": 0.25},
        "since": 0,
        "reference": 0.000625,
        "fixed": [0.01, 0.005, 0.0025, 0.00125],
        "adaptive": {"sim_dt": 0.00125},
        "tolerances": [1e-2, 3e-3, 1e-3, 3e-4],
    },
    "drafting": {
        "scene": "runs/dkt.yaml",
        "options": {"sim_time": 0.17, "couple_method": "aligned"},
        "table": "bodies",
        "columns": {"x": 0.25, "y": 0.25},
        "since": 0,
        "reference": 0.00025,
        "fixed": [0.004, 0.002, 0.001, 0.0005],
        "adaptive": {"sim_dt": 1e-4},
        "tolerances": [1e-3, 3e-4, 1e-4, 3e-5],
        "move": [1, 0.5, 0.5, 0.35],
    },
}
COLUMNS = "scene,kind,dt_or_tolerance,steps,rejected,dt_min,dt_max,outer_iterations,cpu_s,error".split(",")


class Result:
    """Tables of a run, and what it took."""

    def __init__(self, case, folder):
        rows = read_numbers(folder / f"{case['table']}.csv")
        bodies = sorted({row.get("body", 0) for row in rows})
        self.values = [{name: numpy.array([row[name] for row in rows if row.get("body", 0) == body]) for name in case["columns"]} for body in bodies]
        self.time = numpy.array([row["time"] for row in rows if row.get("body", 0) == bodies[0]])
        series = read_numbers(folder / "series.csv")
        self.dt = numpy.array([row["dt"] for row in series])
        self.iterations = int(sum(row["outer_iterations"] for row in series))
        self.rejected = int(series[-1].get("rejected_steps", 0))
        self.seconds = json.loads((folder / "cpu.json").read_text())


def run(case, folder, build, more):
    if not (folder / "cpu.json").exists():
        options = {**case["options"], **more, "output_every": 0}
        before = children_seconds()
        done = run_scene(case["scene"], {name: str(value) for name, value in options.items()}, 1, folder, build, cwd=ROOT)
        if done.ended != "ok":
            print(f"{folder}: {done.ended}: {done.message}", flush=True)
            return None
        (folder / "cpu.json").write_text(json.dumps(children_seconds() - before))
    return Result(case, folder)


def largest_error(case, result, reference):
    late, worst = result.time > case["since"], 0.0
    for name, unit in case["columns"].items():
        for mine, right in zip(result.values, reference.values):
            error = numpy.abs(mine[name][late] - numpy.interp(result.time[late], reference.time, right[name])).max()
            worst = max(worst, error / (unit or numpy.abs(right[name]).max()))
    return worst


def study(name, args):
    """Rows of the table and the runs of a scene."""
    case, results, rows = SCENES[name], {}, []
    reference = run(case, args.work / f"{name}-reference", args.build, {"sim_dt": case["reference"]})
    points = [("fixed", dt, {"sim_dt": dt}) for dt in case["fixed"]]
    for tolerance, cfl, move in zip(case["tolerances"], case.get("cfl", [5] * 4), case.get("move", [0.5] * 4)):
        limits = {"sim_adapt_tolerance": tolerance, "sim_adapt_cfl": cfl, "sim_adapt_displacement": move}
        points.append(("adaptive", tolerance, {**case["adaptive"], "sim_adapt": "true", **limits}))
    for kind, value, more in points:
        result = results[kind, value] = run(case, args.work / f"{name}-{kind}-{value:g}", args.build, more)
        if not result:
            rows.append({**dict.fromkeys(COLUMNS, ""), "scene": name, "kind": kind, "dt_or_tolerance": f"{value:g}", "error": "stopped"})
            continue
        rows.append(
            {
                "scene": name,
                "kind": kind,
                "dt_or_tolerance": f"{value:g}",
                "steps": len(result.dt),
                "rejected": result.rejected,
                "dt_min": f"{result.dt.min():.3g}",
                "dt_max": f"{result.dt.max():.3g}",
                "outer_iterations": result.iterations,
                "cpu_s": f"{result.seconds:.3g}",
                "error": f"{largest_error(case, result, reference):.3g}",
            }
        )
        print(rows[-1], flush=True)
    return rows, results


def draw(everything):
    figure, axes = plt.subplots(2, len(everything), figsize=(4.6 * len(everything), 7), constrained_layout=True, squeeze=False)
    for column, (name, (rows, results)) in enumerate(everything.items()):
        top, bottom = axes[0][column], axes[1][column]
        for kind, colour in (("fixed", "0.45"), ("adaptive", "#c1121f")):
            mine = [row for row in rows if row["kind"] == kind and row["error"] != "stopped"]
            top.loglog([row["steps"] + row["rejected"] for row in mine], [float(row["error"]) for row in mine], "o-", color=colour, label=kind)
        top.set(title=name, xlabel="flow solves, rejected steps included", ylabel="largest error" if column == 0 else "")
        top.legend(frameon=False)
        for tolerance in SCENES[name]["tolerances"]:
            result = results["adaptive", tolerance]
            if not result:
                continue
            bottom.semilogy(numpy.cumsum(result.dt), result.dt, lw=1, label=f"tolerance {tolerance:g}")
        bottom.set(xlabel="time [s]", ylabel="time step [s]" if column == 0 else "")
        bottom.legend(frameon=False, fontsize=8)
    figure.savefig(HERE / "figure.png", dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=SCENES, help="this scene, without writing files")
    parser.add_argument("--build", default="build")
    parser.add_argument("--work", type=Path, default=ROOT / "out" / "adaptive-step")
    args = parser.parse_args()
    everything = {name: study(name, args) for name in ([args.only] if args.only else SCENES)}
    if args.only:
        return
    rows = [row for table, _ in everything.values() for row in table]
    with open(HERE / "data.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    draw(everything)


if __name__ == "__main__":
    main()
