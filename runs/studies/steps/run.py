"""The estimated error of the steps (estimated_error_time) beside the true one: runs the scenes below, writes data.csv and estimate.png.

    python3 runs/studies/steps/run.py [build/tumble]

True error: over the last period and a half, root mean square of the difference to a run with 480 steps a period on the same mesh, over the root mean
square of that. With 10 and 20 steps also where `balanced` is asked for.
"""
import csv
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
PROGRAM = str(Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "build" / "tumble").resolve())
FINE = 480
STEPS = [10, 14, 20, 28, 40, 80]  # a period
END = "sim: {dt: 0.05, time: 5}\noutput: {every: 0}\n"
CHANNEL = """mesh: {cells: [3, 16], lower: [0, -1], upper: [0.5, 1], periodic: [x]}
flow: {density: 1, viscosity: 0.8, convection: false, force: ["5*sin(2*pi*t)", 0]}
""" + END
WALL = """mesh: {cells: [3, 32], lower: [0, 0], upper: [0.5, 4], periodic: [x]}
flow: {density: 1, viscosity: 0.3, convection: false, bc_bottom: {type: moving_wall, velocity: ["sin(2*pi*t)", 0]}}
""" + END
LID = """mesh: {cells: [16, 16], lower: [0, 0], upper: [1, 1]}
flow: {density: 1, viscosity: 0.01, bc_top: {type: moving_wall, velocity: ["sin(2*pi*t)", 0]}}
""" + END
INFLOW = """mesh: {kind: fitted, resolution: 6}
flow:
  density: 1
  viscosity: 0.005
  bc_left: {type: inflow, profile: parabolic, velocity: ["1+0.5*sin(2*pi*t)", 0]}
  bc_right: {type: outflow}
particle: {groups: c, c: {shape: circle, radius: 0.05, position: [0.2, 0.2], free: none}}
""" + END
DUCT = """mesh: {cells: [3, 6, 6], lower: [0, -1, -1], upper: [0.7, 1, 1], periodic: [x]}
flow: {density: 1, viscosity: 0.3, convection: false, force: ["5*sin(2*pi*t)", 0, 0]}
""" + END
BODY = """mesh: {cells: [40, 40], lower: [-1, -1], upper: [1, 1]}
flow: {density: 1, viscosity: 0.05}
couple: {method: aligned}
particle:
  groups: c
  c: {shape: circle, radius: 0.3, position: [0, 0], motion: oscillate, motion_amplitude: [0.05, 0], motion_period: [1, 1], motion_phase: [90 deg, 0]}
""" + END
# name, scene, options, column, file
SCENES = [
    ("channel, Womersley 0.5", CHANNEL, "-flow_viscosity 25", "mean_velocity_x"),
    ("channel, Womersley 2.8", CHANNEL, "", "mean_velocity_x"),
    ("channel, Womersley 8", CHANNEL, "-flow_viscosity 0.1", "mean_velocity_x"),
    ("channel, Womersley 25", CHANNEL, "-flow_viscosity 0.01", "mean_velocity_x"),
    ("channel, cn", CHANNEL, "-flow_time cn", "mean_velocity_x"),
    ("duct, Womersley 4.6", DUCT, "", "mean_velocity_x"),
    ("Stokes' wall", WALL, "", "wall_force_bottom_x"),
    ("lid, Re 10", LID, "-flow_viscosity 0.1", "wall_force_top_x"),
    ("lid, Re 100", LID, "", "wall_force_top_x"),
    ("inflow, Re 20", INFLOW, "", "force_x"),
    ("body, aligned", BODY, "", "force_x"),
]


def run(folder, name, text, dt, options):
    scene, out = folder / "scene.yaml", folder / name.replace(" ", "_")
    scene.write_text(text)
    done = subprocess.run([PROGRAM, scene, "-sim_dt", repr(dt), "-output_dir", out, *options.split()], capture_output=True, text=True)
    if done.returncode and "cannot keep its 1 %" in done.stderr:
        return None
    done.check_returncode()
    return out


def read(out, column):
    with open(out / ("bodies.csv" if column.startswith("force") else "series.csv")) as file:
        table = list(csv.DictReader(file))
    return [float(row["time"]) for row in table], [float(row[column]) for row in table]


def at(series, x):
    """Cubic interpolation."""
    t, v = series
    k = min(max(sum(a < x for a in t) - 2, 0), len(t) - 4)
    return sum(v[a] * math.prod((x - t[b]) / (t[a] - t[b]) for b in range(k, k + 4) if b != a) for a in range(k, k + 4))


def differ(series, fine, dt):
    times = [3.4 + (1.55 - 2 * dt) * i / 200 for i in range(201)]
    true = [at(fine, x) for x in times]
    return math.sqrt(sum((at(series, x) - y) ** 2 for x, y in zip(times, true)) / sum(y * y for y in true))


def measure():
    rows = []
    with tempfile.TemporaryDirectory() as place:
        for name, text, options, column in SCENES:
            fine = read(run(Path(place), f"{name} fine", text, 1 / FINE, options), column)
            for n in STEPS:
                for preset in "", "balanced":
                    if preset and n not in (10, 20):
                        continue
                    out = run(Path(place), f"{name} {n} {preset}", text, 1 / n, options + (f" -preset {preset}" if preset else ""))
                    if not out:
                        rows.append([name, n, preset, "", "refused", ""])
                        continue
                    summary = json.loads((out / "summary.json").read_text())
                    error = differ(read(out, column), fine, 1 / n)
                    rows.append([name, n, preset, summary["steps"], f"{100 * error:.4g}", f"{100 * summary['quantities']['estimated_error_time']:.4g}"])
                    print(*rows[-1], flush=True)
    return rows


def draw(rows):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6, 5))
    for i, name in enumerate(dict.fromkeys(row[0] for row in rows)):
        mine = [(float(row[4]), float(row[5])) for row in rows if row[0] == name and not row[2]]
        axes.loglog(*zip(*mine), marker="osv^D<>Pxd*"[i], linestyle="none", markersize=5, label=name)
    ends = [0.005, 20]
    axes.loglog(ends, ends, color="0.3", linewidth=1)
    for factor in 0.5, 2:
        axes.loglog(ends, [factor * e for e in ends], color="0.7", linewidth=1, linestyle="--")
    axes.axhline(1, color="0.8", linewidth=1)
    axes.set_xlabel("true error of the steps [%]")
    axes.set_ylabel("estimated [%]")
    axes.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(HERE / "estimate.png", dpi=100)


def main():
    rows = measure()
    with open(HERE / "data.csv", "w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([["scene", "steps_a_period", "preset", "steps", "true_percent", "estimated_percent"], *rows])
    draw(rows)


if __name__ == "__main__":
    main()
