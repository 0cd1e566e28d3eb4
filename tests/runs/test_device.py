"""-device emulate: the kernels of a GPU, on the processor, give the numbers of the processor's own in no more iterations."""
import csv

import pytest

from collector import ROOT

CAVITY = [ROOT / "runs" / "bench" / "cavity-3d.yaml", "-mesh_cells", "8,8,8", "-sim_steps", 4, "-output_every", 0, "-output_dir", "out",
          "-output_overwrite"]
VELOCITY = ["-flow_velocity_smoother", "jacobi", "-flow_fieldsplit_velocity_ksp_type", "bcgs"]  # what a device takes
WHOLE = ["-flow_ksp_rtol", "1e-11", "-flow_velocity_tol", 0]
# preset and options of both, options of the processor, how far numbers may be apart: the pressure's smoother is another one
CASES = {
    "balanced, solved whole": (["-preset", "balanced", *WHOLE], ["-flow_ksp_type", "fgmres"], 1e-10),
    "balanced": (["-preset", "balanced"], ["-flow_ksp_type", "fgmres"], 2e-5),
    "fast": (["-preset", "fast"], [], 2e-3),  # half of what its single iteration leaves on the processor
}


def series(result):
    assert result.status == 0, str(result)
    with open(result.folder / "out" / "series.csv") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("case", CASES)
def test_same_numbers(run, case):
    options, taken, apart = CASES[case]
    there, here = series(run([*CAVITY, *options, "-device", "emulate"])), series(run([*CAVITY, *options, *VELOCITY, *taken]))
    assert len(there) == len(here) > 3
    for a, b in zip(there, here, strict=True):
        assert int(a["outer_iterations"]) <= int(b["outer_iterations"])
        assert float(a["kinetic_energy"]) == pytest.approx(float(b["kinetic_energy"]), rel=apart)
    assert float(there[-1]["kinetic_energy"]) > 1e-3


@pytest.mark.parametrize("scene, said", [(["cylinder-2d1.yaml"], "in space"), (["bench/sphere.yaml"], "without bodies")])
def test_refused(run, scene, said):
    result = run([ROOT / "runs" / scene[0], "-device", "emulate", "-output_dir", "out"])
    assert result.status != 0 and "-device" in result.err and said in result.err, str(result)
