"""Surfaces of the bodies and the plane behind them, by VTK: python3 -m tumble.surface DIRECTORY STEP AXIS VALUE FILE.png [UNITS]

A program of its own, started by plot.py: without a screen Debian's VTK ends the process. Spheres from radius; others from the triangles
of bodies_<step>.h5, or where there are none from the field `body` (rough: cells have nine or 27 points).
"""

import sys

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray

from . import draw
from .reader import Run

SIZE = 1000  # pixels of the longer side
BAR = 0.13  # of the width, for the colour bar
MANY = 300  # spheres, beyond which each is coarser
TRIQUADRATIC_HEXAHEDRON = 29


def add_actor(renderer, source, colour=None):
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(source.GetOutputPort()) if hasattr(source, "GetOutputPort") else mapper.SetInputData(source)
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    if colour:
        mapper.ScalarVisibilityOff()
        actor.GetProperty().SetColor(*colour)
        actor.GetProperty().SetSpecular(0.25)
    renderer.AddActor(actor)
    return mapper, actor


def add_box(renderer, lower, upper):
    box = vtk.vtkOutlineSource()
    box.SetBounds(*np.stack([lower, upper], 1).ravel())
    _, actor = add_actor(renderer, box, (0.35, 0.35, 0.35))
    actor.GetProperty().SetLineWidth(2)


def add_spheres(renderer, found):
    ball = vtk.vtkSphereSource()
    fine = 64 if len(found) < MANY else 16
    ball.SetThetaResolution(fine)
    ball.SetPhiResolution(fine)
    ball.Update()
    for _, centre, radius in found:
        _, actor = add_actor(renderer, ball.GetOutput(), (0.9, 0.6, 0.35))
        actor.SetPosition(*centre)
        actor.SetScale(2 * radius)  # the source has radius 0.5


def poly_data(points, cells):
    data, places, polygons = vtk.vtkPolyData(), vtk.vtkPoints(), vtk.vtkCellArray()
    places.SetData(numpy_to_vtk(np.ascontiguousarray(points, float), deep=True))
    polygons.SetCells(len(cells), numpy_to_vtkIdTypeArray(np.insert(cells, 0, cells.shape[1], axis=1).ravel().astype(np.int64), deep=True))
    data.SetPoints(places)
    data.SetPolys(polygons)
    return data


def add_inside(renderer, shot, drawn):
    """Where the field `body` passes from outside to inside."""
    grid, places, cells = vtk.vtkUnstructuredGrid(), vtk.vtkPoints(), vtk.vtkCellArray()
    inside = ((shot["body"] >= 0) & ~np.isin(shot["body"], drawn)).astype(float)
    if not inside.any():
        return
    places.SetData(numpy_to_vtk(shot.points, deep=True))
    cells.SetCells(len(shot.cells), numpy_to_vtkIdTypeArray(np.insert(shot.cells, 0, 27, axis=1).ravel().astype(np.int64), deep=True))
    grid.SetPoints(places)
    grid.SetCells(TRIQUADRATIC_HEXAHEDRON, cells)
    grid.GetPointData().SetScalars(numpy_to_vtk(inside, deep=True))
    contour = vtk.vtkContourFilter()
    contour.SetInputData(grid)
    contour.SetValue(0, 0.5)
    add_actor(renderer, contour, (0.9, 0.6, 0.35))


def colour_table(low, high):
    """Viridis from its corners of matplotlib."""
    import matplotlib

    table = vtk.vtkLookupTable()
    table.SetNumberOfTableValues(256)
    table.SetRange(low, high)
    for i, rgba in enumerate(matplotlib.colormaps["viridis"](np.linspace(0, 1, 256))):
        table.SetTableValue(i, *rgba)
    return table


def add_slice(renderer, cut, units):
    """Returns the renderer of the colour bar."""
    ny, nx = cut.values.shape
    corner = (np.arange(ny - 1)[:, None] * nx + np.arange(nx - 1)).ravel()
    data = poly_data(cut.places.reshape(-1, 3), np.stack([corner, corner + 1, corner + nx + 1, corner + nx], 1))
    data.GetPointData().SetScalars(numpy_to_vtk(np.ascontiguousarray(cut.values.ravel()), deep=True))
    mapper, actor = add_actor(renderer, data)
    table = colour_table(*draw.colour_range(cut.values, False))
    mapper.SetLookupTable(table)
    mapper.UseLookupTableScalarRangeOn()
    actor.GetProperty().LightingOff()
    bar = vtk.vtkScalarBarActor()
    bar.SetLookupTable(table)
    bar.SetTitle(f"speed{units('speed')}\n")
    bar.SetNumberOfLabels(5)
    bar.SetLabelFormat("%.3g")
    bar.UnconstrainedFontSizeOn()
    bar.SetPosition(0.1, 0.25)
    bar.SetWidth(0.6)
    bar.SetHeight(0.5)
    for text in (bar.GetTitleTextProperty(), bar.GetLabelTextProperty()):
        text.SetColor(0.1, 0.1, 0.1)
        text.SetFontSize(18)
        text.ShadowOff()
        text.ItalicOff()
        text.BoldOff()
    beside = vtk.vtkRenderer()
    beside.SetBackground(1, 1, 1)
    beside.SetViewport(1 - BAR, 0, 1, 1)
    beside.AddViewProp(bar)
    return beside


def set_camera(renderer, run, lower, upper, axis):
    """Upright against gravity (else y), looking at the plane's front side from an angle."""
    down, normal = draw.gravity(run), np.eye(3)[axis]
    up = -down if down.any() else np.eye(3)[1 if axis != 1 else 2]
    if abs(normal @ up) > 0.5:  # a plane that lies: from above
        front, side, high = np.cross(up, np.eye(3)[0]), np.eye(3)[0], 0.9
        front = -abs(front)
    else:
        side, high = np.cross(up, normal), 0.35
        front = normal * (np.sign(side.sum()) or 1)
        side = np.cross(up, front)
    camera, centre = renderer.GetActiveCamera(), (lower + upper) / 2
    camera.SetFocalPoint(*centre)
    camera.SetPosition(*(centre + front + 0.6 * side + high * up))
    camera.SetViewUp(*up)
    renderer.ResetCamera()
    camera.Zoom(1 - 1.2 * BAR)  # the camera is set for a square


def add_title(renderer, words):
    text = vtk.vtkTextActor()
    text.SetInput(words)
    text.SetPosition(20, 20)
    text.GetTextProperty().SetColor(0.1, 0.1, 0.1)
    text.GetTextProperty().SetFontSize(22)
    renderer.AddViewProp(text)


def save(renderers, path):
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(8)
    window.SetSize(SIZE, SIZE)
    for renderer in renderers:
        window.AddRenderer(renderer)
    window.Render()
    image = vtk.vtkWindowToImageFilter()
    image.SetInput(window)
    writer = vtk.vtkPNGWriter()
    writer.SetFileName(str(path))
    writer.SetInputConnection(image.GetOutputPort())
    writer.Write()


def main(directory, step, axis, value, path, units=None):
    run = Run(directory)
    shot, units = run.snapshot(step=int(step)), draw.Units(run, units)
    lower, upper = draw.find_box(shot)
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    renderer.SetViewport(0, 0, 1 - BAR, 1)
    add_box(renderer, lower, upper)
    beside = add_slice(renderer, draw.Slice(shot, "speed", int(axis), float(value)), units)
    balls = draw.spheres(run, shot)
    add_spheres(renderer, balls)
    surface = draw.triangles(shot, {number for number, *_ in balls})
    if surface is not None:
        add_actor(renderer, poly_data(*surface), (0.9, 0.6, 0.35))
    elif "body" in shot.names:
        add_inside(renderer, shot, [number for number, *_ in balls])
    add_title(renderer, f"{run.summary.get('scene', run.directory.name)}, {units.moment(shot.time)}")
    set_camera(renderer, run, lower, upper, int(axis))
    save((renderer, beside), path)


if __name__ == "__main__":
    main(*sys.argv[1:])
