"""tools/plot on a made-up output directory: the pictures are there and show something, errors are said in one line."""

import json
import subprocess
import sys
from pathlib import Path

import h5py
import matplotlib.image
import numpy as np
import pytest

PLOT = Path(__file__).resolve().parent.parent.parent / "tools" / "plot"
LATTICE_TO_VTK = [0, 2, 8, 6, 1, 5, 7, 3, 4]
RADIUS = 0.125
STEPS = [0, 40, 160]  # snapshots
SERIES = "step,time_s,dt_s,cfl,outer_iterations,divergence,kinetic_energy,momentum_error,seconds"
BODIES = (
    "step,time_s,body,group,x,y,z,angle_rad,u,v,w,omega_x,omega_y,omega_z,"
    "force_x,force_y,force_z,torque_x,torque_y,torque_z,gap,radius"
)


def fall(time):
    """Speed and height of the disc of the made-up run: exponential approach to 5.5 cm/s until it lies on the floor."""
    speed, height = 5.5 * (1 - np.exp(-time / 0.08)), 4 - 5.5 * (time - 0.08 * (1 - np.exp(-time / 0.08)))
    return (speed, height) if height > RADIUS else (0.0, RADIUS)


def write_mesh(path, nx, ny, width, height):
    """Q2 nodes of nx x ny cells, numbered row by row; returns x, y of the nodes."""
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(0, width, 2 * nx + 1), np.linspace(0, height, 2 * ny + 1)))
    corner = (2 * np.arange(ny)[:, None] * (2 * nx + 1) + 2 * np.arange(nx)[None, :]).ravel()
    offset = np.array([(j // 3) * (2 * nx + 1) + j % 3 for j in LATTICE_TO_VTK])
    with h5py.File(path, "w") as file:
        file["coordinates"] = np.stack([x, y, 0 * x], axis=1)
        file["cells"] = corner[:, None] + offset
    return x, y


def write_fields(path, time, x, y):
    """Two counter-rotating vortices beside the disc."""
    speed, height = fall(time)
    dx, dy = x - 1, y - height
    r = np.hypot(dx, dy)
    decay = -speed * np.exp(-np.maximum(r / RADIUS - 1, 0) / 2) * np.sin(np.pi * x / 2)
    with h5py.File(path, "w") as file:
        file["time"] = [time]
        file["velocity"] = np.stack([0.4 * decay * dx * dy / (r**2 + 0.05), decay, 0 * x], axis=1)
        file["vorticity"] = -decay * dx / (r + 0.1) / 0.2
        file["pressure"] = -15 * speed * dy / (r**2 + 0.1)
        file["body"] = np.where(r < RADIUS, 0, -1)


def write_index(path, steps):
    items = "".join(f"<Grid><Attribute><DataItem>fields_{step}.h5:/velocity</DataItem></Attribute></Grid>" for step in steps)
    path.write_text(f"<?xml version='1.0'?><Xdmf><Domain><Grid>{items}</Grid></Domain></Xdmf>")


def write_tables(folder, radius):
    with open(folder / "series.csv", "w") as series, open(folder / "bodies.csv", "w") as bodies:
        print(SERIES, file=series)
        print(BODIES, file=bodies)
        for step in range(1, 181):
            time = 0.005 * step
            speed, height = fall(time)
            print(f"{step},{time},0.005,{speed / 10},{4 + step % 3},{1e-7 * (1 + step % 5)},{speed**2},{-1e-9 * step},0.1", file=series)
            print(f"{step},{time},0,disc,1,{height},0,{time},0,{-speed},0,0,0,1,0,10,0,0,0,0,{height - RADIUS},{radius}", file=bodies)
        print("181,0.9,0.005", file=series)  # a line that a killed job left


@pytest.fixture(name="run_dir")
def make_run_dir(tmp_path):
    return write_run(tmp_path / "sedimentation")


def write_run(folder, radius=RADIUS, cells=(20, 60)):
    folder.mkdir()
    x, y = write_mesh(folder / "mesh.h5", *cells, 2, 6)
    for step in STEPS:
        write_fields(folder / f"fields_{step}.h5", 0.005 * step, x, y)
    write_index(folder / "fields.xmf", STEPS)
    write_tables(folder, radius)
    (folder / "summary.json").write_text(json.dumps({"scene": "sedimentation", "steps": 180}))
    return folder


def plot(*arguments):
    return subprocess.run([sys.executable, str(PLOT), *map(str, arguments)], capture_output=True, text=True, check=False)


def assert_picture(path):
    """Large enough and not of one colour: more than 2 % of its pixels differ from the background."""
    picture = matplotlib.image.imread(path)[:, :, :3]
    assert min(picture.shape[:2]) > 300, f"{path.name} has {picture.shape} pixels"
    drawn = np.mean(np.any(np.abs(picture - picture[0, 0]) > 0.05, axis=2))
    assert drawn > 0.02, f"only {100 * drawn:.2f} % of {path.name} is drawn"
    return picture


def test_default_pictures(run_dir):
    result = plot(run_dir)
    assert result.returncode == 0, result.stderr
    assert result.stderr == ""
    names = {path.name for path in run_dir.glob("*.png")}
    assert names == {"trajectory.png", "history.png", "field_160.png"}
    assert set(result.stdout.split()) == {str(run_dir / name) for name in names}
    for name in names:
        assert_picture(run_dir / name)


def test_chosen_step_and_fields(run_dir):
    result = plot(run_dir, "--step", 40, "--field", "vorticity", "--field", "pressure", "--units", "si")
    assert result.returncode == 0, result.stderr
    assert_picture(run_dir / "field_40_vorticity.png")
    assert_picture(run_dir / "field_40_pressure.png")
    assert not (run_dir / "field_40.png").exists()


def test_outline_from_indicator(tmp_path):
    """A body that is no disc is drawn from the nodes inside: as many white pixels as the circle of a disc, roughly."""
    white = []
    for name, radius in (("disc", RADIUS), ("other", 0)):
        folder = write_run(tmp_path / name, radius)
        assert plot(folder, "--step", 40).returncode == 0
        picture = assert_picture(folder / "field_40.png")
        height, width = picture.shape[:2]
        inner = picture[int(0.1 * height) : int(0.85 * height), int(0.3 * width) : int(0.55 * width)]
        white.append(np.count_nonzero(np.all(inner > 0.9, axis=2)))
    assert white[1] > 0.3 * white[0] > 10


def test_outline_from_file(tmp_path):
    """A body that is no disc is drawn as the outline that bodies_<step>.h5 holds; one that has left the domain is not."""
    changed = []
    for name, radius in (("gone", 0), ("there", RADIUS)):
        folder = write_run(tmp_path / name, 0)
        with h5py.File(folder / "fields_40.h5", "a") as file:
            file["body"][:] = -1
        with h5py.File(folder / "bodies_40.h5", "w") as file:
            file["radius"] = [radius]
            file["outline"] = [[0.9, 3, 0], [1.6, 3, 0], [1.6, 4, 0], [0.9, 4, 0]]
        assert plot(folder, "--step", 40).returncode == 0
        changed.append(assert_picture(folder / "field_40.png"))
    assert np.count_nonzero(np.any(changed[0] != changed[1], axis=2)) > 500


def test_running_job(run_dir):
    """No summary yet; a snapshot that the index does not name is not ours."""
    (run_dir / "summary.json").unlink()
    write_index(run_dir / "fields.xmf", STEPS[:2])
    result = plot(run_dir)
    assert result.returncode == 0, result.stderr
    assert (run_dir / "field_40.png").exists() and not (run_dir / "field_160.png").exists()


@pytest.mark.parametrize(
    "break_it, arguments, words",
    [
        (lambda folder: None, ["--step", "7"], ["step 7", "0, 40, 160"]),
        (lambda folder: (folder / "series.csv").write_text("step,time\n1,2\n"), [], ["series.csv", "time_s"]),
        (lambda folder: (folder / "summary.json").write_text("{"), [], ["summary.json"]),
        (lambda folder: (folder / "mesh.h5").unlink(), [], ["mesh.h5"]),
    ],
)
def test_broken_results(run_dir, break_it, arguments, words):
    break_it(run_dir)
    result = plot(run_dir, *arguments)
    assert_one_line(result, words)


def test_missing_directory(tmp_path):
    assert_one_line(plot(tmp_path / "nowhere"), ["nowhere", "does not exist"])


def test_empty_directory(tmp_path):
    assert_one_line(plot(tmp_path), ["holds no results", "series.csv"])


def assert_one_line(result, words):
    assert result.returncode == 1
    assert result.stderr.startswith("plot: ") and result.stderr.count("\n") == 1, result.stderr
    for word in words:
        assert word in result.stderr
