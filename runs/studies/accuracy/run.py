"""Estimated errors (-monitor_accuracy) beside true ones: runs the scenes below, writes data.csv and estimate.png.

    python3 runs/studies/accuracy/run.py [build/tumble [WORD]]     # with WORD scenes with that in their names alone, rows of others stay

True values: exact or published ones, else that of a mesh of at least four times as many cells along each axis.
"""
import csv
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
PROGRAM = sys.argv[1] if len(sys.argv) > 1 else str(ROOT / "build" / "tumble")
CHANNEL = """mesh: {kind: fitted, lower: [-10, -2], upper: [10, 2], centre: [0, 0], radius: 1}
flow: {density: 1, viscosity: 1, convection: false, bc_left: {type: inflow, profile: parabolic, velocity: [1.5, 0]}, bc_right: {type: outflow}}
particle: {groups: c, c: {shape: circle, radius: 1, position: [0, 0], free: none}}
sim: {steady: true}
"""
JOURNAL = """mesh: {kind: disc, radius: 1}
flow: {density: 1, viscosity: 1, convection: false}
particle: {groups: j, j: {shape: circle, radius: 0.4, position: [0.3, 0], free: none, angular_velocity: 1}}
sim: {steady: true}
"""
ARRAY = """mesh: {lower: [-0.5, -0.5], upper: [0.5, 0.5], periodic: [x, y]}
flow: {density: 1, viscosity: 1, convection: false, force: [1, 0]}
particle: {groups: c, c: {shape: circle, radius: 0.25231325, position: [0.0123, -0.0071], free: none}}
sim: {steady: true}
"""
ELLIPSE = """mesh: {lower: [0, 0], upper: [4, 2]}
flow: {density: 1, viscosity: 0.02, bc_left: {type: inflow, profile: parabolic, velocity: [1, 0]}, bc_right: {type: outflow}}
particle: {groups: e, e: {shape: ellipse, a: 0.3, b: 0.15, angle: 0.5, position: [1.2, 1.05], free: none}}
sim: {steady: true}
"""
STEP = """mesh: {lower: [0, 0], upper: [1, 1]}
flow: {density: 1, viscosity: 0.01, bc_top: {type: moving_wall, velocity: ["16*x*x*(1-x)*(1-x)", 0]}}
sim: {steady: true}
"""
SQUARES = ARRAY.replace("shape: circle, radius: 0.25231325", "shape: box, size: [0.6, 0.6]")
ELLIPSES = ARRAY.replace("shape: circle, radius: 0.25231325", "shape: ellipse, a: 0.4, b: 0.3, angle: 0.4")
PAIR = ELLIPSE.replace("groups: e, e: {shape: ellipse, a: 0.3, b: 0.15, angle: 0.5, position: [1.2, 1.05], free: none}",
                       "groups: [a, b], a: {shape: circle, radius: 0.2, position: [1.2, 0.6], free: none}, b: {shape: circle, radius: 0.25, position: [1.4, 1.4], free: none}")
BLOCK = ELLIPSE.replace("shape: ellipse, a: 0.3, b: 0.15, angle: 0.5", "shape: box, size: [0.4, 0.3]")
TROUGH = """mesh: {lower: [0, 0], upper: [2, 1]}
flow: {density: 1, viscosity: 0.01, bc_top: {type: moving_wall, velocity: [1, 0]}}
sim: {steady: true}
"""
DRAG = "runs/validate/unseen/disc-container.yaml"
BALL = "runs/sphere-in-sphere.yaml"
SPHERES = "runs/sphere-array.yaml"
CYLINDER = "runs/cylinder-2d1.yaml"
CAVITY = "runs/cavity-re1000.yaml"
BOX = "-mesh_kind box -mesh_upper 2.2,0.41 -mesh_levels 1"
# name, scene, options, meshes, true value: a number, or the options of the mesh that has it
SCENES = [
    ("2D-1, fitted", CYLINDER, "", [f"-mesh_resolution {n}" for n in (3, 4, 6)], 0.01115907046768),
    ("2D-1, aligned", CYLINDER, BOX + " -couple_method aligned", ["-mesh_cells 44,8", "-mesh_cells 66,12"], 0.01115907046768),
    ("2D-1, penalty", CYLINDER, BOX + " -couple_method penalty", ["-mesh_cells 44,8", "-mesh_cells 66,12", "-mesh_cells 88,16"], 0.01115907046768),
    ("channel, Stokes, fitted", CHANNEL, "", [f"-mesh_resolution {n}" for n in (4, 6, 8)], "-mesh_resolution 32"),
    ("bearing, aligned", JOURNAL, "-couple_method aligned", [f"-mesh_resolution {n}" for n in (12, 16)], 2.77299),
    ("bearing, penalty", JOURNAL, "-couple_method penalty", [f"-mesh_resolution {n}" for n in (12, 16, 24)], 2.77299),
    ("array of discs, aligned", ARRAY, "-couple_method aligned", ["-mesh_cells 12,12", "-mesh_cells 20,20"], "-couple_method aligned -mesh_cells 96,96"),
    ("array of discs, penalty", ARRAY, "-couple_method penalty", ["-mesh_cells 16,16", "-mesh_cells 24,24", "-mesh_cells 32,32"],
     "-couple_method aligned -mesh_cells 96,96"),
    ("ellipse at Re 15, aligned", ELLIPSE, "-couple_method aligned", ["-mesh_cells 32,16", "-mesh_cells 48,24"], "-couple_method aligned -mesh_cells 192,96"),
    ("ellipse at Re 15, penalty", ELLIPSE, "-couple_method penalty", ["-mesh_cells 48,24", "-mesh_cells 64,32"], "-couple_method aligned -mesh_cells 192,96"),
    ("regularised cavity, Re 100", STEP, "", ["-mesh_cells 8,8", "-mesh_cells 12,12", "-mesh_cells 16,16"], "-mesh_cells 64,64"),
    ("cavity, Re 1000", CAVITY, "", ["-mesh_cells 24,24", "-mesh_cells 40,40", "-mesh_cells 64,64"], "-mesh_cells 128,128"),
    # ten that were declared before they were run
    ("squares, aligned", SQUARES, "-couple_method aligned", ["-mesh_cells 16,16", "-mesh_cells 24,24"], "-couple_method aligned -mesh_cells 128,128"),
    ("squares, penalty", SQUARES, "-couple_method penalty", ["-mesh_cells 16,16", "-mesh_cells 24,24"], "-couple_method aligned -mesh_cells 128,128"),
    ("ellipses, aligned", ELLIPSES, "-couple_method aligned", ["-mesh_cells 16,16", "-mesh_cells 24,24"], "-couple_method aligned -mesh_cells 96,96"),
    ("ellipses, penalty", ELLIPSES, "-couple_method penalty", ["-mesh_cells 16,16", "-mesh_cells 24,24"], "-couple_method aligned -mesh_cells 96,96"),
    ("disc in a circle, aligned", DRAG, "-couple_method aligned", ["-mesh_resolution 8", "-mesh_resolution 12"], -24.9362),
    ("disc in a circle, penalty", DRAG, "-couple_method penalty", ["-mesh_resolution 12", "-mesh_resolution 20"], -24.9362),
    ("two cylinders, aligned", PAIR, "-couple_method aligned", ["-mesh_cells 40,20", "-mesh_cells 60,30"], "-couple_method aligned -mesh_cells 192,96"),
    ("two cylinders, penalty", PAIR, "-couple_method penalty", ["-mesh_cells 40,20", "-mesh_cells 60,30"], "-couple_method aligned -mesh_cells 192,96"),
    ("block in a channel, aligned", BLOCK, "-couple_method aligned", ["-mesh_cells 40,20", "-mesh_cells 60,30"], "-couple_method aligned -mesh_cells 240,120"),
    ("trough, Re 100", TROUGH, "", ["-mesh_cells 16,8", "-mesh_cells 24,12"], "-mesh_cells 128,64"),
    ("spheres, aligned", SPHERES, "", ["-mesh_cells 8,8,8", "-mesh_cells 12,12,12"], 1 / (6 * 3.141592653589793 * 0.24814020 * 2.8102)),
]


def solve(scene, options, estimate):
    """Value of what is estimated, its name and the estimate"""
    with tempfile.TemporaryDirectory() as folder:
        path = ROOT / scene if scene.endswith(".yaml") else Path(folder) / "scene.yaml"
        if not scene.endswith(".yaml"):
            path.write_text(scene)
        out = Path(folder) / "out"
        words = [PROGRAM, str(path), *options.split(), "-monitor_accuracy", "true" if estimate else "false", "-output_dir", str(out)]
        done = subprocess.run(words, capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"{' '.join(words)}\n{done.stdout}{done.stderr}")
        found = re.search(r"estimated error of (\w+)", done.stdout)
        quantity = json.loads((out / "summary.json").read_text())
        row = list(csv.DictReader((out / "series.csv").open()))[-1]
        bodies = list(csv.DictReader((out / "bodies.csv").open()))
        values = {**row, **(bodies[-1] if bodies else {})}
        text = json.dumps(quantity)
        number = re.search(r'"estimated_error_\w+": ([-+.e0-9]+)', text)
        return values, found and found.group(1), number and float(number.group(1))


def main():
    rows = []
    word = sys.argv[2] if len(sys.argv) > 2 else ""
    before = list(csv.reader((HERE / "data.csv").open()))[1:] if word else []
    for name, scene, options, meshes, true in SCENES:
        known = {}
        if word not in name:
            rows += [row for row in before if row[0] == name]
            continue
        for mesh in meshes:
            values, what, estimate = solve(scene, f"{options} {mesh}", True)
            if what not in known:
                known[what] = true if isinstance(true, float) else float(solve(scene, f"{options} {true}", False)[0][what])
            error = abs(float(values[what]) / known[what] - 1)
            rows.append([name, mesh, what, f"{float(values[what]):.9g}", f"{known[what]:.9g}", f"{error:.3e}", f"{estimate:.3e}", f"{estimate / error:.2f}"])
            print(*rows[-1], sep=" | ", flush=True)
    with (HERE / "data.csv").open("w") as file:
        csv.writer(file).writerows([["scene", "mesh", "of", "value", "true", "error", "estimate", "ratio"], *rows])
    draw(rows)


def draw(rows):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    plt.figure(figsize=(7, 6))
    for i, name in enumerate(dict.fromkeys(row[0] for row in rows)):
        points = [row for row in rows if row[0] == name]
        plt.loglog([100 * float(p[5]) for p in points], [100 * float(p[6]) for p in points], "osD^v<>PX*hd8"[i % 13], color=f"C{i % 10}", label=name)
    ends = [1e-4, 30]
    plt.plot(ends, ends, "k-", lw=0.8)
    plt.plot(ends, [0.5 * v for v in ends], "k--", lw=0.8, label="half, five times the true error")
    plt.plot(ends, [5 * v for v in ends], "k--", lw=0.8)
    plt.xlabel("true error, %")
    plt.ylabel("estimate, %")
    plt.legend(fontsize=7)
    plt.tight_layout()
    plt.savefig(HERE / "estimate.png", dpi=110)


if __name__ == "__main__":
    main()
