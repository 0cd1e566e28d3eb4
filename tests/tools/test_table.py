"""tools/table: combinations are run, laid out as markdown, and failed runs are told."""
import subprocess
import sys

from conftest import ROOT, SCENE, environment


def table(folder, program, *args):
    (folder / "disc.yaml").write_text(SCENE)
    command = [sys.executable, str(ROOT / "tools" / "table"), "disc.yaml", "--ranks", "1", "--build", str(program.parent), *args]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)


def cells(done):
    assert done.returncode == 0, done.stdout + done.stderr
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in done.stdout.splitlines() if line.startswith("|")]


def test_combinations(program, tmp_path):
    done = table(tmp_path, program, "-mesh_cells", "8,24/12,36", "-sim_dt", "0.01/0.005", "-output_every", "0", "--show", "steps,cells,fall_speed_max,nothing")
    heading, rule, *rows = cells(done)
    assert heading == ["mesh_cells", "sim_dt", "steps", "cells", "fall_speed_max", "nothing"] and rule == ["---"] * 6
    assert [row[:4] for row in rows] == [["8,24", "0.01", "2", "192"], ["8,24", "0.005", "2", "192"], ["12,36", "0.01", "2", "432"], ["12,36", "0.005", "2", "432"]]
    assert float(rows[0][4]) > float(rows[1][4]) > 0 and rows[0][5] == "-"
    assert not (tmp_path / "out").exists()


def test_across_and_kept(program, tmp_path):
    args = ["-mesh_cells", "8,24/12,36", "-sim_steps", "1/2", "--across", "sim_steps", "--show", "steps,seconds.total", "--keep", "kept"]
    heading, _, *rows = first = cells(table(tmp_path, program, *args))
    assert heading == ["mesh_cells", "steps, sim_steps 1", "steps, sim_steps 2", "seconds.total, sim_steps 1", "seconds.total, sim_steps 2"]
    assert [row[:3] for row in rows] == [["8,24", "1", "2"], ["12,36", "1", "2"]]
    assert cells(table(tmp_path, program, *args)) == first, "the kept runs were repeated"


def test_failed_run(program, tmp_path):
    done = table(tmp_path, program, "-flow_viscosity", "0.1/-1", "--show", "steps")
    assert cells(done)[2:] == [["0.1", "2"], ["-1", "stopped"]]
    assert "* -1: stopped before the first step: Option -flow_viscosity = -1 is outside its range" in done.stdout
    assert table(tmp_path, program, "-flow_viscosity", "-2/-1").returncode == 1


def test_mistakes(program, tmp_path):
    for args, phrase in [(["word"], "'word' belongs to no option"), (["--across", "sim_dt"], "has not several values"), (["-output_dir", "x"], "--keep")]:
        done = table(tmp_path, program, *args)
        assert done.returncode == 2 and phrase in done.stderr, done.stderr


STUDY = """\
scene = "disc.yaml"
options = { sim_steps = ["1", "2"], output_every = 0 }
show = ["steps", "-2 * body(0).last('v')", "nonsense(1)"]
ranks = 1
"""


def test_declared_in_a_file(program, tmp_path):
    """The same table from a file, with an expression; the command line wins; a mistake in the file is told."""
    (tmp_path / "study.toml").write_text(STUDY)
    (tmp_path / "disc.yaml").write_text(SCENE)

    def study(*args):
        words = [sys.executable, str(ROOT / "tools" / "study"), "study.toml", "--build", str(program.parent), *args]
        return subprocess.run(words, cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=120, check=False)

    heading, _, *rows = cells(study())
    assert heading[:2] == ["sim_steps", "steps"] and [row[:2] for row in rows] == [["1", "1"], ["2", "2"]]
    assert float(rows[1][2]) > float(rows[0][2]) > 0 and rows[0][3] == "-"
    assert cells(study("-sim_steps", "1", "--show", "steps"))[2:] == [["1"]]
    (tmp_path / "study.toml").write_text(STUDY.replace("show", "shwo"))
    assert "unknown key 'shwo'" in study().stderr
