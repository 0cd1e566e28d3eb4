"""Faults injected: every run that meets one ends with one message and a status that is not 0, and its last checkpoint goes on bit for bit.

  tools/faults                              all scenes of runs/faults on one and two ranks; writes runs/faults/faults.csv and README.md (make faults)
  tools/faults --quick                      some 40 faults, those of the tests
  tools/faults --only plane,2               a scene, a number of ranks, a kind of call
  tools/faults --only plane --point rename:3:fail:0      one fault, with what the program prints
  tools/faults --most 1000000               every call, not a sample

tests/runs/faults/inject.c, preloaded, lets the k-th call of a kind fail: an allocation of the program, its plugins or PETSc, an open, write,
fsync, rename, HDF5 call, the load of a plugin; once, or from there on (lasting), or it kills the process there, at the end of a step or in the
middle of a checkpoint. A run without a fault counts the calls; kinds of many calls are sampled: the first and last ones, and one at random in
each of as many equal parts as fit. On two ranks the fault hits rank 0 and 1 in turn. A run ends as
  stopped    status not 0 and one line 'tumble: error:', without PETSc's trace
  survived   status 0, and everything it leaves is what the run without a fault leaves (a file that is looked for and not needed)
  killed     by the kill that was asked for; on two ranks the launcher says so
  missed     the call never came
  BUG        hung, crashed without a message, two messages, ended well with other results, or its last checkpoint was lost
After a stop or a kill the run goes on from its newest checkpoint to the end, without a fault: tables and last checkpoint must have the bits of the
run without a fault.
"""

import concurrent.futures
import json
import os
import random
import re
import shutil
import signal
import subprocess
import tempfile
import time
from collections import Counter
from pathlib import Path

from toolbox import ROOT, default_jobs, end_group, environment, launcher, make_parser, print_table, read_rows, write_rows

FOLDER = ROOT / "runs" / "faults"
COLUMNS = "scene,ranks,fault,step,checkpoints,verdict,restart,seconds,call,message".split(",")
# name: scene file, options, options of a run that comes before and leaves a checkpoint
SCENES = {
    "plane": ("plane.yaml", [], None),
    "space": ("space.yaml", [], None),
    "refined": ("refined.yaml", [], None),
    "bodies": ("bodies.yaml", [], None),
    "restart": ("plane.yaml", ["-sim_restart", "latest", "-sim_steps", "6"], ["-sim_steps", "4"]),
    "mesh": ("mesh.yaml", [], None),
}
# kind and action: how many at most
PLAN = {"alloc:fail": 60, "alloc:lasting": 20, "open:fail": 40, "write:fail": 30, "write:lasting": 10, "sync:fail": 12, "rename:fail": 12, "hdf5:fail": 60,
        "hdf5:lasting": 12, "plugin:fail": 4, "step:kill": 8, "write:kill": 12, "hdf5:kill": 10, "sync:kill": 8, "rename:kill": 8}
# --quick: scene, ranks, how many of each
QUICK = [
    ("plane", 1, {"alloc:fail": 4, "open:fail": 2, "write:fail": 3, "sync:fail": 1, "rename:fail": 1, "hdf5:fail": 4, "plugin:fail": 1, "step:kill": 1, "write:kill": 1}),
    ("plane", 2, {"alloc:fail": 2, "alloc:lasting": 1, "write:fail": 2, "hdf5:fail": 3, "step:kill": 1, "hdf5:kill": 1}),
    ("refined", 1, {"alloc:fail": 2, "write:lasting": 1, "hdf5:fail": 1}),
    ("restart", 1, {"alloc:fail": 2, "hdf5:fail": 2, "rename:kill": 1}),
    ("mesh", 1, {"alloc:fail": 2, "open:fail": 2}),
]
CLOCKS = ("options", "seconds", "wall", "file_length")  # of a checkpoint: what time and place have written
ERROR = re.compile(r"^tumble: error: (.*)", re.M)
TIMES = re.compile(r"^seconds|^memory|^bandwidth|^commit|^wall")


def parse_arguments():
    parser = make_parser(__doc__, limit=30)
    parser.add_argument("--quick", action="store_true", help="some 40 faults")
    parser.add_argument("--only", default="", metavar="LIST", help="scenes, numbers of ranks, kinds of calls")
    parser.add_argument("--point", metavar="FAULT", help="KIND:K:ACTION:RANK: this one, with what the program prints")
    parser.add_argument("--most", type=int, metavar="N", help="as many of each kind, in place of the plan")
    parser.add_argument("--jobs", type=int, default=default_jobs(), metavar="N", help="runs at the same time (default: cores that are free)")
    parser.add_argument("--output", default=str(FOLDER), metavar="FOLDER", help="where faults.csv and README.md go (default: runs/faults)")
    return parser, parser.parse_args()


# ---- one run ----


class Outcome:
    """A run and what the library reports: `fired` (what failed, or ''), `step` and `checkpoints` at that moment, `counts` by rank."""

    def __init__(self, folder, ranks, status, out, err, seconds):
        self.folder, self.status, self.out, self.err, self.seconds = folder, status, out, err, seconds
        reports = [read_text(folder / f"report.{rank}") for rank in range(ranks)]
        found = [match for text in reports if (match := re.search(r"^fired (\w+ \d+) step (\d+) checkpoints (\d+) at (.*)", text, re.M))]
        self.fired = found[0][4].replace(str(folder), ".").strip() if found else ""
        self.step = int(found[0][2]) if found else 0
        self.checkpoints = int(found[0][3]) if found else 0
        self.counts = [dict(re.findall(r"(\w+) (\d+)", text.split("counts ")[1])) if "counts " in text else {} for text in reports]
        self.messages = ERROR.findall(err)


def read_text(path):
    return path.read_text(errors="replace") if path.exists() else ""


def execute(args, name, ranks, folder, options, fault=None):
    """Run a scene into folder/out; at most args.limit seconds. Without mpiexec on one rank: it takes longer than the run."""
    (folder / "out").mkdir(parents=True, exist_ok=True)
    words = [str((ROOT / args.build / "tumble").resolve()), str(FOLDER / SCENES[name][0]), *options, "-output_dir", str(folder / "out")]
    env = {**environment(), "OMPI_MCA_mpi_yield_when_idle": "1"}
    if fault:
        given = {"LD_PRELOAD": str((ROOT / args.build / "tests/runs/faults/inject.so").resolve()), "TUMBLE_FAULT": fault}
        given.update(TUMBLE_FAULT_FOLDER=str(folder), TUMBLE_FAULT_REPORT=str(folder / "report"))
        words = ["env", *(f"{key}={value}" for key, value in given.items()), *words]
    began = time.monotonic()
    process = subprocess.Popen((launcher(ranks) if ranks > 1 else []) + words, env=env, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                               text=True, errors="replace", start_new_session=True)
    try:
        out, err = process.communicate(timeout=args.limit)
        status = process.returncode
    except subprocess.TimeoutExpired:
        end_group(process)
        out, err = process.communicate()
        status = None
    return Outcome(folder, ranks, status, out, err, time.monotonic() - began)


# ---- what a run leaves, compared ----


def read_table(path):
    """A CSV table without its times."""
    lines = [line.split(",") for line in read_text(path).splitlines()]
    keep = [i for i, name in enumerate(lines[0]) if not TIMES.match(name)] if lines else []
    return [[line[i] if i < len(line) else None for i in keep] for line in lines]


def read_arrays(path):
    import h5py

    arrays = {}
    with h5py.File(path, "r") as file:
        file.visititems(lambda name, item: arrays.update({name: item[()].tobytes()}) if isinstance(item, h5py.Dataset) and name.split("/")[-1] not in CLOCKS else None)
    return arrays


def differs(path, other):
    """Do two files of the same name hold other results? Times do not count."""
    if path.suffix == ".csv":
        return read_table(path) != read_table(other)
    if path.suffix == ".h5":
        return path.read_bytes() != other.read_bytes() and read_arrays(path) != read_arrays(other)
    if path.name == "summary.json":
        one, two = (json.loads(p.read_text()) for p in (path, other))
        return any(one.get(key) != two.get(key) for key in ("steps", "time_end", "quantities", "remarks"))
    return path.suffix == ".xdmf" and path.read_text() != other.read_text()


def compare(folder, reference, names=None):
    """'' or the first file of the reference that is missing or other."""
    for other in sorted(reference.iterdir()):
        if names and other.name not in names:
            continue
        path = folder / other.name
        if not path.exists():
            return f"{other.name} is missing"
        try:
            if differs(path, other):
                return f"{other.name} is other"
        except (OSError, ValueError, KeyError) as error:
            return f"{other.name} cannot be read: {error}"
    return ""


# ---- references, plans ----


class Reference:
    """A scene on some ranks without a fault: what it leaves, how often it calls, and what came before it."""

    def __init__(self, args, name, ranks, folder):
        self.name, self.ranks, self.folder, self.options = name, ranks, folder, SCENES[name][1]
        self.before = None
        folder.mkdir(parents=True)
        if SCENES[name][2] is not None:
            first = execute(args, name, ranks, folder, SCENES[name][2])
            self.require(first)
            self.before = folder / "before"
            shutil.copytree(folder / "out", self.before)
        run = execute(args, name, ranks, folder, self.options, "none:0:fail:0")
        self.require(run)
        self.counts = [{kind: int(n) for kind, n in count.items()} for count in run.counts]
        self.last = max((folder / "out").glob("checkpoint_*.h5"), key=lambda path: int(path.stem.split("_")[1])).name

    def require(self, run):
        if run.status != 0:
            raise SystemExit(f"{self.name} on {self.ranks} ranks fails without a fault:\n{run.out[-2000:]}{run.err[-2000:]}")


def sample(draw, n, most):
    """At most `most` of 1 .. n: all, or the first and last few and one in each of equal parts between."""
    if n <= most:
        return list(range(1, n + 1))
    ends = most // 8
    inner = most - 2 * ends
    width = (n - 2 * ends) / inner
    middle = [ends + 1 + int(width * (i + draw.random())) for i in range(inner)]
    return list(range(1, ends + 1)) + middle + list(range(n - ends + 1, n + 1))


def plan_faults(reference, plan, kinds):
    draw, faults = random.Random(f"{reference.name} {reference.ranks}"), []
    for what, most in plan.items():
        kind, action = what.split(":")
        if kinds and kind not in kinds:
            continue
        for rank in range(reference.ranks):
            share = (most + reference.ranks - 1 - rank) // reference.ranks
            faults += [f"{kind}:{k}:{action}:{rank}" for k in sample(draw, reference.counts[rank].get(kind, 0), share)] if share else []
    return faults


# ---- verdicts ----


# PETSc's hash tables take a failed realloc for success (kh_resize), so that its meshes miss what was to be entered: its error, with its trace
LOST_ENTRIES = ("Missing face",)


def judge(run, reference, action):
    """Verdict of a run and its message."""
    text = run.messages[0] if run.messages else ""
    noise = "PETSC ERROR" in run.err + run.out
    if not run.fired:
        return ("missed", "") if run.status == 0 else ("BUG", f"ended with {run.status} before the fault: {run.err[-200:]}")
    if run.status is None:
        return "BUG", f"hung: {text or run.err[-200:]}"
    if run.status == 0:
        other = compare(run.folder / "out", reference.folder / "out")
        return ("BUG", f"silent: {other}") if other else ("survived", "")
    if action == "kill":
        told = reference.ranks == 1 and run.status == -signal.SIGKILL or "Killed" in run.err or "signal 9" in run.err
        return ("killed", "") if told and not run.messages else ("BUG", f"killed, and {len(run.messages)} messages: {text or run.err[-200:]}")
    if not run.messages:
        return "BUG", f"crashed without a message, status {run.status}: " + " / ".join(line.strip() for line in run.err.splitlines() if line.strip())[:300]
    if len(run.messages) == 1 and "realloc" in run.fired and text.startswith(LOST_ENTRIES):
        return "stopped", text
    if len(run.messages) > 1 or noise or not text.strip():
        return "BUG", f"{len(run.messages)} messages{', and a trace' if noise else ''}: {' // '.join(run.messages)}"
    return "stopped", text


def go_on(args, run, reference):
    """The run goes on from its newest checkpoint: 'same', 'none' (there was none yet), or what went wrong."""
    if not run.checkpoints and not reference.before:
        return "none"
    options = reference.options if reference.before else [*reference.options, "-sim_restart", "latest"]
    again = execute(args, reference.name, reference.ranks, run.folder, options)
    if again.status != 0:
        return f"LOST: {again.messages[0] if again.messages else again.err[-200:]}"
    other = compare(run.folder / "out", reference.folder / "out", ["series.csv", "bodies.csv", reference.last])
    return f"LOST: {other}" if other else "same"


def try_fault(args, reference, fault, keep=None):
    """The row of one fault, and its run."""
    kind, k, action, rank = fault.split(":")
    with tempfile.TemporaryDirectory(prefix="tumble-faults-") as name:
        folder = Path(name)
        if reference.before:
            shutil.copytree(reference.before, folder / "out")
        run = execute(args, reference.name, reference.ranks, folder, reference.options, fault)
        verdict, message = judge(run, reference, action)
        restart = go_on(args, run, reference) if run.fired and run.status != 0 else "none"
    if restart.startswith("LOST"):
        verdict, message = "BUG", f"{restart} // after {verdict}: {message}"
    return {"scene": reference.name, "ranks": reference.ranks, "fault": fault, "step": run.step, "checkpoints": run.checkpoints, "verdict": verdict,
            "restart": restart.split(":")[0], "seconds": f"{run.seconds:.1f}", "call": run.fired.replace(str((ROOT / args.build).resolve()), "build").replace(str(ROOT), "."), "message": message.replace(name, "(folder)").replace(str((ROOT / args.build).resolve()), "build").replace(str(ROOT), ".").replace("\n", " ")}, run


# ---- the page ----


def general(message):
    """A message without the figures of the one case: for the table of messages."""
    message = re.sub(r"given no more \(\w+\)", "given no more (NAME)", re.sub(r"fails at (the file|[\w/]+)", "fails at NAME", message))
    message = re.sub(r"\(folder\)/\S+?(['\s:)])", r"FILE\1", message)
    return re.sub(r"(?<![\w])-?\d[\d.e+-]*", "N", message)


def write_page(rows, path):
    counts = Counter(row["verdict"] for row in rows)
    restarts = Counter(row["restart"] for row in rows)
    bad = [row for row in rows if row["verdict"] == "BUG"]
    lines = ["# Faults injected", "", "Written by `tools/faults` (`make faults`; `tools/faults --help` says what a verdict means, `tools/faults --only SCENE,RANKS --point FAULT` shows one).", ""]
    lines += [f"{len(rows)} faults: " + ", ".join(f"{counts[v]} {v}" for v in ("stopped", "survived", "killed", "missed", "BUG")) + ".", ""]
    lines += [f"Hangs: {sum('hung' in r['message'] for r in bad)}. Crashes without a message: {sum('crashed' in r['message'] for r in bad)}. Checkpoints lost: {restarts['LOST']}. "
              f"Restarts with the same bits: {restarts['same']}. Every fault: `faults.csv`.", ""]
    lines += ["How many faults of each kind, and how many runs went on from a checkpoint. A run has 16,000 to 48,000 allocations on a rank, up to 4,000 HDF5 calls and 500 writes: of these a "
              "sample is tried, the first and last ones and one at random in each of equal parts between.", ""]
    kinds = list(dict.fromkeys(":".join(row["fault"].split(":")[::2][:2]) for row in rows))
    lines += ["| scene | ranks | " + " | ".join(kind.replace(":", " ") for kind in kinds) + " | restarts |", "| --- |" + " --- |" * (len(kinds) + 2)]
    for scene, ranks in dict.fromkeys((row["scene"], row["ranks"]) for row in rows):
        mine = [row for row in rows if (row["scene"], row["ranks"]) == (scene, ranks)]
        of_kind = Counter(":".join(row["fault"].split(":")[::2][:2]) for row in mine)
        lines.append(f"| {scene} | {ranks} | " + " | ".join(str(of_kind[kind]) for kind in kinds) + f" | {sum(row['restart'] == 'same' for row in mine)} |")
    lines += ["", "What stopped runs say, figures and names left out:", "", "| times | message |", "| --- | --- |"]
    said = Counter(general(row["message"]) for row in rows if row["verdict"] == "stopped")
    lines += [f"| {n} | {text.replace('|', ' ')} |" for text, n in said.most_common()]
    if bad:
        lines += ["", "| scene | ranks | fault | call | BUG |", "| --- | --- | --- | --- | --- |"]
        lines += [f"| {r['scene']} | {r['ranks']} | {r['fault']} | {r['call'].replace('|', ' ')} | {r['message'].replace('|', ' ')} |" for r in bad]
    path.write_text("\n".join(lines) + "\n")


# ---- main ----


def make_plan(args, folder):
    """(reference, fault) of all faults that were chosen."""
    words = [word for word in args.only.split(",") if word]
    scenes = [word for word in words if word in SCENES]
    ranks = [int(word) for word in words if word.isdigit()]
    kinds = [word for word in words if word not in SCENES and not word.isdigit()]
    cases = QUICK if args.quick else [(name, n, PLAN) for name in SCENES for n in (1, 2)]
    cases = [case for case in cases if (not scenes or case[0] in scenes) and (not ranks or case[1] in ranks)]
    for name, n, plan in cases:
        reference = Reference(args, name, n, folder / f"{name}-{n}")
        if args.most:
            plan = {what: args.most for what in plan}
        yield from ((reference, fault) for fault in ([args.point] if args.point else plan_faults(reference, plan, kinds)))


def main():
    parser, args = parse_arguments()
    if not (ROOT / args.build / "tests/runs/faults/inject.so").exists():
        parser.error(f"{args.build}/tests/runs/faults/inject.so is missing: run 'make tests'")

    def work(case):
        row, run = try_fault(args, *case)
        if args.point:
            print(run.out + run.err)
        print(f"{row['verdict']:>8} {row['scene']:>8} {row['ranks']} {row['fault']:<22} {row['seconds']:>5} s {row['restart']:<5} {row['call'][:40]:<40} {row['message'][:130]}", flush=True)
        return row

    with tempfile.TemporaryDirectory(prefix="tumble-faults-") as folder, concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
        rows = list(pool.map(work, make_plan(args, Path(folder))))
    bad = [row for row in rows if row["verdict"] == "BUG"]
    if not args.point:
        output = Path(args.output)
        write_rows(output / "faults.csv", COLUMNS, rows)
        write_page(rows, output / "README.md")
    counts = Counter(row["verdict"] for row in rows)
    print(f"\n{len(rows)} faults: " + ", ".join(f"{n} {verdict}" for verdict, n in counts.items()))
    return 1 if bad else 0
