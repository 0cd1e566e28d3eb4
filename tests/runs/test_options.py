"""The tables of options (src/<room>/options.c), the readers in the sources, -help, runs/reference/OPTIONS.md and the manual page say the same."""
import re
import subprocess
import time

import pytest

from conftest import ROOT, environment
from test_badinput import refused

OTHER_MODES = {
    "-sim_adapt_cfl 0.5": "-sim_adapt true",
    "-couple_method nodal -couple_penalty_viscous 3": "-couple_method penalty or aligned",
    "-contact_restitution 0.5": "-contact_law spring",
    "-flow_linearization newton": "-sim_steady true",
    "-mesh_focus_h 0.1": "-mesh_focus",
    "-mesh_deform_size 2": "-mesh_deform true",
}
READER = r"\b(ExprRead|Opt(?:Real|Int|Bool|Choice|String|RealArray|IntArray|StringArray|Axes))\((\"-[^\"]+\"|\w+),"
# of two mesh kinds, of which a scene has one; of groups, which are rigid bodies, elastic solids or drops
TWO_READERS = {"-mesh_centre", "-particle_groups", *(f"-particle_<group_scalar>_{word}" for word in ("condition", "expansion", "initial")), *(f"-particle_<group>_{word}" for word in ("angle", "angular_velocity", "axis", "contact_angle", "count", "density", "initial_velocity", "lower", "margin", "pivot", "place", "position", "quaternion", "seed", "shape", "table", "upper", "velocity", "viscosity"))}
# names that a room joins itself: of a scalar, of a scalar at a boundary, of a scalar in the bodies of a group
JOINED = ((r"\bname_option\(s, \"(\w+)\"", "-scalar_<scalar>_"), (r"\bname_option\(s, OptJoin\(\"bc_\", boundary, \"_(\w+)\"", "-scalar_<scalar_bc_boundary>_"),
          (r"\bname_option\(g(?:->name)?, par->name, \"(\w+)\"", "-particle_<group_scalar>_"))


def tell(program, *args):
    done = subprocess.run([str(program), *args], cwd=ROOT, env=environment(), capture_output=True, text=True, timeout=60)
    assert done.returncode == 0 and not done.stderr, f"tumble {' '.join(args)}: exit status {done.returncode}\n{done.stderr}"
    return done.stdout


def declared():
    """Rows of all tables: {name: room}."""
    rows = {}
    for path in sorted(ROOT.glob("src/*/options.c")):
        for name in re.findall(r"^ *\{\s*\"(-[^\"]+)\", *OPT_", path.read_text(), re.M):
            assert name not in rows, f"{name} is declared in {rows[name]} and {path.parent.name}"
            rows[name] = path.parent.name
    return rows


def join(before, after):
    """The name of an option with a word of the scene in it, with its placeholder."""
    return before + {"-particle_": "<group>", "-mesh_box_": "<box>", "-scalar_": "<scalar>"}.get(before, "<boundary>") + after


def looked_at():
    """Options that are looked at without reading them (OptPeek and the like)."""
    found = set()
    for path in sorted(ROOT.glob("src/**/*.c")):
        text = path.read_text()
        found |= set(re.findall(r"\b(?:Opt|Expr)Peek\w*\(\"(-\w+)\"", text))
        found |= {join(before, after) for before, after in re.findall(r"\b(?:Opt|Expr)Peek\w*\(OptJoin\(\"(-\w+)\", [^,]+, \"(\w+)\"", text)}
    return found


def readers():
    """{name: number of reads in the sources}; of names put together from a group or boundary, with the placeholder."""
    found = {}
    for path in sorted(ROOT.glob("src/**/*.c")):
        text = path.read_text()
        if path.parent.name == "base":
            continue
        names = re.findall(READER, text)
        names = [name.strip('"') for _, name in names if name[0] == '"']
        names += [re.sub("%s", "<group>", name) for name in re.findall(r"SNPrintf\(\w+, [^,]+, \"(-particle_%s_[a-z]\w*)\"", text)]
        joined = re.findall(r"(?<!OptPeek\()(?<!OptPeekReal\()(?<!OptPeekReals\()(?<!ExprPeek\()OptJoin\(\"(-\w+)\", [^,]+, \"(\w*)\"", text)
        names += [join(before, after) for before, after in joined if before[0] == "-"]
        names += [before + after for pattern, before in JOINED for after in re.findall(pattern, text)]
        for name in names:
            found[name] = found.get(name, 0) + 1
    return found


@pytest.fixture
def scene_of_the_demo():
    return str(ROOT / "runs" / "sedimentation.yaml")


@pytest.mark.parametrize("option", OTHER_MODES)
def test_option_of_another_mode(run, scene_of_the_demo, option):
    result = run([scene_of_the_demo, *option.split()])
    refused(result, f"is read only with {OTHER_MODES[option]}", option.split()[0])


def test_every_reader_has_a_row_and_every_row_a_reader():
    rows, reads = declared(), readers()
    assert len(rows) > 100
    assert set(reads) - set(rows) == set(), "read, but in no table"
    assert set(rows) - set(reads) == set(), "in a table, but read nowhere"
    assert len(looked_at()) > 10 and looked_at() - set(rows) == set(), "looked at, but in no table"


def test_one_reader_an_option():
    assert {name for name, n in readers().items() if n > 1} <= TWO_READERS


def test_no_room_sets_options_of_another():
    rows = declared()
    for path in sorted(ROOT.glob("src/**/*.c")):
        room = path.relative_to(ROOT / "src").parts[0]
        for name in re.findall(r"OptDefault\(\"(-\w+)\"", path.read_text()):
            assert rows.get(name, room) == room, f"{path} sets {name} of the room {rows[name]}: do it in src/run/defaults.c"


@pytest.mark.parametrize("scene", [True, False])
def test_help_prints_every_option_once_and_runs_nothing(run, scene_of_the_demo, scene):
    begin = time.monotonic()
    result = run([*([scene_of_the_demo] if scene else []), "-help", "expert"])
    assert result.status == 0 and not list(result.folder.iterdir()), str(result)
    assert time.monotonic() - begin < 20, "two seconds on an idle machine"
    printed = re.findall(r"^(-\S+?):? ", result.out, re.M)
    rows = declared()
    for name in rows:
        assert printed.count(name) == 1, f"{name} is printed {printed.count(name)} times"
    assert "-particle_<group>_radius" in printed and "PETSC ERROR" not in result.text
    plain = run([scene_of_the_demo, "-help"]).out
    hidden = set(printed) - set(re.findall(r"^(-\S+?):? ", plain, re.M))
    assert 15 <= len(hidden) <= 40 and f"{len(hidden)} more, for experts" in plain


def test_help_of_petsc_does_not_run(run, scene_of_the_demo):
    result = run([scene_of_the_demo, "-help", "petsc"])
    assert result.status == 0 and "-flow_ksp_type" in result.text, str(result)
    assert not list(result.folder.iterdir()), f"something was written\n{result}"


@pytest.mark.parametrize("word, names", [
    ("drag", {"-particle_<group>_reference_speed"}),  # by a keyword
    ("NU", {"-flow_viscosity", "-particle_<group>_poisson"}),  # what others call it, and no word that only begins so
    ("particle_disc_density", {"-particle_<group>_density"}), ("-sim_dt", {"-sim_dt"}),
    ("gmsh", {"-mesh_file", "-mesh_kind"}),  # words of the meaning
    ("ellipse semi-axis y", {"-particle_<group>_b"}), ("plot", {"-output_every"}),  # all of several words; by the shape
])
def test_help_of_a_word(run, word, names):
    result = run(["-help", *word.split()])
    assert result.status == 0 and set(re.findall(r"^(-\S+?):? ", result.out, re.M)) == names, result


def test_help_of_no_word(run):
    result = run(["-help", "zebra"], 2)
    assert result.status != 0 and result.err.count("tumble: error: no option has to do with 'zebra'") == 1, result


def test_version(run):
    out = run(["-version"]).out
    assert re.match(r"tumble \d+\.\d+\.\d+ \(commit \S+\)\n", out) and re.search(r"petsc", out, re.I), out


def test_options_md_is_what_the_program_prints(program):
    assert tell(program, "-help", "markdown") == (ROOT / "runs" / "reference" / "OPTIONS.md").read_text(), "run 'make options'"


def test_manual_page_has_all_options(program):
    page = tell(program, "-help", "man").replace("\\-", "-")
    for name in declared():
        assert re.search(rf"^\.B {re.escape(name)}( <.*)?$", page, re.M), f"{name} is missing"
