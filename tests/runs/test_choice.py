"""-flow_print_choice: what the solver takes for a step, said when it changes and not again."""
import re

import pytest

from collector import ROOT

# falls faster and faster: convective number 0 in the first step, 1.5 at the end
SCENE = [ROOT / "runs" / "sedimentation.yaml", "-mesh_cells", "16,48", "-sim_dt", 0.05, "-sim_steps", 8, "-output_dir", "out", "-output_overwrite"]
LINE = re.compile(r"^solver from time (\S+): (.*) \(viscous number (\S+), convective (\S+)\)$", re.M)


@pytest.mark.parametrize("ranks", [1, 2])
def test_growing_convective_number(run, ranks):
    result = run([*SCENE, "-flow_print_choice"], ranks)
    assert result.status == 0, str(result)
    (start, before, _, slow), (time, after, _, fast) = LINE.findall(result.out)
    assert (before, after) == ("two stages, velocity sor, cut cells relaxed", "two stages, velocity ilu, cut cells relaxed")
    # the incomplete factorisation is for convective numbers above 1, by the velocity that the step begins with
    assert float(start) == 0.05 and float(slow) == 0 and 1 < float(fast) < 1.5 and 0.1 < float(time) < 0.3


def test_silence(run):
    """Without the option nothing is said; with one method for all numbers it is said once."""
    assert "solver from" not in run(SCENE).out
    assert len(LINE.findall(run([*SCENE, "-flow_print_choice", "-flow_velocity_smoother", "sor"]).out)) == 1
