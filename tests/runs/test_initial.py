"""What a run starts from: flows between walls, the steady solution, another run on another mesh, bodies that move with the fluid."""
import csv

import pytest

from test_badinput import refused

WALLS = "bc: {top: {type: moving_wall, velocity: [0.5, 0]}, bottom: {type: moving_wall, velocity: [-0.5, 0]}}"
SHEAR = f"""\
mesh: {{cells: [8, 8], lower: [0, -0.5], upper: [1, 0.5], periodic: x}}
flow: {{viscosity: 0.04, initial: shear, ksp_rtol: 1e-9, {WALLS}}}
sim: {{dt: 0.05, steps: 2}}
"""
SHEAR_3D = """\
mesh: {dimension: 3, cells: [3, 4, 3], periodic: [x, z]}
flow: {viscosity: 0.04, initial: poiseuille, force: [0.32, 0, 0.16], ksp_rtol: 1e-9, bc: {top: {type: moving_wall, velocity: [0, 0, 1]}}}
sim: {dt: 0.05, steps: 2}
"""
DISC = """\
mesh: {cells: [16, 16], lower: [-1, -1], upper: [1, 1], periodic: x}
flow: {viscosity: 0.05, initial: expression, velocity: "1 - y^2, 0.2*sin(pi*x)", force: [0.1, 0]}
particle: {groups: disc, disc: {shape: circle, radius: 0.3, position: [0.1, 0], free: none}}
couple: {method: nodal}
sim: {dt: 0.002, steps: 3}
"""


def rows(result, name, folder="out/disc"):
    assert result.status == 0, str(result)
    with open(result.folder / folder / name) as file:
        return [{k: float(v) for k, v in row.items() if k != "group"} for row in csv.DictReader(file)]


def test_flow_between_walls_stays(run, scene):
    """Couette flow, and in space the sum of Couette and Poiseuille flow: kinetic energy is that of the formula, and stays."""
    for row in rows(run([scene(SHEAR)]), "series.csv"):
        assert row["kinetic_energy"] == pytest.approx(1 / 24, rel=1e-9)
    top = [0.32 / (8 * 0.04), 0.16 / (8 * 0.04)]
    # int (4 s (1 - s))^2 = 8/15, int 4 s (1 - s) s = 1/3, int s^2 = 1/3
    want = 0.5 * (8 / 15 * (top[0] ** 2 + top[1] ** 2) + 2 / 3 * top[1] + 1 / 3)
    for row in rows(run([scene(SHEAR_3D), "-output_overwrite"]), "series.csv"):
        assert row["kinetic_energy"] == pytest.approx(want, rel=1e-9)


def test_bodies_start_with_the_fluid(run, scene):
    """A disc goes with the fluid at its centre and turns at half the shear; what an ellipse has is its fluid's angular momentum (Jeffery's rate)."""
    text = SHEAR.replace("[8, 8]", "[24, 24]").replace("dt: 0.05, steps: 2", "dt: 1e-6, steps: 1") + (
        "particle:\n  groups: [disc, ellipse]\n"
        "  disc: {shape: circle, radius: 0.1, density: 1e6, position: [0.02, 0.3], initial_velocity: fluid}\n"
        "  ellipse: {shape: ellipse, a: 0.2, b: 0.1, density: 1e6, angle: 1.5707963267948966, position: [0.5, -0.1], initial_velocity: fluid}\n"
    )
    disc, ellipse = rows(run([scene(text)]), "bodies.csv")  # heavy: what they start with, they have
    assert [disc["u"], disc["v"], disc["omega_z"]] == pytest.approx([0.3, 0, -0.5], abs=2e-3)
    assert [ellipse["u"], ellipse["v"], ellipse["omega_z"]] == pytest.approx([-0.1, 0, -0.8], abs=2e-3)


def test_bodies_start_with_their_velocity(run, scene):
    """A disc as heavy as the fluid, given a velocity: it keeps half of it, since its added mass is its own, and its spin, less what fluid in the cells
    at its surface takes; in fluid that moves, too, by velocities beside its own. (It had the fluid's; with nodal it still has, with a remark.)"""
    text = """\
mesh: {cells: [32, 32], lower: [0, 0], upper: [4, 4], periodic: [x, y]}
flow: {density: 1, viscosity: 1e-4, ksp_rtol: 1e-8}
particle: {groups: disc, disc: {shape: circle, radius: 0.5, density: 1, position: [3.93, 2.01], velocity: [-1, 0], angular_velocity: 0.5}}
sim: {dt: 0.001, steps: 1}
"""
    moves = ["-flow_initial", "uniform", "-flow_velocity", "2,0", "-particle_disc_velocity", "1,0"]
    assert "remark: -couple_method nodal: free bodies begin with their own velocity as far as" in run([scene(text), "-couple_method", "nodal"]).text
    for method, more in (("aligned", []), ("penalty", []), ("penalty", moves)):
        result = run([scene(text), "-couple_method", method, *more, "-output_overwrite"])
        disc, = rows(result, "bodies.csv")
        assert "free bodies begin" not in result.text
        assert [disc["u"] - 2 * bool(more), disc["v"]] == pytest.approx([-0.5, 0], abs=0.015), f"{method} {more}"
        assert 0.41 < disc["omega_z"] < 0.5
    solved = ["-flow_initial", "expression", "-flow_velocity", "0,0"]  # made to fit the disc, which keeps what it was given
    for method, most in (("aligned", 1e-3), ("nodal", 1e-3), ("penalty", 0.04)):
        result = run([scene(text), "-couple_method", method, *solved, "-output_overwrite"])
        assert rows(result, "bodies.csv")[0]["u"] == pytest.approx(-1, rel=most) and "free bodies begin" not in result.text


def test_expression_does_not_kick(run, scene):
    """A formula that no flow past the disc obeys is made free of divergence: the first force is not that of an impulse."""
    first, second, _ = (row["force_x"] for row in rows(run([scene(DISC)]), "bodies.csv"))
    assert 0.5 < first / second < 2, f"forces {first:g}, {second:g}"


def test_steady_flow_stays_and_starts_another_mesh(run, scene):
    args = [scene(DISC.replace('initial: expression, velocity: "1 - y^2, 0.2*sin(pi*x)"', "initial: steady")), "-output_every", "3"]
    start = run(args)
    first, *_, last = rows(start, "bodies.csv")
    energy = rows(start, "series.csv")[-1]["kinetic_energy"]
    assert first["force_x"] == pytest.approx(last["force_x"], rel=1e-6) and first["force_x"] > 0.1
    more = ["-flow_initial", "run", "-flow_initial_run", "out/disc", "-mesh_cells", "20,12", "-output_dir", "out/other"]
    result = run([*args, *more])
    assert rows(result, "series.csv", "out/other")[0]["kinetic_energy"] == pytest.approx(energy, rel=1e-2)
    assert "lie outside" not in result.text
    shifted = run([*args, *more[:-1], "out/shifted", "-mesh_upper", "1,1.5"])
    assert "lie outside the mesh of -flow_initial_run" in shifted.text and shifted.status == 0, str(shifted)


BAD = {
    "no walls": (["-flow_initial", "shear"], "-flow_initial shear: the box has no two walls"),
    "no speed": (["-flow_initial", "poiseuille"], "-flow_initial poiseuille needs -flow_velocity"),
    "two flows": (["-flow_initial", "rest", "-flow_velocity", "1,0"], "-flow_velocity has no meaning with -flow_initial rest"),
    "no velocity": (["-flow_initial", "uniform"], "-flow_initial uniform needs -flow_velocity"),
    "no run": (["-flow_initial", "run"], "-flow_initial run needs -flow_initial_run"),
    "no fields": (["-flow_initial", "run", "-flow_initial_run", "nowhere"], "nowhere: no fields there"),
    "no profile": (["-flow_initial", "plug"], "Option -flow_initial = plug is not known"),
    "two velocities": (["-particle_disc_initial_velocity", "fluid", "-particle_disc_velocity", "1,0"], "and -particle_disc_velocity gives one"),
    "not free": (["-particle_disc_initial_velocity", "fluid", "-particle_disc_free", "none"], "no degree of freedom of group 'disc' is free"),
    "sweep": (["-flow_solver", "fast", "-flow_initial", "steady"], "solves no steady problem: use direct, balanced or accurate with -flow_initial steady"),
    "held": (["-particle_disc_initial_velocity", "fluid", "-flow_initial", "steady"], "the fluid in the body's place is held"),
}


@pytest.mark.parametrize("fault", BAD)
def test_bad_start(run, scene, fault):
    args, phrase = BAD[fault]
    refused(run([scene(), *args], 1), phrase)
