#!/usr/bin/python3
"""Wet rebound of a sphere at a wall, in that without a fluid, by the Stokes number of its arrival (notes.md, "Wet rebound").

  runs/studies/contact/wet.py           method penalty, 4 and 6 cells a diameter, and aligned, 4 cells: some 2 to 10 s of one core a line
  runs/studies/contact/wet.py 0.01      one viscosity
"""

import csv
import subprocess
import sys
import tempfile
from math import exp
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
DENSITY, RESTITUTION, NEAR = 7.8, 0.97, 0.25  # of wet.yaml; gap in diameters at which the speed of arrival is taken


def rebound(viscosity, cells, boundary):
    """Stokes number of the arrival, and what is left of its speed"""
    with tempfile.TemporaryDirectory() as folder:
        command = [ROOT / "build/tumble", Path(__file__).with_name("wet.yaml"), "-flow_viscosity", str(viscosity), "-couple_method", boundary]
        subprocess.run([*command, "-mesh_cells", f"{cells},{cells},{cells}", "-output_dir", folder], check=True, capture_output=True)
        with open(Path(folder) / "bodies.csv") as file:
            rows = list(csv.DictReader(file))
    met = next(i for i, row in enumerate(rows) if float(row["z"]) - 0.5 < NEAR)
    arrival, best = -float(rows[met - 1]["w"]), max(float(row["w"]) for row in rows[met:])
    return DENSITY * arrival / (9 * viscosity), max(0, best / arrival)


def main():
    for boundary, cells in (("penalty", 8), ("penalty", 12), ("aligned", 8)):
        for viscosity in map(float, sys.argv[1:] or (0.0867, 0.04, 0.02, 0.01, 0.001, 0.0002)):
            stokes, left = rebound(viscosity, cells, boundary)
            fit = exp(-35 / (stokes * (1 + 0.5 / DENSITY)))  # Legendre, Daniel & Guiraud 2005
            print(f"{boundary:8} {cells // 2} cells a diameter  St {stokes:7.1f}  e/e_dry {left / RESTITUTION:.3f}  correlation {fit:.3f}", flush=True)


if __name__ == "__main__":
    main()
