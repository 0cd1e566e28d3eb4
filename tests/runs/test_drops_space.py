"""Drops in space: exact solutions at reduced size, the same on all numbers of ranks, restarts, refusals."""

import csv
import math

import pytest

SCENE = """
mesh: {cells: [8, 8, 8]}
flow: {density: 1, viscosity: 0.006454972, solver: balanced}
particle:
  groups: drop
  drop: {shape: circle, radius: 0.25, position: [0.503, 0.507, 0.496], material: fluid, density: 0.1, viscosity: 0.0006454972, surface_tension: 1}
sim: {dt: 0.0136, steps: 3}
output: {every: 0}
"""


@pytest.fixture
def drops(run, scene):
    """drops(*options, ranks=1): drops.csv and series.csv of SCENE, a drop at rest"""

    def start(*options, ranks=1, folder="out"):
        result = run([scene(SCENE), "-output_dir", folder, *options], ranks)
        assert result.status == 0, str(result)
        tables = []
        for name in ("drops", "series"):
            with open(result.folder / folder / f"{name}.csv") as file:
                tables.append([{key: text if key == "group" else float(text) for key, text in row.items()} for row in csv.DictReader(file)])
        return tables

    return start


def test_static(drops):
    """Spurious currents of a drop of two cells a radius: kinetic energy below that of a capillary number of 2e-5 in the whole box."""
    rows, series = drops("-sim_steps", "6")
    speed = 2e-5 / 0.006454972
    assert max(row["kinetic_energy"] for row in series) < 0.5 * speed**2
    assert 1 - rows[-1]["sphericity"] < 2e-6 and rows[-1]["deformation"] < 1e-4
    assert rows[-1]["volume"] == pytest.approx(4 * math.pi / 3 / 64, rel=2e-4) and abs(rows[-1]["volume_error"]) < 1e-10
    for name, place in zip("xyz", (0.503, 0.507, 0.496)):
        assert rows[-1][name] == pytest.approx(place, abs=1e-5)
