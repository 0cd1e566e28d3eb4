#!/usr/bin/env python3
"""How far must a step be solved? Some scenes, each against itself solved to 1e-9 of the right-hand side:

    runs/studies/flow-solver/stopping/stopping.py [SCENE ...] [--build build] [-- OPTIONS]

Prints, for bounds -flow_rtol_max (or OPTIONS), the mean number of outer iterations a step and the largest deviation of the bodies' velocity, in
the largest speed, of their force, in the largest force, and of the kinetic energy. README.md has the table.
"""
import argparse
import csv
import math
import subprocess
import sys
from pathlib import Path

RUNS = Path(__file__).resolve().parents[3]
SCENES = {  # scene, options, steps
    "settling": ("sedimentation", ["-mesh_cells", "48,144"], 40),
    "two discs": ("dkt", ["-mesh_cells", "48,144"], 20),
    "504 discs": ("sedimentation-504", ["-output_bodies", "0,503"], 5),
    "light, heavy": ("light-and-heavy", [], 30),
    "ellipse": ("ellipse-falling", [], 20),
    "container": ("rotating-container", ["-preset", "balanced"], 20),
    "settling, nodal": ("sedimentation", ["-mesh_cells", "48,144", "-couple_method", "nodal"], 20),
    "settling, aligned": ("sedimentation", ["-mesh_cells", "48,144", "-couple_method", "aligned"], 20),
    "bench disc": ("bench/disc", [], 60),
    "400 discs": ("bench/discs", ["-output_bodies", "0,399"], 8),
    "400 discs, viscous": ("bench/discs", ["-output_bodies", "0,399", "-flow_viscosity", "1"], 8),
    "sphere": ("bench/sphere", ["-mesh_cells", "16,16,26"], 10),
}
REFERENCE = ["-flow_ksp_rtol", "1e-9"]
BOUNDS = [["-flow_rtol_max", bound] for bound in ("1e-6", "1e-5", "1e-4")]


def solve(build, name, options, out):
    scene, more, steps = SCENES[name]
    file = RUNS / f"{scene}.yaml"
    out.mkdir(parents=True, exist_ok=True)
    if "ksp_rtol: 1e-4" in file.read_text():
        text = file.read_text().replace("  ksp_rtol: 1e-4\n", "")
        file = out / "scene.yaml"
        file.write_text(text)
    words = [build / "tumble", file, *more, "-sim_steps", steps, "-output_every", 0, "-output_dir", out, "-output_overwrite", *options]
    subprocess.run([str(word) for word in words], check=True, stdout=subprocess.DEVNULL)
    return [list(csv.DictReader((out / f"{table}.csv").open())) for table in ("series", "bodies")]


def deviation(rows, others, names):
    size = max(math.hypot(*(float(row[name]) for name in names)) for row in rows)
    far = max(math.hypot(*(float(a[name]) - float(b[name]) for name in names)) for a, b in zip(rows, others, strict=True))
    return far / size if size > 0 else 0


def main():
    own, extra = sys.argv[1:], []
    if "--" in own:
        own, extra = own[: own.index("--")], own[own.index("--") + 1 :]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", default=list(SCENES), help=", ".join(SCENES))
    parser.add_argument("--build", type=Path, default=RUNS.parent / "build")
    options = parser.parse_args(own)
    print("| scene | options | iterations | velocity | force | energy |\n| --- | --- | --- | --- | --- | --- |")
    for name in options.scenes:
        out = Path("out/stopping") / name.replace(", ", "-").replace(" ", "-")
        series, bodies = solve(options.build, name, REFERENCE, out / "reference")
        for words in [extra] if extra else BOUNDS:
            other, moved = solve(options.build, name, words, out / "-".join(words).strip("-"))
            outer = sum(int(row["outer_iterations"]) for row in other) / len(other)
            energy = max(abs(float(a["kinetic_energy"]) - float(b["kinetic_energy"])) for a, b in zip(series, other, strict=True))
            energy /= max(float(row["kinetic_energy"]) for row in series)
            axes = "xyz"[: 3 if "w" in bodies[0] else 2]
            velocities = ["omega_z"] if name == "container" else list("uvw"[: len(axes)])  # the centre of the container is at rest
            velocity, force = deviation(bodies, moved, velocities), deviation(bodies, moved, [f"force_{axis}" for axis in axes])
            print(f"| {name} | {' '.join(words)} | {outer:.2f} | {velocity:.0e} | {force:.0e} | {energy:.0e} |", flush=True)


if __name__ == "__main__":
    main()
