"""Membranes in a flow: capsules in the plane and in space: momentum, volume, the same on all numbers of ranks, restarts, refusals."""
import csv
import math

import pytest

FAR = "bc_left: {type: inflow, velocity: [y, 0]}, bc_right: {type: inflow, velocity: [y, 0]}, bc_bottom: {type: inflow, velocity: [y, 0]}, bc_top: {type: inflow, velocity: [y, 0]}"
PLANE = f"""mesh: {{cells: [10, 10], lower: [-2, -2], upper: [2, 2]}}
flow: {{density: 0.1, viscosity: 1, time: bdf2, solver: direct, velocity: [y, 0], {FAR}}}
particle:
  groups: skin
  skin: {{shape: circle, radius: 0.8, position: [0.03, 0.02], material: membrane, surface_modulus: 5}}
sim: {{dt: 0.1, steps: 4}}
output: {{every: 0}}
"""
SPACE = """mesh: {cells: [5, 5, 5], lower: [0, 0, 0], upper: [1.25, 1.25, 1.25]}
flow: {density: 1, viscosity: 1, time: bdf2, solver: direct, bc_top: {type: moving_wall, velocity: [1, 0, 0]}}
particle:
  groups: skin
  skin: {shape: circle, radius: 0.35, position: [0.63, 0.62, 0.6], material: membrane, surface_modulus: 3, membrane_law: skalak, solid_cells: [4, 4, 4]}
sim: {dt: 0.05, steps: 2}
output: {every: 0}
"""
SCENES = pytest.mark.parametrize("text", [PLANE, SPACE], ids=["plane", "space"])


def rows(run, name, *options, ranks=1, folder="out"):
    result = run([name, "-output_dir", folder, *options], ranks, timeout=300)
    assert result.status == 0, str(result)
    with open(result.folder / folder / "series.csv") as file:
        return [{name: float(text) for name, text in row.items()} for row in csv.DictReader(file)]


@SCENES
def test_ranks(run, scene, text):
    """A capsule is drawn out: momentum is balanced, it keeps its volume; the same on 1, 2 and 3 ranks."""
    name = scene(text)
    one, *others = (rows(run, name, ranks=ranks, folder=f"r{ranks}") for ranks in (1, 2, 3))
    assert max(row["momentum_error"] for row in one) < 1e-11 and max(abs(row["solid_volume_error_skin"]) for row in one) < 1e-12
    assert one[-1]["solid_taylor_skin"] > one[0]["solid_taylor_skin"] > 0 and one[-1]["solid_area_error_skin"] > 0
    for other in others:
        for column in ("solid_taylor_skin", "solid_energy_skin", "solid_stretch_skin", "solid_x_skin", "kinetic_energy"):
            assert other[-1][column] == pytest.approx(one[-1][column], rel=1e-8, abs=1e-10), column


@SCENES
def test_restart(run, scene, text):
    """A run that stops and goes on has the bits of one that does not stop."""
    name, every = scene(text), ["-checkpoint_every", "1"]
    whole = rows(run, name, *every, folder="whole")[-1]
    rows(run, name, *every, "-sim_steps", "1", folder="part")
    again = rows(run, name, *every, "-sim_restart", "latest", folder="part")[-1]
    assert all(math.isfinite(value) for value in again.values())
    for column in again:
        assert column.startswith("seconds") or again[column] == whole[column], column


@pytest.mark.parametrize(
    "options, message",
    [
        (["-particle_skin_density", "2"], "remove it"),
        (["-particle_skin_viscosity", "2"], "the fluid around it inside"),
        (["-particle_skin_poisson", "0.4"], "is a membrane"),
        (["-particle_skin_surface_modulus", "0"], "outside its range"),
        (["-particle_skin_membrane_law", "hooke"], "skalak"),
        (["-couple_method", "aligned"], "-couple_method penalty"),
        (["-flow_active", "false"], "leave the flow on"),
    ],
)
def test_refusals(run, scene, options, message):
    result = run([scene(PLANE), "-output_dir", "out", *options])
    assert result.status and message in result.err and result.err.count("error:") == 1, str(result)
