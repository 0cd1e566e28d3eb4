"""Method aligned in space: what is known exactly of spheres in slow flow, moving bodies, and what it refuses."""
import csv
import math
from pathlib import Path

import pytest

RUNS = Path(__file__).resolve().parents[2] / "runs"
COARSE = ["-mesh_cells", "8,8,8", "-output_every", "0"]  # 4 cells a diameter
RADIUS = 0.2481402

FALL = """\
mesh: {dimension: 3, cells: [6, 6, 10], lower: [0, 0, 0], upper: [1, 1, 1.66667]}
flow: {density: 1, viscosity: 0.1, gravity: [0, 0, -98]}
couple: {method: aligned}
particle:
  groups: ball
  ball: {shape: ellipse, a: 0.3, b: 0.22, c: 0.22, angle: 0.4, density: 1.25, position: [0.48, 0.5, 1.02]}
sim: {dt: 0.02, steps: 4}
output: {every: 0}
"""


def last(result, name="series.csv"):
    assert result.status == 0, str(result)
    with open(result.folder / "out" / name) as file:
        return list(csv.DictReader(file))[-1]


@pytest.mark.parametrize("boundary, tolerance", [("aligned", 0.002), ("penalty", 0.035)])
def test_array(run, boundary, tolerance):
    """Zick & Homsy 1982 (finer: make validate); the force on the sphere is what drives the flow."""
    result = run([RUNS / "sphere-array.yaml", "-output_dir", "out", "-couple_method", boundary, *COARSE])
    row = last(result)
    K = 1 / (6 * math.pi * RADIUS * float(row["mean_velocity_x"]))
    assert K == pytest.approx(2.8102, rel=tolerance), K
    assert float(last(result, "bodies.csv")["force_x"]) == pytest.approx(1, abs=1e-4)  # the volume of the body is exact, that of the fluid the mesh has
    assert int(row.get("aligned_penalty_bodies", 0)) == 0


def test_sphere_in_a_sphere(run):
    """Exact (drag: Happel & Brenner); a mesh of curved cells, fitted to the container, that aligned lines up with the sphere."""
    drag = [RUNS / "sphere-in-sphere.yaml", "-output_dir", "out", "-output_overwrite", "-output_every", "0", "-mesh_resolution", "6"]
    body = last(run(drag), "bodies.csv")
    assert -float(body["force_z"]) / (6 * math.pi) == pytest.approx(7.29412, rel=0.006)
    body = last(run([*drag, "-particle_ball_velocity", "0,0,0", "-particle_ball_angular_velocity", "0,0,1"]), "bodies.csv")
    assert -float(body["torque_z"]) / (8 * math.pi) == pytest.approx(8 / 7, rel=0.002)


def test_film_of_a_rung(run):
    """Method penalty draws surfaces back in films of about a cell (runs/studies/contact): the law begins at twice the gap in space."""
    scene = [RUNS / "studies" / "contact" / "film-wall.yaml", "-scene_dry_run", "-mesh_cells", "4,4,4", "-mesh_levels", "1", "-contact_lubrication"]
    for method, gap in ("penalty", "8."), ("aligned", "4."):
        assert f"lubrication below gap {gap}, roughness 0.08" in run([*scene, "-couple_method", method]).text


def test_steady_cylinder_by_iteration(run):
    """A coarse 3D-1Z: Newton's method with linear solves that go no further than they help (1e-6 each: 2.5 times the iterations)."""
    coarse = ["-mesh_resolution", "3", "-mesh_layers", "3", "-mesh_layer_ratio", "1"]
    row = last(run([RUNS / "cylinder-3d1z.yaml", "-output_dir", "out", "-output_every", "0", *coarse]))
    assert float(row["cd_residual"]) == pytest.approx(6.18533, rel=0.015)
    assert int(row["outer_iterations"]) < 130


@pytest.mark.parametrize("axis", "xyz")
def test_turning_sphere(run, axis):
    spin = {"x": "1,0,0", "y": "0,1,0", "z": "0,0,1"}[axis]
    result = run([RUNS / "sphere-array.yaml", "-output_dir", "out", "-flow_force", "0,0,0", "-particle_ball_angular_velocity", spin, *COARSE])
    body = last(result, "bodies.csv")
    for a in "xyz":
        factor = -float(body["torque_" + a]) / (8 * math.pi * RADIUS**3)
        assert factor == pytest.approx(1.06861 if a == axis else 0, rel=0.002, abs=1e-3), (a, factor)


def test_falling_ellipsoid_on_any_ranks(run, scene):
    """The body crosses cells; every rank count gives the same fall and turn to the tolerance of the solver."""
    rows = []
    for ranks in (1, 2, 3):
        result = run([scene(FALL), "-output_dir", "out", "-output_overwrite", "-flow_ksp_rtol", "1e-9"], ranks)
        series = last(result)
        rows.append([float(last(result, "bodies.csv")[name]) for name in ("z", "w", "omega_y", "omega_x", "q0")])
        assert int(series["aligned_penalty_bodies"]) == 0 and int(series["aligned_unchanged"]) == 0
        assert float(series["momentum_error"]) < 1e-5
    for row in rows[1:]:
        assert row == pytest.approx(rows[0], rel=1e-6, abs=1e-7)


def test_plate_is_refused(run, scene):
    plate = FALL.replace("shape: ellipse, a: 0.3, b: 0.22, c: 0.22, angle: 0.4", "shape: box, size: [0.6, 0.6, 0.05]")
    result = run([scene(plate), "-output_dir", "out"])
    assert result.status != 0
    for words in ("Group 'ball'", "0.05 thick", "-couple_method aligned", "-mesh_cells", "-couple_method penalty"):
        assert words in result.text, str(result)


def test_body_that_cannot_be_followed_is_counted(run, scene):
    """A ball smaller than a cell: held by the penalty, and said"""
    result = run([scene(FALL.replace("shape: ellipse, a: 0.3, b: 0.22, c: 0.22, angle: 0.4", "shape: circle, radius: 0.06")), "-output_dir", "out", "-sim_steps", "2"])
    assert int(last(result)["aligned_penalty_bodies"]) == 1
