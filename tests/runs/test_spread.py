"""Bodies in a flow that each rank knows where it needs them alone (bodies/local.h)."""
import csv
from pathlib import Path

import pytest

RUNS = Path(__file__).resolve().parent.parent.parent / "runs"

CROWD = """mesh: {cells: [24, 24], lower: [0, 0], upper: [1, 1], periodic: x}
flow: {density: 1, viscosity: 0.02, gravity: [2, -10], ksp_rtol: 1e-9}
particle:
  groups: disc, rod
  disc: {shape: circle, radius: 0.04, density: 1.5, place: lattice, count: 30, velocity: [2, 0], lower: [0, 0.05], upper: [1, 0.6], sizes: uniform, sizes_range: [0.7, 1.2]}
  rod: {shape: ellipse, a: 0.06, b: 0.04, density: 1.2, place: lattice, count: 6, velocity: [2, -1], lower: [0, 0.6], upper: [1, 0.95]}
contact: {range: 0.04}
sim: {dt: 0.005, steps: 6}
checkpoint: {every: 3}
output: {every: 0}
"""
# a longer box, of which a rank sees a part; bodies go with the stream and towards the floor
LONG = CROWD.replace("[24, 24]", "[60, 24]").replace("[1, 1]", "[2.5, 1]").replace("[2, 0]", "[4, -4]").replace("[1, 0.6]", "[2.5, 0.3]").replace("[1, 0.95]", "[2.5, 0.95]")
LONG = LONG.replace("ksp_rtol: 1e-9", "initial: uniform, velocity: [4, 0]")


def table(folder):
    with open(folder / "bodies.csv") as file:
        return list(csv.DictReader(file))


# groups that are held, led, turn about a pivot, start with the fluid, are large beside a part; one has coefficients
GROUPS = """mesh: {cells: [24, 24], lower: [0, 0], upper: [1, 1], periodic: x}
flow: {density: 1, viscosity: 0.02, gravity: [2, -10], initial: uniform, velocity: [0.5, 0]}
particle:
  groups: disc, post, wheel, flap, drop
  disc: {shape: circle, radius: 0.04, density: 1.5, place: lattice, count: 12, velocity: [2, 0], lower: [0.55, 0.03], upper: [1, 0.5]}
  post: {shape: circle, radius: 0.2, free: none, position: [0.25, 0.3], reference_speed: 1}
  wheel: {shape: ellipse, a: 0.1, b: 0.04, free: none, position: [0.75, 0.65], angular_velocity: 20}
  flap: {shape: ellipse, a: 0.08, b: 0.04, density: 2, position: [0.2, 0.75], pivot: [-0.05, 0]}
  drop: {shape: circle, radius: 0.04, density: 1, place: lattice, count: 4, lower: [0.35, 0.55], upper: [0.6, 0.95], initial_velocity: fluid}
contact: {range: 0.04}
sim: {dt: 0.005, steps: 6}
checkpoint: {every: 3}
output: {every: 0}
"""
CROWDS = {
    "repulsive": (CROWD, []),
    "none": (CROWD.replace("{range: 0.04}", "{law: none}"), []),
    "groups": (GROUPS, []),
    "groups, nodal": (GROUPS, ["-couple_method", "nodal"]),
    "adaptive": (CROWD, ["-couple_method", "nodal", "-sim_adapt", "-sim_adapt_max", "0.008", "-contact_range", "0.06"]),
    "fast": (CROWD, ["-preset", "fast", "-mesh_cells", "32,32"]),
    "held": (CROWD, ["-couple_backflow", "force"]),
    "travelling": (CROWD, ["-sim_frame", "body", "-sim_frame_body", "7", "-sim_frame_axes", "x"]),
    "shear thinning": (CROWD, ["-flow_rheology", "carreau", "-flow_rheology_index", "0.5"]),
    "explicit contact": (CROWD, ["-contact_coupling", "explicit"]),
    "spring, friction": (CROWD, ["-contact_law", "spring", "-contact_friction", "0.3"]),
    "explicit": (CROWD, ["-couple_type", "explicit", "-particle_disc_density", "4", "-particle_rod_density", "4"]),
    "eddies": (CROWD, ["-flow_rheology", "smagorinsky"]),
    "following": (CROWD, ["-mesh_cells", "12,12", "-mesh_levels", "2", "-mesh_refine", "bodies", "-mesh_track", "true"]),
    "deformed": (LONG, ["-mesh_deform", "-deform_ksp_rtol", "1e-10"]),
    "deformed, groups": (GROUPS, ["-mesh_deform", "-mesh_deform_size", "0.6", "-mesh_deform_width", "0.1", "-deform_ksp_rtol", "1e-10"]),
    "aligned": (CROWD, ["-couple_method", "aligned", "-mesh_cells", "40,40"]),
    "aligned, corners": (CROWD.replace("ellipse, a: 0.06, b: 0.04", "box, size: [0.11, 0.1]"), ["-couple_method", "aligned", "-mesh_cells", "48,48"]),
    "aligned, plates": (CROWD.replace("ellipse, a: 0.06, b: 0.04", "box, size: [0.1, 0.02]"), ["-couple_method", "aligned", "-mesh_cells", "48,48"]),
}
TIGHT = ["-flow_ksp_rtol", "1e-10", "-flow_velocity_tol", "0", "-flow_rtol_start", "0"]


@pytest.mark.parametrize("kind", CROWDS)
def test_a_crowd_in_a_flow_on_some_ranks(run, scene, tmp_path, kind):
    """Bodies that drift over the borders of parts and meet there: as on one rank, also after a restart on others."""
    text, words = CROWDS[kind]
    words, bodies = [*TIGHT, *words], 19 if text == GROUPS else 36
    for ranks in 1, 3:
        result = run([scene(text), "-output_dir", str(ranks), *words], ranks)
        assert result.status == 0, str(result)
    with open(tmp_path / "3" / "series.csv") as file:
        assert (abs(float(list(csv.DictReader(file))[-1]["contact_work"])) > 1e-6) == (kind != "none")
    one, three = table(tmp_path / "1"), table(tmp_path / "3")
    assert len(one) == len(three) == 6 * bodies
    with open(tmp_path / "1" / "series.csv") as file, open(tmp_path / "3" / "series.csv") as other:
        for a, b in zip(csv.DictReader(file), csv.DictReader(other)):
            assert all(float(a[name]) == pytest.approx(float(b[name]), rel=1e-6) for name in ("dt", "kinetic_energy", "cd", "cl_volume") if name in a)
    for name, size in ("x", 1), ("y", 1), ("u", 2), ("v", 2), ("angle", 1), ("omega_z", 10):
        assert max(abs(float(a[name]) - float(b[name])) for a, b in zip(one, three)) < 1e-6 * size, name
    for before, ranks in (3, 3), (3, 2), (1, 2):
        begin, folder = next((tmp_path / str(before)).glob("**/checkpoint_3.h5")), f"again-{before}-{ranks}"
        again = run([scene(text), "-output_dir", folder, "-sim_restart", str(begin), "-checkpoint_every", "0", *words], ranks)
        assert again.status == 0, str(again)
        for a, b in zip(table(tmp_path / folder), three[3 * bodies :], strict=True):
            assert all(abs(float(a[name]) - float(b[name])) < 1e-6 for name in ("x", "y", "u", "v")), ranks


RESTS = """mesh: {cells: [48, 12], lower: [0, 0], upper: [4, 1], periodic: x, deform: true, deform_size: 0.5}
flow: {density: 1, viscosity: 0.02, force: [1, 0]}
particle:
  groups: disc
  disc: {shape: circle, radius: 0.12, free: none, place: lattice, count: 6, velocity: ["t < 0.022 ? 0 : 1", 0]}
sim: {dt: 0.005, steps: 6}
output: {every: 0}
"""


def test_a_mesh_rests_with_its_bodies(run, scene, tmp_path):
    """Bodies that wait before they move: so does the mesh, also where they are dealt out in every step."""
    mesh = {}
    for ranks in 1, 3:
        result = run([scene(RESTS), "-output_dir", str(ranks), *TIGHT, "-deform_ksp_rtol", "1e-10"], ranks)
        assert result.status == 0, str(result)
        with open(tmp_path / str(ranks) / "series.csv") as file:
            mesh[ranks] = [row["deform_jacobian"] for row in csv.DictReader(file)]
        assert mesh[ranks][1] == mesh[ranks][2] == mesh[ranks][3] != mesh[ranks][4] != mesh[ranks][5]
    assert [float(a) for a in mesh[1]] == pytest.approx([float(b) for b in mesh[3]], rel=1e-7)


def test_one_error_for_bodies_of_several_ranks(run, scene):
    """Every rank finds a body of its own that is too fast: one of them is named."""
    result = run([scene(CROWD), "-sim_dt", "0.5"], 3)
    assert result.status != 0 and result.text.count("tumble: error") == 1 and "-sim_max_displacement" in result.text, str(result)


def test_nodes_on_a_surface_on_some_ranks(run, tmp_path):
    """Method nodal, bars of a grate whose surfaces pass through nodes: the last bit of a node's place, which knows how the mesh was made, decides nothing."""
    energy = {}
    for ranks in 1, 2:
        words = ["-sim_steps", "1", "-output_every", "0", "-flow_ksp_rtol", "1e-8", "-flow_velocity_tol", "0", "-flow_rtol_start", "0"]
        result = run([RUNS / "fluidization.yaml", "-output_dir", str(ranks), *words], ranks)
        assert result.status == 0, str(result)
        with open(tmp_path / str(ranks) / "series.csv") as file:
            energy[ranks] = float(list(csv.DictReader(file))[-1]["kinetic_energy"])
    assert energy[1] == pytest.approx(energy[2], rel=1e-7)


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_pile_is_solved_as_far_as_promised(run, tmp_path, ranks):
    """Chains of contacts in the system of flow and bodies: what solver balanced leaves is small (4 % with the ties of all bodies in the velocity's blocks)."""
    energy = []
    for number, words in enumerate((["-flow_ksp_rtol", "1e-9", "-flow_velocity_tol", "0", "-flow_rtol_start", "0"], [])):
        result = run([RUNS / "studies" / "contact" / "pile.yaml", "-output_dir", str(number), *words], ranks)
        assert result.status == 0, str(result)
        with open(tmp_path / str(number) / "series.csv") as file:
            energy.append([float(row["kinetic_energy"]) for row in csv.DictReader(file)])
    assert max(abs(a - b) for a, b in zip(*energy)) < 1e-3 * max(energy[0])


def velocities(folder):
    """By step, of all bodies: u, v and the speed of the surface."""
    steps = {}
    for row in table(folder):
        steps.setdefault(int(row["step"]), []).append((float(row["u"]), float(row["v"]), float(row["omega_z"]) * float(row["radius"])))
    return steps


@pytest.mark.parametrize("method, density, dt, more", [("penalty", 50, 0.01, []), ("nodal", 2, 0.001, []), ("nodal", 2, 0.001, ["-mesh_periodic", "x"])])
def test_bodies_of_a_stiff_pile_are_as_fast_as_promised(run, tmp_path, method, density, dt, more):
    """Contact ten times as stiff, whose forces are most of the right-hand side: shares of that, or of the change, left 3e-3, 2e-1 and 8e-2 of the largest speed."""
    pile = ["-couple_method", method, "-particle_disc_density", str(density), "-sim_dt", str(dt), "-contact_stiffness", "10", "-sim_steps", "4", *more]
    for name, words in ("solved", ["-flow_ksp_rtol", "1e-9", "-flow_velocity_tol", "0", "-flow_rtol_start", "0"]), ("balanced", []):
        result = run([RUNS / "studies" / "contact" / "pile.yaml", "-output_dir", name, *pile, *words])
        assert result.status == 0, str(result)
    solved, balanced = velocities(tmp_path / "solved"), velocities(tmp_path / "balanced")
    for step, bodies in solved.items():
        error = max(abs(a - b) for one, other in zip(bodies, balanced[step]) for a, b in zip(one, other))
        assert error < 1e-3 * max(max(abs(u), abs(v)) for u, v, _ in bodies), step
