"""tools/mutate: every mistake of the table can still be made, and the tool tells a comparison that failed from everything else."""
import importlib.machinery
import importlib.util
import subprocess
import sys
import tomllib

from conftest import ROOT

TOOL = ROOT / "tools" / "mutate"


def load():
    sys.path.insert(0, str(TOOL.parent))
    loader = importlib.machinery.SourceFileLoader("mutate", str(TOOL))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("mutate", loader))
    loader.exec_module(module)
    return module


MUTATE = load()
GOOD = {"name": "a", "room": "flow", "file": "src/flow/time.c", "old": "x = 1;", "new": "x = 2;", "tests": "tests/test_time.c"}


def table():
    return tomllib.loads(MUTATE.TABLE.read_text())["mutation"]


def test_table():
    mutations = table()
    assert MUTATE.find_faults(mutations) == [] and len(mutations) >= 30
    assert {"flow", "bodies", "couple", "solve", "run", "report", "mesh"} <= {entry["room"] for entry in mutations}


def test_faults_are_named(tmp_path):
    (tmp_path / "src" / "flow").mkdir(parents=True)
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "test_time.c").touch()
    source = tmp_path / "src" / "flow" / "time.c"
    source.write_text("x = 1;\n")
    assert MUTATE.find_faults([GOOD], tmp_path) == []
    assert "stands 0 times" in MUTATE.find_faults([{**GOOD, "old": "y"}], tmp_path)[0]
    assert "changes nothing" in MUTATE.find_faults([{**GOOD, "new": GOOD["old"]}], tmp_path)[0]
    assert "there is no tests/test_none.c" in MUTATE.find_faults([{**GOOD, "tests": "tests/test_none.c::test_x"}], tmp_path)[0]
    assert "is no file src/mesh/" in MUTATE.find_faults([{**GOOD, "room": "mesh"}], tmp_path)[0]
    assert "it needs" in MUTATE.find_faults([{"name": "a"}], tmp_path)[0]
    assert len(MUTATE.find_faults([GOOD, GOOD], tmp_path)) == 2
    source.write_text("x = 1;\nx = 1;\n")
    assert "stands 2 times" in MUTATE.find_faults([GOOD], tmp_path)[0]


REPORT = """<testsuites><testsuite>
<testcase classname="tests.flow.test_flow.c" name="test_a[2]"><failure message="rank 1:&#10;x is 1, expected 2">rank 1:</failure></testcase>
<testcase classname="tests.flow.test_flow.c" name="test_b[1]"><failure message="rank 0:&#10;(not finished)&#10;exit status 139"/></testcase>
<testcase classname="tests.flow.test_flow.c" name="test_c[1]"><failure message="build/x does not exist"/></testcase>
<testcase classname="tests.runs.test_run" name="test_d"><failure message="AssertionError: in /tmp: tumble&#10;exit status 1&#10;"/></testcase>
<testcase classname="tests.runs.test_run" name="test_e"><failure message="KeyError: 'u'"/></testcase>
<testcase classname="tests.runs.test_run" name="test_f"><error message="failed on setup"/></testcase>
<testcase classname="tests.runs.test_run" name="test_g"/>
</testsuite></testsuites>"""


def test_comparisons_alone_count(tmp_path):
    path = tmp_path / "report.xml"
    path.write_text(REPORT)
    assert MUTATE.read_failures(path) == [
        ("tests/flow/test_flow.c::test_a[2]", True),
        ("tests/flow/test_flow.c::test_b[1]", False),
        ("tests/flow/test_flow.c::test_c[1]", False),
        ("tests/runs/test_run.py::test_d", True),
        ("tests/runs/test_run.py::test_e", False),
    ]


def test_file_comes_back(tmp_path):
    source, built = tmp_path / "src" / "flow" / "time.c", tmp_path / "build" / "obj" / "flow" / "time.o"
    for path in (source, built):
        path.parent.mkdir(parents=True)
    source.write_text("x = 1;\n")
    built.write_text("old")
    before = [(path.read_text(), path.stat().st_mtime_ns) for path in (source, built)]
    with MUTATE.Mutant(tmp_path, GOOD):
        assert source.read_text() == "x = 2;\n" and source.stat().st_mtime_ns > before[1][1]
        built.write_text("new")
    assert [(path.read_text(), path.stat().st_mtime_ns) for path in (source, built)] == before


def test_unknown_name():
    done = subprocess.run([sys.executable, TOOL, "--only", "no-such"], capture_output=True, text=True)
    assert done.returncode == 2 and "no mutation 'no-such'" in done.stderr
