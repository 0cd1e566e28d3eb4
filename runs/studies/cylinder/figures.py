#!/usr/bin/python3
"""Draw convergence.png from steady.csv, periodic.csv, pulsating.csv, and coefficients.png from the series of the finest runs in out/studies/cylinder."""

import csv
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

HERE = Path(__file__).resolve().parent
KEEP = HERE.parents[2] / "out" / "studies" / "cylinder"
PERIODIC_REFERENCE = {"cd": 3.2274, "cl": 0.9866}
PULSATING_REFERENCE = {"cd": (3.93625, 2.950921575), "cl": (5.693125, 0.47795)}


def read(name):
    with open(HERE / name, newline="") as file:
        rows = list(csv.DictReader(file))
    return [row for row in rows if row["run"] != "reference"], next(row for row in rows if row["run"] == "reference")


def draw_steady(axis):
    rows, reference = read("steady.csv")
    for quantity, marker in (("cd", "o"), ("cl", "s"), ("dp", "^")):
        for kind, style in (("fitted", "-"), ("penalty", ":")):
            points = [(float(row["unknowns"]), abs(float(row[quantity]) / float(reference[quantity]) - 1)) for row in rows if row["run"].startswith(kind)]
            axis.loglog(*zip(*points), style, marker=marker, label=f"{quantity}, {kind}")
    axis.set(title="2D-1: relative error", xlabel="unknowns")
    axis.legend(fontsize=8)


def draw_steps(axis, name, quantities, title):
    """Runs are named fitted-<resolution>-<dt>-<extrapolation>[-<rtol>]; those with a loose tolerance are left out."""
    rows, reference = read(name)
    rows = [row for row in rows if row["cl_max"] and not row["run"].endswith("1e-05")]
    for quantity, marker in zip(quantities, "os"):
        for kind in sorted({(row["run"].split("-")[1], row["run"].split("-")[3]) for row in rows}):
            chosen = [row for row in rows if (row["run"].split("-")[1], row["run"].split("-")[3]) == kind]
            points = sorted((float(row["dt"]) ** 2 * 1e6, float(row[quantity]) - float(reference[quantity])) for row in chosen)
            axis.plot(*zip(*points), marker=marker, mfc="none" if kind[1] == "quadratic" else None, label=f"{quantity}, resolution {kind[0]}, {kind[1]}")
    axis.axhline(0, color="0.6", lw=0.8)
    axis.set_xlim(left=0)
    axis.set(title=title, xlabel="dt² [10⁻⁶ s²]", ylabel="deviation from the reference")
    axis.legend(fontsize=7)


def draw_series(axis, folders, title, since, marks):
    rows = []
    for folder in folders:
        with open(KEEP / folder / "series.csv", newline="") as file:
            rows += [row for row in csv.DictReader(file) if float(row["time"]) >= since]
    time = [float(row["time"]) for row in rows]
    for quantity, colour in (("cd", "C0"), ("cl", "C1")):
        axis.plot(time, [float(row[quantity]) for row in rows], color=colour, label=quantity)
        if isinstance(marks[quantity], tuple):
            axis.plot(*marks[quantity], "x", color="k", ms=8)
        else:
            axis.axhline(marks[quantity], color="k", ls="--", lw=0.8)
    axis.set(title=title, xlabel="t [s]")
    axis.legend()


def main():
    figure, axes = plt.subplots(1, 3, figsize=(15, 4.5), layout="constrained")
    draw_steady(axes[0])
    draw_steps(axes[1], "periodic.csv", ("cd_max", "cl_max"), "2D-2")
    draw_steps(axes[2], "pulsating.csv", ("cd_max", "cl_max"), "2D-3")
    figure.savefig(HERE / "convergence.png", dpi=90)
    if (KEEP / "pulsating").is_dir():
        figure, axes = plt.subplots(1, 2, figsize=(12, 4), layout="constrained")
        draw_series(axes[0], ["periodic/fitted-24-0.0025-quadratic"], "2D-2 (dashed: reference of the largest values)", 6, PERIODIC_REFERENCE)
        draw_series(axes[1], ["pulsating/fitted-24-0.00167-linear-1e-07", "pulsating/fitted-24-tail"], "2D-3 (crosses: reference)", 0.1, PULSATING_REFERENCE)
        figure.savefig(HERE / "coefficients.png", dpi=90)


if __name__ == "__main__":
    main()
