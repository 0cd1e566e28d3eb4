#!/usr/bin/python3
"""Draws reynolds.png from balance.csv."""

import csv
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

HERE = Path(__file__).resolve().parent

with open(HERE / "balance.csv") as file:
    rows = [row for row in csv.DictReader(file) if row["length"] == "1.6"]
figure, axes = plt.subplots(figsize=(6.4, 3.6))
for style, label, chosen in (
    ("o-", "mesh around the ellipse, 24 cells across", [row for row in rows if row["across"] == "24"]),
    ("kx", "8, 16, 32 cells across", [row for row in rows if row["across"] != "24"]),
):
    axes.plot([1000 * float(row["shift"]) for row in chosen], [float(row["reynolds"]) for row in chosen], style, label=label)
axes.axhspan(12.2, 12.8, color="0.9")
axes.axhline(12.5, color="0.5", linestyle="--", linewidth=0.8, label="Xia et al. 2009")
axes.set_xlabel("outward shift of the surface [% of the major axis]")
axes.set_ylabel("Re = V a/nu")
axes.legend()
figure.tight_layout()
figure.savefig(HERE / "reynolds.png", dpi=80)
