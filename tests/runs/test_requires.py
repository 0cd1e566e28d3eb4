"""A scene pays only for what it requires: counts of events in PETSc's log of a run, and what -scene_dry_run tells of it."""
import csv

import pytest

from conftest import SCENE, edited

STEPS = 6
FIXED = edited("position: [1, 4]", "position: [1, 4], free: none").replace("steps: 2", f"steps: {STEPS}")
MOVING = edited("steps: 2", f"steps: {STEPS}")
EMPTY = MOVING[: MOVING.index("particle:")] + MOVING[MOVING.index("sim:") :]
PAIR = MOVING.replace("groups: disc", "groups: disc,other") + "\nparticle_other: {shape: circle, radius: 0.125, density: 1.25, position: [1, 3]}\n"
BODY_EVENTS = ("BodyMark", "Projection", "BodyForce", "BodyAdvance", "Contact", "ContactSearch")


@pytest.fixture
def counts(run, scene, tmp_path):
    """counts(text, *options): how often each event happened on rank 0, in all stages."""

    def count(text, *options, ranks=1):
        result = run([scene(text), "-output_overwrite", "-log_view", ":log.csv:ascii_csv", *options], ranks=ranks)
        assert result.status == 0, result
        found = {}
        with open(tmp_path / "log.csv", newline="") as file:
            for (_, name), number in {(row["Stage Name"], row["Event Name"]): int(float(row["Count"])) for row in csv.DictReader(file) if row["Rank"] == "0"}.items():
                found[name] = found.get(name, 0) + number
        return found

    return count


@pytest.fixture
def inactive(run, scene):
    """inactive(text, *options): what the dry run lists as not active."""

    def tell(text, *options):
        result = run([scene(text), "-scene_dry_run", *options])
        assert result.status == 0, result
        return next(line for line in result.out.splitlines() if line.startswith("not active:"))

    return tell


def test_stokes_assembles_no_convection(counts, inactive):
    full = counts(MOVING, "-flow_time", "be", "-couple_method", "nodal")
    assert full["FlowConvect"] >= STEPS and full.get("FlowAssemble", 0) == 0, full
    stokes = counts(MOVING, "-flow_time", "be", "-couple_method", "nodal", "-flow_convection", "false")
    assert stokes.get("FlowConvect", 0) == 0 and stokes["FlowAssemble"] == 1, stokes
    assert "convection" in inactive(MOVING, "-flow_convection", "false") and "convection" not in inactive(MOVING)


def test_one_body_searches_no_pairs(counts, inactive):
    one, two = counts(MOVING), counts(PAIR)
    assert one.get("ContactSearch", 0) == 0 and one["Contact"] == 2 * STEPS, one  # the force before the solve, the gaps after the move
    assert two["ContactSearch"] > 0, two
    assert "pair search" in inactive(MOVING) and "pair search" not in inactive(PAIR)


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("boundary", ["nodal", "penalty", "aligned"])
def test_fixed_bodies_are_drawn_once(counts, boundary, ranks):
    options = ("-couple_method", boundary, "-flow_time", "be", "-mesh_cells", "16,48")
    fixed, moving = counts(FIXED, *options, ranks=ranks), counts(MOVING, *options, ranks=ranks)
    assert fixed.get("BodyAdvance", 0) == 0 and fixed["BodyMark"] == fixed["Projection"] == 1, fixed
    assert fixed["BodyForce"] == STEPS  # the force on it is what it is there for
    assert moving["BodyAdvance"] == STEPS <= moving["BodyMark"], moving


def test_fixed_bodies_without_convection_are_assembled_once(counts):
    fixed = counts(FIXED, "-couple_method", "penalty", "-flow_time", "be", "-mesh_cells", "16,48", "-flow_convection", "false")
    assert fixed["FlowAssemble"] == 1, fixed


def test_fixed_bodies_are_listed(inactive):
    told = inactive(FIXED)
    assert "marked once, not integrated" in told and "rigid unknowns" in told, told
    assert "integrated" not in inactive(MOVING)


def test_no_bodies_no_projection(counts, inactive):
    found = counts(EMPTY)
    assert not [name for name in BODY_EVENTS if found.get(name, 0)], found
    assert found["FlowConvect"] >= STEPS and found["PressureBuild"] >= 1, found
    assert "bodies, projection" in inactive(EMPTY)


def test_prescribed_motion_is_drawn_in_every_step(counts):
    swing = MOVING.replace("position: [1, 4]", "position: [1, 4], motion: oscillate, motion_amplitude: [0.1, 0], motion_period: [0.1, 1]")
    found = counts(swing)
    assert found["BodyMark"] >= STEPS and found["BodyAdvance"] == STEPS, found
