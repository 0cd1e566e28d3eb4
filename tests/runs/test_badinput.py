"""Bad input stops the program before step 1, with one message that says what is wrong, where, and what to do."""
import re

import pytest

from conftest import SCENE, edited

# One of each kind runs on 1 and 2 ranks; the many variants on 2 only, where a message printed by every rank would show.
RANKS = pytest.mark.parametrize("ranks", [1, 2])
TWO = pytest.mark.parametrize("ranks", [2])


def refused(result, phrase, *parts):
    """The run failed before its first step; `phrase` was printed exactly once, and every one of `parts` was printed."""
    assert result.status != 0, f"accepted, but should be refused\n{result}"
    assert result.text.count(phrase) == 1, f"'{phrase}' should be printed once, not {result.text.count(phrase)} times\n{result}"
    for part in parts:
        assert part in result.text, f"'{part}' is missing from the message\n{result}"
    assert result.steps() == 0, f"steps were made before the error\n{result}"


@RANKS
def test_scene_itself_is_good(run, scene, ranks):
    """Otherwise every refusal below would prove nothing."""
    result = run([scene()], ranks)
    assert result.status == 0, str(result)
    assert result.steps() > 0, f"no step was reported in series.csv\n{result}"


# ---- the scene file ----

FILES = {
    "tab": (edited("  groups", "\tgroups"), 4, "tab character in the indentation", ["use blanks"]),
    "duplicate": (edited("sim:", "sim: {dt: 0.1}\nsim:"), 7, "duplicate key 'sim'", ["first at line 6", "keep one"]),
    "duplicate in a map": (edited("{density: 1,", "{density: 1, density: 2,"), 2, "duplicate key 'density'", ["first at line 2"]),
    "two spellings": (SCENE + "sim_dt: 0.1\n", 7, "option -sim_dt is given twice", ["first at line 6"]),
    "list of maps": (edited("groups: disc", "groups: [{shape: circle, radius: 1}]"), 4, "'groups' is a list of maps", ["give each entry a name"]),
    "open bracket": (edited("[2, 6]}", "[2, 6}"), 1, "syntax error", ["bracket"]),
    "no colon": (edited("  groups: disc", "  groups disc"), 5, "syntax error", ["a colon missing on the line before"]),
    "dash": (SCENE + "-sim_dt: 1\n", 7, "starts with a dash", ["write 'sim_dt'"]),
    "no blank": (edited("{dt: 0.005,", "{dt:0.005,"), 6, "put a blank after the colon", ["dt:0.005"]),
    "two documents": (SCENE + "---\nsim: {dt: 0.1}\n", 7, "second document", []),
}


@TWO
@pytest.mark.parametrize("fault", FILES)
def test_faulty_file(run, scene, ranks, fault):
    text, line, phrase, parts = FILES[fault]
    refused(run([scene(text)], ranks), phrase, f"disc.yaml:{line}: ", *parts)


@RANKS
def test_missing_file(run, ranks):
    refused(run(["nowhere.yaml"], ranks), "no such scene file", "nowhere.yaml")


@TWO
def test_missing_file_is_found_in_runs(run, scene, ranks, tmp_path):
    (tmp_path / "runs").mkdir()
    scene(name="runs/disc.yaml")
    refused(run(["disc.yaml"], ranks), "no such scene file", "did you mean runs/disc.yaml?")


@TWO
def test_empty_file(run, scene, ranks):
    refused(run([scene("# nothing\n")], ranks), "scene file is empty", "disc.yaml")


@TWO
def test_folder_as_file(run, ranks, tmp_path):
    (tmp_path / "dir.yaml").mkdir()
    refused(run(["dir.yaml"], ranks), "is a directory", "dir.yaml")


@TWO
def test_too_many_options(run, scene, ranks):
    many = "".join(f"extra_{i}: 1\n" for i in range(460))
    refused(run([scene(SCENE + many)], ranks), "more than 450 options", "table file")


# ---- unknown and unused options ----

MISSPELT = {
    "in the file": (edited("viscosity", "viscosty"), [], "-flow_viscosty", "-flow_viscosity"),
    "section": (edited("flow:", "flwo:"), [], "-flwo_viscosity", "-flow_viscosity"),
    "of a shape": (edited("radius", "radus"), [], "-particle_disc_radus", "-particle_disc_radius"),
    "of a group": (SCENE, ["-particle_disc_coutn", "2"], "-particle_disc_coutn", "-particle_disc_count"),
    "on the command line": (SCENE, ["-sim_stesp", "1"], "-sim_stesp", "-sim_steps"),
    "without value": (SCENE, ["-output_overwriet"], "-output_overwriet", "-output_overwrite"),
    "of a solver": (SCENE, ["-flow_ksp_rtoll", "1e-3"], "-flow_ksp_rtoll", "-flow_ksp_rtol"),
}


@TWO
@pytest.mark.parametrize("where", MISSPELT)
def test_misspelt_option(run, scene, ranks, where):
    text, args, wrong, right = MISSPELT[where]
    result = run([scene(text), *args], ranks)
    refused(result, "Unknown or unused option", wrong)
    assert not (result.folder / "out").exists(), f"the refused run left a folder, which the corrected one must not find\n{result}"
    assert re.search(re.escape(wrong) + r"\b[^\n]*did you mean " + re.escape(right) + r"\?", result.text), f"{right} is not offered for {wrong}\n{result}"


@TWO
def test_misspelt_option_that_must_be_there(run, scene, ranks):
    """Its absence is met first; the message names the right spelling all the same."""
    refused(run([scene(edited("position", "positon"))], ranks), "Group 'disc' has no position", "give -particle_disc_position")


@TWO
def test_parameter_of_another_shape(run, scene, ranks):
    """The nearest name is none of the shape: what it takes is said."""
    text = edited("shape: circle", "shape: ellipse")
    refused(run([scene(text)], ranks), "-particle_disc_shape ellipse takes -particle_disc_a, -particle_disc_b", "option -particle_disc_radius = 0.125")


@TWO
def test_table_without_its_place(run, scene, ranks):
    """That no position is given is not what is wrong."""
    text = edited("position: [1, 4]", "table: places.csv")
    refused(run([scene(text)], ranks), "-particle_disc_table needs -particle_disc_place table")


@RANKS
def test_all_misspelt_options_are_listed(run, scene, ranks):
    result = run([scene(edited("viscosity", "viscosty")), "-sim_stesp", "1"], ranks)
    refused(result, "Unknown or unused options (2)", "did you mean -flow_viscosity?", "did you mean -sim_steps?")


@TWO
@pytest.mark.parametrize("args", [["-mesh_cells", "8,24", "24"], ["sim_dt", "0.1"]])
def test_stray_argument(run, scene, ranks, args):
    """PETSc drops words that belong to no option; a forgotten dash must not pass in silence."""
    refused(run([scene(), *args], ranks), "belongs to no option", args[-1] if args[0][0] == "-" else args[0])


@TWO
def test_options_read_late_are_no_mistake(run, scene, ranks):
    result = run([scene(), "-log_view", ":log.txt", "-options_left", "no", "-malloc_dump"], ranks)
    assert result.status == 0, str(result)
    assert (result.folder / "log.txt").stat().st_size > 0


# ---- values ----

# option, value, range as printed, has a unit
RANGES = [
    ("-flow_viscosity", "-1", "> 0", True),
    ("-flow_viscosity", "0", "> 0", True),
    ("-flow_density", "-1", "> 0", True),
    ("-sim_dt", "-0.1", "> 0", True),
    ("-particle_disc_radius", "-0.1", "> 0", True),
    ("-particle_disc_density", "-2", None, True),
    ("-sim_steps", "-3", ">= ", False),
]


@TWO
@pytest.mark.parametrize("option, value, limits, unit", RANGES)
def test_out_of_range(run, scene, ranks, option, value, limits, unit):
    result = run([scene(), option, value], ranks)
    refused(result, f"Option {option} = {value} is outside its range (", limits or "")
    found = re.search(re.escape(option) + r" = \S+ is outside its range \(([^)]+)\)([^:\n]*): \S", result.text)
    assert found, f"no range and meaning in the message\n{result}"
    assert not limits or found[1].startswith(limits), str(result)
    assert not unit or found[2].strip(), f"no unit in the message\n{result}"


@TWO
def test_parabola_in_time_with_moving_body(run, scene, ranks):
    refused(run([scene(), "-flow_extrapolation", "quadratic"], ranks), "Option -flow_extrapolation quadratic: group 'disc' moves", "use linear")


@RANKS
def test_out_of_range_in_the_file(run, scene, ranks):
    refused(run([scene(edited("viscosity: 0.1", "viscosity: -0.1"))], ranks), "Option -flow_viscosity = -0.1 is outside its range (> 0)")


@TWO
@pytest.mark.parametrize("value, what", [("thick", "not a number"), ("nan", "not a finite number"), ("inf", "not a finite number"), ("1e999", "not a finite number")])
def test_no_number(run, scene, ranks, value, what):
    refused(run([scene(), "-flow_viscosity", value], ranks), f"Option -flow_viscosity = {value} is {what}", "wanted: ")


@TWO
@pytest.mark.parametrize("value, what", [("8,0", "is outside its range (1 to "), ("8,2.5", "is not a whole number"), ("8,x", "is not a whole number")])
def test_bad_cells(run, scene, ranks, value, what):
    refused(run([scene(), "-mesh_cells", value], ranks), what, "Option -mesh_cells")


@TWO
@pytest.mark.parametrize(
    "option, value, what",
    [
        ("-flow_gravity", "0, -981*(1 + q)", "Option -flow_gravity = 0, -981*(1 + q) is wrong at character 14: Unexpected token 'q"),
        ("-flow_force", "sin(x, 0", "is wrong at character 4: this bracket is not closed"),
        ("-flow_velocity", "y, t", "is wrong at character 4: Unexpected token 't' (known: numbers, x, y, pi,"),
        ("-flow_force", "1/x, 0", "Option -flow_force = 1/x,0: value 1 is inf"),
    ],
)
def test_wrong_expression(run, scene, ranks, option, value, what):
    refused(run([scene(), option, value], ranks), what, option)


@TWO
def test_expression_of_what_is_free(run, scene, ranks):
    what = "-particle_disc_velocity prescribes y, and -particle_disc_free sets it free"
    refused(run([scene(), "-particle_disc_velocity", "0, sin(t)", "-particle_disc_free", "y"], ranks), what, "Group 'disc'")


@TWO
def test_expression_without_steady_state(run, scene, ranks):
    text = "mesh: {cells: [4, 4]}\nflow: {force: \"0, t\"}\nsim: {steady: true}\n"
    refused(run([scene(text)], ranks), "Option -flow_force = 0,t changes in time", "without -sim_steady")


@TWO
def test_value_is_missing(run, scene, ranks):
    refused(run([scene(), "-flow_viscosity"], ranks), "Option -flow_viscosity has no value", "wanted: ")


@TWO
def test_wrong_number_of_values(run, scene, ranks):
    refused(run([scene(), "-particle_disc_position", "1,2,3,4"], ranks), "Option -particle_disc_position = 1,2,3,4 has 4 values", "are wanted")


CHOICES = {
    "-couple_method": ["nodal"],
    "-flow_time": ["be", "cn", "bdf2"],
    "-flow_solver": ["fast", "balanced", "accurate", "direct"],
    "-contact_law": ["repulsive", "spring", "none"],
    "-particle_disc_place": ["single", "lattice", "random", "table"],
}


@TWO
@pytest.mark.parametrize("option", CHOICES)
def test_unknown_choice(run, scene, ranks, option):
    result = run([scene(), option, "nonesuch"], ranks)
    refused(result, f"Option {option} = nonesuch is not known (known: ")
    known = re.search(r"is not known \(known: ([^)]*)\)", result.text)[1].split(", ")
    assert set(CHOICES[option]) <= set(known), f"known ones are missing from {known}\n{result}"


@RANKS
def test_unknown_shape(run, scene, ranks):
    result = run([scene(edited("shape: circle", "shape: cube"))], ranks)
    refused(result, "Shape 'cube' is not known", "-shape_path")
    known = re.search(r"is not known \(known: ([^)]*)\)", result.text)
    assert known, f"the known shapes are not listed\n{result}"
    assert {"airfoil", "circle", "ellipse", "leaflet"} <= set(known[1].split(", ")), str(result)


# ---- output ----


@RANKS
def test_existing_output_is_kept(run, scene, ranks, tmp_path):
    first = run([scene(), "-output_dir", "kept"], ranks)
    assert first.status == 0, str(first)
    series = tmp_path / "kept" / "series.csv"
    before = series.read_bytes()
    again = run([scene(), "-output_dir", "kept", "-sim_steps", "1"], ranks)
    assert again.status != 0, f"overwrote the output of another run\n{again}"
    assert again.text.count("-output_overwrite") == 1, f"the remedy should be named once\n{again}"
    assert "kept" in again.text, str(again)
    assert series.read_bytes() == before, "the refused run changed series.csv of the first"
    forced = run([scene(), "-output_dir", "kept", "-sim_steps", "1", "-output_overwrite"], ranks)
    assert forced.status == 0, str(forced)
    assert series.read_bytes() != before, "-output_overwrite left the old series.csv"


@RANKS
def test_body_that_the_mesh_does_not_see(run, scene, ranks):
    """Smaller than the distance of the nodes: it would fall as in a vacuum."""
    refused(run([scene(), "-particle_disc_radius", "0.02", "-particle_disc_position", "1.06,4.06", "-couple_method", "nodal"], ranks), "covers no node of the mesh", "group 'disc'", "-mesh_cells")


@TWO
def test_mesh_that_cannot_follow(run, scene, ranks):
    refused(run([scene(), "-mesh_deform", "-couple_method", "aligned"], ranks), "aligned moves the nodes around bodies itself", "use -couple_method nodal or penalty")
    refused(run([scene(), "-mesh_deform", "-flow_time", "cn"], ranks), "carries its velocity in the convection", "use -flow_time bdf2")


@TWO
def test_substeps_of_contact_that_is_solved_with_the_flow(run, scene, ranks):
    refused(run([scene(), "-contact_substeps", "9"], ranks), "-contact_substeps has no meaning", "-contact_coupling explicit")
    assert run([scene(), "-contact_substeps", "99999", "-contact_coupling", "explicit", "-sim_steps", "1"], ranks).status == 0
