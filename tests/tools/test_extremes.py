"""tools/extremes: each kind of ending is told apart, and the committed list of points is sound."""
import csv
import stat
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from conftest import ROOT
from drawn import assert_has_colour, keep_figures

sys.path.insert(0, str(ROOT / "tools"))
import kinds.extremes as kind  # noqa: E402

PYTHON = "/usr/bin/python3" if Path("/usr/bin/python3").exists() else sys.executable
POINTS = """\
[density]
title = "density"
scene = "runs/extremes/disc.yaml"
values = [10, 0.001, 1.1]
options = { particle_disc_density = "=a", mesh_cells = "16,16", sim_steps = 20 }
coupling = ["explicit"]
method = ["nodal"]
check = "v / time"
exact = "-981 * (a - 1) / (a + 1.03)"
tolerance = 0.1

[cavity]
title = "no body"
scene = "runs/bench/cavity.yaml"
values = [8]
options = { mesh_cells = "=str(a) + ',8'" }
check = "kinetic_energy"
compare = { sim_dt = 0.001, sim_steps = 6 }
tolerance = 0.05
"""
FAKE = """\
#!/bin/sh
case "$*" in *-help*) echo '-couple_method <nodal>: how (one of: nodal)'; exit 0;; esac
while [ "$1" != -output_dir ]; do shift; done
{ending}
"""
ENDINGS = {
    "crash": ("kill -SEGV $$", "crashed"),
    "hang": ("sleep 60", "no end within the time limit"),
    "nan": ("echo '{\"quantities\": {}}' > $2/summary.json; printf 'step,momentum_error,kinetic_energy\\n1,0,nan\\n' > $2/series.csv", "silent: kinetic_energy = nan in step 1"),
    "trace": ("echo '[0]PETSC ERROR: Corrupt argument' >&2; exit 1", "crashed"),
}


def extremes(folder, build, *args):
    (folder / "points.toml").write_text(POINTS)
    command = [PYTHON, str(ROOT / "tools" / "extremes"), "--points", "points.toml", "--output", "result", "--build", str(build), "--jobs", "1", *args]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)


def test_map(program, tmp_path):
    done = extremes(tmp_path, program.parent)
    assert done.returncode == 0, done.stdout + done.stderr
    with open(tmp_path / "result" / "map.csv", newline="") as file:
        rows = {(row["axis"], row["value"]): row for row in csv.DictReader(file)}
    assert [row["verdict"] for row in rows.values()] == ["ok", "stopped", "inaccurate", "ok"], done.stdout
    assert "Use -couple_type implicit" in rows["density", "0.001"]["message"]
    assert float(rows["density", "1.1"]["error"]) > 0.1 > float(rows["density", "10"]["error"]) > 0
    assert (tmp_path / "result" / "map.png").is_file()
    with keep_figures() as seen:
        kind.draw(tmp_path / "map.png", tomllib.loads(POINTS), list(rows.values()))
    for (x, y), row in zip([(0, -1.7), (1, -1.7), (2, -1.7), (0, -3.9)], rows.values()):  # a line of cells below each title
        assert_has_colour(seen["map.png"].around(x + 0.12, y - 0.3), kind.COLOUR[row["verdict"]], f"{row['axis']} = {row['value']}")
    command = rows["density", "10"]["command"]
    assert command.endswith("-output_overwrite") and "-particle_disc_density 10 " in command and "-couple_type explicit" in command
    again = extremes(tmp_path, program.parent, "--only", "cavity")
    assert again.returncode == 0 and "4 points" in again.stdout, again.stdout + again.stderr
    one = extremes(tmp_path, program.parent, "--point", "density/0.001/explicit/nodal")
    assert one.returncode == 0 and "stopped" in one.stdout, one.stdout + one.stderr


@pytest.mark.parametrize("kind", ENDINGS)
def test_bugs_are_found(tmp_path, kind):
    ending, phrase = ENDINGS[kind]
    fake = tmp_path / "fake" / "tumble"
    fake.parent.mkdir()
    fake.write_text(FAKE.replace("{ending}", ending))
    fake.chmod(fake.stat().st_mode | stat.S_IXUSR)
    done = extremes(tmp_path, fake.parent, "--only", "cavity", "--limit", "3")
    assert done.returncode == 1 and "1 BUG" in done.stdout and phrase in done.stdout, done.stdout + done.stderr


def test_committed_points():
    """Expressions of the list can be computed, and its scenes are there (their runs are 'make extremes')."""
    with open(ROOT / "runs" / "extremes" / "points.toml", "rb") as file:
        axes = tomllib.load(file)
    assert len(axes) >= 15
    names = {"a", "pi", "sqrt", "sin", "cos", "ceil", "min", "max", "int", "str", "abs"}
    for axis, entry in axes.items():
        assert (ROOT / entry["scene"]).is_file(), axis
        assert ("check" in entry) == ("exact" in entry or "compare" in entry) == ("tolerance" in entry), axis
        for text in [*entry.get("options", {}).values(), entry.get("ranks"), entry.get("exact")]:
            if isinstance(text, str) and (text.startswith("=") or text == entry.get("exact")):
                assert set(compile(text.removeprefix("="), axis, "eval").co_names) <= names, f"{axis}: {text}"
