"""Bodies and solid boundaries that are no sides of a box: they rest where the geometry says, start and leave by its rules."""
import csv
import itertools
import math

import pytest

ALONE = """\
mesh: {%s}
flow: {active: false, gravity: [%s]}
particle: {groups: d, d: {shape: circle, radius: %g, density: 2, position: [%s]}}
contact: {damping: 0.01}
sim: {dt: 0.005, steps: 400}
output: {progress: 600}
"""
# kind: mesh, gravity, radius, start, what is left of the way to the wall where it rests (a gap below the range, a tenth of the radius)
KINDS = {
    "disc": ("kind: disc, radius: 1, resolution: 4", "0, -10", 0.2, "0.3, 0", lambda x: 1 - math.hypot(*x) - 0.2),
    "annulus": ("kind: annulus, radii: [0.5, 1.5], resolution: 4", "0, -10", 0.15, "0.6, -1", lambda x: 1.5 - math.hypot(*x) - 0.15),
    "fitted": ("kind: fitted, resolution: 4", "-10, 0", 0.04, "0.45, 0.2", lambda x: math.hypot(x[0] - 0.2, x[1] - 0.2) - 0.05 - 0.04),
    "tube": ("kind: tube, radius: 1, length: 2, resolution: 2", "0, -10, 0", 0.2, "0.3, 0, 1", lambda x: 1 - math.hypot(*x[:2]) - 0.2),
    "ball": ("kind: ball, radius: 1, resolution: 2", "0, 0, -10", 0.2, "0.1, 0.2, 0", lambda x: 1 - math.hypot(*x) - 0.2),
    "shell": ("kind: shell, radii: [0.5, 1.5], resolution: 2", "0, 0, -10", 0.2, "0.1, 0.2, -1", lambda x: 1.5 - math.hypot(*x) - 0.2),
    "file": ("kind: file, file: mesh.msh", "0, -10", 0.2, "1.1, 1.2", lambda x: (0.05 + 0.475 * x[1] - abs(x[0] - 1)) / math.hypot(1, 0.475) - 0.2),
}


def write_mesh(path, cells, place, name):
    """Cells nx, ny as a Gmsh file of format 2.2; place(s, t) of the unit square, name(axis, side) of a boundary."""
    number = {}
    nodes = [number.setdefault(i, len(number) + 1) and i for i in itertools.product(range(cells[0] + 1), range(cells[1] + 1))]
    faces = [(name(0, side), (cells[0] * side, j), (cells[0] * side, j + 1)) for side in (0, 1) for j in range(cells[1])]
    faces += [(name(1, side), (i, cells[1] * side), (i + 1, cells[1] * side)) for side in (0, 1) for i in range(cells[0])]
    names = sorted({f[0] for f in faces})
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names) + 1)]
    lines += [f'1 {i + 1} "{n}"' for i, n in enumerate(names)] + ['2 100 "fluid"', "$EndPhysicalNames", "$Nodes", str(len(nodes))]
    lines += ["{} {!r} {!r} 0".format(number[i], *place(i[0] / cells[0], i[1] / cells[1])) for i in nodes]
    lines += ["$EndNodes", "$Elements", str(len(faces) + cells[0] * cells[1])]
    elements = [(1, names.index(n) + 1, [number[a], number[b]]) for n, a, b in faces]
    elements += [(3, 100, [number[i, j], number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]]) for i in range(cells[0]) for j in range(cells[1])]
    lines += [f"{e + 1} {kind} 2 {tag} {tag} {' '.join(map(str, v))}" for e, (kind, tag, v) in enumerate(elements)]
    path.write_text("\n".join([*lines, "$EndElements", ""]))


@pytest.fixture
def funnel(tmp_path):
    """Two walls that lean apart, 0.1 wide at y = 0 and 2 at y = 2"""
    write_mesh(tmp_path / "mesh.msh", (8, 8), lambda s, t: (1 + (s - 0.5) * (0.1 + 1.9 * t), 2 * t), lambda axis, side: "hopper" if axis == 0 or side == 0 else "lid")


def bodies(result, folder):
    with open(result.folder / folder / "bodies.csv", newline="") as file:
        return [{k: float(v) for k, v in row.items() if k not in ("group",)} for row in csv.DictReader(file)]


@pytest.mark.parametrize("kind", KINDS)
def test_rests_at_the_wall(run, scene, funnel, kind):
    mesh, gravity, radius, start, gap = KINDS[kind]
    ends = []
    for ranks in (1, 2, 3) if kind == "file" else (1,):
        result = run([scene(ALONE % (mesh, gravity, radius, start)), "-output_dir", str(ranks)], ranks)
        assert result.status == 0, str(result)
        table = bodies(result, str(ranks))
        gaps = [gap([row[a] for a in "xyz"[:len(gravity.split(","))]]) for row in table]
        assert min(gaps) > -0.01 * radius, (min(gaps), str(result))
        assert min(gaps) < 0.1 * radius, "it has never come near the wall"
        ends.append([table[-1][a] for a in ("x", "y", "z", "u", "v", "gap")])
    assert all(end == ends[0] for end in ends), ends
    if kind == "file":
        assert ends[0][0] == pytest.approx(1, abs=0.02) and gap(ends[0]) < 0.02, ends


REFUSED = {
    "in the wall": ("0.6, 0.4", "starts outside the domain: its centre 0.6,0.4,0. lies 0.144524 beyond boundary 'hopper'"),
    "overlaps": ("0.8, 0.6", "overlaps wall 'hopper' by 0.0780575"),
    "beyond the box": ("1, 2.5", "starts outside the domain: its y is 2.5"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_start_beyond_a_wall_is_refused(run, scene, funnel, case):
    start, message = REFUSED[case]
    mesh, gravity, radius = KINDS["file"][:3]
    result = run([scene(ALONE % (mesh, gravity, radius, start))], 2)
    assert result.status != 0 and result.text.count(message) == 1 and "Body 0 of group 'd'" in result.text, str(result)


def test_leaves_by_the_name_in_the_file(run, scene, tmp_path):
    write_mesh(tmp_path / "mesh.msh", (8, 8), lambda s, t: (1 + (s - 0.5) * (0.6 + 1.4 * t), 2 * t), lambda axis, side: "spout" if (axis, side) == (1, 0) else "hopper")
    text = ALONE.replace("active: false, ", "density: 1, viscosity: 0.1, bc_spout: {type: outflow}, ").replace("dt: 0.005, steps: 400", "dt: 0.05, steps: 60")
    text = text % ("kind: file, file: mesh.msh", "0, -40", 0.15, "1, 0.3")
    stopped = run([scene(text), "-output_dir", "stop"])
    assert stopped.status != 0 and "has left the domain through boundary 'spout'" in stopped.text, str(stopped)
    removed = run([scene(text), "-output_dir", "gone", "-particle_remove", "spout"], 2)
    assert removed.status == 0 and "bodies_removed" in removed.text, str(removed)
    unknown = run([scene(text), "-particle_remove", "left"])
    assert unknown.status != 0 and "boundary 'left' is not known (known: " in unknown.text and "spout" in unknown.text, str(unknown)
    listed = run([scene(text), "-scene_dry_run"])
    assert "boundary spout (y = 0): outflow" in listed.text and "boundary hopper (x from 0 to 2, y from 0 to 2): no_slip" in listed.text, str(listed)


def test_dry_run_says_where_boundaries_lie(run, scene):
    for mesh, want in {"kind: disc, radius: 1, resolution: 4": "boundary outer (circle of radius 1 about 0,0): no_slip",
                       "cells: [4, 4], lower: [0, 0], upper: [2, 2]": "boundary bottom (y = 0): no_slip"}.items():
        listed = run([scene(ALONE.replace("active: false, ", "density: 1, viscosity: 0.1, ") % (mesh, "0, -10", 0.2, "0.5, 0.5")), "-scene_dry_run"])
        assert want in listed.text, str(listed)


DRIVEN = """\
mesh: {cells: [12, 12], lower: [-1, -1], upper: [1, 1]}
flow: {density: 1, viscosity: 0.05}
particle:
  groups: b
  b: {shape: circle, radius: 0.2, position: [0, 0], motion: constant, velocity: [1, 0]}
sim: {dt: 0.05, steps: 30}
"""
OTHER = "  groups: b, o\n  o: {shape: box, size: [0.2, 0.4], position: [0.6, 0.1], free: none}\n"
ROD = "  groups: b, o\n  o: {shape: box, size: [0.6, 0.1], position: [-0.9, -0.6], motion: constant, velocity: [0.1, 0]}\n"


@pytest.mark.parametrize("flow", [True, False])
@pytest.mark.parametrize("ranks", [1, 2])
def test_prescribed_ways_end_at_walls_and_bodies(run, scene, flow, ranks):
    """Nothing can stop such a body: the run says which goes into what, and when. A rod that stuck in a wall from the start may."""
    text = DRIVEN if flow else DRIVEN.replace("viscosity: 0.05", "active: false")
    for more, phrase in (("", "moves into wall 'right': at t = 0.8"), (OTHER, "moves into body 0 of group 'o', which cannot give way: at t = 0.3"), (ROD, "'b' moves into wall 'right': at t = 0.8")):
        result = run([scene(text.replace("  groups: b\n", more or "  groups: b\n")), "-output_overwrite"], ranks)
        assert result.status != 0 and result.text.count(phrase) == 1, str(result)


TURNS = "  groups: b, o\n  o: {shape: box, size: [1.2, 0.1], position: [-0.35, -0.5], motion: rotate, angular_velocity: -2}\n"
OBSTACLE = "  groups: b, o\n  o: {shape: box, size: [0.2, 0.4], position: [0.6, 0.1], obstacle: true}\n"


@pytest.mark.parametrize("more, phrase", [(TURNS, "'o' moves into wall 'bottom': at t = 0.45"), (OBSTACLE, "moves into body 0 of group 'o', which cannot give way: at t = 0.3")])
def test_what_turns_or_meets_an_obstacle_ends_too(run, scene, more, phrase):
    result = run([scene(DRIVEN.replace("viscosity: 0.05", "active: false").replace("  groups: b\n", more))])
    assert result.status != 0 and result.text.count(phrase) == 1, str(result)
