"""A machine that is shared: ranks on one core give way to each other, and a run that does not get its cores says so."""
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys

import pytest

from conftest import SCENE, edited, environment

sys.path.insert(0, str(os.path.join(os.path.dirname(__file__), "..", "..", "tools")))
from cores import free_cores, read_quota

OPEN_MPI = "oversubscribe" in os.environ["MPIEXEC"]
ALONE = "mesh: {cells: [4, 4]}\nparticle: {groups: disc, disc: {shape: circle, radius: 0.1, density: 2, position: [0.5, 0.5], velocity: [0.01, 0]}}\nsim: {dt: 1e-6, steps: 100000000}\n"


def processor_seconds(words, folder):
    """Of a command and all that it starts, with Open MPI's own choice of who gives way."""
    env = environment()
    env.pop("OMPI_MCA_mpi_yield_when_idle", None)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(words, cwd=folder, env=env, capture_output=True, text=True, timeout=120, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert done.returncode == 0, done.stdout + done.stderr
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


@pytest.mark.skipif(not OPEN_MPI or not shutil.which("taskset"), reason="needs Open MPI and taskset")
@pytest.mark.parametrize("inner", [False, True], ids=["the launcher is bound", "each rank is bound"])
def test_two_ranks_on_one_core(program, scene, tmp_path, inner):
    """Processor time, which others do not disturb. A rank that spins for the other, which waits for the core, takes ten times as much."""
    pin = ["taskset", "-c", str(max(os.sched_getaffinity(0)))]
    run = [str(program), scene(edited("steps: 2", "steps: 6", SCENE)), "-output_overwrite"]
    mpiexec = [*os.environ["MPIEXEC"].split(), "-n", "2"]
    one = processor_seconds([*pin, *run], tmp_path)
    two = processor_seconds([*mpiexec, *pin, *run] if inner else [*pin, *mpiexec, *run], tmp_path)
    share = json.loads((tmp_path / "out" / "disc" / "summary.json").read_text())["balance"]["core_share"]
    assert 0 < share["min"] <= share["max"] < 1.1
    assert two < 3 * one + 0.5, f"{two:.2f} s of processor time on two ranks, {one:.2f} on one"


def test_told(program, scene, tmp_path):
    """Another program on the same core: after some seconds a line says how much the run gets."""
    core = {max(os.sched_getaffinity(0))}
    bind = lambda: os.sched_setaffinity(0, core)
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"], preexec_fn=bind) for _ in range(2)]
    run = subprocess.Popen([str(program), scene(ALONE), "-output_progress", "0"], cwd=tmp_path, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, preexec_fn=bind)
    try:
        told = next((line for line in run.stdout if "core, processor time" in line), "")
        run.send_signal(signal.SIGTERM)
        rest = run.stdout.read()
    finally:
        for process in (*busy, run):
            process.kill()
            process.wait()
    found = re.match(r"remark: the run got (0\.\d+) of a core, processor time over wall time: other programs run there, and the run takes so much longer$", told)
    assert found and 0.01 < float(found[1]) < 0.7, told + rest
    assert re.search(r"a core's time that ranks got: 0\.\d+ to 0\.\d+; on a free core the run is faster", rest), rest


def test_free_cores(tmp_path):
    assert 1 <= free_cores(2, 0.05) <= 2
    (tmp_path / "job" / "task").mkdir(parents=True)
    (tmp_path / "groups").write_text("0::/job/task\n")
    assert read_quota(tmp_path / "groups", tmp_path) == float("inf")
    (tmp_path / "job" / "cpu.max").write_text("150000 100000\n")
    (tmp_path / "job" / "task" / "cpu.max").write_text("max 100000\n")
    assert read_quota(tmp_path / "groups", tmp_path) == 1.5
