"""tools/scaling: rows for every number of ranks, weak series grow, a report that tells measured from predicted."""
import csv
import re
import shlex
import subprocess
import sys
from pathlib import Path

from conftest import ROOT
from drawn import assert_has_colour, keep_figures

sys.path.insert(0, str(ROOT / "tools"))
import kinds.scaling as kind  # noqa: E402

PYTHON = "/usr/bin/python3" if Path("/usr/bin/python3").exists() else sys.executable


def scaling(folder, program, *args):
    command = [PYTHON, str(ROOT / "tools" / "scaling"), "--output", "result", "--build", str(program.parent), *args]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)


def rows(folder, name):
    with open(folder / "result" / name, newline="") as file:
        return list(csv.DictReader(file))


def test_weak_series(program, tmp_path):
    args = ["runs/bench/cavity.yaml", "--ranks", "1,2", "--steps", "5", "-mesh_cells", "12,{12 * n}", "-mesh_upper", "1,{n}"]
    done = scaling(tmp_path, program, *args)
    assert done.returncode == 0, done.stdout + done.stderr
    one, two = rows(tmp_path, "cavity-weak.csv")
    assert (one["ranks"], one["cells"], two["ranks"], two["cells"]) == ("1", "144", "2", "288")
    assert one["efficiency"] == "1.000" and float(two["efficiency"]) > 0 and float(two["balance_cells"]) >= 1
    assert float(one["messages_per_step"]) == 0 and float(two["messages_per_step"]) > 10 and float(two["kbytes_per_step"]) > 1 and float(two["reductions_per_step"]) > 10
    report = (tmp_path / "result" / "cavity-weak.md").read_text()
    assert "weak scaling" in report and "PREDICTED by a model, not measured" in report
    assert int(two["cores"]) >= 1 and float(two["load"]) >= 0 and "| load before |" in report
    assert "* With 2 ranks a rank has fewer than 20,000 unknowns" in report
    assert (tmp_path / "result" / "cavity-weak.png").is_file()
    with keep_figures() as seen:
        kind.draw(Path("weak.png"), "weak", {"weak": True}, [{**row, "ranks": int(row["ranks"])} for row in (one, two)], [])
    for row in (one, two):
        for axes, column in enumerate(("total_s", "efficiency")):
            assert_has_colour(seen["weak.png"].around(int(row["ranks"]), float(row[column]), 1, axes), "#1d3557", f"{column} on {row['ranks']} ranks")
    before = (tmp_path / "result" / "cavity-weak.csv").read_bytes()
    again = scaling(tmp_path, program, *args, "--read", "--latency", "1e-3")
    assert again.returncode == 0 and (tmp_path / "result" / "cavity-weak.csv").read_bytes() == before
    assert "1e+03 us" in again.stdout, again.stdout


def test_bodies_are_balanced_in_the_table(program, tmp_path):
    done = scaling(tmp_path, program, "runs/extremes/packing.yaml", "--ranks", "2", "--steps", "5", "-mesh_cells", "24,24", "-particle_disc_count", "4", "-couple_method", "nodal")
    assert done.returncode == 0, done.stdout + done.stderr
    row = rows(tmp_path, "packing-strong.csv")[0]
    assert row["bodies"] == "4" and 1 <= float(row["balance_body_cells"]) <= 2 and 1 <= float(row["balance_bodies"]) <= 2


def test_mistakes(program, tmp_path):
    for args, phrase in [(["-mesh_cells", "8,8"], "need a SCENE"), (["--only", "x"], "no series 'x'")]:
        done = scaling(tmp_path, program, *args)
        assert done.returncode == 2 and phrase in done.stderr, done.stderr
    done = scaling(tmp_path, program, "runs/bench/cavity.yaml", "-mesh_cells", "8,8", "-nonsense", "1")
    assert done.returncode == 1 and "-nonsense" in done.stderr, done.stderr


def test_counts_and_the_model_made_of_them(program, tmp_path):
    done = scaling(tmp_path, program, "--counts", "runs/studies/scaling/crowd.yaml", "--ranks", "1,2", "--steps", "1", "-mesh_cells", "{12 * n},12", "-mesh_upper", "{n},1", "-particle_grain_count", "{9 * n}")
    assert done.returncode == 0, done.stdout + done.stderr
    one, two = rows(tmp_path, "crowd-counts.csv")
    assert (one["cells"], two["cells"], one["bodies"], two["bodies"]) == ("144", "288", "9", "18")
    assert float(one["messages"]) == 0 and float(two["messages"]) > 100 and float(two["kbytes"]) > 10
    assert float(two["gathered_bytes"]) >= 8 * 18 and 0 < float(two["collective_bytes"]) < 64 * float(two["collectives"])
    report = (tmp_path / "result" / "crowd-counts.md").read_text()
    assert "PREDICTED from these counts, not measured" in report and "\n| 131072 |" in report


def test_prediction_from_counts(program, tmp_path):
    """Points where ranks wait, bytes and processor seconds of a step; what is extrapolated says so, and follows from the counted rows."""
    scene = ["runs/studies/scaling/crowd.yaml", "-mesh_cells", "{12 * n},12", "-mesh_upper", "{n},1", "-particle_grain_count", "{9 * n}"]
    done = scaling(tmp_path, program, "--model", *scene, "--ranks", "1,2", "--steps", "1")
    assert done.returncode == 0, done.stdout + done.stderr
    one, two = rows(tmp_path, "crowd-model.csv")
    assert float(one["points"]) == 0 and 100 < float(two["points"]) < 1500 and float(two["collectives"]) < float(two["points"]) and float(one["processor_s"]) != 0
    again = scaling(tmp_path, program, "--model", "--read", *scene, "--wait", "0", "--rate", "1e30")
    assert "extrapolated" not in again.stdout
    assert again.returncode == 0 and "| 2 | counted |" in again.stdout, again.stdout + again.stderr
    efficiency = float(again.stdout.split("| 2 | counted |")[1].splitlines()[0].split("|")[-2])
    assert abs(efficiency - 1 / float(two["balance_cells"])) < 0.01
    model = tmp_path / "result" / "crowd-model.csv"  # a part of 50,000 unknowns a rank, which it extrapolates
    model.write_text("ranks,cells,unknowns,bodies,outer_mean,balance_cells,points,collectives,kbytes_most,processor_s\n"
                     "1,4000,50000,0,3,1,0,0,0,0.1\n4,16000,200000,0,3,1,800,200,1000,\n16,64000,800000,0,3,1.1,1000,200,1000,\n")  # fmt: skip
    third = scaling(tmp_path, program, "--model", "--read", *scene, "--wait", "1e-5", "--rate", "1e9", "--beyond")
    line = next(line for line in third.stdout.splitlines() if line.startswith("| 256 | extrapolated"))
    work, waiting, sent, step = (float(word) for word in line.split("|")[4:8])
    # 100 points more a doubling of the unknowns, four of them; reductions of 256 ranks take twice those of 16
    assert abs(work - 0.11) < 1e-6 and abs(waiting - (1200 * 1e-5 + 200 * 2e-5)) < 1e-6 and abs(sent - 1e-3) < 1e-6 and abs(step - 0.127) < 1e-6, line


def test_a_machine_is_fitted_to_what_was_measured_there():
    sys.path.insert(0, str(ROOT / "tools"))
    from kinds.predict import Machine, read_machines

    cases = [(1.0, 4, 2000, 4), (1.0, 16, 2000, 4), (2.0, 16, 500, 30), (2.0, 8, 300, 40)]
    for slow, wait, rate in (1.5, 2e-5, 5e8), (1.0, 4e-5, 1e9), (2.0, 0.0, 1e9):
        exact = [{"scene": "x", "commit": "y", "ranks": p, "balance": 1.1, "points": n, "mbytes": mb, "alone_s": alone, "step_s": slow * alone / p * 1.1 + n * wait + 1e6 * mb / rate} for alone, p, n, mb in cases]
        fitted = Machine("exact", exact)
        assert abs(fitted.slow / slow - 1) < 1e-6 and abs(fitted.wait - wait) < 1e-11 and abs(fitted.rate / rate - 1) < 1e-5, (slow, wait, rate, fitted.describe())
    for machine in read_machines().values():  # the table of runs/bench/README.md
        assert machine.slow >= 1 and machine.wait >= 0 and machine.rate > 0 and max(abs(machine.misfit(row)) for row in machine.rows) < 0.15, machine.describe()


def test_remarks_say_what_spoils_a_table():
    sys.path.insert(0, str(ROOT / "tools"))
    from kinds.scaling import remarks

    row = {"unknowns": "10000000", "cores": "4", "load": "0.1"}
    assert not list(remarks([{**row, "ranks": 1}, {**row, "ranks": 4, "load": "1.2"}]))
    told = list(remarks([{**row, "ranks": 1, "load": "2.00"}, {**row, "ranks": 4}, {**row, "ranks": 8}]))
    assert [line.split(":")[0] for line in told] == ["8 ranks share 4 cores", "Other work took more than 0.3 cores before the runs with 1 ranks"]
    assert not list(remarks([{**row, "ranks": 8, "cores": "", "load": ""}]))  # rows of an earlier version


def test_batch_script_gives_ranks_enough_work():
    """It is a script, names account and partition, builds nothing on the nodes, and every rank has 20,000 unknowns and more."""
    path = ROOT / "runs" / "bench" / "scaling.slurm"
    text = path.read_text()
    assert subprocess.run(["bash", "-n", path]).returncode == 0
    assert "--account=" in text and "--partition=" in text and not re.search(r"^make", text, re.M)
    series = [shlex.split(line) for line in text.splitlines() if line.startswith("$scaling ")]
    assert len(series) == 2
    for words in series:
        assert (ROOT / words[1]).exists()
        n = int(words[words.index("--ranks") + 1].split(",")[-1])
        across, along = (eval(word.strip("{}"), {"n": n}) for word in words[words.index("-mesh_cells") + 1].split(","))
        assert 11 * across * along / n > 20000, words
