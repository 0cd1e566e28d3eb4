"""A body that the aligned mesh cannot follow is held by the penalty for as long as that may last: one boundary method, no jumps of its forces."""
import csv
import json

FOIL = """\
mesh: {cells: [32, 24], lower: [-1, -0.75], upper: [1, 0.75]}
flow: {density: 1, viscosity: 0.1}
couple: {method: aligned}
particle: {groups: foil, foil: {shape: airfoil, chord: 1, thickness: 0.16, position: [0, 0]}}
sim: {dt: 0.004}
output: {every: 0, progress: 100}
"""


def held(run, scene, velocity, steps):
    result = run([scene(FOIL), "-particle_foil_motion", "constant", "-particle_foil_velocity", velocity, "-sim_steps", steps, "-output_dir", "out", "-output_overwrite"])
    assert result.status == 0, result
    assert result.text.count("-couple_method aligned cannot follow body 0") == 1, result
    summary = json.loads((result.folder / "out" / "summary.json").read_text())
    with open(result.folder / "out" / "series.csv") as file:
        rows = [int(row["aligned_penalty_bodies"]) for row in csv.DictReader(file)]
    assert summary["quantities"]["aligned_penalty_bodies_steps"] == sum(rows), summary
    return rows


def test_no_change_from_step_to_step(run, scene):
    """On its own the mesh would follow in steps 6 to 10, 22 to 24 and 37 to 40."""
    assert held(run, scene, "0, 1", "26") == 26 * [1]


def test_a_body_that_has_come_to_rest_is_followed(run, scene):
    rows = held(run, scene, "0, t < 0.024 ? 1 : 0", "10")
    assert rows == 7 * [1] + 3 * [0], rows
