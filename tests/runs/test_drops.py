"""Drops and bubbles: scenes of runs/ against exact and published values at reduced size, the same on all numbers of ranks, restarts, refusals."""

import csv
import math
import sys

import numpy as np
import pytest

from conftest import ROOT

sys.path.insert(0, str(ROOT / "tools"))
import tumble  # noqa: E402
from tumble import draw  # noqa: E402

RUNS = ROOT / "runs"


@pytest.fixture
def drops(run):
    """drops(scene, *options, ranks=1): drops.csv and series.csv of a scene of runs/"""

    def start(scene, *options, ranks=1, folder="out"):
        result = run([RUNS / f"{scene}.yaml", "-output_dir", folder, *options], ranks)
        assert result.status == 0, str(result)
        tables = []
        for name in ("drops", "series"):
            with open(result.folder / folder / f"{name}.csv") as file:
                tables.append([{key: text if key == "group" else float(text) for key, text in row.items()} for row in csv.DictReader(file)])
        return tables

    return start


def test_static(drops):
    """Spurious currents: kinetic energy below that of a capillary number of 1e-6 in the whole box, the drop a circle of its volume."""
    rows, series = drops("drop-static", "-sim_steps", "20")
    speed = 1e-6 / 0.006454972
    assert max(row["kinetic_energy"] for row in series) < 0.5 * speed**2
    assert 1 - rows[-1]["circularity"] < 2e-8
    assert abs(rows[-1]["volume_error"]) < 1e-8
    assert rows[-1]["x"] == pytest.approx(0.503, abs=1e-6) and rows[-1]["y"] == pytest.approx(0.507, abs=1e-6)


def test_carried(drops):
    """Through a periodic box with a uniform flow, over its sides: a circle that goes with the flow, no growth."""
    options = ["-mesh_periodic", "x,y", "-flow_velocity", "1,0.5", "-sim_steps", "24", "-sim_dt", "0.0176"]
    rows, _ = drops("drop-static", *options)
    for row in rows:
        assert row["u"] == pytest.approx(1, abs=1e-5) and row["v"] == pytest.approx(0.5, abs=1e-5)
        assert 1 - row["circularity"] < 4e-8 and abs(row["volume_error"]) < 2e-5
    assert rows[-1]["x"] % 1 == pytest.approx(0.503 + 0.4224, abs=2e-5)


def test_outline(run):
    """Snapshots have the interface, whose area is the volume of drops.csv, and the phase of the cells; the closing line names the table."""
    result = run([RUNS / "drop-static.yaml", "-output_dir", "out", "-sim_steps", "2", "-output_every", "2"])
    assert result.status == 0 and "bodies.csv, drops.csv," in result.out, str(result)
    out = tumble.open(result.folder / "out")
    shot = out.snapshot()
    (line,) = draw.find_drops(out, shot)
    x, y = line.T
    assert 0.5 * np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) == pytest.approx(out.drops["volume"][-1], rel=1e-3)
    assert np.hypot(x - 0.503, y - 0.507) == pytest.approx(0.25, rel=1e-4)
    middle = shot.points[shot.cells[:, 8], :2]
    inside = np.hypot(middle[:, 0] - 0.503, middle[:, 1] - 0.507) < 0.25
    assert (shot["phase"] == inside).all() and 10 < inside.sum() < 100


def test_bubble(drops):
    """Case 1 of Hysing et al. (2009) up to its largest rise velocity, with a mesh of 16 cells a width"""
    rows, series = drops("bubble-rising", "-mesh_cells", "16,32", "-sim_dt", "0.04", "-sim_time", "1.04", "-output_every", "0")
    top = max(rows, key=lambda row: row["v"])
    assert top["v"] == pytest.approx(0.2417, rel=3e-3) and 0.88 <= top["time"] <= 0.96
    assert max(abs(row["volume_error"]) for row in rows) < 5e-4
    assert max(row["momentum_error"] for row in series) < 1e-6
    assert rows[-1]["x"] == pytest.approx(0.5, abs=1e-6)


SHORT = ["-mesh_cells", "10,20", "-sim_dt", "0.04", "-output_every", "0", "-flow_solver", "direct"]


def test_ranks(drops):
    """The same on 1, 2 and 3 ranks"""
    one, *others = (drops("bubble-rising", *SHORT, "-sim_steps", "3", ranks=ranks, folder=f"r{ranks}")[0] for ranks in (1, 2, 3))
    for other in others:
        for name in ("volume", "y", "v", "circularity", "deformation"):
            assert other[-1][name] == pytest.approx(one[-1][name], rel=1e-8, abs=1e-9), name


def test_restart(drops):
    """A run that stops and goes on has the bits of one that does not stop."""
    options = ["bubble-rising", *SHORT, "-checkpoint_every", "2"]
    whole = drops(*options, "-sim_steps", "4", folder="whole")[0]
    drops(*options, "-sim_steps", "2", folder="part")
    again = drops(*options, "-sim_steps", "4", "-sim_restart", "latest", folder="part")[0]
    assert again == whole and len(again) == 4 and all(math.isfinite(row["v"]) for row in again)


@pytest.mark.parametrize(
    "options, message",
    [
        (["-flow_time", "cn"], "-flow_time be or bdf2"),
        (["-couple_method", "penalty"], "use aligned"),
        (["-sim_adapt", "true"], "cannot be taken again"),
        (["-monitor_energy", "true"], "surface energy"),
        (["-particle_bubble_place", "random"], "one a group"),
        (["-particle_bubble_radius", "0.02"], "cannot be lined up"),
        (["-particle_bubble_free", "none"], "-particle_bubble_free"),
    ],
)
def test_refusals(run, options, message):
    result = run([RUNS / "bubble-rising.yaml", "-output_dir", "out", "-sim_steps", "1", *options])
    assert result.status and message in result.err and result.err.count("error:") == 1, str(result)
