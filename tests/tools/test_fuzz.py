"""tools/fuzz: a short form of the table of random scenes; the table has all seeds and no bug; a bad end is told."""
import csv
import hashlib
import json
import math
import re
import stat
import subprocess
import sys
import types

from conftest import ROOT
from test_extremes import ENDINGS, FAKE, PYTHON

SEEDS = "3,16,26,41,45,57,93,154"  # plane, disc and space; three methods, explicit, volume force, random and lattice


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
    assert list(rows)[:330] == list(range(1, 331)) and not [seed for seed, row in rows.items() if row["verdict"] == "BUG"]


def test_seeds_stay_what_they_are():
    """Scenes by their seeds: the same ones whatever is added, of all generators."""
    sys.path.insert(0, str(ROOT / "tools"))
    try:
        from kinds import fuzz, fuzzkinds
    finally:
        sys.path.pop(0)
    scenes = json.dumps([fuzz.draw_scene(seed)[:2] for seed in range(1, 331)])
    scenes = re.sub(r"-?\d+\.\d+(e-?\d+)?", lambda number: f"{float(number[0]):.8g}", scenes)  # powers differ between machines in their last digits
    assert hashlib.sha256(scenes.encode()).hexdigest()[:16] == "700ceab18ce8683a"
    for seed in range(4001, 4041):
        kind, scene, ranks, *_ = fuzzkinds.draw_kind(seed)
        assert kind == "solids" and ranks in (1, 2) and any("material" in body for body in scene["particle"].values() if isinstance(body, dict))
    for seed in range(3501, 3541):
        kind, scene, ranks, s, *_ = fuzzkinds.draw_kind(seed)
        assert kind == "drops" and ranks in (1, 2) and s.dim == scene["mesh"]["dimension"] == len(s.cells) == 3 and max(s.cells) <= 12
    for kind, seed in zip(fuzzkinds.KINDS, range(fuzzkinds.FIRST, fuzzkinds.FIRST + 5)):
        assert fuzzkinds.draw_kind(seed)[0] == kind
        assert fuzzkinds.draw_kind(seed)[1:3] == fuzzkinds.draw_kind(seed)[1:3] != fuzzkinds.draw_kind(seed + 5)[1:3]


def test_checks_find_what_is_wrong():
    """A body in a wall, one outside, a rebound above e, a pendulum that gains, a slide that sticks, a restart that jumps."""
    sys.path.insert(0, str(ROOT / "tools"))
    try:
        from kinds import fuzzkinds
    finally:
        sys.path.pop(0)

    class Fake:
        def __init__(self, *rows):
            self.rows = [{"step": k, "body": 0, "group": "one", "time": k, "x": 0, "y": 0, "z": 0, "radius": 1, **row} for k, row in enumerate(rows)]

        def bodies(self):
            return self.rows

    s = types.SimpleNamespace(dim=2, h=1)
    scene = {"particle": {"one": {"shape": "circle", "velocity": [-2, 0]}}}
    walls = fuzzkinds.check_walls(lambda x: 3 - math.hypot(*x))
    assert walls(Fake({}, {"x": 2}), scene, s) == "" and "in a wall" in walls(Fake({}, {"x": 2.1}), scene, s) and "outside" in walls(Fake({"x": 4}, {}), scene, s)
    rebound = fuzzkinds.check_rebound(0, 0.5)
    assert rebound(Fake({"u": -2}, {"u": -1.8}, {"u": 0.9}), scene, s) == "" and "rebound of 0.6" in rebound(Fake({"u": -2}, {"u": -1.8}, {"u": 1.2}), scene, s)
    assert "gains speed" in rebound(Fake({"u": -2}, {"u": -2.1}), scene, s)
    still, gains = {"omega_z": 0, "angle": 0}, {"omega_z": 3, "angle": 0.1}
    pendulum = fuzzkinds.check_pendulum(1, 1, 1, False)
    assert "hangs still" in pendulum(Fake(still, still), scene, s) and "energy" in pendulum(Fake(still, gains), scene, s)
    falls = {"angle": -0.3, "omega_z": math.sqrt(2 * math.sin(0.3) / 1.5)}
    assert pendulum(Fake(still, falls), scene, s) == ""
    slide = fuzzkinds.check_slide([0.6, -0.8], 1)
    assert slide(Fake({"u": 0, "v": 0}, {"u": 0.48, "v": -0.64}), scene, s) == "" and "slide" in slide(Fake({"u": 0, "v": 0}, {"u": 0, "v": 0}), scene, s)
    assert fuzzkinds.compare_runs(Fake({}, {}), Fake({}, {"x": 0.01}), s) == "" and "elsewhere" in fuzzkinds.compare_runs(Fake({}, {}), Fake({}, {"x": 0.2}), s)


def test_bad_ends(tmp_path):
    for name, (ending, message) in ENDINGS.items():
        (tmp_path / "tumble").write_text(FAKE.format(ending=ending))
        (tmp_path / "tumble").chmod(stat.S_IRWXU)
        done = fuzz(tmp_path, tmp_path, "--seeds", "3", "--limit", "2")
        row = read_outcomes(tmp_path / "result")[3]
        assert done.returncode == 1 and row["verdict"] == "BUG" and message in row["message"], f"{name}: {done.stdout}{done.stderr}"
