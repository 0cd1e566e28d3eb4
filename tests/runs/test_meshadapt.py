"""Meshes refined by the flow (-mesh_adapt): 2D-1 and the driven cavity from coarse starts to their references, the same cells on two ranks, the indicator in the files, refusals."""
import csv
import json
import sys

import h5py
import numpy
import pytest

from conftest import ROOT

sys.path.insert(0, str(ROOT / "tools"))
import tumble  # noqa: E402

CD, CL = 5.57953523384, 0.010618948146
CYLINDER = [ROOT / "runs" / "cylinder-2d1.yaml", "-mesh_kind", "box", "-mesh_upper", "2.2,0.41", "-mesh_cells", "22,4", "-mesh_levels", 6, "-mesh_adapt"]
CAVITY = [ROOT / "runs" / "cavity-re1000.yaml", "-mesh_cells", "16,16", "-mesh_levels", 4, "-mesh_adapt"]


def rounds(folder):
    with open(folder / "series.csv", newline="") as file:
        return list(csv.DictReader(file))


def test_benchmark(run):
    """From 1,000 cells to cD within 1e-4 and cL within 1 %, with 13,009 unknowns (0.003 and 0.13 %)."""
    cells = []
    for ranks in (1, 2):
        done = run([*CYLINDER, "-couple_method", "aligned", "-mesh_adapt_unknowns", 14000, "-output_dir", f"ranks{ranks}"], ranks)
        assert done.status == 0, done
        out = done.folder / f"ranks{ranks}"
        table = rounds(out)
        cells.append([row["cells"] for row in table])
        last = table[-1]
        assert float(last["cd"]) == pytest.approx(CD, rel=1e-4) and float(last["cl"]) == pytest.approx(CL, rel=1e-2), last
        assert float(last["unknowns"]) <= 14000 and float(table[0]["cells"]) == 1000, table
        indicator = [float(row["error_indicator"]) for row in table]
        assert indicator == sorted(indicator, reverse=True), table
        assert json.loads((out / "summary.json").read_text())["quantities"]["error_indicator"] == pytest.approx(indicator[-1]), out
    assert cells[0] == cells[1]


def test_indicator_in_files(run):
    """Zero where the body is, largest of all at its surface or the lid's corners; as many as cells."""
    done = run([*CYLINDER, "-couple_method", "penalty", "-mesh_adapt_unknowns", 11200, "-output_dir", "out"])
    assert done.status == 0, done
    table = rounds(done.folder / "out")
    with h5py.File(done.folder / "out" / f"fields_{len(table)}.h5") as file:
        eta = file["error_indicator"][:].ravel()
    assert len(eta) == int(float(table[-1]["cells"])) and (eta >= 0).all() and 0 < (eta == 0).sum() < 0.5 * len(eta)
    assert "error_indicator" in (done.folder / "out" / "fields.xdmf").read_text()


def test_cavity(run):
    """Extrema of the velocity on the middle lines (Botella & Peyret 1998) from 8,019 unknowns as from 45,570 of a uniform mesh: 0.1 %."""
    done = run([*CAVITY, "-mesh_adapt_unknowns", 9000, "-output_dir", "out"])
    assert done.status == 0, done
    table = rounds(done.folder / "out")
    assert 6000 < float(table[-1]["unknowns"]) <= 9000, table
    s = numpy.linspace(0, 1, 1001)
    middle = numpy.full_like(s, 0.5)
    flow = tumble.open(done.folder / "out").snapshot(step=len(table))
    u = flow.sample("velocity", numpy.c_[middle, s])[:, 0]
    v = flow.sample("velocity", numpy.c_[s, middle])[:, 1]
    found = [numpy.nanmin(u), numpy.nanmax(v), numpy.nanmin(v)]
    assert found == pytest.approx([-0.3885698, 0.3769447, -0.5270771], rel=1.5e-3)


def test_tolerance(run):
    done = run([*CYLINDER, "-mesh_adapt_tolerance", 0.3, "-output_every", 0, "-output_dir", "out"])
    assert done.status == 0, done
    table = rounds(done.folder / "out")
    assert float(table[-1]["error_indicator"]) <= 0.3 < float(table[-2]["error_indicator"]), table


def test_space(run, scene):
    """A driven cavity in space: cells are halved, the error falls, on two ranks."""
    lid = """\
mesh: {dimension: 3, cells: [3, 3, 3], levels: 2}
flow: {density: 1, viscosity: 0.1, bc_top: {type: moving_wall, velocity: [1, 0, 0]}}
sim: {steady: true}
"""
    done = run([scene(lid), "-flow_solver", "balanced", "-mesh_adapt", "-mesh_adapt_unknowns", 4500, "-output_dir", "out"], 2)
    assert done.status == 0, done
    table = rounds(done.folder / "out")
    assert len(table) > 1 and float(table[-1]["error_indicator"]) < float(table[0]["error_indicator"]), table


REFUSED = {
    "no target": ([], "no end: give -mesh_adapt_tolerance"),
    "no levels": (["-mesh_adapt_tolerance", 0.1, "-mesh_levels", 0], "give -mesh_levels"),
    "in time": (["-mesh_adapt_tolerance", 0.1, "-sim_steady", "false", "-sim_dt", 0.1, "-sim_steps", 1], "give -sim_steady"),
    "varying viscosity": (["-mesh_adapt_tolerance", 0.1, "-flow_rheology", "carreau", "-flow_rheology_index", 0.5], "remove -flow_rheology"),
    "moving": (["-mesh_adapt_tolerance", 0.1, "-mesh_refine", "way", "-mesh_box_way_corners", "0,0,1,0.4", "-particle_cylinder_free", "all",
                "-particle_cylinder_density", 2],
               "stand still"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_refused(run, case):
    options, words = REFUSED[case]
    done = run([*CYLINDER, *options])
    assert done.status != 0 and words in done.text and done.text.count("error:") == 1 and "residual" not in done.text, done
