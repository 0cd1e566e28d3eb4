"""Cost against error of ten Cate's sphere E4: cost.csv -> cost.png.

    python3 runs/studies/following/draw.py

Cost: user seconds of one core over those of the cavity of runs/bench/cavity-3d.yaml (20 x 20 x 20 cells, 100 steps, fast) on the same
machine and day. Error: of the largest speed, from the limit of finer meshes.
"""
import csv
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402 (needs the backend)

HERE = Path(__file__).resolve().parent
LIMIT = 0.1212
MARK = {"tumble, penalty": "o", "tumble, aligned": "s", "waLBerla": "D"}


def draw(rows, to):
    figure, axes = plt.subplots(figsize=(5, 3.5))
    for code, mark in MARK.items():
        mine = [row for row in rows if row["code"] == code]
        cost = [float(row["cavities"]) for row in mine]
        error = [100 * abs(float(row["largest_speed"]) / LIMIT - 1) for row in mine]
        axes.loglog(cost, error, mark, label=code)
        for x, y, row in zip(cost, error, mine, strict=True):
            axes.annotate(row["cells_a_diameter"], (x, y), textcoords="offset points", xytext=(5, 4), fontsize=8)
    axes.axhline(1, color="0.7", linewidth=1)
    axes.set_xlabel("cost, in cavities")
    axes.set_ylabel("error of the largest speed [%]")
    axes.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(to, dpi=110)


def main():
    with open(HERE / "cost.csv", newline="") as file:
        draw(list(csv.DictReader(file)), HERE / "cost.png")


if __name__ == "__main__":
    main()
