"""Restarts that do not repeat what was: on other ranks where regions are refined, with other bodies and options, from an earlier step.

Where a body is at the restart it stays; what is prescribed from then on has an exact path from there.
"""
import csv
import re
import sys

import h5py
import numpy
import pytest

from conftest import ROOT

sys.path.insert(0, str(ROOT / "tools"))
import tumble  # noqa: E402

# three refined regions far apart, beside each other on the curve along which ranks divide the cells
APART = """\
mesh: {cells: [10, 10], lower: [-2, -2], upper: [2, 2], levels: 3, track: true, refine: [bodies, tip], box_tip_corners: [1.2, -1.8, 1.7, -1.4], box_tip_levels: 2}
flow: {density: 1, viscosity: 0.02, gravity: [0, -10]}
particle:
  groups: [a, b, c]
  a: {shape: circle, radius: 0.2, density: 3, position: [-1, 1]}
  b: {shape: ellipse, a: 0.25, b: 0.15, density: 1.5, position: [1.2, 1.0], angle: 0.4}
  c: {shape: box, size: [0.3, 0.3], density: 0.5, position: [-0.9, -1.2]}
sim: {dt: 0.01, steps: 4}
output: {every: 0}
"""
HELD = """\
mesh: {dimension: 3, cells: [4, 4, 4], lower: [-1, -1, -1], upper: [1, 1, 1], levels: 2}
flow: {density: 1, viscosity: 0.1, bc: {top: {type: moving_wall, velocity: [1, 0, 0]}}}
particle:
  groups: [a, b]
  a: {shape: circle, radius: 0.15, position: [-0.6, -0.5, 0.6], free: none}
  b: {shape: circle, radius: 0.15, position: [0.5, 0.55, -0.5], free: none}
sim: {dt: 0.05, steps: 4}
output: {every: 0}
"""
FALL = """\
mesh: {cells: [12, 24], lower: [0, 0], upper: [2, 4]}
flow: {density: 1, viscosity: 0.1, gravity: [0, -981]}
particle:
  groups: [a, b]
  a: {shape: circle, radius: 0.25, density: 1.25, position: [0.8, 3.2]}
  b: {shape: ellipse, a: 0.3, b: 0.15, density: 2, position: [1.3, 2.6], angle: 0.3}
sim: {dt: 0.005, steps: 10}
output: {every: 2}
"""
# in space, no flow: a body that tumbles
TUMBLE = """\
flow: {active: false}
mesh: {dimension: 3, cells: [2, 2, 2], lower: [0, 0, 0], upper: [4, 4, 4]}
particle:
  groups: b
  b: {shape: box, size: [0.5, 0.3, 0.2], density: 2, position: [1, 2, 2], velocity: [1, 0.2, 0.1], angular_velocity: [3, 1, 2]}
sim: {dt: 0.01, steps: 20}
output: {every: 0}
"""


def rows(folder, name):
    with open(folder / name) as file:
        return list(csv.DictReader(file))


def path_of(folder, body, columns=("x", "y", "angle")):
    return numpy.array([[float(row[name]) for name in columns] for row in rows(folder, "bodies.csv") if row["body"] == str(body)])


@pytest.fixture
def good(run):
    def start(args, ranks=1):
        result = run(args, ranks)
        assert result.status == 0, str(result)
        return result

    return start


# ---- refined regions ----


@pytest.mark.parametrize("text, ranks", [(APART, (1, 2)), (APART, (2, 5)), (HELD, (1, 4))], ids=["1-2", "2-5", "held"])
def test_other_ranks(good, scene, tmp_path, text, ranks):
    """The tree of a file is known to any ranks, and the run agrees with the one that was never interrupted."""
    args = [scene(text), "-flow_ksp_rtol", "1e-10", "-flow_velocity_tol", "0"]
    good([*args, "-output_dir", "whole"], ranks[0])
    good([*args, "-output_dir", "parts", "-checkpoint_every", "2", "-sim_steps", "2"], ranks[0])
    good([*args, "-output_dir", "parts", "-sim_restart", "latest"], ranks[1])
    for name in "series.csv", "bodies.csv":
        for a, b in zip(rows(tmp_path / "whole", name), rows(tmp_path / "parts", name), strict=True):
            for column in {"kinetic_energy", "x", "y", "angle", "u", "v", "force_x", "force_y"} & set(a):
                assert float(b[column]) == pytest.approx(float(a[column]), rel=2e-6, abs=2e-6), f"{column} of step {a['step']}"


# ---- other bodies ----

# options of b at the restart, and how far x, y, angle have come after a time t of its own; None: free
CHANGES = [
    ("-particle_b_free none", lambda t: (0, 0, 0)),
    ("-particle_b_free rotation", lambda t: (0, 0, None)),
    ("-particle_b_free y,rotation -particle_b_velocity 1,0", lambda t: (t, None, None)),
    ("-particle_b_motion constant,rotate -particle_b_velocity 1,0.3 -particle_b_angular_velocity 2", lambda t: (t, 0.3 * t, 2 * t)),
    (
        "-particle_b_motion oscillate -particle_b_motion_amplitude 0.1,0 -particle_b_motion_period 0.5,1 -particle_b_motion_phase 0.4,0",
        lambda t: (0.1 * (numpy.sin(4 * numpy.pi * t + 0.4) - numpy.sin(0.4)), 0, 0),
    ),
    ("-particle_b_velocity cos(30*t),0", lambda t: (numpy.sin(30 * t) / 30, 0, 0)),
]


def test_bodies_stay(good, scene, tmp_path):
    name = scene(FALL)
    good([name, "-output_dir", "first", "-checkpoint_every", "5", "-sim_steps", "5"])
    start = path_of(tmp_path / "first", 1)[-1]
    assert start[1] < 2.59  # it has fallen
    for i, (change, way) in enumerate(CHANGES):
        out = f"part{i}"
        result = good([name, "-output_dir", out, "-sim_restart", "first/checkpoint_5.h5", "-sim_steps", "8", *change.split()], 1 + i % 2)
        for k, place in enumerate(path_of(tmp_path / out, 1)):
            for at, begin, far in zip(place, start, way(0.005 * (k + 1))):
                if far is None:
                    assert abs(at - begin) < 0.1, f"{change}: {place} after {start}"
                else:
                    assert at == pytest.approx(begin + far, abs=1e-9), f"{change}: {place} after {start}"
        assert len(re.findall("^remark: what is prescribed of the bodies of group 'b' .* begins now, at t = 0.025, where they are", result.out, re.M)) == 1, str(result)
        for word in change.split()[::2]:
            assert len(re.findall(f"^remark: .* {word} .*was not given", result.out, re.M)) == 1, str(result)


def test_begun_motion_goes_on(good, scene, tmp_path):
    """What began at a restart is part of the checkpoints that follow: bit for bit."""
    change = "-particle_b_motion constant,rotate,oscillate -particle_b_velocity 1,0.3 -particle_b_angular_velocity 2 -particle_b_motion_amplitude 0.05,0.02 -particle_b_motion_period 0.5,0.3 -particle_b_motion_phase 0.3,1"
    name = scene(FALL)
    good([name, "-output_dir", "parts", "-checkpoint_every", "3", "-sim_steps", "3"], 2)
    good([name, "-output_dir", "whole", "-checkpoint_every", "3", "-sim_restart", "parts/checkpoint_3.h5", *change.split()], 2)
    for steps, told in ("6", 1), ("10", 0):
        result = good([name, "-output_dir", "parts", "-checkpoint_every", "3", "-sim_restart", "latest", "-sim_steps", steps, *change.split()], 2)
        assert result.out.count("what is prescribed") == told and result.out.count("other physics") == 6 * told, str(result)
    whole, parts = ([{k: v for k, v in row.items() if not k.startswith("seconds")} for row in rows(tmp_path / out, "bodies.csv")] for out in ("whole", "parts"))
    assert whole == parts[6:]


def test_tumbling_body_is_held(good, scene, tmp_path):
    """In space: orientation and place stay; about an axis it turns from where it is."""
    name = scene(TUMBLE)
    columns = ("x", "y", "z", "q0", "q1", "q2", "q3")
    good([name, "-output_dir", "first", "-checkpoint_every", "10", "-sim_steps", "10"])
    start = path_of(tmp_path / "first", 0, columns)[-1]
    for out, ranks, change in (("held", 2, ["-particle_b_free", "none", "-particle_b_velocity", "0,0,0", "-particle_b_angular_velocity", "0,0,0"]), ("turns", 1, ["-particle_b_motion", "rotate", "-particle_b_angular_velocity", "0,0,4"])):
        good([name, "-output_dir", out, "-sim_restart", "first/checkpoint_10.h5", *change], ranks)
        end = path_of(tmp_path / out, 0, columns)[-1]
        half = 0.5 * 4 * 0.1 if out == "turns" else 0
        a, b, c, d = start[3:]
        turned = numpy.array([a, b, c, d]) * numpy.cos(half) + numpy.array([-d, -c, b, a]) * numpy.sin(half)  # (cos, 0, 0, sin) times q
        assert end[:3] == pytest.approx(start[:3], abs=1e-9)
        assert min(numpy.abs(end[3:] - turned).max(), numpy.abs(end[3:] + turned).max()) < 1e-9, (end, turned)


def test_changes_are_remarked(good, run, scene):
    """One line an option, with the value that was and the one that is; how equations are solved is not physics."""
    name = scene(FALL)
    good([name, "-output_dir", "run", "-checkpoint_every", "5", "-sim_steps", "5", "-particle_b_force", "1,0"])
    result = good([name, "-output_dir", "other", "-sim_restart", "run/checkpoint_5.h5", "-sim_steps", "6", "-particle_b_density", "1.1", "-flow_gravity", "0,-500",
                   "-couple_method", "nodal", "-flow_ksp_rtol", "1e-7", "-sim_dt", "0.002"], 2)  # fmt: skip
    told = sorted(re.findall("^remark: the run goes on with other physics than its checkpoint: (.*)$", result.out, re.M))
    assert told == ["-couple_method nodal (was penalty)", "-flow_gravity 0,-500 (was 0,-981)", "-particle_b_density 1.1 (was 2)", "-particle_b_force not given: 0 (was 1,0)", "-sim_dt 0.002 (was 0.005)"], str(result)
    assert "  -flow_ksp_rtol 1e-7 (was" in result.out, str(result)
    result = run([name, "-output_dir", "stops", "-sim_restart", "run/checkpoint_5.h5", "-particle_b_pivot", "0,0", "-particle_b_stops", "-1,0.3"])
    assert result.status != 0 and "is at the angle 0.3" in result.err and "beyond -particle_b_stops -1" in result.err, str(result)


@pytest.mark.parametrize("first, then", [([], ["-couple_method", "aligned"]), (["-couple_method", "aligned"], []), ([], ["-sim_adapt", "true", "-sim_adapt_tolerance", "2e-3"]), ([], ["-preset", "fast"])])
def test_other_methods(good, scene, tmp_path, first, then):
    """Another boundary method, or steps of another length, begin with the state there is: the fall goes on as it was, within a few per cent."""
    name = scene(FALL)
    good([name, "-output_dir", "first", "-checkpoint_every", "5", "-sim_steps", "5", *first])
    good([name, "-output_dir", "same", "-sim_restart", "first/checkpoint_5.h5", "-sim_steps", "7", *first])
    good([name, "-output_dir", "other", "-sim_restart", "first/checkpoint_5.h5", "-sim_time", "0.035", *then], 2)
    same, other = (rows(tmp_path / out, "bodies.csv")[-1] for out in ("same", "other"))
    assert float(other["y"]) == pytest.approx(float(same["y"]), abs=2e-3)
    assert float(other["v"]) == pytest.approx(float(same["v"]), rel=0.03)


# ---- an earlier step ----


def test_lists_of_an_earlier_version(good, scene, tmp_path):
    """.xmf counts as the list of a run that goes on, and gives way to .xdmf; a new run in its place leaves none."""
    args = [scene(FALL), "-output_dir", "run"]
    good([*args, "-checkpoint_every", "4", "-sim_steps", "4"])
    kinds = "fields", "bodies", "centres"
    for again, listed in (["-sim_restart", "latest", "-sim_steps", "6"], ["2", "4", "6"]), (["-output_overwrite", "-sim_steps", "2"], ["2"]):
        for kind in kinds:
            (tmp_path / "run" / f"{kind}.xdmf").rename(tmp_path / "run" / f"{kind}.xmf")
        assert tumble.open(tmp_path / "run").steps[:2] == [2, 4]
        good([*args, *again])
        assert not list((tmp_path / "run").glob("*.xmf"))
        for kind in kinds:
            assert re.findall(r"step (\d+)", (tmp_path / "run" / f"{kind}.xdmf").read_text()) == listed


def test_rewind(good, scene, tmp_path):
    """From an earlier checkpoint: nothing of the later steps is left in tables, lists and snapshots, at once and at the end."""
    name = scene(FALL)
    args = [name, "-output_dir", "run", "-checkpoint_every", "4"]
    good([*args, "-sim_steps", "8"])

    def left():
        index = {kind: re.findall(r"step (\d+)", (tmp_path / "run" / f"{kind}.xdmf").read_text()) for kind in ("fields", "bodies", "centres")}
        files = {kind: sorted(int(path.stem.split("_")[1]) for path in (tmp_path / "run").glob(f"{kind}_*.h5")) for kind in ("fields", "bodies")}
        steps = {name: sorted({int(row["step"]) for row in rows(tmp_path / "run", f"{name}.csv")}) for name in ("series", "bodies")}
        return index, files, steps

    index, files, steps = left()
    assert index["fields"] == ["2", "4", "6", "8"] and files["bodies"] == [2, 4, 6, 8]
    result = good([*args, "-sim_restart", "run/checkpoint_4.h5", "-sim_steps", "5", "-flow_viscosity", "0.2"], 2)
    assert "Files of steps after 4, where the run goes on, are removed: 4" in result.out, str(result)
    index, files, steps = left()
    assert set(map(tuple, index.values())) == {("2", "4", "5")} or set(map(tuple, index.values())) == {("2", "4")}, index
    assert all(step <= 5 for kind in files.values() for step in kind) and steps == {"series": [1, 2, 3, 4, 5], "bodies": [1, 2, 3, 4, 5]}
    good([*args, "-sim_restart", "latest", "-sim_steps", "8", "-flow_viscosity", "0.2"], 2)
    for kind, listed in left()[0].items():
        assert listed[:2] == ["2", "4"] and listed[-1] == "8" and len(set(listed)) == len(listed), (kind, listed)
    for step in 2, 8:
        with h5py.File(tmp_path / "run" / f"fields_{step}.h5") as file:
            assert file["time"][0] == pytest.approx(0.005 * step)
    # elsewhere: what is listed is there
    good([name, "-output_dir", "elsewhere", "-sim_restart", "run/checkpoint_8.h5", "-sim_steps", "10", "-flow_viscosity", "0.2"])
    for kind in "fields", "bodies", "centres":
        assert re.findall(r"step (\d+)", (tmp_path / "elsewhere" / f"{kind}.xdmf").read_text()) == ["10"]
