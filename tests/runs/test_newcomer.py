"""First guesses of a newcomer: each works, or leads to the right option with one message."""
import json
import math
import os
import re
import subprocess

import pytest

from conftest import ROOT, SCENE, edited

DRY = "-scene_dry_run"


def refused(result, *parts):
    assert result.status != 0 and result.err.count("tumble: error:") == 1, result
    for part in parts:
        assert part in result.text, f"'{part}' is missing\n{result}"


# ---- groups ----


@pytest.mark.parametrize("ranks", [1, 2])
def test_group_that_is_not_named(run, scene, ranks):
    refused(run([scene(edited("  groups: disc\n", "")), DRY], ranks), "Group 'disc' is described (-particle_disc_shape circle)", "give -particle_groups disc, or remove")


def test_second_group_that_is_not_named(run, scene):
    refused(run([scene(), "-particle_ball_shape", "circle", DRY]), "Group 'ball' is described (-particle_ball_shape circle)", "give -particle_groups disc,ball")


def test_parts_of_a_composite_are_no_groups(run, scene):
    text = edited("shape: circle, radius: 0.125", "shape: composite, parts: [hub, arm], hub: {shape: circle, radius: 0.2}, arm: {shape: box, size: [0.6, 0.2]}")
    assert run([scene(text), DRY]).status == 0
    assert run([scene(text.replace("[hub, arm]", '"hub, arm"')), DRY]).status == 0


# ---- other names ----

NAMES = {
    "-flow_nu": "did you mean -flow_viscosity? dynamic viscosity",
    "-flow_mu": "did you mean -flow_viscosity?",
    "-flow_rho": "did you mean -flow_density?",
    "-sim_timestep": "did you mean -sim_dt?",
    "-dt": "did you mean -sim_dt?",
    "-fluid_viscosity": "did you mean -flow_viscosity?",
    "-particle_disc_rho": "did you mean -particle_disc_density?",
    "-disc_density": "did you mean -particle_disc_density?",
    "-bc_left_type": "did you mean -flow_bc_left_type?",
    "-flow_bc_inlet_type": "there is no boundary 'inlet' in this scene (left, right, bottom, top)",
    "-flow_bc_disc_type": "'disc' is a group of bodies, and no boundary of the mesh (left, right, bottom, top)",
    "-ksp_monitor": "options of PETSc's solvers need the prefix of a solver: -flow_ksp_monitor -flow_fieldsplit_velocity_ksp_monitor",
    "-pc_type": "options of PETSc's solvers need the prefix of a solver: -flow_pc_type",
}


@pytest.mark.parametrize("half", [0, 1])
def test_other_names_of_options(run, scene, half):
    """Several at once: each has its line."""
    names = dict(list(NAMES.items())[half::2])
    result = run([scene(), *(word for name in names for word in (name, "1")), DRY])
    refused(result, f"Unknown or unused options ({len(names)})")
    for name, advice in names.items():
        assert re.search(rf"^ +{name} = 1 \(command line\): .*{re.escape(advice)}", result.text, re.MULTILINE), f"{name}\n{result}"


WORDS = [
    ("-particle_disc_shape", "sphere", "did you mean circle (in space it is a sphere)?"),
    ("-flow_bc_left_type", "symmetry", "did you mean slip?"),
    ("-contact_law", "dem", "did you mean spring?"),
]


@pytest.mark.parametrize("option, value, advice", WORDS)
def test_other_words(run, scene, option, value, advice):
    refused(run([scene(), option, value, DRY]), value, advice)


def test_words_that_are_offered_exist():
    """Of all rows: what a word leads to is one of the choices, and no other word is one."""
    seen = 0
    for text in (path.read_text() for path in (ROOT / "src").glob("*/options.c")):
        for choices, words in re.findall(r'\.choices\s*=\s*"([^"]*)"(?:(?!\{"-).)*?\.words\s*=\s*((?:"[^"]*"\s*)+)', text, re.DOTALL):
            known = choices.split(", ")
            for pair in "".join(re.findall(r'"([^"]*)"', words)).split(", "):
                other, word = pair.split(" ")
                assert word in known and other not in known, (pair, known)
                seen += 1
    assert seen > 80, seen


# ---- values ----


def angle_of(run, scene, value):
    result = run([scene(edited("position: [1, 4]", f"position: [1, 4], angle: {value}")), "-sim_steps", "0", "-output_overwrite"])
    assert result.status == 0, result
    return float(re.search(r"^-particle_disc_angle (\S+)$", next(result.folder.rglob("options.txt")).read_text(), re.MULTILINE)[1])


@pytest.mark.parametrize("value, radians", [("pi/2", math.pi / 2), ("40 deg", math.radians(40))])
def test_angles(run, scene, value, radians):
    assert angle_of(run, scene, value) == pytest.approx(radians, rel=1e-15)


def test_degrees_without_their_unit(run, scene):
    result = run([scene(), "-particle_disc_angle", "45", DRY])
    assert result.status == 0 and "as in 45 deg" in result.text, result


def test_expressions_of_a_step_and_its_half(run, scene):
    """A preset takes half of -sim_dt: of 1/200, not of 1"""
    result = run([scene(edited("shape: circle", "free: none, shape: circle")), "-sim_dt", "1/200", "-preset", "accurate", "-mesh_cells", "32,96", DRY])
    assert result.status == 0 and "0.0025" in result.text, result


def test_lists_of_points(run, scene):
    text = edited("shape: circle, radius: 0.125", "shape: polygon, points: [[-0.3, -0.3], [0.3, -0.3], [0, 0.5]]") + "monitor: {probes: [[0.2, 0.3], [1.5, 1.5]]}\n"
    result = run([scene(text), "-sim_steps", "1"])
    assert result.status == 0, result
    heading = next(result.folder.rglob("series.csv")).read_text().splitlines()[0]
    assert "probe_1_v" in heading and "probe_2_u" not in heading
    assert "area 0.24" in run([scene(text), DRY]).text
    refused(run([scene(text), "-particle_disc_points", "0,0,1,0,0", DRY]), "has 5 numbers")
    refused(run([scene(text), "-particle_disc_points", "0,0,1,1,1,0,0,1", DRY]), "the edge from corner 1 to corner 2 meets the edge from corner 3 to corner 4")


@pytest.mark.parametrize("motion, wanted", [("rotate", "-particle_disc_angular_velocity, which is not given"), ("constant", "-particle_disc_velocity, which is not given")])
def test_motion_without_a_velocity(run, scene, motion, wanted):
    refused(run([scene(), "-particle_disc_motion", motion, DRY]), wanted)


def test_table_with_densities_and_a_mark(run, scene, tmp_path):
    """Its column gives the densities, behind a byte-order mark as spreadsheets write it"""
    text = edited("density: 1.25, position: [1, 4]", "place: table, table: bodies.csv")
    (tmp_path / "bodies.csv").write_bytes(b"\xef\xbb\xbfx,y,density\r\n1,2,2\r\n1,4,3\r\n")
    result = run([scene(text), "-sim_steps", "1"])
    assert result.status == 0, result
    (tmp_path / "bodies.csv").write_bytes(b"x,y\n1,2\n")
    refused(run([scene(text), DRY]), "Group 'disc' moves but has no density: give -particle_disc_density")


def test_many_bodies_and_their_table(run, scene):
    text = edited("radius: 0.125", "radius: 0.02").replace("position: [1, 4]", "place: lattice, count: 65")
    assert "bodies.csv stays without lines: more than 64 bodies (65)" in run([scene(text), DRY]).text
    assert "bodies.csv stays" not in run([scene(text), DRY, "-output_bodies", "0,3"]).text


# ---- solvers, make ----


def test_outer_method_that_takes_the_preconditioner_for_fixed(run, scene):
    assert "-flow_ksp_type gmres takes the preconditioner for fixed" in run([scene(), "-flow_ksp_type", "gmres", DRY]).text
    assert "takes the preconditioner for fixed" not in run([scene(), "-flow_ksp_type", "gcr", DRY]).text


def test_petsc_that_is_none():
    done = subprocess.run(["make", "-n"], cwd=ROOT, env={**os.environ, "PETSC_DIR": "/nowhere", "PETSC_ARCH": ""}, capture_output=True, text=True)
    assert done.returncode != 0 and done.stderr.count("there is no PETSc in PETSC_DIR=/nowhere") == 1, done


# ---- the default preset ----


def test_default_remarks_what_it_promises(run, scene):
    """8 cells across 2: the disc of .25 is one cell thick; with 64 across it is 8, and its boundary layer 1.1"""
    coarse = run([scene(), DRY])
    assert coarse.status == 0 and "preset balanced, the default, cannot keep its 1 % here: group 'disc' is 1.0 cells thick and needs 5.0" in coarse.text, coarse
    assert "cannot keep" not in run([scene(), "-mesh_cells", "64,192", DRY]).text


@pytest.mark.parametrize("cells", ["16,48"])
def test_what_a_refusal_offers_is_accepted(run, scene, cells):
    seen = 0
    for preset in "fast", "balanced", "accurate":
        result = run([scene(), "-mesh_cells", cells, "-preset", preset, DRY])
        offers = re.findall(r"use -preset (\w+)", result.text)
        assert not offers or result.status != 0, result
        for offer in offers:
            seen += 1
            assert run([scene(), "-mesh_cells", cells, "-preset", offer, DRY]).status == 0, result
    assert seen > 0, "nothing was offered"


# ---- units and estimates ----

WATER = {  # density, viscosity, gravity of the earth
    ("m", "s", "kg"): (1000, 1e-3, 9.81), ("cm", "s", "g"): (1, 1e-2, 981), ("mm", "ms", "mg"): (1, 1e-3, 9.81e-3), ("um", "us", "pg"): (1, 1, 9.81e-6),
}


@pytest.mark.parametrize("units", list(WATER)[1::2])
def test_water_in_si(run, scene, units):
    """It is water in all units, and a bead of .1 mm and twice its density falls alike"""
    density, viscosity, gravity = WATER[units]
    length = {"m": 1, "cm": 1e2, "mm": 1e3, "um": 1e6}[units[0]]
    time = {"s": 1, "ms": 1e3, "us": 1e6}[units[1]]
    text = f"""\
units: {{length: {units[0]}, time: {units[1]}, mass: {units[2]}}}
mesh: {{cells: [16, 16], lower: [0, 0], upper: [{1e-3 * length:.10g}, {1e-3 * length:.10g}]}}
flow: {{density: {density}, viscosity: {viscosity}, gravity: [0, {-gravity:.10g}]}}
particle: {{groups: bead, bead: {{shape: circle, radius: {1e-4 * length:.10g}, density: {2 * density}, position: [{5e-4 * length:.10g}, {5e-4 * length:.10g}]}}}}
sim: {{dt: {1e-3 * time:.10g}, steps: 1}}
"""
    result = run([scene(text), DRY])
    assert result.status == 0, result
    assert "fluid density 1000 kg/m^3, viscosity 0.001 Pa s (kinematic 1e-06 m^2/s), gravity 0, -9.81 m/s^2" in result.text.replace("-0,", "0,"), result
    assert re.search(r"group bead falls or rises with about \S+, Reynolds number 5\.38, 3\.2 cells across, .* diameter 0\.0002 m, density 2000 kg/m\^3", result.text), result


def test_table_of_the_tutorial():
    text = (ROOT / "runs" / "guide" / "tutorial.md").read_text()
    for units, (density, viscosity, gravity) in WATER.items():
        row = rf"^\| {units[0]}, {units[1]}, {units[2]} +\|[^|]*\b{density:g}\b[^|]*\|[^|]*\b{viscosity:g}\b[^|]*\| *{gravity:g} *\|"
        assert re.search(row, text, re.MULTILINE), row


def fall(run, scene, *args):
    result = run([scene(), "-mesh_cells", "32,96", *args])
    return result, re.search(r"group disc falls or rises with about (\S+), Reynolds number (\S+), (\S+) cells across, (\S+) cells a step", result.text)


def test_estimates(run, scene):
    """c_D = 1 + 10/Re^(2/3) balances the weight: of a disc of .25, a quarter heavier than the fluid, viscosity .1"""
    result, found = fall(run, scene, DRY)
    assert result.status == 0 and found, result
    speed, reynolds = float(found[1]), float(found[2])
    drag = 0.5 * speed**2 * 0.25 * (1 + 10 / reynolds ** (2 / 3))
    assert drag == pytest.approx(0.25 * math.pi / 4 * 0.25**2 * 981, rel=0.01) and reynolds == pytest.approx(speed * 0.25 / 0.1, rel=0.01)
    assert float(found[3]) == 4 and float(found[4]) == pytest.approx(speed * 0.005 * 16, rel=0.02)


def test_step_a_hundred_times_too_large(run, scene):
    good, _ = fall(run, scene, DRY)
    assert "in a step of -sim_dt" not in good.text
    bad, _ = fall(run, scene, DRY, "-sim_dt", "0.5")
    assert bad.status == 0 and re.search(r"remark: group 'disc' falls or rises with about 6\.\d+, about 4\d cells \(of the smallest\) in a step of -sim_dt 0.5", bad.text), bad
    text = SCENE.replace("flow: {", "flow: {bc_left: {type: inflow, velocity: [1, 0]}, bc_right: {type: outflow}, ")
    result = run([scene(text), "-particle_disc_free", "none", DRY, "-sim_dt", "5"])
    assert result.status == 0 and "the fluid goes about 20 cells (of the smallest) in a step of -sim_dt 5" in result.text, result


def test_summary_keeps_the_remarks(run, scene):
    result = run([scene(), "-sim_steps", "1"])
    remarks = json.loads(next(result.folder.rglob("summary.json")).read_text())["remarks"]
    assert any("preset balanced, the default" in remark for remark in remarks), remarks
