"""The results of a run, read from its output directory: Run, Snapshot, Table. See the package for how they are used."""

from __future__ import annotations

import base64
import csv
import functools
import json
import re
import time
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Callable, Iterator, Sequence

import numpy as np

from .sampling import Search

BIQUADRATIC_QUAD, TRIQUADRATIC_HEXAHEDRON = 28, 29  # VTK's numbers of these cells

# columns of earlier versions: files that have them are read under the present names
RENAMED = {"time_s": "time", "dt_s": "dt", "angle_rad": "angle", "snap_taylor": "aligned_extrapolated", "snap_kept": "aligned_unchanged"}
RENAMED |= {"snap_narrow": "aligned_narrow_gaps", "snap_fallback": "aligned_penalty_bodies", "snap_corners": "aligned_cut_corners"}
RENAMED |= {f"momentum_{old}_{axis}": f"momentum_{new}_{axis}" for old, new in (("openings", "inout"), ("volume", "body_force")) for axis in "xyz"}


def tell_renamed(name: str) -> str:
    """What a message says of a column that is not there: its present name, or nothing."""
    return f"; '{name}' is now called '{RENAMED[name]}'" if name in RENAMED else ""


class Table(dict):
    """Columns by name, in the order of the file: arrays of numbers, of words where a column has any that is no number.

    All else that is asked of it is asked of its pandas.DataFrame: table.plot(x="time", y="v"), table.iloc[-1], table[["time", "v"]],
    table[table["v"] < 0]. A column alone is an array: table["v"][-1].
    """

    def frame(self):
        """The table as pandas.DataFrame."""
        try:
            import pandas
        except ImportError as error:
            raise ImportError("this needs pandas: pip install pandas, or take the columns, which are arrays: table['time']") from error
        return pandas.DataFrame(dict(self))

    def __getitem__(self, key):
        return super().__getitem__(key) if isinstance(key, str) else self.frame()[key]

    def __missing__(self, key):
        raise KeyError(f"no column '{key}'{tell_renamed(key)}")

    def __getattr__(self, name: str):
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.frame(), name)

    def _repr_html_(self):
        return self.frame()._repr_html_()

    def where(self, mask: np.ndarray) -> Table:
        """The rows for which the mask is true."""
        return Table({name: values[mask] for name, values in self.items()})

    def __len__(self):
        return len(next(iter(self.values()))) if self.keys() else 0


def _numbers(words):
    try:
        return np.array([float(word) if word.strip() else np.nan for word in words])
    except ValueError:
        return np.array(words)


def read_table(path: str | Path) -> Table:
    """A CSV file; lines cut short (a running or killed job) and comments are left out, an absent file has no columns."""
    path = Path(path)
    if not path.exists():
        return Table()
    with open(path, newline="") as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))
    if not rows:
        return Table()
    names, rows = [RENAMED.get(name, name) for name in rows[0]], [row for row in rows[1:] if len(row) == len(rows[0])]
    return Table({name: _numbers([row[i] for row in rows]) for i, name in enumerate(names)})


def find_index(folder, kind):
    """<kind>.xdmf, or <kind>.xmf of an earlier version; None if there is neither."""
    paths = (Path(folder) / f"{kind}{ending}" for ending in (".xdmf", ".xmf"))
    return next((path for path in paths if path.exists()), None)


def find_snapshots(folder, kind, unlisted=False):
    """{step: file} of the snapshots <kind>_<step>.h5 that <kind>.xdmf names: other files may come from an earlier run. Without that list none, or all if unlisted."""
    folder = Path(folder)
    index = find_index(folder, kind)
    if index:
        names = {item.text.split(":")[0].strip() for item in ElementTree.parse(index).iter("DataItem") if item.text}
    else:
        names = {path.name for path in folder.glob(f"{kind}_*.h5")} if unlisted else set()
    found = {int(match[1]): folder / match[0] for match in (re.fullmatch(kind + r"_(\d+)\.h5", name) for name in names) if match}
    return dict(sorted(found.items()))


def find_meshes(folder):
    """{name of a file of fields: name of the mesh it belongs to} by fields.xdmf; meshes that move have several."""
    index = find_index(folder, "fields")
    found = {}
    for grid in ElementTree.parse(index).iter("Grid") if index else ():
        names = {item.text.split(":")[0].strip() for item in grid.iter("DataItem") if item.text}
        fields, meshes = ([name for name in names if name.startswith(kind)] for kind in ("fields_", "mesh"))
        if len(fields) == 1 and len(meshes) == 1:
            found[fields[0]] = meshes[0]
    return found


class _Tail:
    """The rows of a table that grows: each look gives those written since the last one."""

    def __init__(self, path):
        self.path, self.at, self.names = path, 0, None

    def read(self):
        if not self.path.exists():
            return
        with open(self.path, "rb") as file:
            file.seek(self.at)
            text = file.read()
        text = text[: text.rfind(b"\n") + 1]  # a line that is being written waits
        self.at += len(text)
        for row in csv.reader(line for line in text.decode().splitlines() if not line.startswith("#")):
            if self.names is None:
                self.names = [RENAMED.get(name, name) for name in row]
            elif len(row) == len(self.names):
                yield {name: _numbers([word])[0] for name, word in zip(self.names, row)}


class Pictures(list):
    """Paths of pictures; a notebook shows the pictures."""

    def _repr_html_(self):
        data = ((path.name, base64.b64encode(path.read_bytes()).decode()) for path in self)
        return "\n".join(f'<img alt="{name}" style="max-width: 48%" src="data:image/png;base64,{text}">' for name, text in data)


class Run:
    """An output directory; tables are read when first asked for."""

    def __init__(self, directory: str | Path):
        self.directory = Path(directory)
        if not self.directory.is_dir():
            raise FileNotFoundError(f"directory '{directory}' does not exist: give the output directory of a run, for example out/sedimentation")
        self._tables = {}
        self._files = find_snapshots(self.directory, "fields", unlisted=True)
        self._body_files = find_snapshots(self.directory, "bodies", unlisted=True)
        self._bond_files = find_snapshots(self.directory, "bonds")
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
    def series(self) -> Table:
        """A row a step: series.csv."""
        return self._table("series.csv")

    @property
    def bodies(self) -> Table:
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
                    columns = {RENAMED.get(name, name): file[name][()].reshape(-1) for name in file}
                    groups = bytes(file.attrs["groups"]).decode().rstrip("\0").split(",")
                time, n = columns.pop("time")[0], len(columns["body"])
                columns["group"] = np.array(groups)[columns["group"]]
                steps.append({"step": np.full(n, float(step)), "time": np.full(n, time), **columns})
        order = [name for name in self._table("bodies.csv") if name in steps[0]]
        return Table({name: np.concatenate([columns[name] for columns in steps]) for name in order or steps[0]})

    def group(self, name: str) -> Table:
        """The rows of the bodies of one group."""
        rows = self.bodies.where(self.bodies["group"] == name) if self.bodies else Table()
        if not len(rows):
            known = ", ".join(np.unique(self.bodies["group"])) if len(self.bodies) else "none"
            raise KeyError(f"no group '{name}' in {self.directory / 'bodies.csv'} (there are: {known})")
        return rows

    def body(self, number: int) -> Table:
        """The rows of one body of bodies.csv."""
        rows = self.bodies.where(self.bodies["body"] == number) if self.bodies else Table()
        if not len(rows):
            raise KeyError(f"no body {number} in {self.directory / 'bodies.csv'}")
        return rows

    @property
    def summary(self) -> dict:
        """summary.json; {} while the run goes on."""
        path = self.directory / "summary.json"
        return json.loads(path.read_text()) if path.exists() else {}

    @property
    def options(self) -> dict[str, str]:
        """{name without dash: text} of options.txt."""
        path = self.directory / "options.txt"
        lines = path.read_text().splitlines() if path.exists() else []
        pairs = (line[1:].partition(" ") for line in lines if line.startswith("-"))
        return {name: value for name, _, value in pairs}

    @property
    def steps(self) -> list[int]:
        """Steps that have a snapshot of the fields, or of the bodies in a run without flow."""
        return list(self._files or self._body_files)

    @property
    def times(self) -> np.ndarray:
        """Their times."""
        return np.array([self.snapshot(step=step).time for step in self.steps])

    def follow(self, poll: float = 0.2, running: Callable[[], bool] | None = None) -> Iterator[dict]:
        """Rows of series.csv, {column: value}, as they are written: those that are there, then each new one, until the run has ended.

        A run has ended when its summary.json is newer than series.csv; running, if given, is asked instead. poll: seconds between two looks.
        """
        tail = _Tail(self.directory / "series.csv")
        while True:
            more = running() if running else not self._has_ended()
            yield from tail.read()
            if not more:
                self._tables.clear()
                return
            time.sleep(poll)

    def _has_ended(self):
        series, summary = (self.directory / name for name in ("series.csv", "summary.json"))
        return summary.exists() and (not series.exists() or summary.stat().st_mtime >= series.stat().st_mtime)

    def plot(self, field: str | Sequence[str] = "speed", step: int | None = None, curve: str | Sequence[str] = (), **options) -> Pictures:
        """Draw the pictures of tumble-plot into the directory (trajectory, history, fields); returns their paths, which a notebook shows.

        curve: "v" or "y/x", columns of bodies.csv against each other; options: as on the command line (slice="x=0.5", cells=True, units="si").
        """
        from . import plot

        words = [str(self.directory), *(["--step", str(step)] if step is not None else [])]
        for name, values in {"field": field, "curve": curve, **options}.items():
            for value in [values] if isinstance(values, (str, int, float)) else values:
                if value is not False:
                    words += ["--" + name.replace("_", "-")] + ([] if value is True else [str(value)])
        return Pictures(plot.plot_run(plot.make_parser().parse_args(words), say=lambda path: None))

    def snapshot(self, step: int | None = None, time: float | None = None) -> Snapshot:
        """Fields of a step, or of the snapshot nearest to a time; without either the last one."""
        if not self.steps:
            raise KeyError(f"{self.directory} has no snapshots: run the scene with -output_every N")
        if step is None:
            step = self.steps[-1] if time is None else self.steps[int(np.argmin(abs(self.times - time)))]
        if step not in self.steps:
            raise KeyError(f"no snapshot of step {step} in {self.directory} (there are: {', '.join(map(str, self.steps))})")
        path = self._files.get(step)
        mesh = self.directory / self._meshes.get(path.name, "mesh.h5") if path else None
        return Snapshot(mesh, path, self._body_files.get(step), step, self._bond_files.get(step))

    @property
    def drops(self) -> Table:
        """A row a step and drop: drops.csv."""
        return self._table("drops.csv")


class Snapshot:
    """Fields at one time, read when first asked for."""

    def __init__(self, mesh, path, body_path, step, bond_path=None):
        import h5py

        self._h5py, self._mesh, self._path, self._body_path, self._bond_path, self.step = h5py, mesh, path, body_path, bond_path, step
        self._fields, self._search, self._bodies = {}, None, None  # read when first asked for
        with h5py.File(path or body_path) as file:
            self.time = float(np.ravel(file["time"][:])[0]) if "time" in file else np.nan
            self.names = [name for name in file if name != "time"] if path else []
        self.has_mesh = path is not None

    @functools.cached_property
    def points(self) -> np.ndarray:
        with self._h5py.File(self._mesh) as mesh:
            return mesh["coordinates"][:]

    @functools.cached_property
    def cells(self) -> np.ndarray:
        with self._h5py.File(self._mesh) as mesh:
            return mesh["cells"][:]

    @property
    def dim(self) -> int:
        """2 or 3; of a run without flow 3 unless its bodies have outlines."""
        return (2 if self.cells.shape[1] == 9 else 3) if self.has_mesh else 2 if "outline" in self.bodies else 3

    def __repr__(self):
        return f"<tumble snapshot, step {self.step}, time {self.time:g}: {', '.join(self.names)}>"

    def __getitem__(self, name: str) -> np.ndarray:
        """A field: [points] or [points][3] at points, [cells] or [cells][3] for those of cells."""
        if name not in self._fields:
            if name not in self.names:
                raise KeyError(f"no field '{name}' in {self._path} (there are: {', '.join(self.names)})")
            with self._h5py.File(self._path) as file:
                values = file[name][:]
            self._fields[name] = values[:, 0] if values.ndim == 2 and values.shape[1] == 1 else values
        return self._fields[name]

    @property
    def bodies(self) -> dict[str, np.ndarray]:
        """{name: [bodies] or [bodies][3]} at this time: position, velocity, angular_velocity, force, radius, ...; {} if there are none."""
        if self._bodies is None:
            self._bodies = {}
            if self._body_path:
                with self._h5py.File(self._body_path) as file:
                    self._bodies = {name: values[:] for name, values in file.items() if name != "time"}
        return self._bodies

    @functools.cached_property
    def bonds(self) -> dict[str, np.ndarray]:
        """{name: [bonds]} at this time: body, partner, aggregate, tension, shear, twist, bending, energy, formed, and end [2 bonds][3]; {} without."""
        if not self._bond_path:
            return {}
        with self._h5py.File(self._bond_path) as file:
            return {name: values[:] for name, values in file.items() if name != "time"}

    @functools.cached_property
    def drops(self) -> dict[str, np.ndarray]:
        """The interface of drops at this time: coordinates [3 edges][3], edge [edges][3] (ends, middle), drop, group, curve [edges]; {} without.

        In space faces in place of edges: face [faces][9] (corners, middles of sides, middle).
        """
        return self._read_beside("drops", flat=("drop", "group", "curve")) if "phase" in self.names else {}

    @functools.cached_property
    def solids(self) -> dict[str, np.ndarray]:
        """Elastic particles at this time: coordinates, displacement, velocity [nodes][3], cells [cells][9 or 27, of membranes 3 or 9] (order of VTK), solid, J [cells], stress [cells][6] (xx, yy,
        zz, xy, xz, yz); {} without."""
        return self._read_beside("solid", flat=("solid", "J"))

    def _read_beside(self, kind, flat):
        """Arrays of <kind>_<step>.h5, which lies beside the fields, the `flat` ones as [n]; {} where there is no such file."""
        path = self._path.with_name(f"{kind}_{self.step}.h5") if self._path else None
        if not path or not path.exists():
            return {}
        with self._h5py.File(path) as file:
            return {name: np.ravel(values[:]) if name in flat else values[:] for name, values in file.items() if name != "time"}

    def pyvista(self, what: str = "fields"):
        """The fields as pyvista.UnstructuredGrid with all nodes of the quadratic cells; what="bodies": outlines or surfaces, "bonds" and "drops": lines (drops in space: faces), as pyvista.PolyData.

        shot.pyvista().plot(scalars="velocity"). Quadratic cells are drawn by their corners unless they are split: .tessellate().
        """
        import pyvista

        if what == "bodies":
            return self._bodies_pyvista(pyvista)
        if what == "bonds":
            return self._bonds_pyvista(pyvista)
        if what == "drops":
            return self._drops_pyvista(pyvista)
        if what != "fields":
            raise ValueError(f"'{what}' is none of 'fields', 'bodies', 'bonds', 'drops'")
        if not self.has_mesh:
            raise ValueError("this run has no fields, only bodies: pyvista('bodies')")
        kind = BIQUADRATIC_QUAD if self.dim == 2 else TRIQUADRATIC_HEXAHEDRON
        grid = pyvista.UnstructuredGrid({kind: self.cells.astype(np.int64)}, self.points.astype(float))
        for name in self.names:
            (grid.point_data if len(self[name]) == len(self.points) else grid.cell_data)[name] = self[name]
        grid.field_data["time"] = [self.time]
        return grid

    def _bodies_pyvista(self, pyvista):
        bodies = self.bodies
        if "surface" in bodies:
            points, cells = bodies["surface"], bodies["triangle"]
        elif "outline" in bodies and len(bodies["outline"]):
            points = bodies["outline"].reshape(-1, 3)
            cells = np.arange(len(points)).reshape(len(bodies["position"].reshape(-1, 3)), -1)
        else:
            raise ValueError("this snapshot has no bodies that can be drawn")
        faces = np.insert(cells, 0, cells.shape[1], axis=1).ravel().astype(np.int64)
        return pyvista.PolyData(points.astype(float), faces)

    def _drops_pyvista(self, pyvista):
        drops = self.drops
        if not drops:
            raise ValueError("this snapshot has no drops")
        points = drops["coordinates"].astype(float)
        if "face" in drops:
            lines = pyvista.PolyData(points, np.insert(drops["face"][:, [0, 4, 1, 5, 2, 6, 3, 7]], 0, 8, axis=1).ravel().astype(np.int64))
        else:
            edges = drops["edge"][:, [0, 2, 1]]  # end, middle, end
            lines = pyvista.PolyData(points, lines=np.insert(edges, 0, 3, axis=1).ravel().astype(np.int64))
        for name in ("drop", "group", "curve"):
            lines.cell_data[name] = drops[name]
        return lines

    def _bonds_pyvista(self, pyvista):
        if not self.bonds:
            raise ValueError("this snapshot has no bonds")
        lines = pyvista.PolyData(self.bonds["end"].astype(float), lines=np.insert(self.bonds["line"], 0, 2, axis=1).ravel().astype(np.int64))
        for name, values in self.bonds.items():
            if name not in ("end", "line"):
                lines.cell_data[name] = np.ravel(values)
        return lines

    def sample(self, name: str | np.ndarray, places) -> np.ndarray:
        """A field of points, by name or as an array, at places [n][2 or 3], by the polynomials of the cells (second order in each direction); nan outside of the mesh."""
        places = np.atleast_2d(np.asarray(places, float))[:, : self.dim]
        values = self[name] if isinstance(name, str) else name
        if len(values) != len(self.points):
            raise ValueError(f"'{name}' belongs to cells, not to points: sample one of the others")
        if self._search is None:
            self._search = Search(self.points[:, : self.dim], self.cells)
        result = np.full((len(places), *values.shape[1:]), np.nan)
        for first in range(0, len(places), 5000):  # memory
            cell, weight = self._search.find(places[first : first + 5000])
            there = cell >= 0
            result[first : first + 5000][there] = np.einsum("nk,nk...->n...", weight[there], values[self.cells[cell[there]]].astype(float))
        return result
