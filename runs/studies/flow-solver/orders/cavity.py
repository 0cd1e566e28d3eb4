#!/usr/bin/env python3
"""Lid-driven cavity at Re 1000 against Botella & Peyret (Computers & Fluids 27, 1998, 421-433) over a sequence of meshes.

Runs runs/cavity-re1000.yaml with N x N cells, reads the nodal velocities from the fields and evaluates the quadratic polynomials of the
elements: extrema on the centre lines, and the stream function of the primary vortex by integration of u upwards from the floor.
Writes cavity.csv, prints a table of errors with observed rates.

  runs/studies/flow-solver/orders/cavity.py [--cells 16 32 64 128] [--build build] [--ranks 1]
"""

import argparse
import csv
import json
import subprocess
import tempfile
from pathlib import Path

import h5py
import numpy

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[3]
REFERENCE = {"u_min": -0.3885698, "u_min_y": 0.1717, "v_max": 0.3769447, "v_max_x": 0.1578, "v_min": -0.5270771, "v_min_x": 0.9092, "psi_min": -0.1189366, "psi_x": 0.5308, "psi_y": 0.5652}
ERRORS = ["u_min", "v_max", "v_min", "psi_min"]


def read_velocity(folder, cells):
    """(u, v) [i][j] at the nodes of the elements, counted from the lower left corner."""
    (file,) = folder.glob("fields_*.h5")
    with h5py.File(folder / "mesh.h5") as mesh, h5py.File(file) as fields:
        index = numpy.rint(mesh["coordinates"][:, :2] * 2 * cells).astype(int)
        velocity = numpy.full((2 * cells + 1, 2 * cells + 1, 2), numpy.nan)
        velocity[index[:, 0], index[:, 1]] = fields["velocity"][:, :2]
    assert not numpy.isnan(velocity).any(), "nodes are missing"
    return velocity


def solve(cells, build, ranks, folder):
    """One mesh: a row of the table."""
    command = [str(ROOT / build / "tumble"), str(ROOT / "runs/cavity-re1000.yaml"), "-mesh_cells", f"{cells},{cells}", "-output_dir", str(folder)]
    if ranks > 1:
        command = ["mpiexec", "--oversubscribe", "-n", str(ranks), *command]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    summary = json.loads((folder / "summary.json").read_text())
    return {"cells": cells, "unknowns": summary["unknowns"], "newton": summary["quantities"]["nonlinear_iterations"], **measure(read_velocity(folder, cells))}


def extremum(values, sign):
    """Place and value of the largest sign * (piecewise quadratic through values[::] on [0, 1])."""
    n, best = (len(values) - 1) // 2, None
    for e in range(n):
        a, b, c = values[2 * e : 2 * e + 3]
        slope, bend = 0.5 * (c - a), a - 2 * b + c
        candidates = [-1, 1] + ([-slope / bend] if bend and abs(slope / bend) < 1 else [])
        for s in candidates:
            value = b + slope * s + 0.5 * bend * s * s
            if best is None or sign * value > sign * best[1]:
                best = (e + 0.5 * (s + 1)) / n, value
    return best


def stream_function(velocity):
    """psi at the nodes: the integral over y of u, exact for its quadratic polynomials."""
    cells = (velocity.shape[0] - 1) // 2
    h, u, psi = 1 / cells, velocity[:, :, 0], numpy.zeros(velocity.shape[:2])
    a, b, c = u[:, 0:-1:2], u[:, 1::2], u[:, 2::2]
    psi[:, 2::2] = numpy.cumsum(h / 6 * (a + 4 * b + c), axis=1)
    psi[:, 1::2] = psi[:, 0:-1:2] + h / 24 * (5 * a + 8 * b - c)
    return psi


def vortex(velocity):
    """Least psi and its place: Newton's method on the polynomial through the 5 x 5 nodes around the least nodal value (error of order h^5 in psi)."""
    psi = stream_function(velocity)
    cells, (i, j) = (psi.shape[0] - 1) // 2, numpy.unravel_index(psi.argmin(), psi.shape)
    s = numpy.arange(-2, 3)
    inverse = numpy.linalg.inv(numpy.vander(s, increasing=True))
    c = inverse @ psi[i - 2 : i + 3, j - 2 : j + 3] @ inverse.T
    p = numpy.polynomial.polynomial
    at = numpy.zeros(2)
    for _ in range(20):
        dx, dy = p.polyder(c, axis=0), p.polyder(c, axis=1)
        gradient = [p.polyval2d(*at, dx), p.polyval2d(*at, dy)]
        mixed = p.polyval2d(*at, p.polyder(dx, axis=1))
        hessian = [[p.polyval2d(*at, p.polyder(dx, axis=0)), mixed], [mixed, p.polyval2d(*at, p.polyder(dy, axis=1))]]
        at -= numpy.linalg.solve(hessian, gradient)
    return (i + at[0]) / (2 * cells), (j + at[1]) / (2 * cells), p.polyval2d(*at, c)


def measure(velocity):
    middle = velocity.shape[0] // 2
    assert middle % 2 == 0, "the centre lines must be element edges: give an even number of cells"
    y, u_min = extremum(velocity[middle, :, 0], -1)
    x1, v_max = extremum(velocity[:, middle, 1], 1)
    x2, v_min = extremum(velocity[:, middle, 1], -1)
    px, py, psi = vortex(velocity)
    return {"u_min": u_min, "u_min_y": y, "v_max": v_max, "v_max_x": x1, "v_min": v_min, "v_min_x": x2, "psi_min": psi, "psi_x": px, "psi_y": py}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, nargs="+", default=[16, 32, 64, 128])
    parser.add_argument("--build", default="build")
    parser.add_argument("--ranks", type=int, default=1)
    arguments = parser.parse_args()
    rows = []
    for cells in arguments.cells:
        with tempfile.TemporaryDirectory() as folder:
            rows.append(solve(cells, arguments.build, arguments.ranks, Path(folder) / "run"))
    with open(HERE / "cavity.csv", "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(rows[0])
        table.writerow(["reference", "", "", *(f"{REFERENCE[k]:.7g}" for k in REFERENCE)])
        table.writerows([[f"{v:.7f}" if isinstance(v, float) and k not in ("newton", "unknowns") else f"{v:g}" for k, v in row.items()] for row in rows])
    print("| cells | unknowns | Newton steps |", " | ".join(f"{name}, error | rate" for name in ERRORS), "|")
    print("|" + " --- |" * (3 + 2 * len(ERRORS)))
    last = None
    for row in rows:
        error = {name: row[name] - REFERENCE[name] for name in ERRORS}
        parts = []
        for name in ERRORS:
            rate = f"{numpy.log(abs(last[name] / error[name])) / numpy.log(row['cells'] / last['cells']):.1f}" if last else ""
            parts += [f"{row[name]:.7f}, {error[name]:+.1e}", rate]
        print(f"| {row['cells']} | {row['unknowns']} | {row['newton']:g} |", " | ".join(parts), "|")
        last = {"cells": row["cells"], **error}


if __name__ == "__main__":
    main()
