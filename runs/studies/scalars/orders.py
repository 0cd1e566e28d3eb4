"""Orders of scalars: python3 runs/studies/scalars/orders.py [--build build] prints the table of README.md, "Orders".

In space: a disc of conductivity 10 in a uniform gradient, aligned, exact values on the sides of the box, x (1 - b a^2/r^2), b =
(k - 1)/(k + 1); the root mean square of what the field is off over the nodes outside of the disc and on it (of those inside it knows
other places, src/couple/scalarshift.h). In time: a mode of a box that decays, exp(-t/2) sin(pi x), on cells so fine that the step alone
counts."""

import argparse
import csv
import math
import subprocess
import tempfile
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parents[3]
A, K, X, Y = 0.3, 10, 0.013, 0.007
B = (K - 1) / (K + 1)
PLACE = f"(x-{X})*(1-{B * A * A!r}/((x-{X})^2+(y-{Y})^2))"
SPACE = f"""mesh: {{cells: [N, N], lower: [-1, -1], upper: [1, 1]}}
flow: {{density: 1, viscosity: 1}}
scalars: heat
scalar: {{heat: {{conductivity: 1, bc: {{left: &far {{value: "{PLACE}"}}, right: *far, bottom: *far, top: *far}}}}}}
particle: {{groups: disc, disc: {{shape: circle, radius: {A}, position: [{X}, {Y}], free: none, heat: {{conductivity: {K}}}}}}}
couple: {{method: aligned}}
sim: {{steady: true}}
output: {{every: 1}}
"""
RATE = 0.5
TIME = f"""mesh: {{cells: [16, 1], upper: [1, 0.0625]}}
flow: {{density: 1, viscosity: 1}}
scalars: heat
scalar: {{heat: {{conductivity: {RATE / math.pi**2!r}, initial: "sin(pi*x)", bc: {{left: {{value: 0}}, right: {{value: 0}}}}}}}}
sim: {{dt: DT, time: 2}}
output: {{every: 0}}
"""


def run(build, text, folder):
    """The output folder of a scene"""
    scene = Path(folder) / "scene.yaml"
    scene.write_text(text)
    out = Path(folder) / "out"
    subprocess.run([Path(build) / "tumble", scene, "-output_dir", out, "-output_overwrite", "-scalars_rtol", "1e-10"], check=True, stdout=subprocess.DEVNULL)
    return out


def measure_space(build, cells):
    with tempfile.TemporaryDirectory() as folder:
        out = run(build, SPACE.replace("N", str(cells)), folder)
        with h5py.File(next(out.glob("mesh*.h5"))) as mesh, h5py.File(out / "fields_1.h5") as fields:
            x, y = mesh["coordinates"][:, :2].T - np.array([[X], [Y]])
            T = np.ravel(fields["heat"][:])
    outside = np.hypot(x, y) > A * (1 - 1e-4)
    x, y, T = x[outside], y[outside], T[outside]
    return math.sqrt(np.mean((T - x * (1 - B * A * A / (x * x + y * y)))**2))


def measure_time(build, step, scheme):
    with tempfile.TemporaryDirectory() as folder:
        out = run(build, TIME.replace("DT", repr(step)) + f"flow_time: {scheme}\n", folder)
        with open(out / "series.csv") as file:
            mean = float(list(csv.DictReader(file))[-1]["scalar_mean_heat"])
    return abs(mean * math.pi / 2 - math.exp(-2 * RATE))


def orders(errors):
    return [math.log2(a / b) for a, b in zip(errors, errors[1:])]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default=ROOT / "build", help="build folder (default: %(default)s)")
    options = parser.parse_args()
    for what, values, measure in (("cells", (8, 16, 32, 64), lambda n: measure_space(options.build, n)),
                                  ("step, bdf2", (0.2, 0.1, 0.05, 0.025), lambda h: measure_time(options.build, h, "bdf2")),
                                  ("step, cn", (0.2, 0.1, 0.05, 0.025), lambda h: measure_time(options.build, h, "cn"))):
        errors = [measure(value) for value in values]
        print(f"| {what} | " + " | ".join(str(v) for v in values) + " |")
        print("| error | " + " | ".join(f"{e:.2e}" for e in errors) + " |")
        print("| order | | " + " | ".join(f"{o:.2f}" for o in orders(errors)) + " |")


if __name__ == "__main__":
    main()
