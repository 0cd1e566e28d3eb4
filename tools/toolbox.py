"""What the tools that run the program share: lists of cases, the launcher, one run with a time limit, what a run left behind, tables, figures."""

import argparse
import csv
import functools
import json
import os
import re
import resource
import shlex
import signal
import statistics
import subprocess
import sys
import time
import tomllib
from pathlib import Path

from cores import count_cores, free_cores
from tumble import read_table

ROOT = Path(__file__).resolve().parent.parent


@functools.cache
def has_open_mpi():
    try:
        version = subprocess.run(["mpiexec", "--version"], capture_output=True, text=True, check=False).stdout
    except OSError:
        return False
    return "Open MPI" in version or "OpenRTE" in version


def can_pin(ranks):
    """Can launcher() give every rank a core of its own?"""
    return not os.environ.get("MPIEXEC") and has_open_mpi() and ranks <= count_cores() == os.cpu_count()


def default_jobs():
    """Runs at the same time, where the user has not said."""
    return free_cores()


def launcher(ranks, pinned=False):
    """Words before the program: $MPIEXEC if set; else mpiexec, if wanted and possible with one core a rank."""
    if os.environ.get("MPIEXEC"):
        return [*shlex.split(os.environ["MPIEXEC"]), "-n", str(ranks)]
    if not has_open_mpi():
        return ["mpiexec", "-n", str(ranks)]
    return ["mpiexec", *(["--bind-to", "core", "--map-by", "core"] if pinned and can_pin(ranks) else ["--oversubscribe", "--bind-to", "none"]), "-n", str(ranks)]


def environment():
    env = {**os.environ, "OMP_NUM_THREADS": os.environ.get("OMP_NUM_THREADS", "1")}
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        env.update(OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")
    env["OMPI_MCA_odls_base_sigkill_timeout"] = "0"  # else Open MPI's launcher takes a second or two to pass a failure on
    env.pop("PETSC_OPTIONS", None)
    return env


def option_words(options):
    """{'sim_dt': '0.1', 'x': None} -> ['-sim_dt', '0.1', '-x']"""
    return [word for name, value in options.items() for word in ([f"-{name}"] if value is None else [f"-{name}", str(value)])]


def option_text(options):
    return " ".join(f"-{name}" if value is None else f"-{name} {value}" for name, value in options.items())


def read_options(text, fail=None):
    """'-a 1 -b', or its words -> {'a': '1', 'b': None}; fail(message) is called with a word that belongs to no option, and with a second one of a name."""
    options, name = {}, None
    for word in shlex.split(text) if isinstance(text, str) else text:
        if re.match(r"-[A-Za-z]", word):
            name = word[1:]
            if fail and name in options:
                fail(f"option -{name} is given twice")
            options[name] = None
        elif fail and (name is None or options[name] is not None):
            fail(f"'{word}' belongs to no option")
        else:
            options[name] = word
    return options


# ---- command lines and lists of cases ----

def make_parser(doc, limit=None, **more):
    """A parser with the flags that all tools have."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False, **more)
    parser.add_argument("--build", default="build", metavar="FOLDER", help="where the program is (default: %(default)s)")
    if limit:
        parser.add_argument("--limit", type=float, default=limit, metavar="S", help="a run that takes longer is ended (default: %(default)s)")
    return parser


def split_words(text):
    return text.split(",") if text else []


def read_toml(parser, path):
    try:
        return tomllib.loads(Path(path).read_text())
    except (OSError, tomllib.TOMLDecodeError) as error:
        parser.error(f"{path}: {error}")


def check_keys(parser, where, entry, known):
    if wrong := set(entry) - set(known):
        parser.error(f"{where}: unknown key '{min(wrong)}' (known: {', '.join(sorted(known))})")


def choose(parser, kind, entries, names):
    """The entries with these names (without names: all), in the order of the names."""
    for name in names:
        if name not in entries:
            parser.error(f"no {kind} '{name}' (there are: {', '.join(entries)})")
    return {name: entries[name] for name in names or entries}


# ---- what a run left behind ----


def read_numbers(path):
    """Rows of a CSV file as dictionaries, numbers where a column has them; a last line cut short is left out; [] without the file."""
    table = read_table(path)
    return [dict(zip(table, row)) for row in zip(*(values.tolist() for values in table.values()))]


class Run:
    """What a run left behind. `ended` is 'ok', 'stopped' (message), 'crashed' (message: what the launcher said) or 'hung'."""

    def __init__(self, command, folder, status, out, err, seconds):
        self.command, self.folder, self.status, self.out, self.err, self.seconds = command, Path(folder), status, out, err, seconds
        found = re.search(r"^tumble: error: (.*)", err, re.M)
        self.message = found[1] if found else ""
        self.ended = "hung" if status is None else "ok" if status == 0 else "stopped" if found else "crashed"
        if self.ended == "crashed":
            self.message = " / ".join(line.strip() for line in err.strip().splitlines()[:6]) or f"exit status {status}"
        try:
            self.summary = json.loads((self.folder / "summary.json").read_text()) if status == 0 else None
        except (OSError, ValueError):
            self.summary = None

    def series(self):
        return read_numbers(self.folder / "series.csv")

    def bodies(self):
        return read_numbers(self.folder / "bodies.csv")

    def refuse_slow(self, tool):
        """Times of a build without optimisation mean nothing."""
        if not self.summary["optimised"]:
            sys.exit(f"{tool}: refused: PETSc or tumble is a debug build (or has sanitizers); its times mean nothing. Build with the default OPT against an optimised PETSc")

    def measured(self, skip):
        """What every table of times has of a run (with -output_bandwidth): who and how large, and medians over the steps but the first ones."""
        steps, summary = self.series()[skip:], self.summary
        return {
            **{name: summary[name] for name in ("commit", "ranks", "cells", "unknowns", "bodies")},
            "machine": machine_name(),
            "pinned": "yes" if can_pin(summary["ranks"]) else "no",
            **{f"{name}_s": statistics.median(row[f"seconds_{name}"] for row in steps) for name in ("nse", "force", "particle")},
            "total_s": statistics.median(row["seconds"] for row in steps),
            "outer_mean": f"{statistics.mean(row['outer_iterations'] for row in steps):.3g}",
            "triad_all_gbs": f"{summary['bandwidth']['triad_all'] / 1e9:.3g}",
            "memory_mb": f"{summary['memory_mb']:.0f}",
        }


def end_group(process):
    """End a launcher and everything it started."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, number)
        except ProcessLookupError:
            return
        try:
            process.wait(3)
        except subprocess.TimeoutExpired:
            pass


def run_scene(scene, options, ranks, folder, build="build", limit=None, launch=None, cwd=None):
    """Run the program on a scene with options {name: value}, its results in folder; at most limit seconds."""
    folder = Path(folder).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "summary.json").unlink(missing_ok=True)
    command = [*(launch or launcher(ranks)), str((ROOT / build / "tumble").resolve()), str(scene), *option_words(options), "-output_dir", str(folder), "-output_overwrite"]
    began = time.monotonic()
    process = subprocess.Popen(command, env=environment(), cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, errors="replace", start_new_session=True)
    try:
        out, err = process.communicate(timeout=limit)
        status = process.returncode
    except subprocess.TimeoutExpired:
        end_group(process)
        out, err = process.communicate()
        status = None
    except BaseException:
        end_group(process)
        raise
    return Run(command, folder, status, out, err, time.monotonic() - began)


def children_seconds():
    """Processor seconds of all programs that this one ran so far and that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def printable(command):
    """The command as typed from the top of the tree."""
    words = [word.removeprefix(str(ROOT) + "/") for word in command]
    return " ".join(shlex.quote(word) for word in words)


def machine_name():
    """Model of the processor and number of cores."""
    try:
        text = Path("/proc/cpuinfo").read_text()
        model = re.search(r"^model name\s*:\s*(.*)", text, re.M)[1].strip()
    except (OSError, TypeError):
        model = os.uname().machine
    return f"{model} x {os.cpu_count()}"


# ---- tables and figures ----


def read_rows(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def write_rows(path, columns, rows):
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def check_columns(path, columns):
    """Refuse a table with other columns."""
    if Path(path).exists() and Path(path).stat().st_size:
        with open(path) as file:
            found = file.readline().rstrip("\n")
        if found != ",".join(columns):
            raise SystemExit(f"{path} has other columns than this version writes: move it away\n  there: {found}\n  here:  {','.join(columns)}")


def append_row(path, columns, row):
    """Append one line to a table that is never rewritten."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "a", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        if not file.tell():
            writer.writerow(columns)
        writer.writerow([row.get(name, "") for name in columns])


def print_table(heading, rows, file=None):
    print("| " + " | ".join(heading) + " |", file=file)
    print("|" + " --- |" * len(heading), file=file)
    for row in rows:
        print("| " + " | ".join(str(cell) for cell in row) + " |", file=file)


def pyplot():
    """matplotlib.pyplot for files, imported when first needed."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot

    return matplotlib.pyplot


def save_figure(figure, path, plain=()):
    """Write a figure, the axes in plain with a legend and without a frame."""
    for axes in plain:
        axes.legend(frameon=False, fontsize=8)
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=150)
    pyplot().close(figure)
