"""tools/tradeoff: ladder, errors, front and recommendation; -preset of the program."""
import csv
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from conftest import ROOT, SCENE, edited
from drawn import assert_has_colour, keep_figures

sys.path.insert(0, str(ROOT / "tools"))
import kinds.tradeoff as kind  # noqa: E402

PYTHON = "/usr/bin/python3" if Path("/usr/bin/python3").exists() else sys.executable
LADDERS = """\
[presets]
fast = { flow_solver = "fast", couple_method = "nodal" }

[disc]
quantity = "-body(0).last('v')"
finest = "-mesh_cells 12,36 -sim_dt 0.0025 -sim_steps 4"
shift = "-mesh_shift_seed {n}"

[disc.axes.solver]
fast = "-flow_solver fast -couple_method nodal"
direct = "-flow_solver direct"

[disc.axes.step]
"dt" = ""
"dt/2" = "-sim_dt {dt/2} -sim_steps 4"
"wrong" = "-sim_dt 0"
"""


@pytest.fixture
def tradeoff(program, tmp_path):
    (tmp_path / "disc.yaml").write_text(SCENE)
    (tmp_path / "ladders.toml").write_text(LADDERS)

    def start(*args):
        command = [PYTHON, str(ROOT / "tools" / "tradeoff"), "disc.yaml", "--ladders", "ladders.toml", "--output", "result", "--build", str(program.parent), *args]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False)

    return start


def test_ladder(tradeoff, tmp_path):
    done = tradeoff()
    assert done.returncode == 0, done.stdout + done.stderr
    with open(tmp_path / "result" / "disc.csv", newline="") as file:
        rows = {row["point"]: row for row in csv.DictReader(file)}
    assert list(rows) == ["finest", "fast dt", "fast dt/2", "fast wrong", "direct dt", "direct dt/2", "direct wrong"]
    assert rows["finest"]["front"] == "reference" and float(rows["finest"]["error"]) == 0
    assert rows["fast wrong"]["ended"].startswith("stopped: ") and not rows["fast wrong"]["error"]
    points = {name: (float(row["error"]), float(row["cpu_s"])) for name, row in rows.items() if row["error"] and name != "finest"}
    right = float(rows["finest"]["value"])
    for name, (error, cpu) in points.items():
        assert error == pytest.approx(abs(float(rows[name]["value"]) / right - 1), rel=0.01) and cpu > 0
        beaten = any(e <= error and c <= cpu and (e, c) != (error, cpu) for e, c in points.values())
        assert (rows[name]["front"] == "yes") != beaten, rows[name]
    report = (tmp_path / "result" / "disc.md").read_text()
    assert re.search(r"\| fast dt \|.*\| fast \|", report) and "direct wrong: stopped" in report
    assert (tmp_path / "result" / "disc.png").is_file()
    with keep_figures() as seen:
        kind.draw(Path("disc.png"), "disc", tomllib.loads(LADDERS)["disc"], [], list(rows.values()))
    for name, (error, cpu) in points.items():
        front = rows[name]["front"] == "yes"
        assert_has_colour(seen["disc.png"].around(cpu, 100 * float(rows[name]["worst"])), "#1d3557" if front else "0.78", f"{name}, {'front' if front else 'beaten'}")
    least = min(points, key=lambda name: points[name])
    best = tradeoff("--read", "--target", f"{100 * points[least][0]:.6f}%")
    assert best.returncode == 0 and best.stdout.startswith(least), best.stdout + best.stderr
    worst = max(error for error, _ in points.values())
    shifted = (tmp_path / "result" / "disc.csv").read_text().replace(rows[least]["error"], f"{2 * worst}")
    (tmp_path / "result" / "disc-shift1.csv").write_text(shifted)
    other = tradeoff("--read", "--target", f"{101 * worst}%")  # what another shift spoils is not recommended
    assert other.returncode == 0 and not re.match(re.escape(least) + r"[^/]", other.stdout), other.stdout + other.stderr
    none = tradeoff("--read", "--target", "1e-12")
    assert none.returncode == 1 and "the best is '" in none.stdout
    (tmp_path / "ladders.toml").write_text(LADDERS + '[disc.presets]\nown = { flow_solver = "direct" }\n')
    report = tradeoff("--read").stdout  # presets of its own
    assert re.search(r"\| direct dt \|.*\| own \|", report) and not re.search(r"\| fast dt \|.*\| fast \|", report)


def test_mistakes(tradeoff, tmp_path):
    assert "give --quantity" in tradeoff("--ladders", str(ROOT / "runs" / "studies" / "tradeoff" / "ladders.toml")).stderr
    assert "run without --read" in tradeoff("--read").stderr
    (tmp_path / "ladders.toml").write_text(LADDERS.replace("finest =", "finst ="))
    assert "unknown key 'finst'" in tradeoff().stderr


def test_committed_ladders():
    with open(ROOT / "runs" / "studies" / "tradeoff" / "ladders.toml", "rb") as file:
        ladders = tomllib.load(file)
    assert list(ladders.pop("presets")) == ["fast", "balanced", "accurate"]
    for name, ladder in ladders.items():
        assert (ROOT / "runs" / f"{name}.yaml").is_file() and ladder["axes"] and ladder["quantity"], name


ADAPTIVE = ["sim_adapt true", "sim_adapt_max 0.005"]
PRESETS = {
    "fast": ["flow_solver fast", "couple_method penalty", "flow_time bdf2", "sim_adapt_tolerance 1e-2", "sim_adapt_displacement 1", *ADAPTIVE],
    "balanced": ["flow_solver balanced", "couple_method penalty", "flow_time bdf2"],
    "accurate": ["flow_solver balanced", "couple_method aligned", "flow_time bdf2", "sim_adapt_tolerance 1e-4", "sim_adapt_displacement 0.5", *ADAPTIVE],
}
MESH = ["-mesh_cells", "40,120", "-sim_steps", "1", "-output_overwrite", "-output_dir", "o"]


def holds(folder, lines):
    """Are these lines among the options that the run had?"""
    options = (folder / "o" / "options.txt").read_text()
    for line in lines:
        assert re.search(rf"^-?{line}$", options, re.M), f"{line} is not in\n{options}"


@pytest.mark.parametrize("preset", PRESETS)
def test_preset(run, scene, tmp_path, preset):
    done = run([scene(), *MESH, "-preset", preset])
    assert done.status == 0 and "replaces" not in done.out, done
    holds(tmp_path, PRESETS[preset])


def test_preset_is_balanced(run, scene, tmp_path):
    """Without a preset; what the scene says for itself stays, also beside a preset of the scene."""
    assert run([scene(), *MESH]).status == 0
    holds(tmp_path, PRESETS["balanced"])
    assert "preset" not in (tmp_path / "o" / "options.txt").read_text()  # a run of it promises no more
    own = SCENE + "couple: {method: aligned}\n"
    for text in own, own + "preset: accurate\n":
        done = run([scene(text), *MESH])
        assert done.status == 0 and "replaces" not in done.out, done
        holds(tmp_path, ["couple_method aligned"])


def test_preset_of_the_command_line(run, scene, tmp_path):
    """It replaces what the scene says, in one line; what the command line says for itself stays; cn is of second order as well."""
    own = edited("flow: {density: 1", "flow: {ksp_rtol: 1e-3, time: be, density: 1") + "couple: {method: nodal}\npreset: balanced\n"
    done = run([scene(own), *MESH, "-preset", "accurate", "-sim_adapt_displacement", "0.4"])
    assert done.status == 0 and done.out.count("replaces") == 1, done
    assert "preset accurate replaces flow_ksp_rtol 1e-3, couple_method nodal, flow_time be of the scene\n" in done.out, done
    holds(tmp_path, ["preset accurate", "flow_ksp_rtol 1e-8", "couple_method aligned", "flow_time bdf2", "sim_adapt_displacement 0.4"])
    done = run([scene(own.replace("time: be", "time: cn")), *MESH, "-preset", "balanced", "-couple_method", "aligned"])
    assert done.status == 0 and "preset balanced replaces flow_ksp_rtol 1e-3 of the scene\n" in done.out, done
    holds(tmp_path, ["couple_method aligned", "flow_time cn", "flow_ksp_rtol 1e-8"])


def test_preset_refuses(run, scene):
    """Asked for, a preset stops where it is known not to keep its promise; the default does not."""
    steps = ["-sim_steps", "1", "-output_overwrite"]
    refused = run([scene(), "-mesh_cells", "16,48", "-preset", "balanced", *steps])
    assert refused.status != 0 and "-preset balanced cannot keep its 1 % here: group 'disc' is 2.0 cells thick and needs 5.0." in refused.text, refused
    # accurate would be refused as well: for the boundary layer
    assert "use -preset fast (5 %)" in refused.text and "accurate" not in refused.text and run([scene(), "-mesh_cells", "16,48", *steps]).status == 0
    assert run([scene(), "-mesh_cells", "16,48", "-preset", "fast", *steps]).status == 0
    fixed = scene(edited("position: [1, 4]", "position: [1, 4], free: none"))
    assert run([fixed, "-mesh_cells", "16,48", "-preset", "fast", *steps]).status == 0
    refused = run([fixed, "-mesh_cells", "8,24", "-preset", "fast", *steps])
    assert refused.status != 0 and "-preset fast cannot keep its 5 % here: group 'disc' is 1.0 cells thick and needs 1.5." in refused.text, refused


def test_preset_yields(run, scene, tmp_path):
    """Options that are given win; explicit coupling keeps its time scheme; a scene without bodies takes a preset too."""
    done = run([scene(), "-mesh_cells", "32,96", "-preset", "accurate", "-couple_method", "nodal", "-couple_type", "explicit", "-sim_steps", "1", "-output_dir", "o"])
    assert done.status == 0, done
    options = (tmp_path / "o" / "options.txt").read_text()
    assert re.search(r"^-?couple_method nodal", options, re.M) and re.search(r"^-?flow_time be", options, re.M), options
    bare = SCENE[: SCENE.index("particle:")] + SCENE[SCENE.index("sim:") :]
    assert run([scene(bare), "-preset", "fast", "-sim_steps", "1", "-output_overwrite"]).status == 0
    wrong = run([scene(), "-preset", "fastest", "-output_overwrite"])
    assert wrong.status != 0 and "known: fast, balanced, accurate" in wrong.text
