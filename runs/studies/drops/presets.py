#!/usr/bin/env python3
"""Quantities of scenes with drops by mesh and step: presets.py BUILD FOLDER CASE CELLS STEP[,STEP ...] [OPTIONS].

A case is one of CASES, CELLS multiply its numbers of cells; a line a step, with the most outer iterations of a step and the number of steps."""

import csv
import math
import subprocess
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
sys.path.insert(0, str(HERE))
import oscillating  # noqa: E402

SECOND = "-particle_bubble_density 1 -particle_bubble_viscosity 0.1 -particle_bubble_surface_tension 1.96"


def read(folder, name):
    with open(Path(folder) / name, newline="") as file:
        rows = list(csv.DictReader(file))
    return {key: np.array([float(row[key]) for row in rows]) for key in rows[0] if key != "group"}


def at(table, name, time):
    return np.interp(time, table["time"], table[name])


def bubble(folder):
    d = read(folder, "drops.csv")
    return {"least circularity": d["circularity"].min(), "largest speed": peak(d["time"], d["v"]), "height at 3": at(d, "y", 3)}


def peak(time, v):
    """Of the parabola through the first largest value and its neighbours"""
    k = int(np.argmax(v[time < 1.5]))
    a, b, _ = np.polyfit(time[k - 1 : k + 2] - time[k], v[k - 1 : k + 2], 2)
    return v[k] - b * b / (4 * a)


def second_bubble(folder):
    d = read(folder, "drops.csv")
    return {"largest speed": peak(d["time"], d["v"]), "height at 1.5": at(d, "y", 1.5), "circularity at 1": at(d, "circularity", 1)}


def oscillation(folder):
    s = oscillating.fit(Path(folder) / "drops.csv")
    return {"frequency": s.imag / oscillating.OMEGA, "decay": -s.real / oscillating.DECAY}


def shear(folder):
    d = read(folder, "drops.csv")
    return {"deformation": d["deformation"][-1], "deformation at .5": at(d, "deformation", 0.5)}


def segment(folder):
    d = read(folder, "drops.csv")
    return {"wetted length": d["wetted"][-1], "wetted at .2": at(d, "wetted", 0.2)}


def wave(folder):
    """Swing of half a wave: first trough, next crest over the amplitude"""
    d = read(folder, "drops.csv")
    k = 2 * math.pi
    a = -(d["x"] - 0.25) * d["volume"] * k * k / 0.02
    low = int(np.argmin(a))
    high = low + int(np.argmax(a[low:]))
    return {"first trough": a[low], "next crest": a[high], "time of the trough": parabola(d["time"], a, low)}


def parabola(time, a, k):
    c = np.polyfit(time[k - 1 : k + 2] - time[k], a[k - 1 : k + 2], 2)
    return time[k] - c[1] / (2 * c[0])


def float_(folder):
    d, b = read(folder, "drops.csv"), read(folder, "bodies.csv")
    return {"depth": (d["wetted"][-1] - 2) / 2 - 1 - b["y"][-1]}


def beside(folder):
    d = read(folder, "drops.csv")
    return {"height": d["y"][-1], "rise at 1": at(d, "y", 1) - d["y"][0]}


def hot(folder):
    return {"rise": read(folder, "drops.csv")["y"][-1] - 0.7}


# name: (scene, cells for CELLS 1, options, end, measure)
CASES = {
    "bubble": ("bubble-rising", (1, 2), "", 3, bubble),
    "bubble-2": ("bubble-rising", (1, 2), SECOND, 1.5, second_bubble),
    "oscillating": ("drop-oscillating", (1, 1), "-sim_steps 1000000", 1.28288, oscillation),
    "shear": ("drop-shear", (1, 1), "", 4, shear),
    "angle": ("contact-angle", (2, 1), "", 3, segment),
    "capillary": ("capillary-wave", (1, 4), "", 0.56, wave),
    "sloshing": ("sloshing", (1, 2), "", 3, wave),
    "floating": ("disc-at-interface", (4, 3), "", 8, float_),
    "beside": ("drop-and-discs", (1, 2), "", 2.4, beside),
    "hot": ("hot-drop-rises", (2, 5), "", 1.2, hot),
}


def run(build, folder, case, n, dt, more=()):
    scene, cells, options, end, measure = CASES[case]
    mesh = ",".join(str(round(n * c)) for c in cells)
    command = [f"{build}/tumble", f"{ROOT}/runs/{scene}.yaml", "-mesh_cells", mesh, "-sim_dt", str(dt), "-sim_time", str(end), "-flow_solver", "balanced",
               "-output_every", "0", "-output_dir", str(folder), *options.split(), *more]
    result = subprocess.run(command, capture_output=True, text=True)
    if result.returncode:
        return {"stopped": (result.stderr + result.stdout).strip().splitlines()[-1][:200]}
    series = read(folder, "series.csv")
    values = measure(folder)
    values["iterations"] = series["outer_iterations"].max()
    values["steps"] = len(series["time"])
    return values


if __name__ == "__main__":
    build, folder = sys.argv[1:3]
    case, n, steps = sys.argv[3], float(sys.argv[4]), sys.argv[5].split(",")
    for dt in steps:
        out = run(build, f"{folder}/{case}-{n:g}-{dt}", case, n, float(dt), sys.argv[6:])
        print(case, f"n={n:g} dt={dt}", " ".join(f"{k}={v:.6g}" if not isinstance(v, str) else v for k, v in out.items()), flush=True)
