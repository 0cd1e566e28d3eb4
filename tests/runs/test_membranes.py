"""Membranes in a flow: capsules in the plane and in space: momentum, volume, the same on all numbers of ranks, restarts, refusals."""
import math

import pytest

from conftest import ROOT, read_rows

FAR = "bc_left: {type: inflow, velocity: [y, 0]}, bc_right: {type: inflow, velocity: [y, 0]}, bc_bottom: {type: inflow, velocity: [y, 0]}, bc_top: {type: inflow, velocity: [y, 0]}"
PLANE = f"""mesh: {{cells: [10, 10], lower: [-2, -2], upper: [2, 2]}}
flow: {{density: 0.1, viscosity: 1, time: bdf2, solver: direct, velocity: [y, 0], {FAR}}}
particle:
  groups: skin
  skin: {{shape: circle, radius: 0.8, position: [0.03, 0.02], material: membrane, surface_modulus: 5}}
sim: {{dt: 0.1, steps: 4}}
output: {{every: 0}}
"""
SPACE = """mesh: {cells: [5, 5, 5], lower: [0, 0, 0], upper: [1.25, 1.25, 1.25]}
flow: {density: 1, viscosity: 1, time: bdf2, solver: direct, bc_top: {type: moving_wall, velocity: [1, 0, 0]}}
particle:
  groups: skin
  skin: {shape: circle, radius: 0.35, position: [0.63, 0.62, 0.6], material: membrane, surface_modulus: 3, membrane_law: skalak, solid_cells: [4, 4, 4]}
sim: {dt: 0.05, steps: 2}
output: {every: 0}
"""
ALIGNED = PLANE.replace("particle:", "couple: {method: aligned}\nparticle:").replace("surface_modulus: 5", "surface_modulus: 5, bending: 0.3")
ROUND = SPACE.replace("particle:", "couple: {method: aligned}\nparticle:").replace("modulus: 3", "modulus: 3, bending: 0.03, viscosity: 3")
THICK = [text.replace("surface_modulus: 5", "surface_modulus: 5, viscosity: 5").replace("surface_modulus: 3", "surface_modulus: 3, viscosity: 0.3") for text in (PLANE, ALIGNED, SPACE)]
MIXED = """mesh: {cells: [10, 14], upper: [2, 2.8]}
flow: {density: 1, viscosity: 0.5, gravity: [0, -10], time: bdf2, solver: direct}
particle:
  groups: skin, nucleus, soft, hard
  skin: {shape: circle, radius: 0.5, position: [0.95, 0.8], material: membrane, surface_modulus: 3, bending: 0.05}
  nucleus: {shape: circle, radius: 0.2, position: [0.93, 0.82], material: neo_hookean, shear_modulus: 20, density: 3}
  soft: {shape: circle, radius: 0.25, position: [1.05, 1.6], material: neo_hookean, shear_modulus: 20, density: 3}
  hard: {shape: circle, radius: 0.25, density: 3, position: [0.9, 2.2]}
sim: {dt: 0.02, steps: 20}
output: {every: 0}
monitor: {energy: true}
"""
HELD = [text.replace("material: membrane", "material: membrane, global_area_modulus: 300") for text in (PLANE, ALIGNED, SPACE)]
SCENES = pytest.mark.parametrize(
    "text",
    [PLANE, ALIGNED, SPACE, ROUND, *THICK, *HELD, MIXED],
    ids=["plane", "aligned", "space", "space-aligned", "plane-inner", "aligned-inner", "space-inner", "plane-held", "aligned-held", "space-held", "mixed"],
)
VESICLE = """mesh: {cells: [16, 16], lower: [-2, -2], upper: [2, 2]}
flow: {density: 1e-3, viscosity: 1, convection: false, time: bdf2, solver: direct}
particle:
  groups: skin
  skin: {shape: ellipse, a: 1.3, b: 0.6, position: [0.003, 0.002], material: membrane, membrane_law: skalak, surface_modulus: 100, bending: 1}
sim: {dt: 0.02, time: 1}
output: {every: 0}
"""


def rows(run, name, *options, ranks=1, folder="out"):
    result = run([name, "-output_dir", folder, *options], ranks, timeout=300)
    assert result.status == 0, str(result)
    return read_rows(result.folder / folder / "series.csv")


@SCENES
def test_ranks(run, scene, text):
    """A capsule is drawn out: momentum is balanced, it keeps its volume; the same on 1, 2 and 3 ranks."""
    name = scene(text)
    one, *others = (rows(run, name, ranks=ranks, folder=f"r{ranks}") for ranks in (1, 2, 3))
    assert max(row["momentum_error"] for row in one) < 1e-11 and max(abs(row["solid_volume_error_skin"]) for row in one) < 1e-12
    assert one[-1]["solid_taylor_skin"] > one[0]["solid_taylor_skin"] > 0 and one[-1]["solid_area_error_skin"] > 0
    for other in others:
        for column in ("solid_taylor_skin", "solid_energy_skin", "solid_stretch_skin", "solid_x_skin", "kinetic_energy"):
            assert other[-1][column] == pytest.approx(one[-1][column], rel=1e-8, abs=1e-10), column


def test_round_off(run, scene):
    """Moved by what an exact position may be rounded by, a body that is as far from nodes of the mesh on both its sides, and one cell from a wall, does the same: round-off makes no choice."""
    one = rows(run, scene(ROUND), folder="one")[-1]
    for sign in (1, -1):
        moved = ROUND.replace("[0.63, 0.62, 0.6]", str([0.63 + sign * 3e-13, 0.62 + sign * 7e-13, 0.6 - sign * 5e-13]))
        other = rows(run, scene(moved, "moved.yaml"), folder=f"moved{sign}")[-1]
        for column in ("solid_taylor_skin", "solid_energy_skin", "solid_stretch_skin", "kinetic_energy"):
            assert other[column] == pytest.approx(one[column], rel=1e-8), column


@SCENES
def test_restart(run, scene, text):
    """A run that stops and goes on has the bits of one that does not stop."""
    name, every = scene(text), ["-checkpoint_every", "1"]
    whole = rows(run, name, *every, folder="whole")[-1]
    rows(run, name, *every, "-sim_steps", "1", folder="part")
    again = rows(run, name, *every, "-sim_restart", "latest", folder="part")[-1]
    assert all(math.isfinite(value) for value in again.values())
    for column in again:
        assert column.startswith("seconds") or again[column] == whole[column], column


def test_beside_solids_and_rigid_bodies(run, scene):
    """A capsule with an elastic nucleus, an elastic disc and a rigid one sink, and the two above come down on it: it keeps its area, is drawn out, and books of momentum and energy close."""
    first, *_, last = series = rows(run, scene(MIXED), "-sim_steps", "60")
    assert max(row["momentum_error"] for row in series) < 1e-11
    assert all(abs(last[f"solid_volume_error_{name}"]) < 1e-12 for name in ("skin", "nucleus", "soft"))
    assert last["solid_y_nucleus"] < first["solid_y_nucleus"] and last["solid_taylor_skin"] > 0.02
    lost = sum(last[name] - first[name] for name in ("energy_dissipated", "energy_boundary", "energy_scheme"))
    assert last["energy"] - first["energy"] == pytest.approx(last["energy_supplied"] - first["energy_supplied"] - lost, abs=1e-2 * lost)


def test_beside_solids_aligned(run, scene):
    """Lined up with both kinds: one error."""
    result = run([scene(MIXED.replace("density: 3, position: [0.9, 2.2]", "density: 3, position: [0.9, 2.2], free: none")), "-output_dir", "out", "-couple_method", "aligned"])
    assert result.status and "not with both" in result.err and result.err.count("error:") == 1, str(result)


@pytest.mark.parametrize("text", [PLANE, ALIGNED], ids=["plane", "aligned"])
def test_weightless(run, scene, text):
    """The fluid on both sides has no net force on a skin without mass, under gravity neither."""
    last = rows(run, scene(text.replace("density: 0.1,", "density: 0.1, gravity: [0, -7],")))[-1]
    assert abs(last["solid_force_x_skin"]) < 1e-11 and abs(last["solid_force_y_skin"]) < 1e-11


@pytest.mark.parametrize(
    "options, message",
    [
        (["-particle_skin_density", "2"], "remove it"),
        (["-particle_skin_viscosity", "0"], "outside its range"),
        (["-particle_skin_viscosity", "2", "-flow_rheology", "power_law", "-flow_rheology_index", "0.8"], "remove -flow_rheology"),
        (["-particle_skin_poisson", "0.4"], "is a membrane"),
        (["-particle_skin_surface_modulus", "0"], "outside its range"),
        (["-particle_skin_membrane_law", "hooke"], "skalak"),
        (["-flow_active", "false"], "leave the flow on"),
    ],
)
def test_refusals(run, scene, options, message):
    result = run([scene(PLANE), "-output_dir", "out", *options])
    assert result.status and message in result.err and result.err.count("error:") == 1, str(result)


@pytest.mark.parametrize(
    "options, message",
    [
        (["-particle_skin_shape", "torus", "-particle_skin_tube", "0.1"], "its own centroid"),
    ],
)
def test_refusals_in_space(run, scene, options, message):
    name = scene(SPACE.replace("shape: circle, radius: 0.35, ", "") if "torus" in options else SPACE)
    result = run([name, "-output_dir", "out", *options])
    assert result.status and message in result.err and result.err.count("error:") == 1, str(result)


def test_scene(run):
    """capsule-shear on a coarse mesh: the capsule goes along with the shear at first, a little less than a drop without tension (half the strain), along the diagonal."""
    series = rows(run, ROOT / "runs/capsule-shear.yaml", "-mesh_focus_h", "0.8", "-sim_steps", "2", "-output_every", "0")
    assert 0.04 < series[0]["solid_taylor_capsule"] < 0.05 and series[0]["solid_taylor_capsule"] < series[1]["solid_taylor_capsule"] < 0.1
    assert series[1]["solid_axis_x_capsule"] == pytest.approx(0.74, abs=0.03) and abs(series[1]["solid_volume_error_capsule"]) < 1e-12


@pytest.mark.parametrize("method, bound", [("aligned", 0.015), ("penalty", 0.08)])
def test_inner_viscosity(run, scene, method, bound):
    """A circle of a fluid 5 times as viscous in strain at rate 1: to first order it deforms at 2/(1 + 5), without stretch of the skin. With c = 4/6 the stream function around it is
    (r^2/2 - c + c/(2 r^2)) sin 2a, which stands on the sides (measured before the bounds were set: .7 and 6 % too fast at .05, four cells a radius)."""
    r2, c = "(x*x+y*y)", 4 / 6
    u = f"x - {2 * c}*x*(x*x-y*y)/{r2}^2 + {c}*(x*(x*x-y*y) - 2*x*y*y)/{r2}^3"
    v = f"0 - y - {2 * c}*y*(x*x-y*y)/{r2}^2 + {c}*(y*(x*x-y*y) + 2*x*x*y)/{r2}^3"
    text = f"""mesh: {{cells: [20, 20], lower: [-2.5, -2.5], upper: [2.5, 2.5]}}
flow:
  {{density: 1e-5, viscosity: 1, convection: false, time: bdf2, solver: direct, velocity: [x, -y],
    bc_left: &far {{type: inflow, velocity: ["{u}", "{v}"]}}, bc_right: *far, bc_bottom: *far, bc_top: *far}}
particle:
  groups: skin
  skin: {{shape: circle, radius: 1, position: [0, 0], material: membrane, surface_modulus: 10, viscosity: 5}}
sim: {{dt: 0.005, time: 0.05}}
output: {{every: 0}}
monitor: {{energy: true}}
"""
    series = rows(run, scene(text), "-couple_method", method)
    last = series[-1]
    assert last["solid_taylor_skin"] == pytest.approx(0.05 * 2 / 6, rel=bound)
    assert abs(last["solid_area_error_skin"]) < 1e-3 and abs(last["solid_volume_error_skin"]) < 1e-12
    first, *_, last = series
    lost = sum(last[name] - first[name] for name in ("energy_dissipated", "energy_boundary", "energy_scheme"))
    assert last["energy"] - first["energy"] == pytest.approx(last["energy_supplied"] - first["energy_supplied"] - lost, abs=1e-5 * lost)


def test_vesicle_in_shear(run, scene):
    """A vesicle of reduced area .868 with the same fluid inside goes round at the angle of a boundary integral, .509 (studies/capsules/vesicle.py; measured before the bound was
    set: .5062 at time 1, .5092 at 5), 3 % above Keller & Skalak's atan(b/a) for an ellipse."""
    far = "{type: inflow, velocity: [y, 0]}"
    text = f"""mesh: {{lower: [-12, -12], upper: [12, 12], focus: [-1.7, -1.4, 1.7, 1.4], focus_h: 0.25, growth: [0.3, 0.3], coarsest: [24, 24]}}
flow: {{density: 1e-3, viscosity: 1, convection: false, time: bdf2, solver: direct, velocity: [y, 0], bc_left: {far}, bc_right: {far}, bc_bottom: {far}, bc_top: {far}}}
particle:
  groups: skin
  skin: {{shape: ellipse, a: 1.4, b: 0.75, angle: 0.5, position: [0.003, 0.002], material: membrane, membrane_law: skalak, surface_modulus: 100, area_modulus: 400, bending: 1}}
couple: {{method: aligned}}
sim: {{dt: 0.04, steps: 25}}
output: {{every: 0}}
"""
    last = rows(run, scene(text))[-1]
    assert last["solid_inclination_skin"] == pytest.approx(0.509, abs=0.005) and last["solid_inclination_skin"] > math.atan(0.75 / 1.4)
    assert last["solid_taylor_skin"] == pytest.approx(0.308, abs=0.003) and abs(last["solid_volume_error_skin"]) < 1e-12


# ---- a vesicle at rest ----


def elastica(curvature, tension, pressure, length, steps=100):
    """A quarter of a closed curve with k'' + k^3/2 - tension k = pressure from its tip, by Runge and Kutta: angle, slope of the curvature and place at its end, the curve's area
    and bending energy."""

    def rate(y):
        angle, k, slope, x, z = y[:5]
        return [k, slope, -(k**3) / 2 + tension * k + pressure, math.cos(angle), math.sin(angle), 0.5 * (x * math.sin(angle) - z * math.cos(angle)), 0.5 * k * k]

    def march(x):
        y, h = [math.pi / 2, curvature, 0, x, 0, 0, 0], length / 4 / steps
        for _ in range(steps):
            a = rate(y)
            b = rate([p + h / 2 * q for p, q in zip(y, a)])
            c = rate([p + h / 2 * q for p, q in zip(y, b)])
            d = rate([p + h * q for p, q in zip(y, c)])
            y = [p + h / 6 * (q + 2 * r + 2 * s + t) for p, q, r, s, t in zip(y, a, b, c, d)]
        return y

    end = march(-march(0)[3])
    return end[0] - math.pi, end[2], 4 * end[5], 4 * end[6]


def solve3(a, b):
    """Cramer's rule"""

    def det(m):
        return sum(m[0][i] * (m[1][(i + 1) % 3] * m[2][(i + 2) % 3] - m[1][(i + 2) % 3] * m[2][(i + 1) % 3]) for i in range(3))

    return [det([[b[i] if j == k else a[i][j] for j in range(3)] for i in range(3)]) / det(a) for k in range(3)]


def least_bending(length, area):
    """The bending energy (modulus 1) of the closed curve of this length and area that has least of it, two-fold symmetric: Newton's method, from nearly a circle."""
    r = length / (2 * math.pi)
    q = [1.35 / r, -2.5 / r**2, 3 / r**3]  # of a circle and a small second mode
    for part in range(1, 13):
        target = math.pi * r * r * (0.98 + (area / (math.pi * r * r) - 0.98) * part / 12)
        for _ in range(8):
            f = [v - w for v, w in zip(elastica(*q, length)[:3], (0, 0, target))]
            columns = [[(v - w) / 1e-6 for v, w in zip(elastica(*[p + 1e-6 * (i == j) for j, p in enumerate(q)], length)[:3], elastica(*q, length)[:3])] for i in range(3)]
            q = [p - d for p, d in zip(q, solve3([[columns[j][i] for j in range(3)] for i in range(3)], f))]
    return elastica(*q, length)[3]


@pytest.mark.parametrize("options, near", [([], 1e-9), (["-flow_solver", "balanced"], 1e-5), (["-couple_method", "aligned"], 1e-9)], ids=["direct", "balanced", "aligned"])
def test_area_as_a_whole(run, scene, options, near):
    """A vesicle that only its length as a whole holds, with a modulus of a million: it keeps it, by the tension that the modulus says, its books of energy close, and it comes to rest
    as the elastica of its length and area (energy +.10 %, lined up +.02 %; bound set after that)."""
    text = VESICLE.replace("surface_modulus: 100, bending: 1", "surface_modulus: 0.05, bending: 1, global_area_modulus: 1e6") + "monitor: {energy: true}\n"
    first, *_, last = rows(run, scene(text), *options)
    assert last["solid_area_error_skin"] == pytest.approx(last["solid_tension_skin"] / 1e6, abs=1e-11) and -3 < last["solid_tension_skin"] < -1
    assert abs(last["solid_volume_error_skin"]) < 1e-12
    lost = sum(last[name] - first[name] for name in ("energy_dissipated", "energy_boundary", "energy_scheme"))
    assert last["energy"] - first["energy"] == pytest.approx(last["energy_supplied"] - first["energy_supplied"] - lost, abs=near * lost)
    assert last["solid_energy_skin"] == pytest.approx(least_bending(6.173356, math.pi * 1.3 * 0.6), rel=2e-3)


@pytest.mark.parametrize("method", ["penalty", "aligned"])
def test_vesicle(run, scene, method):
    """An ellipse whose skin bends and hardly stretches comes to rest as Euler's elastica of its length and area: the same energy to .5 % (measured before the bound was set: .11 %
    immersed, .36 % lined up)."""
    last = rows(run, scene(VESICLE), "-couple_method", method)[-1]
    start, stretch = 6.173356, 1 + last["solid_area_error_skin"]
    exact = least_bending(start * stretch, math.pi * 1.3 * 0.6) + 2 * 100 / 4 * (stretch**2 - 1) ** 2 * start
    assert abs(last["solid_volume_error_skin"]) < 1e-12 and -0.006 < last["solid_area_error_skin"] < 0
    assert last["solid_energy_skin"] == pytest.approx(exact, rel=5e-3)
