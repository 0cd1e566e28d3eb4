"""Bonds between bodies: beams of spheres against Timoshenko's, momentum and energy, breaking, ranks and restart."""
import csv
import math
import random

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
RADIUS, MASS = 0.5, math.pi / 6
INERTIA = 0.4 * MASS * RADIUS**2


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
