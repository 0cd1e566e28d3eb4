"""Figures of tools that draw in the process of a test: judged by what is at a place of their axes, not by the bytes of a file."""
import contextlib
import functools
from pathlib import Path

import matplotlib.colors
import matplotlib.figure
import numpy as np


class Drawn:
    """A figure, drawn when its pixels are asked for: these by places of its axes, words."""

    def __init__(self, figure):
        self.figure, self.axes = figure, list(figure.axes)
        self.words = [text for axes in self.axes for text in (axes.get_xlabel(), axes.get_ylabel(), axes.get_title())]
        self.words += [figure._suptitle.get_text()] if figure._suptitle else []

    @functools.cached_property
    def pixels(self):
        self.figure.canvas.draw()
        return np.asarray(self.figure.canvas.buffer_rgba())[..., :3] / 255

    def covered(self):
        """How many points of curves lie under a legend?"""
        assert len(self.pixels)
        boxes = [axes.get_legend().get_window_extent() for axes in self.axes if axes.get_legend()]
        lines = [axes.transData.transform(line.get_xydata()) for axes in self.axes for line in axes.lines if len(line.get_xydata())]
        return sum(box.contains(x, y) for box in boxes for points in lines for x, y in points)

    def around(self, x, y, size=1, axes=0):
        """Pixels around a place, [2 size + 1, 2 size + 1, 3]."""
        rows = self.pixels.shape[0]
        column, row = self.axes[axes].transData.transform((x, y))
        column, row = int(column), rows - 1 - int(row)
        return self.pixels[row - size : row + size + 1, column - size : column + size + 1]

    def at(self, x, y, axes=0):
        return self.around(x, y, 1, axes).mean((0, 1))


@contextlib.contextmanager
def keep_figures():
    """{name of the file: Drawn} of what is saved meanwhile; nothing is written."""
    old, seen = matplotlib.figure.Figure.savefig, {}
    matplotlib.figure.Figure.savefig = lambda self, path, **_: seen.update({Path(path).name: Drawn(self)})
    try:
        yield seen
    finally:
        matplotlib.figure.Figure.savefig = old


def assert_has_colour(pixels, colour, what):
    """Is it that of one of the pixels?"""
    off = np.abs(pixels - np.array(matplotlib.colors.to_rgb(colour))).max(-1).min()
    assert off < 0.06, f"{what}: no {colour}, {off:.2f} off"
