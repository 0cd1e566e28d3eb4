"""Output: columns and their table, field `body`, pictures of bodies, files as VTK and meshio read them, options.txt as a scene."""
import csv
import json
import os
import pty
import re
import subprocess
import sys

import h5py
import numpy as np
import pytest

from conftest import ROOT
from packages import GROUP

SQUARE = "-0.1 -0.1\n0.1 -0.1\n0.1 0.1\n-0.1 0.1\n"
PERIODIC = """\
mesh: {cells: [8, 6], lower: [0, 0], upper: [2, 1], periodic: x}
flow: {density: 1, viscosity: 0.1, force: [1, 0]}
particle:
  groups: "square,needle"
  square: {shape: polygon, file: square.txt, density: 1, position: [0.02, 0.5], angle: 0.3}
  needle: {shape: ellipse, a: 0.2, b: 0.02, density: 2, position: [1, 0.4], angle: 0.5}
couple: {method: penalty}
sim: {dt: 0.01, steps: 2}
output: {every: 1}
"""
CHANNEL = """\
mesh: {cells: [8, 6], lower: [0, 0], upper: [2, 1]}
flow: {density: 1, viscosity: 0.1, bc: {left: {type: inflow, velocity: [1.5, 0], profile: parabolic}, right: {type: outflow}}}
particle: {groups: disc, disc: {shape: circle, radius: 0.1, density: 1, position: [0.7, 0.5], free: none, reference_speed: 1}}
couple: {method: aligned}
monitor: {momentum: true, dp: [0.2, 0.5, 1.5, 0.5]}
sim: {dt: 0.1, steps: 3, adapt: true}
output: {every: 1}
"""
EMPTY_CHANNEL = """\
mesh: {cells: [4, 6], lower: [0, 0], upper: [2, 1]}
flow: {density: 1, viscosity: 0.1, bc: {left: {type: inflow, velocity: [1.5, 0], profile: parabolic}, right: {type: outflow}}}
sim: {steady: true}
"""
BALL = """\
mesh: {dimension: 3, cells: [4, 4, 8], lower: [0, 0, 0], upper: [1, 1, 2]}
flow: {density: 1, viscosity: 0.1, gravity: [0, 0, -981]}
particle: {groups: ball, ball: {shape: ellipse, a: 0.15, b: 0.1, c: 0.1, density: 1.25, position: [0.5, 0.5, 1.25], angular_velocity: [3, 0, 4]}}
couple: {method: penalty}
sim: {dt: 0.01, steps: 2}
output: {every: 1}
"""


@pytest.fixture
def results(run, scene, tmp_path):
    def start(text, name, ranks=1, *options):
        (tmp_path / "square.txt").write_text(SQUARE)
        done = run([scene(text, name + ".yaml"), "-output_dir", f"{name}{ranks}", *options], ranks)
        assert done.status == 0, str(done)
        return done.folder / f"{name}{ranks}"

    return start


def last_row(path):
    with open(path) as file:
        return list(csv.DictReader(file))[-1]


# ---- columns ----


def explained():
    """Patterns of the columns in runs/reference/OUTPUT.md."""
    names = re.findall(r"^\| `([^`]+)` ", (ROOT / "runs" / "reference" / "OUTPUT.md").read_text(), re.M)
    return [re.compile(re.sub("<[^>]*>", ".+", name.replace("\\|", "|")) + "$") for name in names]


def test_page_is_what_the_program_prints():
    text = subprocess.run([ROOT / "build" / "tumble", "-help", "output"], capture_output=True, text=True, check=True).stdout
    assert text == (ROOT / "runs" / "reference" / "OUTPUT.md").read_text(), "run 'make options'"
    rows = [row for row in text.splitlines() if row.startswith("| `")]
    assert len(rows) > 60 and all(row.count(" |") >= 3 for row in rows)


def test_every_column_is_explained(results):
    patterns = explained()
    for name, text in (("periodic", PERIODIC), ("channel", CHANNEL), ("ball", BALL)):
        out = results(text, name)
        for table in ("series.csv", "bodies.csv"):
            for column in last_row(out / table):
                assert any(pattern.match(column) for pattern in patterns), f"{table} of {name}: {column}"
        for file in out.glob("*.h5"):
            with h5py.File(file) as h5:
                for dataset in h5:
                    assert dataset in (ROOT / "runs" / "reference" / "OUTPUT.md").read_text(), f"{file.name}: {dataset}"


@pytest.mark.parametrize("ranks", [1, 2])
def test_channel_in_numbers(results, ranks):
    """Developed flow, u = 6 y (1 - y), p = 1.2 (2 - x): friction mu 6 on each wall, and the pressure's mean 1.2 times the length."""
    row = {name: float(value) for name, value in last_row(results(EMPTY_CHANNEL, "channel", ranks) / "series.csv").items()}
    assert [row["flow_rate_left"], row["flow_rate_right"]] == pytest.approx([-1, 1], rel=1e-9)
    assert [row["mean_velocity_x"], row["mean_velocity_y"]] == pytest.approx([1, 0], abs=1e-9)
    assert [row["wall_force_bottom_x"], row["wall_force_top_x"]] == pytest.approx([1.2, 1.2], rel=1e-8)
    assert [row["wall_force_bottom_y"], row["wall_force_top_y"]] == pytest.approx([-2.4, 2.4], rel=1e-8)
    assert "flow_rate_top" not in row and "wall_force_left_x" not in row


def test_forces_add_up_to_the_balance(results):
    row = {name: float(value) for name, value in last_row(results(CHANNEL, "channel", 1, "-flow_solver", "accurate") / "series.csv").items()}
    assert row["flow_rate_left"] + row["flow_rate_right"] == pytest.approx(0, abs=1e-7)
    assert row["wall_force_bottom_y"] + row["wall_force_top_y"] == pytest.approx(-row["momentum_walls_y"], abs=1e-9)
    assert row["wall_force_bottom_x"] > 0 and row["wall_force_top_x"] > 0 and row["wall_force_top_y"] > 0 > row["wall_force_bottom_y"]


# ---- fields ----


@pytest.mark.parametrize("method", ["nodal", "penalty", "aligned"])
def test_body_marks_what_lies_inside(results, method):
    out = results(PERIODIC, "periodic", 1, "-couple_method", method)
    with h5py.File(out / "mesh.h5") as mesh, h5py.File(out / "fields_2.h5") as fields, h5py.File(out / "bodies_2.h5") as bodies:
        x, body = mesh["coordinates"][:, :2], np.ravel(fields["body"][:])
        r = x - bodies["position"][1, :2]
        angle = float(np.ravel(bodies["angle"][:])[1])
        a, b = r @ [np.cos(angle), np.sin(angle)], r @ [-np.sin(angle), np.cos(angle)]
        level = np.hypot(a / 0.2, b / 0.02)
        sign = np.abs(level - 1) > 0.3  # nodes near the surface may have changed sides within the step
        assert (body[sign & (level < 1)] == 1).all() and (body[sign & (level > 1)] != 1).all()
        if method == "penalty":
            assert (body == 1).any() and (body == 0).any()


def test_periodic_mesh_shares_points(results):
    points = []
    for ranks in (1, 2):
        with h5py.File(results(PERIODIC, "periodic", ranks) / "mesh.h5") as mesh:
            x, cells = mesh["coordinates"][:], mesh["cells"][:]
        assert len(x) == 17 * 13 and len(np.unique(x.round(9), axis=0)) == len(x)
        assert sorted(np.unique(cells)) == list(range(len(x)))
        assert np.ptp(x[cells], axis=1)[:, 0].max() == pytest.approx(0.25)
        points.append(x[np.lexsort(x.T)])
    assert np.allclose(*points)


# ---- pictures of bodies ----


def test_outline_has_corners_and_images(results):
    with h5py.File(results(PERIODIC, "periodic") / "bodies_2.h5") as file:
        line, outline, owner = file["line"][:], file["outline"][:], np.ravel(file["cell_body"][:])
        position, angle = file["position"][:], np.ravel(file["angle"][:])
    assert owner.tolist() == [0, 0, 1]  # the square reaches over the left side, and has an image at the right one
    cos, sin = np.cos(angle), np.sin(angle)

    def local(i, k, shift=0):
        r = outline[line[i]][:, :2] - position[k, :2] - [shift, 0]
        return r @ np.array([[cos[k], -sin[k]], [sin[k], cos[k]]])

    for i, shift in ((0, 0), (1, 2)):
        x = local(i, 0, shift)
        assert np.abs(x).max(1) == pytest.approx(np.full(len(x), 0.1), abs=1e-9)  # all points on the sides
        for corner in ((-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)):
            assert np.abs(x - corner).max(1).min() < 1e-9, corner
        assert x[0] == pytest.approx([0.1, 0], abs=1e-9) and x[0] == pytest.approx(x[-1])  # closed, begins on the axis
    x = local(2, 1)
    assert np.hypot(x[:, 0] / 0.2, x[:, 1] / 0.02) == pytest.approx(np.ones(len(x)), abs=0.1) and x[0] == pytest.approx([0.2, 0], abs=1e-6)


def rotation(q):
    w, x, y, z = q
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def test_surface_and_orientation(results):
    out = results(BALL, "ball")
    with h5py.File(out / "bodies_2.h5") as file:
        x, triangle, q, centre = file["surface"][:], file["triangle"][:], file["orientation"][0], file["position"][0]
    row = last_row(out / "bodies.csv")
    assert [float(row[f"q{i}"]) for i in range(4)] == pytest.approx(q, abs=1e-11)
    assert q @ q == pytest.approx(1) and abs(q[1]) > 1e-3 and abs(q[3]) > 1e-3
    r = (x - centre) @ rotation(q)  # body axes
    assert np.linalg.norm(r / [0.15, 0.1, 0.1], axis=1) == pytest.approx(np.ones(len(r)), abs=1e-9)
    edges, count = np.unique(np.sort(np.concatenate([triangle[:, [0, 1]], triangle[:, [1, 2]], triangle[:, [2, 0]]]), axis=1), axis=0, return_counts=True)
    assert (count == 2).all() and len(x) - len(edges) + len(triangle) == 2  # closed, a sphere by Euler's formula
    volume = np.einsum("ij,ij->", r[triangle[:, 0]], np.cross(r[triangle[:, 1]], r[triangle[:, 2]])) / 6
    assert volume == pytest.approx(4 / 3 * np.pi * 0.15 * 0.1 * 0.1, rel=0.03)  # normals outward


# ---- readers ----

VTK = """
import json, sys
from vtkmodules.vtkIOXdmf2 import vtkXdmfReader
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as Pipeline
found = []
for path in sys.argv[1:]:
    reader = vtkXdmfReader()
    reader.SetFileName(path)
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(Pipeline.TIME_STEPS())
    reader.UpdateTimeStep(times[-1])
    grid = reader.GetOutputDataObject(0)
    arrays = [data.GetArrayName(i) for data in (grid.GetPointData(), grid.GetCellData()) for i in range(data.GetNumberOfArrays())]
    at = [0, 0, 0]
    if grid.GetCellType(0) in (28, 29):
        grid.GetCell(0).EvaluateLocation(__import__("vtkmodules.vtkCommonCore").vtkCommonCore.reference(0), (0.3, 0.7, 0.2), at, [0.0] * 27)
    found.append([list(times), grid.GetNumberOfPoints(), grid.GetNumberOfCells(), grid.GetCellType(0), arrays, at])
print(json.dumps(found))
"""
FILES = ("fields.xdmf", "bodies.xdmf", "centres.xdmf")


def ask(python, program, out):
    done = subprocess.run([python, "-c", program, *(str(out / file) for file in FILES)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


SCENES = [("channel", CHANNEL), ("periodic", PERIODIC), ("ball", BALL)]


@pytest.mark.xdist_group(GROUP)  # which one worker installs
@pytest.mark.parametrize("name, text", SCENES)
def test_vtk_reads(results, packages, name, text):
    kind = 29 if name == "ball" else 28
    out = results(text, name)
    fields, bodies, centres = ask(packages, VTK, out)
    assert len(fields[0]) == len(bodies[0]) == len(centres[0]) == (3 if name == "channel" else 2)
    with h5py.File(out / "mesh.h5") as mesh:
        x, cells = mesh["coordinates"][:], mesh["cells"][:]
    assert fields[1:4] == [len(x), len(cells), kind]
    assert fields[4] == ["velocity", "vorticity", "pressure", "body", "pressure_mean", "pressure_gradient"]
    if name != "channel":  # the inside of a cell is where VTK takes it to be: nodes are in VTK's order
        box = x[cells[0]].min(0), np.ptp(x[cells[0]], axis=0)
        assert fields[5] == pytest.approx(box[0] + box[1] * [0.3, 0.7, 0.2], abs=1e-12)
    assert bodies[3] == (5 if name == "ball" else 4) and bodies[4] == ["velocity", "angular_velocity", "body", "group"]
    assert centres[3] in (1, 2) and "orientation" not in bodies[4] and "contact_force" in centres[4]


MESHIO = """
import json, sys, meshio
found = []
for path in sys.argv[1:]:
    with meshio.xdmf.TimeSeriesReader(path) as reader:
        points, cells = reader.read_points_cells()
        time, at_points, at_cells = reader.read_data(reader.num_steps - 1)
    found.append([time, points.shape, [cell.type for cell in cells], int(cells[0].data.max()), [len(v) for v in at_points.values()], sorted({**at_points, **at_cells})])
print(json.dumps(found))
"""


@pytest.mark.xdist_group(GROUP)
@pytest.mark.parametrize("name, text", SCENES)
def test_meshio_reads(results, packages, name, text):
    kinds = ("hexahedron27", "triangle", "vertex") if name == "ball" else ("quad9", "line", "vertex")
    for kind, (time, shape, blocks, last, lengths, names) in zip(kinds, ask(packages, MESHIO, results(text, name))):
        assert time > 0 and blocks == [kind] and shape[1] == 3 and last == shape[0] - 1
        assert "velocity" in names and all(n == shape[0] for n in lengths)


PLAIN = """
import json, sys, meshio, numpy, pyvista
mesh, grid = meshio.read(sys.argv[1]), pyvista.read(sys.argv[2])
grid = grid[-1] if isinstance(grid, pyvista.MultiBlock) else grid
print(json.dumps([list(mesh.points.shape), [[cell.type, len(cell.data)] for cell in mesh.cells], sorted({**mesh.point_data, **mesh.cell_data}),
                  float(abs(mesh.point_data["velocity"]).max()), grid.n_points, grid.n_cells, float(abs(grid["velocity"]).max())]))
"""


@pytest.mark.xdist_group(GROUP)
@pytest.mark.parametrize("name, text", [SCENES[0], SCENES[2]], ids=["channel", "ball"])
def test_one_line_reads(results, packages, name, text):
    """meshio.read, which takes one grid, the newest snapshot; pyvista.read all."""
    out = results(text, name)
    done = subprocess.run([packages, "-c", PLAIN, out / "fields_last.xdmf", out / "fields.xdmf"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    shape, cells, names, speed, points, count, _ = json.loads(done.stdout)
    last = max(out.glob("fields_[0-9]*.h5"), key=lambda path: int(re.findall(r"\d+", path.stem)[0]))
    with h5py.File(last) as file:
        assert speed == abs(file["velocity"][:]).max() > 0 and set(names) <= set(file)
        assert shape == [len(file["velocity"]), 3] and points == shape[0]
    assert cells == [["hexahedron27" if name == "ball" else "quad9", count]]


# ---- options.txt ----


# as thick as the preset that options.txt names asks for
THICK = """\
mesh: {cells: [16, 8], lower: "0, 0", upper: [2, 1], periodic: x}
flow: {density: 1, viscosity: 0.1, force: [1, 0]}
particle: {groups: disc, disc: {shape: circle, radius: 0.3, density: 1.5, position: [1, 0.5]}}
sim: {dt: 0.01, steps: 2}
output: {every: 1}
"""


def test_options_are_a_scene(results, run):
    out = results(THICK, "periodic", 1, "-flow_solver", "direct")
    again = run([str(out / "options.txt")])
    assert again.status == 0, str(again)
    other = again.folder / "out" / "periodic1-again"
    for table in ("series.csv", "bodies.csv"):
        rows = [list(csv.DictReader(open(folder / table))) for folder in (out, other)]
        strip = [[{k: v for k, v in row.items() if not k.startswith("seconds")} for row in part] for part in rows]
        assert strip[0] == strip[1] and len(strip[0]) >= 2
    twice = run([str(out / "options.txt")])
    assert twice.status and "already holds the results" in str(twice)
    elsewhere = run([str(out / "options.txt"), "-output_dir", "elsewhere"])
    assert elsewhere.status == 0 and (elsewhere.folder / "elsewhere" / "series.csv").exists(), str(elsewhere)
    (out / "broken-options.txt").write_text("# fine\n-sim_dt 1\nsim_steps 2\n")
    broken = run([str(out / "broken-options.txt")])
    assert broken.status and "broken-options.txt:3: options.txt is a list of '-name value'" in str(broken)


def watch(program, args, folder):
    """What stands on a terminal while a program runs there."""
    master, slave = pty.openpty()
    environment = {**os.environ, "TERM": "xterm"}
    process = subprocess.Popen([program, *args], cwd=folder, stdin=slave, stdout=slave, stderr=slave, env=environment)
    os.close(slave)
    text = b""
    while True:
        try:
            new = os.read(master, 65536)
        except OSError:  # the other end is closed
            break
        if not new:
            break
        text += new
    os.close(master)
    assert process.wait() == 0, text.decode()
    return text.decode()


def test_bar_stands_on_a_terminal(scene, tmp_path, program):
    """Between two lines of progress; it is gone when they are printed, and never in a file."""
    path = scene(PERIODIC.split("particle:")[0] + "sim: {dt: 0.01, steps: 8}\n", "bar.yaml")
    options = [str(path), "-output_progress", "4"]
    text = watch(str(program), options, tmp_path)
    bars = re.findall(r"\r\x1b\[K\[(#+) +\] (\d+) %, step (\d+), \d+ s left\r", text)
    assert bars and all(abs(len(bar) - 0.4 * float(part)) <= 1 and float(part) == pytest.approx(12.5 * float(step), abs=0.51) for bar, part, step in bars), repr(text)
    assert re.search(r"\r\x1b\[K +4 +0\.04 .* 50 % ", text), repr(text)
    plain = subprocess.run([str(program), *options, "-output_overwrite"], cwd=tmp_path, capture_output=True, text=True)
    assert plain.returncode == 0 and "\r" not in plain.stdout and "\x1b" not in plain.stdout
    assert len(re.findall(r"^ +\d+ .* % +\d+ s$", plain.stdout, re.M)) == 3, plain.stdout
