"""tools/aggregate: spheres touch, none overlap, they hang together, and the radius of gyration is that of the dimension asked for."""
import subprocess
from pathlib import Path

import numpy as np
import pytest

AGGREGATE = Path(__file__).resolve().parents[2] / "tools" / "aggregate"


@pytest.mark.parametrize(("number", "dimension", "plane", "factor"), [(32, 1.8, False, 1.3), (32, 2.4, False, 1.3), (24, 1.5, True, 1.2)])
def test_aggregate(tmp_path, number, dimension, plane, factor):
    words = [AGGREGATE, str(number), "--dimension", str(dimension), *(["--plane"] if plane else []), "--output", tmp_path / "a.csv"]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    x = np.loadtxt(tmp_path / "a.csv", delimiter=",", skiprows=1)
    distance = np.sqrt(((x[:, None] - x[None]) ** 2).sum(-1)) + 9 * np.eye(number)
    assert x.shape == (number, 2 if plane else 3) and distance.min() > 2 - 1e-7
    joined = distance < 2 + 1e-7
    assert joined.sum() // 2 >= number - 1
    reached = np.zeros(number, bool)
    reached[0] = True
    for _ in range(number):
        reached |= joined[reached].any(0)
    assert reached.all()
    gyration = np.sqrt(((x - x.mean(0)) ** 2).sum(1).mean() + (0.5 if plane else 0.6))
    assert factor * gyration**dimension == pytest.approx(number, rel=0.02), done.stdout
