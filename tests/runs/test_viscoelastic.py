"""Viscoelastic fluids: exact solutions, conformations of steady shear, bodies, restarts, ranks, and mistakes of users."""
import csv
import math

import h5py
import numpy
import pytest

from conftest import ROOT
from test_restart import assert_identical

STARTUP = ROOT / "runs" / "viscoelastic-startup.yaml"


def mean_velocity(time, elasticity, beta):
    """Of plane Poiseuille flow from rest, half height 1, final mean 1 (Waters & King 1970): modes cos(k y) of velocity and shear stress."""
    total = 0
    for n in range(60):
        k = (n + 0.5) * math.pi
        matrix = numpy.array([[-beta * k * k, -k], [(1 - beta) * k / elasticity, -1 / elasticity]], dtype=complex)
        steady = -numpy.linalg.solve(matrix, [6 * (-1) ** n / k, 0])
        values, vectors = numpy.linalg.eig(matrix)
        now = steady - (vectors * numpy.exp(values * time)) @ numpy.linalg.solve(vectors, steady)
        total += now[0].real * (-1) ** n / k
    return total


def series(folder, name="series.csv"):
    with open(folder / name) as file:
        return list(csv.DictReader(file))


def run_well(run, args, ranks=1):
    result = run(args, ranks)
    assert result.status == 0, str(result)
    return result.folder / "out"


@pytest.mark.parametrize("elasticity, steps, bound", [(1, (0.04, 0.02), 3e-3), (10, (0.1, 0.05), 2e-3)])
def test_startup(run, elasticity, steps, bound):
    """The mean velocity on eight cells, at all times within the bound of its largest value, and of second order in time. At 10 the polymer
    is so stretched that only its present stiffness in the matrix keeps the step stable."""
    errors = []
    for dt in steps:
        args = ["-mesh_cells", "3,16", "-flow_rheology_time", str(elasticity), "-sim_dt", str(dt), "-sim_time", "4", "-output_every", "0", "-output_overwrite"]
        rows = series(run_well(run, [STARTUP, "-output_dir", "out", *args]))
        error = [abs(float(r["mean_velocity_x"]) - mean_velocity(float(r["time"]), elasticity, 1 / 9)) for r in rows[5:]]
        errors.append(max(error) / max(float(r["mean_velocity_x"]) for r in rows))
    assert errors[1] < bound and errors[1] < errors[0] / 3, f"errors {errors}"


SHEAR = """\
mesh: {cells: [3, 4], lower: [0, 0], upper: [0.75, 1], periodic: x}
flow: {density: 0.01, viscosity: 1, initial: shear, rheology_time: 1, rheology_solvent: 0.1, bc: {top: {type: moving_wall, velocity: [3, 0]}}}
sim: {dt: 0.1, time: 20}
output: {every: 200}
"""


def steady_shear(law, rate, parameter):
    """c_xx, c_xy, c_yy of a fluid sheared at the rate (relaxation time 1)."""
    if law == "fene_p":  # f^3 - f^2 = 2 rate^2/b, then c = (1 + 2 (rate/f)^2, rate/f, 1)/f
        f = max(r.real for r in numpy.roots([1, -1, 0, -2 * rate**2 / parameter]) if abs(r.imag) < 1e-9)
        return (1 + 2 * (rate / f) ** 2) / f, rate / f**2, 1 / f
    if law == "giesekus":  # Bird, Armstrong & Hassager 1987, table 7.3-1: with n2 = (1 - l)/(1 + (1 - 2a) l)
        a = parameter
        l2 = (math.sqrt(1 + 16 * a * (1 - a) * rate**2) - 1) / (8 * a * (1 - a) * rate**2)
        n2 = (1 - math.sqrt(l2)) / (1 + (1 - 2 * a) * math.sqrt(l2))
        shear = rate * (1 - n2) ** 2 / (1 + (1 - 2 * a) * n2)
        first = 2 * n2 * (1 - a * n2) / (a * (1 - n2))  # N1 over the modulus; N2 is -n2
        return 1 + first - n2, shear, 1 - n2
    return 1 + 2 * rate**2, rate, 1


@pytest.mark.parametrize("law, option, parameter", [("oldroyd_b", "", 0), ("giesekus", "mobility", 0.2), ("fene_p", "extensibility", 30)])
def test_steady_shear(run, scene, law, option, parameter):
    extra = [f"-flow_rheology_{option}", str(parameter)] if option else []
    out = run_well(run, [scene(SHEAR), "-output_dir", "out", "-flow_rheology", law, *extra])
    with h5py.File(out / "fields_200.h5") as file:
        c = file["conformation"][:]
    xx, xy, yy = steady_shear(law, 3, parameter)
    for column, exact in (0, xx), (1, xy), (3, yy), (2, 0), (4, 0):
        assert numpy.abs(c[:, column] - exact).max() < 2e-5 * xx, f"component {column} of {law}: {c[0, column]}, exact {exact}"


FALL = """\
mesh: {cells: [8, 16], lower: [0, 0], upper: [1, 2]}
flow: {density: 1, viscosity: 1, gravity: [0, -981], rheology: oldroyd_b, rheology_time: 0.05, rheology_solvent: 0.5}
particle:
  groups: disc
  disc: {shape: circle, radius: 0.2, density: 1.5, position: [0.45, 1.4]}
sim: {dt: 0.005, steps: 10}
"""


@pytest.mark.parametrize("method, ranks", [("penalty", 2), ("aligned", 1)])
def test_restart_is_identical(run, scene, method, ranks):
    args = [scene(FALL), "-checkpoint_every", "4", "-couple_method", method]
    whole = run([*args, "-output_dir", "whole"], ranks)
    first = run([*args, "-output_dir", "parts", "-sim_steps", "4"], ranks)
    rest = run([*args, "-output_dir", "parts", "-sim_restart", "latest"], ranks)
    assert whole.status == first.status == rest.status == 0, str(rest)
    assert_identical(whole.folder / "whole", whole.folder / "parts")


# Its surface's nodes swung, by the psi that was extrapolated to them, and stopped runs with either step at t = 0.2.
HEAVY = """\
mesh: {cells: [14, 21], lower: [-1, 0], upper: [1, 3]}
flow: {density: 1, viscosity: 1, gravity: [0, -20], rheology: oldroyd_b, rheology_time: 0.5, rheology_solvent: 0.2}
particle:
  groups: disc
  disc: {shape: circle, radius: 0.5, density: 4, position: [0, 2.2]}
couple: {method: aligned}
sim: {time: 0.32}
"""


def test_surface_keeps_its_polymer(run, scene):
    for dt in "0.04", "0.02":
        out = run_well(run, [scene(HEAVY), "-sim_dt", dt, "-output_dir", "out", "-output_overwrite"])
        speed = max(-float(row["v"]) for row in series(out, "bodies.csv"))
        assert speed == pytest.approx(1.05, rel=0.01), f"largest speed with steps of {dt}: {speed}"


# With lumped masses of the cells' own measure some nodes of the surface had none: the largest trace was 99 here.
HELD = """\
mesh: {cells: [5, 5, 5], lower: [-1.25, -1.25, -1.25], upper: [1.25, 1.25, 1.25], periodic: z}
flow: {density: 0.01, viscosity: 1, force: [0, 0, 10], convection: false, rheology: oldroyd_b, rheology_time: 0.3, rheology_solvent: 0.5}
particle:
  groups: ball
  ball: {shape: circle, radius: 0.6, position: [0, 0, 0], free: none}
couple: {method: aligned}
sim: {dt: 0.05, steps: 8}
"""


# Where the projections alone said what stretches and convects the nodes of the surface, the determinant was 15 % off.
ROUND = """\
mesh: {cells: [13, 13], lower: [-1.25, -1.25], upper: [1.25, 1.25], periodic: x}
flow: {density: 0.01, viscosity: 1, force: [8, 0], convection: false, rheology: oldroyd_b, rheology_time: 0.5, rheology_solvent: 0.5}
particle:
  groups: disc
  disc: {shape: circle, radius: 0.6, position: [0.03, 0.05], free: none}
couple: {method: aligned}
sim: {dt: 0.05, time: 5}
output: {every: 100}
"""


def test_surface_is_sheared(run, scene):
    """Fluid that sticks to a surface at rest stays and is sheared: c is (1 + 2 s^2, s, 1) along and across, whatever the shear s, and its
    determinant half of its trace."""
    out = run_well(run, [scene(ROUND), "-output_dir", "out"])
    with h5py.File(out / "mesh_100.h5") as mesh, h5py.File(out / "fields_100.h5") as fields:
        radius = numpy.hypot(mesh["coordinates"][:, 0] - 0.03, mesh["coordinates"][:, 1] - 0.05)
        c = fields["conformation"][:][numpy.abs(radius - 0.6) < 1e-6]
    ratio = 2 * (c[:, 0] * c[:, 3] - c[:, 1] ** 2) / (c[:, 0] + c[:, 3])
    assert len(c) > 40 and c[:, 0].max() > 10, "the disc is no surface of the mesh, or nothing is stretched there"
    assert numpy.abs(ratio - 1).max() < 5e-3, f"determinant over half of the trace from {ratio.min()} to {ratio.max()}"


def test_sphere(run, scene):
    trace = float(series(run_well(run, [scene(HELD), "-output_dir", "out"]))[-1]["conformation_trace_max"])
    assert 15 < trace < 30, f"largest trace: {trace}"


def test_ranks_agree(run, scene):
    rows = []
    for ranks in 1, 2:
        args = [scene(FALL), "-couple_method", "aligned", "-flow_ksp_rtol", "1e-10", "-output_dir", "out", "-output_overwrite"]
        rows.append(series(run_well(run, args, ranks))[-1])
    for column in "kinetic_energy", "elastic_energy", "conformation_trace_max", "conformation_eigenvalue_min":
        for row in rows[1:]:
            assert float(row[column]) == pytest.approx(float(rows[0][column]), rel=1e-6), f"{column}: {[r[column] for r in rows]}"


MISTAKES = [
    (["-flow_rheology_solvent", "1"], "leaves nothing of -flow_viscosity"),
    (["-flow_rheology", "giesekus"], "needs -flow_rheology_mobility"),
    (["-flow_rheology", "fene_p"], "needs -flow_rheology_extensibility"),
    (["-flow_rheology_mobility", "0.1"], "-flow_rheology giesekus"),
    (["-flow_time", "cn"], "use -flow_time bdf2 or be"),
    (["-sim_dt", "5", "-sim_time", "500", "-flow_force", "3000,0", "-flow_rheology_implicit", "none"], "The conformation of -flow_rheology oldroyd_b"),
]


@pytest.mark.parametrize("args, phrase", MISTAKES)
def test_mistakes(run, args, phrase):
    result = run([STARTUP, "-output_dir", "out", *args])
    assert result.status != 0 and phrase in str(result), str(result)


def test_no_steady_solver(run, scene):
    result = run([scene(SHEAR.replace("sim: {dt: 0.1, time: 20}", "sim: {steady: true}")), "-output_dir", "out", "-flow_rheology", "oldroyd_b"])
    assert result.status != 0 and "finds its steady state in time alone: remove -sim_steady" in str(result), str(result)
