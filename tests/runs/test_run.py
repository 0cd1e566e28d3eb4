"""Whole runs on small meshes: what the scene says is what happens, whatever the number of ranks and the solver.

Bounds are those of the method on these coarse meshes (a disc of diameter d on cells of size h), not of the physics.
"""
import collections
import csv
import json
import math
import os
import re
import shutil
import subprocess
import xml.etree.ElementTree

import pytest

from conftest import ROOT, edited

# d/h = 4
DISC = """\
mesh: {cells: [16, 32], lower: [0, 0], upper: [1, 2]}
flow: {density: 1, viscosity: 0.1, gravity: [0, -981]}
particle:
  groups: disc
  disc: {shape: circle, radius: 0.125, density: 1.25, position: [0.45, 1.4]}
sim: {dt: 0.005, steps: 6}
"""
NINE = edited("position: [0.45, 1.4]", "place: lattice, count: 9", DISC)
SQUARE = edited("[16, 32]", "[16, 16]", edited("[1, 2]", "[1, 1]", edited("[0.45, 1.4]", "[0.5, 0.5]", DISC)))
STATE = ["x", "y", "angle", "u", "v", "omega_z", "force_x", "force_y", "torque_z"]
PLATE = edited("shape: circle, radius: 0.125, density: 1.25", "shape: leaflet, length: 0.4, thickness: 0.03, origin: 0.5, density: 4, angle: 0.4", DISC)  # half a cell thick
EXACT = ["-flow_ksp_rtol", "1e-10"]


class Run:
    """A run that went well, with its tables."""

    def __init__(self, result, name):
        assert result.status == 0, str(result)
        folder = result.folder / "out" / name
        self.result = result
        self.series, self.bodies = ([{k: number(v) for k, v in row.items()} for row in read(folder / file)] for file in ("series.csv", "bodies.csv"))
        self.summary = json.loads((folder / "summary.json").read_text())

    def end(self):
        """State of all bodies after the last step."""
        return [row for row in self.bodies if row["step"] == self.series[-1]["step"]]

    def iterations(self):
        return [row["outer_iterations"] for row in self.series]


def read(path):
    with open(path) as file:
        return list(csv.DictReader(file))


def number(text):
    try:
        return float(text)
    except ValueError:
        return text


@pytest.fixture(scope="module")
def finished():
    """Runs so far, by what was run: many tests compare with the same one."""
    return {}


@pytest.fixture
def go(run, scene, finished):
    """go(text, *args, ranks=1): run the scene text to its end."""

    def start(text, *args, ranks=1):
        key = (text, args, ranks)
        if key not in finished:
            finished[key] = Run(run([scene(text), "-output_overwrite", *args], ranks), "disc")
        return finished[key]

    return start


def assert_same(one, other, tolerance, what=tuple(STATE)):
    """End states agree, relative to the largest value of each column."""
    assert len(one.end()) == len(other.end()) > 0
    for name in what:
        scale = max(max(abs(row[name]) for row in one.end()), 1e-3)
        gap = max(abs(a[name] - b[name]) for a, b in zip(one.end(), other.end()))
        assert gap <= tolerance * scale, f"{name} differs by {gap:g}, allowed {tolerance * scale:g}\n{other.result}"


# ---- ranks ----


NODAL = ["-couple_method", "nodal"]
RANK_CASES = {
    "implicit": (DISC, NODAL),
    "explicit": (DISC, [*NODAL, "-couple_type", "explicit", "-particle_disc_density", "10"]),
    "mesh follows": (DISC, [*NODAL, "-mesh_deform", "-deform_ksp_rtol", "1e-8"]),
    "nine": (NINE, NODAL),
    "plate": (PLATE, ["-couple_method", "aligned"]),
    "nine explicit": (NINE, [*NODAL, "-couple_type", "explicit", "-particle_disc_density", "20", "-sim_dt", "0.001"]),
}


@pytest.mark.parametrize("case", RANK_CASES)
def test_ranks_agree(go, case):
    text, args = RANK_CASES[case]
    args = [*args, "-flow_ksp_rtol", "1e-9"]
    one = go(text, *args)
    for ranks in 2, 3:
        assert_same(one, go(text, *args, ranks=ranks), 1e-6)


# ---- solvers ----

# what is chosen, allowed difference to the balanced solver. Two iterations a step (fast) leave an error of their own.
SOLVERS = {
    "-flow_solver fast": 1e-2,
    "-flow_solver accurate": 1e-5,
    "-flow_solver direct": 1e-5,
    "-flow_schur projection": 1e-5,
    "-flow_schur commutator": 1e-5,
    "-flow_velocity_smoother sor": 1e-5,
    "-flow_velocity_smoother ilu": 1e-5,
    **{f"-flow_fieldsplit_pressure_pc_type {name}": 1e-5 for name in ("gamg", "hypre", "mg")},
    **{f"-flow_fieldsplit_velocity_pc_type {name}": 1e-5 for name in ("hypre", "jacobi", "sor", "bjacobi")},
    "-couple_force volume": 1e-5,  # read after the solve: moves nothing with implicit coupling
    "-couple_force residual": 1e-5,
    "-flow_time be": 5e-2,
    "-flow_time cn": 5e-2,
    "-flow_time bdf2": 1e-5,
}


@pytest.mark.parametrize("choice", SOLVERS)
def test_solvers_agree(go, choice):
    versions = go(DISC, ranks=2).summary["versions"]
    if "hypre" in choice and "hypre" not in versions:
        pytest.skip(f"PETSc {versions['petsc']} is built without hypre")
    solved = ["-flow_rtol_max", 1e-5]
    assert_same(go(DISC, *solved, ranks=2), go(DISC, *solved, *choice.split(), ranks=2), SOLVERS[choice], ["x", "y", "v"])


def test_force_forms_agree(go):
    """Both forms of the drag, once the first steps are over; they converge to each other with the mesh."""
    residual, volume = (go(DISC, *NODAL, "-couple_force", form).end()[0]["force_y"] for form in ("residual", "volume"))
    assert abs(volume - residual) < 0.1 * abs(residual), (residual, volume)


CELLS = ["16,48", "32,96", "64,192"]


def count_iterations(go, place):
    text = edited("position: [0.45, 1.4]", place, edited("upper: [1, 2]", "upper: [2, 6]", DISC))
    return [go(text, "-mesh_cells", cells, "-sim_steps", "3", ranks=2).iterations() for cells in CELLS]


@pytest.mark.parametrize("place", ["position: [1, 4]", "place: lattice, count: 36"])
def test_iterations_do_not_depend_on_the_mesh(go, place):
    largest = [max(counts) for counts in count_iterations(go, place)]
    assert max(largest) <= 12, f"outer iterations {largest} on {CELLS}, allowed 12"
    assert max(largest) - min(largest) <= 3, f"outer iterations {largest} on {CELLS} differ by more than 3"


def test_momentum_balance(go):
    error = max(row["momentum_error"] for row in go(DISC, "-sim_steps", "20", ranks=2).series)
    assert error < 1e-12, f"momentum balance error {error:g}, which a closed box keeps to round-off (src/solve/conserve.c)"


# ---- motion ----


@pytest.mark.parametrize("ratio, side", [(1.25, -1), (0.1, 1), (0.001, 1)])
def test_stops_at_the_wall(go, ratio, side):
    """Bounded, on its way without turning back, and at rest in the end: beside the wall, without touching it."""
    done = go(SQUARE, "-particle_disc_density", str(ratio), "-sim_steps", "40", ranks=2)
    heavy_scale = math.sqrt(2 * 981 * 0.375 * abs(ratio - 1) / (ratio + 1))  # fall without drag, added mass of an unconfined disc
    assert max(abs(row["v"]) for row in done.bodies) < heavy_scale
    assert all(row["gap"] > 0 for row in done.bodies), f"smallest gap {min(row['gap'] for row in done.bodies):g}"
    last = done.end()[0]
    assert side * (last["y"] - 0.5) > 0.3, f"y = {last['y']:g}"
    assert abs(last["v"]) < 0.05, f"still moving: v = {last['v']:g}"
    assert abs(last["x"] - 0.5) < 1e-3, f"left the axis: x = {last['x']:g}"


@pytest.mark.parametrize("ranks", [1, 2])
def test_contact_at_rest(run, ranks):
    """Two discs stop at a gap of nothing, with rigid cells alone between them, whose pressure answers any force of contact: that may not grow by its own answer."""
    place = ["-particle_west_position", "0.875,0.5", "-particle_east_position", "1.125,0.5", "-couple_method", "nodal"]
    result = run([ROOT / "runs" / "extremes" / "pair.yaml", *place, "-output_every", 0, "-output_dir", "out"], ranks)
    assert result.status == 0, str(result)
    rows = read(result.folder / "out" / "bodies.csv")
    assert max(abs(float(row["force_x"])) for row in rows[-8:]) < 1, rows[-1]  # 10 in the first step


def test_neutral_stays_at_rest(go):
    for row in go(DISC, "-particle_disc_density", "1", ranks=2).bodies:
        assert (row["x"], row["y"], row["angle"]) == (0.45, 1.4, 0), row
        assert (row["u"], row["v"], row["omega_z"]) == (0, 0, 0), row


def test_explicit_light_body_is_stopped(run, scene):
    result = run([scene(DISC), "-couple_type", "explicit", "-particle_disc_density", "0.2", "-sim_steps", "40"], 2)
    assert result.status != 0, str(result)
    assert result.text.count("tumble: error: ") == 1 and "Use -couple_type implicit" in result.text, str(result)


def test_explicit_heavy_body_runs(go):
    explicit = go(DISC, "-couple_type", "explicit", "-particle_disc_density", "1.5", "-sim_steps", "12")
    implicit = go(DISC, "-particle_disc_density", "1.5", "-sim_steps", "12")
    assert_same(implicit, explicit, 0.2, ["y", "v"])


def test_first_acceleration(go):
    """a = g (r - 1)/(r + 1) as t -> 0+, d/h = 8. The covered nodes are now more and now fewer than the disc deserves: the mean over places counts."""
    text = edited("[16, 32]", "[64, 64]", edited("upper: [1, 2]", "upper: [2, 2]", DISC))
    dt, ratio = 1e-5, []
    for place in "1,1", "1.004,1.009", "1.011,0.995", "1.016,1.016":
        done = go(text, "-flow_time", "be", "-sim_dt", str(dt), "-sim_steps", "1", "-flow_viscosity", "1e-3", "-particle_disc_position", place, ranks=2)
        ratio.append(done.end()[0]["v"] / dt / (-981 * 0.25 / 2.25))
    mean = sum(ratio) / len(ratio)
    assert abs(mean - 1) < 0.05, f"mean {mean:.4f} of {[round(r, 4) for r in ratio]}"


# ---- 3D ----

CUBE = """\
mesh: {dimension: 3, cells: [4, 4, 4], lower: [0, 0, 0], upper: [1, 1, 1]}
flow: {density: 1, viscosity: 0.1, bc: {top: {type: moving_wall, velocity: [1, 0, 0]}}}
sim: {dt: 0.05, steps: 3}
"""
BALL = """\
mesh: {dimension: 3, cells: [6, 6, 8], lower: [0, 0, 0], upper: [1, 1, 1.5]}
flow: {density: 1, viscosity: 0.1, gravity: [0, 0, -981]}
particle:
  groups: ball
  ball: {shape: circle, radius: 0.2, density: 1.25, position: [0.5, 0.5, 1]}
sim: {dt: 0.005, steps: 2}
"""


def test_cavity_in_3d(go):
    one, two = go(CUBE, *EXACT), go(CUBE, *EXACT, ranks=2)
    energy = [row["kinetic_energy"] for row in one.series]
    assert 0 < energy[0] < energy[1] < energy[2] < 0.5
    assert abs(two.series[-1]["kinetic_energy"] / energy[2] - 1) < 1e-8


def test_ball_falls_in_3d(go):
    done = go(BALL, "-flow_rtol_max", 1e-6, ranks=2)
    first, last = done.bodies
    bound = 981 * 0.25 / (1.25 + 0.5) * 0.005  # unconfined, no drag
    assert 0.5 * bound < -first["w"] < bound and first["w"] > last["w"] > 2 * first["w"], (first["w"], last["w"])
    assert max(abs(last[name]) for name in ("u", "v", "omega_x", "omega_y", "omega_z")) < 1e-4, last
    assert done.summary["quantities"]["fall_speed_max"] == pytest.approx(-last["w"])


# ---- what the program leaves ----


def test_dry_run(run, scene):
    result = run([scene(DISC + "output: {every: 5}\n"), "-scene_dry_run"], 2)
    assert result.status == 0, str(result)
    for part in "2D, 512 cells", "Navier-Stokes", "unknowns", "group disc: 1 x circle", "coupling: implicit", "contact: law", "time: step 0.005", "not active: contact between bodies", "memory":
        assert result.text.count(part) == 1, f"'{part}' should be printed once\n{result}"
    assert not (result.folder / "out").exists(), f"a dry run wrote files\n{result}"


PLACED = """\
mesh: {dimension: 3, cells: [4, 4, 8], lower: [0, 0, -1], upper: [1, 1, 1]}
flow: {density: 1, viscosity: 1, convection: false, bc_back: {type: inflow, velocity: [0, 0, 0.5], profile: parabolic}, bc_front: {type: outflow}}
particle:
  groups: [ball, bed]
  ball: {shape: circle, radius: 0.2, free: none, position: [0.5, 0.5, 0.25]}
  bed: {shape: circle, radius: 0.1, free: none, place: lattice, count: 4, lower: [0, 0, -0.8], upper: [1, 1, -0.4]}
"""


def test_dry_run_in_space(run, scene):
    """Of a steady scene and of one in time: boundaries, where they are, what they hold; where bodies are; results"""
    steady = run([scene(PLACED + "sim: {steady: true}\n"), "-scene_dry_run"], 2)
    for part in ("box [0., 1.] x [0., 1.] x [-1., 1.]", "boundaries: left (x = 0), right (x = 1), bottom (y = 0), top (y = 1), back (z = -1), front (z = 1)",
                 "boundary back (z = -1): inflow, velocity 0,0,0.5, profile parabolic\n", "boundary front (z = 1): outflow\n", "viscosity 1., steady, Stokes",
                 "centre of mass at 0.5, 0.5, 0.25", "output: into out/disc, no snapshots"):
        assert steady.text.count(part) == 1, f"'{part}' should be printed once\n{steady}"
    lower, upper = zip(*(map(float, pair) for pair in re.findall(r"\[(\S+), (\S+)\]", re.search(r"centres of mass in (.*)", steady.out)[1])))
    assert min(lower[:2]) >= 0.1 and max(upper[:2]) <= 0.9 and -0.7 <= lower[2] <= upper[2] <= -0.5
    timed = run([scene(PLACED + "sim: {dt: 0.1, time: 0.3}\noutput: {every: 2}\n"), "-scene_dry_run"])
    assert "time: step 0.1, to 0.3, 3 steps\n" in timed.out and "time scheme bdf2" in timed.out and "snapshots every 2 steps" in timed.out, timed


@pytest.mark.parametrize("ranks", [1, 2])
def test_no_memory_is_lost(run, scene, ranks):
    """PETSc lists what is left: nothing; -malloc_view shows that it has counted."""
    result = run([scene(DISC), "-mesh_cells", "8,16", "-sim_steps", "2", "-output_every", "1", "-malloc_debug", "-malloc_dump", "-malloc_view"], ranks)
    assert result.status == 0, str(result)
    assert "Maximum memory PetscMalloc()ed" in result.text, f"memory was not traced\n{result}"
    assert "Total space allocated" not in result.text, str(result)


@pytest.mark.parametrize("ranks", [1, 2])
def test_no_objects_are_lost(run, scene, ranks):
    """PETSc's log counts what is created and destroyed of each class."""
    result = run([scene(DISC), "-sim_steps", "2", "-output_every", "1", "-log_view", ":log.txt"], ranks)
    assert result.status == 0, str(result)
    left = collections.Counter()
    for name, created, destroyed in re.findall(r"^ +(\S.*?) +(\d+) +(\d+)$", (result.folder / "log.txt").read_text().split("Object Type")[1], re.M):
        left[name] += int(created) - int(destroyed)
    left["Viewer"] = max(left["Viewer"] - 1, 0)  # the log's own, which later releases of PETSc close before they count
    assert len(left) > 10, "no table of objects in the log"
    assert not any(left.values()), {name: n for name, n in left.items() if n}


def test_valgrind(program, scene, tmp_path):
    if not shutil.which("valgrind") or "asan" in str(program):
        pytest.skip("valgrind is not installed, or the build has its own sanitizer")
    env = {**os.environ, "OMP_NUM_THREADS": "1", "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    command = ["valgrind", "--xml=yes", "--xml-file=valgrind.xml", "--leak-check=full", "--num-callers=40", str(program), scene(DISC), "-mesh_cells", "6,12", "-sim_steps", "2", "-output_every", "1"]
    done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, timeout=300, check=False)
    if "nhandled instruction" in done.stderr + (tmp_path / "valgrind.xml").read_text():
        pytest.skip("valgrind does not know all instructions of this processor")
    assert done.returncode == 0, done.stdout + done.stderr
    ours = []
    for error in xml.etree.ElementTree.parse(tmp_path / "valgrind.xml").iter("error"):
        frames = [(frame.findtext("obj", ""), frame.findtext("fn", "?"), frame.findtext("line", "")) for frame in error.iter("frame")]
        if any(fn == "PMPI_Init" for _, fn, _ in frames):
            continue  # what MPI leaves behind
        if any("/libtumble.so" in obj or "/shapes/" in obj for obj, _, _ in frames):
            ours.append(error.findtext("kind", "") + ": " + " < ".join(f"{fn}:{line}" for _, fn, line in frames[:12]))
    assert not ours, "\n".join(ours)


def test_convection_outweighs_a_body(run):
    """Two discs at four cells a diameter and CFL 3 to 5: in step 12 the convective part of a body's block in the preconditioner is larger than its mass, and negative."""
    args = ["-mesh_cells", "32,64", "-mesh_upper", "2,4", "-couple_method", "aligned", "-flow_viscosity", 0.05, "-sim_dt", 0.01, "-sim_time", 0.12]
    places = ["-particle_leader_position", "0.999,3", "-particle_trailer_position", "1.001,3.35"]
    result = run([ROOT / "runs" / "dkt.yaml", *args, *places, "-output_every", 0, "-output_dir", "out"])
    assert result.status == 0, str(result)


def test_convection_outweighs_the_diagonal(run):
    """Two discs at CFL 4 to 5 with four cells a diameter: an entry of the velocity matrix's diagonal is negative, and the sweeps' factors overflowed in step 15."""
    args = ["-mesh_cells", "32,96", "-couple_method", "aligned", "-sim_dt", 6e-3, "-sim_steps", 18]
    result = run([ROOT / "runs" / "dkt.yaml", *args, "-output_every", 0, "-output_dir", "out"])
    assert result.status == 0, str(result)


MUMPS = """mesh: {cells: [8, 8], lower: [0, 0], upper: [1, 1]}
flow: {density: 1, viscosity: 0.1, gravity: [0, -10], solver: direct, mat_mumps_icntl_14: 0}
particle: {groups: disc, disc: {shape: circle, radius: 0.15, density: 2, position: [0.5, 0.6]}}
sim: {dt: 0.01, steps: 2}
"""


def test_direct_solver_takes_more_space(run, scene):
    """Without spare work space MUMPS fails (INFOG(1) = -9): it gets more, once for all steps, and the run says so."""
    result = run([scene(MUMPS), "-output_dir", "out"])
    assert result.status == 0 and result.out.count("-flow_mat_mumps_icntl_14 0: goes on with 100") == 1, str(result)


@pytest.mark.parametrize(
    "options, remark",
    [
        (["-mesh_cells", "6,18", "-sim_steps", 1], "body 0 (group 'disc') is 0.75 of the smallest cells long"),
        (["-mesh_cells", "16,48", "-sim_steps", 1], None),
        (["-couple_method", "aligned", "-mesh_cells", "32,96", "-sim_dt", 0.02, "-sim_steps", 6], "goes 0.7 of the smallest cells in the step to t = 0.04"),
        (["-couple_method", "nodal", "-mesh_cells", "32,96", "-sim_dt", 0.02, "-sim_steps", 6], None),
    ],
)
def test_remarks(run, options, remark):
    """What the mesh or the step cannot hold is said once, by all ranks together, and the run goes on."""
    result = run([ROOT / "runs" / "sedimentation.yaml", "-particle_disc_radius", 0.125, "-output_every", 0, "-output_dir", "out", *options], 2)
    assert result.status == 0, str(result)
    others = result.out.replace("remark: preset balanced, the default", "")
    assert others.count("remark:") == (remark is not None) and (remark or "") in others, str(result)
    assert ("cannot keep its 1 % here" in result.out) == ("aligned" not in options), str(result)


def test_steady_cavity_in_space(run, scene):
    """The direct solver, which small scenes get, with a flow whose products have no matrix: Newton's method is quadratic"""
    text = """\
mesh: {cells: [4, 4, 4]}
flow: {density: 1, viscosity: 0.02, bc: {top: {type: moving_wall, velocity: [1, 0, 0]}}}
sim: {steady: true}
"""
    result = run([scene(text), "-output_dir", "out"])
    assert result.status == 0, str(result)
    norms = [float(line.split()[3]) for line in result.text.splitlines() if re.match(r"  steady +\d+ ", line)]
    assert len(norms) <= 8 and norms[-1] < 1e-10 * norms[0], norms
