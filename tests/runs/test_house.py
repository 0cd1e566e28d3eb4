"""The house stands as it is drawn: the towers build without each other, and tools/check-layers finds what would tie them."""

import os
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / os.environ.get("TUMBLE_BUILD", "build")
TOWERS = {"bodies": ("base", "shape", "bodies", "contact"), "flow": ("base", "fem", "device", "mesh", "flow", "solve"), "align": ("base", "fem", "mesh", "align"),
          "solid": ("base", "fem", "shape", "mesh", "align", "solid"), "scalar": ("base", "fem", "mesh", "scalar"),
          "phase": ("base", "fem", "shape", "mesh", "align", "phase")}

# what is written at the head of which file: what tools/check-layers says
WRONG = {
    "a room above": ("src/base/grid.c", '#include "mesh/mesh.h"', "the room base may not include mesh/mesh.h"),
    "the tower beside": ("include/bodies/bodies.h", '#include "mesh/mesh.h"', "the room bodies may not include mesh/mesh.h"),
    "the tower beside, reversed": ("src/flow/flow.c", '#include "bodies/bodies.h"', "the room flow may not include bodies/bodies.h"),
    "surfaces, not bodies": ("src/align/cover.c", '#include "bodies/bodies.h"', "the room align may not include bodies/bodies.h"),
    "meshes that are lined up": ("src/flow/flow.c", '#include "align/align.h"', "the room flow may not include align/align.h"),
    "drops": ("src/phase/drops.c", '#include "flow/flow.h"', "the room phase may not include flow/flow.h"),
    "elastic solids": ("src/solid/solids.c", '#include "flow/flow.h"', "the room solid may not include flow/flow.h"),
    "scalars know no flow": ("src/scalar/cells.c", '#include "flow/flow.h"', "the room scalar may not include flow/flow.h"),
    "the element": ("src/fem/element.c", '#include "mesh/mesh.h"', "the room fem may not include mesh/mesh.h"),
    "plain arrays": ("src/device/cells.c", '#include "base/log.h"', "the room device may not include base/log.h"),
    "the roof": ("src/contact/law.c", '#include "couple/couple.h"', "the room contact may not include couple/couple.h"),
    "a private header": ("src/report/checkpoint.c", '#include "../solve/impl.h"', "impl.h is private to the room solve"),
    "a header that is not there": ("src/mesh/mesh.c", '#include "mesh/nothing.h"', "there is no header mesh/nothing.h"),
    "our header in brackets": ("src/run/scene.c", "#include <couple/couple.h>", "write our own headers in quotes: couple/couple.h"),
    "a header without its room": ("include/mesh/remap.h", '#include "mesh.h"', "write the room of a header in include/ as well: mesh/mesh.h"),
    "a folder that is no room": ("src/attic/attic.c", "", "'attic' is no room"),
    "a plugin": ("shapes/circle.c", '#include "base/opt.h"', "a shape includes only shape.h"),
    "PETSc's private headers": ("src/solve/system.c", "#include <petsc/private/kspimpl.h>", "private PETSc header"),
}


def find_objects(room):
    """Those of sources that are there today"""
    for path in sorted((BUILD / "obj" / room).glob("**/*.o")):
        if (ROOT / "src" / path.relative_to(BUILD / "obj")).with_suffix(".c").exists():
            yield path


@pytest.mark.parametrize("tower", TOWERS)
def test_a_tower_links_without_the_other(tower, tmp_path):
    """Every symbol of a tower is in the tower or in the libraries below: the linker leaves none open."""
    objects = [path for room in TOWERS[tower] for path in find_objects(room)]
    compiler, *flags = shlex.split((BUILD / "flags").read_text())
    libraries = [word for word in flags if word.startswith(("-L", "-l", "-Wl,", "-fsanitize"))]
    words = [compiler, "-shared", "-Wl,-z,defs", "-Wl,--copy-dt-needed-entries",  # LAPACK comes with PETSc
              "-o", tmp_path / "tower.so", *objects, *libraries]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    assert len(objects) > 10 and not done.returncode, done.stderr


@pytest.fixture(scope="module")
def house(tmp_path_factory):
    """A copy of the tree, to be spoilt"""
    copy = tmp_path_factory.mktemp("house")
    for folder in ("src", "include", "shapes", "tests", "tools"):
        shutil.copytree(ROOT / folder, copy / folder, ignore=shutil.ignore_patterns("__pycache__"))
    return copy


def check(house):
    return subprocess.run([house / "tools" / "check-layers"], capture_output=True, text=True)


def test_the_house_is_in_order(house):
    done = check(house)
    assert not done.returncode, done.stderr


@pytest.mark.parametrize("rule", WRONG)
def test_a_wrong_include_is_found(house, rule):
    name, line, complaint = WRONG[rule]
    path = house / name
    before = path.read_text() if path.exists() else None
    path.parent.mkdir(exist_ok=True)
    path.write_text(f"{line}\n{before or ''}")
    try:
        done = check(house)
    finally:
        if before is None:
            shutil.rmtree(path.parent)
        else:
            path.write_text(before)
    assert done.returncode and complaint in done.stderr and len(done.stderr.splitlines()) == 1, done.stderr


def test_sizes_and_circles():
    """Functions, files, structs, arguments, wide lines and circles of files within their bounds."""
    done = subprocess.run([ROOT / "tools" / "structure", "--check"], capture_output=True, text=True)
    assert not done.returncode, done.stdout.splitlines()[-12:]
