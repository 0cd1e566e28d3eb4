"""tools/bench: rows are appended and hold what was measured; slow builds and foreign tables are refused."""
import csv
import re
import stat
import subprocess
import sys

from conftest import ROOT

CASES = """\
[box]
scene = "runs/bench/cavity.yaml"
sizes = [{ cells = 64, mesh_cells = "8,8" }, { cells = 144, mesh_cells = "12,12" }]
vary = { flow_solver = ["fast", "balanced"] }
ranks = [1]
steps = 6
skip = 1
quick = 1
"""


def bench(folder, build, *args, cases=CASES):
    (folder / "cases.toml").write_text(cases)
    command = [sys.executable, str(ROOT / "tools" / "bench"), "--cases", "cases.toml", "--results", "results.csv", "--build", str(build), *args]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)


def rows(folder):
    with open(folder / "results.csv", newline="") as file:
        return list(csv.DictReader(file))


def test_rows_are_appended(program, tmp_path):
    done = bench(tmp_path, program.parent, "--quick")
    assert done.returncode == 0, done.stdout + done.stderr
    first = rows(tmp_path)
    assert [row["options"] for row in first] == ["mesh_cells=8,8 flow_solver=fast", "mesh_cells=8,8 flow_solver=balanced"]
    for row in first:
        total, phases = float(row["total_s"]), sum(float(row[name]) for name in ("nse_s", "force_s", "particle_s"))
        assert (row["case"], row["cells"], row["unknowns"], row["bodies"], row["ranks"], row["steps"]) == ("box", "64", "770", "0", "1", "5")
        assert 0 < phases < 1.2 * total and float(row["spread"]) >= 0
        assert abs(float(row["unknowns_per_s"]) * total / 770 - 1) < 1e-2
        assert abs(float(row["sweeps_per_step"]) * float(row["sweep_ms"]) * 1e-3 / total - 1) < 1e-2
        assert 0.1 < float(row["triad_one_gbs"]) < 1000 and len(row["commit"]) >= 7
    done = bench(tmp_path, program.parent, "--cells", "144", "--vary", "flow_solver=fast", "--ranks", "2")
    assert done.returncode == 0, done.stdout + done.stderr
    both = rows(tmp_path)
    assert both[:2] == first and len(both) == 3 and (both[2]["cells"], both[2]["ranks"]) == ("144", "2")
    shown = bench(tmp_path, program.parent, "--show").stdout
    assert shown.count("| box |") == 3 and "mesh_cells=12,12 flow_solver=fast" in shown


def test_list_runs_nothing(program, tmp_path):
    done = bench(tmp_path, program.parent, "--list")
    assert done.returncode == 0 and done.stdout.count("tumble runs/bench/cavity.yaml") == 4, done.stdout + done.stderr
    assert bench(tmp_path, program.parent, "--list", "--device", "cuda").returncode != 0  # none of these is in space
    assert done.stdout.index("8,8") < done.stdout.index("12,12") and not (tmp_path / "results.csv").exists()


def test_debug_build_is_refused(tmp_path):
    fake = tmp_path / "slow" / "tumble"
    fake.parent.mkdir()
    fake.write_text('#!/bin/sh\nwhile [ "$1" != -output_dir ]; do shift; done\necho \'{"optimised": false}\' > "$2/summary.json"\n')
    fake.chmod(fake.stat().st_mode | stat.S_IXUSR)
    done = bench(tmp_path, fake.parent)
    assert done.returncode == 1 and "debug build" in done.stderr and not (tmp_path / "results.csv").exists(), done.stdout + done.stderr


def test_foreign_table_is_refused(program, tmp_path):
    (tmp_path / "results.csv").write_text("a,b\n1,2\n")
    done = bench(tmp_path, program.parent, "--quick")
    assert done.returncode == 1 and "other columns" in done.stderr and (tmp_path / "results.csv").read_text() == "a,b\n1,2\n"


def test_mistakes(program, tmp_path):
    for args, phrase in [(["--only", "ball"], "no case 'ball'"), (["--cells", "5"], "no case has such a size"), (["--steps", "5"], "fewer than 5"), (["--vary", "x"], "OPTION=VALUE")]:
        done = bench(tmp_path, program.parent, *args)
        assert done.returncode == 2 and phrase in done.stderr, done.stderr


def test_committed_list_is_valid():
    done = subprocess.run([sys.executable, str(ROOT / "tools" / "bench"), "--list"], capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "-mesh_cells 938,938" in done.stdout, done.stdout + done.stderr
    for line in done.stdout.splitlines():
        assert (ROOT / line.split("tumble ")[1].split()[0]).is_file(), line


def test_kernels_of_a_device(program, tmp_path):
    """--device: a row beside that without, the table of kernels and memory there an unknown."""
    case = CASES.replace("cavity.yaml", "cavity-3d.yaml").replace('"8,8"', '"4,4,4"').replace('vary = { flow_solver = ["fast", "balanced"] }', "device = true")
    done = bench(tmp_path, program.parent, "--quick", "--device", "emulate", cases=case)
    assert done.returncode == 0, done.stdout + done.stderr
    assert [row["options"] for row in rows(tmp_path)] == ["mesh_cells=4,4,4", "mesh_cells=4,4,4 device=emulate"]
    assert {"| kernel ", "| multiply ", "| smooth_rows ", "| upload "} <= {line[: line.find("|", 1)] for line in done.stdout.splitlines()}
    each = re.search(r"^(\d+) bytes an unknown there, without PETSc's vectors$", done.stdout, re.M)
    assert 100 < int(each[1]) < 1000
