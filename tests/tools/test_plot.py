"""tools/plot on a made-up output directory: pictures are judged by what is at a place of the run, errors are said in one line.

All but the first test draw in the process of the tests, which spares each a start of matplotlib, and look at the figures as they are drawn.
"""

import contextlib
import io
import json
import os
import subprocess
import sys
import types
from pathlib import Path

import h5py
import matplotlib.image
import numpy as np
import PIL.Image
import pytest

from drawn import assert_has_colour, keep_figures

PLOT = Path(__file__).resolve().parent.parent.parent / "tools" / "plot"
sys.path.insert(0, str(PLOT.parent))
import tumble.plot  # noqa: E402
from tumble import draw  # noqa: E402

LATTICE_TO_VTK = [0, 2, 8, 6, 1, 5, 7, 3, 4]
RADIUS = 0.125
STEPS = [0, 40, 160]  # snapshots
SERIES = "step,time,dt,cfl,outer_iterations,divergence,kinetic_energy,momentum_error,seconds"
BODIES = (
    "step,time,body,group,x,y,z,angle,u,v,w,omega_x,omega_y,omega_z,"
    "force_x,force_y,force_z,torque_x,torque_y,torque_z,gap,radius"
)


def fall(time):
    """Speed and height of the disc of the made-up run: exponential approach to 5.5 cm/s until it lies on the floor."""
    speed, height = 5.5 * (1 - np.exp(-time / 0.08)), 4 - 5.5 * (time - 0.08 * (1 - np.exp(-time / 0.08)))
    return (speed, height) if height > RADIUS else (0.0, RADIUS)


def write_mesh(path, nx, ny, width, height):
    """Q2 nodes of nx x ny cells, numbered row by row; returns x, y of the nodes."""
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(0, width, 2 * nx + 1), np.linspace(0, height, 2 * ny + 1)))
    corner = (2 * np.arange(ny)[:, None] * (2 * nx + 1) + 2 * np.arange(nx)[None, :]).ravel()
    offset = np.array([(j // 3) * (2 * nx + 1) + j % 3 for j in LATTICE_TO_VTK])
    with h5py.File(path, "w") as file:
        file["coordinates"] = np.stack([x, y, 0 * x], axis=1)
        file["cells"] = corner[:, None] + offset
    return x, y


def write_fields(path, time, x, y):
    """Two counter-rotating vortices beside the disc."""
    speed, height = fall(time)
    dx, dy = x - 1, y - height
    r = np.hypot(dx, dy)
    decay = -speed * np.exp(-np.maximum(r / RADIUS - 1, 0) / 2) * np.sin(np.pi * x / 2)
    with h5py.File(path, "w") as file:
        file["time"] = [time]
        file["velocity"] = np.stack([0.4 * decay * dx * dy / (r**2 + 0.05), decay, 0 * x], axis=1)
        file["vorticity"] = -decay * dx / (r + 0.1) / 0.2
        file["pressure"] = -15 * speed * dy / (r**2 + 0.1)
        file["body"] = np.where(r < RADIUS, 0, -1)


def write_index(path, steps):
    items = "".join(f"<Grid><Attribute><DataItem>fields_{step}.h5:/velocity</DataItem></Attribute></Grid>" for step in steps)
    path.write_text(f"<?xml version='1.0'?><Xdmf><Domain><Grid>{items}</Grid></Domain></Xdmf>")


def write_tables(folder, radius):
    with open(folder / "series.csv", "w") as series, open(folder / "bodies.csv", "w") as bodies:
        print(SERIES, file=series)
        print(BODIES, file=bodies)
        for step in range(1, 181):
            time = 0.005 * step
            speed, height = fall(time)
            print(f"{step},{time},0.005,{speed / 10},{4 + step % 3},{1e-7 * (1 + step % 5)},{speed**2},{-1e-9 * step},0.1", file=series)
            print(f"{step},{time},0,disc,1,{height},0,{time},0,{-speed},0,0,0,1,0,10,0,0,0,0,{height - RADIUS},{radius}", file=bodies)
        print("181,0.9,0.005", file=series)  # a line that a killed job left


@pytest.fixture(name="run_dir")
def make_run_dir(tmp_path):
    return write_run(tmp_path / "sedimentation")


def write_run(folder, radius=RADIUS, cells=(20, 60)):
    folder.mkdir()
    x, y = write_mesh(folder / "mesh.h5", *cells, 2, 6)
    for step in STEPS:
        write_fields(folder / f"fields_{step}.h5", 0.005 * step, x, y)
    write_index(folder / "fields.xdmf", STEPS)
    write_tables(folder, radius)
    (folder / "summary.json").write_text(json.dumps({"scene": "sedimentation", "steps": 180}))
    return folder


def execute(main, *arguments):
    """A tool in this process: exit status and what it printed."""
    out, err, words = io.StringIO(), io.StringIO(), sys.argv
    sys.argv = ["tool", *map(str, arguments)]
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main()
        status = 0
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else 1
        err.write("" if isinstance(end.code, int) else f"{end.code}\n")
    finally:
        sys.argv = words
    return types.SimpleNamespace(returncode=status, stdout=out.getvalue(), stderr=err.getvalue())


def plot(*arguments):
    return execute(tumble.plot.main, *arguments)


def look(folder, *arguments):
    """The pictures that plot draws, by file name; they are not written."""
    with keep_figures() as seen:
        result = execute(tumble.plot.main, folder, *arguments)
    assert result.returncode == 0, result.stderr
    return seen


def colour_of(field, value, low, high):
    """By the colours of the field."""
    return np.array(matplotlib.colormaps[draw.FIELDS[field][1]]((value - low) / (high - low))[:3])


def assert_colour(got, want, what):
    assert np.abs(got - want).max() < 0.06, f"{what}: colour {np.round(got, 2)}, expected {np.round(want, 2)}"


def assert_picture(path):
    """Large enough and not of one colour: more than 2 % of its pixels differ from the background."""
    picture = matplotlib.image.imread(path)[:, :, :3]
    assert min(picture.shape[:2]) > 300, f"{path.name} has {picture.shape} pixels"
    drawn = np.mean(np.any(np.abs(picture - picture[0, 0]) > 0.05, axis=2))
    assert drawn > 0.02, f"only {100 * drawn:.2f} % of {path.name} is drawn"
    return picture


def test_default_pictures(run_dir):
    result = subprocess.run([sys.executable, str(PLOT), str(run_dir)], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert result.stderr == ""
    names = {path.name for path in run_dir.glob("*.png")}
    assert names == {"trajectory.png", "history.png", "field_40.png"}  # as it falls: at step 160 all is at rest
    assert set(result.stdout.split()) == {str(run_dir / name) for name in names}
    for name in names:
        assert_picture(run_dir / name)


def made_up(x, y, time=0.2):
    """Speed and vorticity of write_fields()."""
    speed, height = fall(time)
    dx, dy = x - 1, y - height
    r = np.hypot(dx, dy)
    decay = -speed * np.exp(-np.maximum(r / RADIUS - 1, 0) / 2) * np.sin(np.pi * x / 2)
    return np.hypot(0.4 * decay * dx * dy / (r**2 + 0.05), decay), -decay * dx / (r + 0.1) / 0.2


def test_speed_at_its_place(run_dir):
    """The disc has its group's colour where it is, with a spoke; the fluid beside it, in the wake and far away has that of its speed."""
    picture = look(run_dir, "--step", 40)["field_40.png"]
    height, run = fall(0.2)[1], tumble.open(run_dir)
    tint = np.array(matplotlib.colors.to_rgb(draw.group_tints(run, [0])[0]))
    assert_colour(picture.at(1 - 0.06, height - 0.06), tint, "the disc")
    assert picture.around(1, height, 2).min() < 0.35, "no spoke from the disc's centre"
    low, high = draw.colour_range(draw.scalars(run.snapshot(step=40), "speed"), False)
    for x, y in [(1.3, height), (1.05, height + 0.3), (1.6, height - 0.5), (0.3, 0.5), (1.9, 5.5)]:
        assert_colour(picture.at(x, y), colour_of("speed", made_up(x, y)[0], low, high), f"the fluid at ({x}, {y:.2f})")


def test_colours_go_by_what_is_seen():
    """Of a scalar: values outside of bodies and on their surfaces; nothing is known of what bodies cover"""

    class Shot:
        names = ["body", "heat"]
        cells = np.array([[0, 1, 2], [2, 3, 4], [4, 5, 6]])

        def __getitem__(self, name):
            return np.array([[-1], [-1], [0], [0], [0], [0], [0]])

    values = np.array([1.0, 2, 3, -50, 40, 70, 80])
    assert list(draw.seen(Shot(), "heat", values)) == [1, 2, 3] and draw.seen(Shot(), "speed", values) is values


def test_aggregates_and_bonds(run_dir):
    """Bodies that bonds join have one colour, others another one; a bond under pull is red, one under pressure blue."""
    circle = RADIUS * np.stack([np.cos(draw.ROUND), np.sin(draw.ROUND), 0 * draw.ROUND], 1)
    centre = np.array([[0.5, 3, 0], [0.75, 3, 0], [1, 3, 0], [1.5, 3, 0]])
    with h5py.File(run_dir / "bodies_40.h5", "w") as file:
        file.update({"time": [0.2], "position": centre, "radius": np.full(4, RADIUS), "aggregate": [0, 0, 0, -1], "cell_body": range(4)})
        file.update({"outline": (centre[:, None] + circle).reshape(-1, 3), "line": np.arange(4 * len(circle)).reshape(4, -1)})
    with h5py.File(run_dir / "bonds_40.h5", "w") as file:
        file.update({"time": [0.2], "end": centre[[0, 1, 1, 2]], "line": [[0, 1], [2, 3]], "tension": [5.0, -5.0], "body": [0, 1], "partner": [1, 2]})
    (run_dir / "bodies.csv").unlink()
    for kind in "bodies", "bonds":
        (run_dir / f"{kind}.xdmf").write_text(f"<Xdmf><DataItem>{kind}_40.h5:/end</DataItem></Xdmf>")
    picture = look(run_dir, "--step", 40)["field_40.png"]
    for k, number in enumerate((0, 0, 0, -1)):
        assert_colour(picture.at(centre[k, 0], 3.07), np.array(draw.aggregate_tint(number)), f"body {k}")
    pull, push = picture.around(0.625, 3), picture.around(0.875, 3)
    assert_has_colour(pull, matplotlib.colormaps["coolwarm"](1.0)[:3], "the bond under pull")
    assert_has_colour(push, matplotlib.colormaps["coolwarm"](0.0)[:3], "the bond under pressure")


def test_chosen_step_and_fields(run_dir):
    """Vorticity of one sign on the left and of the other on the right, in the same strength; pressure above less than below."""
    pictures = look(run_dir, "--step", 40, "--field", "vorticity", "--field", "pressure", "--units", "si")
    assert {"field_40_vorticity.png", "field_40_pressure.png"} == {name for name in pictures if name.startswith("field")}
    height, shot = fall(0.2)[1], tumble.open(run_dir).snapshot(step=40)
    low, high = draw.colour_range(draw.scalars(shot, "vorticity"), True)
    assert low == -high
    for x in (0.7, 1.3, 1.8):
        assert_colour(pictures["field_40_vorticity.png"].at(x, height), colour_of("vorticity", made_up(x, height)[1], low, high), f"vorticity at x = {x}")
    low, high = draw.colour_range(draw.scalars(shot, "pressure"), draw.FIELDS["pressure"][2])
    for dy in (-0.4, 0.4):
        value = -15 * fall(0.2)[0] * dy / (dy**2 + 0.1)
        assert_colour(pictures["field_40_pressure.png"].at(1.03, height + dy), colour_of("pressure", value, low, high), f"pressure {dy} above the disc")


def test_curves_and_their_legends(run_dir):
    """Fall speed and height pass the points of the table, in a colour; no legend lies over a curve, nor over published points."""
    (run_dir / "options.txt").write_text("-flow_gravity 0,-981\n")
    picture = look(run_dir)["trajectory.png"]
    for step in (20, 60, 100):
        for axes, value in enumerate(fall(0.005 * step)):
            near = picture.around(0.005 * step, value, 3, axes)
            assert np.ptp(near, axis=2).max() > 0.3, f"no curve at step {step} in panel {axes}"
    assert any(axes.get_legend() for axes in picture.axes) and picture.covered() == 0, "points lie under a legend"


def test_outline_from_indicator(tmp_path):
    """A body that is no disc is outlined from the nodes inside, in white, and the field is seen in it; a disc is filled."""
    height = fall(0.2)[1]
    for name, radius in (("disc", RADIUS), ("other", 0)):
        folder = write_run(tmp_path / name, radius, cells=(40, 120))
        picture, run = look(folder, "--step", 40)["field_40.png"], tumble.open(folder)
        border = [picture.around(1 + RADIUS * np.cos(t), height + RADIUS * np.sin(t), 4).min(2).max() for t in np.linspace(0.3, 6, 7)]
        assert (min(border) > 0.97) == (radius == 0), f"{name}: white up to {min(border):.2f} on the border"
        tint = np.array(matplotlib.colors.to_rgb(draw.group_tints(run, [0])[0]))
        field = colour_of("speed", made_up(0.95, height + 0.05)[0], *draw.colour_range(draw.scalars(run.snapshot(step=40), "speed"), False))
        assert_colour(picture.at(0.95, height + 0.05), tint if radius else field, f"in the {name}")


def test_outline_from_file(tmp_path):
    """A body that is no disc is drawn as the outline that bodies_<step>.h5 holds; one that has left the domain is not."""
    colours = {}
    for name, radius in (("gone", 0), ("there", RADIUS)):
        folder = write_run(tmp_path / name, 0)
        with h5py.File(folder / "fields_40.h5", "a") as file:
            file["body"][:] = -1
        with h5py.File(folder / "bodies_40.h5", "w") as file:
            file["radius"] = [radius]
            file["outline"] = [[0.9, 3, 0], [1.6, 3, 0], [1.6, 4, 0], [1.2, 4.3, 0], [0.9, 4, 0]]
        picture, run = look(folder, "--step", 40)["field_40.png"], tumble.open(folder)
        colours[name] = [picture.at(1.2, 3.2), picture.at(1.45, 3.85), picture.at(1.75, 3.5)]
    tint = np.array(matplotlib.colors.to_rgb(draw.group_tints(run, [0])[0]))
    for inside in colours["there"][:2]:
        assert_colour(inside, tint, "the body")
    low, high = draw.colour_range(draw.scalars(run.snapshot(step=40), "speed"), False)
    for got, x, y in zip(colours["gone"], (1.2, 1.45, 1.75), (3.2, 3.85, 3.5)):
        assert_colour(got, colour_of("speed", made_up(x, y)[0], low, high), f"without the body at ({x}, {y})")
    assert_colour(colours["there"][2], colours["gone"][2], "beside the body")


def test_running_job(run_dir):
    """No summary yet; a snapshot that the index does not name is not ours."""
    (run_dir / "summary.json").unlink()
    write_index(run_dir / "fields.xdmf", STEPS[:2])
    result = plot(run_dir)
    assert result.returncode == 0, result.stderr
    assert (run_dir / "field_40.png").exists() and not (run_dir / "field_160.png").exists()


@pytest.mark.parametrize(
    "break_it, arguments, words",
    [
        (lambda folder: None, ["--step", "7"], ["step 7", "0, 40, 160"]),
        (lambda folder: (folder / "series.csv").write_text("step,hours\n1,2\n"), [], ["series.csv", "time"]),
        (lambda folder: (folder / "summary.json").write_text("{"), [], ["summary.json"]),
        (lambda folder: (folder / "mesh.h5").unlink(), [], ["mesh.h5"]),
    ],
)
def test_broken_results(run_dir, break_it, arguments, words):
    break_it(run_dir)
    result = plot(run_dir, *arguments)
    assert_one_line(result, words)


def test_missing_directory(tmp_path):
    assert_one_line(plot(tmp_path / "nowhere"), ["nowhere", "does not exist"])


def test_empty_directory(tmp_path):
    assert_one_line(plot(tmp_path), ["holds no results", "series.csv"])


def assert_one_line(result, words):
    assert result.returncode == 1
    assert result.stderr.startswith("plot: ") and result.stderr.count("\n") == 1, result.stderr
    for word in words:
        assert word in result.stderr


# ---- what matters is drawn: shown by the words on the pictures ----


def words_of(folder, *arguments):
    """All labels and titles of the pictures, by file name."""
    return {name: picture.words for name, picture in look(folder, *arguments).items()}


@pytest.mark.parametrize(
    "options, there, absent",
    [
        ("-flow_gravity 0,-981\n", ["fall speed", "height of the centre"], ["angle [rad]"]),
        ("-flow_viscosity 0.1\n", ["speed", "y of the centre"], ["fall speed", "height of the centre"]),
        ("-particle_disc_pivot 0,0\n", ["angle [rad]", "angular velocity"], ["fall speed", "speed"]),
        ("-particle_disc_free none\n", ["force along x (drag)", "force along y (lift)"], ["fall speed", "speed"]),
        ("-particle_disc_motion oscillate\n", ["force along x (drag)"], ["fall speed", "speed"]),
    ],
)
def test_trajectory_shows_what_matters(run_dir, options, there, absent):
    (run_dir / "options.txt").write_text(options)
    words = words_of(run_dir)["trajectory.png"]
    assert set(there) <= set(words) and not set(absent) & set(words), words


def test_coefficients_of_a_body_at_rest(run_dir):
    (run_dir / "options.txt").write_text("-particle_disc_free none\n")
    lines = (run_dir / "series.csv").read_text().splitlines()
    (run_dir / "series.csv").write_text("\n".join([lines[0] + ",cd,cl", *(f"{line},3.2,0.01" for line in lines[1:-1])]) + "\n")
    assert {"drag coefficient", "lift coefficient"} <= set(words_of(run_dir)["trajectory.png"])


def test_units_are_those_of_the_summary(run_dir):
    """None that nobody has stated."""
    assert "time" in words_of(run_dir)["history.png"] and "x" in words_of(run_dir)["field_40.png"]
    (run_dir / "summary.json").write_text(json.dumps({"scene": "sedimentation", "units": {"length": "um", "time": "us", "mass": "pg"}}))
    words = words_of(run_dir)
    assert "time [us]" in words["history.png"] and "kinetic energy [pg um²/us²]" in words["history.png"]
    assert "speed [um/us]" in words["field_40.png"]
    assert "time [s]" in words_of(run_dir, "--units", "si")["history.png"]


# ---- runs in space ----


@pytest.fixture(autouse=True)
def coarse_slices(monkeypatch):
    """Enough to see what is where: a fifteenth of the time."""
    monkeypatch.setattr(draw.Slice, "FINE", 60)


HEX = [0, 2, 8, 6, 18, 20, 26, 24, 1, 5, 7, 3, 19, 23, 25, 21, 9, 11, 17, 15, 12, 14, 10, 16, 4, 22, 13]


def write_space(folder):
    """A ball at rest at (0.4, 0.5, 1.2) in a box of 1 x 1 x 2, shear flow u = z."""
    folder.mkdir()
    n = (4, 4, 8)
    lattice = [2 * k + 1 for k in n]
    z, y, x = (a.ravel() for a in np.meshgrid(np.linspace(0, 2, lattice[2]), np.linspace(0, 1, lattice[1]), np.linspace(0, 1, lattice[0]), indexing="ij"))
    cells = []
    for k, j, i in np.ndindex(n[2], n[1], n[0]):
        block = [((2 * k + c) * lattice[1] + 2 * j + b) * lattice[0] + 2 * i + a for c in range(3) for b in range(3) for a in range(3)]
        cells.append([block[p] for p in HEX])
    with h5py.File(folder / "mesh.h5", "w") as file:
        file["coordinates"], file["cells"] = np.stack([x, y, z], axis=1), np.array(cells)
    with h5py.File(folder / "fields_3.h5", "w") as file:
        file["time"] = [0.3]
        file["velocity"] = np.stack([z, 0 * z, 0 * z], axis=1)
        file["body"] = np.where(np.hypot(np.hypot(x - 0.4, y - 0.5), z - 1.2) < 0.3, 0, -1)
    with h5py.File(folder / "bodies_3.h5", "w") as file:
        file["time"], file["radius"], file["position"], file["velocity"] = [0.3], [0.3], [[0.4, 0.5, 1.2]], [[0, 0, 0]]
    (folder / "bodies.csv").write_text(BODIES + "\n3,0.3,0,ball,0.4,0.5,1.2" + ",0" * 14 + ",0.3\n")
    (folder / "options.txt").write_text("-flow_gravity 0,0,-981\n")
    return folder


def test_plane_through_the_body(tmp_path):
    """The plane holds gravity and the body's centre; the ball's circle is filled, the fluid has the colour of its speed, from 0 to 2."""
    folder = write_space(tmp_path / "space")
    picture, run = look(folder, "--no-surface")["field_3.png"], tumble.open(folder)
    assert any("y = 0.5" in word for word in picture.words) and {"x", "z", "speed"} <= set(picture.words)
    tint = np.array(matplotlib.colors.to_rgb(draw.group_tints(run, [0])[0]))
    for x, z in [(0.4, 1.2), (0.4, 1.45), (0.2, 1.1), (0.6, 1.05)]:
        assert_colour(picture.at(x, z), tint, f"the ball at ({x}, {z})")
    for x, z in [(0.85, 1.2), (0.4, 1.6), (0.05, 1.2), (0.5, 0.4)]:
        assert_colour(picture.at(x, z), colour_of("speed", z, 0, 2), f"the fluid at ({x}, {z})")


def test_slices(tmp_path):
    """Planes by hand; a plane of constant z has one speed, and the mesh's polynomials give it exactly."""
    folder = write_space(tmp_path / "space")
    words = words_of(folder, "--no-surface", "--slice", "z=1.5", "--slice", "x=0.25")
    assert any("z = 1.5" in word for word in words["field_3_z1.5.png"]) and {"x", "y"} <= set(words["field_3_z1.5.png"])
    assert {"y", "z"} <= set(words["field_3_x0.25.png"])
    run = tumble.open(folder)
    shot = run.snapshot()
    assert np.allclose(draw.Slice(shot, "speed", 2, 1.5).values, 1.5, atol=1e-12)
    cut = draw.Slice(shot, "speed", 0, 0.25)
    assert np.allclose(cut.values, cut.y[:, None], atol=1e-9) and cut.values.shape == (len(cut.y), len(cut.x))
    (_, circle), = cut.cut_bodies(run, shot)
    assert np.allclose(np.hypot(*(circle - [0.5, 1.2]).T), np.sqrt(0.3**2 - 0.15**2))
    assert draw.Slice(shot, "speed", 0, 0.95).cut_bodies(run, shot) == []


def test_elastic_particles_are_cut():
    """Two cubes side by side, as solid_<step>.h5 has them: their common side is no surface, and a plane cuts a frame of 2 by 1."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float)
    edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
    sides = [[0, 4, 7, 3], [1, 2, 6, 5], [0, 1, 5, 4], [3, 7, 6, 2], [0, 3, 2, 1], [4, 5, 6, 7]]
    cube = np.concatenate([corners, [corners[list(e)].mean(0) for e in edges], [corners[s].mean(0) for s in sides], [corners.mean(0)]])
    points, cells = np.unique(np.concatenate([cube, cube + [1, 0, 0]]), axis=0, return_inverse=True)
    shot = types.SimpleNamespace(drops={}, dim=3, solids={"coordinates": points, "cells": cells.reshape(2, 27)})
    assert len(draw.material_faces(shot)) == 10
    cut = draw.cut_triangles(*draw.material_triangles(shot), 2, 0.3)
    assert np.linalg.norm(cut[:, 0] - cut[:, 1], axis=1).sum() == pytest.approx(6)
    assert len(draw.material_faces(types.SimpleNamespace(drops={}, solids={}, dim=3))) == 0


def test_triangles_are_cut(tmp_path):
    """A tetrahedron's triangles meet a plane in the sides of a triangle."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    cells = np.array([[0, 1, 2], [0, 1, 3], [1, 2, 3], [0, 2, 3]])
    cut = draw.cut_triangles(points, cells, 2, 0.25)
    assert cut.shape == (3, 2, 3) and np.allclose(cut[..., 2], 0.25)
    assert sorted(np.round(np.linalg.norm(cut[:, 0] - cut[:, 1], axis=1), 9)) == pytest.approx([0.75, 0.75, 0.75 * np.sqrt(2)])
    assert len(draw.cut_triangles(points, cells, 2, 1.5)) == 0
    shot = types.SimpleNamespace(bodies={"surface": points, "triangle": cells, "cell_body": np.array([[0], [0], [0], [3]])})  # as bodies_<step>.h5 names them
    assert (draw.triangles(shot)[1] == cells).all() and (draw.triangles(shot, {3})[1] == cells[:3]).all()


def test_surface_picture(tmp_path):
    folder = write_space(tmp_path / "space")
    result = plot(folder)
    assert result.returncode == 0, result.stderr
    if not (folder / "surface_3.png").exists():
        assert "python3-vtk9" in result.stderr
        pytest.skip("no VTK, or no screen for it")
    picture = assert_picture(folder / "surface_3.png")
    orange = (picture[..., 0] > picture[..., 2] + 0.15) & (picture[..., 0] > picture[..., 1] + 0.1)
    assert orange.mean() > 0.01, "no ball is seen"


@pytest.mark.parametrize("words, said", [(["--slice", "q"], "--slice q is no plane"), (["--slice", "x=7"], "x = 7 lies outside"), (["--body", "4"], "no body 4")])
def test_wrong_planes(tmp_path, words, said):
    assert_one_line(plot(write_space(tmp_path / "space"), *words), [said])


def test_no_slice_of_a_plane_run(run_dir):
    assert_one_line(plot(run_dir, "--slice", "x=1"), ["this one is plane"])


def test_cells(tmp_path):
    """--cells draws the cells over the field: at their edges, not in their middles; a run in space is told that it has none to draw."""
    folder = write_run(tmp_path / "coarse", cells=(4, 12))  # of side 1/2
    without, cells = look(folder)["field_40.png"], look(folder, "--cells")["field_40.png"]
    for x, y in [(0.5, 2.25), (0.75, 1.5), (1.5, 5.25)]:
        assert np.abs(cells.around(x, y, 2) - without.around(x, y, 2)).max() > 0.05, f"no edge at ({x}, {y})"
    for x, y in [(0.25, 2.25), (0.75, 1.25), (1.75, 5.25)]:
        assert_colour(cells.at(x, y), without.at(x, y), f"in a cell at ({x}, {y})")
    assert animate(folder, "--frame", 40, "--cells").returncode == 0
    assert_one_line(plot(write_space(tmp_path / "space"), "--cells"), ["--cells is for the meshes of plane runs"])


# ---- the film ----


def animate(*arguments, path=None):
    words = [sys.executable, str(PLOT.parent / "animate"), *map(str, arguments)]
    return subprocess.run(words, capture_output=True, text=True, check=False, env={**os.environ, "PATH": path} if path else None)


def test_gif_without_ffmpeg(run_dir, tmp_path):
    """A frame a snapshot, with a colour bar on the right; an mp4 is refused."""
    result = animate(run_dir, "--width", 300, path=str(tmp_path))
    assert result.returncode == 0, result.stderr
    with PIL.Image.open(run_dir / "animation.gif") as film:
        assert film.n_frames == len(STEPS)
        film.seek(2)
        frame = np.asarray(film.convert("RGB")).astype(int)
    bar = frame[frame.shape[0] // 2 - 150 : frame.shape[0] // 2 + 150, -80:-55]
    assert len(np.unique(bar[:, np.argmin(bar.sum(2).sum(0))], axis=0)) > 20, "no colour bar"
    result = animate(run_dir, "--output", tmp_path / "x.mp4", path=str(tmp_path))
    assert result.returncode == 1 and "ffmpeg" in result.stderr


def test_frames_of_a_periodic_run(run_dir):
    """A disc across the border is seen on both sides; one in the middle is not changed."""
    (run_dir / "options.txt").write_text("-mesh_periodic x\n")
    text = (run_dir / "bodies.csv").read_text()
    (run_dir / "bodies.csv").write_text(text.replace(",disc,1,", ",disc,1.95,"))
    run = tumble.open(run_dir)
    lines = draw.plane_bodies(run, run.snapshot(step=40))
    assert len(lines) == 2 and np.allclose(lines[1][1], lines[0][1] - [2, 0])
    (run_dir / "bodies.csv").write_text(text)
    run = tumble.open(run_dir)
    assert len(draw.plane_bodies(run, run.snapshot(step=40))) == 1
    assert animate(run_dir, "--frame", 40).returncode == 0
    assert_picture(run_dir / "frame_40.png")


def test_large_circles_are_round():
    """48 points of a file become a circle of 180."""
    turn = np.linspace(0, 2 * np.pi, 49)[:-1]
    circle = np.stack([1 + 2 * np.cos(turn), 3 + 2 * np.sin(turn), 0 * turn], 1)
    oval = np.stack([2 * np.cos(turn), np.sin(turn), 0 * turn], 1)
    bodies = {"radius": np.array([2.0, 2.0]), "position": np.array([[1.0, 3, 0], [0, 0, 0]]), "outline": np.concatenate([circle, oval])}
    (_, fine, centre), (_, rough, none) = draw.find_outlines(types.SimpleNamespace(bodies=bodies))
    assert len(fine) == 180 and np.allclose(np.hypot(*(fine - [1, 3]).T), 2) and np.allclose(centre, [1, 3])
    assert len(rough) == 48 and none is None
