"""Bodies and their own periodic images: what overlaps its image, or turns and reaches beyond half a period, is refused; what comes to it is stopped."""
import pytest

PLANE = """\
mesh: {cells: [16, 16], lower: [0, 0], upper: [2, 2], periodic: [x, y]}
flow: {density: 1, viscosity: 0.05, gravity: [0, -10]}
couple: {backflow: flux}
particle:
  groups: g
  g: {density: 1.5, position: [1, 1], SHAPE}
sim: {dt: 0.02, steps: 2}
output: {every: 0, progress: 20}
"""
SPACE = """\
mesh: {cells: [6, 6, 6], lower: [0, 0, 0], upper: [1, 1, 1], periodic: [z]}
flow: {density: 1, viscosity: 0.5, gravity: [0, 0, -10]}
particle:
  groups: g
  g: {density: 1.5, position: [0.5, 0.5, 0.5], SHAPE}
sim: {dt: 0.01, steps: 1}
output: {every: 0}
"""
WALLED = PLANE.replace("periodic: [x, y]", "periodic: x").replace("couple: {backflow: flux}\n", "").replace("cells: [16, 16]", "cells: [16, 32]").replace("[2, 2]", "[2, 4]")

# what overlaps by how much along which axes: a disc 2 (1.2 - 1); a box by .2, of which points on its surface see a little less
OVERLAPS = {
    "disc": (PLANE, "shape: circle, radius: 1.2", "along x by 0.4 at the start"),
    "box": (PLANE, "shape: box, size: [2.2, 0.4], angle: 0", "along x by 0.19"),
    "sphere": (SPACE, "shape: circle, radius: 0.52", "along z by 0.04 at the start"),
    "cylinder that does not turn": (SPACE, 'shape: cylinder, radius: 0.2, length: 1.1, free: "x, y"', "along z by 0.1 at the start"),
}


@pytest.mark.parametrize("case", OVERLAPS)
def test_overlap_is_refused(run, scene, case):
    text, shape, what = OVERLAPS[case]
    result = run([scene(text.replace("SHAPE", shape)), "-scene_dry_run"], 2 if case == "disc" else 1)
    assert result.status != 0 and result.text.count(f"Body 0 of group 'g' overlaps its own periodic image {what}") == 1, result


def test_table_and_sizes(run, scene, tmp_path):
    (tmp_path / "bodies.csv").write_text("x,y,size\n1,0.5,1\n1,1.7,12\n")
    text = PLANE.replace("position: [1, 1], SHAPE", "shape: circle, radius: 0.1, place: table, table: bodies.csv")
    result = run([scene(text), "-scene_dry_run"])
    assert result.status != 0 and "Body 1 of group 'g' overlaps its own periodic image along x by 0.4 at the start" in result.text, result


def test_packed_bodies(run, scene):
    text = PLANE.replace("position: [1, 1], SHAPE", "shape: circle, radius: 1.2, place: pack, count: 1")
    result = run([scene(text), "-scene_dry_run"])
    assert result.status != 0 and "the box is 2. wide along axis 0, one body needs 2.4" in result.text, result


BAR = "shape: box, size: [2.2, 0.2], angle: 0.3"


def test_what_turns_reaches_half_a_period_at_most(run, scene):
    """1.1 cos .3 + .1 sin .3 = 1.0804"""
    result = run([scene(PLANE.replace("SHAPE", BAR)), "-scene_dry_run"])
    assert result.status != 0 and "Body 0 of group 'g' reaches 1.08042 from its centre along x, more than half the period of 2" in result.text, result


@pytest.mark.parametrize("shape", [BAR + ', free: "x, y"', "shape: circle, radius: 1.2, free: none", "shape: circle, radius: 0.99"])
def test_what_is_right_is_not_refused(run, scene, shape):
    result = run([scene(PLANE.replace("SHAPE", shape)), "-scene_dry_run"])
    assert result.status == 0, result


@pytest.mark.parametrize("flow", ["true", "false"])
def test_a_bar_that_turns_is_stopped(run, scene, flow):
    """Upright it has room; it reaches half the period at cos a + .1/1.1 sin a = 1/1.1, a = .52"""
    text = WALLED.replace("SHAPE", "shape: box, size: [2.2, 0.2], angle: 60 deg, torque: -60")
    text = text.replace("position: [1, 1]", "position: [1, 2]").replace("steps: 2", "steps: 60")
    if flow == "false":
        text = text.replace("viscosity: 0.05", "active: false").replace("torque: -60", "angular_velocity: -2")
    result = run([scene(text)], 2 if flow == "true" else 1)
    assert result.status != 0 and result.text.count("Body 0 of group 'g' has turned until at t = ") == 1, result
    assert "from its centre along x, more than half the period of 2., and meets its own periodic image" in result.text and result.steps() > 3, result
