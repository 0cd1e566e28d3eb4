"""Helpers for the end-to-end tests: run the program under mpiexec on small scenes in a temporary folder.

The program is taken from the folder $TUMBLE_BUILD (default: build), the launcher from $MPIEXEC. How tests are collected, limited in time
and counted stands in collector.py.
"""
import csv
import os
import re
import subprocess
from pathlib import Path

import pytest

import collector
from collector import ROOT, build_folder, launch_words
from packages import packages  # noqa: F401  (a fixture)

# A small, fast settling disc; boundaries default to no_slip walls.
SCENE = """\
mesh: {cells: [8, 24], lower: [0, 0], upper: [2, 6]}
flow: {density: 1, viscosity: 0.1, gravity: [0, -981]}
particle:
  groups: disc
  disc: {shape: circle, radius: 0.125, density: 1.25, position: [1, 4]}
sim: {dt: 0.005, steps: 2}
"""


def pytest_configure(config):
    config.pluginmanager.register(collector)


def edited(old, new, text=SCENE):
    """SCENE with one place changed; the place must be there, so that a test cannot lose its subject."""
    assert text.count(old) == 1, f"'{old}' must stand once in the scene"
    return text.replace(old, new)


def read_rows(path):
    """Rows of a table of a run: all but the names of groups are numbers."""
    with open(path) as file:
        return [{key: text if key == "group" else float(text) for key, text in row.items()} for row in csv.DictReader(file)]


class Result:
    """What a run left behind: exit status, everything printed, and the command that repeats it."""

    def __init__(self, command, folder, status, out, err):
        self.command, self.folder, self.status, self.out, self.err = command, Path(folder), status, out, err
        self.text = out + err

    def __str__(self):
        return f"in {self.folder}: {self.command}\nexit status {self.status}\n{self.text[-6000:]}"

    def steps(self):
        """Rows of all series.csv below the folder (without headings): the steps that were reported."""
        rows = 0
        for path in self.folder.rglob("series.csv"):
            rows += sum(1 for line in path.read_text().splitlines() if re.match(r"\s*[-+0-9.]", line))
        return rows


@pytest.fixture(scope="session")
def program():
    path = build_folder() / "tumble"
    if not path.is_file():
        pytest.fail(f"{path} is missing: run 'make', or name the build folder in TUMBLE_BUILD")
    return path


def environment():
    """For the program; the rest was set for all tests by collector.py."""
    env = dict(os.environ)
    env.pop("PETSC_OPTIONS", None)
    return env


@pytest.fixture
def command(program):
    """command(args, ranks=1): what to execute."""
    return lambda args, ranks=1: launch_words([program, *args], ranks)


@pytest.fixture
def run(command, tmp_path):
    """run(args, ranks=1, timeout=120): run the program in the temporary folder of the test; see Result."""

    def start(args, ranks=1, timeout=120):
        words = command(args, ranks)
        try:
            done = subprocess.run(words, cwd=tmp_path, env=environment(), capture_output=True, text=True, errors="replace", timeout=timeout)
        except subprocess.TimeoutExpired:
            pytest.fail(f"no end after {timeout} s: {' '.join(words)}")
        return Result(" ".join(words), tmp_path, done.returncode, done.stdout, done.stderr)

    return start


@pytest.fixture
def scene(tmp_path):
    """scene(text=SCENE, name="disc.yaml"): write a scene file into the temporary folder of the test, return its name."""

    def write(text=SCENE, name="disc.yaml"):
        (tmp_path / name).write_text(text)
        return name

    return write
