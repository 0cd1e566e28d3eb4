"""Bodies in HDF5 (bodies_<step>.h5, bodies.xdmf) and tools/animate, which draws them."""
import csv
import os
import subprocess
import xml.etree.ElementTree as ElementTree

import h5py
import matplotlib.image
import numpy as np
import pytest

from conftest import ROOT

SCENE = """mesh: {cells: [4, 4], lower: [0, 0], upper: [1, 1]}
flow: {active: false, gravity: [0, -10]}
particle:
  groups: disc, stick
  disc: {shape: circle, radius: 0.05, density: 1, place: lattice, count: 9, lower: [0, 0.5], upper: [1, 1], angular_velocity: 2}
  stick: {shape: ellipse, a: 0.2, b: 0.05, density: 1, position: [0.5, 0.25], angle: 0.5}
sim: {dt: 0.01, steps: 10}
output: {every: 5}
"""


@pytest.fixture
def folder(run, scene):
    def start(ranks=1):
        result = run([scene(SCENE), "-output_dir", f"out{ranks}"], ranks)
        assert result.status == 0, str(result)
        return result.folder / f"out{ranks}"

    return start


def animate(folder, *args, path=None):
    env = {**os.environ, "PATH": str(path)} if path else None
    return subprocess.run(["/usr/bin/python3", str(ROOT / "tools" / "animate"), str(folder), *args], capture_output=True, text=True, env=env, check=False)


def test_file_holds_the_state(folder):
    out = folder(1)
    with open(out / "bodies.csv") as file:
        rows = [row for row in csv.DictReader(file) if row["step"] == "10"]
    with h5py.File(out / "bodies_10.h5") as file:
        found = {name: file[name][:] for name in file}
    assert np.ravel(found["time"]) == pytest.approx([0.1])
    for name, columns in (("position", "xyz"), ("velocity", "uvw")):
        assert found[name].reshape(-1, 3) == pytest.approx(np.array([[float(row[c]) for c in columns] for row in rows]), rel=1e-9, abs=1e-9), name
    outline = found["outline"].reshape(10, -1, 3)
    discs = np.linalg.norm(outline[:9] - found["position"].reshape(-1, 1, 3)[:9], axis=2)
    assert discs == pytest.approx(np.full_like(discs, 0.05))
    first = outline[0, 0] - found["position"].reshape(-1, 3)[0]
    assert np.arctan2(first[1], first[0]) == pytest.approx(np.ravel(found["angle"])[0], abs=1e-9) and np.ravel(found["angle"])[0] > 0.1
    named = {item.text.split(":")[0] for item in ElementTree.parse(out / "bodies.xdmf").iter("DataItem")}
    assert named == {"bodies_5.h5", "bodies_10.h5"}


def test_file_does_not_depend_on_ranks(folder):
    files = [h5py.File(folder(ranks) / "bodies_10.h5") for ranks in (1, 2)]
    for name in files[0]:
        assert np.array_equal(files[0][name][:], files[1][name][:]), name


def test_animate(folder, tmp_path):
    out = folder(1)
    done = animate(out, "--frame", "10", "--width", "300")
    assert done.returncode == 0, done.stderr
    picture = matplotlib.image.imread(out / "frame_10.png")
    assert picture.shape[1] == 300 and picture[..., :3].std() > 0.05
    without = animate(out, path=tmp_path / "nothing")
    assert without.returncode == 0 and (out / "animation.gif").read_bytes()[:6] in (b"GIF87a", b"GIF89a"), without.stderr
    fake = tmp_path / "bin" / "ffmpeg"  # takes the frames as they come; the last argument is the film
    fake.parent.mkdir()
    fake.write_text('#!/bin/sh\nfor last; do :; done\n/bin/cat > "$last"\n')
    fake.chmod(0o755)
    film = animate(out, "--width", "200", path=fake.parent)
    assert film.returncode == 0, film.stderr
    size = (out / "animation.mp4").stat().st_size
    assert size % (2 * 200 * 4) == 0 and size > 2 * 200 * 100 * 4  # two frames of raw pixels


def test_animate_says_what_is_missing(tmp_path):
    nothing = animate(tmp_path / "no")
    assert nothing.returncode != 0 and "does not exist" in nothing.stderr
    empty = animate(tmp_path)
    assert empty.returncode != 0 and "holds no results" in empty.stderr
