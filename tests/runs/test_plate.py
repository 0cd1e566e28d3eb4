"""A plate thinner than a cell with method aligned: a path of edges, see include/align/align.h and runs/studies/boundary."""
import csv
import json
import re

import pytest

from conftest import ROOT

FINE = {"cd": 3.2776, "cl": -3.1305}  # 40 cells a length


def read_rows(path):
    with open(path) as file:
        return list(csv.DictReader(file))


def solve(run, folder, resolution, ranks=1):
    args = [ROOT / "runs" / "studies" / "boundary" / "plate.yaml", "-mesh_resolution", resolution, "-output_dir", folder]
    done = run(args, ranks)
    assert done.status == 0, done
    return json.loads((done.folder / folder / "summary.json").read_text())["quantities"]


def test_force(run):
    """0.17 and 0.14 % off at 10 cells a length; allowed is what forces on other meshes of that size differ by. The penalty is 7 and 38 % off."""
    found = solve(run, "out", 10)
    assert found["cd"] == pytest.approx(FINE["cd"], rel=0.0058), found
    assert found["cl"] == pytest.approx(FINE["cl"], rel=0.0073), found


def test_same_on_more_ranks(run):
    one, two = solve(run, "one", 5), solve(run, "two", 5, ranks=2)
    for name in FINE:
        assert two[name] == pytest.approx(one[name], rel=1e-7), (one, two)


def flaps(run, *options):
    return run([ROOT / "runs" / "studies" / "boundary" / "flaps.yaml", "-mesh_cells", "64,32", "-sim_time", "0.2", "-output_every", "0", "-output_dir", "out", *options])


def test_hinged_flaps(run):
    """Flaps hinged in the walls stay paths of edges (held by the penalty they would leak), mirror each other, and open as on a mesh four times as fine (0.376 at t = 0.15)."""
    done = flaps(run)
    assert done.status == 0, done
    rows = read_rows(done.folder / "out" / "series.csv")
    assert all(row["aligned_penalty_bodies"] == "0" for row in rows), rows
    rows = read_rows(done.folder / "out" / "bodies.csv")
    lower, upper = ({row["time"]: float(row["angle"]) for row in rows if row["group"] == group} for group in ("lower", "upper"))
    assert all(lower[t] == pytest.approx(-upper[t], abs=1e-5) for t in lower), (lower, upper)
    assert lower["0.15"] == pytest.approx(0.376, abs=0.03), lower


def test_unresolved_convection_is_named(run):
    done = flaps(run, "-flow_viscosity", "0.01", "-flow_ksp_max_it", "30")
    assert done.status != 0 and re.search(r"cell Reynolds number \d+\): refine the mesh, or use -flow_convection_form skew", done.text), done
