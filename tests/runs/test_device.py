"""-device: the kernels of a GPU give the numbers of the processor's own in no more iterations, over ten steps. Here on the processor, by emulation;
make check-gpu runs the same list on a GPU (TUMBLE_DEVICE=cuda)."""
import csv
import os
import re

import pytest

from collector import ROOT, build_folder

DEVICE = os.environ.get("TUMBLE_DEVICE", "emulate")
STEPS = 10
CAVITY = [ROOT / "runs" / "bench" / "cavity-3d.yaml", "-mesh_cells", "6,6,6", "-sim_steps", STEPS, "-output_every", 0, "-output_dir", "out",
          "-output_overwrite"]
VELOCITY = ["-flow_velocity_smoother", "jacobi", "-flow_fieldsplit_velocity_ksp_type", "bcgs"]  # what a device takes
WHOLE = ["-preset", "balanced", "-flow_ksp_rtol", "1e-12", "-flow_velocity_tol", 0]
FGMRES = ["-flow_ksp_type", "fgmres"]
# options of both, options of the processor, how far numbers may be apart: the pressure's smoother is another one
CASES = {
    "box": (WHOLE, FGMRES, 1e-10),
    "odd cells, cn, skew": ([*WHOLE, "-mesh_cells", "7,5,6", "-flow_time", "cn", "-flow_convection_form", "skew"], FGMRES, 1e-10),
    "periodic, driven by a force": ([*WHOLE, "-mesh_periodic", "x", "-flow_force", "1,0,0.2", "-flow_time", "be"], FGMRES, 1e-10),
    "refined": ([*WHOLE, "-mesh_levels", 1, "-mesh_refine", "a", "-mesh_box_a_corners", "0,0,0,0.4,0.4,0.4"], FGMRES, 1e-10),
    "refined twice": ([*WHOLE, "-mesh_cells", "4,4,4", "-mesh_levels", 2, "-mesh_refine", "a", "-mesh_box_a_corners", "0.4,0.4,0.4,0.6,0.6,0.6"],
                      FGMRES, 1e-10),
    "pressure and outflow": ([*WHOLE, "-flow_bc_left_type", "pressure", "-flow_bc_left_pressure", "0.2*(1+y*t)",
                              "-flow_bc_right_type", "outflow"], FGMRES, 1e-10),
    "fstheta": ([*WHOLE, "-mesh_cells", "4,4,4", "-flow_time", "fstheta", "-mesh_periodic", "x"], FGMRES, 1e-10),
    "balanced": (["-preset", "balanced"], FGMRES, 2e-5),
    "fast": (["-preset", "fast"], [], 2e-3),  # half of what its single iteration leaves on the processor
}


def series(result):
    assert result.status == 0, str(result)
    with open(result.folder / "out" / "series.csv") as file:
        return list(csv.DictReader(file))


def apart(a, b, names):
    """Largest difference of columns, of the largest number in them"""
    values = [(float(x[n]), float(y[n])) for x, y in zip(a, b, strict=True) for n in names]
    return max(abs(x - y) for x, y in values) / max(abs(y) for _, y in values)


def forces(row):
    """Of walls, without the constant of the pressure, which nobody knows: along an axis only that of both sides together"""
    normal = {"left": "x", "right": "x", "bottom": "y", "top": "y", "back": "z", "front": "z"}
    out = dict.fromkeys("xyz", 0.0)
    for name, value in row.items():
        if name.startswith("wall_force_"):
            _, _, wall, axis = name.split("_")
            key = axis if normal[wall] == axis else name
            out[key] = out.get(key, 0.0) + float(value)
    return out


@pytest.mark.parametrize("case", CASES)
def test_same_numbers(run, case):
    options, taken, bound = CASES[case]
    there, here = series(run([*CAVITY, *options, "-device", DEVICE])), series(run([*CAVITY, *options, *VELOCITY, *taken]))
    assert len(there) == len(here) >= STEPS
    assert sum(int(a["outer_iterations"]) for a in there) <= sum(int(b["outer_iterations"]) for b in here)
    assert apart(there, here, ["kinetic_energy"]) <= bound
    assert apart(there, here, ["cfl"]) <= 10 * bound
    if bound == 1e-10:  # pressures are known a hundred times less than velocities are
        walls = [[forces(row) for row in rows] for rows in (there, here)]
        assert apart(*walls, walls[0][0]) <= 1e-8
        assert max(float(a["momentum_error"]) for a in there) < 1e-7
    assert float(there[-1]["kinetic_energy"]) > 1e-3


@pytest.mark.skipif(DEVICE != "emulate", reason="counts what the emulation's memory is given")
@pytest.mark.parametrize("convection", ["true", "false"])
def test_no_field_crosses(run, monkeypatch, convection):
    """Surfaces alone: what goes there and back in a step grows as they do, and the host looks into no vector."""
    moved = []
    monkeypatch.setenv("LD_PRELOAD", str(build_folder() / "tests" / "runs" / "faults" / "hostarrays.so"))
    for n in (6, 12):
        result = run([*CAVITY, "-mesh_cells", f"{n},{n},{n}", "-flow_convection", convection, "-sim_steps", 4, "-device", DEVICE, "-info"])
        assert result.status == 0, str(result)
        steps = [int(a) + int(b) for a, b in re.findall(r"device: (\d+) bytes there, (\d+) back", result.out)]
        assert len(steps) == 4 and steps[2] == steps[3] < steps[0], steps
        moved.append(steps[3])
        asked = re.findall(r"host array: (\S+) (\d+)", result.err)
        assert sum(int(calls) for _, calls in asked) < 12, asked  # at set-up
    assert moved[1] < 4.5 * moved[0]


def test_goes_on(run):
    """A checkpoint has what is on the device."""
    whole = series(run([*CAVITY, *WHOLE, "-mesh_cells", "4,4,4", "-device", DEVICE]))
    run([*CAVITY, *WHOLE, "-mesh_cells", "4,4,4", "-device", DEVICE, "-sim_steps", 5, "-checkpoint_every", 5])
    after = series(run([*CAVITY, *WHOLE, "-mesh_cells", "4,4,4", "-device", DEVICE, "-sim_restart", "latest"]))
    assert float(after[-1]["kinetic_energy"]) == pytest.approx(float(whole[-1]["kinetic_energy"]), rel=1e-10)


@pytest.mark.parametrize("scene, said", [(["cylinder-2d1.yaml"], "in space"), (["bench/sphere.yaml"], "without bodies")])
def test_refused(run, scene, said):
    result = run([ROOT / "runs" / scene[0], "-device", DEVICE, "-output_dir", "out"])
    assert result.status != 0 and "-device" in result.err and said in result.err, str(result)
