"""Bodies that turn about an axis or travel along a direction, orientation at the start, obstacles, bodies made of shapes in the scene."""
import math

import pytest

from conftest import read_rows
from test_badinput import refused

ROD = """\
mesh: {cells: [6, 6, 6], lower: [0, 0, 0], upper: [1, 1, 1]}
flow: {density: 1, viscosity: 0.1, gravity: [0, -10, 0]}
particle:
  groups: rod
  rod: {shape: leaflet, length: 0.6, thickness: 0.2, density: 3, position: [0.3, 0.6, 0.5], pivot: [0, 0, 0], hinge: [0, 1, 2], angle: 0.2}
sim: {dt: 0.02, steps: 4}
output: {every: 0}
contact: {law: none}
"""
DISC = """\
mesh: {cells: [12, 12]}
flow: {density: 1, viscosity: 0.1, gravity: [0, -10]}
particle:
  groups: disc
  disc: {shape: circle, radius: 0.15, density: 2, position: [0.3, 0.6], slide: [1, -1]}
sim: {dt: 0.02, steps: 4}
output: {every: 0}
"""
POSTS = """\
mesh: {cells: [24, 16], lower: [0, 0], upper: [1.5, 1]}
flow: {density: 1, viscosity: 0.1, bc_left: {type: inflow, velocity: [1, 0]}, bc_right: {type: outflow}}
particle:
  groups: GROUPS
  outside: {shape: circle, radius: 0.4, position: [0.75, 1.3], obstacle: true}
SHAPES
sim: {dt: 0.05, steps: 3}
output: {every: 0}
"""
TWO = """\
  disc: {shape: circle, radius: 0.2, position: [0.5, 0.1], obstacle: true}
  beam: {shape: box, size: [0.3, 0.1], position: [0.65, 0.1], obstacle: true}"""
ONE = """\
  both: {shape: composite, parts: [disc, beam], disc: {shape: circle, radius: 0.2}, beam: {shape: box, size: [0.3, 0.1], offset: [0.15, 0]},
         pivot: [0, 0], position: [0.5, 0.1], obstacle: true}"""


def bodies(run, scene, text, *options, ranks=1):
    done = run([scene(text), *options], ranks)
    assert done.status == 0, done
    path = max(done.folder.rglob("bodies.csv"), key=lambda path: path.stat().st_mtime_ns)
    rows = read_rows(path)
    assert rows, done
    return rows


@pytest.mark.parametrize("options", [[], ["-couple_type", "explicit"], ["-couple_method", "nodal"]], ids=["implicit", "explicit", "nodal"])
def test_hinge(run, scene, options):
    """About the axis and nothing else: w is along it, and the centre on its circle about the pivot."""
    rows = bodies(run, scene, ROD, *options)
    for row in rows:
        assert row["omega_x"] == 0 and row["omega_z"] == pytest.approx(2 * row["omega_y"], rel=1e-10), row
        assert math.dist((row["x"], row["y"], row["z"]), (0.3, 0.6, 0.5)) == pytest.approx(0.2, rel=1e-10), row
    last = rows[-1]
    turned = last["angle"]  # of (0.2, 0, 0) about (0, 1, 2)/sqrt(5)
    assert last["x"] == pytest.approx(0.3 + 0.2 * math.cos(turned), rel=1e-10) and turned < 0.2, last
    assert last["y"] == pytest.approx(0.6 + 0.2 * math.sin(turned) * 2 / math.sqrt(5), rel=1e-10), last


def test_hinge_stops(run, scene):
    rows = bodies(run, scene, ROD, "-particle_rod_stops", "0.19,1", "-sim_steps", "5")
    assert min(row["angle"] for row in rows) == rows[-1]["angle"] == 0.19 and rows[-1]["omega_y"] == 0, rows


def test_hinge_alone_swings_as_a_pendulum(run, scene):
    """Without a flow nothing but weight and hinge: energy is kept; here only that it turns the way it should, and stays on its axis."""
    rows = bodies(run, scene, ROD, "-particle_rod_quaternion", "0.5,0.5,0.5,0.5", "-sim_steps", "2")
    start = [0.3 + 0, 0.6 + 0.2, 0.5]  # the quaternion turns x to y; the angle then turns it about the hinge
    assert math.dist((rows[0]["x"], rows[0]["y"], rows[0]["z"]), (0.3, 0.6, 0.5)) == pytest.approx(math.dist(start, (0.3, 0.6, 0.5)), rel=1e-10)
    axis = [0, 1 / math.sqrt(5), 2 / math.sqrt(5)]
    along = sum(a * b for a, b in zip(axis, (rows[0]["x"] - 0.3, rows[0]["y"] - 0.6, rows[0]["z"] - 0.5)))
    assert along == pytest.approx(0.2 / math.sqrt(5), rel=1e-10), rows


@pytest.mark.parametrize("options", [[], ["-couple_type", "explicit", "-particle_disc_density", "8"]], ids=["implicit", "explicit"])
def test_slide(run, scene, options):
    for row in bodies(run, scene, DISC, *options):
        assert row["v"] == pytest.approx(-row["u"], rel=1e-10) and row["u"] > 0 and row["omega_z"] == 0, row
        assert row["x"] + row["y"] == pytest.approx(0.9, rel=1e-10), row


def test_slide_along_an_axis_is_that_axis_free(run, scene):
    free = bodies(run, scene, DISC.replace("slide: [1, -1]", "free: y"), "-flow_rtol_max", 1e-6, "-output_dir", "free")
    held = bodies(run, scene, DISC.replace("slide: [1, -1]", "slide: [0, 3]"), "-flow_rtol_max", 1e-6, "-output_dir", "held")
    for a, b in zip(free, held):
        assert b["v"] == pytest.approx(a["v"], rel=1e-5) and b["x"] == 0.3, (a, b)
        assert b["force_y"] == pytest.approx(a["force_y"], rel=1e-4), (a, b)


@pytest.mark.parametrize("method", ["penalty", "nodal"])
def test_obstacles_are_united(run, scene, method):
    """Shapes that overlap each other and walls act on the flow as the composite of them does."""
    sums = {}
    for groups, shapes in {"[disc, beam, outside]": TWO, "[both, outside]": ONE}.items():
        rows = bodies(run, scene, POSTS.replace("GROUPS", groups).replace("SHAPES", shapes), "-couple_method", method, "-output_dir", groups[1:5])
        sums[groups] = [sum(row[name] for row in rows if row["step"] == 3 and row["group"] != "outside") for name in ("force_x", "force_y")]
    one, two = sums.values()
    assert one == pytest.approx(two, rel=2e-2 if method == "penalty" else 1e-6), sums


@pytest.mark.parametrize("old,new,phrase,part", [
    ("hinge: [0, 1, 2]", "hinge: [0, 0, 0]", "-particle_rod_hinge: a direction has a length", "not zero"),
    ("hinge: [0, 1, 2]", "hinge: [0, 1, 2], free: [x, rotation]", "Group 'rod' turns about -particle_rod_pivot", "-particle_rod_free rotation"),
    ("hinge: [0, 1, 2]", "slide: [0, 1, 2]", "and has -particle_rod_slide", "remove one"),
    ("hinge: [0, 1, 2]", "stops: [0, 1]", "-particle_rod_stops: in space stops need the axis", "give -particle_rod_hinge"),
    ("hinge: [0, 1, 2]", "hinge: [0, 1, 2], axis: [1, 0, 0]", "-particle_rod_axis: the angle of a body", "-particle_rod_quaternion"),
    ("hinge: [0, 1, 2]", "quaternion: [0, 0, 0, 0]", "-particle_rod_quaternion is zero", "w,x,y,z"),
    ("hinge: [0, 1, 2]", "obstacle: true, free: rotation", "-particle_rod_obstacle true: the bodies of an obstacle stand still", "remove it"),
    ("shape: leaflet, length: 0.6, thickness: 0.2", "shape: composite, parts: [a, b], a: {shape: circle}, b: {shape: circl}",
     "Shape 'circl' is not known", "composite"),
    ("shape: leaflet, length: 0.6, thickness: 0.2", "shape: composite, parts: [a, b], a: {shape: circle, operation: difference}, b: {shape: circle}",
     "-particle_rod_a_operation difference: there is nothing before the first part", "-particle_rod_parts"),
    ("shape: leaflet, length: 0.6, thickness: 0.2", "shape: composite, parts: [a, b], a: {shape: circle}", "Part 'b' of shape 'composite' has no type",
     "-particle_rod_b_shape"),
], ids=lambda text: text[-12:])
def test_refused(run, scene, old, new, phrase, part):
    assert ROD.count(old) == 1
    refused(run([scene(ROD.replace(old, new))], 2), phrase, part)
