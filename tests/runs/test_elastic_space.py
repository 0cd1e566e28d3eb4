"""Elastic particles in space: a soft ball over a floor, immersed and with the mesh lined up: momentum, volume, the same on all numbers of ranks, restarts."""
import math

import pytest

from conftest import ROOT, read_rows

# A little more than two cells across, over a floor that is within a cell of it
BALL = """mesh: {cells: [5, 5, 5], lower: [0, 0, 0], upper: [1.25, 1.25, 1.25]}
flow: {density: 1, viscosity: 1, gravity: [0, 0, -10], time: bdf2, solver: direct}
particle:
  groups: soft
  soft: {shape: circle, radius: 0.3, density: 3, position: [0.63, 0.62, 0.5], material: neo_hookean, shear_modulus: 50, solid_cells: [3, 3, 3]}
sim: {dt: 0.05, steps: 2}
output: {every: 0}
"""
METHODS = pytest.mark.parametrize("method", ["penalty", "aligned"])


def rows(run, name, *options, ranks=1, folder="out"):
    result = run([name, "-output_dir", folder, *options], ranks, timeout=300)
    assert result.status == 0, str(result)
    return read_rows(result.folder / folder / "series.csv")


@METHODS
def test_ranks(run, scene, method):
    """The ball sinks towards the floor, which pushes it; momentum is balanced, the volume kept; the same on 1, 2 and 3 ranks."""
    name = scene(BALL)
    one, *others = (rows(run, name, "-couple_method", method, ranks=ranks, folder=f"r{ranks}") for ranks in (1, 2, 3))
    assert max(row["momentum_error"] for row in one) < 1e-11 and max(abs(row["solid_volume_error_soft"]) for row in one) < 1e-12
    assert one[-1]["solid_w_soft"] < -0.01
    for other in others:
        for column in ("solid_z_soft", "solid_w_soft", "solid_energy_soft", "solid_stretch_soft", "solid_force_z_soft", "kinetic_energy"):
            assert other[-1][column] == pytest.approx(one[-1][column], rel=1e-6, abs=1e-9), column


@METHODS
def test_balanced(run, scene, method):
    """The solver of many cells has the velocity of the direct one to what it promises of velocities (2e-3), in at most 9 iterations after the first step; and the same
    velocity where it goes on."""
    name = scene(BALL)
    solvers = {"direct": ["direct"], "balanced": ["balanced"], "whole": ["balanced", "-flow_ksp_rtol", "1e-9"]}
    last = {key: rows(run, name, "-couple_method", method, "-flow_solver", *options, folder=key)[-1] for key, options in solvers.items()}
    assert last["balanced"]["solid_w_soft"] == pytest.approx(last["direct"]["solid_w_soft"], rel=2e-3)
    assert last["balanced"]["outer_iterations"] <= 9
    assert last["whole"]["solid_w_soft"] == pytest.approx(last["direct"]["solid_w_soft"], rel=1e-8)


@METHODS
@pytest.mark.parametrize("modulus", ["1e3", "1e6"])
def test_iterations(run, scene, method, modulus):
    """At a viscous number of .4 at most 9 iterations from the second step on; immersed with factors of the nodes alone (a stress of 25 times the fluid's) and with those of
    pressures."""
    step = ["-sim_dt", "0.0375", "-sim_steps", "3", "-flow_solver", "balanced"]
    series = rows(run, scene(BALL), "-couple_method", method, "-particle_soft_shear_modulus", modulus, *step)
    assert max(row["outer_iterations"] for row in series[1:]) <= 9, [row["outer_iterations"] for row in series]


@pytest.mark.parametrize("options", [["-particle_soft_poisson", "0.4"], ["-particle_soft_material", "st_venant_kirchhoff"], ["-particle_soft_clamp", "z - 0.7"], ["-particle_soft_angle", "0.5", "-particle_soft_axis", "1,1,0"]])
def test_kinds(run, scene, options):
    """Compressible, of another law, held, turned: two steps, lined up. The volume of those that are free and incompressible is kept."""
    text = BALL.replace("circle, radius: 0.3", "ellipse, a: 0.3, b: 0.25, c: 0.25") if "-particle_soft_axis" in options else BALL
    last = rows(run, scene(text), *options, "-couple_method", "aligned")[-1]
    assert all(math.isfinite(value) for value in last.values()) and last["momentum_error"] < 1e-10
    bound = 5e-3 if options[0] in ("-particle_soft_poisson", "-particle_soft_clamp") else 1e-12
    assert 1 <= last["solid_stretch_soft"] < 1.1 and abs(last["solid_volume_error_soft"]) < bound


def test_many(run):
    """A corner of the scene of a hundred balls: momentum and volumes, the same on two ranks as on one."""
    small = ["-mesh_cells", "6,6,4", "-mesh_upper", "2,2,1.3333", "-particle_soft_lower", "0.05,0.05,0.05", "-particle_soft_upper", "1.95,1.95,1.28", "-particle_soft_count", "2", "-particle_soft_solid_cells", "3,3,3"]
    one, two = (rows(run, ROOT / "runs" / "soft-spheres.yaml", *small, "-sim_steps", "2", "-output_every", "0", ranks=ranks, folder=f"r{ranks}")[-1] for ranks in (1, 2))
    assert one["momentum_error"] < 1e-5 and abs(one["solid_volume_error_soft"]) < 1e-12 and one["solid_w_soft"] < 0
    for column in ("solid_z_soft", "solid_w_soft", "solid_energy_soft", "solid_stretch_soft", "kinetic_energy"):
        assert two[column] == pytest.approx(one[column], rel=1e-4), column


def test_beside_rigid(run, scene):
    """A soft ball over a rigid one within a cell: what one takes the other gives."""
    text = BALL.replace("groups: soft", "groups: [soft, hard]").replace("sim:", "  hard: {shape: circle, radius: 0.15, density: 2, position: [0.63, 0.62, 0.2]}\nsim:").replace("0.5]", "0.72]")
    last = rows(run, scene(text), "-couple_method", "penalty")[-1]
    assert last["momentum_error"] < 1e-9 and last["solid_w_soft"] < 0


@pytest.mark.parametrize("options, message", [(["-couple_anchored", "true", "-particle_soft_clamp", "z-0.7"], "in the plane alone"), (["-particle_soft_material", "membrane"], "which has a -particle_soft_surface_modulus")])
def test_refusals(run, scene, options, message):
    result = run([scene(BALL), "-output_dir", "out", "-couple_method", "aligned", *options])
    assert result.status and message in result.err and result.err.count("error:") == 1, str(result)


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
