"""The units of a scene are the user's: in any of them a run takes the same iterations in every step and gives the same results, converted.

A scene is written once with the exponents of length, time and mass behind every number, and converted from cgs to other systems.
"""
import csv
import json

import pytest

# one cm, s, g in these units: SI; micrometres, microseconds, picograms
SYSTEMS = {"cgs": (1, 1, 1), "si": (1e-2, 1, 1e-3), "micro": (1e4, 1e6, 1e12)}
NUMBER, LENGTH, TIME, SPEED, ACCELERATION = (0, 0, 0), (1, 0, 0), (0, 1, 0), (1, -1, 0), (1, -2, 0)
DENSITY, VISCOSITY = (-3, 0, 1), (-1, -1, 1)

DISC = {
    "mesh_cells": "24,72", "mesh_lower": "0,0", "mesh_upper": ((2, 6), LENGTH), "flow_density": ((1,), DENSITY), "flow_viscosity": ((0.1,), VISCOSITY),
    "flow_gravity": ((0, -981), ACCELERATION), "particle_groups": "disc", "particle_disc_shape": "circle", "particle_disc_radius": ((0.125,), LENGTH),
    "particle_disc_density": ((1.25,), DENSITY), "particle_disc_position": ((0.9, 4), LENGTH), "particle_disc_velocity": ((0.1, 0), SPEED),
    "sim_dt": ((0.01,), TIME), "sim_steps": "8",
}
# 20 um in a box of 100 x 200 um of water
SMALL = {**DISC, "mesh_cells": "32,64", "mesh_upper": ((0.01, 0.02), LENGTH), "flow_viscosity": ((0.01,), VISCOSITY), "particle_disc_radius": ((0.001,), LENGTH),
         "particle_disc_position": ((0.0045, 0.0136), LENGTH), "particle_disc_velocity": "0,0", "sim_dt": ((0.001,), TIME)}
# comes to rest on the floor within the run
LANDING = {**DISC, "particle_disc_position": ((0.9, 0.2), LENGTH), "particle_disc_velocity": ((0, -3), SPEED), "sim_steps": "12"}
ELLIPSE = {**DISC, "particle_disc_shape": "ellipse", "particle_disc_a": ((0.25,), LENGTH), "particle_disc_b": ((0.125,), LENGTH), "particle_disc_angle": "0.5"}
del ELLIPSE["particle_disc_radius"]

RUNS = {
    "demo-nodal": (DISC, 1, ["-couple_boundary", "nodal"]),
    "demo-penalty": (DISC, 2, ["-couple_boundary", "penalty"]),
    "demo-snap": (DISC, 1, ["-couple_boundary", "snap"]),
    "demo-accurate": (DISC, 1, ["-flow_recipe", "accurate"]),
    "demo-fast": (DISC, 1, ["-flow_recipe", "fast", "-couple_boundary", "penalty"]),
    "demo-direct": (DISC, 1, ["-flow_recipe", "direct"]),
    "demo-explicit": (DISC, 2, ["-couple_type", "explicit", "-particle_disc_density"]),
    "demo-adaptive": (DISC, 1, ["-sim_adapt", "true", "-couple_boundary", "penalty"]),
    "demo-deform": (DISC, 1, ["-mesh_deform", "true"]),
    "small-nodal": (SMALL, 1, ["-couple_boundary", "nodal"]),
    "small-penalty": (SMALL, 1, ["-couple_boundary", "penalty"]),
    "small-snap": (SMALL, 2, ["-couple_boundary", "snap"]),
    "landing": (LANDING, 1, ["-couple_boundary", "penalty"]),
    "spring": (LANDING, 1, ["-couple_boundary", "nodal", "-contact_law", "spring"]),
    "ellipse-nodal": (ELLIPSE, 2, ["-couple_boundary", "nodal"]),
    "ellipse-snap": (ELLIPSE, 1, ["-couple_boundary", "snap"]),
}
FORCE = (0, -2, 1)  # in the plane: of a unit of depth
BODIES = {"time_s": TIME, "x": LENGTH, "y": LENGTH, "angle_rad": NUMBER, "u": SPEED, "v": SPEED, "omega_z": (0, -1, 0), "force_x": FORCE, "force_y": FORCE, "torque_z": (1, -2, 1)}
SERIES = {"time_s": TIME, "dt_s": TIME, "cfl": NUMBER, "kinetic_energy": (1, -2, 1)}


def factor(exponents, system):
    product = 1
    for unit, exponent in zip(SYSTEMS[system], exponents):
        product *= unit**exponent
    return product


def options(scene, system):
    words = []
    for name, value in scene.items():
        if not isinstance(value, str):
            value = ",".join(repr(number * factor(value[1], system)) for number in value[0])
        words += ["-" + name, value]
    return words


def table(folder, name):
    with open(folder / name / "series.csv") as series, open(folder / name / "bodies.csv") as bodies:
        return list(csv.DictReader(series)), list(csv.DictReader(bodies))


def deviations(rows, others, exponents, system):
    """Largest difference of each column, relative to the largest of its kind: components that vanish count beside those that do not."""
    size, worst = {}, {}
    for name, unit in exponents.items():
        values = [float(row[name]) for row in rows]
        size[unit] = max(size.get(unit, 0), max(map(abs, values)))
    for name, unit in exponents.items():
        far = max(abs(float(a[name]) - float(b[name]) / factor(unit, system)) for a, b in zip(rows, others))
        worst[name] = far / size[unit] if size[unit] else far
    return worst


@pytest.mark.parametrize("name", RUNS)
def test_units_change_nothing(name, run, scene, tmp_path):
    numbers, ranks, extra = RUNS[name]
    if extra[-1] == "-particle_disc_density":
        numbers, extra = {**numbers, "particle_disc_density": ((4,), DENSITY)}, extra[:-1]
    file = scene("output: {every: 0}\n", "empty.yaml")
    for system in SYSTEMS:
        result = run([file, *options(numbers, system), *extra, "-output_dir", system], ranks)
        assert result.status == 0, result
    series, bodies = table(tmp_path, "cgs")
    assert len(series) > 4 and sum(int(row["outer_iterations"]) for row in series) > 4
    for system in SYSTEMS:
        others, their_bodies = table(tmp_path, system)
        assert [row["outer_iterations"] for row in others] == [row["outer_iterations"] for row in series], system
        worst = {**deviations(series, others, SERIES, system), **deviations(bodies, their_bodies, BODIES, system)}
        assert max(worst.values()) < 1e-9, (system, worst)
