"""Estimated errors of runs in time (-monitor_accuracy) beside true ones: runs the scenes below, writes intime.csv.

    python3 runs/studies/accuracy/intime.py [build/tumble [WORD]]      # with WORD scenes with that in their names alone, rows of others stay

True errors are those of what is gauged (src/run/gauge.h: mean, largest, smallest value from a time on), against the same scene on a mesh at
least twice as fine with at most half the step. Declared before the first run.
"""
import csv
import json
import re
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
PROGRAM = sys.argv[1] if len(sys.argv) > 1 else str(ROOT / "build" / "tumble")
# name, scene, options of all runs, of the one that is judged, of the finer one
SCENES = [
    ("2D-2, fitted, coarse", "cylinder-2d2", "", "-mesh_resolution 6 -sim_dt 0.01", "-mesh_resolution 12 -sim_dt 0.0025"),
    ("2D-3, fitted, coarse", "cylinder-2d3", "", "-mesh_resolution 6 -sim_dt 0.02", "-mesh_resolution 12 -sim_dt 0.005"),
    ("disc falls, aligned", "sedimentation", "-sim_time 0.4 -couple_method aligned", "-mesh_cells 32,96 -sim_dt 0.004", "-mesh_cells 96,288 -sim_dt 0.00133"),
    ("disc falls, penalty", "sedimentation", "-sim_time 0.4 -couple_method penalty", "-mesh_cells 48,144 -sim_dt 0.004",
     "-mesh_cells 96,288 -sim_dt 0.00133 -couple_method aligned"),
    ("ellipse falls, aligned", "ellipse-falling", "-sim_time 0.6", "-sim_dt 0.01", "-mesh_cells 32,128 -sim_dt 0.0025"),
    ("cylinder led to and fro", "oscillating-cylinder", "-sim_time 2", "-mesh_focus_h 0.0125 -sim_dt 0.02", "-mesh_focus_h 0.00556 -sim_dt 0.005"),
    ("disc across Couette flow", "couette-migration", "-sim_time 12", "-sim_dt 0.25", "-mesh_cells 64,32 -sim_dt 0.0625"),
    ("container, disc free to turn", "rotating-container", "-sim_time 1", "", "-mesh_resolution 24 -sim_dt 0.005 -couple_method aligned"),
    ("ball free to turn, space", "sphere-container", "-sim_time 0.6", "-sim_dt 0.02", "-mesh_resolution 10 -sim_dt 0.005"),
    ("sphere starts, space", "sphere-start", "-sim_time 1 -mesh_cells 4,4,4", "-sim_dt 0.05", "-mesh_cells 8,8,8 -sim_dt 0.0125"),
]


def solve(scene, options, estimate):
    """Rows of series.csv and bodies.csv, quantities, processor time"""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        words = [PROGRAM, str(ROOT / "runs" / f"{scene}.yaml"), *options.split(), "-output_every", "0", "-output_dir", str(out),
                 "-monitor_accuracy", "true" if estimate else "false"]
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        done = subprocess.run(words, capture_output=True, text=True)
        seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
        if done.returncode:
            raise SystemExit(f"{' '.join(words)}\n{done.stdout}{done.stderr}")
        series = list(csv.DictReader((out / "series.csv").open()))
        bodies = list(csv.DictReader((out / "bodies.csv").open()))
        quantity = json.loads((out / "summary.json").read_text())["quantities"]
        start = re.search(r"-monitor_from (\S+)", (out / "options.txt").read_text())
        return series, bodies, quantity, seconds, float(start.group(1)) if start else 0.5 * float(series[-1]["time"])


def gauge(series, bodies, name, start):
    """Mean, largest and smallest value of the first body"""
    column = {"velocity_x": "u", "velocity_y": "v", "velocity_z": "w"}.get(name, name)
    if column in series[0]:
        values = [float(row[column]) for row in series]
    else:
        values = [float(row[column]) for row in bodies if int(row["body"]) == 0]
    steps = [(float(row["time"]), value) for row, value in zip(series, values)]
    points = []
    for (before, old), (now, new) in zip(steps, steps[1:]):
        if now <= start + 1e-9 * (now - before):
            continue
        if not points:
            share = max(0, (start - before) / (now - before))
            points.append((max(start, before), old + share * (new - old)))
        points.append((now, new))
    area = sum(0.5 * (b[0] - a[0]) * (a[1] + b[1]) for a, b in zip(points, points[1:]))
    return area / (points[-1][0] - points[0][0]), max(v for _, v in points), min(v for _, v in points)


def main():
    rows = []
    word = sys.argv[2] if len(sys.argv) > 2 else ""
    table = HERE / "intime.csv"
    before = list(csv.reader(table.open()))[1:] if word and table.exists() else []
    for name, scene, common, coarse, fine in SCENES:
        if word not in name:
            rows += [row for row in before if row[0] == name]
            continue
        *run, quantity, seconds, start = solve(scene, f"{common} {coarse}", True)
        alone = solve(scene, f"{common} {coarse}", False)[3]
        finer = solve(scene, f"{common} {fine}", False)
        for key, estimate in quantity.items():
            what = key.removeprefix("estimated_error_")
            if what == key or what.endswith(("_space", "_time")):
                continue
            mine, other = gauge(*run, what, start), gauge(*finer[:2], what, start)
            error = max(abs(a - b) for a, b in zip(mine, other)) / max(abs(mine[1]), abs(mine[2]))
            rows.append([name, what, f"{error:.2e}", f"{estimate:.2e}", f"{quantity[key + '_space']:.2e}", f"{quantity.get(key + '_time', float('nan')):.2e}",
                         f"{estimate / error:.2f}", f"{100 * (seconds / alone - 1):.0f}"])
            print(*rows[-1], sep=" | ", flush=True)
    with table.open("w") as file:
        csv.writer(file).writerows([["scene", "of", "error", "estimate", "space", "time", "ratio", "cost_percent"], *rows])


if __name__ == "__main__":
    main()
