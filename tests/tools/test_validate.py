"""tools/validate: values are taken from the run, judged, and mistakes in a declaration are told."""
import csv
import subprocess
import sys

import pytest
from conftest import ROOT, SCENE, environment

CASE = """\
[disc]
scene = "{scene}"
options = "-sim_steps 3"
minutes = 0.1
source = "book"
quantities = [
  {{ value = "steps", reference = 3, tolerance = 0 }},
  {{ name = "fall", value = "-body(0).last('v') / body(0).smallest('v')", reference = -1, relative = 1e-9, source = "paper" }},
  {{ value = "at('time', 0.0125) + first('time') + mean('time', 0.007)", reference = 0.03, relative = 1e-6 }},
  {{ value = "unknowns", at_most = 10 }},
  {{ value = "unknowns", at_least = 10 }},
  {{ value = "nothing", reference = 1, tolerance = 1 }},
]
"""


def validate(folder, program, *args):
    words = ["--cases", str(folder), "--results", str(folder / "results"), "--build", str(program.parent)]
    return subprocess.run([sys.executable, str(ROOT / "tools" / "validate"), *words, *args], cwd=folder, env=environment(), capture_output=True, text=True, timeout=120, check=False)


KISS = """\
[kiss]
scene = "{scene}"
minutes = 0.1
source = "exact"
quantities = [
  {{ value = "kiss_time()", reference = 0.3, tolerance = 1e-6 }},
  {{ value = "kiss_time(1, 0, 1.5)", reference = 0.255, tolerance = 1e-6 }},
  {{ value = "distance(0.21)", reference = 0.195, tolerance = 1e-6 }},
  {{ value = "tilt(0.21)", reference = 90, tolerance = 1e-9 }},
  {{ value = "body(0).crossing('x', 0.34)", reference = 0.19, tolerance = 1e-6 }},
  {{ value = "rms([x + y for x, y in zip(body(0).column('x'), body(1).column('x'))])", reference = 0.895, tolerance = 1e-6 }},
]
"""
MEET = """mesh: {cells: [4, 4], lower: [0, 0], upper: [1, 1]}
flow: {active: false}
particle:
  groups: a, b
  a: {shape: circle, radius: 0.05, density: 1, position: [0.245, 0.5], velocity: [0.5, 0]}
  b: {shape: circle, radius: 0.05, density: 1, position: [0.65, 0.5], velocity: [-0.5, 0]}
contact: {law: none}
sim: {dt: 0.02, steps: 16}
"""


def declare(folder, text=CASE):
    (folder / "disc.yaml").write_text(SCENE)
    (folder / "case.toml").write_text(text.format(scene=folder / "disc.yaml"))


def test_verdicts(program, tmp_path):
    declare(tmp_path)
    done = validate(tmp_path, program)
    assert done.returncode == 1, done.stdout + done.stderr
    with open(tmp_path / "results" / "table.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["verdict"].split(" (")[0].split(":")[0] for row in rows] == ["within", "within", "within", "NOT within", "within", "not"], rows
    assert rows[0]["ours"] == "3" and rows[1]["quantity"] == "fall" and [row["source"] for row in rows[:2]] == ["book", "paper"]
    assert "1 cases, about 0 minutes" in done.stdout and done.stdout.endswith("4 within tolerance, 2 not\n")
    shown = validate(tmp_path, program, "--show")
    assert shown.returncode == 1 and shown.stdout.splitlines()[-7:] == done.stdout.splitlines()[-7:]


EACH = """\
[disc]
scene = "{scene}"
options = "-sim_dt 0.01"
each = ["-sim_steps 3", "-sim_steps 2", "-sim_steps 4"]
minutes = 0.1
quantities = [
  {{ value = "steps", reference = 3.4, tolerance = 1.4 }},
  {{ value = "steps", at_most = 4 }},
  {{ value = "steps", at_least = 2.5 }},
  {{ name = "spread", value = "steps", spread = true, reference = 0.6666667, relative = 1e-6 }},
]
"""


def test_worst_of_several_runs(program, tmp_path):
    """A case of three runs: the one farthest from the reference, the largest, the smallest, and how far they lie apart."""
    declare(tmp_path, EACH)
    (tmp_path / "disc.yaml").write_text(MEET)
    done = validate(tmp_path, program)
    with open(tmp_path / "results" / "table.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["ours"] for row in rows] == ["2", "4", "2", "0.66666667"], done.stdout + done.stderr
    assert [row["verdict"].startswith("within") for row in rows] == [True, True, False, True]
    assert validate(tmp_path, program, "--list").stdout.count("-sim_dt 0.01 -sim_steps") == 3


SPACE = MEET.replace("[4, 4], lower: [0, 0], upper: [1, 1]", "[4, 4, 4], lower: [0, 0, 0], upper: [1, 1, 1]")
SPACE = SPACE.replace("[0.245, 0.5], velocity: [0.5, 0]", "[0.5, 0.5, 0.245], velocity: [0, 0, 0.5]").replace("[0.65, 0.5], velocity: [-0.5, 0]", "[0.5, 0.5, 0.65], velocity: [0, 0, -0.5]")


@pytest.mark.parametrize("scene, axis", [(MEET, "x"), (SPACE, "z")])
def test_kiss_time(program, tmp_path, scene, axis):
    """Two discs, or spheres, 0.405 apart approach with speed 1: 1.05 diameters after 0.3, 1.5 after 0.255."""
    declare(tmp_path, KISS.replace("'x'", f"'{axis}'").replace("= 90", "= 90" if axis == "x" else "= 0"))
    (tmp_path / "disc.yaml").write_text(scene)
    done = validate(tmp_path, program)
    assert done.returncode == 0, done.stdout + done.stderr


POINTS = """\
[points]
scene = "{scene}"
minutes = 0.1
source = "book"
quantities = [
  {{ value = "rms([3, -4, 0, 0])", reference = 2.5, tolerance = 1e-12 }},
  {{ value = "rms([body(0).at('v', 0.1) - v for t, v in published('sedimentation', 'fall_speed') if t < 0.1])", reference = 2.96, tolerance = 1e-9 }},
  {{ value = "rms([v for t, v in published('nothing', 'fall_speed')])", at_least = 0 }},
]
"""


def test_published_points(program, tmp_path):
    """Points of runs/reference, one of them before t = 0.1, against a body that does not fall; a scene without points is told."""
    declare(tmp_path, POINTS)
    (tmp_path / "disc.yaml").write_text(MEET)
    done = validate(tmp_path, program)
    assert done.returncode == 1 and "2 within tolerance, 1 not" in done.stdout and "nothing.csv" in done.stdout, done.stdout + done.stderr


def test_stopped_run(program, tmp_path):
    declare(tmp_path, CASE.replace("-sim_steps 3", "-flow_viscosity -1"))
    done = validate(tmp_path, program)
    assert done.returncode == 1 and "0 within tolerance, 6 not" in done.stdout and "not: stopped: Option -flow_viscosity = -1" in done.stdout, done.stdout


def test_mistakes(program, tmp_path):
    cases = [
        (CASE.replace("minutes", "hours"), (), "unknown key 'hours'"),
        (CASE.replace("minutes = 0.1\n", ""), (), "key 'minutes' is missing"),
        (CASE.replace("reference = 3, tolerance = 0", "reference = 3"), (), "'steps' needs tolerance (absolute) or relative"),
        (CASE.replace("at_most = 10", "at_most = 10, at_least = 1"), (), "one of reference, at_most, at_least"),
        (CASE.replace('"steps", ', '"steps", spread = true, '), (), "the case needs two options or more in each"),
        (CASE, ("box",), "no case 'box' (there are: disc)"),
        (CASE, ("--longest", "0.05"), "no case is left"),
    ]
    for text, args, phrase in cases:
        declare(tmp_path, text)
        done = validate(tmp_path, program, *args)
        assert done.returncode == 2 and phrase in done.stderr, done.stderr
    declare(tmp_path)
    assert "-sim_steps 3" in validate(tmp_path, program, "--list").stdout


PRESETS = """\
[presets.disc]
scene = "{scene}"
options = "-mesh_cells 40,120 -sim_steps 2"
minutes = 0.1
quantities = [
  {{ value = "steps", converged = 2, source = "exact" }},
  {{ name = "rank", value = "ranks - 1", converged = 0, scale = 1, source = "exact" }},
]

[presets.coarse]
scene = "{scene}"
options = "-mesh_cells 16,48 -sim_steps 2"
minutes = 0.2
quantities = [{{ value = "steps", converged = 3, source = "wrong" }}]
"""


def test_presets(program, tmp_path):
    """The table scene x preset: values, deviations, the message of a refusal, holes that a later run fills and an earlier row that stays."""
    declare(tmp_path, PRESETS)
    done = validate(tmp_path, program, "--presets", "disc")
    assert done.returncode == 0 and "6 kept, 0 not, 0 not run" in done.stdout, done.stdout + done.stderr
    assert (tmp_path / "results" / "presets.md").read_text().count("| not run |") == 3
    with open(tmp_path / "results" / "presets.md", "a") as page:
        page.write("\n## Costs\n\nMuch.\n")
    done = validate(tmp_path, program, "--presets", "coarse")
    assert done.returncode == 1 and "2 kept, 1 not, 0 not run" in done.stdout, done.stdout + done.stderr
    assert (tmp_path / "results" / "presets.md").read_text().endswith("|\n\n## Costs\n\nMuch.\n")  # by hand
    with open(tmp_path / "results" / "presets.csv", newline="") as file:
        rows = {(row["scene"], row["preset"], row["quantity"]): row for row in csv.DictReader(file)}
    assert len(rows) == 9 and rows["disc", "fast", "rank"]["verdict"] == "within" and float(rows["disc", "accurate", "steps"]["cpu_seconds"]) > 0
    assert rows["coarse", "fast", "steps"]["verdict"] == "NOT within" and rows["coarse", "fast", "steps"]["deviation_percent"] == "-33.3"
    assert rows["coarse", "balanced", "steps"]["verdict"].startswith("refused: -preset balanced cannot keep its 1 % here: group 'disc' is 2.0 cells")
    declare(tmp_path, PRESETS.replace("converged = 2", "converged = 2.03"))  # judged anew
    assert "6 kept, 3 not, 0 not run" in validate(tmp_path, program, "--presets", "--show").stdout


STEADY = """\
mesh: {cells: [6, 4], lower: [0, 0], upper: [1, 1]}
flow: {density: 1, viscosity: 0.1, bc_top: {type: moving_wall, velocity: [1, 0]}}
sim: {steady: true}
"""
ALIKE = """\
[presets.box]
scene = "box.yaml"
minutes = 0.1
quantities = [{{ value = "steps", converged = 1, source = "exact" }}]

[presets.bed]
scene = "bed.yaml"
reason = "chaotic"
"""


def test_presets_that_are_alike(program, tmp_path):
    """Without bodies balanced and accurate are one direct solve: no seconds of its own. A scene without a value has its reason as row."""
    (tmp_path / "box.yaml").write_text(STEADY)
    declare(tmp_path, ALIKE.replace("box.yaml", str(tmp_path / "box.yaml")))
    done = validate(tmp_path, program, "--presets")
    assert done.returncode == 0 and "3 kept, 0 not, 0 not run" in done.stdout, done.stdout + done.stderr
    with open(tmp_path / "results" / "presets.csv", newline="") as file:
        rows = {(row["scene"], row["preset"]): row for row in csv.DictReader(file)}
    assert float(rows["box", "fast"]["cpu_seconds"]) > 0 and rows["box", "accurate"]["cpu_seconds"].startswith("= ")
    assert rows["bed", "-"]["verdict"] == "no promise: chaotic"
    declare(tmp_path, ALIKE.replace('"chaotic"', '"chaotic"\nminutes = 1'))
    assert "a scene with a reason has nothing else" in validate(tmp_path, program, "--presets").stderr


def test_prices(program, tmp_path):
    """A preset that is cheaper than the one before is told."""
    declare(tmp_path, PRESETS.replace("[presets.coarse]", "[presets.other]"))
    heads = "scene,preset,quantity,value,converged,deviation_percent,promise_percent,cpu_seconds,verdict"
    rows = [f"disc,{preset},{name},{value},2,0,5,{seconds},within" for preset, seconds in (("fast", 2), ("balanced", 1), ("accurate", 3)) for name, value in (("steps", 2), ("rank", 0))]
    (tmp_path / "results").mkdir(exist_ok=True)
    (tmp_path / "results" / "presets.csv").write_text("\n".join([heads, *rows]) + "\n")
    done = validate(tmp_path, program, "--presets", "--show", "disc")
    assert done.returncode == 1 and "6 kept, 0 not" in done.stdout and "not dearer: disc: balanced takes 1 s, fast 2 s" in done.stdout, done.stdout


def test_table_of_the_tree(program, tmp_path):
    """Every scene is in the table, without a hole; all that is asked for is kept, and dearer from left to right."""
    table = tmp_path / "presets.csv"
    for suffix in (".csv", ".md"):  # the page with its notes below the table, which are kept
        table.with_suffix(suffix).write_text((ROOT / "runs" / "validate" / "presets").with_suffix(suffix).read_text())
    words = ["--presets", "--show", "--build", str(program.parent), "--table", str(table)]
    done = subprocess.run([sys.executable, str(ROOT / "tools" / "validate"), *words], cwd=ROOT, env=environment(), capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0 and " 0 not, 0 not run" in done.stdout, done.stdout + done.stderr
    with open(table, newline="") as file:
        listed = {row["scene"] for row in csv.DictReader(file)}
    files = (ROOT / "runs" / "validate").glob("*.toml")
    declared = {line[9:-1] for file in files for line in file.read_text().splitlines() if line.startswith("[presets.")}
    assert listed == {path.stem for path in (ROOT / "runs").glob("*.yaml")} | declared
    assert table.with_suffix(".md").read_text() == (ROOT / "runs" / "validate" / "presets.md").read_text()


def test_mistakes_of_presets(program, tmp_path):
    for text, phrase in ((PRESETS.replace("minutes", "hours", 1), "unknown key 'hours'"), (PRESETS.replace(', scale = 1', ""), "converges to 0"), (CASE, "no list of cases declares")):
        declare(tmp_path, text)
        done = validate(tmp_path, program, "--presets")
        assert done.returncode == 2 and phrase in done.stderr, done.stderr


def test_presets_keep_their_promise(program, tmp_path):
    """Three cheap scenes of the tree with each preset; all others: tools/validate --presets."""
    words = ["--build", str(program.parent), "--results", str(tmp_path)]
    scenes = ["cylinder-2d1", "rotating-container", "rotating-container-immersed"]
    done = subprocess.run([sys.executable, str(ROOT / "tools" / "validate"), "--presets", *scenes, *words], cwd=ROOT, env=environment(), capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0 and "12 kept, 0 not, 0 not run" in done.stdout and "refused" not in done.stdout, done.stdout + done.stderr


def test_numbers_of_headers_hold():
    """Headers of scenes, README and gallery say what results.csv has."""
    done = subprocess.run([sys.executable, str(ROOT / "tools" / "validate"), "--said"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_stale_number_is_told_and_written(tmp_path, program):
    scene = tmp_path / "disc.yaml"
    scene.write_text("# A disc. Here 3.14,\n# 12,000 cells and -2e-5, +.500 %.\n")
    (tmp_path / "results.csv").write_text("case,quantity,ours,commit\ndisc,way,3.1449,a\ndisc,cells,13456,a\ndisc,low,-2.04e-5,a\ndisc,up,1.0071,a\n")
    sentence = "Here {disc: way}, {disc: cells} cells and {disc: low}, {disc: up | 100 * (x - 1)} %."
    (tmp_path / "said.toml").write_text(f'[[said]]\nfile = "{scene}"\ntext = "{sentence}"\n')
    done = validate(tmp_path, program, "--said")
    assert done.returncode == 1 and done.stdout.splitlines() == [f"{scene}: 12,000 for disc: cells, measured 13,456", f"{scene}: +.500 for disc: up, measured +.710"], done.stdout
    assert validate(tmp_path, program, "--said", "--write").returncode == 0
    assert scene.read_text() == "# A disc. Here 3.14,\n# 13,456 cells and -2e-5, +.710 %.\n"
    assert validate(tmp_path, program, "--said").stdout == "all numbers hold\n"
    scene.write_text("# A disc.\n")
    assert "no longer says" in validate(tmp_path, program, "--said").stdout
    (tmp_path / "results.csv").unlink()
    scene.write_text("# Here 3.14, 12,000 cells and -2e-5, +.500 %.\n")
    assert "tools/validate --store disc" in validate(tmp_path, program, "--said").stdout


def test_ledger(tmp_path):
    """One page of all claims: what is kept, what is not, which is told and fails, and holes; a value is judged by the claim of today."""
    (tmp_path / "list.toml").write_text(
        '[disc]\nscene = "a.yaml"\nminutes = 1\nsource = "book"\nquantities = [{ name = "fall", value = "x", reference = 2, relative = 0.01 }, { name = "turn", value = "y", at_most = 1 }]\n'
        '[presets.disc]\nscene = "a.yaml"\nminutes = 1\nquantities = [{ name = "fall", value = "x", converged = 2, source = "exact" }]\n')
    (tmp_path / "results.csv").write_text("case,quantity,ours,commit\ndisc,fall,2.001,a\n")
    head = "scene,preset,quantity,value,converged,deviation_percent,promise_percent,cpu_seconds,verdict\n"

    def ledger():
        words = [sys.executable, str(ROOT / "tools" / "validate"), "--ledger", "--cases", str(tmp_path)]
        return subprocess.run(words, cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=60, check=False)

    (tmp_path / "presets.csv").write_text(head + "disc,fast,fall,1.95,2,-2.5,5,0.1,within\ndisc,accurate,fall,,2,,0.2,0.1,refused: thin\n")
    good = ledger()
    page = (tmp_path / "README.md").read_text()
    assert not good.returncode and "5 claims: 2 within, 1 refused by the preset, 0 NOT within, 2 not run." in page, page
    assert "| disc: fall | 2 | book | 2.001 | 1 % | within (+0.05 %) |" in page and "| disc: turn | <= 1 | book |  |  | not run |" in page
    assert "| disc, preset fast: fall | 2 | exact | 1.95 | 5 % | within (-2.5 %) |" in page
    (tmp_path / "presets.csv").write_text(head + "disc,balanced,fall,1.95,2,-2.5,1,0.1,within\n")
    bad = ledger()
    assert bad.returncode == 1 and "NOT kept: disc, preset balanced: fall: 1.95 for 2" in bad.stdout, bad.stdout
    assert "* NOT kept: disc, preset balanced: fall" in (tmp_path / "README.md").read_text()
