"""Elastic particles in space: a soft ball over a floor, immersed and with the mesh lined up: momentum, volume, the same on all numbers of ranks, restarts."""
import csv
import math

import pytest

# Two cells a radius; the ball starts within a cell of the floor
BALL = """mesh: {cells: [6, 6, 7], lower: [0, 0, 0], upper: [1.5, 1.5, 1.75]}
flow: {density: 1, viscosity: 1, gravity: [0, 0, -10], time: bdf2, solver: balanced, ksp_rtol: 1e-9}
particle:
  groups: soft
  soft: {shape: circle, radius: 0.4, density: 3, position: [0.76, 0.75, 0.6], material: neo_hookean, shear_modulus: 50, solid_cells: [4, 4, 4]}
sim: {dt: 0.05, steps: 2}
output: {every: 0}
"""
METHODS = pytest.mark.parametrize("method", ["penalty", "aligned"])


def rows(run, name, *options, ranks=1, folder="out"):
    result = run([name, "-output_dir", folder, *options], ranks)
    assert result.status == 0, str(result)
    with open(result.folder / folder / "series.csv") as file:
        return [{name: float(text) for name, text in row.items()} for row in csv.DictReader(file)]


@METHODS
def test_ranks(run, scene, method):
    """The ball sinks towards the floor, which pushes it; momentum is balanced, the volume kept; the same on 1, 2 and 3 ranks."""
    name = scene(BALL)
    one, *others = (rows(run, name, "-couple_method", method, ranks=ranks, folder=f"r{ranks}") for ranks in (1, 2, 3))
    assert max(row["momentum_error"] for row in one) < 1e-8 and max(abs(row["solid_volume_error_soft"]) for row in one) < 1e-3
    assert one[-1]["solid_w_soft"] < -0.05 and max(row["outer_iterations"] for row in one) <= 15
    for other in others:
        for column in ("solid_z_soft", "solid_w_soft", "solid_energy_soft", "solid_stretch_soft", "solid_force_z_soft", "kinetic_energy"):
            assert other[-1][column] == pytest.approx(one[-1][column], rel=1e-6, abs=1e-9), column


@METHODS
def test_restart(run, scene, method):
    """A run that stops and goes on has the bits of one that does not stop."""
    name, every = scene(BALL), ["-checkpoint_every", "1", "-couple_method", method]
    whole = rows(run, name, *every, folder="whole")[-1]
    rows(run, name, *every, "-sim_steps", "1", folder="part")
    again = rows(run, name, *every, "-sim_restart", "latest", folder="part")[-1]
    assert all(math.isfinite(value) for value in again.values())
    for column in again:
        if not any(word in column for word in ("wall", "seconds")):
            assert again[column] == whole[column], column
