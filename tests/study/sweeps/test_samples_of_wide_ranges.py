"""Points drawn from ranges whose lengths, quotients or ends doubles do not hold."""

import numpy as np
import pytest
from scipy.stats import kstest

import flocking as fk


@pytest.mark.parametrize(("ends", "log"), [
    ((1e-200, 1e200), True), ((5e-324, 1e308), True), ((-1.7e308, 1.7e308), False), ((1e-8, 1e-3), True),
    ((-2.0, 3.0), False),
])  # fmt: skip
@pytest.mark.parametrize("method", ["random", "latin", "sobol"])
def test_points_are_even_over_ranges_of_any_width(ends, log, method):
    points = np.array(fk.Sample(method, 128, {"a": ends}, log=["a"] if log else ()).points()["a"])
    scaled = np.log(points) if log else points / 4
    low, high = np.log(ends) if log else np.array(ends) / 4
    assert kstest((scaled - low) / (high - low), "uniform").pvalue > 1e-4


def test_integers_that_doubles_round_are_refused():
    assert set(fk.Sample("random", 40, {"a": (2**53 - 1, 2**53)}).points()["a"]) == {2**53 - 1, 2**53}
    with pytest.raises(fk.InvalidInput, match="integers of at most 9007199254740992"):
        fk.Sample("random", 4, {"a": (0, 2**63 - 1)})


def test_integers_of_numpy_are_recorded_as_integers(tmp_path):
    from tests.study.sweeps.sweep_cases import make

    given = {
        "seeds": [0],
        "measures": {"agents": lambda run: run.n},
        "workers": 1,
        "progress": False,
        "out": tmp_path / "o",
    }
    for kind in (np.int64, int):
        table = fk.sweep(make, sample=fk.Sample("latin", 3, {"n": (kind(2), kind(5))}), **given)
        assert table.columns["n"] == table.columns["agents"]
