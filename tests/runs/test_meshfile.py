"""Gmsh files in a scene: names and options, what is refused, curved cells. Formats, orders, damage: tests/mesh/test_gmsh.c."""
import csv
import json

import h5py
import numpy as np
import pytest

from conftest import ROOT

TYPES = {2: 1, 3: 8, 4: 3, 9: 10}  # Gmsh's, by nodes


def write_msh(path, points, cells, edges, names):
    """Format 2.2; edges: (number of the physical group, 0: none; nodes), names: by number."""
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat"]
    if names:
        lines += ["$PhysicalNames", str(len(names)), *(f'1 {number} "{name}"' for number, name in names.items()), "$EndPhysicalNames"]
    lines += ["$Nodes", str(len(points)), *(f"{i + 1} {x!r} {y!r} 0" for i, (x, y) in enumerate(points.tolist())), "$EndNodes"]
    elements = [(99, cell) for cell in cells] + list(edges)
    lines += ["$Elements", str(len(elements))]
    for i, (group, nodes) in enumerate(elements):
        lines.append(f"{i + 1} {TYPES[len(nodes)]} 2 {group} 1 {' '.join(str(n + 1) for n in nodes)}")
    path.write_text("\n".join([*lines, "$EndElements", ""]))


def outer_edges(cells):
    """(corner, corner, middle) of the edges that one cell alone has, of nine-node cells."""
    found = {}
    for cell in cells:
        for k in range(4):
            edge = (int(cell[k]), int(cell[(k + 1) % 4]), int(cell[4 + k]))
            found.setdefault(edge[2], []).append(edge)
    return [edges[0] for edges in found.values() if len(edges) == 1]


def channel(path, names=None, skip=(), n=(8, 4), turn=0.0):
    """[0, 2] x [0, 1], turned about the origin; groups 1 to 4: left, right, bottom, top."""
    nx, ny = n
    x, y = np.meshgrid(np.linspace(0, 2, nx + 1), np.linspace(0, 1, ny + 1))
    points = np.column_stack([np.cos(turn) * x.ravel() - np.sin(turn) * y.ravel(), np.sin(turn) * x.ravel() + np.cos(turn) * y.ravel()])

    def at(i, j):
        return j * (nx + 1) + i

    cells = [(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)) for j in range(ny) for i in range(nx)]
    edges = [(1, (at(0, j), at(0, j + 1))) for j in range(ny)] + [(2, (at(nx, j), at(nx, j + 1))) for j in range(ny)]
    edges += [(3, (at(i, 0), at(i + 1, 0))) for i in range(nx)] + [(4, (at(i, ny), at(i + 1, ny))) for i in range(nx)]
    write_msh(path, points, cells, [(g, e) for g, e in edges if g not in skip], names)


def last_row(result, folder="out"):
    assert result.status == 0, str(result)
    with open(result.folder / folder / "series.csv") as file:
        return {k: float(v) for k, v in list(csv.DictReader(file))[-1].items()}


POISEUILLE = """\
mesh: {kind: file, file: channel.msh}
flow:
  density: 1
  viscosity: 0.1
  convection: false
  bc_KEY: {type: inflow, velocity: [1, 0], profile: parabolic}
  bc_OUT: {type: outflow}
sim: {steady: true}
"""
NAMES = {1: "left inlet", 2: "out (2)", 3: "walls", 4: "walls"}


@pytest.mark.parametrize("inlet, outlet", [("left inlet", "out (2)"), ("left_inlet", "out__2_")])
def test_names_with_blanks(run, scene, tmp_path, inlet, outlet):
    channel(tmp_path / "channel.msh", NAMES)
    row = last_row(run([scene(POISEUILLE.replace("KEY", inlet).replace("OUT", outlet)), "-output_dir", "out"]))
    assert row["flow_rate_left_inlet"] == pytest.approx(-2 / 3, rel=1e-9) and row["flow_rate_out__2_"] == pytest.approx(2 / 3, rel=1e-8)
    assert row["wall_force_walls_x"] == pytest.approx(1.6, rel=1e-8)  # 2 walls, length 2, mu du/dy = 0.4


def test_numbers_are_names(run, scene, tmp_path):
    channel(tmp_path / "channel.msh")
    row = last_row(run([scene(POISEUILLE.replace("KEY", "1").replace("OUT", "2")), "-output_dir", "out"], 2))
    assert row["flow_rate_2"] == pytest.approx(2 / 3, rel=1e-8)
    assert row["wall_force_3_x"] == pytest.approx(0.8, rel=1e-8) and row["wall_force_4_x"] == pytest.approx(0.8, rel=1e-8)


def test_scale(run, scene, tmp_path):
    """The channel as if in millimetres: the same flow in the scene's metres."""
    channel(tmp_path / "channel.msh")
    text = POISEUILLE.replace("KEY", "1").replace("OUT", "2")
    row = last_row(run([scene(text), "-mesh_scale", "0.001", "-output_dir", "out"]))
    assert row["flow_rate_2"] == pytest.approx(2e-3 / 3, rel=1e-8)


def test_unnamed_edges_are_refused(run, scene, tmp_path):
    channel(tmp_path / "channel.msh", NAMES, skip=(4,))
    text = POISEUILLE.replace("KEY", "left inlet").replace("OUT", "out (2)")
    result = run([scene(text)], 2)
    assert result.status != 0 and result.text.count("8 edges of the outside have no name") == 1, str(result)
    assert "all from (0.125, 1) to (1.875, 1)" in result.text and "-mesh_unnamed" in result.text and result.steps() == 0, str(result)
    row = last_row(run([scene(text), "-mesh_unnamed", "lid", "-output_dir", "out"]))
    assert row["wall_force_lid_x"] == pytest.approx(0.8, rel=1e-8)


def test_one_boundary(run, scene, tmp_path):
    channel(tmp_path / "channel.msh", skip=(1, 2, 3, 4))
    text = "mesh: {kind: file, file: channel.msh}\nflow: {density: 1, viscosity: 0.1, bc_boundary: {type: moving_wall, velocity: [-y, x]}}\nsim: {steady: true}\n"
    result = run([scene(text), "-output_dir", "out"])
    assert "are one boundary, 'boundary'" in result.text, str(result)
    assert last_row(result)["kinetic_energy"] == pytest.approx(0.5 * 2 * (4 / 3 + 1 / 3), rel=1e-10)  # rigid rotation


def test_benchmark_on_curved_file(run, tmp_path):
    """2D-1 on the built-in mesh around the cylinder, and on the same nine-node cells from a file: the same numbers."""
    case = [ROOT / "runs" / "cylinder-2d1.yaml", "-output_dir"]
    done = run([*case, "fitted", "-mesh_resolution", "4"])
    assert done.status == 0, str(done)
    with h5py.File(tmp_path / "fitted" / "mesh.h5") as file:
        points, cells = file["coordinates"][:, :2], file["cells"][:]
    edges = []
    for edge in outer_edges(cells):
        x, y = points[edge[2]]
        where = 1 if abs(x) < 1e-9 else 2 if abs(x - 2.2) < 1e-9 else 3 if abs(y) < 1e-9 or abs(y - 0.41) < 1e-9 else 4
        edges.append((where, edge))
    write_msh(tmp_path / "cylinder.msh", points, cells, edges, {1: "left", 2: "right", 3: "walls", 4: "cylinder"})
    file_mesh = ["-mesh_kind", "file", "-mesh_file", "cylinder.msh"]
    found = []
    for folder, ranks, more in (("one", 1, []), ("two", 2, []), ("fine", 1, ["-dm_refine", "1"])):
        done = run([*case, folder, *file_mesh, *more], ranks)
        assert done.status == 0, str(done)
        found.append(json.loads((tmp_path / folder / "summary.json").read_text())["quantities"])
    built_in = json.loads((tmp_path / "fitted" / "summary.json").read_text())["quantities"]
    for name in ("cd", "cl", "dp"):
        assert found[0][name] == pytest.approx(built_in[name], rel=1e-7), (found[0], built_in)
        assert found[1][name] == pytest.approx(found[0][name], rel=1e-7), found
    assert abs(found[2]["cd"] / 5.57953523384 - 1) < 5e-4, found[2]  # halved on the curved cells of 16 around the circle
