"""What the flow carries: the heated cavity, bodies that conduct or heat, restart, ranks, refusals."""

import csv
import functools
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SERIES = ROOT / "runs" / "studies" / "scalars" / "array.py"

# A body in a box on whose sides the value is that of free space, strength times -log r or 1/r
BODY = """mesh: {{cells: {cells}, lower: {lower}, upper: {upper}}}
flow: {{density: 1, viscosity: 1}}
scalars: heat
scalar:
  heat: {{conductivity: 1}}
{sides}particle:
  groups: body
  body: {{shape: circle, radius: 0.4, position: {place}, free: none, heat: {{{heat}}}}}
couple: {{method: penalty}}
sim: {{steady: true}}
output: {{every: 0}}
"""


def in_free_space(dim, cells, strength, heat):
    r = "sqrt((x-0.013)^2+(y-0.007)^2" + ("+(z-0.01)^2)" if dim == 3 else ")")
    value = f"{strength}/{r}" if dim == 3 else f"-{strength}*log({r})"
    sides = "".join(f'  heat_bc_{side}: {{value: "{value}"}}\n' for side in "left right bottom top front back".split()[:2 * dim])
    return BODY.format(cells=[cells] * dim, lower=[-1] * dim, upper=[1] * dim, sides=sides, place=[0.013, 0.007, 0.01][:dim], heat=heat)


def read_steps(folder):
    with open(Path(folder) / "series.csv") as file:
        return list(csv.DictReader(file))


def read_last(folder):
    return read_steps(folder)[-1]


DISPERSES = """mesh: {cells: [3, 16], upper: [1.5, 1], periodic: [x]}
flow: {density: 1, viscosity: 1, initial: poiseuille, velocity: [1, 0], rate: [1, 0]}
scalars: heat
scalar: {heat: {conductivity: 0.1, gradient: [1, 0]}}
sim: {dt: 0.2, time: 4}
output: {every: 0}
"""


def test_a_flow_between_plates_disperses_as_taylor_and_aris_say(run, scene, tmp_path):
    """Mean velocity 1 between plates 1 apart, diffusivity .1: 1 + 2/105 Pe^2 by half the distance, Pe 5"""
    run([scene(DISPERSES), "-output_dir", tmp_path / "out"])
    row = read_last(tmp_path / "out")
    assert float(row["scalar_effective_heat"]) == pytest.approx(0.1 * (1 + 2 / 105 * 25), rel=1e-4)
    assert float(row["scalar_error_heat"]) < 1e-10


def test_a_hot_disc_in_a_cold_square_heats_it(run, tmp_path):
    """As much leaves through the walls; converged to the digits given (runs/studies/scalars)"""
    run([ROOT / "runs/cylinder-in-cavity.yaml", "-sim_time", "16", "-output_every", "0", "-output_dir", tmp_path / "out"])
    row = read_last(tmp_path / "out")
    walls = sum(float(row[f"scalar_flux_heat_{side}"]) for side in ("left", "right", "bottom", "top"))
    assert float(row["scalar_bodies_heat"]) / 2 / 0.01186781658 == pytest.approx(3.2257, rel=1e-3)
    assert walls == pytest.approx(-float(row["scalar_bodies_heat"]), rel=1e-4)


@pytest.mark.parametrize("method, most", [("nodal", 0.04), ("penalty", 0.03), ("aligned", 1e-4)])
def test_a_disc_in_a_hot_fluid_is_pushed_as_archimedes_says(run, scene, tmp_path, method, most):
    """As hot as the fluid all around, which buoyancy of 1 pulls up at rest: its pressure pushes the disc down by its area, the walls up by theirs."""
    name = scene("""mesh: {cells: [16, 16]}
flow: {density: 1, viscosity: 0.1, gravity: [0, -1]}
scalars: heat
scalar:
  heat: {conductivity: 0.1, expansion: 1, initial: 1}
particle:
  groups: disc
  disc: {shape: circle, radius: 0.2, position: [0.5, 0.5], free: none, heat: {condition: value, value: 1}}
sim: {dt: 0.5, steps: 2}
""")
    result = run([name, "-output_dir", "out", "-couple_method", method])
    assert result.status == 0, str(result)
    with open(tmp_path / "out" / "bodies.csv") as file:
        assert float(list(csv.DictReader(file))[-1]["force_y"]) == pytest.approx(-0.04 * math.pi, rel=most)
    last = read_last(tmp_path / "out")
    assert sum(float(last[f"wall_force_{side}_y"]) for side in ("left", "right", "bottom", "top")) == pytest.approx(1, abs=0.2 * most)
    assert float(last["momentum_error"]) < 1e-12


def test_the_heated_cavity_has_its_nusselt_number(run, tmp_path):
    """De Vahl Davis 1983: 1.118 at Ra 1e3, on both walls, and the balances close"""
    run([ROOT / "runs/heated-cavity.yaml", "-mesh_cells", "16,16", "-flow_viscosity", "0.0266458252", "-scalar_heat_conductivity", "0.0375293312", "-sim_dt", "1",
         "-sim_time", "50", "-output_dir", tmp_path / "out"])
    last = read_last(tmp_path / "out")
    assert abs(float(last["nusselt_heat_left"]) - 1.1178) < 5e-4
    assert abs(float(last["nusselt_heat_left"]) + float(last["nusselt_heat_right"])) < 1e-6
    assert float(last["scalar_error_heat"]) < 1e-10 and float(last["momentum_error"]) < 1e-6


@functools.cache
def series(ratio, fraction):
    return float(subprocess.run([sys.executable, SERIES, str(ratio), str(fraction)], capture_output=True, text=True, check=True).stdout)


@pytest.mark.parametrize("ranks", (1, 2, 3))
def test_an_array_of_discs_conducts_as_the_series_says(run, tmp_path, ranks):
    run([ROOT / "runs/effective-conductivity.yaml", "-mesh_cells", "12,12", "-output_dir", tmp_path / "out"], ranks)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert abs(summary["quantities"]["scalar_effective_heat"] / series(50, 0.4) - 1) < 1e-4


@pytest.mark.parametrize("method, most", [("aligned", 5e-4), ("penalty", 5e-3), ("nodal", 5e-3)])
def test_an_array_of_spheres_conducts_as_the_series_says(run, scene, tmp_path, method, most):
    """Rayleigh 1892 with the term in f^(10/3), ratio 10, radius .3: at 4.8 cells a diameter"""
    f, k = 4 / 3 * math.pi * 0.3**3, 10
    exact = 1 - 3 * f / ((2 + k) / (1 - k) + f - 1.306 * (1 - k) / (4 / 3 + k) * f ** (10 / 3))
    text = """mesh: {cells: [8, 8, 8], periodic: [x, y, z]}
flow: {density: 1, viscosity: 1}
scalars: heat
scalar: {heat: {conductivity: 1, gradient: [1, 0, 0]}}
particle:
  groups: sphere
  sphere: {shape: circle, radius: 0.3, position: [0.5, 0.5, 0.5], free: none, heat: {conductivity: 10}}
sim: {steady: true}
"""
    run([scene(text), "-couple_method", method, "-output_dir", tmp_path / "out"])
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert abs(summary["quantities"]["scalar_effective_heat"] / exact - 1) < most


@pytest.mark.parametrize("dim, cells, most, method", [(2, 40, 1e-2, "penalty"), (3, 10, 1e-2, "penalty"), (2, 20, 1e-5, "aligned"), (3, 8, 2e-3, "aligned")])
@pytest.mark.parametrize("condition", ["flux", "transfer"])
def test_a_body_heats_the_fluid_around_it(run, scene, tmp_path, condition, dim, cells, most, method):
    """With a flux or in exchange, against the solution of free space: the whole heat, and the highest value, inside by at most a cell"""
    a, h = 0.4, 5
    slope, value = (a**-2, 1 / a) if dim == 3 else (1 / a, -math.log(a))  # of 1/r, -log r at the surface
    strength = h / (slope + h * value) if condition == "transfer" else 1 / slope
    heat = f"condition: {condition}, " + ("transfer: 5, value: 1" if condition == "transfer" else "flux: 1")
    run([scene(in_free_space(dim, cells, strength, heat)), "-couple_method", method, "-output_dir", tmp_path / "out"])
    last = read_last(tmp_path / "out")
    whole = strength * 2 * (dim - 1) * math.pi
    assert abs(float(last["scalar_source_heat"]) / whole - 1) < most
    assert float(last["scalar_from_heat_body"]) == pytest.approx(float(last["scalar_source_heat"]), rel=1e-10)
    assert abs(sum(float(v) for k, v in last.items() if k.startswith("scalar_flux_heat")) / whole + 1) < most
    assert float(last["scalar_error_heat"]) < 1e-8
    inside = a if method == "aligned" else a - 2.0 / cells * math.sqrt(dim)
    assert value * strength * 0.97 < float(last["scalar_max_heat"]) < strength * 1.1 * (1 / inside if dim == 3 else -math.log(inside))


@pytest.mark.parametrize("position", ["[0.41, 0.43]", "[0.5, 0.5]"])
def test_a_body_in_cells_much_larger_than_the_smallest_heats(run, scene, tmp_path, position):
    """Within one of them, and around a corner of four, whose centres are farther than several of the smallest cells"""
    text = f"""mesh: {{cells: [8, 8], lower: [-1, -1], upper: [1, 1], levels: 4, refine: corner, box: {{corner: {{corners: [-1, -1, -0.9, -0.9]}}}}}}
flow: {{density: 1, viscosity: 1}}
scalars: heat
scalar: {{heat: {{conductivity: 1, bc: {{left: {{value: 0}}}}}}}}
particle:
  groups: body
  body: {{shape: circle, radius: 0.05, position: {position}, free: none, heat: {{source: 1000}}}}
couple: {{method: penalty}}
sim: {{steady: true}}
"""
    run([scene(text), "-output_dir", tmp_path / "out"])
    assert float(read_last(tmp_path / "out")["scalar_source_heat"]) == pytest.approx(1000 * math.pi * 0.05**2, rel=0.05)


CARRIED = """mesh: {cells: [32, 32], upper: [2, 2], periodic: [x, y]}
flow: {density: 1, viscosity: 0.1, velocity: [0.5, 0], initial: uniform}
scalars: heat
scalar: {heat: {conductivity: 0.01, initial: "exp(-((x-1)^2+(y-1)^2)/0.09)"}}
particle:
  groups: disc
  disc: {shape: circle, radius: 0.25, density: 1, position: [1, 1], velocity: [0.5, 0], free: none, heat: {conductivity: 0.1, capacity: 3}}
sim: {dt: 0.04, time: 1}
output: {every: 0}
"""


@pytest.mark.parametrize("ranks, method", [(1, "penalty"), (1, "nodal"), (2, "penalty"), (3, "penalty"), (1, "aligned"), (2, "aligned"), (3, "aligned")])
def test_a_body_that_moves_keeps_its_heat(run, scene, tmp_path, ranks, method):
    """A warm disc goes with the fluid: diffusion in its frame, .62931 at its centre (runs/studies/scalars/radial.py), and what it covers is given back"""
    run([scene(CARRIED), "-couple_method", method, "-output_dir", tmp_path / "out"], ranks)
    rows = read_steps(tmp_path / "out")
    heat = [float(row["scalar_content_heat"]) for row in rows]
    assert abs(float(rows[-1]["scalar_max_heat"]) / 0.62931 - 1) < (1e-3 if method == "aligned" else 5e-3)
    assert abs(heat[-1] / 0.565849 - 1) < 2e-3 and max(abs(h / heat[8] - 1) for h in heat[8:]) < 6e-5
    assert max(float(row["scalar_error_heat"]) for row in rows) < 1e-10


COVERS = """mesh: {cells: [10, 10], upper: [10, 10], periodic: [x, y]}
flow: {density: 1, viscosity: 1000}
scalars: heat
scalar: {heat: {conductivity: 24, initial: 1}}
particle:
  groups: disc
  disc: {shape: circle, radius: 3, density: 1, position: [4.04, 5.07], motion: oscillate, motion_amplitude: [0.32, 0.12], motion_period: [0.8, 0.8],
         heat: {condition: transfer, transfer: 9, value: 0}}
sim: {dt: 0.01, steps: 5}
couple: {method: penalty}
output: {every: 0}
"""


def test_books_close_where_a_body_covers_nodes(run, scene, tmp_path):
    """The fourth step covers nodes that the preconditioner, of the step before, still couples: what that leaves there is no heat (1.1e-7 was)"""
    run([scene(COVERS), "-output_dir", tmp_path / "out"])
    assert max(float(row["scalar_error_heat"]) for row in read_steps(tmp_path / "out")) < 1e-10


LUMPED = """mesh: {kind: disc, radius: 1, resolution: 8}
flow: {density: 1, viscosity: 1}
scalars: heat
scalar: {heat: {conductivity: 1, capacity: 0.001, initial: "log(sqrt(x^2+y^2)+1e-9)/log(0.4)", bc: {outer: {value: 0}}}}
particle:
  groups: body
  body: {shape: circle, radius: 0.4, position: [0, 0], free: none, heat: {condition: lumped, capacity: 100, initial: 1}}
sim: {dt: 0.25, time: 8}
output: {every: 0}
"""


@pytest.mark.parametrize("method, most, ranks", [("aligned", 1e-4, 1), ("aligned", 1e-4, 3), ("penalty", 5e-3, 2), ("nodal", 0.06, 1)])
def test_a_lumped_body_cools_exponentially(run, scene, tmp_path, method, most, ranks):
    """Rate 2 k/(c a^2 log(R/a)) through a ring that holds nothing; a step of dt has (rate dt)^2/3 less of it. A disc of the conductivity
    100 k, Biot number k Nu/100 k = .01, cools as one of a single value"""
    run([scene(LUMPED), "-couple_method", method, "-output_dir", tmp_path / "out"], ranks)
    rows = read_steps(tmp_path / "out")
    exact = 2 / (100 * 0.4**2 * math.log(1 / 0.4))
    rate = -math.log(float(rows[-1]["scalar_max_heat"]) / float(rows[7]["scalar_max_heat"])) / 6
    assert rate / exact - (exact * 0.25) ** 2 / 3 == pytest.approx(1, abs=most)
    assert max(float(row["scalar_error_heat"]) for row in rows) < 1e-10
    if method == "aligned":
        run([scene(LUMPED.replace("condition: lumped", "conductivity: 100")), "-couple_method", method, "-output_dir", tmp_path / "conducts"], ranks)
        content = [float(read_last(tmp_path / name)["scalar_content_heat"]) for name in ("out", "conducts")]
        assert content[1] / content[0] == pytest.approx(1, abs=0.01)


def test_a_steady_state_beside_a_lumped_body_has_one_level(run, scene, tmp_path):
    """What it exchanges says nothing of the level where boundaries give none: one node keeps its value. The bound was set after 1.2e-3 was seen"""
    text = LUMPED.replace("kind: disc, radius: 1, resolution: 8", "cells: [16, 16], lower: [-1, -1], upper: [1, 1]").replace("dt: 0.25, time: 8", "steady: true")
    text = text.replace("log(sqrt(x^2+y^2)+1e-9)/log(0.4)", "1").replace("outer: {value: 0}", "left: {flux: 1}, right: {flux: -1}")
    means = []
    for method in ("aligned", "penalty"):
        run([scene(text), "-couple_method", method, "-output_dir", tmp_path / method])
        means.append(float(read_last(tmp_path / method)["scalar_mean_heat"]))
    assert means[1] == pytest.approx(means[0], abs=4e-3)


@pytest.mark.parametrize("method, ranks, most", [("aligned", 3, 1e-4), ("penalty", 2, 5e-4)])
def test_a_lumped_body_that_moves_keeps_heat(run, scene, tmp_path, method, ranks, most):
    """It goes with the fluid, and cools as at rest; nothing is lost"""
    ends = []
    for speed in ("0.5", "0"):
        text = CARRIED.replace("conductivity: 0.1, capacity: 3", "condition: lumped, capacity: 3, initial: 1").replace("[0.5, 0]", f"[{speed}, 0]")
        run([scene(text), "-couple_method", method, "-output_dir", tmp_path / speed], ranks)
        rows = read_steps(tmp_path / speed)
        heat = [float(row["scalar_content_heat"]) for row in rows]
        assert max(abs(h / heat[8] - 1) for h in heat[8:]) < most
        assert max(float(row["scalar_error_heat"]) for row in rows) < 1e-10
        ends.append(float(rows[-1]["scalar_max_heat"]))
    assert ends[0] == pytest.approx(ends[1], rel=2e-3)


@pytest.mark.parametrize("heat, ranks", [("condition: flux, flux: 0.1", 1), ("condition: transfer, transfer: 0.5, value: 2", 3)])
def test_a_body_that_moves_lined_up_heats_through_its_surface(run, scene, tmp_path, heat, ranks):
    """It goes with the fluid, whose heat grows as around one at rest, by all of the flux through the circle; books close"""
    grown = []
    for speed in ("0.5", "0"):
        text = CARRIED.replace("conductivity: 0.1, capacity: 3", heat).replace("[0.5, 0]", f"[{speed}, 0]")
        run([scene(text), "-couple_method", "aligned", "-output_dir", tmp_path / speed], ranks)
        rows = read_steps(tmp_path / speed)
        assert max(float(row["scalar_error_heat"]) for row in rows) < 1e-10
        grown.append(float(rows[-1]["scalar_content_heat"]) - float(rows[7]["scalar_content_heat"]))
    assert grown[0] == pytest.approx(grown[1], rel=2e-3)
    if "flux" in heat:
        assert grown[0] == pytest.approx(0.1 * 2 * math.pi * 0.25 * 0.04 * (len(rows) - 8), rel=2e-4)


COOLS = """mesh: {cells: [10, 10, 10], lower: [-2, -2, -2], upper: [2, 2, 2]}
flow: {density: 1, viscosity: 1}
scalars: heat
scalar: {heat: {conductivity: 1, initial: 0}}
particle:
  groups: s
  s: {shape: circle, radius: 1, position: [0, 0, 0], free: none, heat: {conductivity: 5, capacity: 2, initial: 1}}
sim: {dt: 0.01, time: 0.15}
output: {every: 0}
"""


@pytest.mark.parametrize("method, most, heat", [("aligned", 5e-3, 1e-3), ("penalty", 0.03, 0.04)])
def test_a_hot_sphere_cools(run, scene, tmp_path, method, most, heat):
    """Carslaw & Jaeger 13.9, two materials, by runs/studies/scalars/radial.py: .57635 at the centre; it begins with its heat"""
    run([scene(COOLS), "-couple_method", method, "-output_dir", tmp_path / "out"])
    last = read_last(tmp_path / "out")
    assert float(last["scalar_max_heat"]) == pytest.approx(0.57635, rel=most)
    assert float(last["scalar_content_heat"]) == pytest.approx(8 * math.pi / 3, rel=heat)


@pytest.mark.parametrize("heat, highest", [("conductivity: 1, capacity: 3", 0.6073), ("condition: value, value: 2", 2)])
def test_a_sphere_carries_its_heat(run, scene, tmp_path, heat, highest):
    """In space, with a uniform flow: in its frame diffusion alone, .6073 at the centre (radial.py)"""
    text = CARRIED.replace("[32, 32]", "[10, 10, 10]").replace("[2, 2]", "[2, 2, 2]").replace("[x, y]", "[x, y, z]").replace("[0.5, 0]", "[0.5, 0, 0]")
    text = text.replace("[1, 1]", "[1, 1, 1]").replace("conductivity: 0.1, capacity: 3", heat).replace("conductivity: 0.01", "conductivity: 0.1")
    text = text.replace("(y-1)^2)/0.09", "(y-1)^2+(z-1)^2)/0.36").replace("0.25", "0.5")
    run([scene(text), "-couple_method", "aligned", "-sim_dt", "0.02", "-sim_time", "0.2", "-output_dir", tmp_path / "out"])
    rows = read_steps(tmp_path / "out")
    assert float(rows[-1]["scalar_max_heat"]) == pytest.approx(highest, rel=5e-3)
    assert max(float(row["scalar_error_heat"]) for row in rows) < 1e-10
    if "conductivity" in heat:
        assert float(rows[-1]["scalar_content_heat"]) == pytest.approx(float(rows[0]["scalar_content_heat"]), rel=1e-5)


@pytest.mark.parametrize("heat, method", [("conductivity: 0.1, capacity: 3", "penalty"), ("conductivity: 0.1, capacity: 3", "aligned"),
                                          ("condition: flux, flux: 0.1", "penalty"), ("condition: value, value: 2", "nodal"),
                                          ("condition: lumped, capacity: 3, initial: 1", "penalty"), ("condition: lumped, capacity: 3, initial: 1", "aligned")])
def test_a_restart_amid_motion_goes_on_with_the_same_bits(run, scene, tmp_path, heat, method):
    whole, half = tmp_path / "whole", tmp_path / "half"
    text = scene(CARRIED.replace("conductivity: 0.1, capacity: 3", heat))
    for folder in (whole, half):
        run([text, "-couple_method", method, "-sim_time", "0.32", "-checkpoint_every", "4", "-output_dir", folder])
    before = read_last(whole)
    run([text, "-couple_method", method, "-sim_time", "0.32", "-sim_restart", half / "checkpoint_4.h5", "-output_dir", half])
    after = read_last(half)
    assert {k: v for k, v in before.items() if not k.startswith("seconds")} == {k: v for k, v in after.items() if not k.startswith("seconds")}


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
    (["-scalars", "pi"], "a word of expressions with another meaning"),
    (["-scalars", "my-heat"], "letters, digits and _ alone"),
])
def test_mistakes_are_refused_with_one_message(run, tmp_path, options, said):
    result = run([ROOT / "runs/heated-cavity.yaml", "-output_dir", tmp_path / "out", *options])
    assert result.status and said in result.err and result.err.count("error:") == 1


HELD = in_free_space(2, 8, 1, "conductivity: 2")


@pytest.mark.parametrize("change, said", [
    (("conductivity: 2", "condition: lumped, capacity: 3"), "give -particle_body_heat_initial, its value at the start"),
])
def test_what_bodies_cannot_do_yet_is_refused(run, scene, tmp_path, change, said):
    text = HELD.replace(*change).replace("method: penalty", "method: aligned").replace("steady: true", "dt: 0.01, steps: 2")
    result = run([scene(text), "-output_dir", tmp_path / "out"])
    assert result.status and said in result.err and result.err.count("error:") == 1


BESIDE = """mesh: {cells: [20, 20], lower: [-1, -1], upper: [1, 1]}
flow: {density: 1, viscosity: 1}
scalars: heat
scalar:
  heat: {conductivity: 1, capacity: 2, TERM, initial: 1}
particle:
  groups: body
  body: {shape: circle, radius: 0.43, position: [0.03, 0.02], density: 1, free: none, heat: {conductivity: 5, capacity: 3}}
sim: {dt: 0.01, steps: 1}
output: {every: 0}
"""


@pytest.mark.parametrize("method, error", [("aligned", 1e-6), ("penalty", 5e-5), ("nodal", 5e-5)])
def test_sources_and_reactions_of_the_fluid_end_at_bodies(run, scene, tmp_path, method, error):
    """Heat a time: of a source 1, the area of the fluid; of a decay, the rate times the heat of the fluid at the end of an implicit step, whose edge the body warms"""
    area = 4 - math.pi * 0.43**2
    for term, expected, within in (("source: 1", area, error), ("decay: 2", -4 * area / 1.02, 5e-3), ('source: "-4*heat"', -4 * area / 1.02, 5e-3)):
        run([scene(BESIDE.replace("TERM", term)), "-couple_method", method, "-output_dir", tmp_path / "out", "-output_overwrite"])
        last = read_last(tmp_path / "out")
        assert float(last["scalar_source_heat"]) == pytest.approx(expected, rel=within) and float(last["scalar_error_heat"]) < 1e-12


@pytest.mark.parametrize("method, error", [("aligned", 1e-5), ("penalty", 1e-4), ("nodal", 0.05)])
def test_a_held_value_takes_what_the_fluid_makes(run, scene, tmp_path, method, error):
    """Steady: the source of the fluid around, not of the place of the body (nodal: of cells that it cuts the whole)."""
    held = BESIDE.replace("conductivity: 5, capacity: 3", "condition: value, value: 0").replace("TERM", "source: 1").replace("dt: 0.01, steps: 1", "steady: true")
    run([scene(held), "-couple_method", method, "-output_dir", tmp_path / "out"])
    assert float(read_last(tmp_path / "out")["scalar_from_heat_body"]) == pytest.approx(math.pi * 0.43**2 - 4, rel=error)


def test_a_mean_gradient_stays_where_it_is_as_a_disc_goes_by(run, scene, tmp_path):
    """In a uniform flow U of one conductivity and capacity T = G.(x - U t), whatever passes: T' = -.5 t everywhere"""
    text = CARRIED.replace('initial: "exp(-((x-1)^2+(y-1)^2)/0.09)"', "gradient: [1, 0]").replace(", heat: {conductivity: 0.1, capacity: 3}", "")
    run([scene(text), "-couple_method", "aligned", "-mesh_cells", "16,16", "-sim_time", "0.4", "-output_dir", tmp_path / "out"])
    last = read_last(tmp_path / "out")
    assert all(float(last[f"scalar_{what}_heat"]) == pytest.approx(-0.2, abs=5e-6) for what in ("min", "max"))


def test_nodes_that_go_along_know_no_moving_frame(run, scene, tmp_path):
    result = run([scene(CARRIED), "-couple_method", "aligned", "-sim_frame", "body", "-output_dir", tmp_path / "out"])
    assert result.status and "-sim_frame body with -couple_method aligned" in result.err and result.err.count("error:") == 1


REACTION = """mesh: {cells: [3, 2]}
flow: {density: 1, viscosity: 1}
scalars: ORDER
scalar:
  a: {conductivity: 0, initial: "1+x*y", reaction: [A]}
  b: {conductivity: 0, initial: 0, reaction: [B]}
  c: {conductivity: 0, initial: 0, reaction: [C]}
sim: {dt: DT, time: 1}
output: {every: 0}
"""


def react(run, scene, folder, order, dt, ranks=1):
    """a -> b at rate 2, b -> c at rate 1; means at the end, over the start's, and errors of the balances"""
    rates = {"A": {"a": -2}, "B": {"a": 2, "b": -1}, "C": {"b": 1}}
    text = REACTION.replace("ORDER", f"[{', '.join(order)}]").replace("DT", str(dt))
    for name, rate in rates.items():
        text = text.replace(f"[{name}]", str([rate.get(of, 0) for of in order]))
    run([scene(text), "-scalars_rtol", "1e-8", "-output_dir", folder], ranks)
    last = read_last(folder)
    return [float(last[f"scalar_mean_{s}"]) / 1.25 for s in "abc"], [float(last[f"scalar_error_{s}"]) for s in "abc"]


@pytest.mark.parametrize("order, ranks, most", [("abc", 1, 2e-4), ("abc", 2, 2e-4), ("cba", 1, 2e-3)])
def test_a_chain_of_reactions_is_exponentials(run, scene, tmp_path, order, ranks, most):
    """Second order in the step, in any order of the list; in that of the chain nothing is lost"""
    exact = [math.exp(-2), 2 * (math.exp(-1) - math.exp(-2)), 1 - 2 * math.exp(-1) + math.exp(-2)]
    errors = []
    for dt in (0.05, 0.025):
        means, books = react(run, scene, tmp_path / str(dt), order, dt, ranks)
        assert max(books) < 1e-10
        errors.append(max(abs(m - e) for m, e in zip(means, exact)))
    assert order == "cba" or abs(sum(means) - 1) < 1e-12
    assert errors[1] < most and 3.3 < errors[0] / errors[1] < 5


@pytest.mark.parametrize("dt, most", [(0.05, 5e-4), (0.025, 1.2e-4)])
def test_a_source_goes_by_scalars(run, scene, tmp_path, dt, most):
    """a' = -a^2: 1/2 at t = 1, second order in the step"""
    text = REACTION.replace("ORDER", "a").replace("[A]", "[0]").replace("DT", str(dt)).replace('"1+x*y"', '1, source: "-a^2"')
    text = "\n".join(line for line in text.split("\n") if not line.startswith(("  b:", "  c:")))
    run([scene(text), "-output_dir", tmp_path / "out"])
    last = read_last(tmp_path / "out")
    assert abs(float(last["scalar_mean_a"]) - 0.5) < most and float(last["scalar_error_a"]) < 1e-10


VISCOUS = """mesh: {cells: [4, 8], upper: [1, 1], periodic: [x]}
flow: {density: 1, viscosity: 1, force: [1, 0], viscosity_of_scalars: "exp(-heat)"}
scalars: heat
scalar: {heat: {conductivity: 1, initial: "y", bc: {bottom: {value: 0}, top: {value: 1}}}}
sim: {dt: 0.5, time: 10}
output: {every: 0}
"""


def test_the_viscosity_goes_by_heat(run, scene, tmp_path):
    """A channel, exp(-y): mean velocity .136305 by quadrature"""
    run([scene(VISCOUS), "-output_dir", tmp_path / "out"])
    assert float(read_last(tmp_path / "out")["mean_velocity_x"]) == pytest.approx(0.136305, rel=1e-3)


@pytest.mark.parametrize("text, said", [('"heat-2"', "above zero for all values"), ("2", "goes by no scalar"), ('"1+salt"', "Unexpected token")])
def test_a_wrong_viscosity_is_refused(run, scene, tmp_path, text, said):
    result = run([scene(VISCOUS.replace('"exp(-heat)"', text)), "-output_dir", tmp_path / "out"])
    assert result.status and said in result.err and result.err.count("error:") == 1


AFLOAT = """
mesh: {cells: [8, 8], upper: [2, 2]}
flow: {density: 1, viscosity: 0.1, gravity: [0, -10]}
scalars: heat
scalar: {heat: {conductivity: 0.05, initial: 2, reference: 1, bc_left_value: 2}}
particle:
  groups: disc
  disc: {shape: circle, radius: 0.4, density: 1.25, position: [1, 1], heat: {CONDITION, expansion: 0.2}}
couple: {method: METHOD}
sim: {dt: 0.02, steps: 3}
output: {every: 0}
"""


@pytest.mark.parametrize("method", ["penalty", "aligned"])
@pytest.mark.parametrize("condition", ["condition: value, value: 2", "condition: lumped, initial: 2, capacity: 2", "initial: 2, capacity: 2"])
def test_a_body_that_expands_to_the_density_of_the_fluid_floats(run, scene, tmp_path, condition, method):
    """Density 1.25 less a fifth of it is that of the fluid: it stays where it is; colder by .5 it sinks, warmer it rises."""
    text = AFLOAT.replace("CONDITION", condition).replace("METHOD", method)

    def read_speed(out, *options):
        assert run([scene(text), "-output_dir", tmp_path / out, *options]).status == 0
        with open(tmp_path / out / "bodies.csv") as file:
            return float(list(csv.DictReader(file))[-1]["v"])

    assert abs(read_speed("still")) < 1e-12
    if method == "penalty":
        assert read_speed("sinks", "-particle_disc_heat_reference", "1.5") < -1e-3
        assert read_speed("rises", "-particle_disc_heat_reference", "0.5") > 1e-3


def test_what_expands_without_a_value_is_refused(run, scene, tmp_path):
    for condition, said in (("condition: flux, flux: 1", "is in flux, nothing is known of the scalar inside"),
                            ("capacity: 2", "give -particle_disc_heat_initial")):
        result = run([scene(AFLOAT.replace("CONDITION", condition).replace("METHOD", "penalty")), "-output_dir", tmp_path / "out"])
        assert result.status and said in result.err and result.err.count("error:") == 1


def test_steady_sources_that_do_not_cancel_are_refused(run, scene, tmp_path):
    text = "mesh: {cells: [4, 4]}\nscalars: heat\nscalar: {heat: {bc_left_flux: 1}}\nsim: {steady: true}\n"
    result = run([scene(text), "-output_dir", tmp_path / "out"])
    assert result.status and "its sources and fluxes add up to 1. a time" in result.err and result.err.count("error:") == 1
    assert run([scene(text), "-scalar_heat_bc_right_flux", "-1", "-output_dir", tmp_path / "cancels"]).status == 0


@pytest.mark.parametrize("method", ["penalty", "aligned"])
@pytest.mark.parametrize("condition", ["initial: 3, capacity: 2, conductivity: 0.5", "condition: lumped, initial: 3, capacity: 2"])
def test_a_restart_of_a_body_that_weighs_by_heat_has_the_same_bits(run, scene, tmp_path, condition, method):
    """A scalar called heat beside the books of bodies, which stood under the same name in a checkpoint; two ranks differ by what solvers leave"""
    text = AFLOAT.replace("CONDITION", condition).replace("METHOD", method).replace("steps: 3", "steps: 6")
    assert run([scene(text), "-checkpoint_every", "3", "-output_dir", tmp_path / "all"]).status == 0
    assert run([scene(text), "-sim_restart", tmp_path / "all" / "checkpoint_3.h5", "-output_dir", tmp_path / "on"]).status == 0
    ends = [(tmp_path / out / "bodies.csv").read_text().splitlines()[-1] for out in ("all", "on")]
    assert ends[0] == ends[1]
    rows = [{k: v for k, v in read_last(tmp_path / out).items() if "seconds" not in k} for out in ("all", "on")]
    assert rows[0] == rows[1]
    tight = ["-scalars_rtol", "1e-8", "-flow_ksp_rtol", "1e-9"]
    contents = []
    for ranks in (1, 2):
        assert run([scene(text), *tight, "-output_dir", tmp_path / str(ranks)], ranks).status == 0
        contents.append(float(read_last(tmp_path / str(ranks))["scalar_content_heat"]))
    assert contents[1] == pytest.approx(contents[0], rel=1e-7)


MEET = """mesh: {cells: [2, 2]}
flow: {density: 1, viscosity: 1}
scalars: NAMES
scalar:
  a: {conductivity: 0, initial: 1, source: "-RATE*a*b"}
  b: {conductivity: 0, initial: 0.5, source: "-RATE*a*b"}
  c: {conductivity: 0, initial: 0, source: "RATE*a*b"}
sim: {dt: DT, time: 1}
output: {every: 0}
"""


def meet(run, scene, folder, names, rate, dt, ranks=1, *more):
    """a + b -> c: what is left of a and b and what c is, at t = 1"""
    text = MEET.replace("NAMES", names).replace("RATE", str(rate)).replace("DT", str(dt))
    assert run([scene(text), "-scalars_rtol", "1e-12", "-output_dir", folder, *more], ranks).status == 0
    last = read_last(folder)
    assert max(float(last[f"scalar_error_{s}"]) for s in "abc") < 1e-10
    return [float(last[f"scalar_mean_{s}"]) for s in "abc"]


@pytest.mark.parametrize("names, ranks", [("[a, b, c]", 1), ("[c, b, a]", 2)])
def test_two_scalars_make_a_third(run, scene, tmp_path, names, ranks):
    """c = a b (e - 1)/(a e - b), e = exp(k (a - b) t); second order in the step, and nothing is lost"""
    e = math.exp(2 * 0.5)
    exact = 0.5 * (e - 1) / (e - 0.5)
    errors = []
    for dt in (0.1, 0.05):
        a, b, c = meet(run, scene, tmp_path / str(dt), names, 2, dt, ranks)
        assert abs(a + c - 1) < 1e-10 and abs(b + c - 0.5) < 1e-10
        errors.append(abs(c - exact))
    assert errors[1] < 3e-4 and 3.3 < errors[0] / errors[1] < 5


def test_a_stiff_reaction_is_stable(run, scene, tmp_path):
    """Rate times step 1e4: b is used up within a step"""
    a, b, c = meet(run, scene, tmp_path / "out", "[a, b, c]", 1e5, 0.1, 1, "-sim_time", "0.3")
    assert abs(a - 0.5) < 1e-4 and abs(b) < 1e-4 and abs(c - 0.5) < 1e-4


SLAB = """mesh: {cells: [32, 1], upper: [1, 0.1]}
flow: {density: 1, viscosity: 1}
scalars: c
scalar:
  c: {diffusivity: 1, initial: 1, bc: {right: {value: 1}, LEFT}, SOURCE}
sim: {steady: true}
output: {every: 0}
"""


def find_root(f, low, high):
    """By halving"""
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if f(low) * f(middle) > 0 else (low, middle)
    return low


def reach(bottom, rate):
    """Thickness over which c'' = rate c^2 goes from `bottom`, without a slope, to 1: c = bottom + (1 - bottom) s^2"""
    n = 4000
    total = 0
    for k in range(n):
        s = (k + 0.5) / n
        u = (1 - bottom) * s * s
        total += 2 * math.sqrt(1 - bottom) / math.sqrt(2 * rate / 3 * (3 * bottom**2 + 3 * bottom * u + u * u)) / n
    return total


@pytest.mark.parametrize("order, most", [(1, 1e-6), (2, 3e-6)])
def test_a_slab_reacts_as_thiele_says(run, scene, tmp_path, order, most):
    """Thiele modulus sqrt(20): what goes in, of first order by tanh, of second by the first integral"""
    bottom = find_root(lambda b: reach(b, 20) - 1, 1e-3, 0.9)
    exact = math.sqrt(20) * math.tanh(math.sqrt(20)) if order == 1 else math.sqrt(2 * 20 / 3 * (1 - bottom**3))
    text = SLAB.replace("SOURCE", f'source: "-20*c^{order}"').replace(", LEFT", "")
    run([scene(text), "-output_dir", tmp_path / "out"])
    last = read_last(tmp_path / "out")
    assert abs(float(last["scalar_flux_c_right"]) / (0.1 * exact) - 1) < most
    assert float(last["scalar_error_c"]) < 1e-7


@pytest.mark.parametrize("where", ["steady: true", "dt: 0.5, time: 20"])
def test_a_wall_reacts_by_expression(run, scene, tmp_path, where):
    """1 - c = 5 c^2 at a wall across a slab of thickness 1"""
    wall = (math.sqrt(21) - 1) / 10
    text = SLAB.replace(", SOURCE", "").replace("LEFT", 'left: {flux: "-5*c^2"}').replace("steady: true", where)
    run([scene(text), "-output_dir", tmp_path / "out"])
    last = read_last(tmp_path / "out")
    assert float(last["scalar_min_c"]) == pytest.approx(wall, rel=1e-6)
    assert float(last["scalar_error_c"]) < (1e-10 if "dt" in where else 1e-7)


@pytest.mark.parametrize("method, ranks, most", [("aligned", 1, 1e-5), ("aligned", 2, 1e-5), ("penalty", 2, 0.012), ("nodal", 1, 0.012)])
def test_a_disc_reacts_by_expression(run, scene, tmp_path, method, ranks, most):
    """c = 1 + s log(r) around a disc of radius a with flux -5 c^2: s/a = 5 (1 + s log(a))^2. The bound of penalty and nodal was set after 1.1 % was
    seen; with half the cells .45 %"""
    a = 0.4
    s = find_root(lambda s: s / a - 5 * (1 + s * math.log(a))**2, 0, -1 / math.log(a))
    text = in_free_space(2, 16, 1, 'condition: flux, flux: "-5*(heat+1)^2"').replace("-1*log(", f"{s}*log(")
    run([scene(text), "-couple_method", method, "-output_dir", tmp_path / "out"], ranks)
    last = read_last(tmp_path / "out")
    assert abs(float(last["scalar_source_heat"]) / (-2 * math.pi * s) - 1) < most


@pytest.mark.parametrize("change, said", [
    ('source: "-20*d"', "Unexpected token"),
    ('source: "-c/0"', "write expressions that are finite everywhere"),
    ('source: "-sqrt(c-2)"', "write expressions that are finite everywhere"),
    ('source: "1+c^2"', "have found no steady state"),
])
def test_a_wrong_reaction_is_refused(run, scene, tmp_path, change, said):
    text = SLAB.replace("SOURCE", change).replace(", LEFT", "").replace("32, 1", "4, 1").replace("upper: [1,", "upper: [10,")
    result = run([scene(text), "-output_dir", tmp_path / "out"])
    assert result.status and said in result.err and result.err.count("error:") == 1


FIELD = """mesh: {cells: [8, 8]}
flow: {density: 1, viscosity: 1}
scalars: [heat, salt]
scalar: {heat: {conductivity: 0, initial: "x^2*y", bc: {left: {value: 0}}}, salt: {conductivity: 0, initial: "1+x"}}
sim: {dt: 0.1, time: 0.1}
output: {every: 1}
"""


@pytest.mark.parametrize("method", ["penalty", "aligned"])
def test_a_scalar_starts_from_the_fields_of_another_run(run, scene, tmp_path, method):
    """Of a run on other cells and ranks, around a disc, too, whose nodes the mesh is lined up with later"""
    assert run([scene(FIELD), "-output_dir", tmp_path / "first"]).status == 0
    text = FIELD.replace('initial: "x^2*y", ', "").replace("cells: [8, 8]", "cells: [12, 10]")
    text += ("particle: {groups: disc, disc: {shape: circle, radius: 0.2, position: [0.5, 0.5], free: none, salt: {capacity: 1}}}\n"
             f"couple: {{method: {method}}}\n")
    more = ["-scalar_heat_initial_run", tmp_path / "first" / "fields_1.h5", "-output_dir", tmp_path / "second"]
    assert run([scene(text), *more], 2).status == 0
    result = read_last(tmp_path / "second")
    assert float(result["scalar_mean_heat"]) == pytest.approx(1 / 6, rel=1e-5)
    assert float(result["scalar_mean_salt"]) == pytest.approx(1.5, rel=1e-8)


@pytest.mark.parametrize("change, options, said", [
    (("salt]", "sugar]"), ["-scalar_sugar_initial_run", "first"], "'sugar' of"),
    (("cells: [8, 8]", "cells: [8, 8], upper: [2, 1]"), ["-scalar_heat_initial_run", "first"], "nodes of this mesh do not lie in the mesh of that run"),
    (("cells: [8, 8]", "cells: [2, 2, 2]"), ["-scalar_heat_initial_run", "first"], "is a run in 2 dimensions"),
    (("a", "a"), ["-scalar_salt_initial_run", "first"], "-scalar_salt_initial says another start"),
    (("a", "a"), ["-scalar_heat_initial_run", "nowhere"], "no fields there"),
])
def test_fields_that_do_not_fit_are_refused(run, scene, tmp_path, change, options, said):
    first = FIELD.replace('initial: "x^2*y", ', "")
    assert run([scene(first), "-sim_steps", "1", "-output_dir", tmp_path / "first"]).status == 0
    text = first.replace(*change).replace("salt: {conductivity: 0, initial: \"1+x\"}", "sugar: {conductivity: 1}") if "sugar" in change[1] else first.replace(*change)
    result = run([scene(text), options[0], tmp_path / options[1], "-output_dir", tmp_path / "second"])
    assert result.status and said in result.err and result.err.count("error:") == 1


def test_fields_with_a_mean_gradient_have_it_at_the_far_side(run, scene, tmp_path):
    """Images of nodes across a period: x on both sides, not that of the node"""
    import h5py

    text = ("mesh: {cells: [4, 3], periodic: [x, y]}\nflow: {density: 1, viscosity: 1}\nscalars: heat\n"
            "scalar: {heat: {conductivity: 1, gradient: [1, 0]}}\nsim: {steady: true}\noutput: {every: 1}\n")
    assert run([scene(text), "-output_dir", tmp_path / "out"], 2).status == 0
    with h5py.File(next((tmp_path / "out").glob("mesh*.h5"))) as mesh, h5py.File(tmp_path / "out" / "fields_1.h5") as fields:
        assert abs(mesh["coordinates"][:, 0] - fields["heat"][:].ravel()).max() < 1e-9


def test_orders_are_three_in_space_and_two_in_time(tmp_path):
    """What runs/studies/scalars/orders.py measures, at its coarsest"""
    sys.path.insert(0, str(ROOT / "runs" / "studies" / "scalars"))
    import orders

    build = ROOT / os.environ.get("TUMBLE_BUILD", "build")
    assert orders.orders([orders.measure_space(build, cells) for cells in (8, 16)])[0] > 2.8
    for scheme in ("bdf2", "cn"):
        assert 1.9 < orders.orders([orders.measure_time(build, step, scheme) for step in (0.2, 0.1)])[0] < 2.2


@pytest.mark.parametrize("ratio", [0.001, 1000.0])
def test_a_sphere_that_conducts_has_its_dipole_under_penalty(ratio):
    """What runs/studies/scalars/dipole.py measures, at 8 cells a diameter: .01, .30 % off"""
    sys.path.insert(0, str(ROOT / "runs" / "studies" / "scalars"))
    import dipole

    assert abs(dipole.measure(ROOT / os.environ.get("TUMBLE_BUILD", "build"), 8, ratio)) < 0.02


GRAIN = """mesh: {kind: disc, radius: 1, resolution: 8}
flow: {density: 1, viscosity: 1}
scalars: gas
scalar: {gas: {conductivity: 1, initial: 1, bc: {outer: {value: 1}}}}
particle:
  groups: grain
  grain: {shape: circle, radius: 0.4, position: [0, 0], free: none, gas: {conductivity: 0.5, capacity: 2, decay: 25}}
sim: {steady: true}
output: {every: 0}
"""
BALL = """mesh: {cells: [8, 8, 8], lower: [-1, -1, -1], upper: [1, 1, 1]}
flow: {density: 1, viscosity: 1}
scalars: gas
scalar:
  gas: {conductivity: 1, initial: 1}
SIDES
particle:
  groups: grain
  grain: {shape: circle, radius: 0.5, position: [0.013, 0.007, 0.01], free: none, gas: {conductivity: 0.5, capacity: 2, decay: 25}}
sim: {steady: true}
output: {every: 0}
"""


@pytest.mark.parametrize("method, plane, space", [("aligned", 5e-4, 3e-3), ("penalty", 0.012, 0.025), ("nodal", 0.012, None)])
def test_a_grain_takes_up_what_thiele_has(run, scene, tmp_path, method, plane, space):
    """First order, Thiele modulus 4 (disc in a ring, effectiveness .43176) and 5 (sphere in free space, .48005). The bounds were set after
    .03, 1.06 % (disc; half with half the cells) and .21, 2.3 % (sphere, 4 cells a diameter) were seen"""
    run([scene(GRAIN), "-couple_method", method, "-output_dir", tmp_path / "disc"])
    i1_over_i0 = 0.8635226110245447  # I1(4)/I0(4)
    exact = 2 * math.pi / (math.log(1 / 0.4) + 1 / (0.5 * 4 * i1_over_i0))
    assert float(read_last(tmp_path / "disc")["scalar_flux_gas_outer"]) == pytest.approx(exact, rel=plane)
    if space is None:
        return
    taken = 0.5 * (5 / math.tanh(5) - 1)  # over the conductivity of the fluid
    exact = 4 * math.pi * 0.5 * taken / (1 + taken)
    sides = "left right bottom top front back".split()
    value = f"1-{exact / 4 / math.pi}/sqrt((x-0.013)^2+(y-0.007)^2+(z-0.01)^2)"
    run([scene(BALL.replace("SIDES", "\n".join(f'  gas_bc_{side}: {{value: "{value}"}}' for side in sides))), "-couple_method", method, "-output_dir", tmp_path / "ball"])
    row = read_last(tmp_path / "ball")
    assert sum(float(row[f"scalar_flux_gas_{side}"]) for side in sides) == pytest.approx(exact, rel=space)


def in_stokes_flow(peclet):
    """A sphere at a value in the Stokes flow of free space, on whose outer sphere of 4 radii the value is 0"""
    r = "sqrt(x^2+y^2+z^2)"
    flow = [f"1-0.75*(1/{r}+x^2/{r}^3)-0.25*(1/{r}^3-3*x^2/{r}^5)", *(f"0.75*x*{a}*(1/{r}^5-1/{r}^3)" for a in "yz")]
    return f"""mesh: {{kind: ball, radius: 4, resolution: 6}}
flow: {{density: 1, viscosity: 1, convection: false, bc_outer: {{type: inflow, velocity: {json.dumps(flow)}}}}}
scalars: heat
scalar: {{heat: {{conductivity: {2 / peclet}, bc_outer: {{value: 0}}}}}}
particle:
  groups: ball
  ball: {{shape: circle, radius: 1, position: [0, 0, 0], free: none, heat: {{condition: value, value: 1}}}}
sim: {{steady: true}}
output: {{every: 0}}
"""


@pytest.mark.parametrize("method, most", [("aligned", 1e-3), ("penalty", 1e-2)])
def test_a_sphere_in_a_stokes_flow_heats_it(run, scene, tmp_path, monkeypatch, method, most):
    """Nusselt number at Peclet 1 and 10, 3.7 cells a diameter, against a spectral solution, which in free space has the series of Acrivos & Taylor"""
    pytest.importorskip("numpy")
    monkeypatch.syspath_prepend(str(ROOT / "runs/studies/scalars"))
    import stokes

    assert stokes.nusselt(0.1, 300) == pytest.approx(stokes.series(0.1), rel=1e-3)
    for peclet in (1, 10):
        run([scene(in_stokes_flow(peclet)), "-couple_method", method, "-output_dir", tmp_path / "out", "-output_overwrite"])
        last = read_last(tmp_path / "out")
        assert -float(last["scalar_flux_heat_outer"]) * peclet / (4 * math.pi) == pytest.approx(stokes.nusselt(peclet, 4), rel=most)
        assert float(last["scalar_from_heat_ball"]) == pytest.approx(-float(last["scalar_flux_heat_outer"]), rel=1e-3)


MICRO = """\
mesh: {cells: [12, 4, 4], upper: [1e-4, 3e-5, 3e-5]}
flow: {density: 1000, viscosity: 1e-3}
scalars: salt
scalar: {salt: {conductivity: 1e-9, initial: 0, bc_left: {value: 1}}}
sim: {dt: 1e-3, steps: 20}
output: {every: 0}
"""


def test_micrometres_in_si(run, scene):
    """Values at nodes are no measure of the equation's terms, which are 1e-15 here: not a step was solved. Exact: error function (bound set after
    -.4 % was seen, +30 % before)"""
    result = run([scene(MICRO, "micro.yaml"), "-output_dir", "out"])
    assert result.status == 0, str(result)
    last = read_last(result.folder / "out")
    assert float(last["scalar_mean_salt"]) == pytest.approx(2 * math.sqrt(1e-9 * float(last["time"]) / math.pi) / 1e-4, rel=0.01)
