"""The force that a scene asks for: mean velocities held by -flow_rate, back-flow of bodies that fall in periodic boxes (-couple_backflow)."""
import csv
import math
from pathlib import Path

import pytest

RUNS = Path(__file__).resolve().parent.parent.parent / "runs"
POST = "  post: {shape: circle, radius: 0.125, position: [0.5, 0.4], free: none}\n"
FALL = """\
mesh: {cells: [16, 32], lower: [0, 0], upper: [1, 2], periodic: [x, y]}
flow: {density: 1, viscosity: 0.05, gravity: [0, -100]}
particle:
  groups: [disc, ellipse, post]
  disc: {shape: circle, radius: 0.125, density: 1.5, position: [0.4, 1.4]}
  ellipse: {shape: ellipse, a: 0.2, b: 0.12, angle: 0.5, density: 0.8, position: [0.6, 1]}
""" + POST + """\
sim: {dt: 0.005, steps: 4}
"""
ALONE = FALL.replace(", post]", "]").replace(POST, "")
CHANNEL = """\
mesh: {cells: [32, 16], lower: [0, 0], upper: [2, 1]}
flow: {density: 1, viscosity: 0.05, rate: [0.7, 0], bc: {left: {type: outflow}, right: {type: outflow}}}
particle:
  groups: disc
  disc: {shape: circle, radius: 0.125, density: 1.2, position: [0.5, 0.4]}
sim: {dt: 0.02, steps: 3}
"""
CUBE = """\
mesh: {dimension: 3, cells: [6, 6, 6], lower: [0, 0, 0], upper: [1, 1, 1], periodic: [x, y, z]}
flow: {density: 1, viscosity: 0.05, gravity: [0, 0, -10]}
particle: {groups: ball, ball: {shape: circle, radius: 0.25, density: 2, position: [0.5, 0.5, 0.5]}}
sim: {dt: 0.02, steps: 2}
"""


def table(result, name="series.csv"):
    assert result.status == 0, str(result)
    with open(result.folder / "out" / name) as file:
        return [{k: float(v) for k, v in row.items() if k != "group"} for row in csv.DictReader(file)]


def test_square_array(run):
    """Drag of the force column, of the cylinder's own table, and Sangani & Acrivos (1982), who give four digits."""
    result = run([RUNS / "cylinder-array.yaml", "-output_dir", "out"])
    rows, drag = table(result), table(result, "bodies.csv")[-1]["force_x"]
    assert max(abs(row["mean_velocity_x"] - 1) + abs(row["mean_velocity_y"]) for row in rows) < 1e-10
    assert abs(rows[-1]["flow_force_x"] / 51.53 - 1) < 2e-4, rows[-1]["flow_force_x"]
    assert abs(rows[-1]["flow_force_x"] / drag - 1) < 1e-6, f"force {rows[-1]['flow_force_x']:g}, drag {drag:g}"
    assert max(row["momentum_error"] for row in rows) < 1e-5


HELD = {
    "bodies": (FALL, ["-flow_rate", "0.3,1"], (0.3, 1), 2),
    "bodies, aligned": (FALL, ["-flow_rate", "0.3,1", "-couple_method", "aligned"], (0.3, 1), 1),
    "bodies, fast": (FALL, ["-flow_rate", "0.3,1", "-flow_solver", "fast"], (0.3, 1), 1),
    "one axis": (FALL, ["-flow_rate", "0,0.5", "-flow_rate_axes", "y", "-flow_time", "cn", "-sim_adapt", "-flow_rtol_max", 1e-6], (None, 0.5), 1),
    "open ends": (CHANNEL, [], (0.7, None), 1),
    "space": (CUBE, ["-flow_rate", "0.5,0,0"], (0.5, 0, 0), 2),
}


@pytest.mark.parametrize("case", HELD)
def test_rate_is_held(run, scene, case):
    text, options, rate, ranks = HELD[case]
    rows = table(run([text if isinstance(text, Path) else scene(text), "-output_dir", "out", *options], ranks))
    for axis, wanted in zip("xyz", rate):
        off = [abs(row["mean_velocity_" + axis] - wanted) for row in rows if wanted is not None]
        assert max(off, default=0) < 1e-10, f"along {axis}: {off}"
    assert max(row["momentum_error"] for row in rows) < (0.3 if "fast" in case else 1e-4)


BACKFLOW = {
    "flux": (FALL, ["flux"], 1e-10),
    "flux, bodies alone": (ALONE, ["flux", "-couple_method", "aligned"], 1e-10),
    "force": (FALL, ["force", "-couple_method", "aligned"], 1e-5),
    "force, bodies alone": (ALONE, ["force"], 1e-5),
    "space": (CUBE, ["flux"], 1e-10),
}


@pytest.mark.parametrize("case", BACKFLOW)
def test_backflow(run, scene, case):
    """The condition holds by itself, and beside a post that takes what it leaves to it."""
    text, options, bound = BACKFLOW[case]
    result = run([scene(text), "-output_dir", "out", "-couple_backflow", *options])
    rows = table(result)
    assert "remark: back-flow: zero " in result.text
    assert max(row["backflow_error"] for row in rows) < bound, [row["backflow_error"] for row in rows]
    if options[0] == "force":
        weight = 100 * math.pi * (0.5 * 0.125**2 - 0.2 * 0.2 * 0.12)
        off = 1e-4 if "aligned" in options else 1e-12  # there the volume is that of curved cells and of bodies between them
        assert all(abs(row["flow_force_y"] * 2 / weight - 1) < off for row in rows), rows[-1]["flow_force_y"] * 2 / weight - 1
    else:
        axis = "y" if text != CUBE else "z"
        assert max(abs(row["mean_velocity_" + axis]) for row in rows) < 1e-12 and rows[-1]["flow_force_" + axis] > 0


def test_open_box_says_so(run, scene):
    """Nothing chosen, nothing holds: the box is accelerated, with a remark that names the choice."""
    result = run([scene(ALONE), "-output_dir", "out"])
    assert table(result)[-1]["mean_velocity_y"] < -0.001
    assert "-couple_backflow flux or force" in result.text


BAD = {
    "inflow": (CHANNEL, ["-flow_bc_left_type", "inflow", "-flow_bc_left_velocity", "1,0"], "no force changes it"),
    "walls": (CHANNEL, ["-flow_rate", "1,1"], "the mean velocity along y is that of the boundaries"),
    "axis": (FALL, ["-flow_rate", "1,0", "-flow_rate_axes", "z"], "'z' is no axis of this scene"),
    "left out": (FALL, ["-flow_rate", "1,1", "-flow_rate_axes", "x"], "which -flow_rate_axes does not name"),
    "force": (FALL, ["-flow_rate", "1,0", "-flow_force", "1,0"], "both act along x"),
    "steady": (RUNS / "cylinder-array.yaml", ["-sim_steady", "-sim_dt"], "run in time without -sim_steady"),
    "both": (FALL, ["-flow_rate", "0,0", "-couple_backflow", "force"], "remove one of the two"),
    "no axis": (FALL, ["-mesh_periodic", "x", "-couple_backflow", "flux"], "gravity acts along no periodic axis"),
    "a step late": (FALL, ["-couple_backflow", "force", "-couple_type", "explicit"], "use -couple_type implicit, or -couple_backflow flux"),
}


@pytest.mark.parametrize("fault", BAD)
def test_refused(run, scene, fault):
    text, options, message = BAD[fault]
    result = run([text if isinstance(text, Path) else scene(text), "-output_dir", "out", *options])
    assert result.status == 1 and result.text.count("tumble: error:") == 1 and message in result.text, str(result)
