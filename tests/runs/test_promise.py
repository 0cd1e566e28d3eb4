"""Presets where nobody tuned them: gaps that last between a body and a wall, another body or its own image, bodies that turn, spheres in space."""
import csv
import math

import pytest

BEARING = """\
mesh: {kind: disc, radius: 1, resolution: 16}
flow: {density: 1, viscosity: 1, convection: false, OUTER}
particle:
  groups: j
  j: {shape: circle, density: 0.2, radius: 0.4, position: [0.3, 0], MOTION}
contact: {law: none}
sim: {SIM}
output: {every: 0}
"""
JOURNAL = BEARING.replace(", OUTER", "").replace("MOTION", "free: none, angular_velocity: 1").replace("SIM", "steady: true")
FREE = BEARING.replace("OUTER", "bc_outer: {type: rotating_wall, omega: 1}").replace("MOTION", "free: rotation").replace("SIM", "dt: 0.1, time: 1")
ARRAY = """\
mesh: {cells: [12, 12], lower: [0, 0], upper: [1, 1], periodic: [x, y]}
flow: {density: 1, viscosity: 1, convection: false, force: [1, 0]}
particle:
  groups: s
  s: {shape: circle, radius: 0.437019, free: none, position: [0.487, 0.531]}
sim: {steady: true}
output: {every: 0}
"""
SPHERES = """\
mesh: {cells: [12, 12, 12], lower: [0, 0, 0], upper: [1, 1, 1], periodic: [x, y, z]}
flow: {density: 1, viscosity: 1, convection: false, gravity: [0, 0, -31.25]}
couple: {backflow: flux}
particle:
  groups: s
  s: {shape: circle, radius: 0.24814020, density: 1.5, position: [0.487, 0.531, 0.443]}
sim: {dt: 0.1, steps: 4}
output: {every: 0}
"""
PERCENT = {"fast": 5, "balanced": 1, "accurate": 0.2}
DRY = "-scene_dry_run"


@pytest.fixture
def last(run, scene):
    """last(text, name, args, ranks=1): the last value of a column of bodies.csv or series.csv, the boundary method, and the run"""
    def go(text, name, *args, ranks=1):
        result = run([scene(text), "-output_dir", "out", "-output_overwrite", *args], ranks)
        assert result.status == 0, str(result)
        with open(result.folder / "out" / ("bodies.csv" if name in ("force_y", "omega_z", "w") else "series.csv")) as file:
            value = float(list(csv.DictReader(file))[-1][name])
        words = (result.folder / "out" / "options.txt").read_text().split()
        return value, words[words.index("-couple_method") + 1], result
    return go


@pytest.mark.parametrize("preset", PERCENT)
def test_bearing(last, preset):
    """Exact, Stokes: the force on an inner circle that turns, and how fast it turns if the outer one does"""
    assert last(JOURNAL, "force_y", "-preset", preset)[0] == pytest.approx(2.77299, rel=PERCENT[preset] / 100)
    if preset != "fast":
        assert last(FREE, "omega_z", "-preset", preset)[0] == pytest.approx(0.694696, rel=PERCENT[preset] / 100)


def test_narrow_bearing(run, scene, last):
    """At a gap of half a cell fast lines the mesh up, and keeps its promise: 11.1466 on a mesh five times as fine; the others say why not"""
    force, method, _ = last(JOURNAL, "force_y", "-preset", "fast", "-particle_j_position", "0.57,0")
    assert method == "aligned" and force == pytest.approx(11.1466, rel=0.05)
    result = run([scene(JOURNAL), "-preset", "balanced", "-particle_j_position", "0.57,0", DRY])
    assert "the gap between body 0 of group 'j' and the wall 'outer' is 0.53 cells wide and needs 1.5. Refine the mesh" in result.text, result
    assert result.status != 0 and result.text.count("use -preset fast (5 %)") == 1, result


@pytest.mark.parametrize("ranks", [1, 3])
def test_array_of_discs(last, ranks):
    """60 % of the area: 5.66793e-4 with 64 cells, lined up; the penalty is 4.8 % off"""
    speed, method, result = last(ARRAY, "mean_velocity_x", "-preset", "fast", ranks=ranks)
    assert method == "aligned" and speed == pytest.approx(5.66793e-4, rel=0.01), result
    with open(result.folder / "out" / "series.csv") as file:
        assert abs(float(next(csv.DictReader(file))["driving_error"])) < 1e-5


def test_gaps_that_do_not_last_are_not_counted(run, scene):
    free = ARRAY.replace("free: none", "density: 2").replace("force: [1, 0]", "gravity: [1, 0]").replace("steady: true", "dt: 0.1, steps: 1")
    wide = free.replace("periodic: [x, y]", "periodic: x").replace("[1, 1]", "[9, 1]").replace("[12, 12]", "[108, 12]")
    result = run([scene(wide), "-preset", "balanced", DRY])
    assert result.status == 0 and "penalty" in result.text, result
    held = wide.replace("density: 2", "free: none")
    result = run([scene(held), "-preset", "balanced", "-particle_s_radius", "0.43", "-couple_method", "penalty", DRY])
    assert result.status != 0 and "and the wall 'top' is 0.47 cells wide and needs 8" in result.text, result


def test_openings_are_no_walls(run, scene):
    text = ARRAY.replace(", periodic: [x, y]", ", periodic: y").replace("force: [1, 0]", "bc_left: {type: outflow}, bc_right: {type: inflow, velocity: [1, 0]}")
    text = text.replace("position: [0.487, 0.531]", "position: [0.3, 0.5]").replace("0.437019", "0.25")
    result = run([scene(text), "-preset", "fast", DRY])
    assert result.status == 0 and "couple_method aligned" not in result.text and "gap" not in result.err, result


@pytest.mark.parametrize("preset", ["balanced"])  # fast takes the same penalty
def test_sphere_settles_in_an_array(last, preset):
    """U = W/(6 pi mu a K), K = 2.8102 (Zick & Homsy 1982): the penalty of the plane, 200, is 1.5 % off"""
    exact = 1 / (6 * math.pi * 0.2481402 * 2.8102)
    assert -last(SPHERES, "w", "-preset", preset)[0] == pytest.approx(exact, rel=0.005)


def test_accurate_lines_up_in_space(run, scene):
    result = run([scene(SPHERES), "-preset", "accurate", DRY])
    assert result.status == 0 and "boundary aligned" in result.text.lower(), result
    result = run([scene(SPHERES), "-preset", "accurate", "-couple_method", "penalty", DRY])
    assert result.status != 0 and "in space it needs the mesh lined up with the bodies (-couple_method aligned)" in result.text, result


def test_boundary_layer_in_space(run, scene):
    """A sphere that falls at a Reynolds number of some thousand, 6 cells thick"""
    text = SPHERES.replace("viscosity: 1,", "viscosity: 0.0005,").replace("convection: false, ", "")
    result = run([scene(text), "-preset", "balanced", DRY])
    assert result.status != 0 and "the boundary layer of a body of group 's' that falls is 0.0" in result.text, result


def test_what_lies_in_each_other_is_remarked(last):
    """A bar as long as 1.3 periods: of the force on the whole domain it takes .06 more than there is, by its volume"""
    text = ARRAY.replace("shape: circle, radius: 0.437019", "shape: box, size: [1.3, 0.2]").replace("[0.487, 0.531]", "[0.5, 0.5]")
    error, _, result = last(text, "driving_error", "-couple_method", "aligned", "-mesh_cells", "20,20")
    assert error == pytest.approx(-0.06, abs=1e-3), result
    assert result.text.count("bodies and walls take 6 % more than the force that drives the flow at t = 0 (column driving_error of series.csv)") == 1, result


STREAM = """\
mesh: {cells: [3, 3, 4], lower: [-3.01, -3.01, -2], upper: [2.99, 2.99, 6], levels: 4, refine: [bodies], refine_distance: 2.5}
flow: {density: 1, viscosity: 0.01, bc_back: {type: inflow, velocity: [0, 0, 1]}, bc_front: {type: outflow}}
particle: {groups: s, s: {shape: circle, radius: 0.5, position: [0.013, -0.021, 0.034], free: none}}
sim: {steady: true}
"""


def test_boundary_layer_in_a_stream(run, scene):
    """A sphere at Re 100 with 8 cells a diameter: 1.4 % off with the penalty, .08 % lined up, for which the band is too narrow"""
    for preset, needs in (("balanced", "held in a stream is 0.80 cells thick and needs 1."), ("accurate", "needs the mesh lined up")):
        result = run([scene(STREAM), "-preset", preset, DRY])
        assert result.status != 0 and needs in result.text and "raise -mesh_refine_distance to 4" in result.text, result
    result = run([scene(STREAM), "-preset", "fast", DRY])
    assert result.status == 0, result


def test_at_rest_all_presets_line_up(run, scene):
    for preset in PERCENT:
        result = run([scene(ARRAY.replace("0.437019", "0.3").replace("steady: true", "dt: 0.1, steps: 1")), "-preset", preset, DRY])
        assert result.status == 0 and "boundary aligned" in result.text.lower(), result


SLENDER = """\
mesh: {cells: [30, 20], lower: [-2, -2], upper: [4, 2], levels: 2, refine: [bodies, near], refine_distance: 4, box_near: {corners: [-0.8, -0.6, 1.6, 0.6], levels: 1}}
flow: {density: 1, viscosity: 0.005, bc_left: {type: inflow, velocity: [1, 0]}, bc_right: {type: outflow}, bc_bottom: {type: slip}, bc_top: {type: slip}}
particle: {groups: s, s: {BODY, position: [0.013, 0.021], free: none}}
sim: {steady: true}
"""
ELLIPSE = "shape: ellipse, a: 0.5, b: 0.125"
WITH_FLAG = ("shape: composite, parts: [cyl, flag], cyl: {shape: circle, radius: 0.05}, "
             "flag: {shape: box, size: [0.4, 0.02], offset: [0.2, 0]}, pivot: [0, 0]")
WIDE_FLAG = WITH_FLAG.replace("0.05}", "0.125}").replace("[0.4, 0.02], offset: [0.2, 0]", "[0.75, 0.11], offset: [0.4, 0]")
STREET = """\
mesh: {cells: [50, 8], lower: [0, 0], upper: [2.5, 0.41], levels: 3, refine_distance: 3, refine: [bodies, wake], box_wake: {corners: [0.1, 0.08, 1.1, 0.33], levels: 2}}
flow: {density: 1000, viscosity: 1, bc_left: {type: inflow, profile: parabolic, velocity: [3, 0]}, bc_right: {type: outflow}}
particle: {groups: b, b: {%s, position: [0.2, 0.2], free: none}}
sim: {dt: 0.005, time: 4}
"""


def test_flag_behind_a_cylinder(run, scene):
    """Turek & Hron's CFD3: with a layer of .9 cells the lift is 1.6 % off, lined up; the flag makes the cylinder's layer no thicker"""
    text = STREET % WITH_FLAG
    result = run([scene(text), "-preset", "accurate", DRY])
    assert result.status != 0 and "held in a stream is 0.9" in result.text and "thick and needs 2" in result.text, result
    result = run([scene(text), "-preset", "fast", DRY])
    assert result.status == 0, result
    same = run([scene(STREET % "shape: circle, radius: 0.05"), "-preset", "accurate", DRY])
    assert same.status != 0 and "held in a stream is 0.9" in same.text, same


DRIVEN = """\
mesh: {cells: [%d, %d], lower: [-0.5, -0.5], upper: [0.5, 0.5], periodic: [x, y]}
flow: {density: 1, viscosity: 0.01, force: [%s, 0]}
particle: {groups: s, s: {shape: circle, radius: 0.25231, position: [0.0123, 0.0071], free: none}}
sim: {steady: true}
"""


@pytest.mark.parametrize("cells, force, preset, refused", [
    (12, "1", "balanced", True),  # 1.3 % off
    (12, "1", "fast", False),
    (20, "1", "balanced", False),  # .18 %
    (12, "1+sin(2*pi*x)", "balanced", True),
    (12, "4", "fast", True),  # 5.3 %
    (12, "1e-4", "accurate", False),
])
def test_array_driven_by_a_force(run, scene, cells, force, preset, refused):
    """Discs with a force on the fluid: the layer goes by the velocity that the force can keep up. Off from 64 x 64 cells (studies/boundary)"""
    result = run([scene(DRIVEN % (cells, cells, force)), "-preset", preset, DRY])
    assert (result.status != 0) == refused and ("held in a stream" in result.text) == refused, result


def test_fast_comes_to_rest(last):
    """A free disc in a circle that turns reaches its steady state, where solves have but round-off to work on: no reason to stop"""
    assert last(FREE.replace("dt: 0.1, steps: 10", "dt: 0.02, time: 1"), "omega_z", "-preset", "fast")[0] == pytest.approx(0.694696, rel=0.05)


@pytest.mark.parametrize("body, levels, refused", [
    ("shape: airfoil", 2, False),  # drag .05 % off
    (ELLIPSE, 2, False),  # .02 %
    (ELLIPSE, 1, True),  # .32 %
    (WIDE_FLAG, 2, True),  # .24 %
    (ELLIPSE + ", angle: 45 deg", 1, True),  # .9 % at a viscosity of .02
    ("shape: airfoil, angle: -10 deg", 2, True),  # lift 3.6 %, likewise
    ("shape: airfoil, angle: -5 deg", 4, True),  # lift .2 to .3 % at a viscosity of .02
    (WIDE_FLAG, 3, False),  # .02 %
])
def test_size_along_a_stream(run, scene, body, levels, refused):
    """The layer of what ends gently goes by its length (by its width it would have .5, .7 cells of an airfoil, an ellipse), that of a cylinder with a
    flag by the cylinder's. How far the drag is off, from meshes up to four times as fine"""
    result = run([scene(SLENDER.replace("BODY", body)), "-preset", "accurate", "-mesh_levels", str(levels), DRY])
    assert (result.status != 0) == refused and ("held in a stream" in result.text) == refused, result
