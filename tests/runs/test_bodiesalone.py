"""Bodies without a flow: the bed, what happens at the faces of the domain, and starts that are refused."""
import csv
import json
import sys

import h5py
import pytest

from conftest import ROOT

BOX = """mesh: {cells: [4, 4], lower: [0, 0], upper: [1, 1]%s}
flow: {active: false, gravity: [0, %g]}
particle:
  groups: a, b
  a: {shape: circle, radius: 0.05, density: 1, position: [%g, 0.5], velocity: [%g, 0]}
  b: {shape: circle, radius: 0.05, density: 1, position: [0.5, 0.2]}
sim: {dt: 0.01, steps: 60}
"""


def box(periodic="", gravity=0, x=0.5, speed=0):
    return BOX % (periodic, gravity, x, speed)


def summary(folder):
    return json.loads((folder / "summary.json").read_text())["quantities"]


def rows(folder, body):
    with open(folder / "bodies.csv") as file:
        return [row for row in csv.DictReader(file) if row["body"] == str(body)]


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_body_falls_and_rests(run, scene, ranks, tmp_path):
    result = run([scene(box(gravity=-10)), "-output_dir", "fall", "-sim_steps", "400"], ranks)
    assert result.status == 0, str(result)
    quantities = summary(tmp_path / "fall")
    last = rows(tmp_path / "fall", 1)[-1]
    assert quantities["overlap_max"] < 0.01, quantities
    assert 0.05 < float(last["y"]) < 0.06 and abs(float(last["v"])) < 0.01, last


CROWD = """mesh: {cells: [8, 4], lower: [0, 0], upper: [2, 1], periodic: x}
flow: {active: false, gravity: [3, -5]}
particle:
  groups: small, spread, rod, wheel, rock
  small: {shape: circle, radius: 0.025, density: 2, place: lattice, count: 60, velocity: [1, 0], lower: [0, 0.5], upper: [2, 1]}
  spread: {shape: circle, radius: 0.03, density: 1.5, place: random, count: 20, lower: [0, 0.3], upper: [2, 0.5], sizes: uniform, sizes_range: [0.5, 1.3]}
  rod: {shape: ellipse, a: 0.04, b: 0.02, density: 3, place: random, count: 6, lower: [0, 0.3], upper: [2, 0.5], angle: 0.4}
  wheel: {shape: ellipse, a: 0.1, b: 0.02, density: 1, position: [0.6, 0.15], free: rotation, angular_velocity: 8}
  rock: {shape: circle, radius: 0.21, position: [1.5, 0.1], obstacle: true}
contact: {range: 0.01}
sim: {dt: 2e-3, steps: 40}
output: {progress: 20, bodies: [0, 87], every: 40}
checkpoint: {every: 20}
"""


def test_crowd_on_any_ranks(run, scene, tmp_path):
    """Bodies that cross the borders of parts and of the period, a rock larger than a part, sizes, stops: bit for bit the same, and after a restart on others."""
    for ranks in 1, 2, 3:
        result = run([scene(CROWD), "-output_dir", str(ranks)], ranks)
        assert result.status == 0, str(result)
    tables = [(tmp_path / str(ranks) / "bodies.csv").read_bytes() for ranks in (1, 2, 3)]
    assert tables[0] == tables[1] == tables[2]
    columns = [[{name: row[name] for name in ("bodies_energy", "contact_energy", "contact_work")} for row in csv.DictReader(open(tmp_path / str(ranks) / "series.csv"))]
               for ranks in (1, 2, 3)]
    assert len(columns[0]) == 40 and columns[0] == columns[1] == columns[2]
    again = run([scene(CROWD), "-output_dir", "again", "-sim_restart", str(next((tmp_path / "3").glob("**/*20*.h5"))), "-checkpoint_every", "0"], 2)
    assert again.status == 0, str(again)
    end = lambda table: table.decode().splitlines()[-88 * 20:]
    assert end((tmp_path / "again" / "bodies.csv").read_bytes()) == end(tables[0])


FRICTION = """mesh: {cells: [8, 4], lower: [0, 0], upper: [2, 1], periodic: x}
flow: {active: false, gravity: [3, -5]}
particle:
  groups: low, high, rod, rock
  low: {shape: circle, radius: 0.0125, density: 2, place: lattice, count: 190, velocity: [2, 4], lower: [0, 0.5], upper: [2, 0.7]}
  high: {shape: circle, radius: 0.0125, density: 1, place: lattice, count: 190, velocity: [-2, -4], lower: [0, 0.7], upper: [2, 0.9]}
  rod: {shape: ellipse, a: 0.03, b: 0.015, density: 3, place: random, count: 30, velocity: [0, 2], lower: [0, 0.4], upper: [2, 0.5], angle: 0.4}
  rock: {shape: circle, radius: 0.21, position: [1.5, 0.1], obstacle: true}
contact: {range: 0.006, law: spring, friction: 0.5}
sim: {dt: 5e-4, steps: 30}
output: {progress: 30, bodies: [0, 410], every: 0}
checkpoint: {every: 15}
"""


def test_friction_on_any_ranks(run, scene, tmp_path):
    """Tangential springs go with their bodies from rank to rank, and through a checkpoint to another number of ranks: bit for bit the same."""
    for ranks in 1, 2, 3, 5:
        result = run([scene(FRICTION), "-output_dir", str(ranks)], ranks)
        assert result.status == 0, str(result)
    again = run([scene(FRICTION), "-output_dir", "again", "-sim_restart", str(next((tmp_path / "5").glob("**/*15*.h5"))), "-checkpoint_every", "0"], 2)
    assert again.status == 0, str(again)
    with h5py.File(next((tmp_path / "5").glob("**/*15*.h5"))) as file:
        assert (file["contact/slips"][:] != 0).sum() > 30
    tables = [(tmp_path / name / "bodies.csv").read_bytes().splitlines()[-411 * 15:] for name in ("1", "2", "3", "5", "again")]
    assert all(table == tables[0] for table in tables)


def test_bed_on_one_and_two_ranks(run, tmp_path):
    for ranks in 1, 2:
        result = run([ROOT / "runs/bench/bodies-only.yaml", "-particle_bed_count", "400", "-particle_bed_radius", "0.0218", "-contact_range", "0.0065", "-sim_dt", "1e-3",
                      "-output_bodies", "0,399", "-output_dir", str(ranks)], ranks)
        assert result.status == 0, str(result)
    assert (tmp_path / "1" / "bodies.csv").read_bytes() == (tmp_path / "2" / "bodies.csv").read_bytes()


@pytest.mark.parametrize("ranks", [2])
def test_faces_of_the_domain(run, scene, ranks, tmp_path):
    out = [scene(box(x=0.9, speed=1)), "-contact_law", "none"]
    stopped = run([*out, "-output_dir", "stop"], ranks)
    assert stopped.status != 0 and stopped.text.count("Body 0 of group 'a' has left the domain through boundary 'right'") == 1, str(stopped)
    assert "-particle_remove right" in stopped.text, str(stopped)
    removed = run([*out, "-particle_remove", "right", "-output_dir", "gone"], ranks)
    assert removed.status == 0, str(removed)
    assert summary(tmp_path / "gone")["bodies_removed"] == 1
    around = run([scene(box(periodic=", periodic: x", x=0.9, speed=1)), "-output_dir", "around"], ranks)
    assert around.status == 0, str(around)
    assert abs(float(rows(tmp_path / "around", 0)[-1]["x"]) - 0.5) < 1e-9


@pytest.mark.parametrize("ranks", [1, 2])
def test_overlap_at_the_start_is_refused(run, scene, ranks):
    wall = run([scene(box(x=0.04))], ranks)
    assert wall.status != 0 and wall.text.count("Body 0 of group 'a' overlaps wall 'left' by 0.01 at the start") == 1, str(wall)
    pair = run([scene(box()), "-particle_b_position", "0.5,0.41"], ranks)
    assert pair.status != 0 and pair.text.count("Body 0 of group 'a' overlaps body 0 of group 'b' by 0.01 at the start") == 1, str(pair)


@pytest.mark.parametrize("coupling", ["implicit", "explicit"])
def test_a_body_leaves_a_flow(run, scene, coupling, tmp_path):
    """Swept out through an outflow; neutrally buoyant, so that what is left behind has no inertia in the coupled system either."""
    text = """mesh: {cells: [16, 8], lower: [0, 0], upper: [2, 1]}
flow:
  density: 1
  viscosity: 0.01
  bc_left: {type: inflow, velocity: [1, 0]}
  bc_right: {type: outflow}
particle:
  groups: disc
  remove: right
  disc: {shape: circle, radius: 0.2, density: %g, position: [1.6, 0.5], velocity: [1, 0]}
sim: {dt: 0.05, steps: 14}
""" % (1 if coupling == "implicit" else 1.5)
    result = run([scene(text), "-couple_type", coupling, "-output_dir", "out"], 2)
    assert result.status == 0, str(result)
    assert summary(tmp_path / "out")["bodies_removed"] == 1
    last = rows(tmp_path / "out", 0)[-1]
    assert float(last["x"]) > 2 and float(last["u"]) == 0, last


def test_bodies_in_a_flow_on_one_and_two_ranks(run, tmp_path):
    """Marking of nodes, forces and contact of 36 discs: the same motion and forces to round-off."""
    found = []
    for ranks in 1, 2:
        result = run([ROOT / "runs/bench/bodies.yaml", "-mesh_cells", "32,32", "-particle_bed_count", "36", "-particle_bed_radius", "0.07", "-flow_solver", "direct", "-sim_steps", "4",
                      "-output_dir", str(ranks)], ranks)
        assert result.status == 0, str(result)
        found.append([float(row[name]) for k in range(36) for row in rows(tmp_path / str(ranks), k) for name in ("x", "y", "force_x", "force_y", "torque_z")])
    largest = max(map(abs, found[0]))
    assert len(found[0]) == 36 * 4 * 5 and largest > 0
    assert max(abs(a - b) for a, b in zip(*found)) < 1e-9 * largest


def test_tables_of_many_bodies_are_hdf5(run, scene, tmp_path):
    """The same rows as bodies.csv, from all ranks; by themselves above 10,000 bodies."""
    sys.path.insert(0, str(ROOT / "tools"))
    import tumble

    crowd = scene(CROWD)
    for name in "csv", "hdf5":
        result = run([crowd, "-output_dir", name, "-output_bodies", "3,70", "-output_bodies_format", name, "-output_series", "20", "-output_every", "0"], 3)
        assert result.status == 0, str(result)
    csv_rows, rows = tumble.open(tmp_path / "csv").bodies, tumble.open(tmp_path / "hdf5").bodies
    assert list(rows) == list(csv_rows) and len(rows) == len(csv_rows) == 2 * 68
    for name in rows:
        if name == "group":
            assert (rows[name] == csv_rows[name]).all()
        else:
            assert rows[name] == pytest.approx(csv_rows[name], rel=1e-6, abs=1e-9), name
    many = scene("mesh: {cells: [4, 4]}\nflow: {active: false}\nparticle: {groups: a, a: {shape: circle, radius: 1e-3, density: 1, place: lattice, count: 10001}}\n"
                 "contact: {range: 1e-4}\nsim: {dt: 1e-3, steps: 1}\n", "many.yaml")
    for last, expected in ("9999", False), ("10000", True):
        assert run([many, "-output_dir", last, "-output_bodies", f"0,{last}"], 2).status == 0
        assert (tmp_path / last / "table_1.h5").exists() == expected


def test_crossing_borders_in_every_step(run, tmp_path):
    """Parts smaller than the way of some steps, periodic along both axes: the bits of one rank, every body once, momentum kept."""
    sys.path.insert(0, str(ROOT / "tools"))
    from quantities import names_of_run

    for ranks in 1, 7:
        result = run([str(ROOT / "runs" / "studies" / "scaling" / "crossing.yaml"), "-sim_steps", "20", "-output_dir", f"{ranks}"], ranks)
        assert result.status == 0, str(result)
    assert (tmp_path / "1" / "bodies.csv").read_bytes() == (tmp_path / "7" / "bodies.csv").read_bytes()
    assert names_of_run(tmp_path / "7")["momentum_drift"](88) < 1e-10
    cells = [{row["body"]: (int(8 * float(row["x"])), int(8 * float(row["y"]))) for row in step} for step in steps_of(tmp_path / "7")]
    assert min(sum(a[body] != b[body] for body in a) for a, b in zip(cells, cells[1:])) > 0


def steps_of(folder):
    with open(folder / "bodies.csv") as file:
        rows = list(csv.DictReader(file))
    return [rows[i:i + 88] for i in range(0, len(rows), 88)]
