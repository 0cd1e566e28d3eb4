"""A box that travels (-sim_frame): the same physics as at rest, results as seen from the laboratory."""
import csv
import xml.etree.ElementTree as xml

import h5py
import numpy
import pytest

SIZE = numpy.array([1, 1.5])
BOX = """\
mesh: {cells: [16, 24], lower: [0, 0], upper: [1, 1.5], periodic: [x, y]}
flow: {density: 1, viscosity: 0.05, gravity: [0, -100], ksp_rtol: 1e-11}
particle:
  groups: [disc, light, post]
  disc: {shape: circle, radius: 0.125, density: 1.5, position: [0.3, 1]}
  light: {shape: ellipse, a: 0.2, b: 0.12, angle: 0.5, position: [0.65, 0.6], density: 0.8}
  post: {shape: circle, radius: 0.1, position: [0.3, 0.3], free: none, motion: constant, velocity: [0, 0]}
sim: {dt: 0.005, steps: 6}
"""
FALL = """\
mesh: {cells: [16, 32], lower: [0, 0], upper: [1, 2]}
flow: {density: 1, viscosity: 0.1, gravity: [0, -981], bc: {bottom: {type: inflow, velocity: [0, 0]}, top: {type: outflow}}}
particle:
  groups: disc
  disc: {shape: circle, radius: 0.125, density: 1.25, position: [0.48, 1.2]}
sim: {dt: 0.005, steps: 8, frame: body}
"""
CUBE = """\
mesh: {dimension: 3, cells: [6, 6, 6], lower: [0, 0, 0], upper: [1, 1, 1], periodic: [x, y, z]}
flow: {density: 1, viscosity: 0.05, gravity: [0, 0, -10]}
particle: {groups: ball, ball: {shape: circle, radius: 0.25, density: 2, position: [0.5, 0.5, 0.5]}}
sim: {dt: 0.02, steps: 3, frame: body}
"""


def good(result, folder, name="bodies.csv"):
    assert result.status == 0, str(result)
    with open(result.folder / folder / name) as file:
        return [{k: float(v) for k, v in row.items() if k != "group"} for row in csv.DictReader(file)]


CASES = {
    "penalty": [],
    "aligned": ["-couple_method", "aligned"],
    "crank nicolson": ["-flow_time", "cn", "-couple_method", "nodal"],
    "explicit": ["-couple_type", "explicit", "-particle_light_density", 4],
}


@pytest.mark.parametrize("case", CASES)
def test_galilei(run, scene, case):
    """Travelling at V is the same discrete problem as a box at rest where all starts with -V, whatever the way in a step."""
    name, speed = scene(BOX), numpy.array([0.7, 2.3])
    back = ",".join(str(-v) for v in speed)
    common = [name, "-output_every", 6, *CASES[case]]
    moving = good(run([*common, "-sim_frame", "velocity", "-sim_frame_velocity", "0.7,2.3", "-output_dir", "moving"]), "moving")
    options = [f"-particle_{group}_velocity" for group in ("disc", "light", "post")]
    result = run([*common, "-flow_velocity", back, *[word for option in options for word in (option, back)], "-output_dir", "resting"])
    for a, b in zip(moving, good(result, "resting"), strict=True):
        way = numpy.array([a["x"] - b["x"], a["y"] - b["y"]]) - speed * a["time"]
        assert abs(way - SIZE * numpy.round(way / SIZE)).max() < 1e-9
        assert abs(numpy.array([a["u"] - b["u"], a["v"] - b["v"]]) - speed).max() < 1e-8
        assert abs(a["angle"] - b["angle"]) < 1e-9
    with h5py.File(result.folder / "moving" / "fields_6.h5") as a, h5py.File(result.folder / "resting" / "fields_6.h5") as b:
        assert abs(a["velocity"][:, :2] - speed - b["velocity"][:, :2]).max() < 1e-8


def test_follows(run, scene):
    """Against the box at rest: places and speeds but for the error of the mesh; the disc stays where it is in the box."""
    name = scene(FALL)
    result = run([name, "-output_dir", "moving", "-output_every", 8, "-couple_method", "aligned"], 2)
    here = good(result, "moving")[-1]
    there = good(run([name, "-sim_frame", "none", "-output_dir", "resting", "-couple_method", "aligned"]), "resting")[-1]
    series = good(result, "moving", "series.csv")[-1]
    assert abs(here["v"] / there["v"] - 1) < 2e-3 and abs((here["y"] - 1.2) / (there["y"] - 1.2) - 1) < 2e-3
    assert series["frame_x"] == 0 and abs(here["y"] - series["frame_y"] - 1.2) < 1e-3 and series["frame_y"] < -0.02
    assert abs(series["frame_velocity_y"] / here["v"] - 1) < 0.05
    assert abs(series["flow_rate_bottom"] - series["frame_velocity_y"]) < 1e-6  # width 1: fluid at rest comes in as the box comes down
    with h5py.File(result.folder / "moving" / "bodies_8.h5") as file:
        assert abs(file["position"][0, 1] - here["y"]) < 1e-9
    tree = xml.parse(result.folder / "moving" / "fields.xdmf")
    mesh = next(item.text.strip() for item in tree.iter("DataItem") if item.text and "coordinates" in item.text).split(":")[0]
    with h5py.File(result.folder / "moving" / mesh) as file:
        y = file["coordinates"][:, 1]
        assert abs(y.min() - series["frame_y"]) < 1e-9 and abs(y.max() - 2 - series["frame_y"]) < 1e-9


def test_space(run, scene):
    """Beside a back-flow: the momentum of all stays zero, seen from the laboratory."""
    result = run([scene(CUBE), "-output_dir", "out", "-couple_backflow", "force"], 2)
    rows, series = good(result, "out"), good(result, "out", "series.csv")
    assert rows[-1]["w"] < -0.1 and abs(rows[-1]["z"] - series[-1]["frame_z"] - 0.5) < 1e-3
    # ball twice as heavy: its excess momentum is that of the fluid and the ball's share, backwards
    momentum = series[-1]["mean_velocity_z"] + 4 / 3 * numpy.pi * 0.25**3 * rows[-1]["w"]
    assert abs(momentum) < 1e-4 * abs(rows[-1]["w"])


BAD = {
    "wall": (FALL, ["-sim_frame_axes", "x"], "a wall (or a boundary that is no plane along an axis) stands across x"),
    "closed": (FALL, ["-flow_bc_top_type", "no_slip"], "walls stand across every axis"),
    "way": (FALL, ["-sim_frame", "velocity", "-sim_frame_velocity", "1,1"], "stands across x"),
    "no velocity": (FALL, ["-sim_frame", "velocity"], "give the velocity of the box with -sim_frame_velocity"),
    "no body": (FALL, ["-sim_frame_body", 1], "this scene has 1 bodies"),
    "no axis": (FALL, ["-sim_frame_axes", "z"], "'z' is no axis of this scene"),
    "stokes": (FALL, ["-flow_convection", "false"], "set -flow_convection true"),
}


@pytest.mark.parametrize("fault", BAD)
def test_refused(run, scene, fault):
    text, options, message = BAD[fault]
    result = run([scene(text), "-output_dir", "out", *options])
    assert result.status == 1 and result.text.count("tumble: error:") == 1 and message in result.text, str(result)
