"""Bonds: beams of spheres against Timoshenko's, momentum and energy, walls, files, contact, breaking, ranks and restart."""
import csv
import math
import random

import h5py
import numpy as np
import pytest

CHAIN = """mesh: {cells: [8, 4, 4], lower: [-1, -2, -2], upper: [12, 2, 2]}
flow: {active: false, gravity: [0, 0, -1.0e-4]}
particle:
  groups: root, chain
  root: {shape: circle, radius: 0.5, density: 1, position: [0, 0, 0], free: none}
  chain: {shape: circle, radius: 0.5, density: 1, place: table, table: chain.csv}
contact: {law: none, bond: {law: parallel, young: 1.0e6, ratio: 2.5}}
sim: {dt: 0.01, time: 10}
output: {progress: 1000}
"""
CLUSTER = """mesh: {cells: [8, 8, 8], lower: [-8, -8, -8], upper: [8, 8, 8]}
flow: {active: false}
particle:
  groups: chain
  chain: {shape: circle, radius: 0.5, density: 1, place: table, table: cluster.csv}
contact: {law: none, bond: {law: parallel, young: 1.0e4, ratio: 2}}
sim: {dt: 0.01, steps: 100}
output: {progress: 1000}
checkpoint: {every: 50}
"""
HANGING = """mesh: {cells: [4, 4], lower: [0, 0], upper: [2, 2]}
flow: {active: false, gravity: [0, -1]}
particle:
  groups: disc
  disc: {shape: circle, radius: 0.25, density: 2, position: [1, 1.748]}
contact: {law: none, bond: {law: spring, stiffness: 1000, bending: 1, damping: 10, walls: true}}
sim: {dt: 0.01, time: 0.3}
output: {progress: 1000}
"""
MEETING = """mesh: {cells: [4, 4], lower: [-2, -2], upper: [2, 2]}
flow: {active: false}
particle:
  groups: disc
  disc: {shape: circle, radius: 0.25, density: 2, place: table, table: discs.csv}
contact: {law: spring, bond: {law: spring, stiffness: 1000, bending: 10}}
sim: {dt: 0.005, time: 1}
output: {progress: 1000}
"""
FLOATING = """mesh: {cells: [16, 16], lower: [0, 0], upper: [1, 1]}
flow: {density: 1, viscosity: 0.1, gravity: [0, -10]}
particle:
  groups: disc
  disc: {shape: circle, radius: 0.15, density: 2, position: [0.5, 0.849]}
contact: {law: spring, bond: {law: spring, stiffness: 1000, bending: 1, walls: true, damping: 1}}
sim: {dt: 0.01, time: 0.6}
output: {progress: 1000}
checkpoint: {every: 20}
"""
RADIUS, MASS = 0.5, math.pi / 6
INERTIA = 0.4 * MASS * RADIUS**2
WEIGHT = 2 * math.pi * 0.25**2  # of the disc that hangs


@pytest.fixture
def chain(tmp_path):
    (tmp_path / "chain.csv").write_text("x,y,z\n" + "".join(f"{i},0,0\n" for i in range(1, 10)))


@pytest.fixture
def cluster(tmp_path):
    draw = random.Random(3)
    lines = ["%g,%g,%g," % at + ",".join("%g" % draw.uniform(-1, 1) for _ in range(3)) for at in ((0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1), (2, 1, 1), (2, 2, 1))]
    (tmp_path / "cluster.csv").write_text("x,y,z,u,v,w\n" + "\n".join(lines) + "\n")


def table(path, body=None):
    rows = [row for row in csv.DictReader(open(path)) if body is None or row["body"] == str(body)]
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0] if name not in ("group", "name")}


def beam(young=1e6, ratio=2.5):
    """Bending and shear stiffness of the beam that the bonds are."""
    return young * math.pi * RADIUS**4 / 4, young / ratio * math.pi * RADIUS**2


def frequency_of_beam(length, cells=120):
    """Lowest circular frequency of a cantilever of Timoshenko's with the masses of nine spheres: linear elements, one point of integration."""
    EI, GA = beam()
    h, n = length / cells, 2 * (cells + 1)
    K, M = np.zeros((n, n)), np.zeros((n, n))
    for e in range(cells):
        at = slice(2 * e, 2 * e + 4)
        shear, bend = np.array([-1 / h, -0.5, 1 / h, -0.5]), np.array([0, -1 / h, 0, 1 / h])
        K[at, at] += h * (GA * np.outer(shear, shear) + EI * np.outer(bend, bend))
        for node in (e, e + 1):
            M[2 * node, 2 * node] += 0.5 * h * MASS
            M[2 * node + 1, 2 * node + 1] += 0.5 * h * INERTIA
    M[-2, -2] += 0.5 * MASS  # the half of the last sphere beyond the beam
    M[-1, -1] += 0.5 * INERTIA
    return math.sqrt(min(np.linalg.eigvals(np.linalg.solve(M[2:, 2:], K[2:, 2:])).real))


def test_cantilever_bends_as_a_beam(run, scene, chain, tmp_path):
    result = run([scene(CHAIN), "-output_dir", "out", "-contact_bond_damping", "1"])
    assert result.status == 0, str(result)
    EI, GA = beam()
    deflection = 1e-4 * MASS * sum(i**2 * (27 - i) / (6 * EI) + i / GA for i in range(1, 10))
    tip = table(tmp_path / "out/bodies.csv", 9)["z"][-1]
    assert tip == pytest.approx(-deflection, rel=0.01), (tip, deflection)


def test_cantilever_swings_as_a_beam(run, scene, chain, tmp_path):
    result = run([scene(CHAIN), "-output_dir", "out", "-sim_dt", "4e-4", "-sim_time", "1.1"])
    assert result.status == 0, str(result)
    tip = table(tmp_path / "out/bodies.csv", 9)
    z, t = tip["z"] - 0.5 * (tip["z"].min() + tip["z"].max()), tip["time"]
    cross = [t[i] - z[i] * (t[i + 1] - t[i]) / (z[i + 1] - z[i]) for i in range(len(t) - 1) if z[i] * z[i + 1] < 0]
    period = 2 * (cross[-1] - cross[0]) / (len(cross) - 1)
    assert len(cross) >= 4 and period == pytest.approx(2 * math.pi / frequency_of_beam(9), rel=0.01), period


def momenta(folder, row):
    total = np.zeros(6)
    for k in range(6):
        b = table(folder / "bodies.csv", k)
        x, u, w = (np.array([b[name][row] for name in names]) for names in (("x", "y", "z"), ("u", "v", "w"), ("omega_x", "omega_y", "omega_z")))
        total += np.concatenate([MASS * u, MASS * np.cross(x, u) + INERTIA * w])
    return total


@pytest.mark.parametrize("young", [1e2, 1e4, 7e9])
def test_cluster_keeps_momenta_and_closes_its_books(run, scene, cluster, tmp_path, young):
    """Six spheres thrown in all directions; the last is 1e6 stiffer than a step sees."""
    result = run([scene(CLUSTER), "-output_dir", "out", "-contact_bond_young", str(young)])
    assert result.status == 0, str(result)
    series = table(tmp_path / "out/series.csv")
    assert np.abs(momenta(tmp_path / "out", -1) - momenta(tmp_path / "out", 0)).max() < 1e-11
    start = 0.5 * MASS * sum(float(v) ** 2 for line in open(tmp_path / "cluster.csv").readlines()[1:] for v in line.split(",")[3:])
    assert series["bodies_energy"] - series["contact_work"] == pytest.approx(start, rel=1e-7)
    lost = -(series["contact_energy"] + series["contact_work"])
    assert lost.min() > -0.05 * start and (young > 1e3 or abs(lost[-1]) < 0.01 * start), lost


def test_ranks_and_restart(run, scene, cluster, tmp_path):
    for ranks in 1, 2, 3:
        result = run([scene(CLUSTER), "-output_dir", str(ranks), "-contact_bond_tension", "600"], ranks)
        assert result.status == 0, str(result)
    tables = [(tmp_path / str(ranks) / "bodies.csv").read_bytes() for ranks in (1, 2, 3)]
    assert tables[0] == tables[1] == tables[2]
    again = run([scene(CLUSTER), "-output_dir", "again", "-contact_bond_tension", "600", "-sim_restart", str(next((tmp_path / "3").glob("**/*50*.h5"))),
                 "-checkpoint_every", "0"], 2)
    assert again.status == 0, str(again)
    assert (tmp_path / "again/bodies.csv").read_text().splitlines()[-6 * 50:] == tables[0].decode().splitlines()[-6 * 50:]


def lines(folder, step):
    with h5py.File(folder / f"bonds_{step}.h5") as file:
        return {name: values[:].squeeze() for name, values in file.items()}


def test_bonds_are_lines(run, scene, cluster, tmp_path):
    """Their ends are centres, their load that of the contact; aggregates by their lowest body; the same on any number of ranks and after a restart."""
    arguments = [scene(CLUSTER), "-output_every", "50", "-contact_bond_tension", "30"]
    for ranks, name, more in ((1, "1", []), (3, "3", []), (2, "3", ["-output_overwrite", "-sim_restart", "1/checkpoint_50.h5"])):
        result = run([*arguments, "-output_dir", name, *more], ranks)
        assert result.status == 0, str(result)
        for step in 50, 100:
            assert all(np.array_equal(lines(tmp_path / name, step)[key], value) for key, value in lines(tmp_path / "1", step).items()), (ranks, step)
        text = (tmp_path / name / "bonds.xdmf").read_text()
        assert [f"bonds_{step}.h5:/{key}" in text for step in (50, 100) for key in ("end", "line", "tension", "aggregate")] == [True] * 8
    bonds, bodies = lines(tmp_path / "1", 50), h5py.File(tmp_path / "1/bodies_50.h5")
    for side, body in enumerate((bonds["body"], bonds["partner"])):
        assert bonds["end"][side::2] == pytest.approx(bodies["position"][:][body], abs=1e-14)
    aggregate = bodies["aggregate"][:].squeeze()
    broken = [(int(event[1]), int(event[2])) for event in events(tmp_path / "1") if event[0] == "tension" and event[3] <= 0.5]
    kept = {(i, j) for i, j in zip(bonds["body"], bonds["partner"])}
    assert broken and kept | set(broken) == {(i, i + 1) for i in range(5)}, (broken, kept)
    number = [-1] * 6
    for i, j in sorted(kept):
        number[i] = i if number[i] < 0 else number[i]
        number[j] = number[i]
    assert list(aggregate) == number and np.array_equal(bonds["aggregate"], aggregate[bonds["body"]])
    assert bonds["energy"].sum() == pytest.approx(table(tmp_path / "1/series.csv")["bond_energy"][49], rel=1e-12)


def events(folder):
    return [(row["event"], row["body"], row["partner"], float(row["time"]), float(row["tension"])) for row in csv.DictReader(open(folder / "bonds.csv"))]


def test_disc_hangs_on_a_wall_by_its_weight(run, scene, tmp_path):
    result = run([scene(HANGING), "-output_dir", "out", "-contact_bond_damping", "1", "-sim_time", "2"])
    assert result.status == 0, str(result)
    disc, series = table(tmp_path / "out/bodies.csv"), table(tmp_path / "out/series.csv")
    assert disc["contact_force_y"][-1] == pytest.approx(WEIGHT, rel=1e-6)
    assert disc["y"][-1] == pytest.approx(1.748 - WEIGHT / 1000, abs=1e-9)
    assert series["bond_energy"][-1] == pytest.approx(WEIGHT**2 / 2000, rel=1e-4)
    assert (series["bonds"][-1], series["bonds_broken"][-1]) == (1, 0)
    assert events(tmp_path / "out") == [("start", "0", "top", 0, 0)]


@pytest.mark.parametrize(
    ("position", "cause", "limit"),
    [([1, 1.748], "tension", WEIGHT), ([1.748, 1], "shear", WEIGHT), ([1.748, 1], "moment", WEIGHT * 0.251), ([1, 1.748], "energy", WEIGHT**2 / 2000)],
)
def test_bond_breaks_at_its_strength(run, scene, tmp_path, position, cause, limit):
    """A disc held by the ceiling or by the side wall: the bond breaks where it is 3 % weaker than the load, and holds where it is 5 % stronger."""
    text = HANGING.replace("[1, 1.748]", str(position))
    stiff = ["-contact_bond_bending", "1000", "-sim_dt", "0.002"] if cause != "tension" else []
    damping = ["-contact_bond_damping", "1", "-sim_time", "0.5"] if cause == "energy" else []
    for factor, holds in ((0.97, False), (1.05, True)):
        result = run([scene(text), "-output_dir", str(factor), f"-contact_bond_{cause}", str(factor * limit), *stiff, *damping])
        assert result.status == 0, str(result)
        assert [event[0] for event in events(tmp_path / str(factor))] == (["start"] if holds else ["start", cause])


def test_bond_breaks_by_age(run, scene, tmp_path):
    result = run([scene(HANGING), "-output_dir", "out", "-contact_bond_lifetime", "0.105"])
    assert result.status == 0, str(result)
    assert [event[:4] for event in events(tmp_path / "out")][1:] == [("time", "0", "top", 0.11)]


@pytest.mark.parametrize("name", ["bonds.csv", "aggregates.csv"])
def test_full_disk_is_told(run, scene, tmp_path, name):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / name).symlink_to("/dev/full")
    result = run([scene(HANGING), "-output_dir", "out", "-output_overwrite"])
    assert result.status == 1 and f"Cannot write 'out/{name}': No space left on device" in result.text, result


def test_discs_that_meet_stick(run, scene, tmp_path):
    """Momentum and angular momentum are those of before; the slow ones alone stick where that is asked for."""
    (tmp_path / "discs.csv").write_text("x,y,u,v\n-.5,0,1,0\n.5,.1,-.5,0\n")
    for forms, more, bonds in (("contact", [], 1), ("slow", ["-contact_bond_speed", "3"], 1), ("slow", ["-contact_bond_speed", "0.1"], 0)):
        result = run([scene(MEETING), "-output_dir", "out", "-output_overwrite", "-contact_bond_forms", forms, *more])
        assert result.status == 0, str(result)
        assert [event[:3] for event in events(tmp_path / "out")] == [("contact", "0", "1")] * bonds
        b = [table(tmp_path / "out/bodies.csv", k) for k in (0, 1)]
        spin = [sum(WEIGHT * (d["x"][t] * d["v"][t] - d["y"][t] * d["u"][t] + d["omega_z"][t] * 0.25**2 / 2) for d in b) for t in (0, -1)]
        assert sum(WEIGHT * d["u"][-1] for d in b) == pytest.approx(0.5 * WEIGHT, rel=1e-9)
        assert spin[1] == pytest.approx(0.05 * WEIGHT, rel=1e-9), spin
        apart = math.hypot(b[0]["x"][-1] - b[1]["x"][-1], b[0]["y"][-1] - b[1]["y"][-1])
        assert (apart < 0.75) == bool(bonds), apart


def test_pairs_of_a_file(run, scene, tmp_path):
    (tmp_path / "discs.csv").write_text("x,y\n-.75,0\n-.25,0\n.25,0\n.75,0\n")
    pairs = tmp_path / "pairs.txt"
    arguments = [scene(MEETING.replace("law: spring, bond", "law: none, bond")), "-output_dir", "out", "-contact_bond_file", "pairs.txt", "-sim_steps", "2"]
    for text, words in (
        ("0 1\n1 0\n", ["-contact_bond_file pairs.txt has the pair 0 1 twice"]),
        ("# none\n", ["-contact_bond_file pairs.txt has no pairs"]),
        ("0 1\n0 2\n", ["2 pairs, of which 1 touch", "-contact_bond_gap"]),
        ("0 1\n3 4\n", ["pairs.txt:2", "0 to 3"]),
    ):
        pairs.write_text(text)
        result = run(arguments)
        assert result.status and all(word in result.text for word in words), str(result)
    pairs.write_text("# two\n1 0\n2, 3\n")
    result = run([*arguments, "-output_overwrite"])
    assert result.status == 0, str(result)
    assert [event[:3] for event in events(tmp_path / "out")] == [("start", "0", "1"), ("start", "2", "3")]
    row = {name: value[-1] for name, value in table(tmp_path / "out/aggregates.csv").items()}
    want = {"bonds": 2, "aggregates": 2, "single": 0, "mean_size": 2, "largest": 2, "radius_of_gyration": 0.25, "coordination": 1}
    assert {name: row[name] for name in want} == pytest.approx(want)


def test_disc_hangs_in_a_fluid_and_keeps_its_bond_on_restart(run, scene, tmp_path):
    result = run([scene(FLOATING), "-output_dir", "out"])
    assert result.status == 0, str(result)
    weight = 10 * math.pi * 0.15**2
    assert table(tmp_path / "out/bodies.csv")["contact_force_y"][-1] == pytest.approx(weight, rel=0.01)
    restart = [scene(FLOATING), "-output_dir", "again", "-output_overwrite", "-sim_restart", "out/checkpoint_40.h5", "-checkpoint_every", "0"]
    again = run(restart)
    assert again.status == 0, str(again)
    assert (tmp_path / "again/bodies.csv").read_text().splitlines()[-20:] == (tmp_path / "out/bodies.csv").read_text().splitlines()[-20:]
    lost = run([*restart, "-contact_bond_law", "none"])
    assert lost.status and "has 1 bonds" in lost.text and "give -contact_bond_law" in lost.text, str(lost)


MANY = """mesh: {cells: [4, 4], lower: [-1, 0], upper: [60, 60]}
flow: {active: false, gravity: [1, -1]}
particle:
  groups: disc
  disc: {shape: circle, radius: 0.5, density: 1, place: table, table: discs.csv}
contact: {law: none, bond: {law: parallel, young: %g, walls: true, gap: 1.0e-6, tension: 400}}
sim: {dt: 0.01, steps: 6}
output: {progress: 1000, bodies: [0, 50]}
checkpoint: {every: 3}
"""


def test_many_bonds_on_any_ranks(run, scene, tmp_path):
    """A block of 2116 discs on the floor, beyond what is factorised: the same bits on 1, 2, 3 ranks and after a restart."""
    n = 46
    (tmp_path / "discs.csv").write_text("x,y\n" + "".join(f"{i},{j + 0.5}\n" for j in range(n) for i in range(n)))
    for ranks in 1, 2, 3:
        result = run([scene(MANY % 1e4), "-output_dir", str(ranks)], ranks)
        assert result.status == 0, str(result)
    tables = [(tmp_path / str(ranks) / "bodies.csv").read_text() for ranks in (1, 2, 3)]
    assert tables[0] == tables[1] == tables[2]
    again = run([scene(MANY % 1e4), "-output_dir", "again", "-sim_restart", "3/checkpoint_3.h5", "-checkpoint_every", "0"], 2)
    assert again.status == 0, str(again)
    assert (tmp_path / "again/bodies.csv").read_text().splitlines()[-153:] == tables[0].splitlines()[-153:]
    series = table(tmp_path / "1/series.csv")
    assert series["bonds"][-1] == 2 * n * (n - 1) + n
