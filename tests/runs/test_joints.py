"""Joints, loads, springs and stops, without a flow and in one: against closed forms."""
import csv
import math

import pytest


def table(folder, name="bodies.csv"):
    with open(folder / name) as file:
        return list(csv.DictReader(file))


def column(rows, name, body="0"):
    return [float(row[name]) for row in rows if row.get("body", body) == body]


def solve(run, scene, text, *options, ranks=1, out="out"):
    result = run([scene(text, out + ".yaml"), "-output_dir", out, "-output_overwrite", *options], ranks)
    assert result.status == 0, str(result)


LOADS = """mesh: {cells: [4, 4], lower: [-4, -4], upper: [4, 4]}
flow: {active: false}
particle:
  groups: pushed, slides, moored, spring, led, driven, rope, turned
  pushed: {shape: circle, radius: 0.1, density: 2, position: [-2, -2], force: [0.005, 0.01]}
  slides: {shape: circle, radius: 0.1, density: 2, position: [2, 0], slide: [0.6, 0.8], force: [0.005, 0]}
  moored: {shape: circle, radius: 0.1, density: 2, position: [0.5, 2], mooring_stiffness: 2, mooring: [0, 2]}
  spring: {shape: box, size: [0.4, 0.1], density: 1, position: [-2, 2], free: rotation, angle: 0.3, spring: 0.01, spring_angle: 0.1}
  led: {shape: circle, radius: 0.1, density: 1, position: [0, 0], motion: oscillate, motion_amplitude: [0.3, 0], motion_period: [1, 1]}
  driven: {shape: circle, radius: 0.1, density: 1, position: [-3, 0], free: x, force: ["0.02*cos(t) - 0.05*u", 0]}
  rope: {shape: circle, radius: 0.1, density: 1, position: [3.1, -3], mooring: [2.8, -3, 3.8, -3], mooring_length: 0.4, mooring_stiffness: [1, 3], mooring_slack: true}
  turned: {shape: circle, radius: 0.5, density: 2, position: [0, -3], free: rotation, torque: 1}
contact: {law: none}
sim: {dt: 0.04, steps: 150}
output: {progress: 200}
checkpoint: {every: 75}
"""


def test_loads_without_a_flow(run, scene, tmp_path):
    """Exact in time, the same bits on any ranks and after a restart on others."""
    solve(run, scene, LOADS)
    rows, t = table(tmp_path / "out"), 6.0
    end = lambda body, name: column(rows, name, str(body))[-1]
    m = 2 * math.pi * 0.01
    assert end(0, "x") == pytest.approx(-2 + 0.5 * 0.005 / m * t * t, rel=1e-9) and end(0, "v") == pytest.approx(0.01 / m * t, rel=1e-9)
    assert end(1, "y") == pytest.approx(0.5 * 0.003 / m * t * t * 0.8, rel=1e-9)
    assert end(2, "x") == pytest.approx(0.5 * math.cos(math.sqrt(2 / m) * t), abs=1e-7)
    inertia = 0.04 * (0.16 + 0.01) / 12
    assert end(3, "angle") == pytest.approx(0.1 + 0.2 * math.cos(math.sqrt(0.01 / inertia) * t), abs=1e-7)
    assert abs(end(4, "x")) < 1e-9 and end(4, "u") == pytest.approx(0.6 * math.pi, rel=1e-9)
    a, c = 0.02 / (math.pi * 0.01), 0.05 / (math.pi * 0.01)
    assert end(5, "u") == pytest.approx(a * (c * math.cos(t) + math.sin(t) - c * math.exp(-c * t)) / (1 + c * c), rel=1e-7)
    assert end(7, "omega_z") == pytest.approx(5.092958179 * t, rel=1e-9)
    # a rope that is taut on one side at a time: energy of a piecewise spring
    series = table(tmp_path / "out", "series.csv")
    x = column(rows, "x", "6")
    assert max(x) > 3.45 and min(x) < 3.15
    total = [0.5 * math.pi * 0.01 * u * u + 0.5 * max(0, p - 3.2) ** 2 + 1.5 * max(0, 3.4 - p) ** 2 for p, u in zip(x, column(rows, "u", "6"))]
    assert max(total) - min(total) < 1e-5 * total[0]
    assert "spring_energy" in series[0]
    for ranks in 2, 3:
        solve(run, scene, LOADS, ranks=ranks, out=f"out{ranks}")
    restarted = run([scene(LOADS, "out.yaml"), "-output_dir", "again", "-sim_restart", str(tmp_path / "out3" / "checkpoint_75.h5")], 2)
    assert restarted.status == 0, str(restarted)
    lines = [(tmp_path / name / "bodies.csv").read_text().splitlines()[-600:] for name in ("out", "out2", "out3", "again")]
    assert lines[0] == lines[1] == lines[2] == lines[3]


PENDULUM = """mesh: {cells: [4, 4%s], lower: [-2, -2%s], upper: [2, 2%s]}
flow: {active: false, gravity: [0, -10%s]}
particle:
  groups: p
  p: {shape: box, size: [0.2, 1.0%s], density: 2, position: [0, 0.5%s], pivot: [0, 0.5%s], angle: %g%s}
sim: {dt: %.12g, steps: %d}
output: {progress: 100000, series: 1}
"""


def pendulum(angle, dt, steps, space=False):
    more = (", 4", ", -2", ", 2", ", 0", ", 0.2", ", 0", ", 0") if space else ("",) * 7
    return PENDULUM % (*more, angle, ", hinge: [0, 0, 1]" if space else "", dt, steps)


def exact_period(angle):
    """Of a thin box about its end, from the arithmetic-geometric mean"""
    a, g = 1.0, math.cos(angle / 2)
    while abs(a - g) > 1e-15:
        a, g = (a + g) / 2, math.sqrt(a * g)
    return 2 * math.pi * math.sqrt(((0.04 + 1) / 12 + 0.25) / 5) / a


@pytest.mark.parametrize("space", [False, True])
def test_period_of_a_pendulum(run, scene, space, tmp_path):
    period = exact_period(0.8)
    solve(run, scene, pendulum(0.8, period / 50, 200, space))
    rows = table(tmp_path / "out")
    assert column(rows, "x")[-1] == pytest.approx(0.5 * math.sin(0.8), abs=2e-6) and abs(column(rows, "omega_z")[-1]) < 1e-5


def test_a_pendulum_keeps_its_energy(run, scene, tmp_path):
    """100 periods of 200 steps"""
    solve(run, scene, pendulum(1.0, exact_period(1.0) / 200, 20000), "-output_series", "40")
    rows, series = table(tmp_path / "out"), table(tmp_path / "out", "series.csv")
    energy = [e + 4 * y for e, y in zip(column(series, "bodies_energy"), column(rows, "y"))]
    exact = 4 * (0.5 - 0.5 * math.cos(1.0))
    assert len(energy) == 500 and max(abs(e - exact) for e in energy) < 1e-7 * exact


TOP = """mesh: {cells: [4, 4, 4], lower: [-4, -4, -4], upper: [4, 4, 4]}
flow: {active: false, gravity: [0, 0, -10]}
particle:
  groups: top, free
  top: {shape: box, size: [0.6, 0.4, 1.0], density: 2, position: [0, 0, 0], pivot: [0, 0, -0.5], angle: 0.5, axis: [1, 0, 0], angular_velocity: [0, 9, 16]}
  free: {shape: box, size: [0.6, 0.4, 1.0], density: 2, position: [2, 2, 2], angular_velocity: [3, 0.6, 0.3], force: [0, 0, 4.8]}
contact: {law: none}
sim: {dt: 0.005, steps: 700}
output: {progress: 1000}
"""


def test_tops_keep_energy_and_angular_momentum(run, scene, tmp_path):
    """A heavy asymmetric top on a point (energy, momentum about the vertical), and one that tumbles without weight (all of it)."""
    solve(run, scene, TOP)
    mass, dot = 0.48, lambda a, b: sum(x * y for x, y in zip(a, b))
    cross = lambda a, b: [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    inertia = [mass / 12 * 1.16, mass / 12 * 1.36, mass / 12 * 0.52]
    seen, flips = {"0": [], "1": []}, []
    for row in table(tmp_path / "out"):
        x, u, w, q = ([float(row[n]) for n in names] for names in (("x", "y", "z"), ("u", "v", "w"), ("omega_x", "omega_y", "omega_z"), ("q0", "q1", "q2", "q3")))
        a, v = q[0], q[1:]
        turn = lambda p, side: [p_i + 2 * (side * a * c_i + d_i) for p_i, c_i, d_i in zip(p, cross(v, p), cross(v, cross(v, p)))]
        momentum = turn([i * o for i, o in zip(inertia, turn(w, -1))], 1)
        energy = 0.5 * mass * dot(u, u) + 0.5 * dot(w, momentum)
        if row["body"] == "0":
            momentum = [p + m for p, m in zip(momentum, cross(x, [mass * c for c in u]))]
            seen["0"].append((energy + mass * 10 * x[2], momentum[2]))
        else:
            seen["1"].append((energy, *momentum))
            flips.append(turn(w, -1)[0])
    assert len(seen["0"]) == 700
    for body, tolerance in ("0", 1e-7), ("1", 1e-9):
        size = max(abs(value) for value in seen[body][0])
        assert all(max(values) - min(values) < tolerance * size for values in zip(*seen[body])), [max(values) - min(values) for values in zip(*seen[body])]
    assert max(flips) > 2.9 and min(flips) < -2  # about the middle axis: it turns over


STOPS = """mesh: {cells: [4, 4%s], lower: [-2, -2%s], upper: [2, 2%s]}
flow: {active: false, gravity: [0, -10%s]}
particle:
  groups: p
  p: {shape: box, size: [0.2, 1.0%s], density: 2, position: [0, 0.5%s], pivot: [0, 0.5%s], angle: 0.6, stops: [0.2, 1.2], stops_restitution: %g%s}
sim: {dt: 0.01, steps: %d}
output: {progress: 100000}
"""


@pytest.mark.parametrize("space, restitution, steps", [(False, 0, 100), (False, 0.8, 800), (True, 0.5, 300), (False, 0.99, 600)])
def test_bounces_on_a_stop(run, scene, space, restitution, steps, tmp_path):
    """Each bounce is a share e of the one before, to rest; e = .99 has not come to rest yet, and has not gained."""
    more = (", 4", ", -2", ", 2", ", 0", ", 0.2", ", 0", ", 0") if space else ("",) * 7
    solve(run, scene, STOPS % (*more, restitution, ", hinge: [0, 0, 1]" if space else "", steps))
    rows, series = table(tmp_path / "out"), table(tmp_path / "out", "series.csv")
    w, mass = column(rows, "omega_z"), 0.08 if space else 0.4
    energy = [e + mass * 10 * y for e, y in zip(column(series, "bodies_energy"), column(rows, "y"))]
    assert all(after < before + 1e-8 for before, after in zip(energy, energy[1:]))
    assert restitution == 0.99 or (w[-1] == 0 and w[-20:] == [0] * 20), w[-20:]
    # heights above the stop go by the square of the restitution at every rebound
    floor = mass * 10 * (0.5 - 0.5 * math.cos(0.2))
    levels = [energy[0] - floor]
    for e in energy:
        if e - floor < levels[-1] * (1 - 1e-6):
            levels.append(e - floor)
    assert all(after == pytest.approx(restitution**2 * before, rel=1e-4, abs=1e-7) for before, after in zip(levels[:4], levels[1:4]))
    assert len(levels) > 1


CONTACT = """mesh: {cells: [4, 4], lower: [-2, -2], upper: [2, 2]}
flow: {active: false, gravity: [0, -10]}
particle:
  groups: p, w, d, c
  p: {shape: box, size: [0.2, 1.0], density: 2, position: [0, 1.0], pivot: [0, 0.5], angle: -1.0}
  w: {shape: circle, radius: 0.3, density: 1, position: [0.4, 0.2], free: none}
  d: {shape: circle, radius: 0.2, density: 2, position: [0.9, 1.5], pivot: [0, 0.9], angle: 0.9, stops: [-1.0, 1.5], stops_restitution: 0.5}
  c: {shape: circle, radius: 0.2, density: 2, position: [-1, -1.79]}
contact: {law: spring, restitution: 0.5}
sim: {dt: 0.005, steps: 240}
output: {progress: 2000}
checkpoint: {every: 120}
"""


def test_pendulums_that_meet(run, scene, tmp_path):
    """Energy falls only, the books of contact close, contact forces carry a weight; bits on any ranks and after a restart."""
    for ranks in 1, 2:
        solve(run, scene, CONTACT, ranks=ranks, out=f"out{ranks}")
    again = run([scene(CONTACT, "out1.yaml"), "-output_dir", "again", "-sim_restart", str(tmp_path / "out2" / "checkpoint_120.h5")], 1)
    assert again.status == 0, str(again)
    lines = [(tmp_path / name / "bodies.csv").read_text().splitlines()[-480:] for name in ("out1", "out2", "again")]
    assert lines[0] == lines[1] == lines[2]
    rows, series = table(tmp_path / "out1"), table(tmp_path / "out1", "series.csv")
    potential = [4 * p + 20 * math.pi * 0.04 * (d + c) for p, d, c in zip(column(rows, "y", "0"), column(rows, "y", "2"), column(rows, "y", "3"))]
    total = [p + float(s["bodies_energy"]) + float(s["contact_energy"]) for p, s in zip(potential, series)]
    assert all(after < before + 1e-6 for before, after in zip(total, total[1:])) and total[-1] < total[0] - 0.3
    # beyond the rebounds at stops, what is gone is what contact took
    taken = [p + float(s["bodies_energy"]) - float(s["contact_work"]) for p, s in zip(potential, series)]
    assert max(taken) - min(taken) < 0.02 * (total[0] - total[-1]), (min(taken), max(taken), total[0], total[-1])
    impulse, mass = 0.005 * sum(column(rows, "contact_force_y", "3")), 2 * math.pi * 0.04
    assert impulse == pytest.approx(mass * (column(rows, "v", "3")[-1] + 10 * 1.2), rel=1e-6) and impulse > 1


HINGE = """mesh: {cells: [24, 24], lower: [0, 0], upper: [2, 2]}
flow: {density: 1, viscosity: 0.05, gravity: [0, -100]}
particle:
  groups: g
  g: {shape: leaflet, length: 0.8, thickness: 0.2, density: %g, position: [1, 1.5], free: rotation, pivot: [0, 0], stops: [-1.0, 0.5], stops_restitution: %g}
sim: {dt: 0.01, steps: %d}
output: {progress: 1000}
"""


@pytest.mark.parametrize("density, restitution, steps", [(3, 0.8, 60), (40, 0.99, 130)])
def test_a_flap_in_a_flow_rests_on_its_stop(run, scene, density, restitution, steps, tmp_path):
    solve(run, scene, HINGE % (density, restitution, steps))
    w = column(table(tmp_path / "out"), "omega_z")
    assert w[-10:] == [0] * 10 and column(table(tmp_path / "out"), "angle")[-1] == -1
    down = [min(w[max(0, i - 3):i]) for i in range(1, len(w)) if w[i - 1] < 0 < w[i]]
    assert all(abs(after) < abs(before) for before, after in zip(down, down[1:])), down


MOORED = """mesh: {cells: [12, 12], lower: [0, 0], upper: [2, 2]}
flow: {density: 0.001, viscosity: 0.0001}
particle:
  groups: m
  m: {shape: circle, radius: 0.3, density: 2, position: [1.2, 1.0], free: x, %s}
sim: {dt: 0.02, steps: %d}
output: {progress: 200}
"""


def crossings(t, x):
    return [a + (b - a) * p / (p - q) for a, b, p, q in zip(t, t[1:], x, x[1:]) if p > 0 >= q]


@pytest.mark.parametrize("load", ["mooring: [1, 1], mooring_stiffness: 20", "force: [\"-20*(x - 1)\", 0]"])
def test_a_spring_in_a_thin_fluid(run, scene, load, tmp_path):
    """Its period in a vacuum, to the second order of the step"""
    solve(run, scene, MOORED % (load, 80))
    rows = table(tmp_path / "out")
    at = crossings(column(rows, "time"), [x - 1 for x in column(rows, "x")])
    assert at[-1] - at[0] == pytest.approx(2 * math.pi * math.sqrt(2 * math.pi * 0.09 / 20), rel=0.006) and len(at) == 2


@pytest.mark.parametrize("options, ends", [("-particle_m_mooring_stiffness 2e8", 1.0), ("-particle_m_mooring_stiffness 2e8 -flow_time cn", 1.0),
                                           ("-particle_m_mooring_stiffness 2e8 -couple_type explicit", 1.0),
                                           ("-particle_m_mooring_stiffness 0 -particle_m_mooring_damping 1e7 -particle_m_velocity 1,0", 1.2)])
def test_stiff_springs_in_a_flow(run, scene, options, ends, tmp_path):
    solve(run, scene, MOORED % ("mooring: [1, 1], mooring_stiffness: 20", 40), *options.split())
    x = column(table(tmp_path / "out"), "x")
    assert all(abs(p - 1) < 0.25 for p in x) and x[-1] == pytest.approx(ends, abs=2e-3), x[-3:]


@pytest.mark.parametrize("change, message", [
    ("mooring: [0, 2]", "-particle_moored_mooring needs -particle_moored_mooring_stiffness"),
    ("mooring: [0, 2, 1], mooring_stiffness: 2", "give 2 for each point"),
    ("mooring: [0, 2, 1, 2], mooring_stiffness: [1, 2, 3]", "3 values for 2 moorings"),
    ("mooring_stiffness: 2, mooring_slack: true", "a line that can be slack has a length"),
    ("free: none, spring: 1", "-particle_moored_spring needs a body that turns freely"),
    ("mooring: [0, 2], mooring_stiffness: 1e16", "times faster. Lower them or -sim_dt"),
    ("force: [\"1/(x - 0.5)\", 0]", "write expressions that are finite"),
])
def test_mistakes(run, scene, change, message):
    text = LOADS.replace("mooring_stiffness: 2, mooring: [0, 2]", change)
    assert text != LOADS
    result = run([scene(text)], 2)
    assert result.status != 0 and result.text.count(message) == 1, str(result)


def test_blanks_between_parts(run, scene):
    text = "mesh: {cells: [4, 4]}\nflow: {active: false}\nparticle: {groups: a, a: {shape: composite, parts: 'hub, b1', hub: {shape: circle, radius: 0.1}, " \
           "b1: {shape: box, size: [0.3, 0.1]}, density: 1, position: [0.5, 0.5]}}\nsim: {dt: 0.1, steps: 1}\n"
    result = run([scene(text), "-scene_dry_run"], 1)
    assert result.status == 0, str(result)


STIFF = """mesh: {cells: [8, 8], lower: [0, 0], upper: [1, 1]}
flow: {density: 1, viscosity: 0.01, gravity: [0, -10]}
particle:
  groups: disc
  disc: {shape: circle, radius: 0.15, density: 2, position: [0.5, 0.5], mooring: [0.5, 0.51], mooring_stiffness: 1.0e5}
contact: {law: none}
sim: {dt: 0.01, steps: 6}
output: {progress: 100}
"""


@pytest.mark.parametrize("scheme", ["bdf2", "cn", "be"])
def test_spring_stiffer_than_a_step_does_not_ring(run, scene, tmp_path, scheme):
    """The frequency times the step is 8: let go .01 away, the disc is within 2 % of that of its rest after five steps, with every scheme."""
    solve(run, scene, STIFF, "-flow_time", scheme)
    rest = 0.51 - 10 * math.pi * 0.15**2 / 1e5
    y = column(table(tmp_path / "out"), "y")
    assert abs(y[4] - rest) < 2e-4 and abs(y[5] - rest) < 2e-4, [p - rest for p in y]
