"""The layer of a scalar around bodies that move against the fluid: what is refused and remarked, and that heat is counted alike by all methods."""

import csv
import json

import pytest

STREAM = """mesh: {cells: [15, 10], lower: [-5, -5], upper: [10, 5], levels: 3, refine_distance: 4}
flow:
  density: 1
  viscosity: 0.1
  bc_left: {type: inflow, velocity: [1, 0]}
  bc_bottom: {type: inflow, velocity: [1, 0]}
  bc_top: {type: inflow, velocity: [1, 0]}
  bc_right: {type: outflow}
scalars: heat
scalar: {heat: {conductivity: 0.01, bc: {left: {value: 0}, bottom: {value: 0}, top: {value: 0}}}}
particle:
  groups: disc
  disc: {shape: circle, radius: 0.5, position: [0.013, 0.007], free: none, heat: {condition: value, value: 1}}
sim: {steady: true}
output: {every: 0}
"""

MOVES = """mesh: {cells: [28, 12], lower: [0, -1.5], upper: [7, 1.5]}
flow: {density: 1, viscosity: 0.1}
scalars: heat
scalar: {heat: {conductivity: 0.1}}
particle:
  groups: disc
  disc: {shape: circle, radius: 0.5, density: 1, position: [1.513, 0.007], free: none, velocity: [0, 0], heat: {condition: value, value: 1}}
sim: {dt: 0.02, steps: 4}
output: {every: 0}
"""

# 1.18 cells in the layer by the stream: 1 / (100^(1/3) 10^(1/6)) of a diameter of 8
THIN = "the layer of scalar 'heat' around a body of group 'disc' (Peclet number 100) is 1.2 cells thick and with -couple_method"


@pytest.mark.parametrize("preset, method, refused", [("fast", "penalty", False), ("balanced", "penalty", True), ("accurate", "aligned", False), ("fast", "nodal", True)])
def test_presets_know_the_layer_of_heat(run, scene, preset, method, refused):
    result = run([scene(STREAM), "-preset", preset, "-couple_method", method, "-scene_dry_run"])
    assert (result.status != 0) == refused, result
    assert (f"{THIN} {method} needs" in result.text) == refused and result.text.count("error:") == int(refused)


def test_a_thin_layer_is_remarked_and_in_the_summary(run, scene, tmp_path):
    result = run([scene(STREAM), "-couple_method", "penalty", "-output_dir", tmp_path / "out"])
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert sum(THIN in remark for remark in summary["remarks"]) == 1, result
    assert result.text.count("the layer of scalar") == 1
    assert 1 < summary["quantities"]["scalar_layer_cells_heat_disc"] < 1.2  # by the fastest fluid near the disc


def find_content(run, scene, folder, method, *options):
    run([scene(MOVES), "-couple_method", method, "-output_dir", folder, *options])
    with open(folder / "series.csv") as file:
        return float(list(csv.DictReader(file))[-1]["scalar_content_heat"])


@pytest.mark.parametrize("method, most", [("penalty", 0.005), ("nodal", 0.1)])
def test_the_inside_of_a_body_at_a_value_counts_in_no_method(run, scene, tmp_path, method, most):
    """Of the fluid alone, 1.41 after a while; the disc itself would be .785 more. Nodal lets in less heat, as its bodies are drawn smaller"""
    options = ["-sim_dt", "0.1", "-sim_steps", "10"]
    exact = find_content(run, scene, tmp_path / "aligned", "aligned", "-mesh_cells", "56,24", *options)
    assert find_content(run, scene, tmp_path / "other", method, "-mesh_cells", "56,24", *options) == pytest.approx(exact, rel=most)


@pytest.mark.parametrize("frame", [[], ["-sim_frame", "none"]])
def test_the_way_of_a_step_is_refused(run, scene, frame):
    """U^2 dt/D = 2, in a box at rest"""
    result = run([scene(MOVES), "-couple_method", "penalty", "-mesh_cells", "56,24", "-particle_disc_velocity", "1,0", "-sim_dt", "0.2", "-preset", "balanced", "-scene_dry_run", *frame])
    assert result.status and "goes 2 times as far in a step" in result.err and result.err.count("error:") == 1


def test_a_body_that_settles_has_its_layer_measured(run, scene, tmp_path):
    """It starts from rest, and nothing but the run knows how fast it gets; with the fluid's conductivity tenfold nothing is said"""
    text = MOVES.replace("density: 1, position", "density: 1.5, position").replace("free: none, velocity: [0, 0], ", "").replace("viscosity: 0.1", "viscosity: 0.1, gravity: [1, 0]")
    result = run([scene(text), "-couple_method", "penalty", "-scalar_heat_conductivity", "0.01", "-sim_dt", "0.05", "-sim_steps", "40", "-output_dir", tmp_path / "out"])
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert any("of scalar 'heat' around a body of group 'disc'" in remark for remark in summary["remarks"]), result
    calm = run([scene(text), "-couple_method", "penalty", "-scalar_heat_conductivity", "1", "-sim_steps", "2", "-output_dir", tmp_path / "calm"])
    assert "around a body of group" not in calm.text
