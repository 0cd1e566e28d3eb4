"""Surfaces that move in the frame of their bodies: squirmers against exact speeds and powers, ranks, restarts and refusals."""
import csv
import math
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# A disc (radius .5, B1 = 1, B2 = 3) in a box on whose sides the velocity is that of free space: Stokes flow, one step
R2 = "(x^2+y^2)"
UR, UT = f"(-1.5*(1-0.25/{R2})*(x^2-y^2)/{R2})", f"(0.375*2*x*y/({R2}*{R2}))"
SIDE = f'["0.125*(x^2-y^2)/{R2}^2+({UR}*x-{UT}*y)/{R2}", "0.125*2*x*y/{R2}^2+({UR}*y+{UT}*x)/{R2}"]'
DISC = f"""mesh: {{cells: [32, 32], lower: [-2, -2], upper: [2, 2]}}
flow:
  density: 1e-8
  viscosity: 1
  convection: false
  bc: {{left: &free {{type: inflow, velocity: {SIDE}}}, right: {{type: inflow, velocity: {SIDE}}}, bottom: {{type: inflow, velocity: {SIDE}}}, top: {{type: inflow, velocity: {SIDE}}}}}
particle:
  groups: swimmer
  swimmer: {{shape: circle, radius: 0.5, density: 1e-8, position: [0, 0], slip: {{modes: [1, 3]}}}}
sim: {{dt: 1e-3, steps: 1}}
""".replace("&free ", "")
POWER = 2 * math.pi * (1 + 2 * 9)

# Two swimmers and a body that turns by its own treadmill, unsteady
SEVERAL = """mesh: {cells: [16, 16], lower: [-1, -1], upper: [1, 1], periodic: x}
flow: {density: 1, viscosity: 0.1}
couple: {method: aligned}
particle:
  groups: pusher, puller, wheel
  pusher: {shape: circle, radius: 0.2, density: 1, position: [-0.45, 0.3], angle: 0.4, slip: {modes: [1, "-1-sin(9*t)"], direction: [0, 1]}}
  puller: {shape: circle, radius: 0.2, density: 2, position: [0.4, 0.3], slip: {modes: [1, 2]}}
  wheel: {shape: ellipse, a: 0.3, b: 0.2, density: 1, position: [0.1, -0.45], slip: {velocity: ["-y", x]}}
sim: {dt: 0.02, steps: 2}
checkpoint: {every: 1}
"""


def solve(run, scene, text, *options, ranks=1, out="out"):
    result = run([scene(text, out + ".yaml"), "-output_dir", out, "-output_overwrite", "-output_every", "0", *options], ranks)
    assert result.status == 0, str(result)
    with open(result.folder / out / "series.csv") as series, open(result.folder / out / "bodies.csv") as bodies:
        return list(csv.DictReader(series)), list(csv.DictReader(bodies))


@pytest.mark.parametrize("method, speed, power", [("aligned", 2e-4, 4e-3), ("penalty", 1e-2, 5e-2), ("nodal", 4e-2, 0.25)])
def test_a_disc_swims_in_free_space(run, scene, method, speed, power):
    """At B1/2 whatever B2, with the power 2 pi mu sum n B_n^2; 4 cells a radius. The momentum balance closes."""
    series, _ = solve(run, scene, DISC, "-couple_method", method)
    assert float(series[-1]["swimming_speed"]) == pytest.approx(0.5, rel=speed)
    assert float(series[-1]["slip_power"]) == pytest.approx(POWER, rel=power)
    assert float(series[-1]["momentum_error"]) < 1e-6


@pytest.mark.parametrize("dim, tolerance", [(2, 1e-5), (3, 1e-4)])
def test_a_treadmill_turns_and_the_fluid_rests(run, scene, dim, tolerance):
    """Slip e_z x r: the body turns at -1, so that its surface stands still. In gradient form the torque lacks mu int n x s."""
    box = lambda number: "[" + ", ".join([number] * dim) + "]"
    text = f"""mesh: {{cells: {box('12')}, lower: {box('-1')}, upper: {box('1')}}}
flow: {{density: 1e-8, viscosity: 1, convection: false}}
couple: {{method: aligned}}
particle:
  groups: wheel
  wheel: {{shape: circle, radius: 0.5, density: 1e-8, position: {box('0.013')}, slip: {{velocity: ["-y", x{', 0' * (dim - 2)}]}}}}
sim: {{dt: 1e-3, steps: 1}}
"""
    series, bodies = solve(run, scene, text, "-flow_ksp_rtol", "1e-10")
    assert float(bodies[-1]["omega_z"]) == pytest.approx(-1, abs=tolerance)
    assert abs(float(series[-1]["slip_power"])) < math.pi * tolerance  # 4 pi mu a^2, 8 pi mu a^3: torque over rate of rotation


@pytest.mark.parametrize("method", ["aligned", "penalty"])
def test_ranks_and_restart(run, scene, tmp_path, method):
    """The same on 1, 2, 3 ranks, and bit for bit after a restart."""
    text = SEVERAL.replace("aligned", method)
    if method == "penalty":
        text = text.replace("ellipse, a: 0.3, b: 0.2", "circle, radius: 0.2").replace('velocity: ["-y", x]', "modes: [0.5]")
    _, one = solve(run, scene, text, "-flow_ksp_rtol", "1e-10")
    for ranks in 2, 3:
        _, more = solve(run, scene, text, "-flow_ksp_rtol", "1e-10", ranks=ranks, out=f"out{ranks}")
        for a, b in zip(one, more):
            for name in "x", "y", "angle", "u", "v", "omega_z":
                assert float(a[name]) == pytest.approx(float(b[name]), abs=1e-6), (ranks, name)
    again = run([scene(text, "out.yaml"), "-output_dir", "again", "-output_every", "0", "-flow_ksp_rtol", "1e-10",
                 "-sim_restart", str(tmp_path / "out2" / "checkpoint_1.h5")], 2)
    assert again.status == 0, str(again)
    lines = [(tmp_path / name / "bodies.csv").read_text().splitlines()[-3:] for name in ("out2", "again")]
    assert lines[0] == lines[1]


@pytest.mark.parametrize("change, message", [
    (("modes: [1, 3]", "modes: [1, 3], velocity: [1, 0]"), "both give the slip of group 'swimmer'"),
    (("shape: circle, radius: 0.5", "shape: ellipse, a: 0.5, b: 0.3"), "-particle_swimmer_slip_modes is for discs and spheres"),
    (("modes: [1, 3]", "direction: [1, 0]"), "-particle_swimmer_slip_direction needs -particle_swimmer_slip_modes"),
    (("modes: [1, 3]", "modes: [1, 3], direction: [0, 0]"), "a direction has a length"),
    (("modes: [1, 3]}}\nsim: {dt: 1e-3, steps: 1}", 'modes: ["sin(t)"]}, free: none}\nsim: {steady: true}'), "has no steady state"),
    (("  viscosity: 1\n  convection: false\n" + DISC[DISC.index("  bc:"):DISC.index("particle:")], "  active: false\n"), "slip_* needs a flow"),
    (("density: 1e-8, position: [0, 0]", "density: 1e-8, position: [0, 0], pivot: [0.1, 0]"), "without -particle_swimmer_pivot"),
    (("density: 1e-8, position: [0, 0]", "position: [0, 0], material: neo_hookean, shear_modulus: 1"), "-particle_swimmer_slip_modes is for rigid bodies"),
    (("modes: [1, 3]", "velocity: [1, 0]"), "not continued: use -couple_method aligned"),
])
def test_refusals(run, scene, change, message):
    result = run([scene(DISC.replace(*change)), "-output_dir", "out"])
    assert result.status != 0 and message in result.err + result.out, str(result)
    assert (result.err + result.out).count("error:") == 1


@pytest.mark.parametrize("dim, cells, k", [(2, 24, 1e-3), (2, 24, 1), (2, 24, 5), (3, 12, 1), (3, 12, 5)])
def test_a_phoretic_body_in_a_gradient(run, scene, dim, cells, k):
    """A body that is held in a fluid without inertia, in a periodic box, exerts no force and drives the fluid as fast as it would swim itself: mobility times gradient, 1/(1 + k) and 2/(2 + k) of it for the ratio k of conductivities (Anderson 1989); without net flux less by the fraction of the volume, in the gradient that its images leave (Clausius & Mossotti)."""
    box = lambda *number: "[" + ", ".join(number[:dim]) + "]"
    text = f"""mesh: {{cells: {box(*[str(cells)] * 3)}, lower: {box("-2", "-2", "-2")}, upper: {box("2", "2", "2")}, periodic: {box("x", "y", "z")}}}
flow: {{density: 1e-8, viscosity: 1, convection: false}}
scalars: heat
scalar: {{heat: {{conductivity: 1000, gradient: {box("0.3", "0.4", "0")}}}}}
couple: {{method: aligned}}
particle:
  groups: p
  p: {{shape: circle, radius: 0.6, position: {box("0.031", "0.017", "0.02")}, free: none, heat: {{conductivity: {1000 * k}}}, slip: {{mobility: 2, scalar: heat}}}}
sim: {{dt: 1e-3, steps: 5}}
"""
    series, _ = solve(run, scene, text, "-flow_ksp_rtol", "1e-9")  # the mean velocity hangs on little momentum
    full = math.pi * 0.6**2 / 16 if dim == 2 else 4 / 3 * math.pi * 0.6**3 / 64
    part = (dim - 1) / (dim - 1 + k) * (1 - full) / (1 - full * (k - 1) / (k + dim - 1))
    for axis, slope in (("x", 0.3), ("y", 0.4)):
        assert float(series[-1]["mean_velocity_" + axis]) == pytest.approx(-2 * slope * part, rel=4e-3 if dim == 2 else 1e-2)


PERIODIC = """units: {length: um, time: s, mass: ng}
mesh: {cells: [36, 36], lower: [0, 0], upper: [120, 120], periodic: [x, y]}
flow: {density: 1e-3, viscosity: 1e3}
particle: {groups: s, s: {shape: circle, radius: 10, density: 1e-3, position: [51.3, 62.1], slip: {modes: [200, 400]}}}
contact: {law: none}
sim: {dt: 0.01, steps: 8}
output: {every: 0}
"""


@pytest.mark.parametrize("preset, cells, promised", [("fast", "18,18", 0.05), ("balanced", "48,48", 0.01), ("accurate", "36,36", 0.002)])
def test_presets_promise_the_speed_of_a_swimmer(run, scene, preset, cells, promised):
    """A force-free disc in a periodic box, in micrometres: B1/2 times the share of fluid (1 - 2.18 %). What the mean velocity would gather is held, and
    the error of momentum is that of tractions, not of forces that are nothing."""
    done = run([scene(PERIODIC, "swim.yaml"), "-preset", preset, "-mesh_cells", cells])
    assert not done.status, done.text
    last = list(csv.DictReader((done.folder / "out/swim/series.csv").open()))[-1]
    assert float(last["swimming_speed"]) == pytest.approx(97.818, rel=promised)
    assert float(last["momentum_error"]) < 1e-3 and abs(float(last["mean_velocity_x"])) < 1e-9


def test_presets_refuse_swimmers_of_few_cells(run, scene):
    done = run([scene(PERIODIC, "swim.yaml"), "-preset", "balanced"])
    assert done.status and "group 's' is 6.0 cells thick and needs 8.0" in done.text and "use -preset accurate (0.2 %)" in done.text, done.text


SPHERE = """mesh: {cells: [6, 6, 6], lower: [-12, -12, -12], upper: [12, 12, 12], levels: 3, track: true}
flow:
  density: 1
  viscosity: 1
  bc: {left: {type: inflow, velocity: [0, 0, 0]}, right: {type: inflow, velocity: [0, 0, 0]}, bottom: {type: slip}, top: {type: slip}, front: {type: slip}, back: {type: slip}}
couple: {method: aligned}
particle:
  groups: swimmer
  swimmer: {shape: circle, radius: 1, density: 1, position: [0.013, -0.021, 0.034], velocity: [0.8, 0, 0], slip: {modes: [1.5, 4.5]}}
sim: {dt: 1, steps: 10, frame: body, frame_axes: x}
"""


def test_inertia_slows_a_puller(run, scene, monkeypatch):
    """Sphere at Re 1, 2 cells a radius, in a box of 12 radii that goes along, against the spectral solution, which knows Stokes' drag. The speed still
    falls: .816 at t = 20 with 4 cells a radius and 20 radii"""
    pytest.importorskip("numpy")
    monkeypatch.syspath_prepend(str(ROOT / "runs/studies/swimmers"))
    import inertia

    exact = inertia.Squirmer(modes=6, radial=32, outer=12)
    phi = exact.r * 0
    field, curl = [[f, phi, phi, phi, phi, phi] for f in (exact.r / 2 - 0.75 + 0.25 / exact.r**2, 1.5 / exact.r**2)]
    numpy = inertia.np
    assert exact.force(numpy.array(field), numpy.array(curl), 0)[0] == pytest.approx(6 * math.pi, rel=1e-9)
    series, _ = solve(run, scene, SPHERE)
    assert float(series[-1]["swimming_speed"]) == pytest.approx(exact.swim(3, 1)[0], rel=1e-2)


def test_a_janus_disc_swims_to_its_source(run, tmp_path):
    """The first modes of the flux of one half: .2887 of mobility flux/diffusivity between walls (1/pi in free space, .2848 in a circle of 6 radii)"""
    run([ROOT / "runs/janus.yaml", "-particle_janus_slip_mobility", "0.01", "-particle_janus_position", "0.01,0.02", "-particle_janus_solute_flux", "5+20/pi*x", "-sim_dt", "0.2",
         "-sim_time", "2.4", "-output_every", "0", "-output_dir", tmp_path / "out"])
    with open(tmp_path / "out" / "series.csv") as file:
        last = list(csv.DictReader(file))[-1]
    assert float(last["swimming_speed"]) == pytest.approx(0.002848, rel=0.02)
    assert float(last["scalar_source_solute"]) == pytest.approx(10 * math.pi, rel=1e-3)
