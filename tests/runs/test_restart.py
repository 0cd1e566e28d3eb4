"""Checkpoints and restarts: a run that goes on from a checkpoint is the run that was never interrupted.

On the same number of ranks every number is the same to the last digit, in series.csv, bodies.csv and in the arrays of the checkpoints; on another
number within what the solvers leave. Runs that are killed lose the steps since the last checkpoint and nothing else. TUMBLE_KILLS=20 kills more often.
"""
import csv
import os
import random
import signal
import subprocess
import time
from pathlib import Path

import h5py
import numpy
import pytest

from conftest import edited, environment

DISC = """\
mesh: {cells: [16, 32], lower: [0, 0], upper: [1, 2]}
flow: {density: 1, viscosity: 0.1, gravity: [0, -981]}
particle:
  groups: disc
  disc: {shape: circle, radius: 0.125, density: 1.25, position: [0.45, 1.4]}
sim: {dt: 0.005, steps: 10}
"""
# discs that meet, a wall and a fixed body; ellipses turn
CROWD = """\
mesh: {cells: [16, 24], lower: [0, 0], upper: [1, 1.5]}
flow: {density: 1, viscosity: 0.1, gravity: [0, -981]}
particle:
  groups: [disc, ellipse, post]
  disc: {shape: circle, radius: 0.1, density: 2, place: lattice, count: 4, lower: [0.1, 0.7], upper: [0.9, 1.2]}
  ellipse: {shape: ellipse, a: 0.15, b: 0.1, density: 1.5, angle: 0.5, position: [0.5, 0.35]}
  post: {shape: circle, radius: 0.1, position: [0.2, 0.2], free: none}
sim: {dt: 0.004, steps: 10}
"""
# discs and ellipses of many sizes and densities, packed
MIXED = """\
mesh: {cells: [16, 24], lower: [0, 0], upper: [1, 1.5], periodic: x}
flow: {density: 1, viscosity: 0.1, gravity: [0, -981]}
particle:
  groups: [disc, ellipse]
  disc: {shape: circle, radius: 0.07, place: pack, count: 20, density: 2, sizes: lognormal, sizes_deviation: 0.2, densities: uniform, densities_range: [1.2, 3]}
  ellipse: {shape: ellipse, a: 0.1, b: 0.06, density: 1.5, place: pack, fraction: 0.15, orientation: random, sizes: bimodal, sizes_range: [0.7, 1.1], free: [x, y]}
sim: {dt: 0.002, steps: 10}
"""
BOX = "mesh: {cells: [12, 12]}\nflow: {viscosity: 0.01, bc: {top: {type: moving_wall, velocity: [1, 0], factor: [1, 0.5, 0.3]}}}\nsim: {dt: 0.05, steps: 10}\n"
FORMULAS = """\
mesh: {cells: [16, 16], periodic: x}
flow:
  viscosity: 0.02
  gravity: "0, -1*(1 + 0.5*sin(3*t))"
  force: "0.1*sin(2*pi*x)*cos(t), 0"
  velocity: "y*(1 - y), 0"
  bc: {top: {type: moving_wall, velocity: ["-0.1*sin(2*pi*x)*t", "0"]}}
particle:
  groups: [disc, rod, tip]
  disc: {shape: circle, radius: 0.1, density: 2, position: [0.5, 0.6], initial_velocity: fluid}
  tip: {shape: ellipse, a: 0.1, b: 0.06, position: [0.5, 0.85], motion_file: way.csv, motion_repeat: true}
  rod: {shape: ellipse, a: 0.15, b: 0.08, position: [0.5, 0.25], angular_velocity: "-2*cos(3*t)", velocity: "0.1*sin(5*t), 0"}
sim: {dt: 0.02, steps: 10}
"""
WAY = "t, x, omega\n0, 0, 1\n0.02, 0.01, -1\n0.05, 0.02, 0\n0.07, 0, 1\n"
# in space: a rod on a hinge falls on its stop, a ball slides
AXES = """\
mesh: {cells: [5, 5, 5], lower: [0, 0, 0], upper: [1, 1, 1]}
flow: {density: 1, viscosity: 0.1, gravity: [0, -10, 0]}
particle:
  groups: [rod, ball]
  rod: {shape: leaflet, length: 0.5, thickness: 0.25, density: 3, position: [0.2, 0.6, 0.5], pivot: [0, 0, 0], hinge: [0, 1, 2], angle: 0.2, stops: [0.16, 1]}
  ball: {shape: composite, parts: [a, b], a: {shape: circle, radius: 0.15}, b: {shape: box, size: [0.1, 0.1, 0.4]}, density: 2, position: [0.75, 0.7, 0.5],
         slide: [0, 1, 0.5], axis: [1, 1, 0], angle: 0.3}
sim: {dt: 0.02, steps: 10}
output: {every: 0}
"""
# two discs, cells around both; ranks have other cells after each change
LEVELS = """\
mesh: {cells: [6, 12], upper: [1, 2], levels: 2, track: true, track_distance: 1}
flow: {density: 1, viscosity: 0.1, gravity: [0, -981]}
particle:
  groups: [disc, light]
  disc: {shape: circle, radius: 0.125, density: 1.5, position: [0.45, 1.4], velocity: [0, -5]}
  light: {shape: ellipse, a: 0.15, b: 0.1, density: 0.8, angle: 0.5, position: [0.6, 0.5], velocity: [0, 4]}
sim: {dt: 0.004, steps: 10}
output: {every: 3}
"""
CASES = {
    "levels follow": (LEVELS, []),
    "levels follow, aligned": (LEVELS, ["-couple_method", "aligned", "-mesh_refine_distance", "4"]),
    "levels follow, adaptive": (LEVELS, ["-sim_adapt", "-sim_adapt_tolerance", "2e-3", "-couple_method", "nodal"]),
    "levels follow, driven": (edited("levels: 2,", "periodic: y, levels: 2,", LEVELS), ["-flow_rate", "0,1", "-sim_frame", "velocity", "-sim_frame_velocity", "0,2"]),
    "axes": (AXES, []),
    "formulas": (FORMULAS, []),
    "one disc": (DISC, []),
    "crowd": (CROWD, []),
    "mixed": (MIXED, []),
    "friction": (CROWD, ["-contact_law", "spring", "-contact_friction", "0.3"]),
    "explicit": (DISC, ["-couple_type", "explicit", "-particle_disc_density", "10", "-sim_dt", "0.004"]),
    "adaptive": (DISC, ["-sim_adapt", "-sim_adapt_tolerance", "2e-3", "-couple_method", "penalty", "-sim_steps", "14"]),
    "adaptive friction": (CROWD, ["-sim_adapt", "-sim_adapt_tolerance", "1e-3", "-contact_law", "spring", "-contact_friction", "0.3"]),
    "crank nicolson": (DISC, ["-flow_time", "cn"]),
    "fractional step": (DISC, ["-flow_time", "fstheta"]),
    "frame follows": (edited("upper: [1, 1.5]}", "upper: [1, 1.5], periodic: [y]}", CROWD), ["-sim_frame", "body", "-output_every", "4"]),
    "no bodies": (BOX, []),
    "flow rate": (edited("upper: [1, 2]}", "upper: [1, 2], periodic: [x, y]}", DISC), ["-flow_rate", "1,0.5"]),
    "three velocities": (BOX, ["-flow_extrapolation", "quadratic"]),
    "plate": (edited("shape: circle, radius: 0.125, density: 1.25", "shape: leaflet, length: 0.4, thickness: 0.03, origin: 0.5, density: 4, angle: 0.4", DISC), ["-couple_method", "aligned"]),
    "aligned": (CROWD, ["-couple_method", "aligned", "-output_every", "4"]),
    "mesh follows": (CROWD, ["-mesh_deform", "-mesh_deform_size", "0.6", "-couple_method", "penalty", "-output_every", "4"]),
    "mesh follows, adaptive": (DISC, ["-mesh_deform", "-sim_adapt", "-sim_adapt_tolerance", "2e-3"]),
}


def rows(folder, name):
    with open(folder / name) as file:
        return [{k: v for k, v in row.items() if not k.startswith("seconds")} for row in csv.DictReader(file)]


def assert_identical(one, other):
    """Tables to the last digit; arrays of the last checkpoints bit for bit."""
    for name in "series.csv", "bodies.csv":
        for a, b in zip(rows(one, name), rows(other, name), strict=True):
            assert a == b, f"{name} of {one} and {other}"
    last = max(one.glob("checkpoint_*.h5"), key=lambda path: int(path.stem.split("_")[1])).name
    with h5py.File(one / last) as a, h5py.File(other / last) as b:
        seen = 0
        for module in "bodies", "contact", "couple", "flow", "sim":
            assert set(a[module]) == set(b[module])
            for array in a[module]:
                assert numpy.array_equal(a[module][array], b[module][array]), f"{module}/{array} of {last}"
                seen += 1
        assert seen > 15


@pytest.fixture
def good(run):
    """good(args, ranks=1): a run that must succeed."""

    def start(args, ranks=1):
        result = run(args, ranks)
        assert result.status == 0, str(result)
        return result

    return start


# ---- the same run ----


@pytest.mark.parametrize("case, ranks", [("levels follow", 2), ("levels follow, aligned", 1), ("levels follow, adaptive", 1), ("levels follow, driven", 1), ("axes", 1), ("one disc", 2), ("crowd", 1), ("crowd", 2), ("aligned", 2), ("plate", 1), ("mesh follows", 2), ("mesh follows, adaptive", 1), ("friction", 1), ("explicit", 1), ("crank nicolson", 1), ("fractional step", 1), ("formulas", 1), ("adaptive", 2), ("adaptive friction", 1), ("no bodies", 2), ("frame follows", 1), ("flow rate", 1), ("three velocities", 2)])
def test_restart_is_identical(good, scene, tmp_path, case, ranks):
    text, args = CASES[case]
    name = scene(text)
    (tmp_path / "way.csv").write_text(WAY)
    args = [name, "-checkpoint_every", "4", *args]
    good([*args, "-output_dir", "whole"], ranks)
    good([*args, "-output_dir", "parts", "-sim_steps", "4"], ranks)
    result = good([*args, "-output_dir", "parts", "-sim_restart", "latest"], ranks)
    assert "Restarted from parts/checkpoint_4.h5" in result.out and "differ" not in result.out, str(result)
    assert_identical(tmp_path / "whole", tmp_path / "parts")


def test_other_number_of_ranks(good, scene, tmp_path):
    name = scene(CROWD)
    args = [name, "-flow_ksp_rtol", "1e-10"]
    good([*args, "-output_dir", "whole", "-sim_steps", "12"], 2)
    for steps, ranks in (4, 2), (8, 1), (12, 2):
        more = ["-sim_restart", "latest"] if steps > 4 else []
        good([*args, "-output_dir", "parts", "-checkpoint_every", "4", "-output_every", "4", "-sim_steps", steps, *more], ranks)
    for name in "series.csv", "bodies.csv":
        for a, b in zip(rows(tmp_path / "whole", name), rows(tmp_path / "parts", name), strict=True):
            for column in {"kinetic_energy", "x", "y", "angle", "u", "v", "omega_z"} & set(a):
                assert float(b[column]) == pytest.approx(float(a[column]), rel=1e-6, abs=1e-6), f"{column} of step {a['step']}"
    index = (tmp_path / "parts" / "fields.xdmf").read_text()
    for step, mesh in (4, "mesh.h5"), (8, "mesh_5.h5"), (12, "mesh_9.h5"):  # other ranks number the nodes in another way
        assert index.count(f"fields_{step}.h5:/velocity") == 1 and f"{mesh}:/coordinates" in index
        with h5py.File(tmp_path / "parts" / mesh) as grid, h5py.File(tmp_path / "parts" / f"fields_{step}.h5") as fields:
            wall = numpy.abs(grid["coordinates"][:, 1]) < 1e-12
            assert wall.sum() == 33 and numpy.abs(fields["velocity"][wall]).max() == 0


def test_elsewhere(good, scene, tmp_path):
    """Another output directory: a series of its own, from the step after the checkpoint."""
    name = scene(DISC)
    good([name, "-output_dir", "first", "-checkpoint_every", "4"])
    good([name, "-output_dir", "second", "-sim_restart", "first/checkpoint_8.h5"])
    assert rows(tmp_path / "second", "series.csv") == rows(tmp_path / "first", "series.csv")[8:]


def test_nothing_left_to_do(good, scene, tmp_path):
    """A restart beyond the end leaves tables without a line, which the corrected one begins anew."""
    name = scene(DISC)
    good([name, "-output_dir", "first", "-checkpoint_every", "10"])
    args = [name, "-output_dir", "second", "-sim_restart", "first/checkpoint_10.h5"]
    assert "Raise -sim_time or -sim_steps" in good([*args, "-sim_time", "0.02"], 2).out
    good([*args, "-sim_steps", "12"], 2)
    assert [int(row["step"]) for row in rows(tmp_path / "second", "series.csv")] == [11, 12]
    assert len(rows(tmp_path / "second", "bodies.csv")) == 2


def test_changed_extrapolation(good, scene, tmp_path):
    """A state of two velocities serves a run that wants three, and the other way round."""
    name = scene(BOX)
    for first, second in (("linear", "quadratic"), ("quadratic", "linear")):
        good([name, "-output_dir", first, "-flow_extrapolation", first, "-checkpoint_every", "4", "-sim_steps", "4"])
        good([name, "-output_dir", f"{first}-{second}", "-flow_extrapolation", second, "-sim_restart", f"{first}/checkpoint_4.h5"])
        assert len(rows(tmp_path / f"{first}-{second}", "series.csv")) == 6
    assert rows(tmp_path / "linear-quadratic", "series.csv")[-1]["kinetic_energy"] != rows(tmp_path / "quadratic-linear", "series.csv")[-1]["kinetic_energy"]


def test_branch(good, scene, tmp_path):
    """From an older checkpoint: later steps of the abandoned branch leave the tables, its checkpoints do not displace new ones."""
    name = scene(DISC)
    args = [name, "-output_dir", "run", "-checkpoint_every", "2"]
    good([*args, "-output_overwrite"])
    assert sorted(path.name for path in (tmp_path / "run").glob("checkpoint*")) == ["checkpoint_10.h5", "checkpoint_8.h5"]
    good([*args, "-sim_restart", "run/checkpoint_8.h5", "-sim_steps", "9", "-flow_viscosity", "0.2"])
    assert [int(row["step"]) for row in rows(tmp_path / "run", "series.csv")] == list(range(1, 10))
    result = good([*args, "-sim_restart", "latest"])
    assert "Restarted from run/checkpoint_9.h5" in result.out, str(result)
    assert "-flow_viscosity 0.1 (was 0.2)" in result.out, str(result)


STEADY = """\
mesh: {cells: [8, 8], lower: [-2.5, -2.5], upper: [2.5, 2.5]}
flow: {density: 1, viscosity: 1, bc: {top: {type: moving_wall, velocity: [1, 0]}}}
particle: {groups: inner, inner: {shape: circle, radius: 1, position: [0, 0], motion: rotate, angular_velocity: 1}}
sim: {steady: true}
"""


@pytest.mark.parametrize(
    "args, ranks, most",
    [
        ([], 1, 0),
        (["-flow_solver", "balanced"], 2, 0),
        # the viscosity of cut cells settles again, and as long as it does the residual cannot fall much further
        (["-flow_convection", "false", "-flow_rheology", "power_law", "-flow_rheology_index", "0.5", "-mesh_cells", "20,20", "-flow_solver", "direct"], 1, 8),
    ],
)
def test_steady_again(good, scene, tmp_path, args, ranks, most):
    """A steady solution solves its problem: nothing is left to reduce."""
    args = [scene(STEADY), "-checkpoint_every", "1", "-output_dir", "run", *args]
    good(args, ranks)
    for _ in range(2):
        good([*args, "-sim_restart", "latest"], ranks)
    first, *others = rows(tmp_path / "run", "bodies.csv")
    assert [int(row["outer_iterations"]) <= most for row in rows(tmp_path / "run", "series.csv")] == [False, True, True]
    for other in others:
        assert float(other["torque_z"]) == pytest.approx(float(first["torque_z"]), rel=1e-4)


# ---- refusals ----


def test_refusals(run, good, scene, tmp_path):
    name = scene(DISC)
    good([name, "-output_dir", "run", "-checkpoint_every", "5"])
    file = tmp_path / "run" / "checkpoint_10.h5"

    def refused(text, *args, ranks=1):
        result = run([name, "-output_dir", "other", "-sim_restart", "run/checkpoint_10.h5", *args], ranks)
        assert result.status != 0 and text in result.err, str(result)

    refused("another mesh", "-mesh_cells", "16,30")
    refused("groups of bodies 'disc'", "-particle_groups", "disc,two", "-particle_two_shape", "circle", "-particle_two_position", "0.5,0.5",
            "-particle_two_radius", "0.1", "-particle_two_free", "none")  # fmt: skip
    refused("another shape", "-particle_disc_radius", "0.12")
    refused("No such file", "-sim_restart", "run/checkpoint_3.h5")
    refused("no HDF5 file", "-sim_restart", name)
    refused("holds no whole checkpoint", "-sim_restart", "latest")
    with open(file, "r+b") as handle:
        handle.truncate(file.stat().st_size // 2)
    refused("truncated", ranks=2)
    # the newest is broken: the one before serves
    result = good([name, "-output_dir", "run", "-sim_restart", "latest"])
    assert "checkpoint_10.h5 is passed over: it is truncated" in result.out and "Restarted from run/checkpoint_5.h5" in result.out, str(result)
    # a fresh start does not mix with what is there
    os.remove(tmp_path / "run" / "series.csv")
    result = run([name, "-output_dir", "run"])
    assert result.status != 0 and "-sim_restart latest" in result.err, str(result)
    good([name, "-output_dir", "run", "-output_overwrite", "-sim_steps", "1"])
    assert not list((tmp_path / "run").glob("checkpoint*"))


def test_error_names_checkpoint(run, scene):
    result = run([scene(DISC), "-output_dir", "run", "-checkpoint_every", "1", "-couple_type", "explicit", "-particle_disc_density", "0.2"])
    assert result.status != 0 and "-couple_type implicit" in result.err, str(result)
    assert "The last checkpoint is run/checkpoint_" in result.err, str(result)


# ---- signals ----


class Live:
    """A run that goes on while the test looks at it."""

    def __init__(self, words, folder):
        self.process = subprocess.Popen(words, cwd=folder, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True)
        self.folder, self.words = Path(folder), words

    def steps(self):
        """Complete lines of series.csv."""
        path = self.folder / "run" / "series.csv"
        return path.read_text().count("\n") - 1 if path.exists() else 0

    def wait_for_steps(self, n):
        end = time.monotonic() + 60
        while self.steps() < n:
            assert time.monotonic() < end and self.process.poll() is None, self.finish()
            time.sleep(0.01)

    def ranks(self):
        """Process ids of the ranks, not of the launcher."""
        program = str(next(word for word in self.words if word.endswith("/tumble")))
        found = []
        for entry in Path("/proc").glob("[0-9]*"):
            try:
                words = (entry / "cmdline").read_bytes().split(b"\0")
                if words[0].decode() == program and os.getsid(int(entry.name)) in (self.process.pid, int(entry.name)) and (entry / "cwd").resolve() == self.folder:
                    found.append(int(entry.name))
            except OSError:  # ended meanwhile
                pass
        return found

    def finish(self):
        out, _ = self.process.communicate(timeout=60)
        return f"exit status {self.process.returncode}\n{out}"

    def kill(self):
        """Everything at once and for good."""
        for pid in [*self.ranks(), self.process.pid]:
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
        self.process.communicate(timeout=60)
        while self.ranks():
            time.sleep(0.01)


@pytest.fixture
def live(command, tmp_path):
    runs = []

    def start(args, ranks=1):
        runs.append(Live(command(args, ranks), tmp_path))
        return runs[-1]

    yield start
    for one in runs:
        if one.process.poll() is None:
            one.kill()


def test_sigusr1(live, good, scene, tmp_path):
    """Write and go on; the run itself is not disturbed beyond round-off."""
    name = scene(DISC)
    one = live([name, "-output_dir", "run", "-sim_steps", "60", "-sim_dt", "0.001"], 2)
    one.wait_for_steps(5)
    os.kill(one.ranks()[-1], signal.SIGUSR1)
    text = one.finish()
    assert one.process.returncode == 0 and one.steps() == 60, text
    (file,) = (tmp_path / "run").glob("checkpoint*")
    step = int(file.stem.split("_")[1])
    assert 5 <= step < 60
    whole = rows(tmp_path / "run", "series.csv")
    good([name, "-output_dir", "run", "-sim_steps", "60", "-sim_dt", "0.001", "-sim_restart", "latest"], 2)
    assert rows(tmp_path / "run", "series.csv") == whole


def test_sigterm(live, good, scene, tmp_path):
    """Write and stop in order, status 0; what follows is the rest of the run."""
    name = scene(DISC)
    args = [name, "-output_dir", "run", "-sim_steps", "60", "-sim_dt", "0.001", "-flow_ksp_rtol", "1e-10"]
    one = live(args, 2)
    one.wait_for_steps(5)
    os.kill(one.ranks()[-1], signal.SIGTERM)
    text = one.finish()
    done = one.steps()
    assert one.process.returncode == 0 and 5 <= done < 60, text
    assert f"Stopped by SIGTERM after step {done}" in text and f"run/checkpoint_{done}.h5" in text, text
    assert (tmp_path / "run" / "summary.json").exists()
    good([*args, "-sim_restart", "latest"], 2)
    good([name, "-output_dir", "whole", *args[3:]], 2)
    for a, b in zip(rows(tmp_path / "whole", "bodies.csv"), rows(tmp_path / "run", "bodies.csv"), strict=True):
        assert a["step"] == b["step"]
        for column in "x", "y", "u", "v":
            assert float(b[column]) == pytest.approx(float(a[column]), rel=1e-7, abs=1e-7)


def test_minutes(good, scene, tmp_path):
    good([scene(DISC), "-output_dir", "run", "-checkpoint_minutes", "1e-9"])
    assert sorted(path.name for path in (tmp_path / "run").glob("checkpoint*")) == ["checkpoint_10.h5", "checkpoint_9.h5"]


def test_kill(live, good, scene, tmp_path):
    """Killed again and again at random moments, in set-up, steps and writing, it arrives at the same end."""
    kills = int(os.environ.get("TUMBLE_KILLS", "3"))
    every, steps = 3, 40 if kills <= 3 else 20 * kills
    name = scene(DISC)
    args = [name, "-checkpoint_every", every, "-sim_steps", steps, "-sim_dt", "0.001"]
    start = time.monotonic()
    good([*args, "-output_dir", "whole"])
    length = time.monotonic() - start
    chance = random.Random(7)
    lost, alive = [], 0
    for _ in range(kills):
        files = list((tmp_path / "run").glob("checkpoint_*.h5"))
        one = live([*args, "-output_dir", "run", *(["-sim_restart", "latest"] if files else ["-output_overwrite"])])
        time.sleep(chance.uniform(0, 2.4 * length / kills))
        one.kill()
        alive += one.process.returncode == -signal.SIGKILL
        assert one.process.returncode in (-signal.SIGKILL, 0)
        saved = max([int(path.stem.split("_")[1]) for path in (tmp_path / "run").glob("checkpoint_*.h5")], default=0)
        lost.append(one.steps() - saved)
        assert lost[-1] <= every, f"{one.steps()} steps done, the last checkpoint is of step {saved}"
    print(f"{alive} of {kills} kills met a live run, steps lost: {lost}")
    assert alive >= kills // 2
    good([*args, "-output_dir", "run", *(["-sim_restart", "latest"] if saved else ["-output_overwrite"])])
    assert_identical(tmp_path / "whole", tmp_path / "run")
