"""Cohesion: what a pair bears in a flow, the speed below which it sticks, ranks and restart, wrong scenes; loads of bonds in a stream and in
a shear flow."""
import csv
import math

import pytest

PULLED = """mesh: {cells: [32, 16], lower: [0, 0], upper: [2, 1]}
flow: {density: 1, viscosity: 0.1}
particle:
  groups: a, b
  a: {shape: circle, radius: 0.2, density: 1, position: [0.795, 0.5]}
  b: {shape: circle, radius: 0.2, density: 1, position: [1.205, 0.5]}
contact: {range: 0.02, cohesion: van_der_waals, cohesion_cutoff: 0.01}
sim: {dt: 0.01, time: 0.4}
output: {every: 0, progress: 1000}
"""
STICKING = """mesh: {cells: [32, 16], lower: [0, 0], upper: [2, 1]}
flow: {density: 1.0e-3, viscosity: 1.0e-5}
particle:
  groups: a, b
  a: {shape: circle, radius: 0.2, density: 1, position: [0.75, 0.5]}
  b: {shape: circle, radius: 0.2, density: 1, position: [1.25, 0.5]}
contact: {law: spring, restitution: 1, range: 0.02, cohesion: bridge, cohesion_tension: 0.1, cohesion_volume: 2.5e-3}
sim: {dt: 0.01, time: 0.4}
output: {every: 0, progress: 1000}
checkpoint: {every: 12}
"""
ALONE = """mesh: {cells: [8, 4, 4], lower: [0, 0, 0], upper: [2, 1, 1]}
flow: {active: false}
particle:
  groups: ball
  ball: {shape: circle, radius: 0.1, density: 1, place: table, table: balls.csv}
contact: {law: spring, restitution: 0.5, range: 1.0e-3, cohesion: jkr, cohesion_surface_energy: 0.5, cohesion_young: 1.82e+4}
sim: {dt: 2.0e-3, steps: 100}
output: {every: 0, progress: 1000}
checkpoint: {every: 50}
"""
STREAM = """mesh: {cells: [48, 16], lower: [0, 0], upper: [6, 2]}
flow:
  density: 1
  viscosity: 0.1
  bc_left: {type: inflow, velocity: [1, 0]}
  bc_right: {type: outflow}
  bc_bottom: {type: moving_wall, velocity: [1, 0]}
  bc_top: {type: moving_wall, velocity: [1, 0]}
particle:
  groups: root, chain
  root: {shape: circle, radius: 0.25, density: 2, position: [1.5, 1], free: none}
  chain: {shape: circle, radius: 0.25, density: 2, place: table, table: chain.csv}
contact: {law: none, bond: {law: parallel, young: 1.0e4}}
sim: {dt: 0.02, time: 0.6}
output: {every: 0, progress: 1000}
"""
ROD = """mesh: {cells: [32, 32], lower: [-3, -3], upper: [3, 3], periodic: [x]}
flow:
  density: 1
  viscosity: 10
  initial: steady
  bc_top: {type: moving_wall, velocity: [3, 0]}
  bc_bottom: {type: moving_wall, velocity: [-3, 0]}
particle:
  groups: rod
  rod: {shape: circle, radius: 0.25, density: 1, place: table, table: rod.csv, angular_velocity: -0.5}
contact: {law: none, bond: {law: spring, stiffness: 1.0e+6, bending: 1.0e+5, tension: 46.6}}
sim: {dt: 0.05, steps: 5}
output: {every: 0, progress: 1000}
"""


def last(folder):
    """Bodies of the last step."""
    rows = list(csv.DictReader(open(folder / "bodies.csv")))
    return [{name: float(text) for name, text in row.items() if name != "group"} for row in rows if row["step"] == rows[-1]["step"]]


@pytest.mark.parametrize("law", ["spring", "repulsive"])
def test_pair_bears_its_pull(run, scene, tmp_path, law):
    """A sqrt(R)/(8 sqrt(2) h^(5/2)) a unit of depth, here 5, with R = .1 and h the cut-off."""
    hamaker = 5 * 8 * math.sqrt(2) * 0.01**2.5 / math.sqrt(0.1)
    gaps = []
    for load in 4.9, 5.6:
        result = run([scene(PULLED), "-output_dir", str(load), "-contact_law", law, "-contact_cohesion_hamaker", str(hamaker),
                      "-particle_a_force", f" {-load},0", "-particle_b_force", f"{load},0"])
        assert result.status == 0, str(result)
        bodies = last(tmp_path / str(load))
        assert bodies[0]["contact_force_x"] == pytest.approx(-bodies[1]["contact_force_x"], rel=1e-9)
        gaps.append((bodies[1]["x"] - bodies[0]["x"] - 0.4, bodies[1]["u"] - bodies[0]["u"], bodies[0]["contact_force_x"]))
    assert gaps[0][0] < 0.02 and gaps[0][2] == pytest.approx(4.9, rel=0.01), gaps
    assert gaps[1][1] > 2 * abs(gaps[0][1]) and gaps[1][0] > gaps[0][0] + 5e-4, gaps


def test_sticking_speed_in_a_flow(run, scene, tmp_path):
    """A bridge forms where surfaces touch and breaks farther out: m v^2 for two discs is what it takes, 4 T (b(0) - b(rupture)), with b of the
    volume 2 b s + b^3/(3 R)."""
    width = 0.0245  # 2 b .05 + b^3/.3 = 2.5e-3
    for _ in range(20):
        width -= (0.1 * width + width**3 / 0.3 - 2.5e-3) / (0.1 + width**2 / 0.1)
    work = 0.4 * ((0.3 * 2.5e-3) ** (1 / 3) - width)
    mass = math.pi * 0.04 * (1 + 1e-3)
    v = math.sqrt(work / mass)
    for factor, sticks in (0.97, True), (1.03, False):
        result = run([scene(STICKING), "-output_dir", str(factor), "-particle_a_velocity", f"{factor * v},0", "-particle_b_velocity", f" {-factor * v},0"])
        assert result.status == 0, str(result)
        rows = list(csv.DictReader(open(tmp_path / str(factor) / "bodies.csv")))
        gaps = [float(b["x"]) - float(a["x"]) - 0.4 for a, b in zip(rows[::2], rows[1::2])]
        assert min(gaps) < 0.02
        assert (max(gaps[gaps.index(min(gaps)):]) < 0.0705) == sticks, gaps[-10:]
    again = run([scene(STICKING), "-output_dir", "again", "-particle_a_velocity", f"{0.97 * v},0", "-particle_b_velocity", f" {-0.97 * v},0",
                 "-sim_restart", str(next((tmp_path / "0.97").glob("**/*36*.h5"))), "-checkpoint_every", "0"])
    assert again.status == 0, str(again)
    assert (tmp_path / "again/bodies.csv").read_text().splitlines()[-2 * 4:] == (tmp_path / "0.97/bodies.csv").read_text().splitlines()[-2 * 4:]


def test_ranks_and_restart(run, scene, tmp_path):
    lines = [f"{0.3 + 0.202 * i},{0.5 + 0.03 * (i % 2)},0.5,{1.5 - 0.5 * i},0,{0.2 * (i % 3)}" for i in range(6)]
    (tmp_path / "balls.csv").write_text("x,y,z,u,v,w\n" + "\n".join(lines) + "\n")
    for ranks in 1, 2, 3:
        result = run([scene(ALONE), "-output_dir", str(ranks)], ranks)
        assert result.status == 0, str(result)
    tables = [(tmp_path / str(ranks) / "bodies.csv").read_bytes() for ranks in (1, 2, 3)]
    assert tables[0] == tables[1] == tables[2]
    again = run([scene(ALONE), "-output_dir", "again", "-sim_restart", str(next((tmp_path / "3").glob("**/*50*.h5"))), "-checkpoint_every", "0"], 2)
    assert again.status == 0, str(again)
    assert (tmp_path / "again/bodies.csv").read_text().splitlines()[-6 * 50:] == tables[0].decode().splitlines()[-6 * 50:]
    bodies = last(tmp_path / "1")
    for axis, before in ("u", sum(1.5 - 0.5 * i for i in range(6))), ("v", 0), ("w", 0.2 * 6):
        assert sum(body[axis] for body in bodies) == pytest.approx(before, abs=1e-12)
    assert bodies[0]["contact_force_x"] != 0  # they hold on


@pytest.mark.parametrize("options, words", [
    (["-contact_law", "none"], ["-contact_cohesion van_der_waals", "-contact_law"]),
    (["-contact_cohesion", "jkr"], ["-contact_law spring"]),
    (["-contact_law", "spring", "-contact_cohesion", "dmt"], ["in space"]),
    (["-contact_cohesion_hamaker", "-1"], ["-contact_cohesion_hamaker"]),
    (["-contact_coupling", "explicit"], ["-contact_coupling explicit"]),
    (["-couple_type", "explicit", "-contact_law", "spring"], ["-contact_cohesion", "-couple_type explicit"]),
    (["-contact_law", "spring", "-contact_spring_stiffness", "1"], ["raise the stiffness"]),
])
def test_mistakes(run, scene, options, words):
    given = [] if "-contact_cohesion_hamaker" in options else ["-contact_cohesion_hamaker", "1e-3"]
    result = run([scene(PULLED), *given, *options, "-scene_dry_run"])
    assert result.status != 0 and "tumble: error" in str(result)
    assert all(word in str(result) for word in words), str(result)


def test_chain_in_a_stream_bears_the_drags(run, scene, tmp_path):
    (tmp_path / "chain.csv").write_text("x,y\n2,1\n2.5,1\n3,1\n")
    result = run([scene(STREAM), "-output_dir", "o"])
    assert result.status == 0, str(result)
    bodies = last(tmp_path / "o")
    drags = [body["force_x"] for body in bodies[1:]]
    assert min(drags) > 0.5
    assert bodies[0]["contact_force_x"] == pytest.approx(sum(drags), rel=1e-3)
    assert sum(body["contact_force_x"] for body in bodies) == pytest.approx(0, abs=1e-9)


def test_rod_in_shear_breaks_in_its_middle(run, scene, tmp_path):
    places = [0.5 * (k - 2.5) * math.sqrt(0.5) for k in range(6)]
    (tmp_path / "rod.csv").write_text("x,y,u,v\n" + "".join(f"{r},{r},{0.5 * r},{-0.5 * r}\n" for r in places))
    result = run([scene(ROD), "-output_dir", "o"])
    assert result.status == 0, str(result)
    broken = [row for row in csv.DictReader(open(tmp_path / "o/bonds.csv")) if row["event"] != "start"]
    assert [(row["event"], row["body"], row["partner"]) for row in broken] == [("tension", "2", "3")], broken
