#!/usr/bin/python3
"""Films between spheres, and sphere and wall: resistance by the mesh alone and with the film law, beside the exact one (README.md, "Films").

  runs/studies/contact/films.py              runs film-wall.yaml and film-pair.yaml at some gaps (half a minute of one core each) and prints the table
  runs/studies/contact/films.py wall 0.5     one gap, in cells; 4 cells a radius
  runs/studies/contact/films.py pair 0.5 6   with 3, 4, 5, 6 or 8 cells a radius
"""

import csv
import subprocess
import sys
import tempfile
from math import acosh, cosh, log, pi, sinh
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
CLOSED, POWER, RECESS = {"wall": 0.165, "pair": 0.305}, {"wall": 6, "pair": 4}, 0.035  # of src/contact/pairforce.c and src/couple/method_penalty.c
MESHES = {3: (6, 4), 4: (8, 4), 5: (10, 4), 6: (12, 4), 8: (8, 5)}  # cells a radius: coarse cells an axis and levels
PLACE = "0.013,-0.021"


def series(alpha, term):
    """4/3 sinh(alpha) sum n(n+1)/((2n-1)(2n+3)) (term - 1)"""
    total = 0
    for n in range(1, int(300 / alpha) + 2):
        if (2 * n + 1) * alpha > 600:
            break
        total += n * (n + 1) / ((2 * n - 1) * (2 * n + 3)) * (term(n, 2 * n + 1) - 1)
    return 4 / 3 * sinh(alpha) * total


def wall(gap):
    """Brenner, Chem. Eng. Sci. 16, 242 (1961)"""
    a = acosh(1 + gap)
    return series(a, lambda n, m: (2 * sinh(m * a) + m * sinh(2 * a)) / (4 * sinh((n + 0.5) * a) ** 2 - m**2 * sinh(a) ** 2))


def pair(gap):
    """Two equal spheres with speed 1 each: half way between them is a free surface (Brenner 1961)"""
    a = acosh(1 + gap / 2)
    return series(a, lambda n, m: (4 * cosh((n + 0.5) * a) ** 2 + m**2 * sinh(a) ** 2) / (2 * sinh(m * a) - m * sinh(2 * a)))


def film(kind, gap, cell):
    """What -contact_lubrication adds with method penalty, with a range of one cell"""
    x = gap / cell
    if x >= 2:
        return 0
    closed, power = CLOSED[kind] * cell, POWER[kind]
    wide = gap + RECESS * cell * max(0, min(1, (x - 0.4) / 0.35) * min(1, 2 - x))
    resolved = (wide**power + closed**power) ** (1 / power)
    if kind == "wall":
        return 1 / gap - 1 / resolved + log(resolved / gap) / 5
    return 2 * ((1 / gap - 1 / resolved) / 4 + 9 / 40 * log(resolved / gap))


def measure(kind, gap, cells):
    """Force over 6 pi by the mesh alone"""
    coarse, levels = MESHES[cells]
    heights = {"ball": 1 + gap} if kind == "wall" else {"below": 0.01 - 1 - gap / 2, "above": 0.01 + 1 + gap / 2}
    with tempfile.TemporaryDirectory() as folder:
        words = [str(ROOT / "build" / "tumble"), str(ROOT / "runs/studies/contact" / f"film-{kind}.yaml"), "-output_every", "0", "-output_dir", folder, "-output_overwrite"]
        words += ["-mesh_cells", f"{coarse},{coarse},{coarse}", "-mesh_levels", str(levels)]
        for name, z in heights.items():
            words += [f"-particle_{name}_position", f"{PLACE},{z}"]
        subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
        with open(Path(folder) / "bodies.csv", newline="", encoding="utf-8") as file:
            return abs(float(list(csv.DictReader(file))[-1]["force_z"])) / (6 * pi)


def main():
    cases = [(sys.argv[1], float(sys.argv[2]))] if len(sys.argv) > 2 else [(kind, x) for kind in ("wall", "pair") for x in (2, 1.5, 1, 0.7, 0.5, 0.25, 0.125, 0.05, 0.02)]
    cells = int(sys.argv[3]) if len(sys.argv) > 3 else 4
    print("| | gap in cells | exact | mesh alone | off [%] | with film [%] |\n| --- | --- | --- | --- | --- | --- |")
    for kind, x in cases:
        gap = x / cells
        exact, ours = {"wall": wall, "pair": pair}[kind](gap), measure(kind, gap, cells)
        print(f"| {kind} | {x:.3g} | {exact:.4g} | {ours:.4g} | {100 * (ours / exact - 1):+.1f} | {100 * ((ours + film(kind, gap, 1 / cells)) / exact - 1):+.1f} |", flush=True)


if __name__ == "__main__":
    main()
