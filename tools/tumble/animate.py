"""Make an animation of a run: tools/animate out/dkt

Draws the snapshots of a run (fields_<step>.h5 and bodies_<step>.h5 of its output directory, as named by fields.xdmf and bodies.xdmf) and writes
them as an mp4 with ffmpeg, or where that is missing as a GIF: the fluid's speed with the outlines of bodies and drops, or the bodies alone, coloured
by their speed, if there are no fields. Of a run in space a plane through its largest body is shown (--slice x=0.5: another one), without flow
all spheres from ahead. Where bonds hold bodies together each aggregate has a colour, and bonds are lines: red under pull, blue under pressure.

  tools/animate out/dkt --field vorticity --fps 10 --width 600
  tools/animate out/sedimentation-504 --frame 40 --output picture.png     one picture, of the snapshot at step 40
"""
import argparse
import shutil
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import h5py  # noqa: F401  (asked for here: the reader needs it for snapshots only)
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.tri import Triangulation

from . import draw
from .plot import draw_drops
from .reader import Run

DPI = 100
TITLE, BAR, EDGE = 30, 78, 6  # pixels of the line above, of the colour bar on the right, of the margin
MANY = 100  # bodies, beyond which lines are thin and turning is not shown


class AnimateError(Exception):
    """Something the user can put right."""


class Film:
    """The snapshots of a run and what they have in common: box, mesh, range of colours."""

    def __init__(self, options):
        self.run = run = Run(options.directory)
        self.field, self.unit, self.cells = options.field, draw.Units(run, options.units), options.cells
        self.steps = run.steps
        if not self.steps:
            raise AnimateError(f"directory '{options.directory}' holds no snapshots: run the scene with -output_every N")
        last = run.snapshot()
        self.has_fields, self.space = last.has_mesh, last.dim == 3
        if self.space and not self.has_fields and not draw.spheres(run, last):
            raise AnimateError(f"{options.directory} is a 3D run without flow whose bodies are no spheres: open bodies.xdmf in ParaView")
        self.view = 1 if draw.gravity(run)[2] else 2  # axis that spheres without a flow are seen along
        if options.slice and not self.space:
            raise AnimateError("--slice is for runs in space: this one is plane")
        if options.cells and (self.space or not self.has_fields):
            raise AnimateError("--cells is for the meshes of plane runs: remove it")
        self.plane = (draw.read_plane(options.slice) if options.slice else draw.choose_plane(run, last)) if self.space and self.has_fields else None
        self.box = self.find_box(last)
        self.range = self.find_range()
        self.pull = self.find_pull()

    def find_box(self, last):
        """Lower and upper corner of the picture."""
        if self.space and self.has_fields:
            cut = draw.Slice(last, self.field, *self.plane)
            return cut.lower, cut.upper
        if self.space:
            balls = [ball for step in self.steps for ball in draw.spheres(self.run, self.run.snapshot(step=step))]
            centre, radius = np.delete([x for _, x, _ in balls], self.view, 1), np.array([[r] for *_, r in balls])
            return (centre - radius).min(0), (centre + radius).max(0)
        if self.has_fields:
            return draw.find_box(last)
        lines = [line for shot in (self.run.snapshot(step=self.steps[0]), last) for _, line, _ in draw.find_outlines(shot)]
        return np.min([line.min(0) for line in lines], 0), np.max([line.max(0) for line in lines], 0)

    def values(self, shot):
        """What is coloured: at the points, on a plane, or of the bodies."""
        if self.space and self.has_fields:
            return draw.Slice(shot, self.field, *self.plane).values.ravel()
        return draw.scalars(shot, self.field) if self.has_fields else np.linalg.norm(shot.bodies["velocity"].reshape(-1, 3), axis=1)

    def seen(self, shot):
        """What of it the range of colours goes by."""
        if self.space and self.has_fields:
            return draw.Slice(shot, self.field, *self.plane).seen.ravel()
        return draw.seen(shot, self.field, self.values(shot)) if self.has_fields else self.values(shot)

    def find_range(self):
        """The same colours in all frames, from some of them."""
        chosen = self.steps[:: max(1, len(self.steps) // 10)] + self.steps[-1:]
        values = np.concatenate([self.seen(self.run.snapshot(step=step)) for step in chosen])
        symmetric = self.has_fields and draw.look_of(self.field)[2]
        low, high = np.nanpercentile(values, [0.5, 99.5])
        high = max(abs(low), abs(high)) if symmetric else high
        low = -high if symmetric else low
        return (low, high) if high > low else (low - 1, low + 1)

    def find_pull(self):
        """The largest load of bonds that colours show, the same in all frames."""
        loads = [np.abs(draw.find_bonds(self.run, self.run.snapshot(step=step))[1]) for step in self.steps[:: max(1, len(self.steps) // 10)]]
        loads = np.concatenate(loads)
        return np.percentile(loads, 98) or 1.0 if len(loads) else 1.0


# ---- drawing ----


def draw_bonds(film, axes, shot):
    """Lines from centre to centre: the more pull, the redder."""
    lines, tension = draw.find_bonds(film.run, shot)
    if len(lines):
        axes.add_collection(LineCollection(lines[:, :, :2], array=tension, cmap="coolwarm", clim=(-film.pull, film.pull), linewidths=2 if len(lines) < MANY else 1))


def draw_plane(film, axes, shot, look):
    """A plane run: its field, its bodies."""
    image = None
    if film.has_fields:
        mesh = Triangulation(*shot.points[:, :2].T, draw.split_cells(shot.cells))
        image = axes.tripcolor(mesh, film.values(shot), shading="gouraud", **look)
        if film.cells:
            axes.add_collection(LineCollection(draw.cell_edges(shot), colors="black", linewidths=0.25, alpha=0.6))
        draw_drops(axes, film.run, shot, "black" if draw.look_of(film.field)[2] else "white")
    bodies = draw.plane_bodies(film.run, shot)
    thin = 0.9 if len(bodies) < MANY else 0.3
    lines = [line for _, line, _ in bodies]
    if film.has_fields or "aggregate" in shot.bodies:
        axes.add_collection(PolyCollection(lines, facecolors=draw.body_tints(film.run, shot, [int(number) for number, *_ in bodies]), edgecolors="black", linewidths=thin))
    else:
        speeds = film.values(shot)[[number for number, *_ in bodies]]
        image = axes.add_collection(PolyCollection(lines, array=speeds, cmap=look["cmap"], clim=film.range, edgecolors="black", linewidths=thin))
    if len(bodies) < MANY:  # from the centre to the first point, to show the turning
        spokes = [(line.mean(0) if centre is None else centre, line[0]) for _, line, centre in bodies]
        axes.add_collection(LineCollection(spokes, colors="black", linewidths=thin))
    draw_bonds(film, axes, shot)
    return image


def draw_space(film, axes, shot, look):
    """A plane through a run in space."""
    cut = draw.Slice(shot, film.field, *film.plane)
    image = axes.pcolormesh(cut.x, cut.y, cut.values, shading="gouraud", **look)
    for number, line in cut.cut_bodies(film.run, shot):
        if number is None:
            axes.add_collection(LineCollection(line, colors="black", linewidths=0.9))
        else:
            tint = draw.body_tints(film.run, shot, [number]) if "aggregate" in shot.bodies else "0.93"
            axes.add_collection(PolyCollection([line], facecolors=tint, edgecolors="black", linewidths=0.9))
    return image


def draw_spheres(film, axes, shot, look):
    """Spheres without a flow, the nearest last: by aggregate, or by speed."""
    balls = sorted(draw.spheres(film.run, shot), key=lambda ball: ball[1][film.view])
    circles = [np.delete(x, film.view) + r * np.stack([np.cos(draw.ROUND), np.sin(draw.ROUND)], 1) for _, x, r in balls]
    speed = film.values(shot)
    bodies = PolyCollection(circles, array=speed[[number for number, *_ in balls]], cmap=look["cmap"], clim=film.range, edgecolors="black", linewidths=0.4)
    if "aggregate" in shot.bodies:
        bodies = PolyCollection(circles, facecolors=draw.body_tints(film.run, shot, [number for number, *_ in balls]), edgecolors="black", linewidths=0.4)
    return axes.add_collection(bodies)


def frame_size(film, width):
    """Pixels of the picture inside the frame, and of the frame: even numbers, as the encoder asks for."""
    across, up = film.box[1] - film.box[0]
    inner = width - BAR - 2 * EDGE
    height = max(80, round(inner * up / across))
    if height > 2 * width:  # a tall domain is no wider than can be looked at
        height = 2 * width
        inner = round(height * across / up)
    total = np.array([inner + BAR + 2 * EDGE, height + TITLE + EDGE])
    return inner, height, total + total % 2


def draw_frame(film, step, figure, width):
    inner, height, (wide, high) = frame_size(film, width)
    figure.clear()
    axes = figure.add_axes([EDGE / wide, EDGE / high, inner / wide, height / high])
    shot = film.run.snapshot(step=step)
    look = {"cmap": draw.look_of(film.field)[1], "vmin": film.range[0], "vmax": film.range[1]}
    image = (draw_plane if not film.space else draw_space if film.has_fields else draw_spheres)(film, axes, shot, look)
    axes.set_xlim(film.box[0][0], film.box[1][0])
    axes.set_ylim(film.box[0][1], film.box[1][1])
    axes.axis("off")
    aggregates = not film.has_fields and "aggregate" in shot.bodies
    field = film.field if film.has_fields else "speed"
    label = "aggregates" if aggregates else f"{field}{film.unit(draw.look_of(field)[0])}"
    figure.text(0.5, 1 - TITLE / 2 / high, f"{film.run.directory.resolve().name}   {film.unit.moment(shot.time)}   {label}", ha="center", va="center", fontsize=9)
    if aggregates:
        return
    tall = min(height, 360)
    bar = figure.colorbar(image, cax=figure.add_axes([(inner + 2 * EDGE) / wide, (EDGE + (height - tall) / 2) / high, 12 / wide, tall / high]))
    bar.ax.tick_params(labelsize=8)
    bar.ax.locator_params(nbins=6)
    bar.outline.set_visible(False)


def new_figure(film, width):
    return plt.figure(figsize=frame_size(film, width)[2] / DPI, dpi=DPI)


def save_picture(film, step, width, path):
    figure = new_figure(film, width)
    draw_frame(film, step, figure, width)
    figure.savefig(path, dpi=DPI)
    print(path)


def save_film(film, width, rate, path):
    """An mp4, or a GIF if the name says so or without ffmpeg."""
    path = Path(path) if path else film.run.directory / ("animation.mp4" if shutil.which("ffmpeg") else "animation.gif")
    gif = path.suffix.lower() == ".gif"
    if not gif and not shutil.which("ffmpeg"):
        raise AnimateError(f"{path} needs ffmpeg, which is not in PATH: install it (Debian: apt-get install ffmpeg), or let --output end in .gif")
    figure = new_figure(film, width)
    writer = PillowWriter(fps=rate) if gif else FFMpegWriter(fps=rate, codec="libx264", extra_args=["-pix_fmt", "yuv420p", "-loglevel", "error"])
    with writer.saving(figure, str(path), DPI):
        for number, step in enumerate(film.steps):
            draw_frame(film, step, figure, width)
            writer.grab_frame()
            if sys.stderr.isatty():  # a line that is written over; in a file it would be a heap
                print(f"\rframe {number + 1} of {len(film.steps)}", end="", file=sys.stderr, flush=True)
    if sys.stderr.isatty():
        print(file=sys.stderr)
    print(path)


# ---- command line ----


def parse_arguments():
    parser = argparse.ArgumentParser(prog="animate", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("directory", help="output directory of a run")
    parser.add_argument("--field", metavar="NAME", default="speed", help="what colours show: speed, vorticity, pressure, or the name of a scalar (default: %(default)s)")
    parser.add_argument("--cells", action="store_true", help="draw the cells of the mesh, too, of a plane run")
    parser.add_argument("--slice", metavar="AXIS=VALUE", help="plane to draw of a run in space (default: through the largest body)")
    parser.add_argument("--fps", type=float, default=24, metavar="N", help="frames a second (default: %(default)s)")
    parser.add_argument("--width", type=int, default=800, metavar="PIXELS", help="of the picture (default: %(default)s)")
    parser.add_argument("--frame", type=int, metavar="STEP", help="draw the snapshot of this step only, as a PNG")
    parser.add_argument("--units", choices=draw.UNITS, help="units of the scene, for the labels (default: those that the scene states)")
    parser.add_argument("--output", metavar="FILE", help="default: animation.mp4 (without ffmpeg .gif), or frame_<step>.png, in the directory")
    return parser.parse_args()


def main():
    matplotlib.use("Agg")
    options = parse_arguments()
    try:
        film = Film(options)
        draw.check_field(film.run, options.field)
        if options.frame is not None:
            save_picture(film, options.frame, options.width, options.output or film.run.directory / f"frame_{options.frame}.png")
        else:
            save_film(film, options.width, options.fps, options.output)
    except (AnimateError, OSError, ValueError, KeyError, ElementTree.ParseError) as error:
        sys.exit(f"animate: {error.args[0] if isinstance(error, KeyError) else error}")


if __name__ == "__main__":
    main()
