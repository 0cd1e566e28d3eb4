"""tools/fuzz: a short form of the table of random scenes; the table has all seeds and no bug; a bad end is told."""
import csv
import stat
import subprocess

from conftest import ROOT
from test_extremes import ENDINGS, FAKE, PYTHON

SEEDS = "3,16,26,41,45,57,93,154"  # plane, disc and space; three rungs, explicit, volume force, random and lattice


def fuzz(build, folder, *args):
    command = [PYTHON, str(ROOT / "tools" / "fuzz"), "--build", str(build), "--jobs", "2", "--output", str(folder / "result"), *args]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=200, check=False)


def read_outcomes(folder):
    with open(folder / "outcomes.csv", newline="") as file:
        return {int(row["seed"]): row for row in csv.DictReader(file)}


def test_some_seeds(program, tmp_path):
    done = fuzz(program.parent, tmp_path, "--seeds", SEEDS)
    rows = read_outcomes(tmp_path / "result")
    assert done.returncode == 0 and ",".join(map(str, rows)) == SEEDS, done.stdout + done.stderr
    assert {row["verdict"] for row in rows.values()} == {"ok", "stopped"}, done.stdout


def test_table_of_the_tree():
    rows = read_outcomes(ROOT / "runs" / "fuzz")
    assert list(rows) == list(range(1, 331)) and not [seed for seed, row in rows.items() if row["verdict"] == "BUG"]


def test_bad_ends(tmp_path):
    for name, (ending, message) in ENDINGS.items():
        (tmp_path / "tumble").write_text(FAKE.format(ending=ending))
        (tmp_path / "tumble").chmod(stat.S_IRWXU)
        done = fuzz(tmp_path, tmp_path, "--seeds", "3", "--limit", "2")
        row = read_outcomes(tmp_path / "result")[3]
        assert done.returncode == 1 and row["verdict"] == "BUG" and message in row["message"], f"{name}: {done.stdout}{done.stderr}"
