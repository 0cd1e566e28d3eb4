"""Drops on a mesh that is not lined up with them (-couple_drops regularised): published and exact values within the errors of the method, the
same on all numbers of ranks, restarts, drops that merge and break up, refusals."""

import pytest

from conftest import ROOT, read_rows

RUNS = ROOT / "runs"
SHORT = ["-mesh_cells", "10,20", "-sim_dt", "0.04", "-output_every", "0", "-flow_solver", "direct"]


@pytest.fixture
def drops(run):
    """drops(scene, *options, ranks=1): drops.csv and series.csv of a scene of runs/"""

    def start(scene, *options, ranks=1, folder="out"):
        result = run([RUNS / f"{scene}.yaml", "-couple_drops", "regularised", "-output_dir", folder, *options], ranks)
        assert result.status == 0, str(result)
        return [read_rows(result.folder / folder / f"{name}.csv") for name in ("drops", "series")]

    return start


def test_bubble(drops):
    """Case 1 of Hysing et al. (2009), 16 cells a width: rise velocity within 1 %, volume kept"""
    rows, series = drops("bubble-rising", "-mesh_cells", "16,32", "-sim_dt", "0.04", "-sim_time", "1.12", "-output_every", "0")
    assert max(row["v"] for row in rows) == pytest.approx(0.2419, rel=1e-2)
    assert max(abs(row["volume_error"]) for row in rows) < 1e-6
    assert max(row["momentum_error"] for row in series) < 1e-5
    assert rows[-1]["x"] == pytest.approx(0.5, abs=1e-4)


def test_at_rest(drops):
    """Spurious currents of a drop of the fluid around: a capillary number below 3e-3, a circle within 1e-3"""
    rows, series = drops("drop-static", "-particle_drop_density", "1", "-particle_drop_viscosity", "0.006454972", "-sim_steps", "20")
    assert max(row["cfl"] / 16 / row["dt"] for row in series) * 0.006454972 < 3e-3
    assert 1 - rows[-1]["circularity"] < 1e-3 and abs(rows[-1]["volume_error"]) < 1e-9


def test_ranks_and_restart(drops):
    one = drops("bubble-rising", *SHORT, "-sim_steps", "3")[0]
    other = drops("bubble-rising", *SHORT, "-sim_steps", "3", ranks=3, folder="other")[0]
    for name in ("volume", "y", "v", "circularity", "deformation"):
        assert other[-1][name] == pytest.approx(one[-1][name], rel=1e-8, abs=1e-9), name
    options = ["bubble-rising", *SHORT, "-checkpoint_every", "2"]
    whole = drops(*options, "-sim_steps", "4", folder="whole")[0]
    drops(*options, "-sim_steps", "2", folder="part")
    assert drops(*options, "-sim_steps", "4", "-sim_restart", "latest", folder="part")[0] == whole


def test_merging(drops):
    """Two drops pressed together become one, with the volume of both"""
    rows, series = drops("drops-coalesce", "-mesh_cells", "24,24", "-sim_dt", "0.02", "-sim_time", "0.6", "-output_every", "0")
    assert series[0]["drops"] == 2 and series[-1]["drops"] == 1 and series[-1]["drops_merged"] == 1
    assert rows[-1]["volume"] == pytest.approx(rows[0]["volume"] + rows[1]["volume"], rel=1e-6)


PERIOD = """
mesh: {cells: [16, 16], lower: [-1, -1], upper: [1, 1], periodic: [x, y]}
flow: {density: 1, viscosity: 0.1, solver: direct, velocity: "2,0"}
particle:
  groups: right, left
  right: {shape: circle, radius: 0.3, position: [0.28, 0], material: fluid, surface_tension: 1}
  left: {shape: circle, radius: 0.3, position: [-0.28, 0], material: fluid, surface_tension: 1}
sim: {dt: 0.02, steps: 12}
output: {every: 0}
"""


def run_period(run, scene, folder, *options):
    return run([scene(PERIOD), "-couple_drops", "regularised", "-output_dir", folder, *options])


def test_merging_across_a_period(run, scene):
    """Two drops that overlap across a period become one, as they do in the middle of the domain; one that meets itself is refused"""
    rows = []
    for folder, x in (("middle", 0.28), ("across", 0.72)):
        result = run_period(run, scene, folder, "-particle_right_position", f"{x},0", "-particle_left_position", f"{-x},0")
        assert result.status == 0, str(result)
        rows.append(read_rows(result.folder / folder / "drops.csv"))
    assert len(rows[0]) == len(rows[1]) == 12
    for name in ("volume", "v", "u", "length", "deformation"):
        assert rows[1][-1][name] == pytest.approx(rows[0][-1][name], rel=1e-6, abs=1e-7), name
    assert max(abs(row["x"]) for row in rows[0] + rows[1]) < 1 + 2 * 0.02
    result = run_period(run, scene, "itself", "-particle_right_radius", "0.98", "-particle_right_position", "0,0", "-particle_left_position", "1,1", "-particle_left_radius", "0.2")
    assert result.status and "met itself across a period" in result.err and result.err.count("error:") == 1, str(result)


def test_break_up(drops):
    """A dumbbell drawn out breaks: two drops of one size, a small one between them or none, with its volume"""
    region = "min(min((x-0.5)^2,(x+0.5)^2)+y^2-0.06,max(abs(y)-0.06,abs(x)-0.5))"
    rows, series = drops("thread-breaks", "-particle_drop_region", region, "-mesh_cells", "36,12", "-sim_dt", "0.025", "-sim_time", "1", "-output_every", "0")
    last = sorted(row["volume"] for row in rows if row["time"] == rows[-1]["time"])
    assert series[0]["drops"] == 1 and series[-1]["drops"] in (2, 3) and series[-1]["drops_broken"] >= 1
    assert last[-2] == pytest.approx(last[-1], rel=1e-2)
    assert sum(last) == pytest.approx(rows[0]["volume"], rel=2e-3)


@pytest.mark.parametrize(
    "scene, options, message",
    [
        ("bubble-rising-3d", [], "has no drops in space"),
        ("drop-and-discs", [], "has no rigid bodies beside drops"),
        ("sloshing", [], "has no walls that drops wet"),
        ("bubble-rising", ["-particle_bubble_coalescence", "never"], "has no drops that stay apart"),
        ("bubble-rising", ["-mesh_levels", "1", "-mesh_refine", "low", "-mesh_box_low_corners", "0,0,0.5,0.5"], "has no cells of several sizes"),
    ],
)
def test_refusals(run, scene, options, message):
    result = run([RUNS / f"{scene}.yaml", "-couple_drops", "regularised", "-output_dir", "out", "-sim_steps", "1", *options])
    assert result.status and message in result.err and result.err.count("error:") == 1, str(result)
