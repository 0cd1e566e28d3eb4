"""Adaptive time steps: they follow the error and the limits, end at the times that were asked for, and are refused where they cannot be."""
import csv
import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
LID = """\
mesh: {cells: [12, 12]}
flow: {viscosity: 0.01, bc: {top: {type: moving_wall, velocity: [1, 0], factor: [0, 1, 2]}}}
sim: {dt: 0.01, time: 2, adapt: true, adapt_tolerance: 1e-4}
output: {interval: 0.3}
"""
FIXED = LID.replace(", adapt: true, adapt_tolerance: 1e-4", "")
# two discs fall towards each other and towards the floor
PAIR = """\
mesh: {cells: [12, 24], lower: [0, 0], upper: [1, 2]}
flow: {viscosity: 0.1, gravity: [0, -981]}
couple: {method: penalty}
particle:
  groups: [a, b]
  a: {shape: circle, radius: 0.15, density: 1.5, position: [0.5, 1.2]}
  b: {shape: circle, radius: 0.15, density: 1.2, position: [0.51, 0.8]}
sim: {dt: 0.002, time: 0.12, adapt: true, adapt_tolerance: 5e-3}
"""


def series(folder):
    with open(folder / "series.csv") as file:
        return [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]


@pytest.fixture
def rows_of(run, tmp_path):
    """rows_of(args, ranks): lines of series.csv of a run that must succeed, in folder `out` or in that of -output_dir."""

    def start(args, ranks=1):
        result = run([*(args if "-output_dir" in args else [*args, "-output_dir", "out"])], ranks)
        assert result.status == 0, str(result)
        return series(tmp_path / (args[args.index("-output_dir") + 1] if "-output_dir" in args else "out"))

    return start


@pytest.mark.parametrize("scheme, tolerance, accuracy", [("bdf2", 1e-4, 4e-3), ("cn", 1e-4, 4e-3), ("be", 2e-4, 0.05)])
def test_error_is_kept(rows_of, scene, scheme, tolerance, accuracy):
    """An oscillating wall: the estimate stays below twice the tolerance, the step changes rarely and by little, and the result is that of small steps."""
    rows = rows_of([scene(LID), "-sim_time", "1", "-flow_time", scheme, "-sim_adapt_tolerance", tolerance])
    assert all(row["step_error"] <= 2 * tolerance for row in rows[4:])
    steps = [row["dt"] for row in rows]
    assert max(steps) > 3 * min(steps) and len(steps) < 120
    assert all(b <= 2 * a * (1 + 1e-9) for a, b in zip(steps, steps[1:]))
    kept = sum(abs(b - a) <= 1e-9 * a for a, b in zip(steps, steps[1:]))
    assert kept > 0.4 * len(steps), "the step is to stay as it is most of the time"
    fine = rows_of([scene(FIXED), "-output_interval", "0", "-sim_dt", "0.005", "-sim_time", "1", "-output_dir", "fixed"])
    assert rows[-1]["kinetic_energy"] == pytest.approx(fine[-1]["kinetic_energy"], rel=accuracy)


def test_times_are_met(rows_of, scene, tmp_path):
    rows = rows_of([scene(LID)])
    times = [row["time"] for row in rows]
    assert times[-1] == 2
    for k in range(1, 7):
        assert min(abs(t - 0.3 * k) for t in times) < 1e-12
    assert len(list((tmp_path / "out").glob("fields_*.h5"))) == 6
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())["quantities"]
    assert summary["rejected_steps"] == rows[-1]["rejected_steps"]
    assert summary["dt_max"] == pytest.approx(max(row["dt"] for row in rows), rel=1e-5)


def test_fixed_steps_meet_times(rows_of, scene, tmp_path):
    """-output_interval without adaptation: 0.05 is no multiple of the step, and no step is shorter than half of it."""
    text = FIXED.replace("interval: 0.3", "interval: 0.05").replace("dt: 0.01, time: 2", "dt: 0.02, time: 0.2")
    rows = rows_of([scene(text)])
    assert [round(row["time"], 12) for row in rows] == [0.02, 0.035, 0.05, 0.07, 0.085, 0.1, 0.12, 0.135, 0.15, 0.17, 0.185, 0.2]
    assert len(list((tmp_path / "out").glob("fields_*.h5"))) == 4


def test_rejected_steps(rows_of, scene):
    """The first step is much too long: steps are taken again, and counted."""
    rows = rows_of([scene(LID), "-sim_dt", "0.4", "-sim_adapt_min", "0.001"])
    assert rows[-1]["rejected_steps"] >= 1
    assert all(b["rejected_steps"] >= a["rejected_steps"] for a, b in zip(rows, rows[1:]))
    assert all(row["step_error"] <= 2e-4 for row in rows[6:])


def test_failed_solves_are_taken_again(rows_of, scene):
    """The solve of the first, long step does not converge within the iterations that it may take; that of a shorter one does."""
    rows = rows_of([scene(LID), "-sim_dt", "0.4", "-sim_adapt_min", "0.001", "-flow_ksp_max_it", "6", "-sim_steps", "12"])
    assert rows[-1]["rejected_steps"] >= 1 and rows[0]["dt"] < 0.2 and len(rows) == 12


def test_fast_recipe_is_stable(rows_of, scene):
    rows = rows_of([scene(LID), "-flow_solver", "fast", "-sim_time", "4", "-output_interval", "0"])
    assert max(row["kinetic_energy"] for row in rows) < 0.02
    assert rows[-1]["time"] == 4


def test_bodies_limit_the_step(rows_of, scene, tmp_path):
    """With the error out of the way: a body moves at most a fifth of a cell in a step, also as it meets another one, on any number of ranks."""
    args = [scene(PAIR), "-sim_adapt_tolerance", "1", "-sim_adapt_displacement", "0.2", "-sim_adapt_min", "1e-6", "-flow_ksp_rtol", "1e-9"]
    rows = rows_of(args)
    with open(tmp_path / "out" / "bodies.csv") as file:
        bodies = list(csv.DictReader(file))
    h = 1 / 12
    last = {}
    met = False
    for row in bodies:
        here = (float(row["x"]), float(row["y"]))
        if row["body"] in last:
            way = ((here[0] - last[row["body"]][0]) ** 2 + (here[1] - last[row["body"]][1]) ** 2) ** 0.5
            assert way <= 0.24 * h, f"step {row['step']}"
        last[row["body"]] = here
        met = met or float(row["gap"]) < h / 2
    assert met and rows[-1]["time"] == 0.12
    two = rows_of([*args, "-output_dir", "two"], 2)
    assert len(two) == len(rows)
    for a, b in zip(rows, two):
        assert b["dt"] == pytest.approx(a["dt"], rel=1e-4) and b["bodies_energy"] == pytest.approx(a["bodies_energy"], rel=1e-4, abs=1e-8)


@pytest.mark.parametrize(
    "args, words",
    [
        (["-flow_time", "fstheta"], ["-flow_time fstheta", "bdf2"]),
        (["-sim_adapt_min", "0.1"], ["-sim_adapt_min 0.1", "-sim_dt 0.01"]),
        (["-sim_adapt_hysteresis", "2"], ["-sim_adapt_hysteresis 2", "-sim_adapt_growth 1.5"]),
        (["-sim_adapt_growth", "3"], ["-sim_adapt_growth", "2.4"]),
    ],
)
def test_refusals(run, scene, args, words):
    result = run([scene(LID), *args, "-output_dir", "out"])
    assert result.status != 0 and result.steps() == 0, str(result)
    assert all(word in result.err for word in words), str(result)


def limits_of(folder):
    """step_limits of a run's summary, by name."""
    return {row["who"]: row for row in json.loads((folder / "summary.json").read_text())["step_limits"]}


FALLING = """\
mesh: {cells: [12, 24], lower: [0, 0], upper: [1, 2]}
flow: {viscosity: 0.1, gravity: [0, -981]}
couple: {method: penalty}
particle: {groups: [a], a: {shape: circle, radius: 0.15, density: 1.5, position: [0.5, 1.2]}}
sim: {dt: 0.002, time: 0.04, adapt: true, adapt_tolerance: 1, adapt_cfl: 0, adapt_gap: 0}
"""


@pytest.mark.parametrize(
    "text, options, who, value",
    [
        (LID, "-sim_adapt_tolerance 1e-4 -sim_time 0.5 -output_interval 0", "error", 1e-4),
        (LID, "-sim_adapt_tolerance 1 -sim_adapt_cfl 0.2 -sim_time 0.5 -output_interval 0", "cfl", 0.2),
        (LID, "-sim_adapt_tolerance 1 -sim_adapt_cfl 0 -sim_adapt_max 0.01 -sim_time 0.2 -output_interval 0", "max", 0.01),
        (FALLING, "-sim_adapt_displacement 0.02", "displacement", 0.02),
    ],
)
def test_the_summary_says_who_limits_the_step(rows_of, scene, tmp_path, text, options, who, value):
    """The same scenes under different limits: the one that binds is named, with its option and its value, by the table at the end and by the column."""
    rows = rows_of([scene(text), *options.split()])
    table = json.loads((tmp_path / "out" / "summary.json").read_text())["step_limits"]
    limits = limits_of(tmp_path / "out")
    assert max(limits, key=lambda name: limits[name]["steps"]) == who
    assert limits[who]["value"] == value and limits[who]["steps"] > len(rows) / 2 and limits[who]["option"].startswith("-sim_adapt_")
    held = [row["dt"] for row in rows if table[int(row["step_limit"])]["who"] == who]
    assert len(held) == limits[who]["steps"] and limits[who]["dt_min"] == pytest.approx(min(held), rel=1e-9)
    assert sum(row["steps"] for row in table) == len(rows)


def test_the_page_says_who_limits_the_step(run, scene):
    page = run([scene(FALLING), "-sim_adapt_displacement", "0.02"]).out
    line = next(line for line in page.splitlines() if "(-sim_adapt_displacement)" in line)
    assert "the displacement of bodies" in line and "length of steps by" in page


def test_refused_steps_have_a_name(rows_of, scene, tmp_path):
    rows = rows_of([scene(LID), "-sim_dt", "0.4", "-sim_adapt_min", "0.001", "-sim_time", "1"])
    limits = limits_of(tmp_path / "out")
    assert limits["error"]["refused"] == rows[-1]["rejected_steps"] >= 1
    rows = rows_of([scene(LID), "-sim_dt", "0.4", "-sim_adapt_min", "0.001", "-flow_ksp_max_it", "6", "-sim_steps", "12", "-output_dir", "solve"])
    assert limits_of(tmp_path / "solve")["solve"]["refused"] >= 1


def test_fixed_steps_have_no_page(run, scene, tmp_path):
    """A length that is given is no news; the file has it all the same, and what fell short of it: the times to meet."""
    result = run([scene(FIXED), "-output_interval", "0.05", "-sim_dt", "0.02", "-sim_time", "0.2", "-output_dir", "out"])
    assert result.status == 0 and "length of steps by" not in result.out
    limits = limits_of(tmp_path / "out")
    assert limits["dt"]["steps"] + limits["time"]["steps"] == 12 and limits["time"]["dt_min"] == pytest.approx(0.015)


def test_counts_go_on_after_a_restart(rows_of, scene, tmp_path):
    once = rows_of([scene(LID), "-sim_time", "0.6", "-output_interval", "0", "-sim_adapt_cfl", "1", "-checkpoint_every", "8", "-sim_steps", "20"])
    whole = limits_of(tmp_path / "out")
    rows_of([scene(LID), "-sim_time", "0.6", "-output_interval", "0", "-sim_adapt_cfl", "1", "-sim_steps", "20", "-output_dir", "out", "-sim_restart", "out/checkpoint_16.h5"])
    again = limits_of(tmp_path / "out")
    assert sum(row["steps"] for row in again.values()) == len(once)
    assert {k: (v["steps"], v["refused"]) for k, v in whole.items()} == {k: (v["steps"], v["refused"]) for k, v in again.items()}


def test_the_guide_shows_what_is_printed(run):
    """The command of "How long steps are" in the guide ends with the table that stands below it."""
    text = (ROOT / "runs" / "guide" / "output.md").read_text().split("## How long steps are")[1]
    command, table = re.search(r"`build/tumble (\S+) ([^`]*)`", text), re.search(r"```\n(.*?)```", text, re.S).group(1)
    page = run([ROOT / command.group(1), *command.group(2).split()]).out
    assert [line.split()[:-2] for line in table.splitlines()] == [line.split()[:-2] for line in page.splitlines() if line.startswith(("  length of steps", "  the error of", "  the displacement of"))]


def test_immersed_solids(rows_of):
    """Fields jump from cell to cell around immersed elastic bodies, whatever the step: no reason for shorter ones (a hundredfold, before)"""
    small = ["-mesh_cells", "12,18", "-particle_soft_count", "4", "-particle_soft_solid_size", "0.15", "-output_every", "0"]
    rows = rows_of([ROOT / "runs" / "soft-suspension.yaml", *small, "-sim_adapt", "true", "-sim_time", "0.2"])
    assert len(rows) <= 12 and min(row["dt"] for row in rows) > 0.01, len(rows)


@pytest.mark.parametrize("preset, cells", [("fast", []), ("balanced", []), ("accurate", ["-mesh_cells", "32,32"])])
def test_drops(rows_of, preset, cells):
    """Presets take steps with drops as they are, and no solver of a single sweep, by which a drop at rest breaks (accurate wants 8 cells a radius)"""
    rows = rows_of([ROOT / "runs" / "drop-static.yaml", "-preset", preset, "-sim_steps", "10", *cells])
    assert len(rows) == 10 and rows[-1]["kinetic_energy"] < 1e-8
