"""What is installed is enough to write a shape outside of this tree; tools/new-shape begins one. The plugin is the one printed in shapes/README.md."""
import csv
import math
import os
import shutil
import subprocess
import sys

import PIL.Image
import pytest

from conftest import ROOT, environment

MASS = """
#include <shape.h>
int main(int argc, char **argv)
{
  Shape     s;
  ShapeMass m;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  PetscCall(ShapeCreate("rounded_star", "star_", 2, &s));
  PetscCall(ShapeGetMass(s, &m));
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "%.12g %.12g %.12g %.12g\\n", m.volume, m.centroid[0], m.centroid[1], m.inertia[2]));
  PetscCall(ShapeDestroy(&s));
  PetscCall(ShapeFinalize());
  return PetscFinalize();
}
"""

SHAPES = (ROOT / "shapes" / "README.md").read_text()
CODE, SCENE = (SHAPES.split(f"```{kind}\n", 1)[1].split("```", 1)[0] for kind in ("c", "yaml"))


def execute(words, cwd, fail=False):
    """All that was printed; the build of another tree that runs these tests is hidden."""
    done = subprocess.run(list(map(str, words)), cwd=cwd, env={**environment(), **ENVIRONMENT, "TUMBLE_BUILD": "build"}, capture_output=True, text=True, timeout=300)
    assert (done.returncode != 0) == fail, f"in {cwd}: {' '.join(map(str, words))}\n{done.stdout}{done.stderr}"
    return done.stdout + done.stderr


ENVIRONMENT = {}


@pytest.fixture(scope="module")
def prefix(tmp_path_factory):
    """An installation in a folder that has nothing to do with this tree."""
    if (ROOT / os.environ.get("TUMBLE_BUILD", "build")).resolve() != ROOT / "build":
        pytest.skip("make install takes what is in the folder build")
    folder = tmp_path_factory.mktemp("prefix")
    execute(["make", "-C", ROOT, "install", f"PREFIX={folder}", "SETUP=true"], folder)
    ENVIRONMENT["PKG_CONFIG_PATH"] = str(folder / "lib" / "pkgconfig")
    yield folder
    ENVIRONMENT.clear()


def pkg_config(*words):
    return execute(["pkg-config", *words, "tumble"], ".").split()


def build_plugin(folder, name):
    out = execute(["cc", "-O2", "-Wall", *pkg_config("--cflags", "--libs"), "-shared", "-fPIC", "-o", f"{name}.so", f"{name}.c"], folder)
    assert "warning" not in out, out


def outline(tips, outer, n=4000):
    """Points of the star's outline, counter-clockwise, from its description in README alone: arcs, and flanks cut off where they meet."""
    half, arc = math.pi / tips, outer / 10
    tip, notch = complex(outer - arc, 0), outer / 2 * complex(math.cos(half), math.sin(half))
    along = (notch - tip) / abs(notch - tip)
    normal = along * -1j
    start, ray = tip + arc * normal, complex(math.cos(half), math.sin(half))
    length = -(start * ray.conjugate()).imag / (along * ray.conjugate()).imag
    turn = math.atan2(normal.imag, normal.real)
    side = [tip + arc * complex(math.cos(turn * i / n), math.sin(turn * i / n)) for i in range(n + 1)] + [start + along * length]
    sector = [point.conjugate() for point in reversed(side)] + side[1:]
    return [point * complex(math.cos(2 * half * k), math.sin(2 * half * k)) for k in range(tips) for point in sector[1:]]


def polygon_mass(points):
    """Area, and second moment about the origin."""
    area = inertia = 0
    for a, b in zip(points, points[1:] + points[:1]):
        cross = a.real * b.imag - b.real * a.imag
        area += cross / 2
        inertia += cross * (abs(a) ** 2 + a.real * b.real + a.imag * b.imag + abs(b) ** 2) / 12
    return area, inertia


def test_pkg_config(prefix):
    version = pkg_config("--modversion")[0]
    assert f'VERSION := {version}\n' in (ROOT / "Makefile").read_text()
    assert os.path.isfile(os.path.join(pkg_config("--variable=shapesdir")[0], "circle.so"))
    assert os.path.isfile(os.path.join(pkg_config("--variable=scenesdir")[0], "sedimentation.yaml"))


def test_installed_program_finds_its_shapes(prefix, tmp_path):
    (tmp_path / "disc.yaml").write_text(SCENE.replace("rounded_star, outer: 0.25, tips: 6", "circle, radius: 0.125"))
    execute([prefix / "bin" / "tumble", "disc.yaml", "-scene_dry_run"], tmp_path)


def test_plugin_of_readme(prefix, tmp_path):
    (tmp_path / "rounded_star.c").write_text(CODE)
    build_plugin(tmp_path, "rounded_star")
    out = execute([prefix / "bin" / "tumble-test-shape", "./rounded_star.so"], tmp_path)
    assert out.rstrip().endswith(" 0 failed"), out

    (tmp_path / "mass.c").write_text(MASS)
    execute(["cc", "mass.c", "-o", "mass", *pkg_config("--cflags", "--libs")], tmp_path)
    volume, x, y, inertia = map(float, execute(["./mass", "-shape_path", ".", "-star_tips", "6", "-star_outer", "0.25"], tmp_path).split())
    exact = polygon_mass(outline(6, 0.25))
    assert abs(volume / exact[0] - 1) < 1e-3 and abs(inertia / exact[1] - 1) < 1e-3, (volume, inertia, exact)
    assert math.hypot(x, y) < 1e-3 * 0.25

    (tmp_path / "star.yaml").write_text(SCENE)
    execute([prefix / "bin" / "tumble", "star.yaml", "-shape_path", "."], tmp_path)
    with open(tmp_path / "out" / "star" / "bodies.csv") as file:
        rows = list(csv.DictReader(file))
    assert float(rows[-1]["v"]) < float(rows[-2]["v"]) < 0 and abs(float(rows[-1]["x"]) - 0.5) < 1e-3


def test_new_shape_outside(prefix, tmp_path):
    tool = ROOT / "tools" / "new-shape"
    execute([sys.executable, tool, "round_knob", "--into", tmp_path], tmp_path)
    build_plugin(tmp_path, "round_knob")
    out = execute([sys.executable, "-m", "pytest", "-q", "test_shape_round_knob.py"], tmp_path)
    assert "3 passed" in out, out
    assert "exists" in execute([sys.executable, tool, "round_knob", "--into", tmp_path], tmp_path, fail=True)
    assert "small letters" in execute([sys.executable, tool, "Knob", "--into", tmp_path], tmp_path, fail=True)


def test_new_shape_in_the_tree(prefix, tmp_path):
    """The tool in a tree of its own, whose build is the installation's and the new plugin."""
    for folder in ("tools", "shapes", "build/tests/shape", "build/shapes"):
        (tmp_path / folder).mkdir(parents=True)
    shutil.copy(ROOT / "tools" / "new-shape", tmp_path / "tools")
    shutil.copy(ROOT / "shapes" / "template.c", tmp_path / "shapes")
    execute([sys.executable, "tools/new-shape", "knob"], tmp_path)
    execute(["cc", *pkg_config("--cflags", "--libs"), "-shared", "-fPIC", "-o", "build/shapes/knob.so", "shapes/knob.c"], tmp_path)
    (tmp_path / "build" / "tumble").symlink_to(prefix / "bin" / "tumble")
    (tmp_path / "build" / "tests" / "shape" / "conformance").symlink_to(prefix / "bin" / "tumble-test-shape")
    assert "3 passed" in execute([sys.executable, "-m", "pytest", "-q", "tests/runs/test_shape_knob.py"], tmp_path)


def test_tools(prefix, tmp_path):
    """Installed pictures, animation and page of an installed scene; the reader from the folder that pkg-config names."""
    scene = prefix / "share" / "tumble" / "runs" / "sedimentation.yaml"
    execute([prefix / "bin" / "tumble", "-mesh_cells", "8,24", "-sim_steps", "4", "-output_every", "2", scene, "-output_dir", "run"], tmp_path)
    for tool, arguments, written in (("plot", [], "trajectory.png"), ("animate", ["--output", tmp_path / "film.gif"], "film.gif"), ("report", [], "report.html")):
        out = execute([prefix / "bin" / f"tumble-{tool}", "run", *arguments], tmp_path)
        assert written in out, out
    with PIL.Image.open(tmp_path / "film.gif") as film:
        assert (tmp_path / "run" / "field_4.png").is_file() and film.n_frames in (2, 3)
    folder = pkg_config("--variable=pythondir")[0]
    code = f"import sys; sys.path.insert(0, {folder!r}); import tumble; assert tumble.__file__.startswith({folder!r}); print(tumble.open('run').steps)"
    assert "[2, 4]" in execute([sys.executable, "-c", code], tmp_path)
