"""The package tumble with what users have beside it: pandas, pyvista, meshio, jsonschema, a notebook. See packages.py."""
import json
import os
import subprocess

import pytest

from conftest import ROOT, SCENE, build_folder
from packages import GROUP

pytestmark = pytest.mark.xdist_group(GROUP)
SPHERE = """\
mesh: {dimension: 3, cells: [3, 3, 6], lower: [0, 0, 0], upper: [1, 1, 2]}
flow: {density: 1, viscosity: 0.1, gravity: [0, 0, -981]}
particle:
  groups: [ball, brick]
  ball: {shape: circle, radius: 0.3, density: 1.25, position: [0.48, 0.5, 1.3]}
  brick: {shape: box, size: [0.3, 0.2, 0.4], density: 2, position: [0.5, 0.5, 0.5]}
sim: {dt: 0.005, steps: 2}
output: {every: 1}
"""


@pytest.fixture
def python(packages):
    """python(code, *arguments, cwd=): run by the environment's interpreter with tools/ in its path; what it printed."""

    def execute(code, *arguments, cwd):
        env = {**os.environ, "PYTHONPATH": str(ROOT / "tools"), "TUMBLE_PROGRAM": str(build_folder() / "tumble"), "DISPLAY": ""}
        done = subprocess.run([packages, "-c", code, *map(str, arguments)], cwd=cwd, env=env, capture_output=True, text=True)
        assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
        return done.stdout

    return execute


# ---- the schema of scene files ----

CHECK = """
import json, sys, yaml, jsonschema
from pathlib import Path
schema = json.loads(Path(sys.argv[1]).read_text())
jsonschema.Draft7Validator.check_schema(schema)
validator = jsonschema.Draft7Validator(schema)
for path in sys.argv[2:]:
    scene = yaml.safe_load(Path(path).read_text())
    print(json.dumps([path, [[list(map(str, e.absolute_path)), e.message] for e in validator.iter_errors(scene)]]))
"""
GOOD = [
    SCENE,
    "flow: {bc: {left: {type: inflow}}, bc_right_type: outflow, viscosity: 1e-3, ksp_rtol: 1e-4}\n",
    "particle_groups: disc\nparticle_disc: {shape: circle, radius: 1}\nparticle: {disc_density: 2, disc: {motion: [rotate], motion_rotation: [1, 2, 0]}}\n",
    "include: other.yaml\nparticle: {disc: ~}\n",
    "particle: {groups: a, a: {shape: composite, parts: [x], x: {shape: circle, radius: 1, offset: [0, 1]}}}\n",
    "mesh: {cells: \"8,24\"}\nsim: {dt: 1/8, adapt: yes}\n",
    "scalars: [heat]\nscalar: {heat: {bc: {left: {value: x}, right_flux: 1}, bc_top: {transfer: 2}, bc_bottom_value: 0}, heat_bc_up: {value: 0}}\nscalar_heat_bc: {down: {flux: 1}}\n",
]
BAD = {  # the scene, and what is wrong in it
    "flow: {viscosty: 1}\n": "viscosty",
    "flow: {viscosity: -1}\n": "-1",
    "sim: {dt: small}\n": "small",
    "mesh: {cells: [8, 2.5]}\n": "2.5",
    "flow: {bc: {left: {type: inflw}}}\n": "inflw",
    "flow: {bc_left: {tpe: inflow}}\n": "tpe",
    "scalar: {heat: {bc: {left: {transfer: -1}}}}\n": "-1",
    "scalar: {heat: {bc_left: {vlaue: 1}}}\n": "vlaue",
    "particle: {disc: {shpae: circle}}\n": "circle",
    "meshes: {cells: [8, 24]}\n": "meshes",
}


def test_schema(python, tmp_path, program):
    """It accepts all scenes of the tree and the ways in which keys nest; it finds slips of the pen."""
    schema = ROOT / "runs" / "reference" / "scene.schema.json"
    assert subprocess.run([program, "-help", "schema"], capture_output=True, text=True).stdout == schema.read_text(), "run 'make options'"
    paths = sorted([*ROOT.glob("runs/*.yaml"), *ROOT.glob("runs/*/*.yaml"), *ROOT.glob("tests/**/*.yaml")])
    assert len(paths) > 60
    for i, text in enumerate([*GOOD, *BAD]):
        paths.append(tmp_path / f"{i}.yaml")
        paths[-1].write_text(text)
    told = [json.loads(line) for line in python(CHECK, schema, *paths, cwd=tmp_path).splitlines()]
    good, bad = told[: -len(BAD)], told[-len(BAD) :]
    assert not [entry for entry in good if entry[1]]
    for (_, errors), word in zip(bad, BAD.values()):
        assert len(errors) == 1 and word in errors[0][1], (word, errors)


# ---- files ----

FILES = """
import numpy, pyvista, meshio, tumble
from pathlib import Path
run = tumble.open("out/ball")
shot = run.snapshot(step=2)
reader = pyvista.get_reader("out/ball/fields.xdmf")
assert reader.time_values == [0.005, 0.01], reader.time_values
reader.set_active_time_value(0.01)
for grid in (reader.read(), shot.pyvista()):
    assert set(grid.celltypes) == {29} and (grid.cells_dict[29] == shot.cells).all()
    assert numpy.allclose(grid.points, shot.points) and numpy.allclose(grid.point_data["velocity"], shot["velocity"])
    assert numpy.allclose(grid.cell_data["pressure_mean"], shot["pressure_mean"])
    assert abs(grid.compute_cell_sizes()["Volume"].sum() - 2) < 1e-9
assert pyvista.read("out/ball/fields.xdmf").n_points == len(shot.points)
assert pyvista.read("out/ball/bodies.xdmf").n_cells == shot.pyvista("bodies").n_cells > 100
brick = shot.pyvista("bodies").split_bodies()[1]
assert abs(brick.extract_surface().volume - 0.3 * 0.2 * 0.4) < 1e-6
with meshio.xdmf.TimeSeriesReader("out/ball/fields.xdmf") as series:
    points, cells = series.read_points_cells()
    time, point_data, cell_data = series.read_data(1)
assert time == 0.01 and (cells[0].data == shot.cells).all() and cells[0].type == "hexahedron27"
assert numpy.array_equal(point_data["velocity"], shot["velocity"]) and numpy.array_equal(points, shot.points)
pictures = run.plot(slice="y=0.5")
assert {"trajectory.png", "surface_2.png", "field_2_y0.5.png"} <= {path.name for path in pictures}, pictures
picture = __import__("matplotlib.image").image.imread("out/ball/surface_2.png")
orange = (picture[..., 0] > picture[..., 2] + 0.15) & (picture[..., 0] > picture[..., 1] + 0.1)
assert orange.mean() > 0.01, "no ball is seen"
"""


def test_pyvista_and_meshio_read_the_files(python, run, scene, tmp_path):
    """Node order, values and times; the surfaces are drawn by pip's VTK without a screen."""
    done = run([scene(SPHERE, "ball.yaml")])
    assert done.status == 0, done
    python(FILES, cwd=tmp_path)


# ---- runs ----

SWEEP = """
import json, pathlib, pytest, yaml, tumble
scene = yaml.safe_load(pathlib.Path("disc.yaml").read_text())
seen = []
frame = tumble.sweep(scene, jobs=2, out="out/s", particle_disc_density=[1.1, 1.5, -2], sim_dt=[0.005, 0.0025], mesh_cells=(8, 24), progress=seen.append)
assert len(frame) == len(seen) == 6 and list(frame["sim_dt"]) == [0.005, 0.0025] * 3
assert list(frame.columns[:2]) == ["particle_disc_density", "sim_dt"] and (frame["error"].notna() == (frame["particle_disc_density"] < 0)).all()
assert "-particle_disc_density = -2" in frame["error"][4]
fast, slow = frame["fall_speed_max"][2], frame["fall_speed_max"][0]
assert 2 < fast / slow < 5, frame
assert fast == tumble.open(frame["directory"][2]).summary["quantities"]["fall_speed_max"]
run = tumble.open("out/s/000")
assert run.series[["step", "time"]].shape == (2, 2) and run.group("disc").iloc[-1]["v"] == run.body(0)["v"][-1] and len(run.series[run.series["step"] > 1]) == 1
with pytest.raises(tumble.Failure, match="did you mean -flow_viscosity"):
    tumble.sweep(scene, out="out/t", flow_viscosty=[1, 2])
"""


def test_sweep(python, scene, tmp_path):
    scene()
    python(SWEEP, cwd=tmp_path)


NOTEBOOK = """
import sys, nbformat, nbclient
book = nbformat.read(sys.argv[1], 4)
nbclient.NotebookClient(book, timeout=300, kernel_name="python3").execute()
for cell in book.cells:
    if cell.cell_type == "code":
        print("CELL", "|".join(str(dict(out.get("data", out))) for out in cell.outputs))
"""


def test_notebook(python, tmp_path):
    """It runs, shows pictures, a table, the program's error and rows while it runs."""
    (tmp_path / "runs").symlink_to(ROOT / "runs")
    cells = python(NOTEBOOK, ROOT / "runs" / "guide" / "notebook.ipynb", cwd=tmp_path).split("CELL ")[1:]
    assert "fall_speed_max" in cells[1] and "text/html" in cells[2] and cells[3].count("data:image/png;base64,") == 3
    assert "did you mean -flow_viscosity?" in cells[4]
    assert "text/html" in cells[5] and "image/png" in cells[6] and "step 4, kinetic energy" in cells[7] and "image/png" in cells[8]
    assert (tmp_path / "out" / "notebook" / "sphere" / "fields.xdmf").exists()
