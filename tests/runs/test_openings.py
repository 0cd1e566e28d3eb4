"""A pressure at openings (-flow_bc_<boundary>_type pressure): exact flows, the same as with a uniform force, balances, messages."""
import csv

import numpy as np
import pytest
from test_meshfile import channel

STEADY = """\
mesh: {cells: [4, 3], upper: [2, 1]}
flow:
  density: 1
  viscosity: 0.1
  bc_left: {type: pressure, pressure: 1}
  bc_right: {type: pressure, pressure: -0.6}
sim: {steady: true}
"""


def rows_of(result, folder="out"):
    assert result.status == 0, str(result)
    with open(result.folder / folder / "series.csv") as file:
        return [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]


def expect_poiseuille(row):
    """Pressure gradient -0.8, mean velocity 0.8/(12 mu), 0.8 on each wall for a width of 1; 0.4 up and down by the pressure, whose mean is 0.2."""
    assert row["mean_velocity_x"] == pytest.approx(2 / 3, rel=1e-8)
    assert row["flow_rate_left"] == pytest.approx(-2 / 3, rel=1e-8) and row["flow_rate_right"] == pytest.approx(2 / 3, rel=1e-8)
    for wall, sign in (("bottom", -1), ("top", 1)):
        assert row[f"wall_force_{wall}_x"] == pytest.approx(0.8, rel=1e-7)
        assert row[f"wall_force_{wall}_y"] == pytest.approx(0.4 * sign, rel=1e-7)
    assert row["momentum_error"] < 1e-8


@pytest.mark.parametrize("ranks", [1, 2, 3])
def test_plane(run, scene, ranks):
    expect_poiseuille(rows_of(run([scene(STEADY), "-output_dir", "out"], ranks))[-1])


def test_space(run, scene):
    text = STEADY.replace("[4, 3], upper: [2, 1]", "[3, 2, 3], upper: [2, 1, 1], periodic: z")
    expect_poiseuille(rows_of(run([scene(text), "-output_dir", "out"], 2))[-1])


def test_refined(run, scene):
    """Cells of two sizes on an opening."""
    text = STEADY.replace("[2, 1]}", "[2, 1], levels: 1, refine: part, box_part_corners: [0, 0, 0.4, 0.4]}")
    expect_poiseuille(rows_of(run([scene(text), "-output_dir", "out"]))[-1])


def test_inclined(run, scene, tmp_path):
    """A channel of a mesh file, turned by 0.7, pressures by place: a potential force along it is nothing but pressure."""
    turn, g = 0.7, 0.3
    channel(tmp_path / "channel.msh", {1: "left", 2: "right", 3: "walls", 4: "walls"}, n=(4, 3), turn=turn)
    c, s = float(np.cos(turn)), float(np.sin(turn))
    slope = f"{g * c:.17g}*x+{g * s:.17g}*y"
    text = STEADY.replace("cells: [4, 3], upper: [2, 1]", "kind: file, file: channel.msh").replace("pressure: 1}", f'pressure: "1+{slope}"}}')
    text = text.replace("pressure: -0.6}", f'pressure: "-0.6+{slope}"}}').replace("viscosity: 0.1", f"viscosity: 0.1\n  force: [{g * c!r}, {g * s!r}]")
    row = rows_of(run([scene(text), "-output_dir", "out"], 2))[-1]
    assert row["mean_velocity_x"] == pytest.approx(2 / 3 * c, rel=1e-8) and row["mean_velocity_y"] == pytest.approx(2 / 3 * s, rel=1e-8)
    assert row["wall_force_walls_x"] == pytest.approx(1.6 * c, rel=1e-6) and row["momentum_error"] < 1e-8


@pytest.mark.parametrize("scheme", ["cn", "bdf2", "fstheta"])
def test_changes_in_time(run, scene, scheme):
    """A difference of pressure p(t) over a length of 2 is a force p(t)/2 in a periodic channel, in every step of every scheme."""
    common = "flow: {density: 1, viscosity: 0.1, time: " + scheme + ", solver: direct, KEYS}\nsim: {dt: 0.1, steps: 6}\n"
    pressed = common.replace("KEYS", 'bc_left: {type: pressure, pressure: "cos(3*t)+y-y"}, bc_right: {type: pressure, pressure: -0.6, factor: [0, 1, 2]}')
    pushed = common.replace("KEYS", 'force: ["(cos(3*t)+0.6*sin(pi*t))/2", 0]')
    one = rows_of(run([scene("mesh: {cells: [4, 3], upper: [2, 1]}\n" + pressed, "one.yaml"), "-output_dir", "one"]), "one")
    two = rows_of(run([scene("mesh: {cells: [4, 3], upper: [2, 1], periodic: x}\n" + pushed, "two.yaml"), "-output_dir", "two"]), "two")
    assert len(one) == len(two) == 6 and max(abs(row["mean_velocity_x"]) for row in two) > 0.1
    for a, b in zip(one, two):
        assert a["mean_velocity_x"] == pytest.approx(b["mean_velocity_x"], abs=1e-9), (a, b)
        assert a["momentum_error"] < 1e-7


def test_body_in_the_way(run, scene):
    """Balances with a body: what the pressures do at the openings is what walls and body take, and the change of the flow."""
    text = STEADY.replace("[4, 3]", "[16, 8]").replace("sim: {steady: true}", "sim: {dt: 0.05, steps: 10}")
    text += "particle: {groups: disc, disc: {shape: circle, radius: 0.2, density: 2, position: [0.8, 0.45]}}\n"
    for row in rows_of(run([scene(text), "-output_dir", "out"], 2)):
        assert row["momentum_error"] < 1e-3, row
    assert row["mean_velocity_x"] > 0.1


def test_messages(run, scene):
    result = run([scene(STEADY.replace("pressure, pressure: 1", "pressure"))], 2)
    assert result.status != 0 and result.text.count("give the pressure outside with -flow_bc_left_pressure") == 1, str(result)
    result = run([scene(STEADY.replace("pressure: 1", 'pressure: "1+t"'))], 2)
    assert result.status != 0 and result.text.count("(-flow_bc_left_pressure 1+t) and has no steady state") == 1, str(result)
