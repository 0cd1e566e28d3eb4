"""Elastic particles: scenes of runs/ against exact and published values at reduced size, the same on all numbers of ranks, restarts, refusals."""
import csv
import math

import pytest

from conftest import ROOT

RUNS = ROOT / "runs"
SOFT = ["-mesh_coarsest", "4,4", "-mesh_growth", "1,1", "-mesh_focus_h", "0.4", "-particle_soft_solid_size", "0.5", "-output_every", "0"]


@pytest.fixture
def rows(run):
    """rows(scene, *options, ranks=1): series.csv of a scene of runs/"""

    def start(scene, *options, ranks=1, folder="out"):
        result = run([RUNS / f"{scene}.yaml", "-output_dir", folder, *options], ranks)
        assert result.status == 0, str(result)
        with open(result.folder / folder / "series.csv") as file:
            return [{name: float(text) for name, text in row.items()} for row in csv.DictReader(file)]

    return start


def test_csm2(rows):
    """Turek & Hron: -.4690, -16.97 mm"""
    last = rows("csm", "-sim_dt", "1000", "-sim_time", "2000", "-particle_flag_shear_modulus", "2e6")[-1]
    assert last["watch_x_flag_1"] == pytest.approx(-0.4690e-3, rel=0.006)
    assert last["watch_y_flag_1"] == pytest.approx(-16.97e-3, rel=0.005)


@pytest.mark.parametrize("method, bar", [("penalty", 0.06), ("aligned", 0.02)])
def test_shear(rows, method, bar):
    """The exact deformation .18655 and inclination .6010, on a coarse mesh; what the disc exerts is in the balance of momentum."""
    series = rows("soft-disc-shear", *SOFT, "-sim_time", "2.5", "-couple_method", method)
    assert series[-1]["solid_taylor_soft"] == pytest.approx(0.18655, rel=bar)
    assert series[-1]["solid_inclination_soft"] == pytest.approx(0.6010, abs=0.02)
    assert max(row["momentum_error"] for row in series) < 1e-9
    assert max(abs(row["solid_volume_error_soft"]) for row in series) < 3e-3


METHODS = pytest.mark.parametrize("method", ["penalty", "aligned"])


@METHODS
def test_ranks(rows, method):
    """The same on 1, 2 and 3 ranks, immersed and with the mesh lined up"""
    one, *others = (rows("soft-disc-shear", *SOFT, "-sim_steps", "3", "-couple_method", method, ranks=ranks, folder=f"r{ranks}") for ranks in (1, 2, 3))
    for other in others:
        for name in ("solid_taylor_soft", "solid_x_soft", "solid_energy_soft", "kinetic_energy"):
            assert other[-1][name] == pytest.approx(one[-1][name], rel=1e-7, abs=1e-9), name


@METHODS
def test_restart(rows, method):
    """A run that stops and goes on has the bits of one that does not stop."""
    whole = rows("soft-disc-shear", *SOFT, "-sim_steps", "4", "-checkpoint_every", "2", "-couple_method", method, folder="whole")
    part = ["soft-disc-shear", *SOFT, "-checkpoint_every", "2", "-couple_method", method]
    rows(*part, "-sim_steps", "2", folder="part")
    again = rows(*part, "-sim_steps", "4", "-sim_restart", "latest", folder="part")
    drop = {"wall", "seconds"}
    assert len(again) == 4 and all(math.isfinite(value) for value in again[-1].values())
    for name in again[-1]:
        if not any(word in name for word in drop):
            assert again[-1][name] == whole[-1][name], name


FSI = ["-flow_time", "bdf2", "-flow_bc_left_ramp", "0.5", "-sim_dt", "0.05"]


def test_fsi1_restart(rows):
    """A solid that is held, whose material the mesh follows: a restart has the same bits."""
    whole = rows("fsi1", *FSI, "-sim_steps", "3", "-checkpoint_every", "2", folder="whole")[-1]
    rows("fsi1", *FSI, "-sim_steps", "2", "-checkpoint_every", "2", folder="part")
    again = rows("fsi1", *FSI, "-sim_steps", "3", "-checkpoint_every", "2", "-sim_restart", "latest", folder="part")[-1]
    for name in ("watch_x_flag_1", "watch_y_flag_1", "solid_force_x_flag", "kinetic_energy"):
        assert again[name] == whole[name], name


@pytest.mark.parametrize(
    "scene, options, message",
    [
        ("soft-disc-shear", ["-monitor_energy", "true"], "does not count the energy of elastic particles"),
        ("soft-disc-shear", ["-flow_solver", "fast"], "-flow_solver fast"),
        ("soft-disc-shear", ["-flow_time", "cn"], "-flow_time be or bdf2"),
        ("soft-disc-shear", ["-particle_soft_poisson", "0.4", "-flow_solver", "balanced"], "needs -flow_solver direct"),
        ("soft-disc-shear", ["-particle_soft_place", "random"], "one a group"),
        ("soft-disc-shear", ["-particle_soft_watch", "3,3"], "away from the solid"),
        ("csm", ["-particle_flag_clamp", "x-3"], "holds no node"),
        ("csm", ["-particle_flag_poisson", "0.5"], "below 0.5"),
        ("csm", ["-particle_flag_solid_cells", "1,1"], "cannot follow its shape"),
    ],
)
def test_refusals(run, scene, options, message):
    result = run([RUNS / f"{scene}.yaml", "-output_dir", "out", "-sim_steps", "1", *options])
    assert result.status and message in result.err and result.err.count("error:") == 1, str(result)
