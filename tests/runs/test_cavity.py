"""Steady lid-driven cavity at Re 1000 against the spectral values of Botella & Peyret 1998, read by the script of the study runs/studies/flow-solver.

Observed there: errors of the extrema 1.0 to 1.6 % at 32 x 32 and 0.1 % at 64 x 64 cells, rates 3.7 to 3.9."""
import csv
import importlib.util
import math

from conftest import ROOT

RATE = 3


def load_study():
    spec = importlib.util.spec_from_file_location("cavity", ROOT / "runs/studies/flow-solver/orders/cavity.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_cavity(run):
    study = load_study()
    error = {}
    for cells, ranks, bound in (32, 2, 0.02), (64, 1, 0.002):
        folder = f"cavity_{cells}"
        result = run([ROOT / "runs/cavity-re1000.yaml", "-mesh_cells", f"{cells},{cells}", "-output_dir", folder], ranks)
        assert result.status == 0, str(result)
        found = study.measure(study.read_velocity(result.folder / folder, cells))
        for name in study.ERRORS:
            error[name, cells] = abs(found[name] / study.REFERENCE[name] - 1)
            assert error[name, cells] < bound, f"{name} at {cells} x {cells} cells: {found[name]}, expected {study.REFERENCE[name]}"
        for name in "u_min_y", "v_max_x", "v_min_x", "psi_x", "psi_y":
            assert abs(found[name] - study.REFERENCE[name]) < 0.2 / cells, f"{name} at {cells} x {cells} cells: {found[name]}, expected {study.REFERENCE[name]}"
    for name in study.ERRORS:
        rate = math.log2(error[name, 32] / error[name, 64])
        assert rate > RATE, f"{name}: errors {error[name, 32]:g} and {error[name, 64]:g} give rate {rate:.2f}, expected more than {RATE}"


def test_outer_iterations(run):
    """With large viscosity the iterations do not grow with the mesh (13, 13, 12 from 8 to 64 cells); with large time steps convection costs no more."""
    for cells, options, most in (8, ["-flow_viscosity", "100", "-sim_dt", "0.1"], 14), (32, ["-flow_viscosity", "100", "-sim_dt", "0.1"], 15), (16, ["-flow_viscosity", "1e-6", "-sim_dt", "0.0625"], 9):
        folder = f"iterations_{cells}"
        result = run([ROOT / "runs/bench/cavity.yaml", "-mesh_cells", f"{cells},{cells}", "-sim_steps", "3", "-output_dir", folder, *options], 2)
        assert result.status == 0, str(result)
        with open(result.folder / folder / "series.csv") as file:
            steps = [int(row["outer_iterations"]) for row in csv.DictReader(file)]
        assert max(steps[1:]) <= most and steps[0] <= 15, f"{cells} x {cells} cells, {' '.join(options)}: {steps} outer iterations, at most {most} expected"


def test_single_sweep_is_stable(run):
    """Solver fast at a viscous number of 1e-4 and CFL 0.06: with the whole correction of the pressure the energy grew a thousandfold in 16 steps."""
    energy = {}
    for solver in "fast", "balanced":
        result = run([ROOT / "runs/bench/cavity.yaml", "-mesh_cells", "32,32", "-flow_viscosity", "1e-4", "-sim_steps", "60", "-flow_solver", solver, "-output_dir", solver])
        assert result.status == 0, str(result)
        with open(result.folder / solver / "series.csv") as file:
            energy[solver] = float(list(csv.DictReader(file))[-1]["kinetic_energy"])
    assert abs(energy["fast"] / energy["balanced"] - 1) < 0.01, f"kinetic energy {energy}: expected to agree within 1 %"
