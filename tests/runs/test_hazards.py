"""Sizes and numbers that once had a fixed room: cells at a node, PETSc's scalar."""
import csv
import math
import os
import re
import subprocess

import pytest

from collector import ROOT

SPUN = 'mesh: {kind: file, file: fan.msh}\nflow: {viscosity: 0.1, convection: false, force: ["-y", "x"]}\nsim: {dt: 0.02, steps: 40}\noutput: {every: 0}\n'


def write_fan(path, cells):
    """A disc of quadrilaterals that all meet in its centre, as a Gmsh file."""
    rim = 2 * cells
    points = [(0, 0)] + [(math.cos(math.pi * i / cells), math.sin(math.pi * i / cells)) for i in range(rim)]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "2", '1 1 "wall"', '2 2 "fluid"', "$EndPhysicalNames", "$Nodes", str(rim + 1)]
    lines += [f"{i + 1} {x:.17g} {y:.17g} 0" for i, (x, y) in enumerate(points)]
    lines += ["$EndNodes", "$Elements", str(rim + cells)]
    lines += [f"{i + 1} 1 2 1 1 {2 + i} {2 + (i + 1) % rim}" for i in range(rim)]
    lines += [f"{rim + 1 + k} 3 2 2 2 1 {2 + 2 * k} {3 + 2 * k} {2 + (2 * k + 2) % rim}" for k in range(cells)]
    path.write_text("\n".join([*lines, "$EndElements", ""]))


@pytest.mark.parametrize("ranks", [1, 2])
def test_many_cells_at_a_node(run, scene, tmp_path, ranks):
    """70 cells around one node, whose vertices are 141: a coarse level of any of them. A force (-y, x) leaves a flow v = (r - r^3)/(8 nu)."""
    write_fan(tmp_path / "fan.msh", 70)
    args = [scene(SPUN, "fan.yaml"), "-flow_solver", "balanced", "-output_overwrite"]
    energy = []
    for coarse in "galerkin", "laplacian":
        result = run([*args, "-flow_pressure_coarse", coarse, "-sim_steps", "16", "-sim_dt", "0.5"], ranks)
        assert result.status == 0, str(result)
        with open(tmp_path / "out" / "fan" / "series.csv") as file:
            energy.append(float(list(csv.DictReader(file))[-1]["kinetic_energy"]))
    # pi int (r - r^3)^2/(64 nu^2) r dr from 0 to 1 = pi/(64 * 24 nu^2); one cell along the radius is within some per cent
    assert energy[0] == pytest.approx(energy[1], rel=1e-4)
    assert energy[0] == pytest.approx(math.pi / (64 * 24 * 0.01), rel=0.03)


@pytest.mark.parametrize("define, text", [("PETSC_USE_COMPLEX", "needs a PETSc of real numbers"), ("PETSC_USE_REAL_SINGLE", "needs a PETSc of double precision"), ("PETSC_USE_REAL_DOUBLE", None)])
def test_scalar_type(tmp_path, define, text):
    """Another scalar than double is refused where it is compiled, by a line that says so."""
    stand_in = tmp_path / "petsc.h"  # of a PETSc with that scalar
    both = "" if define.startswith("PETSC_USE_REAL") else "#define PETSC_USE_REAL_DOUBLE 1\n"
    stand_in.write_text(f"#define PETSC_VERSION_LT(a, b, c) 0\n#define {define} 1\n{both}")
    (tmp_path / "probe.c").write_text('#include "compat.h"\n')
    done = subprocess.run([os.environ.get("CC", "cc"), "-E", f"-I{tmp_path}", f"-I{ROOT}/include", "probe.c"], cwd=tmp_path, capture_output=True, text=True)
    errors = re.findall(r"#error .*", done.stderr)
    assert len([line for line in done.stderr.splitlines() if "error: #error" in line]) == (1 if text else 0), done.stderr
    if text:
        assert text in errors[0] and done.returncode != 0
