"""pytest plugin: collects the cmocka programs, limits the time of every test, and counts.

BUILD/tests/<room>/test_* is built from tests/<room>/test_*.c. A comment such as /* ranks: 1 2 3 */ in the source asks for a run on each of
these numbers of MPI ranks; the default is 1. Every case on every number of ranks is a test, but the program runs once for each number of
ranks: in the set-up of the first of its tests. A case passes when it passes on every rank. -k "test_mesh and [2]" chooses the runs on two ranks.
All is run one after the other; with pytest-xdist, "-n 2 --dist loadgroup" runs two at a time ("make check" does so on two cores). A program
goes to one worker with all its cases.

A program without progress for 180 s and an end-to-end test of more than 600 s fail (TUMBLE_LIMIT and TUMBLE_LIMIT_E2E change these), and
everything they started is killed: all processes of a test carry a mark in their environment, by which they are found even when they left
their process group. The mark of a test begins with that of its worker, and the worker's with that of the process that started it. A failed test is shown with the command that repeats it. The last line is "N passed, N failed"; the exit status is 1
when something failed, or nothing passed.
"""
import atexit
import os
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import uuid
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
MARK = "TUMBLE_TEST_MARK"
LIMIT = float(os.environ.get("TUMBLE_LIMIT", 180))
LIMIT_E2E = float(os.environ.get("TUMBLE_LIMIT_E2E", 600))
POLL = 0.1  # s between two looks at a running test
GRACE = 2.0  # s between asking a process to end and killing it
STRAGGLERS = 10.0  # s that other ranks get after a case has failed on one: they may wait for it forever
MAX_LINES = 80  # of output shown for a failed case

# Each rank writes its own file, line by line, so that nothing is mixed and nothing is lost in a crash.
RANK_SHELL = 'exec {buffer} "$@" > "$0/rank.${{OMPI_COMM_WORLD_RANK:-${{PMIX_RANK:-${{PMI_RANK:-0}}}}}}" 2>&1'
CASE_DECLARED = re.compile(r"cmocka_unit_test\w*\(\s*(\w+)")
CASE_LINE = re.compile(r"^\[ *(RUN|OK|FAILED|SKIPPED) *\] (\S+)$", re.M)
RANKS_COMMENT = re.compile(r"/\*\s*ranks:([\d ]+)\s*(?:\*/|$)", re.M)
OUTCOME = {"RUN": "unfinished", "OK": "passed", "FAILED": "failed", "SKIPPED": "skipped"}
WORSE = ["skipped", "passed", "failed", "unfinished"]  # the outcome of a case is the worst of its ranks

# ---- processes ----


def build_folder():
    return (ROOT / os.environ.get("TUMBLE_BUILD", "build")).resolve()


def default_mpiexec():
    """As many ranks as asked for on any machine, and not all tests of all users on core 0."""
    try:
        version = subprocess.run(["mpiexec", "--version"], capture_output=True, text=True, check=False).stdout
    except OSError:
        return "mpiexec"
    return "mpiexec --oversubscribe --bind-to none" if "Open MPI" in version or "OpenRTE" in version else "mpiexec"


def set_environment(mark):
    """What every test sees: it may run as root in a container, and on fewer cores than ranks."""
    os.environ.update({MARK: mark, "MPLBACKEND": "Agg", "TUMBLE_BUILD": str(build_folder()), "MPIEXEC": os.environ.get("MPIEXEC") or default_mpiexec()})
    os.environ.update(OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")
    os.environ.update(OMPI_MCA_rmaps_base_oversubscribe="1", PRTE_MCA_rmaps_default_mapping_policy=":oversubscribe")
    os.environ["OMPI_MCA_ess_singleton_isolated"] = "1"  # a rank alone starts no daemon
    keep_session_folder()
    os.environ["OMPI_MCA_odls_base_sigkill_timeout"] = "0"  # else Open MPI's launcher takes a second or two to pass a failure on
    # Half of a short run's time went into looking for hardware: a driver of fast networks measures its clock for 0.2 s on core 0, and hwloc asks cards
    os.environ.setdefault("OMPI_MCA_pml", "ob1")
    os.environ.setdefault("HWLOC_COMPONENTS", "-linuxio,-pci,-opencl,-gl")
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("OMPI_MCA_mpi_yield_when_idle", "1")  # ranks that wait leave the core to those that work
    # MPI libraries leak on purpose; stdbuf comes before the sanitizer in the list of libraries, which is harmless
    os.environ.setdefault("ASAN_OPTIONS", "detect_leaks=0:verify_asan_link_order=0")
    os.environ.setdefault("UBSAN_OPTIONS", "print_stacktrace=1:halt_on_error=1")


def keep_session_folder():
    """Isolated single ranks of Open MPI share one session folder: each makes it, and each removes it, perhaps while another makes it, which then
    fails. With a folder inside that is not its own no rank removes it."""
    if "OMPI_MCA_orte_tmpdir_base" not in os.environ:
        base = tempfile.mkdtemp(prefix="tumble-mpi-")
        Path(base, f"ompi.{socket.gethostname().split('.')[0]}.{os.getuid()}", "jf.0", "1", "0", "kept").mkdir(parents=True, mode=0o700)
        os.environ["OMPI_MCA_orte_tmpdir_base"] = base
        atexit.register(shutil.rmtree, base, ignore_errors=True)


def longer_mark():
    """A new mark that begins with ours, if we have one."""
    return f"{os.environ.get(MARK, '')}{uuid.uuid4().hex}/"


def find_marked(mark):
    """Process ids (other than ours) whose environment carries the mark, or one that begins with it."""
    wanted = f"{MARK}={mark}".encode()
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            if int(entry.name) != os.getpid() and any(word.startswith(wanted) for word in (entry / "environ").read_bytes().split(b"\0")):
                yield int(entry.name)
        except OSError:  # ended meanwhile, or not ours
            pass


def signal_marked(mark, number):
    for pid in find_marked(mark):
        try:
            os.kill(pid, number)
        except ProcessLookupError:
            pass


def kill_marked(mark):
    """End what a test started, politely at first so that the launcher can clean up."""
    signal_marked(mark, signal.SIGTERM)
    end = time.monotonic() + GRACE
    while list(find_marked(mark)) and time.monotonic() < end:
        time.sleep(POLL)
    signal_marked(mark, signal.SIGKILL)


# ---- programs ----


def relative(path):
    return path.relative_to(ROOT) if path.is_relative_to(ROOT) else path


def launch_words(program, nranks):
    """One rank needs no launcher with Open MPI, and starts twice as fast without."""
    if nranks == 1 and "oversubscribe" in os.environ["MPIEXEC"]:
        return [*map(str, program)]
    return [*shlex.split(os.environ["MPIEXEC"]), "-n", str(nranks), *map(str, program)]


def read_outputs(folder):
    """Output of each rank so far, by rank."""
    files = sorted(folder.glob("rank.*"), key=lambda path: int(path.suffix[1:]))
    return {int(path.suffix[1:]): path.read_text(errors="replace") for path in files}


def wait_for(process, folder):
    """Wait until the program ends: None; or until a case exceeded its limit: that limit in s."""
    started, count = time.monotonic(), -1
    while True:
        try:
            process.wait(POLL)
            return None
        except subprocess.TimeoutExpired:
            pass
        text = "".join(read_outputs(folder).values())
        allowed = min(LIMIT, STRAGGLERS) if "[  FAILED  ]" in text else LIMIT
        if len(CASE_LINE.findall(text)) != count:
            started, count = time.monotonic(), len(CASE_LINE.findall(text))
        if time.monotonic() - started > allowed:
            return allowed


def run_program(program, nranks):
    """Run a test program; returns how it ended ("" for status 0), output by rank, output of the launcher."""
    mark = longer_mark()
    buffer = "stdbuf -oL" if shutil.which("stdbuf") else ""
    with tempfile.TemporaryDirectory(prefix="tumble-test-") as name:
        folder = Path(name)
        words = launch_words(["sh", "-c", RANK_SHELL.format(buffer=buffer), name, program], nranks)
        with open(folder / "launcher", "w") as log:
            process = subprocess.Popen(words, cwd=ROOT, env={**os.environ, MARK: mark}, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT)
            try:
                exceeded = wait_for(process, folder)
            finally:
                kill_marked(mark)
                process.wait()
        end = f"no progress for {exceeded:g} s: killed" if exceeded else f"exit status {process.returncode}" if process.returncode else ""
        return end, read_outputs(folder), (folder / "launcher").read_text(errors="replace")


def shorten(text):
    lines = text.rstrip().splitlines()
    if len(lines) > MAX_LINES:
        lines[MAX_LINES // 2 : -MAX_LINES // 2] = [f"... {len(lines) - MAX_LINES} lines left out ..."]
    return "\n".join(lines)


class Run:
    """What one run of a program on some ranks left behind."""

    def __init__(self, program, nranks, declared):
        if not program.exists():
            self.cases, self.complaint = {}, f"{relative(program)} does not exist: it is built by 'make tests'"
            return
        self.end, self.outputs, launcher = run_program(program, nranks)
        self.cases = {}
        for text in self.outputs.values():
            for name, outcome in {name: OUTCOME[word] for word, name in CASE_LINE.findall(text)}.items():
                self.cases[name] = max(self.cases.get(name, "skipped"), outcome, key=WORSE.index)
        self.complaint = self.find_complaint(launcher, declared)

    def find_complaint(self, launcher, declared):
        """What is wrong although no case failed; the first test that asks is blamed for it."""
        good = all(outcome in ("passed", "skipped") for outcome in self.cases.values())
        if unknown := set(self.cases) - set(declared):
            return f"cases ran that are not declared with cmocka_unit_test() in the source: {', '.join(sorted(unknown))}"
        if good and (self.end or not self.cases):
            tails = "\n".join(f"rank {rank}:\n{text}" for rank, text in self.outputs.items())
            return f"{self.end or 'no case ran'}, although none of {len(self.cases)} cases failed\n{launcher}\n{tails}"
        return None

    def output(self, name):
        """What the ranks on which the case did not pass printed between its start and its end."""
        parts = []
        for rank, text in self.outputs.items():
            found = re.search(rf"^\[ RUN +\] {re.escape(name)}$(.*?)(^\[ +(OK|FAILED|SKIPPED) +\] {re.escape(name)}$|\Z)", text, re.M | re.S)
            if found and found.group(3) not in ("OK", "SKIPPED"):
                end = "" if found.group(3) else "\n(not finished)"
                parts.append(f"rank {rank}:{found.group(1).rstrip()}{end}")
        return "\n".join(parts)


# ---- collection ----


class Program(pytest.File):
    """A source of a test program; its runs by number of ranks."""

    def collect(self):
        text = self.path.read_text()
        self.runs, self.declared = {}, list(dict.fromkeys(CASE_DECLARED.findall(text)))
        self.program = build_folder() / relative(self.path).with_suffix("")
        found = RANKS_COMMENT.search(text)
        for nranks in [int(word) for word in found.group(1).split()] if found else [1]:
            for name in self.declared:
                yield Case.from_parent(self, name=f"{name}[{nranks}]", case=name, nranks=nranks)


class Case(pytest.Item):
    def __init__(self, *, case, nranks, **rest):
        super().__init__(**rest)
        self.case, self.nranks = case, nranks
        self.add_marker(pytest.mark.xdist_group(str(relative(self.path))))

    def setup(self):
        if self.nranks not in self.parent.runs:
            self.parent.runs[self.nranks] = Run(self.parent.program, self.nranks, self.parent.declared)

    def runtest(self):
        run = self.parent.runs[self.nranks]
        outcome = run.cases.get(self.case, "not run")
        if outcome == "skipped":
            pytest.skip("skipped by the program")
        if outcome in ("failed", "unfinished"):
            pytest.fail(shorten(run.output(self.case) + (f"\n{run.end}" if outcome == "unfinished" else "")), pytrace=False)
        complaint, run.complaint = run.complaint, None
        if complaint or outcome == "not run":
            pytest.fail(shorten(complaint or "the case did not run: see the first failure of this program"), pytrace=False)

    def repeat(self):
        return launch_words([relative(self.parent.program)], self.nranks)

    def reportinfo(self):
        return self.path, None, f"{self.case} on {self.nranks} rank{'s'[: self.nranks > 1]}"


def pytest_collect_file(file_path, parent):
    if file_path.suffix == ".c" and file_path.name.startswith("test_"):
        return Program.from_parent(parent, path=file_path)
    return None


# ---- time limit, failures, counts ----


def heed(number, handler):
    """Handle a signal, if this is the main thread, which alone can: a worker of pytest-xdist has been seen in another one."""
    if threading.current_thread() is not threading.main_thread():
        return False
    signal.signal(number, handler)
    return True


@pytest.hookimpl(hookwrapper=True)
def limited(item):
    """A wrapper around one phase of an end-to-end test, failing it when the time is over; a program has its own limit."""

    def expire(*_):
        kill_marked(os.environ[MARK])
        pytest.fail(f"time limit of {LIMIT_E2E:g} s exceeded: killed", pytrace=False)

    heeded = heed(signal.SIGALRM, expire)  # else the alarm would end the worker
    signal.setitimer(signal.ITIMER_REAL, LIMIT_E2E if heeded and not isinstance(item, Case) else 0)
    yield
    signal.setitimer(signal.ITIMER_REAL, 0)


pytest_runtest_setup = pytest_runtest_call = pytest_runtest_teardown = limited


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item):
    outcome = yield
    report = outcome.get_result()
    if report.failed:
        words = item.repeat() if isinstance(item, Case) else [sys.executable, "-m", "pytest", report.nodeid]
        needed = {} if isinstance(item, Case) or build_folder() == ROOT / "build" else {"TUMBLE_BUILD": relative(build_folder())}
        needed.update({name: "1" for name in ("OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM") if os.geteuid() == 0})
        command = " ".join([f"{name}={value}" for name, value in needed.items()] + [shlex.quote(str(word)) for word in words])
        report.sections.append(("repeat", f"cd {ROOT} && {command}"))


class Counter:
    """The last line; a test that fails twice, as a test and in its end, counts once."""

    def __init__(self):
        self.outcomes = {}

    def pytest_collectreport(self, report):
        if report.failed:
            self.outcomes[report.nodeid] = "failed"

    def pytest_runtest_logreport(self, report):
        if report.failed or (report.when == "call" or report.skipped) and report.nodeid not in self.outcomes:
            self.outcomes[report.nodeid] = report.outcome

    def count(self, outcome):
        return list(self.outcomes.values()).count(outcome)

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self, session):
        if session.exitstatus == 0 and not self.count("passed") and not session.config.option.collectonly:
            session.exitstatus = 1

    @pytest.hookimpl(trylast=True)
    def pytest_unconfigure(self, config):
        if config.option.collectonly:
            return
        if self.count("skipped"):
            print(f"{self.count('skipped')} skipped")
        if not self.count("passed") + self.count("failed"):
            print("no test ran")
        print(f"{self.count('passed')} passed, {self.count('failed')} failed", flush=True)


def pytest_configure(config):
    config.addinivalue_line("markers", "xdist_group(name): tests of one group go to one worker of pytest-xdist")
    set_environment(longer_mark())
    heed(signal.SIGTERM, lambda *_: pytest.exit("ended by SIGTERM", 143))  # an exception, so that running tests are killed on the way out
    if not hasattr(config, "workerinput"):  # the workers of pytest-xdist report to one that counts
        config.pluginmanager.register(Counter())


def pytest_unconfigure():
    kill_marked(os.environ[MARK])
