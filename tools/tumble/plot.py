"""Draw the results of a run: tools/plot out/sedimentation

Reads an output directory (whatever is there, also while the run goes on) and writes into it:

  trajectory.png        what the bodies do against time: fall speed and height, without gravity speed and place; the angle of hinged ones;
                        drag and lift of those that are held or led. With published points if runs/reference/<scene>.csv exists
  <y>-<x>.png           with --curve y/x: columns of bodies.csv against each other (--curve angle: against time), with the reference's points of that column
  history.png           energy, outer iterations, divergence and momentum balance against time
  field_<step>.png      speed of the fluid with the outlines of bodies, elastic particles and drops (aggregates in colours, bonds red under pull;
                        field_<step>_vorticity.png and so on for other fields); of a run in
                        space on a plane through its largest body, or as --slice x=0.5 says
  surface_<step>.png    in space: the bodies' surfaces behind the plane (needs VTK: pip install vtk; Debian's python3-vtk9 without a screen needs xvfb)
"""
import argparse
import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import h5py  # noqa: F401  (asked for here: the reader needs it for snapshots only)
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patheffects import withStroke
from matplotlib.tri import Triangulation

from . import draw
from .reader import Run, read_table, tell_renamed

PACKAGES = Path(__file__).resolve().parents[1]
REFERENCE = PACKAGES.parent / "runs" / "reference"
MANY_BODIES = 12  # in trajectory.png
MARKERS = "osD^v"

STYLE = {
    "figure.dpi": 110,
    "savefig.dpi": 160,
    "font.size": 10,
    "axes.titlesize": 11,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "0.9",
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "lines.linewidth": 1.8,
    "legend.edgecolor": "none",
    "legend.framealpha": 0.85,
    "figure.constrained_layout.use": True,
}


class PlotError(Exception):
    """Something the user can put right."""


def need_columns(table, names, path):
    missing = [name for name in names if name not in table]
    if missing:
        raise PlotError(f"{path} has no column {', '.join(missing)} (it has: {', '.join(table)}){''.join(map(tell_renamed, missing))}")


class Picture:
    """A run, and what its pictures are labelled with."""

    def __init__(self, directory, units, say=print):
        """say: called with the path of each picture"""
        self.run, self.say, self.paths = Run(directory), say, []
        self.dir = self.run.directory
        try:
            self.scene = self.run.summary.get("scene", self.dir.resolve().name)
        except ValueError as error:
            raise PlotError(f"{self.dir / 'summary.json'}: {error}") from error
        self.unit = draw.Units(self.run, units)

    def save(self, figure, name, **options):
        figure.savefig(self.dir / name, **options)
        plt.close(figure)
        self.note(self.dir / name)

    def note(self, path):
        self.paths.append(path)
        self.say(path)


# ---- field_<step>.png ----


def fit_figure(lower, upper):
    """Figure size (inches) for a domain, its labels and its colour bar."""
    width, height = upper - lower
    scale = min(9.0 / width, 7.0 / height)
    return max(3.6, width * scale + 1.9), max(2.4, height * scale + 1.0)


def place_bar(lower, upper):
    """Along the longer side of the picture."""
    width, height = upper - lower
    if width > 1.5 * height:
        return {"location": "bottom", "aspect": 30, "shrink": 0.6, "anchor": (0.5, 1.0)}
    return {"location": "right", "aspect": 35, "shrink": 0.7}


def halo(colour):
    """Outlines are to be seen on every colour of the map."""
    return [withStroke(linewidth=2.4, foreground="black" if colour == "white" else "white")]


def draw_paths(axes, run, time, colour):
    """Where bodies have come from."""
    ways = draw.paths(run, time, draw.split_names(run.options.get("mesh_periodic", "")), MANY_BODIES)
    axes.add_collection(LineCollection(ways, colors=colour, linewidth=0.9, linestyle=(0, (4, 3)), alpha=0.8))


def draw_bodies(axes, run, shot, outlines):
    """Bodies filled by their groups or aggregates, discs with a spoke that shows how far they have turned."""
    thin = 0.8 if len(outlines) <= MANY_BODIES else 0.4
    tints = draw.body_tints(run, shot, [int(number) for number, *_ in outlines])
    axes.add_collection(PolyCollection([line for _, line, _ in outlines], facecolor=tints, edgecolor="black", linewidth=thin))
    axes.add_collection(LineCollection([(centre, line[0]) for _, line, centre in outlines if centre is not None], colors="black", linewidth=thin))


def draw_drops(axes, run, shot, colour):
    """The interface of drops, outlines of elastic particles."""
    axes.add_collection(LineCollection(draw.find_drops(run, shot) + draw.find_solids(run, shot), colors=colour, linewidths=1.2, path_effects=halo(colour)))


def draw_bonds(axes, run, shot):
    """Bonds of a plane run, red under pull, blue under pressure."""
    lines, tension = draw.find_bonds(run, shot)
    if len(lines):
        most = np.percentile(np.abs(tension), 98) or 1
        axes.add_collection(LineCollection(lines[:, :, :2], array=tension, cmap="coolwarm", clim=(-most, most), linewidths=1.5))


def draw_inside(axes, place, inside, colour):
    """The border of what lies inside bodies, by the field `body`: of bodies without an outline."""
    if (inside > 0.5).any():
        contour = (axes.tricontour if isinstance(place[0], Triangulation) else axes.contour)(*place, inside, levels=[0.5], colors=colour, linewidths=1.2)
        plt.setp(contour.collections if hasattr(contour, "collections") else contour, path_effects=halo(colour))


def find_inside(shot, drawn):
    """1.0 at points inside bodies that have not been drawn."""
    body = shot["body"] if "body" in shot.names else np.full(len(shot.points), -1)
    return ((body >= 0) & ~np.isin(body, list(drawn))).astype(float)


def finish_field(picture, shot, figure, axes, image, field, box, names):
    kind, _, symmetric = draw.look_of(field)
    lower, upper = box
    axes.set_aspect("equal")
    axes.set_xlim(lower[0], upper[0])
    axes.set_ylim(lower[1], upper[1])
    axes.grid(False)
    axes.spines[["top", "right"]].set_visible(True)
    axes.set_xlabel(f"{names[0]}{picture.unit('length')}")
    axes.set_ylabel(f"{names[1]}{picture.unit('length')}")
    plane = f", {names[2]}" if len(names) > 2 else ""
    axes.set_title(f"{picture.scene}\n{picture.unit.moment(shot.time)}{plane}")
    bar = figure.colorbar(image, ax=axes, label=f"{field}{picture.unit(kind)}", extend="both" if symmetric else "neither", pad=0.03, **place_bar(*box))
    bar.outline.set_visible(False)


def draw_field(picture, shot, field, cells):
    """A plane run, and its cells if they are wanted."""
    _, colours, symmetric = draw.look_of(field)
    values, box = draw.scalars(shot, field), draw.find_box(shot)
    low, high = draw.colour_range(draw.seen(shot, field, values), symmetric)
    mesh = Triangulation(*shot.points[:, :2].T, draw.split_cells(shot.cells))
    figure, axes = plt.subplots(figsize=fit_figure(*box))
    image = axes.tripcolor(mesh, values, shading="gouraud", cmap=colours, vmin=low, vmax=high, rasterized=True)
    colour = "black" if symmetric else "white"
    if cells:
        axes.add_collection(LineCollection(draw.cell_edges(shot), colors=colour, linewidths=0.25, alpha=0.6))
    outlines = draw.plane_bodies(picture.run, shot)
    if len(outlines) <= MANY_BODIES:
        draw_paths(axes, picture.run, shot.time, colour)
    draw_bodies(axes, picture.run, shot, outlines)
    draw_drops(axes, picture.run, shot, colour)
    draw_bonds(axes, picture.run, shot)
    draw_inside(axes, (mesh,), find_inside(shot, {number for number, *_ in outlines}), colour)
    finish_field(picture, shot, figure, axes, image, field, box, "xy")
    name = f"field_{shot.step}.png" if field == "speed" else f"field_{shot.step}_{field}.png"
    picture.save(figure, name, bbox_inches="tight", pad_inches=0.12)


def draw_slice(picture, shot, field, plane, name):
    """A plane through a run in space."""
    _, colours, symmetric = draw.look_of(field)
    cut = draw.Slice(shot, field, *plane)
    low, high = draw.colour_range(cut.seen, symmetric)
    figure, axes = plt.subplots(figsize=fit_figure(cut.lower, cut.upper))
    image = axes.pcolormesh(cut.x, cut.y, cut.values, shading="gouraud", cmap=colours, vmin=low, vmax=high, rasterized=True)
    colour = "black" if symmetric else "white"
    bodies = cut.cut_bodies(picture.run, shot)
    for number, line in bodies:
        if number is None:
            axes.add_collection(LineCollection(line, colors=colour, linewidth=1.2, path_effects=halo(colour)))
    draw_bodies(axes, picture.run, shot, [(number, line, None) for number, line in bodies if number is not None])
    axes.add_collection(LineCollection(cut.cut_material(shot), colors=colour, linewidths=1.2, path_effects=halo(colour)))
    if None not in [number for number, _ in bodies]:
        drawn = {number for number, *_ in draw.spheres(picture.run, shot)}
        draw_inside(axes, (cut.x, cut.y), cut.sample(shot, find_inside(shot, drawn)), colour)
    names = [*(draw.AXES[a] for a in cut.across), f"{draw.AXES[cut.axis]} = {cut.value:.4g}"]
    finish_field(picture, shot, figure, axes, image, field, (cut.lower, cut.upper), names)
    picture.save(figure, name, bbox_inches="tight", pad_inches=0.12)


def draw_space(picture, shot, options):
    planes = [(draw.read_plane(text), "_" + text.replace("=", "")) for text in options.slice or []] or [(draw.choose_plane(picture.run, shot, options.body), "")]
    for plane, ending in planes:
        for field in options.field or ["speed"]:
            draw_slice(picture, shot, field, plane, f"field_{shot.step}{ending}{'' if field == 'speed' else '_' + field}.png")
    if not options.no_surface:
        draw_surface(picture, shot, planes[0][0], options.units)


def draw_surface(picture, shot, plane, units):
    """By VTK in a process of its own: without a screen Debian's, unlike pip's, ends the process, and needs xvfb-run."""
    path = picture.dir / f"surface_{shot.step}.png"
    words = [sys.executable, "-m", "tumble.surface", picture.dir.resolve(), shot.step, *plane, path.resolve(), *([units] if units else [])]
    screens = [[]] if os.environ.get("DISPLAY") or not shutil.which("xvfb-run") else [[], ["xvfb-run", "-a"]]
    for screen in screens:
        done = subprocess.run([*screen, *map(str, words)], cwd=PACKAGES, capture_output=True, text=True, check=False)
        if done.returncode == 0:
            picture.note(path)
            return
    print("no picture of the surfaces: it needs VTK (pip install vtk, which needs no screen; Debian: python3-vtk9 and a screen, or xvfb and xauth)", file=sys.stderr)


# ---- trajectory.png ----


def read_reference(scene):
    """{quantity: rows} of runs/reference/<scene>.csv, rows being (source, time, value, tolerance)."""
    path = REFERENCE / f"{scene}.csv"
    table = read_table(path)
    if not table:
        return {}
    columns = ["source", "quantity", "time", "value", "tolerance"]
    need_columns(table, columns, path)
    reference = {}
    for source, quantity, *numbers in zip(*(table[name] for name in columns)):
        reference.setdefault(quantity, []).append((source, *numbers))
    return reference


def draw_points(axes, rows):
    """One kind of marker for each source, in front of the lines."""
    look = {"markersize": 6, "markerfacecolor": "white", "markeredgecolor": "C3", "markeredgewidth": 1.4, "zorder": 5}
    for marker, source in zip(MARKERS, dict.fromkeys(row[0] for row in rows)):
        points = np.array([row[1:] for row in rows if row[0] == source])
        axes.plot(points[:, 0], points[:, 1], marker, label=source, **look)


def draw_bands(speed, height, reference):
    for source, _, value, tolerance in reference.get("fall_speed_max", []):
        speed.axhspan(value - tolerance, value + tolerance, color="C3", alpha=0.15, linewidth=0, label=f"{source} {value:g} ± {tolerance:g}")
    for source, _, value, tolerance in reference.get("impact_time", []):
        for axes in (speed, height):
            axes.axvspan(value - tolerance, value + tolerance, color="0.5", alpha=0.3, linewidth=0, label=f"{source} {value:g} ± {tolerance:g}")


def body_label(group, number, nbodies):
    return f"{group}" if nbodies == 1 else f"{group} {int(number)}"


def unbroken(values):
    """A gap where a body leaves through a periodic boundary and comes in again."""
    jumps = np.flatnonzero(abs(np.diff(values)) > 0.5 * np.ptp(values)) + 1 if len(values) > 20 else []
    return np.insert(values, jumps, np.nan), jumps


class Curve:
    """A quantity of one body against time; what: columns of its rows -> values."""

    def __init__(self, label, what, reference=(), wraps=False):
        self.label, self.what, self.reference, self.wraps = label, what, reference, wraps

    def draw(self, axes, rows, name):
        values = self.what(rows)
        values, jumps = unbroken(values) if self.wraps else (values, [])
        axes.plot(np.insert(rows["time"], jumps, np.nan), values, label=name)


def motion_kind(options, rows):
    """'hinged', 'held' (at rest or led on a prescribed way: the force is the result) or 'free'."""
    prefix = f"particle_{rows['group'][0]}_"
    if f"{prefix}pivot" in options:
        return "hinged"
    if f"{prefix}motion" in options or options.get(f"{prefix}free") == "none":
        return "held"
    moved = any(np.ptp(rows[name]) > 0 for name in ("x", "y", "z", "angle") if name in rows)
    return "free" if moved or len(rows) == 1 else "held"


def choose_curves(picture, kind, names, reference):
    """What matters of bodies of one kind, two curves."""
    unit, down = picture.unit, draw.gravity(picture.run)

    def along(columns, direction):
        return lambda rows: sum(direction[a] * rows[name] for a, name in enumerate(columns) if direction[a] and name in rows)

    if kind == "hinged":
        return Curve("angle [rad]", lambda rows: rows["angle"], reference.get("angle", [])), Curve(f"angular velocity{unit('rate')}", lambda rows: rows["omega_z"])
    if kind == "held" and len(names) == 1 and {"cd", "cl"} <= set(picture.run.series):
        series = picture.run.series
        return Curve("drag coefficient", lambda _: series["cd"], reference.get("cd", [])), Curve("lift coefficient", lambda _: series["cl"], reference.get("cl", []))
    if kind == "held":
        return Curve(f"force along x (drag){unit('force')}", lambda rows: rows["force_x"]), Curve(f"force along y (lift){unit('force')}", lambda rows: rows["force_y"])
    if down.any():
        return Curve(f"fall speed{unit('speed')}", along("uvw", down), reference.get("fall_speed", [])), Curve(f"height of the centre{unit('length')}", along("xyz", -down), reference.get("height", []), True)
    speed = Curve(f"speed{unit('speed')}", lambda rows: np.sqrt(sum(rows[name] ** 2 for name in "uvw" if name in rows)))
    return speed, Curve(f"y of the centre{unit('length')}", lambda rows: rows["y"], reference.get("y", []), True)


def choose_bodies(picture, table):
    """{kind: numbers}, {number: rows} of at most MANY_BODIES bodies: some of every group, those that are free first."""
    groups, first, kinds = {}, {}, {}
    for number, group in dict(zip(table["body"], table["group"])).items():
        groups.setdefault(group, []).append(number)
    for group, numbers in groups.items():
        first[group] = motion_kind(picture.run.options, table.where(table["body"] == numbers[0]))
    order = sorted(groups, key=lambda group: first[group] != "free")
    chosen, turn = [], 0
    while len(chosen) < MANY_BODIES and turn < max(map(len, groups.values())):
        chosen += [groups[group][turn] for group in order if turn < len(groups[group])]
        turn += 1
    bodies = {number: table.where(table["body"] == number) for number in sorted(chosen[:MANY_BODIES])}
    for number, rows in bodies.items():
        kinds.setdefault(motion_kind(picture.run.options, rows), []).append(number)
    return {kind: kinds[kind] for kind in sorted(kinds, key=lambda kind: kind != "free")}, bodies


def name_curves(pair, count):
    """One legend on the right of both panels, away from the curves."""
    handles = {label: handle for axes in pair for handle, label in zip(*axes.get_legend_handles_labels())}
    if count > 1 or len(handles) > 1:
        pair[1].legend(handles.values(), handles.keys(), loc="upper left", bbox_to_anchor=(1.01, 1), borderaxespad=0)


def draw_trajectory(picture):
    table = picture.run.bodies
    need_columns(table, ["time", "body", "group", "y", "v"], picture.dir / "bodies.csv")
    if len(np.unique(table["time"])) < 2:  # a steady state has no curves
        return
    kinds, bodies = choose_bodies(picture, table)
    count = len(np.unique(table["body"]))
    reference = read_reference(picture.scene)
    figure, panels = plt.subplots(len(kinds), 2, figsize=(11, 3.6 * len(kinds) + 0.6), sharex=True, squeeze=False)
    for pair, (kind, names) in zip(panels, kinds.items()):
        curves = choose_curves(picture, kind, names, reference)
        if kind == "free":
            draw_bands(*pair, reference)
        for axes, curve in zip(pair, curves):
            for number in names:
                curve.draw(axes, bodies[number], body_label(bodies[number]["group"][0], number, count))
            draw_points(axes, curve.reference)
            axes.set_ylabel(curve.label)
            axes.set_xlabel(f"time{picture.unit('time')}")
            axes.margins(x=0.02)
        name_curves(pair, count)
    shown = f" ({MANY_BODIES} of {count} bodies)" if count > MANY_BODIES else ""
    title = {("held",): "forces on the bodies"}.get(tuple(kinds), "motion of the bodies")
    figure.suptitle(f"{picture.scene}: {title}{shown}")
    picture.save(figure, "trajectory.png")


# ---- curves ----


def draw_curve(picture, what):
    """A column of bodies.csv against another one, a line a body."""
    name, across = (what.split("/") + ["time"])[:2]
    table = picture.run.bodies
    need_columns(table, ["body", "group", name, across], picture.dir / "bodies.csv")
    numbers = np.unique(table["body"])
    figure, axes = plt.subplots(figsize=(7.2, 4.2))
    for number in numbers[:MANY_BODIES]:
        rows = table.where(table["body"] == number)
        axes.plot(rows[across], rows[name], label=body_label(rows["group"][0], number, len(numbers)))
    if across == "time":
        draw_points(axes, read_reference(picture.scene).get(name, []))
    axes.set_xlabel(f"time{picture.unit('time')}" if across == "time" else across)
    axes.set_ylabel(name)
    axes.legend()
    axes.set_title(picture.scene)
    picture.save(figure, f"{name}-{across}.png")


# ---- history.png ----


# columns, label, logarithmic
HISTORY = [
    ({"kinetic_energy": "fluid", "bodies_energy": "bodies"}, "kinetic energy", False),
    ({"outer_iterations": ""}, "outer iterations", False),
    ({"divergence": ""}, "divergence", True),
    ({"momentum_error": ""}, "momentum error", True),
]


def draw_panel(axes, table, columns, logarithmic, colour):
    for shade, (name, label) in enumerate(columns.items()):
        values = np.abs(table[name]) if logarithmic else table[name]
        look = {"drawstyle": "steps-mid"} if name == "outer_iterations" else {}
        axes.plot(table["time"], values, color=colour, alpha=1 - 0.5 * shade, linewidth=1.3, label=label, **look)
    if logarithmic and (values > 0).any():
        axes.set_yscale("log")
    else:
        axes.set_ylim(bottom=0)
    if len(columns) > 1:
        axes.legend()
    axes.margins(x=0.02)


def draw_history(picture):
    """Panels for those columns that there are."""
    table = picture.run.series
    need_columns(table, ["time"], picture.dir / "series.csv")
    if len(table) < 2:
        return
    panels = [({name: word for name, word in columns.items() if name in table and (not word or np.any(table[name]))}, *rest) for columns, *rest in HISTORY]
    panels = [panel for panel in panels if panel[0]]
    if not panels:
        raise PlotError(f"{picture.dir / 'series.csv'} has none of the columns {', '.join(name for columns, *_ in HISTORY for name in columns)}")
    figure, rows = plt.subplots(len(panels), 1, figsize=(7.5, 1.9 * len(panels) + 0.6), sharex=True, squeeze=False)
    for number, (axes, (columns, label, logarithmic)) in enumerate(zip(rows[:, 0], panels)):
        draw_panel(axes, table, columns, logarithmic, f"C{number}")
        axes.set_ylabel(label + (picture.unit("energy") if "energy" in label else ""))
    rows[-1, 0].set_xlabel(f"time{picture.unit('time')}")
    figure.align_ylabels()
    figure.suptitle(f"{picture.scene}: energy and solver")
    picture.save(figure, "history.png")


# ---- command line ----


def make_parser():
    parser = argparse.ArgumentParser(prog="plot", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("directory", help="output directory of a run")
    parser.add_argument("--step", type=int, help="snapshot to draw (default: the last one, or where the fluid had come to rest by then, that of its largest kinetic energy)")
    parser.add_argument("--field", action="append", metavar="NAME", help="speed, vorticity, pressure, or the name of a scalar; may be repeated (default: speed)")
    parser.add_argument("--cells", action="store_true", help="draw the cells of the mesh, too, of a plane run")
    parser.add_argument("--slice", action="append", metavar="AXIS=VALUE", help="plane to draw of a run in space, may be repeated (default: through the largest body)")
    parser.add_argument("--body", type=int, metavar="N", help="the body that the plane goes through (default: the largest one)")
    parser.add_argument("--no-surface", action="store_true", help="leave out surface_<step>.png of a run in space")
    parser.add_argument("--curve", action="append", metavar="Y[/X]", default=[], help="columns of bodies.csv to draw against each other, may be repeated (X: default time)")
    parser.add_argument("--units", choices=draw.UNITS, help="units of the scene, for the labels (default: those that the scene states)")
    return parser


def plot_run(options, say=print):
    """The pictures that the options of the command line ask for; returns their paths."""
    picture = Picture(options.directory, options.units, say)
    with plt.rc_context(STYLE):
        draw_pictures(picture, options)
    return picture.paths


def draw_pictures(picture, options):
    run = picture.run
    if len(run.bodies):
        draw_trajectory(picture)
    for what in options.curve:
        draw_curve(picture, what)
    if len(run.series):
        draw_history(picture)
    for field in options.field or []:
        draw.check_field(run, field)
    if run.steps or options.step is not None:
        shot = run.snapshot(step=draw.liveliest(run) if options.step is None else options.step)
        if options.slice and shot.dim == 2:
            raise PlotError("--slice is for runs in space: this one is plane")
        if options.cells and not (shot.has_mesh and shot.dim == 2):
            raise PlotError("--cells is for the meshes of plane runs: remove it")
        if shot.has_mesh and shot.dim == 3:
            draw_space(picture, shot, options)
        for field in (options.field or ["speed"]) if shot.has_mesh and shot.dim == 2 else []:
            draw_field(picture, shot, field, options.cells)


def main():
    matplotlib.use("Agg")
    try:
        plot_run(make_parser().parse_args())
    except (PlotError, OSError, ValueError, KeyError, ElementTree.ParseError) as error:
        sys.exit(f"plot: {error.args[0] if isinstance(error, KeyError) else error}")


if __name__ == "__main__":
    main()
