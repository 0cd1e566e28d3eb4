"""Large-eddy simulation and statistics: laminar flows as they are, ranks, restarts, bodies that move, mistakes of users."""
import csv
import json
import math

import numpy
import pytest

from conftest import ROOT
from test_restart import assert_identical


def table(path):
    with open(path) as file:
        return [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]


def run_well(run, args, ranks=1):
    result = run(args, ranks)
    assert result.status == 0, str(result)
    return result.folder / "out"


LAMINAR = """\
mesh: {cells: [3, 8, 3], lower: [0, -1, 0], upper: [1, 1, 1], periodic: [x, z], stretch: [0, 1.5, 0]}
flow: {viscosity: 0.1, force: [0.3, 0, 0], velocity: [1.5, 0, 0], initial: poiseuille, ksp_rtol: 1e-9}
output: {statistics: y, statistics_from: 0.1}
monitor: {probes: [0.3, 0.25, 0.4, 0.9, -1, 0.5]}
sim: {dt: 0.05, time: 0.3}
"""


def test_laminar(run, scene):
    """WALE has no viscosity in pure shear, and the parabola is one of the element: profile, friction and probes are exact. Smagorinsky damped
    at the walls slows it down."""
    folder = run_well(run, [scene(LAMINAR), "-flow_rheology", "wale", "-output_dir", "out"])
    for row in table(folder / "statistics.csv"):
        assert row["u"] == pytest.approx(1.5 * (1 - row["position"] ** 2), abs=1e-7), row
        assert max(abs(row[k]) for k in ("v", "w", "uu", "vv", "ww", "uv", "uw", "vw", "eddy_viscosity")) < 1e-7, row
    with open(folder / "summary.json") as file:
        quantities = json.load(file)["quantities"]
    assert quantities["re_tau"] == pytest.approx(math.sqrt(0.3) / 0.1, rel=1e-7)
    assert quantities["friction_velocity_lower"] == pytest.approx(math.sqrt(0.3), rel=1e-7)
    assert quantities["statistics_time"] == pytest.approx(0.2)
    last = table(folder / "series.csv")[-1]
    assert last["probe_0_u"] == pytest.approx(1.5 * (1 - 0.25**2), abs=1e-7) and abs(last["probe_1_u"]) < 1e-12
    folder = run_well(run, [scene(LAMINAR), "-flow_rheology", "smagorinsky", "-flow_les_friction", "0.5", "-output_dir", "out", "-output_overwrite"])
    assert max(row["eddy_viscosity"] for row in table(folder / "statistics.csv")) > 1e-6
    assert table(folder / "series.csv")[-1]["mean_velocity_x"] < 1 - 1e-8


VORTICES = """\
mesh: {cells: [6, 6, 6], upper: [6.283185307179586, 6.283185307179586, 6.283185307179586], periodic: [x, y]}
flow:
  viscosity: 1e-3
  velocity: ["sin(x)*cos(y)*sin(z)", "(-cos(x)*sin(y)*sin(z))", "0.3*sin(x+y)*sin(z)^2"]
  rheology: smagorinsky
  bc: {front: {type: moving_wall, velocity: [0.5, 0, 0]}}
output: {statistics: z}
particle:
  groups: ball
  ball: {shape: circle, radius: 1, density: 2, position: [3, 3, 3]}
sim: {dt: 0.1, steps: 4}
checkpoint: {every: 2}
"""


def test_ranks(run, scene):
    """The same decay on 1, 2 and 3 ranks, within what the solvers leave, with a ball and a wall that moves"""
    found = []
    for ranks in (1, 2, 3):
        args = ["-flow_solver", "direct", "-mesh_cells", "4,4,4", "-particle_ball_radius", "1.4", "-sim_steps", "3", "-checkpoint_every", "0", "-output_overwrite"]
        folder = run_well(run, [scene(VORTICES), "-output_dir", "out", *args], ranks)
        planes = table(folder / "statistics.csv")
        found.append([table(folder / "series.csv")[-1]["kinetic_energy"], *(row[k] for row in planes for k in ("u", "uu", "uw", "eddy_viscosity"))])
    for other in found[1:]:
        assert numpy.allclose(other, found[0], rtol=1e-6, atol=1e-8), numpy.abs(numpy.subtract(other, found[0])).max()


def test_restart(run, scene):
    """From a checkpoint: the same sums, to the last bit"""
    whole = run_well(run, [scene(VORTICES), "-output_dir", "out"])
    run_well(run, [scene(VORTICES), "-output_dir", "parts", "-sim_steps", "2"])
    result = run([scene(VORTICES), "-output_dir", "parts", "-sim_restart", "latest"])
    assert result.status == 0, str(result)
    parts = result.folder / "parts"
    assert_identical(whole, parts)
    assert (whole / "statistics.csv").read_text() == (parts / "statistics.csv").read_text()


COARSE = """\
mesh: {cells: [4, 6, 4], lower: [0, -1, 0], upper: [3, 1, 1], periodic: [x, z]}
flow:
  viscosity: 0.002
  force: [1, 0, 0]
  velocity: [8*(1 - y^8) + 3*cos(2*pi*z)*(1 - y^2)*(y + 1.5), 2*sin(4*pi*x/3)*sin(2*pi*z)*(1 - y^2)^2, 2*sin(4*pi*x/3 + 2*pi*z + y)*(1 - y^2)]
  ksp_rtol: 1e-8
sim: {dt: 0.01, steps: 40}
checkpoint: {every: 20}
output: {every: 0}
"""


def lost_momentum(folder):
    """What friction and acceleration lack of the driving force, of it, over steps 5 to the last"""
    rows = table(folder / "series.csv")[4:]
    volume = 6.0
    time = rows[-1]["time"] - rows[0]["time"]
    gained = (rows[-1]["mean_velocity_x"] - rows[0]["mean_velocity_x"]) / time
    friction = sum(row["wall_force_bottom_x"] + row["wall_force_top_x"] for row in rows[1:]) / (len(rows) - 1) / volume
    return 1 - gained - friction


def test_momentum(run, scene):
    """Where cells are too coarse for the flow the convective form gains or loses momentum, and a remark says so; the conservative one
    gives it back, also across a restart"""
    result = run([scene(COARSE), "-output_dir", "out", "-sim_steps", "50"])
    assert result.status == 0 and "remark: convection has taken 34 % of the force" in result.text, str(result)
    convective = lost_momentum(result.folder / "out")
    args = [scene(COARSE), "-flow_convection_form", "conservative"]
    whole = run_well(run, [*args, "-output_dir", "out", "-output_overwrite"])
    lost = lost_momentum(whole)
    assert abs(lost) < 0.1 * abs(convective), (lost, convective)
    run_well(run, [*args, "-output_dir", "parts", "-sim_steps", "20"])
    result = run([*args, "-output_dir", "parts", "-sim_restart", "latest"])
    assert result.status == 0, str(result)
    assert_identical(whole, result.folder / "parts")


FALLING = """\
mesh: {cells: [16, 32], upper: [1, 2]}
flow: {density: 1, viscosity: 1e-3, gravity: [0, -981]}
particle:
  groups: disc
  disc: {shape: circle, radius: 0.125, density: 1.5, position: [0.45, 1.6]}
sim: {dt: 0.005, time: 0.1}
"""


@pytest.mark.parametrize("law, method", [("smagorinsky", "penalty"), ("wale", "nodal"), ("smagorinsky", "aligned")])
def test_falling_disc(run, scene, law, method):
    """A disc falls at Reynolds numbers up to several thousand, on cells of an eighth of it: speeds stay below those without drag"""
    args = ["-sim_dt", "0.0025", "-sim_time", "0.06"] if method == "aligned" else []
    folder = run_well(run, [scene(FALLING), "-flow_rheology", law, "-couple_method", method, "-output_dir", "out", *args])
    with open(folder / "bodies.csv") as file:
        fastest = max(-float(row["v"]) for row in csv.DictReader(file))
    assert 5 < fastest < 981 * 0.5 / 1.5 * 0.1, fastest


@pytest.mark.parametrize(
    "args, parts",
    [
        (["-flow_rheology", "wale", "-sim_steady"], ["wale", "no steady state", "-sim_steady"]),
        (["-flow_rheology", "wale", "-flow_les_damping", "none"], ["-flow_les_damping", "smagorinsky"]),
        (["-flow_les_constant", "0.1"], ["-flow_les_constant", "-flow_rheology"]),
        (["-output_statistics", "z"], ["two dimensions"]),
        (["-monitor_probes", "0.5,0.5,0.5"], ["-monitor_probes", "2 for each"]),
        (["-monitor_probes", "5,0.5"], ["-monitor_probes", "no cell"]),
        (["-mesh_stretch", "1,1", "-mesh_periodic", "x"], ["-mesh_stretch", "periodic"]),
        (["-mesh_kind", "disc", "-output_statistics", "y"], ["-output_statistics", "planes"]),
        (["-flow_convection_form", "conservative", "-flow_bc_right_type", "outflow"], ["conservative", "skew"]),
    ],
)
def test_refused(run, scene, args, parts):
    box = "mesh: {cells: [6, 6]}\nsim: {dt: 0.1, steps: 1}\n"
    if "disc" in args:
        box = "mesh: {resolution: 4}\nsim: {dt: 0.1, steps: 1}\n"
    if "-sim_steady" in args:
        box = "mesh: {cells: [6, 6]}\n"
    result = run([scene(box), "-output_dir", "out", *args])
    assert result.status != 0, str(result)
    for part in parts:
        assert part in result.text, f"'{part}' is missing\n{result}"
