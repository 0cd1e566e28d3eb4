"""tools/faults: the quick form finds no bug; the table of the tree has none; runs that end badly are told; a silent loss is seen."""
import csv
import os
import re
import stat
import subprocess
from collections import Counter

import pytest

from conftest import ROOT, environment
from test_extremes import PYTHON

SANE = pytest.mark.skipif("asan" in os.environ["TUMBLE_BUILD"], reason="sanitizers have allocators of their own")
# What a program that ends badly does once it is told to fail: what the table says of it. Without a fault it leaves a table and a checkpoint.
BAD = {
    "hang": ("sleep 60", "hung"),
    "crash": ("kill -SEGV $$", "crashed without a message"),
    "no word": ("exit 3", "crashed without a message, status 3"),
    "two": ("echo 'tumble: error: one' >&2; echo 'tumble: error: two' >&2; exit 1", "2 messages"),
    "trace": ("echo 'tumble: error: one' >&2; echo '[0]PETSC ERROR: #1 main()' >&2; exit 1", "1 messages, and a trace"),
    "silent": ("echo 'step,u' > $out/series.csv; : > $out/checkpoint_1.h5; exit 0", "silent: series.csv is other"),
}
FAKE = """\
#!/bin/sh
for word; do [ "$before" = -output_dir ] && out=$word; before=$word; done
echo counts rename 1 > $TUMBLE_FAULT_REPORT.0
case "$TUMBLE_FAULT" in rename:1:fail*) echo fired rename 1 step 1 checkpoints 0 at rename x > $TUMBLE_FAULT_REPORT.0
{ending};; esac
printf 'step,u\\n1,2\\n' > $out/series.csv
: > $out/checkpoint_1.h5
"""


def faults(build, folder, *args):
    command = [PYTHON, str(ROOT / "tools" / "faults"), "--build", str(build), "--output", str(folder / "result"), *args]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    with open(folder / "result" / "faults.csv", newline="") as file:
        return done, list(csv.DictReader(file))


@SANE
def test_some_faults(program, tmp_path):
    done, rows = faults(program.parent, tmp_path, "--quick")
    counts = Counter(row["verdict"] for row in rows)
    assert done.returncode == 0 and not counts["BUG"], done.stdout + done.stderr
    assert len(rows) >= 36 and counts["stopped"] >= 15 and counts["killed"] >= 4 and counts["missed"] <= 1, done.stdout
    assert sum(row["restart"] == "same" for row in rows) >= 6, done.stdout


def test_table_of_the_tree():
    with open(ROOT / "runs" / "faults" / "faults.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert not [row for row in rows if row["verdict"] == "BUG" or row["restart"] == "LOST"]
    assert {(row["scene"], row["ranks"]) for row in rows} == {(scene, ranks) for scene in ("plane", "space", "refined", "bodies", "restart", "mesh") for ranks in "12"}


def test_bad_ends(tmp_path):
    (tmp_path / "tests/runs/faults").mkdir(parents=True)
    (tmp_path / "tests/runs/faults/inject.so").write_bytes(b"")
    for name, (ending, message) in BAD.items():
        (tmp_path / "tumble").write_text(FAKE.format(ending=ending))
        (tmp_path / "tumble").chmod(stat.S_IRWXU)
        done, rows = faults(tmp_path, tmp_path, "--only", "plane,1,rename", "--limit", "1.5")
        bad = [row for row in rows if row["fault"] == "rename:1:fail:0"]
        assert done.returncode == 1 and len(bad) == 1 and bad[0]["verdict"] == "BUG" and message in bad[0]["message"], f"{name}: {done.stdout}{done.stderr}"


@SANE
def test_limit_of_memory(program, tmp_path):
    """A real one, of addresses: down to where MPI itself does not start, each run ends well or with one message. OpenBLAS alone would wait for ever."""
    ended = []
    for limit in range(720, 180, -60):
        words = ["sh", "-c", f"ulimit -v {limit}000 && exec \"$@\"", "limited", str(program), str(ROOT / "runs/faults/plane.yaml"), "-output_overwrite"]
        done = subprocess.run(words, cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=60, check=False)
        found = re.findall(r"^tumble: error: (.*)", done.stderr, re.M)
        if not found and done.returncode and limit < 450:
            break  # the launcher's word
        assert done.returncode == 0 and not found or done.returncode == 1 and len(found) == 1 and found[0].startswith("Out of memory: "), f"{limit} MB: {done.stdout[-500:]}{done.stderr}"
        ended.append(done.returncode)
    assert ended[0] == 0 and 1 in ended
