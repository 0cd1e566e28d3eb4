"""Bodies that are led to and fro: what presets choose and refuse (src/run/swing.h)."""
import pytest

SCENE = """mesh: {cells: [20, 20], lower: [-1, -1], upper: [1, 1]}
flow: {density: 1, viscosity: 0.05}
particle:
  groups: c
  c: {shape: circle, radius: 0.3, position: [0, 0], MOTION}
sim: {dt: 0.0125, time: 4}
output: {every: 0}
"""
SHORT = "motion: oscillate, motion_amplitude: [0.05, 0], motion_period: [1, 1]"
FORMULA = 'velocity: "0.3*cos(2*pi*t), 0", free: none'


def method(result, name):
    return next(line.split()[1] for line in (result.folder / name / "options.txt").read_text().splitlines() if line.startswith("-couple_method"))


@pytest.mark.parametrize("motion", [SHORT, FORMULA])
def test_the_mesh_is_lined_up_with_them(run, scene, motion):
    """6 cells a diameter: the force by the penalty is 9.5 % off, lined up .9 %."""
    name = scene(SCENE.replace("MOTION", motion), "a.yaml")
    for preset, cells, expected in ("fast", "20,20", "aligned"), ("fast", "40,40", "penalty"), ("balanced", "40,40", "aligned"):
        out = f"{preset}{cells}"
        result = run([name, "-preset", preset, "-mesh_cells", cells, "-sim_steps", "1", "-output_dir", out])
        assert not result.status, result.text
        assert method(result, out) == expected


def test_thin_layers_and_the_penalty_are_refused(run, scene):
    name = scene(SCENE.replace("MOTION", SHORT), "a.yaml")
    thin = run([name, "-preset", "accurate", "-flow_viscosity", "0.01", "-sim_steps", "1"])
    assert thin.status and "the layer that swings with group 'c' is 0.56 cells thick and needs 1" in thin.text, thin.text
    penalty = run([name, "-preset", "balanced", "-couple_method", "penalty", "-sim_steps", "1"])
    assert penalty.status and "group 'c' swings, is 6.0 cells thick and needs 24" in penalty.text, penalty.text
    default = run([name, "-sim_steps", "1"])
    assert not default.status and "group 'c' swings" in default.text, default.text


def test_the_group_with_the_thinnest_layer_is_named(run, scene):
    """It is not the one with the thinnest bodies."""
    text = SCENE.replace("groups: c", "groups: [a, c]").replace("  c: {", '  a: {shape: circle, radius: 0.15, position: [0.7, 0.7], motion: oscillate, motion_amplitude: [0.01, 0], motion_period: [2, 1]}\n  c: {')
    result = run([scene(text.replace("MOTION", SHORT), "a.yaml"), "-preset", "balanced", "-mesh_cells", "40,40", "-flow_viscosity", "0.002", "-sim_steps", "1"])
    assert result.status and "the layer that swings with group 'c' is 0.50 cells thick and needs 0.6" in result.text, result.text


def test_long_ways_are_no_swing(run, scene):
    """Drag is most of the force: the layer counts, not the inertia."""
    far = SHORT.replace("0.05", "0.6").replace("[1, 1]", "[12, 12]").replace("motion_amplitude: [0.6", "motion_amplitude: [1.2")
    name = scene(SCENE.replace("MOTION", far).replace("lower: [-1, -1], upper: [1, 1]", "lower: [-2, -1], upper: [2, 1]").replace("[20, 20]", "[40, 20]"), "a.yaml")
    result = run([name, "-preset", "balanced", "-sim_time", "12", "-sim_steps", "1"])
    assert not result.status and "swings" not in result.text, result.text
    assert method(result, "out/a") == "penalty"
