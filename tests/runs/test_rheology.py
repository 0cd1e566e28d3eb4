"""Fluids whose viscosity varies: scenes of runs/ against exact solutions, at reduced size, and mistakes of users."""
import csv
import math
import re
from pathlib import Path

import pytest

RUNS = Path(__file__).resolve().parent.parent.parent / "runs"


def last(run, scene, table, *args, **how):
    result = run([RUNS / f"{scene}.yaml", "-output_dir", "out", "-output_overwrite", *args], **how)
    assert result.status == 0, str(result)
    with open(result.folder / "out" / f"{table}.csv") as file:
        return list(csv.DictReader(file))[-1]


@pytest.mark.parametrize("n, bound", [(0.5, 2.5e-4), (0.8, 2.5e-5), (1.5, 6e-5)])
def test_channel(run, n, bound):
    """Eight cells across; the bound is what the element leaves, and twice the cells leave at least six times less."""
    force = ["-flow_rheology_index", str(n), "-flow_force", f"{(2 + 1 / n) ** n:.12g},0"]
    errors = [abs(float(last(run, "rheology-channel", "series", "-mesh_cells", f"4,{cells}", *force)["mean_velocity_x"]) - 1) for cells in (8, 16)]
    assert errors[0] < bound and errors[1] < errors[0] / 6, f"errors {errors}"


def test_channel_in_time(run):
    """Time steps with the extrapolated viscosity end at the steady state, whose mean velocity is 1 but for the mesh."""
    row = last(run, "rheology-channel", "series", "-sim_steady", "false", "-sim_dt", "0.1", "-sim_time", "15", "-mesh_cells", "4,8")
    steady = last(run, "rheology-channel", "series", "-mesh_cells", "4,8")
    assert abs(float(row["mean_velocity_x"]) / float(steady["mean_velocity_x"]) - 1) < 1e-5


def test_bingham(run):
    """The plug of a regularised yield stress creeps: the error of the mean velocity falls as the inverse of the rigid viscosity."""
    errors = [float(last(run, "rheology-bingham", "series", "-flow_rheology_max_viscosity_ratio", rigid)["mean_velocity_x"]) - 1 for rigid in ("100", "1000")]
    assert 0 < errors[1] < 0.002 and 8 < errors[0] / errors[1] < 12, f"errors {errors}"


@pytest.mark.parametrize("form", ["residual", "volume"])
def test_couette_torque(run, form):
    row = last(run, "rheology-couette", "bodies", "-mesh_cells", "27,27", "-couple_force", form)
    exact = 2 * math.pi * (4 / (1 - 2**-4)) ** 0.5
    bound = {"residual": 2e-3, "volume": 2e-2}[form]
    assert abs(-float(row["torque_z"]) / exact - 1) < bound, f"torque {row['torque_z']}, exact {exact}"


MISTAKES = [
    (["-flow_rheology", "cross", "-flow_rheology_index", "1.5"], "Cross"),
    (["-flow_rheology", "bingham"], "needs -flow_rheology_yield"),
    (["-flow_rheology_viscosity_bounds", "2,1e3"], "-flow_rheology_viscosity_bounds"),
    (["-flow_rheology", "carreau", "-flow_rheology_viscosity_infinity", "3"], "below -flow_viscosity"),
    (["-flow_rheology_yield", "3"], "-flow_rheology bingham or herschel_bulkley"),
    (["-flow_rheology", "jelly"], "herschel_bulkley"),
]


@pytest.mark.parametrize("args, phrase", MISTAKES)
def test_mistakes(run, args, phrase):
    result = run([RUNS / "rheology-channel.yaml", "-output_dir", "out", *args])
    assert result.status != 0 and phrase in str(result), str(result)


@pytest.mark.parametrize("index, ranks", [(0.5, 1), (1.5, 2)])
def test_penalty_takes_viscosity_of_fluid(run, index, ranks):
    """Cells that a body cuts: within 0.3 % with 6 cells a radius, where their own rates of strain give 2 to 3 %."""
    row = last(run, "rheology-couette", "bodies", "-mesh_cells", "30,30", "-couple_method", "penalty", "-flow_rheology_index", str(index), ranks=ranks)
    exact = 2 * math.pi * (2 / (index * (1 - 2 ** (-2 / index)))) ** index
    assert abs(-float(row["torque_z"]) / exact - 1) < 3e-3, f"torque {row['torque_z']}, exact {exact}"


def test_snap_follows_what_it_can(run):
    """A ring that reaches out of the domain as one inside; one that ends beside a side is held by the penalty, which is said once."""
    words = ["-mesh_cells", "30,30", "-flow_rheology_index", "0.8"]
    torque = [float(last(run, "rheology-couette", "bodies", "-particle_container_outer", outer, *words)["torque_z"]) for outer in ("2.3", "3.6")]
    assert torque[0] == pytest.approx(torque[1], rel=1e-9)
    thin = ["-particle_container_inner", "2.4", "-particle_container_outer", "2.6"]
    beside = run([RUNS / "rheology-couette.yaml", "-output_dir", "beside", *thin, *words])
    assert beside.status == 0 and beside.text.count("aligned cannot follow body 0 (group 'container')") == 1, str(beside)


CARREAU = ["-flow_rheology", "carreau", "-flow_rheology_time", "30", "-flow_rheology_index", "0.2", "-flow_rheology_viscosity_infinity", "1e-4"]


@pytest.mark.parametrize("method, convection, most, total", [("aligned", "false", 15, 115), ("penalty", "false", 33, 200), ("penalty", "true", 33, 290)])
def test_steady_iterations(run, method, convection, most, total):
    """Linear iterations of every correction in a steady problem with viscosities of a ratio 1e4; cut cells settle between corrections."""
    words = ["-couple_method", method, "-flow_solver", "balanced", "-flow_convection", convection, *CARREAU]
    result = run([RUNS / "rheology-couette.yaml", "-output_dir", "out", "-mesh_cells", "30,30", *words])
    counts = [int(n) for n in re.findall(r"(\d+) linear iterations", result.text)]
    assert result.status == 0 and len(counts) <= most and max(counts) < 15 and sum(counts) < total, f"iterations {counts}\n{result}"


@pytest.mark.parametrize(
    "scene, ranks, options, total",
    [
        ("rheology-channel", 1, ["-mesh_cells", "4,64"], 50),
        ("rheology-bingham", 2, ["-flow_rheology_max_viscosity_ratio", "10000"], 125),
        ("rheology-couette", 1, ["-mesh_cells", "30,30"], 30),
    ],
)
def test_iterations_of_laws(run, scene, ranks, options, total):
    """Linear iterations where viscosities of the law differ by ten thousand and more: what the velocity solve is for."""
    result = run([RUNS / f"{scene}.yaml", "-output_dir", "out", "-flow_solver", "balanced", *options], ranks=ranks)
    counts = [int(n) for n in re.findall(r"(\d+) linear iterations", result.text)]
    assert result.status == 0 and max(counts) < 15 and sum(counts) < total, f"iterations {counts}\n{result}"


@pytest.mark.parametrize("method", ["aligned", "penalty"])
def test_iterations_in_time(run, method):
    """A disc falls in a fluid that is a thousand times as stiff at rest: 13 to 14 iterations a step with a mass that knows densities alone, 7 to 8."""
    words = ["-couple_method", method, "-flow_solver", "balanced", "-flow_viscosity", "1", "-flow_rheology_yield", "0.2"]
    result = run([RUNS / "rheology-yield.yaml", "-output_dir", "out", "-mesh_cells", "28,84", "-sim_dt", "0.04", "-sim_time", "0.4", *words])
    with open(result.folder / "out" / "series.csv") as f:
        counts = [int(row["outer_iterations"]) for row in csv.DictReader(f)]
    assert result.status == 0 and len(counts) == 10 and max(counts) < 15 and sum(counts) < 100, f"iterations {counts}\n{result}"


def test_yield_stress_in_stages(run):
    """A plug three thousand times as stiff as what is sheared, in a box of many plugs' widths, where Newton's method alone finds nothing."""
    words = ["-mesh_upper", "0.5,1", "-mesh_cells", "3,32", "-flow_rheology_max_viscosity_ratio", "3000"]
    row = last(run, "rheology-bingham", "series", *words)
    assert float(row["mean_velocity_x"]) == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize(
    "ranks, options, bound",
    [
        (1, ["-flow_rheology_index", "0.3"], 10),
        (2, ["-flow_rheology", "herschel_bulkley", "-flow_rheology_index", "1", "-flow_rheology_yield", "5"], 8),
    ],
)
def test_penalty_in_stiff_fluids(run, ranks, options, bound):
    """The penalty of a fluid that is a thousand times as stiff at rest: Newton's method settles what cut cells take from the fluid beside them."""
    words = ["-couple_method", "penalty", "-mesh_cells", "30,30", "-flow_solver", "balanced", *options]
    result = run([RUNS / "rheology-couette.yaml", "-output_dir", "out", *words], ranks=ranks)
    counts = [int(n) for n in re.findall(r"(\d+) linear iterations", result.text)]
    assert result.status == 0 and max(counts) < bound and "pseudo-time steps from" not in result.text, f"iterations {counts}\n{result}"
    if "-flow_rheology_yield" in options:
        with open(result.folder / "out" / "bodies.csv") as file:
            torque = -float(list(csv.DictReader(file))[-1]["torque_z"])
        assert torque == pytest.approx(68.4475, rel=0.025)  # sheared up to the radius 1.476, 3 cells away


def test_power_in_stages(run):
    """A stress as the tenth root of the rate: from the jump at the wall Newton's method alone ends in pseudo-time, which finds nothing."""
    row = last(run, "rheology-channel", "series", "-mesh_cells", "4,16", "-flow_rheology_index", "0.1", "-flow_force", f"{12**0.1:.12g},0")
    assert float(row["mean_velocity_x"]) == pytest.approx(1, abs=5e-3)


def test_unsettled(run):
    """What stops a run whose cut cells do not settle is said with what helps."""
    words = ["-flow_rheology", "herschel_bulkley", "-flow_rheology_yield", "5", "-couple_method", "penalty", "-mesh_cells", "20,20"]
    result = run([RUNS / "rheology-couette.yaml", "-output_dir", "out", "-flow_snes_max_it", "5", "-flow_pseudo_steps", "0", *words])
    assert result.status != 0 and "cells that bodies cut" in str(result) and "-couple_method aligned" in str(result), str(result)
