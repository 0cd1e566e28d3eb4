"""What the ranks send one another in a time step, counted through the profiling interface of MPI (tools/mpicount.c).

Nothing that all ranks take part in may grow with the number of bodies, or of ranks, but for the lengths of new vectors and matrices, a number a rank
(PetscLayout), a bounded number of times a step.
"""
import os
import shlex
import subprocess
from collections import defaultdict

import pytest

from collector import ROOT, build_folder, launch_words

FLOW = """mesh: {cells: [20, 20], lower: [0, 0], upper: [1, 1], periodic: [x]}
flow: {density: 1, viscosity: 0.02, gravity: [0, -10]}
particle:
  groups: grain
  grain: {shape: circle, radius: 0.02, density: 1.5, place: lattice}
contact: {range: 0.01, stiffness: 1e-4}
sim: {dt: 0.005}
output: {every: 0, bodies: [0, 0]}
"""
ALONE = """mesh: {cells: [4, 4], lower: [0, 0], upper: [1, 1], periodic: x}
flow: {active: false, gravity: [3, -5]}
particle:
  groups: grain
  grain: {shape: circle, radius: 0.002, density: 2, place: lattice, velocity: [1, 0]}
contact: {range: 1e-3}
sim: {dt: 1e-3}
output: {every: 0, progress: 1000}
"""
EXACT = 576  # bytes: a sum without rounding (base/exact.h), a fixed length
BALANCE = 24576  # bytes: bodies in bins along the axes, by which parts are cut; a fixed length


@pytest.fixture(scope="module")
def counter(tmp_path_factory):
    compiler = shlex.split((build_folder() / "flags").read_text())[0]
    path = tmp_path_factory.mktemp("counter") / "mpicount.so"
    subprocess.run([compiler, "-O1", "-shared", "-fPIC", "-o", path, ROOT / "tools" / "mpicount.c"], check=True)
    return path


def count(counter, program, scene, ranks, steps, bodies, folder):
    """{kind: [calls, bytes, long calls, long bytes, longest]}, the largest of the ranks"""
    out = folder / f"{ranks}-{steps}-{bodies}"
    words = launch_words(["env", f"LD_PRELOAD={counter}", f"MPICOUNT={out}.count", program, scene, "-sim_steps", steps, "-particle_grain_count", bodies,
                          "-output_dir", out], ranks)
    done = subprocess.run([str(word) for word in words], cwd=folder, capture_output=True, text=True, timeout=120, env=dict(os.environ))
    assert not done.returncode, done.stdout + done.stderr
    most = defaultdict(lambda: [0] * 5)
    for line in (folder / f"{out}.count").read_text().splitlines():
        _, kind, *numbers = line.split()
        most[kind] = [max(a, int(b)) for a, b in zip(most[kind], numbers)]
    return most


@pytest.fixture
def steps(counter, program, tmp_path):
    """steps(scene, ranks, bodies, n): what n steps take, after n others and the set-up"""

    def subtract(text, ranks, bodies, n):
        scene = tmp_path / "scene.yaml"
        scene.write_text(text)
        short, long = (count(counter, program, scene, ranks, m, bodies, tmp_path) for m in (n, 2 * n))
        return {kind: [(b - a) / n for a, b in zip(short[kind][:4], long[kind][:4])] + [long[kind][4]] for kind in long}

    return subtract


COLLECTIVES = "allreduce", "reduce", "bcast", "scan", "allgather", "alltoall", "gather"
HELD = 8 * 4096  # values of a level of the coarse solve that all ranks hold (solve/pressure/vcycle.c)
OPEN_TIES = 8 * 3 * 2000  # right-hand sides of the touching bodies that all ranks solve for; where there are more, they are iterated


SCENES = {
    "explicit": FLOW.replace("stiffness: 1e-4}", "stiffness: 1e-4, coupling: explicit}"),
    "meet": FLOW.replace("{range: 0.01, stiffness: 1e-4}", "{range: 0.095}"),
    "no contact": FLOW.replace("{range: 0.01, stiffness: 1e-4}", "{law: none}"),
    "nodal, adaptive": FLOW.replace("[20, 20]", "[30, 30]").replace("{dt: 0.005}", "{dt: 0.005, adapt: true, adapt_max: 0.005, adapt_tolerance: 1}\ncouple: {method: nodal}"),
    "deformed": FLOW.replace("periodic: [x]", "periodic: [x], deform: true, deform_size: 0.7"),
    "aligned": FLOW.replace("[20, 20]", "[80, 80]").replace("0.01, stiff", "0.005, stiff").replace("{dt: 0.005}", "{dt: 0.002}\ncouple: {method: aligned}"),
}


@pytest.mark.parametrize("kind", SCENES)
def test_collectives_do_not_grow_with_the_bodies_of_a_flow(steps, kind):
    """With contact before the flow and with the flow, with some that meet and without contact, and under all methods"""
    scene, touch, fine = SCENES[kind], kind == "meet", kind == "aligned"
    few, many, spread = steps(scene, 3, 60, 1), steps(scene, 3, 120, 1), steps(scene, 6, 120, 1)
    for n, ranks, sent in (60, 3, few), (120, 3, many), (120, 6, spread):
        assert sent["allgather"][2] == 0 or touch, (n, ranks, dict(sent))
        for kind in COLLECTIVES:
            calls, total, long_calls, long_bytes, longest = sent[kind]
            if touch and kind in ("allreduce", "allgather"):
                assert longest <= OPEN_TIES, (kind, n, ranks, sent[kind])
            elif fine and kind == "allreduce":
                assert longest <= HELD, (n, ranks, sent[kind])
            elif kind != "allgather":
                assert long_bytes == EXACT * long_calls, (kind, n, ranks, sent[kind])
            else:
                assert total <= 8 * ranks * calls, (kind, n, ranks, sent[kind])
    for other in many, spread:
        for kind in COLLECTIVES:
            assert other[kind][0] <= 1.3 * few[kind][0] + 2, (kind, few[kind], other[kind])
            if fine and kind == "allreduce":
                assert other[kind][4] <= 1.3 * few[kind][4], (kind, few[kind], other[kind])
            elif kind != "allgather" and not (touch and kind == "allreduce"):
                assert other[kind][1] <= 1.3 * few[kind][1] + 64, (kind, few[kind], other[kind])


def test_collectives_do_not_grow_where_the_mesh_follows_the_bodies(steps):
    """Made anew in every step: what all ranks hear is where the ranks are, how many cells the base cells have, and the rows of small coarse levels,
    made anew when enough has changed"""
    scene = FLOW.replace("periodic: [x]", "periodic: [x], levels: 1, track: true, track_distance: 0.1").replace("place: lattice", "place: lattice, velocity: [2, 0]")
    few, many = steps(scene, 3, 60, 2), steps(scene, 3, 120, 2)
    assert few["allgather"][1] > 2 * 20 * 20 * 4, few
    for kind in COLLECTIVES:
        levels = many[kind][4] if kind == "allgather" else 0
        assert many[kind][4] <= 1.1 * few[kind][4] + 64 and many[kind][1] <= 1.3 * few[kind][1] + levels + 64, (kind, few[kind], many[kind])


def test_collectives_of_bodies_alone_have_a_fixed_length(steps):
    for ranks in 2, 5:
        sent = steps(ALONE, ranks, 7000, 10)
        assert sent["message"][1] > 0, sent
        for kind in COLLECTIVES:
            assert sent[kind][4] <= BALANCE and sent[kind][0] < 100, (kind, ranks, sent[kind])
