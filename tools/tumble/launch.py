"""Start the program: run, start, sweep. See the package for how they are used."""

from __future__ import annotations

import itertools
import json
import os
import shlex
import shutil
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Callable, Iterator, Mapping, Union

import numpy as np

from .reader import Run

Scene = Union[str, os.PathLike, Mapping[str, Any]]
Progress = Union[None, bool, Callable[[dict], None]]
PATHS = ("file", "table", "library_path", "initial_run", "include")  # ends of keys whose values are paths
ERROR = "tumble: error: "


class Failure(RuntimeError):
    """The program refused a scene, or a run stopped: str(failure) is its one-line message, failure.output all that it printed, failure.status its exit status."""

    def __init__(self, message: str, output: str = "", status: int | None = None):
        super().__init__(message)
        self.output, self.status = output, status


def find_program() -> Path:
    """$TUMBLE_PROGRAM, `tumble` in PATH, or build/tumble of the source tree that holds this package or the working folder."""
    given = os.environ.get("TUMBLE_PROGRAM")
    if given:
        if not shutil.which(given):
            raise Failure(f"TUMBLE_PROGRAM={given} is no program: give the path of tumble")
        return Path(shutil.which(given)).resolve()
    here, work = Path(__file__).resolve(), Path.cwd().resolve()
    trees = [here.parents[2], work, *work.parents]
    places = [shutil.which("tumble"), *(tree / "build" / "tumble" for tree in trees if (tree / "include" / "shape.h").is_file())]
    for place in places:
        if place and os.access(place, os.X_OK):
            return Path(place)
    raise Failure("the program tumble is not found: build it with 'make', add its folder to PATH, or set TUMBLE_PROGRAM=/path/to/build/tumble")


def _text(value: Any) -> str:
    """A value as the command line takes it."""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (list, tuple, np.ndarray)):
        return ",".join(_text(item) for item in value)
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    return str(value)


def _flatten(options: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    """("particle_disc_density", 2) of {"particle": {"disc": {"density": 2}}}; None is left out."""
    for name, value in options.items():
        if isinstance(value, Mapping):
            yield from _flatten(value, f"{before}{name}_")
        elif value is not None:
            yield before + name, value


def _plain(value: Any, key: str = "") -> Any:
    """A scene as JSON takes it; relative paths, which the program would seek beside the scene file, made absolute."""
    if isinstance(value, Mapping):
        return {str(name): _plain(item, str(name)) for name, item in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_plain(item, key) for item in value]
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, os.PathLike) or (isinstance(value, str) and key.endswith(PATHS) and Path(value).exists()):
        return str(Path(value).resolve())
    return value


def _launcher(ranks: int) -> list[str]:
    """$MPIEXEC or mpiexec; Open MPI is told that ranks may share cores."""
    if ranks == 1:
        return []
    words = shlex.split(os.environ.get("MPIEXEC", ""))
    if not words:
        if not shutil.which("mpiexec"):
            raise Failure(f"ranks={ranks} needs mpiexec, which is not in PATH: set MPIEXEC, or use ranks=1")
        said = subprocess.run(["mpiexec", "--version"], capture_output=True, text=True, check=False).stdout
        words = ["mpiexec", *(["--oversubscribe", "--bind-to", "none"] if "Open MPI" in said or "OpenRTE" in said else [])]
    return [*words, "-n", str(ranks)]


def _environment() -> dict[str, str]:
    root = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"} if hasattr(os, "geteuid") and os.geteuid() == 0 else {}
    return {**os.environ, **root, "OMP_NUM_THREADS": os.environ.get("OMP_NUM_THREADS", "1")}


class Job:
    """A run that goes on. Iterate over it for the rows of series.csv as they are written; wait() for its end."""

    def __init__(self, words: list[str], directory: Path):
        self.command, self.directory = words, directory
        series = directory / "series.csv"
        self._before = _stamp(series)
        self._lines: list[str] = []
        self._process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", env=_environment())
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __repr__(self) -> str:
        return f"<tumble job {self.directory}: {'running' if self.running else f'ended with {self._process.returncode}'}>"

    def _read(self):
        with self._process.stdout as lines:
            for line in lines:
                self._lines.append(line)

    @property
    def running(self) -> bool:
        return self._process.poll() is None

    @property
    def output(self) -> str:
        """What the program has printed so far."""
        return "".join(self._lines)

    @property
    def run(self) -> Run:
        """The results so far; an error until there are any."""
        return Run(self.directory)

    def stop(self) -> None:
        """Ask the program to write a checkpoint and end."""
        if self.running:
            self._process.terminate()

    def __iter__(self) -> Iterator[dict]:
        """Rows of series.csv, {column: value}, until the run ends; a run that stops with an error raises Failure after its last row."""
        series = self.directory / "series.csv"
        while self.running and _stamp(series) == self._before:  # what stands there is of an earlier run
            time.sleep(0.05)
        if _stamp(series) != self._before:
            yield from Run(self.directory).follow(running=lambda: self.running)
        self._check()

    def _check(self):
        status = self._process.wait()
        self._reader.join()
        if status == 0:
            return
        lines = [line.strip() for line in self.output.splitlines() if line.strip()]
        told = [line[line.index(ERROR) + len(ERROR) :] for line in lines if ERROR in line]
        raise Failure((told or lines[-1:] or [f"{self.command[0]} ended with status {status}"])[0], self.output, status)

    def wait(self, progress: Progress = False) -> Run:
        """The results, when the run has ended. progress: True for a line on standard error, or a function that gets each row of series.csv."""
        tell = progress if callable(progress) else _Line(self.directory) if progress else None
        try:
            if tell:
                for row in self:
                    tell(row)
            self._check()
        except KeyboardInterrupt:
            self.stop()
            self._process.wait()
            raise
        finally:
            if isinstance(tell, _Line):
                tell.end()
        return Run(self.directory)


def _stamp(path: Path):
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns, found.st_size


class _Line:
    """One line that tells how far a run is: "sedimentation: step 34, time 0.34, 34 %, 12 s left"."""

    def __init__(self, directory: Path):
        self.directory, self.began, self.first, self.said = directory, time.time(), None, 0.0

    def __call__(self, row: dict):
        now = time.time()
        if self.first is None:
            options = Run(self.directory).options
            self.goal = [(name, float(options[key])) for name, key in (("step", "sim_steps"), ("time", "sim_time")) if key in options]
            self.first = row
        if now - self.said < 0.2:
            return
        self.said = now
        # of a step that begins the run, what went before it counts as well
        done = [(row[name] / goal, row[name] - self.first[name], goal - row[name]) for name, goal in self.goal if name in row and goal > 0]
        text = f"{self.directory.name}: step {row.get('step', 0):.0f}, time {row.get('time', 0):.6g}"
        if done:
            part, gone, left = max(done)
            text += f", {100 * min(1, part):.0f} %" + (f", {(now - self.began) * left / gone:.0f} s left" if gone > 0 else "")
        print(f"\r{text:<78}", end="", file=sys.stderr, flush=True)

    def end(self):
        if self.said:
            print(file=sys.stderr)


def _write_scene(scene: Scene, directory: Path) -> Path:
    """The path of the scene; a dictionary is written into the directory, as JSON, which is YAML."""
    if not isinstance(scene, Mapping):
        return Path(scene)
    try:
        directory.mkdir(parents=True, exist_ok=True)
        path = directory / f"{directory.resolve().name}.yaml"
        path.write_text(json.dumps(_plain(scene), indent=2) + "\n")
    except (OSError, TypeError) as error:
        raise Failure(f"cannot write the scene into {directory}: {error}") from error
    return path


def start(scene: Scene, ranks: int = 1, out: str | os.PathLike | None = None, **options: Any) -> Job:
    """Start a run and return at once.

    scene: a scene file, or a dictionary of what stands in one (paths in it are relative to the working folder; it is written into the output
    directory). ranks: of MPI. out: the output directory, by default out/<name of the scene file>, for a dictionary out/scene. options: any by its
    name without dash, sim_dt=0.01, particle_disc_position=[1, 4], or nested, sim={"dt": 0.01}; they win over the scene.
    """
    if out is None:
        out = options.pop("output_dir", None) or Path("out") / ("scene" if isinstance(scene, Mapping) else Path(scene).stem)
    directory = Path(out)
    words = [word for name, value in _flatten(options) for word in (f"-{name}", _text(value))]
    program, launcher = find_program(), _launcher(ranks)
    free = options.get("output_overwrite") or options.get("sim_restart") or not (directory / "series.csv").exists()
    if isinstance(scene, Mapping) and not free:  # the scene in it is that of its results
        raise Failure(f"directory '{directory}' already holds the results of a run (series.csv): choose another out, or allow it with output_overwrite=True")
    return Job([*launcher, str(program), str(_write_scene(scene, directory)), "-output_dir", str(directory), *words], directory)


def run(scene: Scene, ranks: int = 1, out: str | os.PathLike | None = None, progress: Progress = None, **options: Any) -> Run:
    """Run a scene to its end; arguments as of start(). Raises Failure with the program's message.

    progress: True for a line on standard error, False for none, None for one where somebody looks (a terminal, a notebook), or a function that gets
    each row of series.csv as it is written.
    """
    return start(scene, ranks, out, **options).wait(_is_watched() if progress is None else progress)


def _is_watched() -> bool:
    return sys.stderr.isatty() or "ipykernel" in sys.modules


def sweep(scene: Scene, ranks: int = 1, jobs: int = 1, out: str | os.PathLike | None = None, progress: Progress = None, **lists: Any):
    """Run a scene for all combinations of the lists; returns a pandas.DataFrame of one row a run.

    lists: options as of start(); a list is varied, anything else, a tuple too, is one value: sim_dt=[0.01, 0.005], mesh_cells=[(16, 48), (32, 96)].
    jobs: runs at a time. out: where the runs' directories are made, 000, 001, ..., by default out/<scene>-sweep; sweep.csv there is the table.
    Columns: the varied options, the quantities of summary.json, steps, seconds, directory; where runs failed, error with their messages (if all
    fail, Failure is raised).
    """
    import pandas

    fixed = {name: value for name, value in lists.items() if not isinstance(value, list)}
    varied = {name: value for name, value in lists.items() if isinstance(value, list)}
    if not all(varied.values()):
        raise ValueError(f"nothing to run: {next(name for name, value in varied.items() if not value)} is an empty list")
    folder = Path(out) if out else Path("out") / f"{'scene' if isinstance(scene, Mapping) else Path(scene).stem}-sweep"
    points = [dict(zip(varied, values)) for values in itertools.product(*varied.values())]
    tell = _is_watched() if progress is None else progress
    lock, done = threading.Lock(), []

    def one(number: int) -> tuple[dict, Failure | None]:
        row, failure = dict(points[number]), None
        directory = folder / f"{number:03d}"
        try:
            summary = run(scene, ranks, directory, False, **{**fixed, **points[number]}).summary
            row.update(summary.get("quantities", {}), steps=summary.get("steps"), seconds=summary.get("seconds", {}).get("total"))
        except Failure as error:
            row["error"], failure = str(error), error
        row["directory"] = str(directory)
        with lock:
            done.append(number)
            if tell is True:
                print(f"\r{folder.name}: {len(done)} of {len(points)} runs", end="\n" if len(done) == len(points) else "", file=sys.stderr, flush=True)
            elif callable(tell):
                tell(row)
        return row, failure

    with ThreadPoolExecutor(max(1, jobs)) as pool:
        results = list(pool.map(one, range(len(points))))
    if all(failure for _, failure in results):
        raise results[0][1]
    frame = pandas.DataFrame([row for row, _ in results])
    frame.to_csv(folder / "sweep.csv", index=False)
    return frame
