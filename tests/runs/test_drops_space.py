"""Drops in space: exact solutions at reduced size, the same on all numbers of ranks, restarts, refusals."""

import json
import math

import h5py
import numpy as np
import pytest

from conftest import ROOT, read_rows
from test_drops import find_energy_left

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
        return [read_rows(result.folder / folder / f"{name}.csv") for name in ("drops", "series")]

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


def test_turned(run, scene):
    """An ellipsoid starts turned as its quaternion says and then by its angle about its axis, as rigid bodies do: the long axis of its moments."""
    turned = "shape: ellipse, a: 0.36, b: 0.24, c: 0.24, quaternion: [0.9659258, 0, 0, 0.2588190], axis: [0, 2, 0], angle: 40 deg"
    result = run([scene(SCENE.replace("shape: circle, radius: 0.25", turned)), "-output_dir", "out", "-sim_dt", "0.0005", "-sim_steps", "1"])
    assert result.status == 0, str(result)
    row = read_rows(result.folder / "out" / "drops.csv")[0]
    about_z, about_y = math.radians(30), math.radians(40)
    right = (math.cos(about_y) * math.cos(about_z), math.sin(about_z), -math.sin(about_y) * math.cos(about_z))
    assert abs(sum(row[f"axis_{name}"] * x for name, x in zip("xyz", right))) > 1 - 1e-3
    assert row["deformation"] == pytest.approx(0.2, abs=0.01) and row["volume"] == pytest.approx(4 * math.pi / 3 * 0.36 * 0.24**2, rel=5e-3)


def test_carried(drops):
    """Through a periodic box with a uniform flow, over its sides (two cells a radius): a ball that goes with the flow."""
    rows, _ = drops("-mesh_periodic", "x,y,z", "-flow_velocity", "1,0.5,0.25", "-sim_dt", "0.025", "-sim_steps", "6", "-particle_drop_position", "0.9,0.5,0.1")
    for row in rows:
        for name, speed in (("u", 1), ("v", 0.5), ("w", 0.25)):
            assert row[name] == pytest.approx(speed, abs=1e-4), name
        assert 1 - row["sphericity"] < 5e-6 and abs(row["volume_error"]) < 1e-10
    for name, place in (("x", 1.05), ("y", 0.575), ("z", 0.1375)):
        assert (rows[-1][name] - place + 0.5) % 1 == pytest.approx(0.5, abs=1e-4), name


def test_carried_iterations(drops):
    """The solver takes at most 20 iterations a step of a drop that is carried through a periodic box (39 while the pressure did not know the tension)."""
    _, series = drops(
        *["-mesh_cells", "10,10,10", "-mesh_periodic", "x,y,z", "-flow_velocity", "1,0.5,0.25", "-particle_drop_radius", "0.3"],
        *["-sim_dt", "0.02", "-sim_steps", "2"],
    )
    assert max(row["outer_iterations"] for row in series) <= 20


def test_bubble(run):
    """The scene on 6 x 12 x 6 cells, three a diameter: a bubble that begins to rise along the axis of the box."""
    result = run([ROOT / "runs" / "bubble-rising-3d.yaml", "-output_dir", "out", "-output_every", "0", "-mesh_cells", "6,12,6", "-sim_steps", "3"])
    assert result.status == 0, str(result)
    rows = read_rows(result.folder / "out" / "drops.csv")
    assert 0.1 < rows[-1]["v"] < 0.14 and max(abs(rows[-1]["u"]), abs(rows[-1]["w"])) < 2e-5
    assert abs(rows[-1]["volume_error"]) < 1e-8 and abs(rows[-1]["x"] - 0.5) < 1e-6


FALLS = ["-mesh_cells", "6,6,6", "-particle_drop_radius", "0.33", "-flow_gravity", "0,-1,0", "-flow_solver", "direct"]


def test_ranks(drops):
    """The same on 1, 2 and 3 ranks; momentum balances."""
    (one, series), *others = (drops(*FALLS, "-sim_steps", "2", "-monitor_momentum", ranks=ranks, folder=f"r{ranks}") for ranks in (1, 2, 3))
    assert max(row["momentum_error"] for row in series) < 1e-12
    for rows, _ in others:
        for name in ("volume", "y", "v", "sphericity", "deformation"):
            assert rows[-1][name] == pytest.approx(one[-1][name], rel=1e-7, abs=1e-9), name


@pytest.mark.parametrize("stop", ["1", "2"])
def test_restart(drops, stop):
    """A run that stops and goes on has the bits of one that does not stop, after the first step too, whose mesh has the shape itself."""
    options = [*FALLS, "-checkpoint_every", stop]
    whole = drops(*options, "-sim_steps", "3", folder="whole")[0]
    drops(*options, "-sim_steps", stop, folder="part")
    assert drops(*options, "-sim_steps", "3", "-sim_restart", "latest", folder="part")[0] == whole and len(whole) == 3


def test_apart(drops):
    """Two drops that do not merge, one cell between them: it is not filled when the mesh is mended."""
    other = {"shape": "circle", "radius": "0.3", "position": "1.29,0.5,0.5", "material": "fluid", "surface_tension": "1", "coalescence": "never"}
    options = [word for name, value in other.items() for word in (f"-particle_other_{name}", value)]
    rows, series = drops(
        *["-mesh_cells", "16,8,8", "-mesh_upper", "2,1,1", "-particle_groups", "drop,other", "-particle_drop_radius", "0.3", *options],
        *["-particle_drop_position", "0.59,0.5,0.5", "-particle_drop_coalescence", "never", "-sim_steps", "1"],
    )
    assert series[0]["drops"] == 2 and [row["volume"] for row in rows] == pytest.approx([4 * math.pi / 3 * 0.027] * 2, rel=1e-3)


RISES = """
mesh: {cells: [4, 16, 4], upper: [0.5, 2, 0.5]}
flow:
  density: 1000
  viscosity: 10
  gravity: [0, -0.98, 0]
  solver: balanced
  bc: {left: {type: slip}, back: {type: slip}}
particle:
  groups: bubble
  bubble: {shape: circle, radius: 0.25, position: [0, 0.5, 0], material: fluid, density: 100, viscosity: 1, surface_tension: 24.5, contact_angle: 90 deg}
sim: {dt: 0.06, steps: 4}
output: {every: 0}
"""


def test_levels(run, scene):
    """A bubble rises between mirrors through cells of two sizes, which are made anew around it as it goes: as on cells of the small size, with the bits of a restart; energy's books close."""

    def start(folder, *options):
        result = run([scene(RISES), "-output_dir", folder, *options])
        assert result.status == 0, str(result)
        return read_rows(result.folder / folder / "drops.csv"), json.loads((result.folder / folder / "summary.json").read_text())

    levels = ["-mesh_cells", "2,8,2", "-mesh_levels", "1", "-mesh_track", "-mesh_track_distance", "0.1", "-checkpoint_every", "2", "-monitor_energy", "true"]
    (whole, summary), (even, _) = start("whole", *levels), start("even")
    assert summary["quantities"]["mesh_changes"] == 2 and summary["quantities"]["energy_error"] < 1e-5
    for name, bound in (("y", 1e-4), ("v", 2e-3), ("sphericity", 1e-4)):
        assert whole[-1][name] == pytest.approx(even[-1][name], rel=bound), name
    assert max(abs(row["volume_error"]) for row in whole) < 1e-6
    start("part", *levels, "-sim_steps", "2")
    assert start("part", *levels, "-sim_restart", "latest")[0] == whole and len(whole) == 4


BALL = ["-particle_groups", "drop,ball", "-particle_ball_shape", "circle", "-particle_ball_radius", "0.2", "-particle_ball_density", "2", "-particle_ball_position", "0.5,1.12,0.5"]
SMALL = ["-particle_ball_radius", "0.1", "-particle_ball_position", "0.2,0.2,0.2"]
ACROSS = ["-mesh_periodic", "x", "-particle_drop_position", "0.05,0.5,0.5", "-particle_ball_position", "0.95,0.5,0.5"]
SINKS = ["-mesh_cells", "8,12,8", "-mesh_upper", "1,1.5,1", "-flow_viscosity", "0.05", "-flow_gravity", "0,-8,0", "-sim_dt", "0.04", "-particle_drop_position", "0.5,0.45,0.5"]


@pytest.fixture
def pushed(drops):
    """pushed(*options, ...): a ball that sinks towards a drop, held by the penalty."""

    def start(*options, **how):
        softer = ["-particle_drop_radius", "0.26", "-particle_drop_viscosity", "0.05", "-couple_method", "penalty", "-monitor_momentum"]
        return drops(*SINKS, *BALL, *softer, *options, **how)

    return start


def test_ball_beside(pushed, run, scene):
    """A rigid ball beside a drop: momentum balances, and one that pushes a drop of the same fluid without tension falls as without it (3.2 cells a diameter)."""
    rows, series = pushed("-particle_drop_density", "1", "-particle_drop_surface_tension", "0", "-sim_steps", "5")
    assert max(row["momentum_error"] for row in series) < 1e-12 and max(abs(row["volume_error"]) for row in rows) < 1e-10
    alone = SCENE.replace("groups: drop\n  drop: {shape", "groups: ball\n  ball: {shape").split("material")[0].rstrip(", ") + "}\nsim: {dt: 1}\noutput: {every: 0}\n"
    result = run([scene(alone), "-output_dir", "alone", *SINKS[:-2], *BALL[2:], "-couple_method", "penalty", "-sim_steps", "5"])
    assert result.status == 0, str(result)
    with_drop, without = (read_rows(result.folder / name / "bodies.csv")[-1]["v"] for name in ("out", "alone"))
    assert without < -0.25 and with_drop == pytest.approx(without, rel=5e-3)


def test_ball_ranks_and_restart(pushed):
    """The same on 1 and 2 ranks; a run that stops and goes on has the bits of one that does not."""
    options = ["-particle_drop_density", "0.8", "-flow_solver", "direct", "-checkpoint_every", "1"]
    whole, two = (pushed(*options, "-sim_steps", "2", ranks=ranks, folder=f"r{ranks}")[0] for ranks in (1, 2))
    for name in ("y", "v", "sphericity", "deformation"):
        assert two[-1][name] == pytest.approx(whole[-1][name], rel=1e-7, abs=1e-9), name
    pushed(*options, "-sim_steps", "1", folder="part")
    assert pushed(*options, "-sim_steps", "2", "-sim_restart", "latest", folder="part")[0] == whole


THREAD = """
mesh: {cells: [9, 4, 4], upper: [4.487989505128276, 2, 2]}
flow: {density: 0.001, viscosity: 0.0001, solver: balanced, bc_left: &s {type: slip}, bc_right: *s, bc_bottom: *s, bc_top: *s, bc_back: *s, bc_front: *s}
particle:
  groups: thread
  thread: {region: "sqrt(y^2 + z^2) - 1 - 0.02*cos(0.7*x)", material: fluid, density: 1, viscosity: 0.1, surface_tension: 1, contact_angle: 90 deg}
sim: {dt: 0.2, steps: 20}
output: {every: 0}
"""


def test_thread(run, scene):
    """A liquid thread between smooth walls, a quarter of half a wave: the growth rate of its wave is that of Chandrasekhar (two cells a radius)."""
    result = run([scene(THREAD), "-output_dir", "out"])
    assert result.status == 0, str(result)
    rows = read_rows(result.folder / "out" / "drops.csv")
    half = math.pi / 0.7
    wave = [(half / 2 - row["x"]) * 0.49 * half / 4 for row in rows]  # of the amplitude, by the centre
    assert wave[0] == pytest.approx(0.02, rel=0.01) and max(abs(row["volume_error"]) for row in rows) < 1e-12
    # two waves, one that grows and one that fades: wave[n + 4] = p wave[n] + q wave[n - 4]
    moments = [[sum(wave[i + a] * wave[i + b] for i in range(8, 16)) for b in (0, -4, 4)] for a in (0, -4)]
    (aa, ab, ac), (_, bb, bc) = moments
    p, q = (ac * bb - bc * ab) / (aa * bb - ab * ab), (aa * bc - ab * ac) / (aa * bb - ab * ab)
    assert math.log(p / 2 + math.sqrt(p * p / 4 + q)) / 0.8 == pytest.approx(0.28042, rel=0.01)


BALLS = """
mesh: {cells: [12, 5, 5], lower: [-0.63, 0, 0], upper: [0.63, 0.54, 0.54]}
flow: {density: 1, viscosity: 0.1, solver: balanced, velocity: "-x,y/2,z/2", bc_left: &s {type: inflow, velocity: "-x,y/2,z/2"}, bc_right: *s, bc_top: *s, bc_front: *s, bc_bottom: &m {type: slip}, bc_back: *m}
particle:
  groups: drop
  drop: {region: "min(sqrt((x - 0.285)^2 + y^2 + z^2), sqrt((x + 0.285)^2 + y^2 + z^2)) - 0.23", material: fluid, density: 1, surface_tension: 0.5, contact_angle: 90 deg}
sim: {dt: 0.04, steps: 6}
monitor: {energy: true}
output: {every: 0}
"""


def test_merging(run, scene):
    """Two balls that a flow presses together, a quarter between mirrors: volume is kept where they merge and after it; energy's books close, with what the event took."""
    result = run([scene(BALLS), "-output_dir", "out"])
    assert result.status == 0, str(result)
    series = read_rows(result.folder / "out" / "series.csv")
    assert [row["drops_merged"] for row in series] == [0] * 3 + [1] * 3 and all(row["drops_broken"] == 0 for row in series)
    assert max(row["drop_volume_error"] for row in series) < 1e-4 and series[-1]["drop_volume_error"] < 1e-8
    assert [row["energy_events"] != 0 for row in series] == [False] * 3 + [True] * 3
    assert find_energy_left(series) < 1e-3


CAP = """
mesh: {cells: [8, 4, 8], upper: [1.5, 0.75, 1.5]}
flow: {density: 1, viscosity: 1, solver: direct, bc_bottom: {type: slip}}
particle:
  groups: drop
  drop: {region: "sqrt((x - 0.76)^2 + (y + 0.3)^2 + (z - 0.74)^2) - 0.6", material: fluid, density: 1, viscosity: 1, surface_tension: 1, contact_angle: 60 deg}
sim: {dt: 0.02, steps: 2}
monitor: {momentum: true}
output: {every: 0}
"""


@pytest.mark.parametrize("angle, fast", [("60", False), ("90", True)])
def test_cap(run, scene, angle, fast):
    """The cap of a ball stays as it is at its own contact angle; at another the line moves. Momentum balances with the pull of the wall."""
    result = run([scene(CAP), "-output_dir", "out", "-particle_drop_contact_angle", angle + "deg", "-flow_bc_bottom_navier", "0.2"])
    assert result.status == 0, str(result)
    rows, series = (read_rows(result.folder / "out" / f"{name}.csv") for name in ("drops", "series"))
    assert rows[0]["volume"] == pytest.approx(math.pi * 0.09 * 1.5 / 3, rel=1e-3) and abs(rows[-1]["volume_error"]) < 1e-10
    assert (series[-1]["kinetic_energy"] > 1e-5) == fast and (series[-1]["kinetic_energy"] < 1e-8) != fast
    assert max(row["momentum_error"] for row in series) < 1e-9


LAYER = """
mesh: {cells: [4, 4, 4]}
flow: {density: 0.1, viscosity: 0.01, gravity: [0, -1, 0], solver: direct, bc_left: &s {type: slip}, bc_right: *s, bc_bottom: *s, bc_top: *s, bc_back: *s, bc_front: *s}
particle:
  groups: water
  water: {region: "y - 0.45 - 0.03*cos(pi*x)*cos(pi*z)", material: fluid, density: 1, viscosity: 0.02, surface_tension: 0.1, contact_angle: 75 deg}
sim: {dt: 0.05, steps: 2}
monitor: {momentum: true}
output: {every: 0}
"""


def test_layer(run, scene):
    """A layer with a wave between smooth walls that it wets: the same on 1 and 2 ranks, a restart to the bit, momentum balances."""

    def start(folder, steps, ranks=1, *options):
        result = run([scene(LAYER), "-output_dir", folder, "-sim_steps", steps, *options], ranks)
        assert result.status == 0, str(result)
        return [read_rows(result.folder / folder / f"{name}.csv") for name in ("drops", "series")]

    (whole, series), (two, _) = start("whole", "2"), start("two", "2", 2)
    assert whole[-1]["volume"] == pytest.approx(0.45, rel=1e-4) and max(row["momentum_error"] for row in series) < 1e-10
    for name in ("volume", "x", "y", "v", "sphericity"):
        assert two[-1][name] == pytest.approx(whole[-1][name], rel=1e-7, abs=1e-9), name
    start("part", "1", 1, "-checkpoint_every", "1")
    assert start("part", "2", 1, "-sim_restart", "latest")[0] == whole


FLOATS = [
    *["-mesh_cells", "9,7,9", "-mesh_lower", "-0.75,-0.5,-0.75", "-mesh_upper", "0.75,0.6666666666666667,0.75", "-particle_water_region", "y", "-particle_groups", "water,ball"],
    *["-particle_water_contact_angle", "90deg", "-particle_water_viscosity", "0.1", "-particle_water_surface_tension", "0.028125", "-particle_ball_shape", "circle", "-particle_ball_radius", "0.25"],
    *["-particle_ball_density", "1", "-couple_method", "penalty", "-particle_ball_position", "0,-0.1,0", "-monitor_momentum"],
]


def test_floating_angle(run, scene):
    """A ball that floats with its centre below the water, of 3 cells across: a wetting one is drawn down, one that is not up; momentum balances."""
    speed = []
    for angle in ("60", "120"):
        result = run([scene(LAYER), *FLOATS, "-output_dir", angle, "-sim_steps", "2", "-flow_solver", "balanced", "-particle_ball_contact_angle", angle + "deg"])
        assert result.status == 0, str(result)
        series, bodies, drops = (read_rows(result.folder / angle / f"{name}.csv") for name in ("series", "bodies", "drops"))
        assert max(row["momentum_error"] for row in series) < 1e-11 and abs(drops[-1]["volume_error"]) < 1e-6
        assert max(abs(bodies[-1]["u"]), abs(bodies[-1]["w"])) < 2e-3
        speed.append(bodies[-1]["v"])
    assert speed[0] < speed[1] - 1e-3


def test_floating_quarter(run, scene):
    """A quarter of the ball between mirrors: what fluid is inside of it moves with it there too (before the penalty held it, .025 against it)."""
    options = ["-mesh_cells", "5,7,5", "-mesh_lower", "0,-0.5,0", "-particle_ball_density", "0.325", "-particle_ball_contact_angle", "90deg", "-particle_ball_free", "y"]
    result = run([scene(LAYER), *FLOATS, *options, "-output_dir", "out", "-sim_steps", "2", "-flow_solver", "balanced", "-output_every", "2"])
    assert result.status == 0, str(result)
    assert read_rows(result.folder / "out" / "series.csv")[-1]["momentum_error"] < 1e-9
    mesh, fields, bodies = (h5py.File(result.folder / "out" / f"{name}_2.h5") for name in ("mesh", "fields", "bodies"))
    inside = np.linalg.norm(mesh["coordinates"][:] - bodies["position"][0], axis=1) < 0.15
    assert inside.sum() > 10 and np.abs(fields["velocity"][:][inside] - bodies["velocity"][0]).max() < 1e-3


def test_no_mirror(run, scene):
    """A quarter of a ball between walls that the water meets at another angle than 90 degrees: these are no mirrors."""
    result = run([scene(LAYER), *FLOATS, "-output_dir", "out", "-mesh_cells", "5,7,5", "-mesh_lower", "0,-0.5,0", "-particle_ball_contact_angle", "90deg", "-particle_water_contact_angle", "75deg"])
    assert result.status and "which is no mirror" in result.err and result.err.count("error:") == 1, str(result)


def test_floating_scene(run):
    """The scene with 3 cells a radius, which starts without its contact angle: it keeps the volume that its region has outside of the ball, and sinks."""
    options = ["-mesh_focus_h", "0.0834", "-mesh_growth", "1,1,1", "-output_every", "0", "-output_dir", "out", "-sim_steps", "2"]
    result = run([ROOT / "runs" / "sphere-at-interface.yaml", *options])
    assert result.status == 0, str(result)
    bodies, drops = (read_rows(result.folder / "out" / f"{name}.csv") for name in ("bodies", "drops"))
    assert max(abs(row["volume_error"]) for row in drops) < 1e-9 and -0.02 < bodies[-1]["v"] < -1e-3
    assert drops[0]["volume"] == pytest.approx(0.2651897, rel=2e-4)  # by summing over a lattice


def test_floating_energy(run, scene):
    """Energy of surfaces in the first step, in which all is flat: tension times the area outside of the ball."""
    options = ["-particle_ball_contact_angle", "90deg", "-particle_ball_position", "0,0,0", "-sim_steps", "1", "-sim_dt", "0.01", "-monitor_energy"]
    result = run([scene(LAYER), *FLOATS, *options, "-flow_solver", "balanced", "-output_dir", "out"])
    assert result.status == 0, str(result)
    energy = read_rows(result.folder / "out" / "series.csv")[0]["energy"]
    assert energy == pytest.approx(0.028125 * (1.5**2 - math.pi * 0.25**2), rel=2e-3)


@pytest.mark.parametrize(
    "options, message",
    [
        (["-flow_bc_left_type", "no_slip"], "The fluid 'water' reaches the side x = 0."),
        (["-mesh_periodic", "x"], "reaches over a period"),
    ],
)
def test_region_refused(run, scene, options, message):
    """A region that reaches a side that it cannot wet, or over a period."""
    result = run([scene(LAYER), "-output_dir", "out", *options])
    assert result.status != 0 and message in result.err + result.out, str(result)


@pytest.mark.parametrize(
    "options, message",
    [
        (["-particle_drop_contact_angle", "60 deg"], "no plane wall of type slip"),
        (["-flow_velocity_operator", "matrix_free"], "use -flow_velocity_operator assembled"),
        ([*BALL, *SMALL, "-couple_method", "aligned"], "rigid bodies beside them are held by the penalty: give -couple_method penalty"),
        ([*BALL, *ACROSS, "-couple_method", "penalty"], "'ball' overlaps the drop 'drop'"),
        (["-particle_drop_film", "0.05"], "for the plane so far"),
        (["-particle_drop_radius", "0.1"], "use smaller cells (-mesh_cells)"),
        (["-mesh_levels", "1"], "give -mesh_track"),
        (["-mesh_levels", "1", "-mesh_track", "-scalars", "T"], "Drops with -scalars on a mesh that follows"),
        (["-mesh_levels", "1", "-mesh_refine", "b", "-mesh_box_b_corners", "0,0,0,0.5,1,1"], "Levels of the mesh jump at"),
    ],
)
def test_refused(run, scene, options, message):
    """What cannot be yet ends with one message that names the remedy."""
    result = run([scene(SCENE), "-output_dir", "out", "-sim_steps", "1", *options])
    assert result.status != 0 and message in result.err + result.out, str(result)
