"""The Python reader (tools/tumble): its values are those of the files, and a polynomial flow is sampled exactly."""
import csv
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

from conftest import ROOT, SCENE, edited

sys.path.insert(0, str(ROOT / "tools"))
import tumble  # noqa: E402

SPHERE = """\
mesh: {dimension: 3, cells: [3, 3, 6], lower: [0, 0, 0], upper: [1, 1, 2]}
flow: {density: 1, viscosity: 0.1, gravity: [0, 0, -981]}
particle: {groups: ball, ball: {shape: circle, radius: 0.3, density: 1.25, position: [0.48, 0.5, 1.3]}}
sim: {dt: 0.005, steps: 2}
output: {every: 1}
"""
# developed flow between plates, u = 4 y (1 - y), which the elements hold exactly; the mesh is graded and periodic
CHANNEL = """\
mesh: {cells: [6, 4], lower: [0, 0], upper: [3, 1], periodic: x}
flow: {density: 1, viscosity: 1, force: [8, 0], convection: false}
sim: {steady: true}
output: {every: 1}
"""


@pytest.fixture
def disc(run, scene, tmp_path):
    done = run([scene(edited("steps: 2}", "steps: 4}\noutput: {every: 2}")), "-couple_method", "nodal"])
    assert done.status == 0, done
    return tumble.open(tmp_path / "out" / "disc")


def test_tables(disc):
    with open(disc.directory / "bodies.csv") as file:
        rows = list(csv.DictReader(file))
    assert list(disc.bodies) == list(rows[0]) and len(disc.bodies) == len(rows) == 4
    assert disc.bodies["group"][0] == "disc"
    for name in ("time", "y", "v", "force_y"):
        assert disc.body(0)[name].tolist() == [float(row[name]) for row in rows]
    assert disc.series["step"].tolist() == [1, 2, 3, 4]
    assert disc.summary["quantities"]["fall_speed_max"] == pytest.approx(-min(disc.bodies["v"]), rel=1e-9)
    assert disc.options["sim_dt"] == "0.005"
    with pytest.raises(KeyError, match="no body 7"):
        disc.body(7)


def test_frame(disc):
    pandas = pytest.importorskip("pandas")
    frame = disc.series.frame()
    assert isinstance(frame, pandas.DataFrame) and frame["step"].tolist() == [1, 2, 3, 4]


def test_snapshots(disc):
    assert disc.steps == [2, 4] and disc.times.tolist() == pytest.approx([0.01, 0.02])
    assert disc.snapshot().step == 4 and disc.snapshot(time=0.0101).step == 2
    shot = disc.snapshot(step=4)
    assert shot.bodies["position"][0, 1] == pytest.approx(disc.body(0)["y"][-1], rel=1e-9)
    # inside the disc the fluid takes its velocity; nodes are points of the sampling, too
    assert np.allclose(shot.sample("velocity", shot.points[:40]), shot["velocity"][:40], atol=1e-12)
    inside = shot.points[shot["body"] == 0]
    assert len(inside) and np.allclose(shot.sample("velocity", inside)[:, 1], disc.body(0)["v"][-1], rtol=1e-6)
    assert np.isnan(shot.sample("velocity", [[5.0, 5.0]])).all()
    with pytest.raises(KeyError, match="no snapshot of step 3"):
        disc.snapshot(step=3)
    with pytest.raises(KeyError, match="there are: .*velocity"):
        shot["speed"]
    with pytest.raises(ValueError, match="belongs to cells"):
        shot.sample("pressure_mean", [[1, 1]])


def test_sampling_is_exact_for_parabolas(run, scene, tmp_path):
    done = run([scene(CHANNEL, "channel.yaml")])
    assert done.status == 0, done
    shot = tumble.open(tmp_path / "out" / "channel").snapshot()
    places = np.random.default_rng(1).uniform([0, 0], [3, 1], (200, 2))
    u = shot.sample("velocity", places)
    assert np.allclose(u[:, 0], 4 * places[:, 1] * (1 - places[:, 1]), atol=1e-9) and np.allclose(u[:, 1], 0, atol=1e-9)


def test_space(run, scene, tmp_path):
    done = run([scene(SPHERE, "ball.yaml")])
    assert done.status == 0, done
    shot = tumble.open(tmp_path / "out" / "ball").snapshot()
    assert shot.dim == 3 and shot.cells.shape[1] == 27
    assert np.allclose(shot.sample("velocity", shot.points[::7]), shot["velocity"][::7], atol=1e-12)
    assert np.allclose(shot.sample("pressure", shot.points[::11]), shot["pressure"][::11], rtol=1e-9)


def test_missing_results(tmp_path):
    with pytest.raises(FileNotFoundError, match="does not exist"):
        tumble.open(tmp_path / "none")
    with pytest.raises(FileNotFoundError, match="holds no results"):
        tumble.open(tmp_path)


def test_pip_installs_it(tmp_path):
    """From a copy, since pip builds beside the sources: the modules, and commands that run."""
    shutil.copytree(ROOT / "tools" / "tumble", tmp_path / "tools" / "tumble", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "tools" / "pyproject.toml", tmp_path / "tools")
    words = ["-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--target", str(tmp_path), str(tmp_path / "tools")]
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True, cwd=tmp_path)
    if done.returncode and ("No module named pip" in done.stderr or "setuptools" in done.stderr):
        pytest.skip("this Python has no pip with setuptools")
    assert done.returncode == 0, done.stderr
    for path in (ROOT / "tools" / "tumble").glob("*.py"):
        assert (tmp_path / "tumble" / path.name).read_text() == path.read_text()
    for name in ("plot", "animate", "report"):
        done = subprocess.run([tmp_path / "bin" / f"tumble-{name}", tmp_path / "none"], capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(tmp_path)})
        assert done.returncode == 1 and done.stderr.startswith(f"{name}: directory"), done.stderr


def test_mesh_that_moves(run, scene, tmp_path):
    """Every snapshot is read with its own mesh."""
    done = run([scene(edited("steps: 2}", "steps: 4}\noutput: {every: 2}")), "-mesh_deform", "true", "-particle_disc_radius", "0.3"])
    assert done.status == 0, done
    shots = [tumble.open(tmp_path / "out" / "disc").snapshot(step=step) for step in (2, 4)]
    assert not np.array_equal(shots[0].points, shots[1].points)
    for shot in shots:
        assert np.allclose(shot.sample("velocity", shot.points[:50]), shot["velocity"][:50], atol=1e-12)
