"""Bodies from surface files: the drawn surface is that of the file, a robust one runs, files in other units are told."""
import h5py
import numpy as np

BOX = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
SCENE = """mesh: {cells: [4, 4, 4], lower: [0, 0, 0], upper: [8, 8, 8]}
flow: {active: false, gravity: [0, 0, -10]}
particle:
  groups: fin
  fin: {shape: stl, file: fin.off, density: 1, position: [4, 4, 4]}
sim: {dt: 0.01, steps: 1}
output: {every: 1}
"""


def write_off(path, half, faces):
    points = [[half[a] * (1 if c >> a & 1 else -1) for a in range(3)] for c in range(8)]
    rows = [f"{len(points)} {len(faces)} 0", *(" ".join(map(str, p)) for p in points), *("4 " + " ".join(map(str, f)) for f in faces)]
    path.write_text("OFF\n" + "\n".join(rows) + "\n")


def volume_of(x, cells):
    a, b, c = (x[cells[:, k]] - x.mean(axis=0) for k in range(3))
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


def test_thin_plate_is_drawn_as_it_is(run, scene, tmp_path):
    for faces, robust in [(BOX, False), (BOX[1:], True)]:
        path = scene(SCENE)
        write_off(tmp_path / "fin.off", (2, 1, 0.02), faces)
        result = run([path, "-output_overwrite", *(["-particle_fin_surface", "robust"] if robust else [])])
        assert result.status == 0, str(result)
        assert ("4 open edges, 1 holes, closed" in result.out) == robust
        with h5py.File(next(result.folder.rglob("bodies_1.h5"))) as f:
            sets = {}
            f.visititems(lambda name, item: sets.update({name.split("/")[-1]: item[()]}) if isinstance(item, h5py.Dataset) else None)
        points = next(v for v in sets.values() if v.ndim == 2 and v.shape[1] == 3 and v.dtype.kind == "f" and len(v) == 8)
        cells = next(v for v in sets.values() if v.ndim == 2 and v.shape[1] == 3 and v.dtype.kind in "iu")
        assert abs(volume_of(points, cells) - 0.32) < 1e-6


def test_units_of_the_file(run, scene, tmp_path):
    path = scene(SCENE)
    write_off(tmp_path / "fin.off", (2, 1, 0.02), BOX)
    result = run([path, "-particle_fin_scale", "1000"])
    assert result.status != 0 and "set -particle_fin_scale" in result.err + result.out
    result = run([path, "-scene_dry_run"])
    assert "box 4. x 2. x 0.04" in result.out
    write_off(tmp_path / "fin.off", (2, 1, 0.02), BOX[1:])
    result = run([path, "-scene_dry_run"])
    assert "-particle_fin_surface robust" in result.err + result.out
