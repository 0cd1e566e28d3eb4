"""A free ellipsoid that tumbles in space, without a flow and heavy in a thin fluid, against Euler's equations."""
import csv

import numpy as np
import pytest

SCENE = """mesh: {dimension: 3, cells: [4, 4, 4], lower: [0, 0, 0], upper: [1, 1, 1]}
flow: {%s}
particle: {groups: egg, egg: {shape: ellipse, a: 0.3, b: 0.2, c: 0.15, density: 1, position: [0.5, 0.5, 0.5], angular_velocity: [0.4, 4, 0.2]}}
%scontact: {law: none}
output: {every: 0}
sim: {time: 1.5, dt: %g}
"""
INERTIA = np.array([0.2**2 + 0.15**2, 0.3**2 + 0.15**2, 0.3**2 + 0.2**2])


def euler(time, n=4000):
    """Angular velocity in space at `time`, by Runge-Kutta for spin (axes of the body) and orientation"""

    def rate(y):
        w, axes = y[:3], y[3:].reshape(3, 3)
        cross = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        return np.concatenate([-np.cross(w, INERTIA * w) / INERTIA, (axes @ cross).ravel()])

    y, h = np.concatenate([[0.4, 4, 0.2], np.eye(3).ravel()]), time / n
    for _ in range(n):
        a = rate(y)
        b = rate(y + h / 2 * a)
        c = rate(y + h / 2 * b)
        y = y + h / 6 * (a + 2 * b + 2 * c + rate(y + h * c))
    return y[3:].reshape(3, 3) @ y[:3]


def error(run, scene, method, dt, ranks, out):
    flow = "active: false" if method == "none" else "density: 1e-7, viscosity: 1e-7"
    couple = "" if method == "none" else f"couple: {{method: {method}}}\n"
    result = run([scene(SCENE % (flow, couple, dt)), "-output_dir", out], ranks)
    assert result.status == 0, str(result)
    with open(out / "bodies.csv") as file:
        last = list(csv.DictReader(file))[-1]
    got = np.array([float(last[f"omega_{axis}"]) for axis in "xyz"])
    return np.linalg.norm(got - euler(1.5)) / 4


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("method", ["none", "nodal", "penalty"])
def test_a_free_ellipsoid_tumbles(run, scene, method, ranks, tmp_path):
    errors = [error(run, scene, method, 1.5 / n, ranks, tmp_path / str(n)) for n in (30, 60)]
    assert errors[1] < 5e-3 and 3 < errors[0] / errors[1] < 5, errors
