"""-device: the kernels of a GPU give the numbers of the processor's own in no more iterations, over ten steps. Here on the processor, by emulation;
make check-gpu runs the same list on a GPU (TUMBLE_DEVICE=cuda)."""
import csv
import json
import os
import re
import subprocess

import pytest

from collector import ROOT, build_folder

DEVICE = os.environ.get("TUMBLE_DEVICE", "emulate")
STEPS = 10
CAVITY = [ROOT / "runs" / "bench" / "cavity-3d.yaml", "-mesh_cells", "6,6,6", "-sim_steps", STEPS, "-output_every", 0, "-output_dir", "out",
          "-output_overwrite"]
VELOCITY = ["-flow_velocity_smoother", "jacobi", "-flow_fieldsplit_velocity_ksp_type", "bcgs"]  # what a device takes
WHOLE = ["-preset", "balanced", "-flow_ksp_rtol", "1e-12", "-flow_velocity_tol", 0]
FGMRES = ["-flow_ksp_type", "fgmres"]
# options of both, options of the processor, how far numbers may be apart: the pressure's smoother is another one
CASES = {
    "box": (WHOLE, FGMRES, 1e-10),
    "odd cells, cn, skew": ([*WHOLE, "-mesh_cells", "7,5,6", "-flow_time", "cn", "-flow_convection_form", "skew"], FGMRES, 1e-10),
    "periodic, driven by a force": ([*WHOLE, "-mesh_periodic", "x", "-flow_force", "1,0,0.2", "-flow_time", "be"], FGMRES, 1e-10),
    "refined": ([*WHOLE, "-mesh_levels", 1, "-mesh_refine", "a", "-mesh_box_a_corners", "0,0,0,0.4,0.4,0.4"], FGMRES, 1e-10),
    "refined twice": ([*WHOLE, "-mesh_cells", "4,4,4", "-mesh_levels", 2, "-mesh_refine", "a", "-mesh_box_a_corners", "0.4,0.4,0.4,0.6,0.6,0.6"],
                      FGMRES, 1e-10),
    "pressure and outflow": ([*WHOLE, "-flow_bc_left_type", "pressure", "-flow_bc_left_pressure", "0.2*(1+y*t)",
                              "-flow_bc_right_type", "outflow"], FGMRES, 1e-10),
    "fstheta": ([*WHOLE, "-mesh_cells", "4,4,4", "-flow_time", "fstheta", "-mesh_periodic", "x"], FGMRES, 1e-10),
    "balanced": (["-preset", "balanced"], FGMRES, 2e-5),
    "fast": (["-preset", "fast"], [], 2e-3),  # half of what its single iteration leaves on the processor
}


def series(result):
    assert result.status == 0, str(result)
    with open(result.folder / "out" / "series.csv") as file:
        return list(csv.DictReader(file))


def bodies(result):
    with open(result.folder / "out" / "bodies.csv") as file:
        return list(csv.DictReader(file))


def apart(a, b, names):
    """Largest difference of columns, of the largest number in them"""
    values = [(float(x[n]), float(y[n])) for x, y in zip(a, b, strict=True) for n in names]
    return max(abs(x - y) for x, y in values) / max(abs(y) for _, y in values)


def assert_iterations(there, here, more):
    """In every step at most `more` iterations more than on the processor, whose smoother of the pressure is another one"""
    its = [[int(row["outer_iterations"]) for row in rows] for rows in (there, here)]
    assert all(a <= b + more for a, b in zip(*its, strict=True)), its


def forces(row):
    """Of walls, without the constant of the pressure of a closed box, which is that of a solver's preconditioner (src/device/README.md): along an axis only
    that of both sides together"""
    normal = {"left": "x", "right": "x", "bottom": "y", "top": "y", "back": "z", "front": "z"}
    out = dict.fromkeys("xyz", 0.0)
    for name, value in row.items():
        if name.startswith("wall_force_"):
            _, _, wall, axis = name.split("_")
            key = axis if normal[wall] == axis else name
            out[key] = out.get(key, 0.0) + float(value)
    return out


@pytest.mark.parametrize("case", CASES)
def test_same_numbers(run, case):
    options, taken, bound = CASES[case]
    there, here = series(run([*CAVITY, *options, "-device", DEVICE])), series(run([*CAVITY, *options, *VELOCITY, *taken]))
    assert len(there) == len(here) >= STEPS
    assert_iterations(there, here, 2 if case == "fstheta" else 0)  # three solves of 11 and more a step
    assert apart(there, here, ["kinetic_energy"]) <= bound
    assert apart(there, here, ["cfl"]) <= 10 * bound
    if bound == 1e-10:
        walls = [[forces(row) for row in rows] for rows in (there, here)]
        assert apart(*walls, walls[0][0]) <= bound
        assert max(float(a["momentum_error"]) for a in there) < 1e-7
    assert float(there[-1]["kinetic_energy"]) > 1e-3


BODIES = """
mesh: {cells: [8, 8, 10], lower: [0, 0, 0], upper: [2, 2, 2.5]}
flow: {density: 1, viscosity: 0.05, gravity: [0, 0, -10], velocity_operator: matrix_free, solver: balanced}
particle:
  groups: low, high, light, held
  low: {shape: circle, radius: 0.3, density: 1.5, position: [0.5, 0.5, 0.34]}
  high: {shape: circle, radius: 0.3, density: 2.5, position: [0.55, 0.56, 0.96]}
  light: {shape: ellipse, a: 0.35, b: 0.25, c: 0.3, density: 0.5, position: [1.4, 1.45, 1.2]}
  held: {shape: circle, radius: 0.35, position: [1.5, 0.5, 1.5], free: none}
couple: {method: penalty}
contact: {range: 0.1}
sim: {dt: 0.01}
"""
TIGHT = ["-flow_ksp_rtol", "1e-12", "-flow_velocity_tol", 0]
# options, steps, how far numbers of bodies may be apart, of the largest
BODY_CASES = {
    "contact with a floor and each other, one held": (TIGHT, STEPS, 1e-10),
    "rigid nodes in a staircase, periodic": ([*TIGHT, "-couple_method", "nodal", "-mesh_periodic", "x,y"], 5, 1e-10),
    "refined": ([*TIGHT, "-mesh_cells", "4,4,5", "-mesh_levels", 1, "-mesh_refine", "a", "-mesh_box_a_corners", "0,0,0,1,1,1.3"], 5, 1e-10),
    "balanced": ([], STEPS, 2e-3),
    "fast": (["-flow_solver", "fast"], STEPS, 5e-3),
    "accurate": (["-flow_solver", "accurate"], 5, 1e-6),
}


@pytest.mark.parametrize("case", BODY_CASES)
def test_same_bodies(run, tmp_path, case):
    """Bodies under a penalty or as rigid nodes, with ties of contact: the processor's numbers."""
    options, steps, bound = BODY_CASES[case]
    scene = tmp_path / "bodies.yaml"
    scene.write_text(BODIES)
    common = [scene, "-sim_steps", steps, "-output_every", 0, "-output_dir", "out", "-output_overwrite", *options]
    there = run([*common, "-device", DEVICE])
    flow, motion = series(there), bodies(there)
    here = run([*common, *VELOCITY, *FGMRES])
    assert len(flow) == steps
    assert_iterations(flow, series(here), 1)
    assert apart(flow, series(here), ["kinetic_energy"]) <= bound
    for columns in ("uvw", ["omega_x", "omega_y", "omega_z"], ["force_x", "force_y", "force_z"]):
        assert apart(motion, bodies(here), columns) <= 10 * bound
    assert max(float(a["momentum_error"]) for a in flow) < 1e-7
    assert max(abs(float(m["w"])) for m in motion) > 0.05


# a ball that leaves its fine cells behind: the mesh is made anew in every second step
FOLLOWED = """
mesh: {upper: [1.5, 1.5, 2.5], cells: [3, 3, 5], levels: 2, refine_distance: 1.5, track: true, track_distance: 0.3}
flow: {density: 1, viscosity: 0.1, gravity: [0, 0, -981], solver: balanced}
particle:
  groups: ball
  ball: {shape: circle, radius: 0.2, density: 1.5, position: [0.75, 0.75, 1.7], velocity: [0, 0, -4]}
sim: {dt: 0.004, steps: 10}
output: {every: 0}
"""


@pytest.mark.parametrize("method", ["penalty", "nodal"])
def test_mesh_follows(run, tmp_path, method):
    """What lies on a device is made anew for the cells of another mesh: the processor's numbers over five of them. What goes over for a mesh is the fields
    once back, and there they, what stands on cells, and its rows of the pressure (bounds set
    after 15 and 399 bytes an unknown were seen); what was kept of the old one is freed."""
    scene = tmp_path / "followed.yaml"
    scene.write_text(FOLLOWED)
    common = [scene, *TIGHT, "-couple_method", method, "-output_dir", "out", "-output_overwrite"]
    there = run([*common, "-device", DEVICE, "-info"])
    flow, motion = series(there), bodies(there)
    about = json.loads((there.folder / "out" / "summary.json").read_text())
    here = run([*common, *VELOCITY, *FGMRES])
    assert json.loads((here.folder / "out" / "summary.json").read_text())["quantities"]["mesh_changes"] == about["quantities"]["mesh_changes"] >= 5
    assert_iterations(flow, series(here), 1)
    assert apart(flow, series(here), ["kinetic_energy"]) <= 1e-10
    assert apart(motion, bodies(here), "uvw") <= 1e-10
    assert apart(motion, bodies(here), ["force_x", "force_y", "force_z"]) <= 1e-10
    steps = [[int(n) for n in step] for step in re.findall(r"device: (\d+) bytes there, (\d+) back in this step; at most (\d+)", there.out)][1:]
    up, down, held = zip(*steps)
    assert len(steps) == 9
    if DEVICE == "emulate":  # which alone counts what is held
        assert max(down) < min(down) + 20 * about["unknowns"] and max(up) < min(up) + 500 * about["unknowns"], steps
        assert held[-1] < 1.2 * held[0], steps


@pytest.mark.parametrize("ranks", [2, 3])
@pytest.mark.parametrize("bodied", [False, True])
def test_ranks(run, tmp_path, ranks, bodied):
    """A device a rank: the numbers of one rank, with cells in which nodes hang, and with bodies that ranks share."""
    scene = tmp_path / "bodies.yaml"
    scene.write_text(BODIES)
    refined = ["-mesh_levels", 1, "-mesh_refine", "a", "-mesh_box_a_corners", "0,0,0,0.4,0.4,0.4", "-mesh_cells", "4,4,4"]
    case = [*CAVITY, *WHOLE, *refined]
    if bodied:
        case = [scene, "-mesh_cells", "6,6,8", *TIGHT, "-output_every", 0, "-output_dir", "out", "-output_overwrite"]
    flow, motion = [], []
    for n in (1, ranks):
        result = run([*case, "-sim_steps", 3, "-device", DEVICE], ranks=n, timeout=300)
        flow.append(series(result))
        motion.append(bodies(result) if bodied else [])
    assert_iterations(flow[1], flow[0], 3)  # the vertices' level of the pressure is another one
    assert apart(*flow, ["kinetic_energy"]) <= 1e-10
    if bodied:
        assert apart(*motion, "uvw") <= 1e-10
        assert apart(*motion, ["force_x", "force_y", "force_z"]) <= 1e-9


@pytest.mark.parametrize("ranks", [2, 3])
def test_mesh_follows_on_ranks(run, tmp_path, ranks):
    """The same over changes of the mesh: bodies and cells that come to other ranks are there on their devices."""
    scene = tmp_path / "followed.yaml"
    scene.write_text(FOLLOWED)
    results = [run([scene, *TIGHT, "-sim_steps", 4, "-device", DEVICE, "-output_dir", "out", "-output_overwrite"], ranks=n, timeout=300) for n in (1, ranks)]
    flow, motion = [series(result) for result in results], [bodies(result) for result in results]
    changes = [json.loads((result.folder / "out" / "summary.json").read_text())["quantities"]["mesh_changes"] for result in results]
    assert changes[0] == changes[1] >= 2
    assert_iterations(flow[1], flow[0], 3)
    assert apart(*flow, ["kinetic_energy"]) <= 1e-10
    assert apart(*motion, "uvw") <= 1e-10
    assert apart(*motion, ["force_x", "force_y", "force_z"]) <= 1e-9


@pytest.mark.skipif(DEVICE != "emulate", reason="counts what the emulation's memory is given")
@pytest.mark.parametrize("convection", ["true", "false"])
def test_no_field_crosses(run, monkeypatch, convection):
    """Surfaces alone: what goes there and back in a step grows as they do, and the host looks into no vector."""
    moved = []
    monkeypatch.setenv("LD_PRELOAD", str(build_folder() / "tests" / "runs" / "faults" / "hostarrays.so"))
    for n in (6, 12):
        result = run([*CAVITY, "-mesh_cells", f"{n},{n},{n}", "-flow_convection", convection, "-sim_steps", 4, "-device", DEVICE, "-info"])
        assert result.status == 0, str(result)
        steps = [int(a) + int(b) for a, b in re.findall(r"device: (\d+) bytes there, (\d+) back", result.out)]
        assert len(steps) == 4 and steps[2] == steps[3] < steps[0], steps
        moved.append(steps[3])
        asked = re.findall(r"host array: (\S+) (\d+)", result.err)
        assert sum(int(calls) for _, calls in asked) < 12, asked  # at set-up
    assert moved[1] < 4.5 * moved[0]


@pytest.mark.skipif(DEVICE != "emulate", reason="counts what the emulation's memory is given")
def test_no_field_crosses_with_bodies(run, tmp_path, monkeypatch):
    """The same bodies in a box and in one of eight times the volume: what goes over in a step grows less than surfaces do, which grow fourfold (1.7 and
    5.0 MB; with rows of the pressure, which are made there, 4.5 and 6.8), and the host looks into vectors at set-up and into rows of bodies alone."""
    moved = []
    scene = tmp_path / "bodies.yaml"
    scene.write_text(BODIES)
    monkeypatch.setenv("LD_PRELOAD", str(build_folder() / "tests" / "runs" / "faults" / "hostarrays.so"))
    for m in (1, 2):
        result = run([scene, "-mesh_cells", f"{8 * m},{8 * m},{10 * m}", "-mesh_upper", f"{2 * m},{2 * m},{2.5 * m}", "-sim_steps", 3,
                      "-output_every", 0, "-output_dir", "out", "-output_overwrite", "-device", DEVICE, "-info"], timeout=300)
        assert result.status == 0, str(result)
        moved.append([int(a) + int(b) for a, b in re.findall(r"device: (\d+) bytes there, (\d+) back", result.out)][-1])
        asked = {name: int(size) for name, size in re.findall(r"host array: (\S+) \d+ (\d+)", result.err)}
        asked.pop("DeviceLevelsCreate", None)  # vertices of the pressure, when their matrix has changed
        assert sum(asked.values()) < 3 * 640 * m**3 * 4 * 8, asked  # three pressures, at set-up; a velocity has six times as many numbers as one
    assert moved[0] < 2e6 and moved[1] < 4 * moved[0], moved


def test_kernel_table(run):
    """-device_table: each kernel with its calls, what it moves and its time; what goes over the bus is what -info says."""
    result = run([*CAVITY, "-mesh_cells", "4,4,4", "-sim_steps", 2, "-device", DEVICE, "-device_table", "-info"])
    assert result.status == 0, str(result)
    rows = {name: (int(calls), float(mb), float(s)) for name, calls, mb, s in re.findall(r"\| (\w+) \| (\d+) \| ([\d.]+) \| ([\d.]+) \|", result.out)}
    calls, mb, seconds = rows["multiply"]
    nodes = 9**3
    assert {"smooth_rows", "combine", "dot", "add_gradient", "upload", "download"} <= set(rows) and seconds > 0
    assert mb * 1e6 / calls > 72 * nodes + 8 * 27 * 3 * 64  # two vectors there, one back; convection at points
    steps = [int(a) + int(b) for a, b in re.findall(r"device: (\d+) bytes there, (\d+) back", result.out)]
    assert (rows["upload"][1] + rows["download"][1]) * 1e6 == pytest.approx(sum(steps), rel=0.02)
    moved = [mb for _, mb, _ in rows.values()]
    assert moved == sorted(moved, reverse=True)


@pytest.mark.skipif(DEVICE != "emulate", reason="a GPU has the script itself")
def test_bench_script():
    """runs/bench/gpu.sh from its beginning to its end, small: every row has its numbers."""
    small = {"DEVICE": DEVICE, "SIZES": "4", "SPHERES": "13", "RANKS": "1", "STEPS": "3", "LIMIT": "250"}
    result = subprocess.run([ROOT / "runs" / "bench" / "gpu.sh", build_folder()], env={**os.environ, **small}, capture_output=True, text=True, timeout=300)
    runs, _, kernels = result.stdout.partition("| kernel")
    rows = [line.strip("| ").split(" | ") for line in runs.splitlines() if line.startswith("| ")][2:]
    assert result.returncode == 0 and len(rows) == 6, result.stdout + result.stderr
    assert all(float(row[1]) > 0 and float(row[4]) > 0 for row in rows), rows
    assert "| multiply |" in kernels


def test_goes_on(run):
    """A checkpoint has what is on the device."""
    whole = series(run([*CAVITY, *WHOLE, "-mesh_cells", "4,4,4", "-device", DEVICE]))
    run([*CAVITY, *WHOLE, "-mesh_cells", "4,4,4", "-device", DEVICE, "-sim_steps", 5, "-checkpoint_every", 5])
    after = series(run([*CAVITY, *WHOLE, "-mesh_cells", "4,4,4", "-device", DEVICE, "-sim_restart", "latest"]))
    assert float(after[-1]["kinetic_energy"]) == pytest.approx(float(whole[-1]["kinetic_energy"]), rel=1e-10)


@pytest.mark.parametrize("scene, said", [(["cylinder-2d1.yaml"], "in space"), (["bench/sphere.yaml", "-couple_method", "aligned"], "lines up with")])
def test_refused(run, scene, said):
    result = run([ROOT / "runs" / scene[0], *scene[1:], "-device", DEVICE, "-output_dir", "out"])
    assert result.status != 0 and "-device" in result.err and said in result.err, str(result)
