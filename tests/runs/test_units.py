"""The units of a scene are the user's: in any of them a run takes the same iterations in every step and gives the same results, converted.

A scene is written once with the exponents of length, time and mass behind every number, and converted from cgs to other systems.
"""
import csv
import json
import math

import pytest

# one cm, s, g in these units: SI; micrometres, microseconds, picograms
SYSTEMS = {"cgs": (1, 1, 1), "si": (1e-2, 1, 1e-3), "micro": (1e4, 1e6, 1e12)}


class Unit:
    """Exponents of length, time, mass and the value of a scalar."""

    def __init__(self, length=0, time=0, mass=0, scalar=0):
        self.exponents = (length, time, mass, scalar)

    def __mul__(self, other):
        return Unit(*(a + b for a, b in zip(self.exponents, other.exponents)))

    def __truediv__(self, other):
        return Unit(*(a - b for a, b in zip(self.exponents, other.exponents)))

    def __rtruediv__(self, one):
        return Unit() / self

    def __pow__(self, power):
        return Unit(*(power * a for a in self.exponents))

    def factor(self, sizes):
        """One of it, where one length, time, mass, value has these sizes"""
        return math.prod(size**exponent for size, exponent in zip(sizes, self.exponents))


NUMBER, LENGTH, TIME, MASS = Unit(), Unit(1), Unit(0, 1), Unit(0, 0, 1)
SPEED, ACCELERATION, DENSITY, VISCOSITY = LENGTH / TIME, LENGTH / TIME**2, MASS / LENGTH**3, MASS / (LENGTH * TIME)

DISC = {
    "mesh_cells": "24,72", "mesh_lower": "0,0", "mesh_upper": ((2, 6), LENGTH), "flow_density": ((1,), DENSITY), "flow_viscosity": ((0.1,), VISCOSITY),
    "flow_gravity": ((0, -981), ACCELERATION), "particle_groups": "disc", "particle_disc_shape": "circle", "particle_disc_radius": ((0.125,), LENGTH),
    "particle_disc_density": ((1.25,), DENSITY), "particle_disc_position": ((0.9, 4), LENGTH), "particle_disc_velocity": ((0.1, 0), SPEED),
    "sim_dt": ((0.01,), TIME), "sim_steps": "8",
}
# 20 um in a box of 100 x 200 um of water
SMALL = {**DISC, "mesh_cells": "32,64", "mesh_upper": ((0.01, 0.02), LENGTH), "flow_viscosity": ((0.01,), VISCOSITY), "particle_disc_radius": ((0.001,), LENGTH),
         "particle_disc_position": ((0.0045, 0.0136), LENGTH), "particle_disc_velocity": "0,0", "sim_dt": ((0.001,), TIME), "sim_steps": "5"}
# comes to rest on the floor within the run
LANDING = {**DISC, "particle_disc_position": ((0.9, 0.2), LENGTH), "particle_disc_velocity": ((0, -3), SPEED), "sim_steps": "12"}
ELLIPSE = {**DISC, "particle_disc_shape": "ellipse", "particle_disc_a": ((0.25,), LENGTH), "particle_disc_b": ((0.125,), LENGTH), "particle_disc_angle": "0.5"}
del ELLIPSE["particle_disc_radius"]

RUNS = {
    "demo-nodal": (DISC, 2, ["-couple_method", "nodal"]),
    "demo-penalty": (DISC, 1, ["-couple_method", "penalty"]),
    "demo-aligned": (DISC, 1, ["-couple_method", "aligned"]),
    "demo-fast": (DISC, 1, ["-flow_solver", "fast", "-couple_method", "penalty"]),
    "demo-direct": (DISC, 1, ["-flow_solver", "direct", "-mesh_cells", "16,48"]),
    "demo-explicit": (DISC, 1, ["-couple_type", "explicit", "-sim_max_displacement", "2", "-particle_disc_density"]),
    "demo-adaptive": (DISC, 1, ["-sim_adapt", "true", "-couple_method", "penalty"]),
    # what is left holds round-off of single precision, by which inner solves may take an iteration more
    "demo-deform": (DISC, 1, ["-mesh_deform", "true", "-flow_rtol_max", "2e-5"]),
    "small-nodal": (SMALL, 1, ["-couple_method", "nodal", "-flow_rtol_max", "2e-5"]),
    "small-penalty": (SMALL, 2, ["-couple_method", "penalty", "-flow_rtol_max", "2e-5"]),
    "small-aligned": (SMALL, 1, ["-couple_method", "aligned"]),
    "landing": (LANDING, 1, ["-couple_method", "penalty"]),
    "spring": (LANDING, 1, ["-couple_method", "nodal", "-contact_law", "spring"]),
    "ellipse-aligned": (ELLIPSE, 1, ["-couple_method", "aligned"]),
}
DOUBLE = ["-flow_krylov_single", "false"]  # what other units leave in the sixteenth digit would change the eighth of a Krylov vector
IN_ALL = {"demo-nodal", "demo-aligned", "small-penalty"}  # the others in two systems, to save time
RATE, FORCE, TORQUE = 1 / TIME, MASS / TIME**2, MASS * ACCELERATION  # in the plane: of a unit of depth
BODIES = {
    "time": TIME, "x": LENGTH, "y": LENGTH, "angle": NUMBER, "u": SPEED, "v": SPEED, "omega_z": RATE,
    "force_x": FORCE, "force_y": FORCE, "torque_z": TORQUE,
}
SERIES = {"time": TIME, "dt": TIME, "cfl": NUMBER, "kinetic_energy": TORQUE}


def options(scene, system):
    words = []
    for name, value in scene.items():
        if not isinstance(value, str):
            value = ",".join(repr(number * value[1].factor(SYSTEMS[system])) for number in value[0])
        words += ["-" + name, value]
    return words


def table(folder, name):
    with open(folder / name / "series.csv") as series, open(folder / name / "bodies.csv") as bodies:
        return list(csv.DictReader(series)), list(csv.DictReader(bodies))


def deviations(rows, others, exponents, system, radius):
    """Largest difference of each column, relative to the largest number of its unit: what vanishes counts beside what does not, rotation
    by the speed it gives the surface, torque by the force's lever."""
    size, worst = {NUMBER.exponents: 1}, {}
    for name, unit in exponents.items():
        size[unit.exponents] = max(size.get(unit.exponents, 0), max(abs(float(row[name])) for row in rows))
    for unit, of, factor_of in ((RATE, SPEED, 1 / radius), (TORQUE, FORCE, radius)):
        size[unit.exponents] = max(size.get(unit.exponents, 0), size.get(of.exponents, 0) * factor_of)
    for name, unit in exponents.items():
        far = max(abs(float(a[name]) - float(b[name]) / unit.factor(SYSTEMS[system])) for a, b in zip(rows, others))
        worst[name] = far / size[unit.exponents]
    return worst


@pytest.mark.parametrize("name", RUNS)
def test_units_change_nothing(name, run, scene, tmp_path):
    numbers, ranks, extra = RUNS[name]
    if extra[-1] == "-particle_disc_density":
        numbers, extra = {**numbers, "particle_disc_density": ((4,), DENSITY)}, extra[:-1]
    file = scene("output: {every: 0}\n", "empty.yaml")
    systems = [system for system in SYSTEMS if system != "si" or name in IN_ALL]
    for system in systems:
        result = run([file, *options(numbers, system), *DOUBLE, *extra, "-output_dir", system], ranks)
        assert result.status == 0, result
    series, bodies = table(tmp_path, "cgs")
    radius = numbers.get("particle_disc_radius", numbers.get("particle_disc_b"))[0][0]
    assert len(series) > 4 and sum(int(row["outer_iterations"]) for row in series) > 4
    for system in systems:
        others, their_bodies = table(tmp_path, system)
        assert [row["outer_iterations"] for row in others] == [row["outer_iterations"] for row in series], system
        worst = {**deviations(series, others, SERIES, system, radius), **deviations(bodies, their_bodies, BODIES, system, radius)}
        assert max(worst.values()) < 1e-9, (system, worst)


# a box on an oblique hinge, near a wall: its surface points for contact must be the same, and what holds it to its axis costs eight digits
HINGED = {
    "mesh_cells": "8,8,8", "mesh_lower": "0,0,0", "mesh_upper": ((1, 1, 1), LENGTH), "flow_density": ((1,), DENSITY), "flow_viscosity": ((0.1,), VISCOSITY),
    "flow_gravity": ((0, 0, -981), ACCELERATION), "particle_groups": "flap", "particle_flap_shape": "box", "particle_flap_size": ((0.5, 0.2, 0.3), LENGTH),
    "particle_flap_rounding": ((0.04,), LENGTH), "particle_flap_density": ((2,), DENSITY), "particle_flap_position": ((0.513, 0.507, 0.491), LENGTH),
    "particle_flap_pivot": ((-0.2, 0, 0), LENGTH), "particle_flap_hinge": "1,2,0.5", "sim_dt": ((0.005,), TIME), "sim_steps": "2",
}
IN_SPACE = {"x": LENGTH, "z": LENGTH, "u": SPEED, "w": SPEED, "omega_x": RATE, "omega_y": RATE, "omega_z": RATE, "force_x": MASS * ACCELERATION, "force_z": MASS * ACCELERATION,
            "contact_force_x": MASS * ACCELERATION, "torque_y": MASS * SPEED**2}


def test_a_hinge_in_other_units(run, scene, tmp_path):
    file = scene("output: {every: 0}\n", "empty.yaml")
    for system in ("cgs", "micro"):
        # solved well, as pressures are multiplied in single precision
        result = run([file, *options(HINGED, system), *DOUBLE, "-couple_method", "nodal", "-flow_ksp_rtol", "1e-10", "-output_dir", system])
        assert result.status == 0, result
    (_, bodies), (_, others) = table(tmp_path, "cgs"), table(tmp_path, "micro")
    assert any(float(row["contact_force_x"]) != 0 for row in bodies)
    worst = deviations(bodies, others, IN_SPACE, "micro", 0.25)
    assert max(worst.values()) < 1e-7, worst
    for row in bodies:  # about its axis alone
        turn = float(row["omega_z"]) / 0.5
        assert float(row["omega_x"]) == pytest.approx(turn, rel=1e-9) and float(row["omega_y"]) == pytest.approx(2 * turn, rel=1e-9)


def test_names_of_units(run, scene, tmp_path):
    """A scene that names its units has them in headings and summary; one that does not has none."""
    text = "mesh: {cells: [4, 4]}\nsim: {dt: 0.5, steps: 1}\n"
    plain = run([scene(text, "plain.yaml"), "-output_dir", "plain"])
    named = run([scene(text + "units: {length: um, time: ms, mass: pg}\n", "named.yaml"), "-output_dir", "named"])
    assert plain.status == 0 and named.status == 0, (plain, named)
    assert "time [" not in plain.out and "to t = 0.5\n" in plain.out
    assert "time [ms]" in named.out and "dt [ms]" in named.out and "to t = 0.5 ms\n" in named.out
    assert json.loads((tmp_path / "plain/summary.json").read_text())["units"] == {}
    assert json.loads((tmp_path / "named/summary.json").read_text())["units"] == {"length": "um", "time": "ms", "mass": "pg"}
    wrong = run([scene(text + "units: {length: yard}\n", "wrong.yaml")])
    assert wrong.status != 0 and "-units_length" in wrong.text and "yard" in wrong.text, wrong


def test_tiny_numbers_are_above_zero(run, scene):
    """1e-17 is a length like any other: what must be positive is compared with zero."""
    result = run([scene("mesh: {cells: [4, 4], upper: [4e-17, 4e-17]}\nflow: {viscosity: 1e-20, density: 1e-18}\nsim: {dt: 1e-17, steps: 1}\n")])
    assert result.status == 0, result
