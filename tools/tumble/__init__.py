"""Read what a run of tumble left in its output directory.

    import tumble
    run = tumble.open("out/dkt")
    run.series["time_s"], run.bodies["v"]              columns of the tables as arrays; run.series.frame() is a pandas DataFrame
    run.body(1)["y"]                                   the rows of one body
    shot = run.snapshot(time=0.2)                      the nearest one; or step=...; run.steps, run.times list them
    shot["velocity"]                                   [points][3]; shot.points [points][3], shot.cells [cells][9 or 27] in VTK's order
    shot.sample("velocity", [[1.0, 3.5]])              its value at places, by the finite element polynomials; nan outside
    shot.bodies["position"]                            [bodies][3] at that moment
    run.summary["quantities"], run.options["sim_dt"]

Needs numpy; snapshots need h5py; frame() needs pandas.
"""

import csv
import functools
import json
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np

__all__ = ["Run", "Snapshot", "Table", "open"]
_open = open

# Place of VTK's k-th node of a cell in its lattice of three points a direction, first coordinate fastest: corners, edges, (space: faces,) centre
VTK_QUAD = np.array([0, 2, 8, 6, 1, 5, 7, 3, 4])
VTK_HEX = np.array([0, 2, 8, 6, 18, 20, 26, 24, 1, 5, 7, 3, 19, 23, 25, 21, 9, 11, 17, 15, 12, 14, 10, 16, 4, 22, 13])


def open(directory):
    """The run whose results lie in the directory."""
    return Run(directory)


class Table(dict):
    """Columns by name, in the order of the file: arrays of numbers, of words where a column has any that is no number."""

    def frame(self):
        """The table as pandas.DataFrame."""
        import pandas

        return pandas.DataFrame(self)

    def where(self, mask):
        return Table({name: values[mask] for name, values in self.items()})

    def __len__(self):
        return len(next(iter(self.values()))) if self.keys() else 0


def _numbers(words):
    try:
        return np.array([float(word) if word.strip() else np.nan for word in words])
    except ValueError:
        return np.array(words)


def read_table(path):
    """A CSV file; lines cut short (a running or killed job) and comments are left out, an absent file has no columns."""
    path = Path(path)
    if not path.exists():
        return Table()
    with _open(path, newline="") as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))
    if not rows:
        return Table()
    names, rows = rows[0], [row for row in rows[1:] if len(row) == len(rows[0])]
    return Table({name: _numbers([row[i] for row in rows]) for i, name in enumerate(names)})


def find_snapshots(folder, kind, unlisted=False):
    """{step: file} of the snapshots <kind>_<step>.h5 that <kind>.xmf names: other files may come from an earlier run. Without that list none, or all if unlisted."""
    folder = Path(folder)
    index = folder / f"{kind}.xmf"
    if index.exists():
        names = {item.text.split(":")[0].strip() for item in ElementTree.parse(index).iter("DataItem") if item.text}
    else:
        names = {path.name for path in folder.glob(f"{kind}_*.h5")} if unlisted else set()
    found = {int(match[1]): folder / match[0] for match in (re.fullmatch(kind + r"_(\d+)\.h5", name) for name in names) if match}
    return dict(sorted(found.items()))


def find_meshes(folder):
    """{name of a file of fields: name of the mesh it belongs to} by fields.xmf; meshes that move have several."""
    index = Path(folder) / "fields.xmf"
    found = {}
    for grid in ElementTree.parse(index).iter("Grid") if index.exists() else ():
        names = {item.text.split(":")[0].strip() for item in grid.iter("DataItem") if item.text}
        fields, meshes = ([name for name in names if name.startswith(kind)] for kind in ("fields_", "mesh"))
        if len(fields) == 1 and len(meshes) == 1:
            found[fields[0]] = meshes[0]
    return found


class Run:
    """An output directory; tables are read when first asked for."""

    def __init__(self, directory):
        self.directory = Path(directory)
        if not self.directory.is_dir():
            raise FileNotFoundError(f"directory '{directory}' does not exist: give the output directory of a run, for example out/sedimentation")
        self._tables = {}
        self._files = find_snapshots(self.directory, "fields", unlisted=True)
        self._body_files = find_snapshots(self.directory, "bodies", unlisted=True)
        self._meshes = find_meshes(self.directory)
        if not self._files and not any((self.directory / name).exists() for name in ("series.csv", "bodies.csv", "summary.json")):
            raise FileNotFoundError(f"directory '{directory}' holds no results: neither series.csv, nor bodies.csv, nor snapshots of fields")

    def __repr__(self):
        return f"<tumble run {self.directory}: {len(self.series)} steps, {len(self.steps)} snapshots>"

    def _table(self, name):
        if name not in self._tables:
            self._tables[name] = read_table(self.directory / name)
        return self._tables[name]

    @property
    def series(self):
        """A row a step: series.csv."""
        return self._table("series.csv")

    @property
    def bodies(self):
        """A row a step and body: bodies.csv, or where that has no lines table_<step>.h5 of the steps of series.csv."""
        if not len(self._table("bodies.csv").get("body", ())):
            self._tables["bodies.csv"] = self._read_body_tables()
        return self._table("bodies.csv")

    def _read_body_tables(self):
        paths = {int(step): self.directory / f"table_{int(step)}.h5" for step in self.series.get("step", ())}
        if not any(path.exists() for path in paths.values()):
            return self._table("bodies.csv")
        import h5py

        steps = []
        for step, path in paths.items():
            if path.exists():
                with h5py.File(path) as file:
                    columns = {name: file[name][()].reshape(-1) for name in file}
                    groups = bytes(file.attrs["groups"]).decode().rstrip("\0").split(",")
                time, n = columns.pop("time_s")[0], len(columns["body"])
                columns["group"] = np.array(groups)[columns["group"]]
                steps.append({"step": np.full(n, float(step)), "time_s": np.full(n, time), **columns})
        order = [name for name in self._table("bodies.csv") if name in steps[0]]
        return Table({name: np.concatenate([columns[name] for columns in steps]) for name in order or steps[0]})

    def body(self, number):
        """The rows of one body of bodies.csv."""
        rows = self.bodies.where(self.bodies["body"] == number) if self.bodies else Table()
        if not len(rows):
            raise KeyError(f"no body {number} in {self.directory / 'bodies.csv'}")
        return rows

    @property
    def summary(self):
        """summary.json; {} while the run goes on."""
        path = self.directory / "summary.json"
        return json.loads(path.read_text()) if path.exists() else {}

    @property
    def options(self):
        """{name without dash: text} of options.txt."""
        path = self.directory / "options.txt"
        lines = path.read_text().splitlines() if path.exists() else []
        pairs = (line[1:].partition(" ") for line in lines if line.startswith("-"))
        return {name: value for name, _, value in pairs}

    @property
    def steps(self):
        """Steps that have a snapshot of the fields, or of the bodies in a run without flow."""
        return list(self._files or self._body_files)

    @property
    def times(self):
        """Their times."""
        return np.array([self.snapshot(step=step).time for step in self.steps])

    def snapshot(self, step=None, time=None):
        """Fields of a step, or of the snapshot nearest to a time; without either the last one."""
        if not self.steps:
            raise KeyError(f"{self.directory} has no snapshots: run the scene with -output_every N")
        if step is None:
            step = self.steps[-1] if time is None else self.steps[int(np.argmin(abs(self.times - time)))]
        if step not in self.steps:
            raise KeyError(f"no snapshot of step {step} in {self.directory} (there are: {', '.join(map(str, self.steps))})")
        path = self._files.get(step)
        mesh = self.directory / self._meshes.get(path.name, "mesh.h5") if path else None
        return Snapshot(mesh, path, self._body_files.get(step), step)


class Snapshot:
    """Fields at one time, read when first asked for."""

    def __init__(self, mesh, path, body_path, step):
        import h5py

        self._h5py, self._mesh, self._path, self._body_path, self.step = h5py, mesh, path, body_path, step
        self._fields, self._search, self._bodies = {}, None, None
        with h5py.File(path or body_path) as file:
            self.time = float(np.ravel(file["time"][:])[0]) if "time" in file else np.nan
            self.names = [name for name in file if name != "time"] if path else []
        self.has_mesh = path is not None

    @functools.cached_property
    def points(self):
        with self._h5py.File(self._mesh) as mesh:
            return mesh["coordinates"][:]

    @functools.cached_property
    def cells(self):
        with self._h5py.File(self._mesh) as mesh:
            return mesh["cells"][:]

    @property
    def dim(self):
        """2 or 3; of a run without flow 3 unless its bodies have outlines."""
        return (2 if self.cells.shape[1] == 9 else 3) if self.has_mesh else 2 if "outline" in self.bodies else 3

    def __repr__(self):
        return f"<tumble snapshot, step {self.step}, time {self.time:g}: {', '.join(self.names)}>"

    def __getitem__(self, name):
        """A field: [points] or [points][3] at points, [cells] or [cells][3] for those of cells."""
        if name not in self._fields:
            if name not in self.names:
                raise KeyError(f"no field '{name}' in {self._path} (there are: {', '.join(self.names)})")
            with self._h5py.File(self._path) as file:
                values = file[name][:]
            self._fields[name] = values[:, 0] if values.ndim == 2 and values.shape[1] == 1 else values
        return self._fields[name]

    @property
    def bodies(self):
        """{name: [bodies] or [bodies][3]} at this time: position, velocity, angular_velocity, force, radius, ...; {} if there are none."""
        if self._bodies is None:
            self._bodies = {}
            if self._body_path:
                with self._h5py.File(self._body_path) as file:
                    self._bodies = {name: values[:] for name, values in file.items() if name != "time"}
        return self._bodies

    def sample(self, name, places):
        """A field of points, by name or as an array, at places [n][2 or 3], by the polynomials of the cells (second order in each direction); nan outside of the mesh."""
        places = np.atleast_2d(np.asarray(places, float))[:, : self.dim]
        values = self[name] if isinstance(name, str) else name
        if len(values) != len(self.points):
            raise ValueError(f"'{name}' belongs to cells, not to points: sample one of the others")
        if self._search is None:
            self._search = _Search(self.points[:, : self.dim], self.cells)
        result = np.full((len(places), *values.shape[1:]), np.nan)
        for first in range(0, len(places), 5000):  # memory
            cell, weight = self._search.find(places[first : first + 5000])
            there = cell >= 0
            result[first : first + 5000][there] = np.einsum("nk,nk...->n...", weight[there], values[self.cells[cell[there]]].astype(float))
        return result


def _lagrange(xi):
    """Values [..., 3] of the quadratic polynomials of the nodes -1, 0, 1, and their derivatives."""
    return np.stack([xi * (xi - 1) / 2, 1 - xi * xi, xi * (xi + 1) / 2], -1), np.stack([xi - 0.5, -2 * xi, xi + 0.5], -1)


def _shape_functions(xi):
    """Values [n][nodes] at reference places [n][dim] and derivatives [n][nodes][dim], nodes in VTK's order."""
    n, dim = xi.shape
    one = [_lagrange(xi[:, d]) for d in range(dim)]

    def product(derivative):
        out = np.ones((n, 1))
        for d in reversed(range(dim)):  # the first coordinate runs fastest
            out = (out[:, :, None] * one[d][derivative == d][:, None, :]).reshape(n, 3 * out.shape[1])
        return out[:, VTK_QUAD if dim == 2 else VTK_HEX]

    return product(-1), np.stack([product(d) for d in range(dim)], -1)


class _Search:
    """The cell that holds a place: bins over the cells' boxes, then Newton's method for the inverse of the cell's map."""

    OUTSIDE = 1e-6  # of a cell: a place on its border belongs to it
    MISS = 1e-5  # of a cell: what Newton's method may leave; where a map is nearly flat it is slow

    def __init__(self, points, cells):
        self.x = points[cells]  # [cells][nodes][dim]
        spread = self.x.max(1) - self.x.min(1)
        slack = 0.05 * spread  # curved sides bulge beyond their nodes
        self.lower, self.upper = self.x.min(1) - slack, self.x.max(1) + slack
        self.origin, self.h = self.lower.min(0), np.median(spread, 0) * 1.5
        self.n = np.maximum(1, np.ceil((self.upper.max(0) - self.origin) / self.h).astype(int))
        first, last = self._bin(self.lower), self._bin(self.upper)
        lists = {}
        for cell, (a, b) in enumerate(zip(first, last)):
            for index in np.ndindex(*(b - a + 1)):
                lists.setdefault(tuple(a + index), []).append(cell)
        self.lists = lists

    def _bin(self, x):
        return np.clip(((x - self.origin) / self.h).astype(int), 0, self.n - 1)

    def find(self, places):
        """Cell of each place (-1: none) and the weights [n][nodes] of its nodes."""
        pairs = [(i, cell) for i, key in enumerate(map(tuple, self._bin(places))) for cell in self.lists.get(key, ())]
        found, weight = np.full(len(places), -1), np.zeros((len(places), self.x.shape[1]))
        if not pairs:
            return found, weight
        place, cell = np.array(pairs).T
        inside = ((places[place] >= self.lower[cell]) & (places[place] <= self.upper[cell])).all(1)
        place, cell = place[inside], cell[inside]
        xi, miss = self._invert(places[place], self.x[cell])
        good = (abs(xi) <= 1 + self.OUTSIDE).all(1) & (miss <= self.MISS * (self.upper - self.lower)[cell].max(1))
        place, cell, xi = place[good], cell[good], xi[good]
        found[place] = cell
        last = {p: i for i, p in enumerate(place)}  # of several cells that share the place, the one taken above
        keep = np.array(list(last.values()), int)
        weight[place[keep]] = _shape_functions(xi[keep])[0]
        return found, weight

    @staticmethod
    def _invert(places, x):
        """Reference coordinates by damped steps, and how far from the places they are."""
        xi = np.zeros_like(places)
        for _ in range(40):
            value, slope = _shape_functions(xi)
            miss = places - np.einsum("nk,nkd->nd", value, x)
            jacobian = np.einsum("nke,nkd->nde", slope, x)
            jacobian[np.linalg.det(jacobian) == 0] += 1e-12 * np.eye(places.shape[1])
            step = np.linalg.solve(jacobian, miss[:, :, None])[:, :, 0] if len(places) else miss
            step /= np.maximum(1, 2 * abs(step).max(1, initial=0))[:, None]
            xi = np.clip(xi + step, -3, 3)
            if not len(places) or abs(step).max() < 1e-13:
                break
        return xi, abs(places - np.einsum("nk,nkd->nd", _shape_functions(xi)[0], x)).max(1, initial=0)
