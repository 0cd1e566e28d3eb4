#!/usr/bin/python3
"""Films between spheres, and sphere and wall: resistance by the mesh alone and with the film law, beside the exact one (README.md, "Films").

  runs/studies/contact/films.py            runs film-wall.yaml and film-pair.yaml at some gaps (half a minute of one core each) and prints the table
  runs/studies/contact/films.py wall 0.1   one gap, in radii
"""

import csv
import subprocess
import sys
import tempfile
from math import acosh, cosh, log, pi, sinh
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
CELL = 0.25  # size of the finest cells, in radii
CLOSED, POWER = 0.136, 2.8  # of src/contact/law.c
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


def film(kind, gap):
    """What -contact_lubrication adds, with a range of one cell"""
    if gap >= CELL:
        return 0
    closed = CLOSED * CELL * (1 if kind == "wall" else 2)
    resolved = (gap**POWER + closed**POWER) ** (1 / POWER)
    if kind == "wall":
        return 1 / gap - 1 / resolved + log(resolved / gap) / 5
    return 2 * ((1 / gap - 1 / resolved) / 4 + 9 / 40 * log(resolved / gap))


def measure(kind, gap):
    """Force over 6 pi by the mesh alone"""
    heights = {"ball": 1 + gap} if kind == "wall" else {"below": 0.01 - 1 - gap / 2, "above": 0.01 + 1 + gap / 2}
    with tempfile.TemporaryDirectory() as folder:
        words = [str(ROOT / "build" / "tumble"), str(ROOT / "runs/studies/contact" / f"film-{kind}.yaml"), "-output_every", "0", "-output_dir", folder, "-output_overwrite"]
        for name, z in heights.items():
            words += [f"-particle_{name}_position", f"{PLACE},{z}"]
        subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
        with open(Path(folder) / "bodies.csv", newline="", encoding="utf-8") as file:
            return abs(float(list(csv.DictReader(file))[-1]["force_z"])) / (6 * pi)


def main():
    cases = [(sys.argv[1], float(sys.argv[2]))] if len(sys.argv) == 3 else [(kind, CELL * x) for kind in ("wall", "pair") for x in (2, 1, 0.5, 0.25, 0.125, 0.05, 0.02)]
    print("| | gap in cells | exact | mesh alone | off [%] | with film [%] |\n| --- | --- | --- | --- | --- | --- |")
    for kind, gap in cases:
        exact, ours = {"wall": wall, "pair": pair}[kind](gap), measure(kind, gap)
        print(f"| {kind} | {gap / CELL:.3g} | {exact:.4g} | {ours:.4g} | {100 * (ours / exact - 1):+.1f} | {100 * ((ours + film(kind, gap)) / exact - 1):+.1f} |", flush=True)


if __name__ == "__main__":
    main()
