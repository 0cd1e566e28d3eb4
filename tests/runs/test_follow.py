"""Meshes that follow bodies (-mesh_track): in space, with adaptive steps, in a box that travels, with a mean velocity that is held; from a checkpoint, with other ranks and other cells."""
import csv
import json
import xml.etree.ElementTree as xml

import h5py
import pytest

from conftest import edited

FOLLOWS = ", levels: 3, track: true, track_distance: 0.8"
FALLING = f"""\
mesh: {{upper: [2, 6], cells: [8, 24]{FOLLOWS}}}
flow: {{density: 1, viscosity: 0.1, gravity: [0, -981]}}
particle:
  groups: disc
  disc: {{shape: circle, radius: 0.125, density: 1.25, position: [1, 4], velocity: [0, -4]}}
sim: {{dt: 0.002, steps: 16}}
output: {{every: 0}}
"""
# the same in a box without ends
ROUND = edited("upper: [2, 6], cells: [8, 24]", "upper: [2, 4], cells: [8, 16], periodic: y", FALLING).replace("[1, 4], velocity", "[1, 2], velocity")
WAY = ["-mesh_refine", "way", "-mesh_box_way_corners", "0.5,1.2,1.5,4.5", "-mesh_levels", "3"]
BALL = """\
mesh: {dimension: 3, upper: [1.5, 1.5, 2.5], cells: [3, 3, 5], levels: 2, refine_distance: 1.5, track: true, track_distance: 0.3}
flow: {density: 1, viscosity: 0.1, gravity: [0, 0, -981], solver: balanced, ksp_rtol: 1e-9}
particle:
  groups: ball
  ball: {shape: circle, radius: 0.2, density: 1.5, position: [0.75, 0.75, 1.7], velocity: [0, 0, -4]}
sim: {dt: 0.004, steps: 4}
output: {every: 0}
"""


def rows(folder, name="bodies.csv"):
    with open(folder / name, newline="") as file:
        return [{k: v for k, v in row.items() if not k.startswith("seconds")} for row in csv.DictReader(file)]


def changes(folder):
    return json.loads((folder / "summary.json").read_text())["quantities"].get("mesh_changes", 0)


@pytest.fixture
def good(run, tmp_path):
    """good(folder, args, ranks=1): a run into the folder that must succeed; returns the folder."""

    def start(folder, args, ranks=1):
        done = run([*args, "-output_dir", folder], ranks)
        assert done.status == 0, done
        return tmp_path / folder

    return start


def check_near(one, two, rel, columns=("v",)):
    for a, b in zip(rows(one), rows(two), strict=True):
        for column in columns:
            assert float(a[column]) == pytest.approx(float(b[column]), rel=rel), (column, a, b)


def fixed(text, name, scene):
    """The scene with cells that stay."""
    return scene(edited(FOLLOWS, "", text), name)


# ---- together with others ----


def test_adaptive_steps(good, scene):
    """As many steps as on cells that stay, but for one, of nearly the same lengths: re-meshing is no error in time. From rest: the layer of a sudden
    start is thinner than a cell, and other cells have another one."""
    rest = edited(", velocity: [0, -4]", "", FALLING)
    adapt = ["-sim_adapt", "-sim_adapt_tolerance", 1e-3, "-sim_time", 0.06, "-sim_steps", 100]
    one = good("follows", [scene(rest), *adapt])
    two = good("stays", [fixed(rest, "stays.yaml", scene), *WAY, *adapt])
    assert changes(one) >= 4
    assert abs(len(rows(one)) - len(rows(two))) <= 1
    for a, b in list(zip(rows(one, "series.csv"), rows(two, "series.csv")))[:12]:
        assert float(a["dt"]) == pytest.approx(float(b["dt"]), rel=0.06), (a, b)
        assert float(a["step_error"]) == pytest.approx(float(b["step_error"]), rel=0.2), (a, b)
    assert float(rows(one)[-1]["v"]) == pytest.approx(float(rows(two)[-1]["v"]), rel=5e-4)


def test_travelling_box(good, scene):
    """A box that goes with the disc keeps its cells; one that goes the other way makes them anew more often than one at rest, and the fall is the same."""
    name, rest = scene(edited(", velocity: [0, -4]", "", ROUND)), 0
    flux = ["-couple_backflow", "flux", "-sim_steps", 24]
    still = good("rest", [name, *flux])
    body = good("body", [name, *flux, "-sim_frame", "body"])
    against = good("against", [name, *flux, "-sim_frame", "velocity", "-sim_frame_velocity", "0,3"])
    rest = changes(still)
    assert rest >= 2 and changes(body) == 0 and changes(against) > rest, (rest, changes(against))
    for travels in body, against:
        assert float(rows(travels)[-1]["y"]) == pytest.approx(float(rows(still)[-1]["y"]), rel=2e-4)
        assert float(rows(travels)[-1]["v"]) == pytest.approx(float(rows(still)[-1]["v"]), rel=3e-3)


def test_rate_is_held(good, scene):
    """The force that holds the mean velocity is found on the new cells as on the old ones, within 2.4e-5 also in the step after a change: momentum is carried whole (7e-3 where values alone are)."""
    moves = edited("velocity: [0, -4]", "velocity: [0, -2]", edited("gravity: [0, -981]", "gravity: [0, -981], velocity: [0, -2], rate: [0, -2], solver: balanced, ksp_rtol: 1e-9", ROUND))
    moves = edited("periodic: y", "periodic: [x, y]", moves)
    one = good("follows", [scene(moves)])
    two = good("stays", [fixed(moves, "stays.yaml", scene), *WAY, "-mesh_box_way_corners", "0.5,1.2,1.5,2.8"])
    assert changes(one) >= 4
    for a, b in zip(rows(one, "series.csv"), rows(two, "series.csv"), strict=True):
        assert float(a["mean_velocity_y"]) == pytest.approx(-2, abs=1e-8), a
        assert float(a["flow_force_y"]) == pytest.approx(float(b["flow_force_y"]), rel=1e-4), (a, b)


def test_in_space(good, scene):
    """A ball falls on one rank as on two, and as on cells that are fine all the way."""
    one = good("one", [scene(BALL)])
    two = good("two", [scene(BALL), "-sim_steps", 3], 2)
    stays = edited(", track: true, track_distance: 0.3", ", refine: way, box_way_corners: [0, 0, 0.9, 1.5, 1.5, 2.3]", BALL)
    stays = good("stays", [scene(stays, "stays.yaml")])
    assert changes(one) >= 1 and changes(two) >= 1
    for a, b in zip(rows(two), rows(one)):
        for column in "z", "w", "force_z":
            assert float(a[column]) == pytest.approx(float(b[column]), rel=1e-6), (a, b)
    check_near(one, stays, 1e-3, ["w"])


# ---- checkpoints ----


def test_restart_on_other_ranks(good, scene):
    name = scene(FALLING)
    tight = [name, "-flow_solver", "balanced", "-flow_ksp_rtol", 1e-9, "-checkpoint_every", 5]
    whole = good("whole", tight)
    parts = good("parts", [*tight, "-sim_steps", 5])
    good("parts", [*tight, "-sim_steps", 8, "-sim_restart", "latest"], 2)
    good("parts", [*tight, "-sim_restart", "latest"])
    assert changes(whole) == changes(parts) >= 2
    check_near(parts, whole, 1e-7, ["y", "v", "force_y"])


OTHERS = {
    "a level more": ["-mesh_levels", 4],
    "other base cells": ["-mesh_cells", "12,36"],
    "a wider band": ["-mesh_refine_distance", 4],
}


@pytest.mark.parametrize("case", OTHERS)
def test_restart_with_other_cells(good, scene, case):
    """The fields go over to the new cells, and the fall goes on as it has begun on them."""
    name = scene(FALLING)
    first = good("first", [name, "-sim_steps", 8, "-checkpoint_every", 8])
    whole = good("whole", [name, *OTHERS[case]])
    parts = good("parts", [name, *OTHERS[case], "-sim_restart", first / "checkpoint_8.h5"])
    cells = [json.loads((folder / "summary.json").read_text())["cells"] for folder in (first, whole, parts)]
    assert cells[1] != cells[0] and cells[2] != cells[0], cells
    for a, b in zip(rows(parts), rows(whole)[8:], strict=True):
        assert float(a["v"]) == pytest.approx(float(b["v"]), rel=4e-3), (a, b)


def test_restart_with_cells_that_stay(good, scene):
    """From a mesh that followed to one that is fine all the way, and back."""
    follows, stays = scene(FALLING), [fixed(FALLING, "stays.yaml", scene), *WAY]
    one = good("one", [follows, "-sim_steps", 8, "-checkpoint_every", 8])
    two = good("two", [*stays, "-sim_restart", one / "checkpoint_8.h5", "-checkpoint_every", 12, "-sim_steps", 12])
    three = good("three", [follows, "-sim_restart", two / "checkpoint_12.h5"])
    whole = rows(good("whole", [follows]))
    for part, of in ((rows(two), whole[8:12]), (rows(three), whole[12:])):
        for a, b in zip(part, of, strict=True):
            assert float(a["v"]) == pytest.approx(float(b["v"]), rel=1e-3), (a, b)


def test_restart_without_levels(run, good, scene):
    """A file whose cells the scene cannot have is refused by name, in both directions."""
    follows, plain = scene(FALLING), fixed(FALLING, "plain.yaml", scene)
    one = good("one", [follows, "-sim_steps", 2, "-checkpoint_every", 2])
    two = good("two", [plain, "-sim_steps", 2, "-checkpoint_every", 2])
    for name, file in ((plain, one), (follows, two)):
        done = run([name, "-output_dir", "no", "-sim_restart", file / "checkpoint_2.h5"])
        assert done.status != 0 and done.text.count("error:") == 1 and "has another mesh" in done.text, done


def test_snapshots_after_restart(good, scene):
    """Every snapshot of the index has the mesh it was written with, of the size that the index tells, also those from before the restart."""
    name = scene(FALLING)
    good("out", [name, "-output_every", 4, "-sim_steps", 8, "-checkpoint_every", 8])
    out = good("out", [name, "-output_every", 4, "-sim_restart", "latest"])
    grids = [grid for grid in xml.parse(out / "fields.xdmf").iter("Grid") if grid.get("GridType") != "Collection"]
    assert len(grids) == 4
    meshes = set()
    for grid in grids:
        for item in grid.iter("DataItem"):
            if not item.text or ":" not in item.text:
                continue
            file, dataset = item.text.strip().split(":")
            meshes |= {file} if dataset == "/coordinates" else set()
            with h5py.File(out / file) as data:
                shape = [int(n) for n in item.get("Dimensions").split()]
                assert list(data[dataset].shape) == shape or data[dataset].size == shape[0], (file, dataset, shape)
    assert len(meshes) >= 3, meshes


# ---- boxes that go with bodies ----

WAKE = edited(FOLLOWS, FOLLOWS + ", refine: [bodies, wake], box_wake_corners: [0, -0.1, 0.9, 0.1], box_wake_group: disc, box_wake_orientation: velocity, box_wake_levels: 2", FALLING)


def levels_at(checkpoint, upper, *places):
    """Levels of the cells at places, from the tree of a checkpoint."""
    with h5py.File(checkpoint) as file:
        tree = file["tree"]
        deepest, base = int(tree["levels"][:].ravel()[0]), tree["cells"][:].ravel()
        x, y, level = (tree[k][:, 0] for k in ("x", "y", "level"))
    finest = [length / (n * 2**deepest) for length, n in zip(upper, base)]
    size, found = 2.0 ** (deepest - level), []
    for place in places:
        at = [c / h for c, h in zip(place, finest)]
        inside = (x <= at[0]) & (at[0] < x + size) & (y <= at[1]) & (at[1] < y + size)
        assert inside.sum() == 1, place
        found.append(int(level[inside][0]))
    return found


def test_wake_box(good, scene):
    """Behind a disc on its way cells are halved twice, beside and before it they are not; the box turns with the way, and a restart has the cells of the whole run."""
    name = scene(edited("velocity: [0, -4]", "velocity: [3, -4]", WAKE))
    whole = good("whole", [name, "-checkpoint_every", 1, "-sim_steps", 1])
    behind, before, above = levels_at(whole / "checkpoint_1.h5", [2, 6], (0.52, 4.64), (1.48, 3.36), (1, 4.8))
    assert behind >= 2 and before < 2 and above < 2, (behind, before, above)
    down = [scene(WAKE, "down.yaml"), "-checkpoint_every", 5]
    whole = good("down", [*down, "-sim_steps", 10])
    above, below = levels_at(whole / "checkpoint_10.h5", [2, 6], (1, 4.7), (1, 3.2))
    assert above >= 2 and below < 2, (above, below)
    parts = good("parts", [*down, "-sim_steps", 5])
    good("parts", [*down, "-sim_restart", "latest", "-sim_steps", 10])
    assert changes(parts) == changes(whole) >= 1 and rows(parts)[-1] == rows(whole)[-1]


HELD = """\
mesh: {upper: [2, 2], cells: [8, 8], periodic: [x, y], levels: 3, refine: [bodies, wake, above], box_wake_corners: [0, -0.1, 0.6, 0.1], box_wake_group: post, box_above_corners: [-0.1, 0, 0.1, 0.6], box_above_group: post}
flow: {viscosity: 0.1, velocity: [1, 0]}
particle: {groups: [post], post: {shape: circle, radius: 0.1, place: table, table: posts.csv, free: none}}
sim: {dt: 0.01, steps: 1}
output: {every: 0}
"""


def test_boxes_of_bodies_that_stand(good, scene, tmp_path):
    """Behind and above each of two posts, along the axes, and over a periodic border."""
    (tmp_path / "posts.csv").write_text("x,y\n0.5,0.5\n1.7,1.5\n")
    out = good("out", [scene(HELD), "-checkpoint_every", 1])
    levels = levels_at(out / "checkpoint_1.h5", [2, 2], (1, 0.5), (0.2, 1.5), (0.5, 1), (1.7, 0.05), (0, 0.55), (1.15, 1.5), (0.5, 0.05))
    assert levels[:4] == [3, 3, 3, 3] and max(levels[4:]) < 3, levels


CARRIED = {
    "no such group": (["-mesh_box_wake_group", "ball"], "the scene has no group 'ball'"),
    "no group": (["-mesh_refine", "bodies,a", "-mesh_box_a_corners", "0,0,1,1", "-mesh_box_a_orientation", "velocity"], "name their group by -mesh_box_a_group"),
    "stays": (["-mesh_track", "false"], "or a box with a group, refines where bodies are at the start"),
    "stays, alone": (["-mesh_track", "false", "-mesh_refine", "wake"], "or a box with a group, refines where bodies are at the start"),
    "stands": (["-mesh_track", "false", "-particle_disc_free", "none", "-particle_disc_velocity", "0,0"], "put -mesh_box_<box>_orientation axes"),
    "direction": (["-mesh_box_wake_orientation", "wind"], "-mesh_box_wake_orientation"),
}


@pytest.mark.parametrize("case", CARRIED)
def test_wrong_boxes(run, scene, case):
    options, words = CARRIED[case]
    done = run([scene(WAKE), *options])
    assert done.status != 0 and words in done.text and done.text.count("error:") == 1, done


BANDS = {
    "space": (BALL, [], 1.5),
    "space, nodal": (BALL, ["-couple_method", "nodal"], 3),
    "space, aligned": (BALL, ["-couple_method", "aligned"], 4),
    "plane": (FALLING, [], 3),
}


@pytest.mark.parametrize("case", BANDS)
def test_default_bands(run, scene, case):
    """As many cells around a body as runs/studies/refinement/notes.md, "How wide a band", and the alignment ask for, and no more."""
    text, options, band = BANDS[case]
    name, cells = scene(text.replace("refine_distance: 1.5, ", "")), {}
    for words in ((), ("-mesh_refine_distance", band), ("-mesh_refine_distance", band + 1)):
        told = run([name, *options, *words, "-scene_dry_run"])
        assert told.status == 0, told
        cells[words] = next(line.split(",")[1] for line in told.text.splitlines() if line.startswith("mesh: "))
    assert cells[()] == cells["-mesh_refine_distance", band] != cells["-mesh_refine_distance", band + 1], cells
