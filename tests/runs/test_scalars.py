"""What the flow carries: the heated cavity, arrays of discs that conduct, restart, ranks, refusals."""

import csv
import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SERIES = ROOT / "runs" / "studies" / "scalars" / "array.py"


def read_last(folder):
    with open(Path(folder) / "series.csv") as file:
        return list(csv.DictReader(file))[-1]


def test_the_heated_cavity_has_its_nusselt_number(run, tmp_path):
    """De Vahl Davis 1983: 1.118 at Ra 1e3, on both walls, and the balances close"""
    run([ROOT / "runs/heated-cavity.yaml", "-mesh_cells", "16,16", "-flow_viscosity", "0.0266458252", "-scalar_heat_conductivity", "0.0375293312", "-sim_dt", "1",
         "-sim_time", "50", "-output_dir", tmp_path / "out"])
    last = read_last(tmp_path / "out")
    assert abs(float(last["nusselt_heat_left"]) - 1.1178) < 5e-4
    assert abs(float(last["nusselt_heat_left"]) + float(last["nusselt_heat_right"])) < 1e-6
    assert float(last["scalar_error_heat"]) < 1e-10 and float(last["momentum_error"]) < 1e-6


@pytest.mark.parametrize("ranks", (1, 2, 3))
def test_an_array_of_discs_conducts_as_the_series_says(run, tmp_path, ranks):
    exact = float(subprocess.run([sys.executable, SERIES, "50", "0.4"], capture_output=True, text=True, check=True).stdout)
    run([ROOT / "runs/effective-conductivity.yaml", "-mesh_cells", "12,12", "-output_dir", tmp_path / "out"], ranks)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert abs(summary["quantities"]["scalar_effective_heat"] / exact - 1) < 1e-4


def test_a_restart_goes_on_with_the_same_bits(run, tmp_path):
    whole, half = tmp_path / "whole", tmp_path / "half"
    scene = [ROOT / "runs/heated-cavity.yaml", "-mesh_cells", "8,8", "-sim_time", "2", "-output_every", "0"]
    for folder in (whole, half):
        run([*scene, "-checkpoint_every", "4", "-output_dir", folder])
    before = read_last(whole)
    run([*scene, "-sim_restart", half / "checkpoint_4.h5", "-output_dir", half])
    after = read_last(half)
    assert {k: v for k, v in before.items() if not k.startswith("seconds")} == {k: v for k, v in after.items() if not k.startswith("seconds")}


@pytest.mark.parametrize("options, said", [
    (["-scalar_heat_bc_left_flux", "1"], "a boundary has a value, or a flux"),
    (["-scalar_heat_gradient", "1,0"], "the mesh is not periodic"),
    (["-scalar_heat_diffusivity", "1"], "remove one of the two"),
    (["-sim_steady"], "-sim_steady solves for the flow alone"),
    (["-scalar_heat_conductivty", "1"], "did you mean -scalar_heat_conductivity"),
])
def test_mistakes_are_refused_with_one_message(run, tmp_path, options, said):
    result = run([ROOT / "runs/heated-cavity.yaml", "-output_dir", tmp_path / "out", *options])
    assert result.status and said in result.err and result.err.count("error:") == 1
