"""Scenes of single bodies (all of their references: make validate) at reduced size, against what is known exactly."""
import csv
import json
import math
from pathlib import Path

import pytest

RUNS = Path(__file__).resolve().parent.parent.parent / "runs"


@pytest.fixture
def bodies(run):
    """bodies(scene, group, *args): run a scene of runs/, return the rows of one group and the summary."""

    def start(scene, group, *args):
        result = run([RUNS / f"{scene}.yaml", "-output_dir", "out", "-output_every", "0", *args])
        assert result.status == 0, str(result)
        with open(result.folder / "out" / "bodies.csv") as file:
            rows = [row for row in csv.DictReader(file) if row["group"] == group]
        return rows, json.loads((result.folder / "out" / "summary.json").read_text())

    return start


def nearest(rows, time, name):
    return float(min(rows, key=lambda row: abs(float(row["time"]) - time))[name])


# density ratio: square of the first wave number (R = 2, r = 1), and the times between which the first mode decays alone
DECAY = {0.01: (5.1542, 0.8, 1.6), 1: (3.882688, 1, 2), 10: (0.94027, 2, 4)}
CONTAINER, IMMERSED = "rotating-container", "rotating-container-immersed"


@pytest.mark.parametrize("scene, density", [(CONTAINER, 0.01), (CONTAINER, 1), (CONTAINER, 10), (IMMERSED, 0.01)])
def test_rotating_container(bodies, scene, density):
    wave, begin, end = DECAY[density]
    rows, _ = bodies(scene, "disc", "-particle_disc_density", str(density), "-sim_time", str(end))
    lag = [1 - nearest(rows, t, "omega_z") / 0.01 for t in (begin, end)]
    rate = math.log(lag[0] / lag[1]) / (end - begin)
    assert abs(rate / wave - 1) < 0.01, f"decay rate {rate:g}, exact {wave:g}"
    assert max(abs(float(row[axis])) for row in rows for axis in "xy") < 1e-6


@pytest.mark.parametrize("scene, viscosity, step", [(CONTAINER, 0.001, 20), (CONTAINER, 0.01, 10), (CONTAINER, 1, 0.1), (IMMERSED, 0.1, 1)])
def test_rotating_container_ends_as_a_rigid_body(bodies, scene, viscosity, step):
    """Any step will do to get there, as long as the container turns by little in it (a neutral disc is at home everywhere, and strays)."""
    end = 4 / viscosity
    rows, _ = bodies(scene, "disc", "-flow_viscosity", str(viscosity), "-sim_dt", str(step), "-sim_time", str(end))
    assert abs(nearest(rows, end, "omega_z") / 0.01 - 1) < 1e-4


def test_oscillating_cylinder(bodies):
    """Half a period on a coarse mesh: the cylinder is where it should be; the mean force over an interval is that of the published curve."""
    rows, _ = bodies("oscillating-cylinder", "cylinder", "-mesh_focus_h", "0.0125", "-sim_dt", "0.02", "-sim_time", "1.2")
    for row in rows:
        assert abs(float(row["x"]) - 1.1 - 0.25 * math.sin(math.pi / 2 * float(row["time"]))) < 1e-9
    drag = [129.69 * float(row["force_x"]) for row in rows if 0.9 < float(row["time"]) < 1.1]
    assert abs(sum(drag) / len(drag) - 1.3537) < 0.25  # D/h = 8


def test_small_oscillations(bodies):
    """Added mass and drag of a cylinder that oscillates by a tenth of a cell, method aligned, are those of Stokes (1851): 0.2 and 0.4 % off at 5 cells a diameter with the box's walls, 21 and 17 % with methods nodal and penalty."""
    options = ["-particle_cylinder_motion_amplitude", "-0.02,0", "-mesh_focus_h", "0.2", "-mesh_growth", "0.3,0.3", "-sim_dt", "0.05", "-sim_time", "10"]
    rows, _ = bodies("studies/boundary/inline", "cylinder", *options)
    rate, mass, drag, n = 2 * math.pi / 5, 0, 0, 0
    for row in rows:
        if float(row["time"]) > 5 + 1e-9:  # the second period; x = -0.02 sin(rate t)
            mass -= 2 * float(row["force_x"]) * math.sin(rate * float(row["time"]))
            drag += 2 * float(row["force_x"]) * math.cos(rate * float(row["time"]))
            n += 1
    displaced = math.pi / 4 * 0.02 * rate**2  # its inertia
    assert n == 100 and mass / n / displaced == pytest.approx(1.50622, rel=0.005), mass / n / displaced
    assert drag / n / displaced == pytest.approx(0.56634, rel=0.01), drag / n / displaced


def test_heart_valve(bodies):
    """Between its stops, fully open in the first half of the period; in the second half the stronger back-flow swings it further."""
    swing = []
    for inlet in (0.925, 1.25):
        rows, _ = bodies("heart-valve", "flap", "-mesh_cells", "32,8", "-sim_dt", "0.02", "-sim_time", "0.9", "-flow_bc_left_factor", f"{inlet},1,1", "-output_overwrite")
        angle = {round(float(row["time"]), 3): float(row["angle"]) for row in rows}
        assert 0.3 <= min(angle.values()) and max(angle.values()) <= math.pi / 2
        assert max(a for t, a in angle.items() if 0.2 < t < 0.5) < 0.3 + 1e-6
        swing.append(max(a for t, a in angle.items() if t > 0.5))
    assert swing[0] > swing[1] + 0.1 > 0.41, swing


def test_heart_valve_thin(bodies):
    """A flap of a quarter of a cell's thickness is a path of edges and swings as on a mesh four times as fine (0.742); held by the penalty it would leak (0.718)."""
    rows, _ = bodies("heart-valve", "flap", "-mesh_cells", "32,8", "-sim_dt", "0.02", "-sim_time", "0.9", "-couple_method", "aligned", "-particle_flap_thickness", "0.03")
    assert abs(max(float(row["angle"]) for row in rows if float(row["time"]) > 0.5) - 0.742) < 0.01


@pytest.mark.parametrize("scene, group", [("lift-off-circle", "disc"), ("lift-off-ellipse", "ellipse")])
def test_lift_off(bodies, scene, group):
    """In its first moments the body rises and rolls with the shear; a heavier one rises less."""
    height = []
    for density in ("1.01", "1.05"):
        rows, _ = bodies(scene, group, "-sim_time", "0.76", "-sim_dt", "0.04", f"-particle_{group}_density", density, "-output_overwrite")
        assert float(rows[-1]["omega_z"]) < -0.5, rows[-1]
        height.append(float(rows[-1]["y"]) - float(rows[0]["y"]))
    assert height[0] > height[1] + 0.02 and height[0] > 0.03, height


def test_airfoil_rotating(bodies):
    """The airfoil turns away from the stream about its mass centre, which stays where it is."""
    rows, _ = bodies("airfoil-rotating", "airfoil", "-mesh_focus_h", "0.1", "-mesh_growth", "0.3,0.3", "-sim_dt", "0.1", "-sim_time", "2")
    assert float(rows[-1]["angle"]) > 0.2 and float(rows[-1]["omega_z"]) > 0.1, rows[-1]
    assert all(abs(float(row["x"]) - 0.42) + abs(float(row["y"])) < 1e-9 for row in rows)


def test_scene_in_a_moving_frame(bodies):
    """Walls, fluid and disc that start with one velocity keep it, whatever the mesh and the method."""
    rows, _ = bodies("poiseuille-migration", "disc", "-flow_force", "0,0", "-mesh_cells", "12,12", "-sim_time", "4")
    for row in rows:
        assert abs(float(row["u"]) + 0.044) < 1e-8 and abs(float(row["v"])) < 1e-8, row


def test_two_falling_discs_with_two_iterations(bodies):
    """Solver fast beside the coupled solve on a coarse mesh; a single sweep blew up within 20 steps."""
    speed = []
    for solver in ("fast", "balanced"):
        rows, _ = bodies("dkt", "trailer", "-mesh_cells", "32,96", "-sim_dt", "2e-3", "-sim_time", "0.06", "-flow_solver", solver, "-output_overwrite")
        speed.append(float(rows[-1]["v"]))
    assert speed[1] < -5 and abs(speed[0] / speed[1] - 1) < 0.01, speed


def test_dense_bed_on_many_ranks(run):
    """Discs of one and a half cells, so that most cells meet several: the pressure's preconditioner stays definite where ranks sweep at the same time, and the ranks agree."""
    energy = []
    for ranks in (1, 2, 4):
        args = ["-mesh_cells", "48,48", "-sim_steps", "1", "-output_every", "0", "-output_overwrite", "-flow_ksp_rtol", "1e-6", "-flow_rtol_start", "0"]
        result = run([RUNS / "sedimentation-504.yaml", "-output_dir", "out", *args], ranks)
        assert result.status == 0, str(result)
        with open(result.folder / "out" / "series.csv") as file:
            energy.append(float(list(csv.DictReader(file))[-1]["kinetic_energy"]))
    assert max(energy) < (1 + 1e-4) * min(energy), energy


def test_bed_that_loosens(run):
    """Discs whose gaps open one by one: where body nodes were too soft in the pressure's preconditioner, iterations grew with the gaps."""
    result = run([RUNS / "fluidization.yaml", "-sim_steps", "40", "-output_every", "0", "-output_dir", "out"])
    assert result.status == 0, str(result)
    with open(result.folder / "out" / "series.csv") as file:
        series = list(csv.DictReader(file))
    assert max(int(row["outer_iterations"]) for row in series) <= 8, str(result)
    assert max(float(row["momentum_error"]) for row in series) < 1e-4
    assert json.loads((result.folder / "out" / "summary.json").read_text())["quantities"]["overlap_max"] < 0.01


def test_light_and_heavy(run):
    """A disc of density ratio .001 beside one of 8, ten steps: the balance of momentum closes, and both obey the free-fall bound; the explicit step refuses it."""
    coarse = ["-mesh_cells", "32,48", "-sim_steps", "10", "-output_dir", "out", "-output_every", "0"]
    result = run([RUNS / "light-and-heavy.yaml", "-flow_rtol_max", "1e-6", *coarse])
    assert result.status == 0, str(result)
    with open(result.folder / "out" / "series.csv") as file:
        assert max(float(row["momentum_error"]) for row in csv.DictReader(file)) < 1e-5
    with open(result.folder / "out" / "bodies.csv") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        ratio = {"light": 0.001, "heavy": 8}[row["group"]]
        fall = 981 * abs(ratio - 1) / (ratio + 1) * float(row["time"])  # inviscid, with the added mass of a disc in open fluid
        speed = float(row["v"]) * (1 if ratio < 1 else -1)
        assert 0.5 * fall < speed < fall, row
    refused = run([RUNS / "light-and-heavy.yaml", "-couple_type", "explicit", *coarse, "-output_overwrite"])
    assert refused.status != 0 and "Use -couple_type implicit" in refused.err
