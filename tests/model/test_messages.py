"""Messages give numbers as numbers: no type of an array library stands in them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput, SimulationError, said

X, K = np.float64, np.int64


@pytest.mark.parametrize(
    ("made", "told"),
    [
        (lambda: fk.Hysteresis(X(-1), 1), "got -1.0."),
        (lambda: fk.Hysteresis(1, X(2)), "got 2.0."),
        (lambda: fk.Velocity([1.0, 2.0], [X(3)]), "got [3.0]."),
        (lambda: fk.Schedule(np.array([2.0, 1.0]), [1, 2, 3]), "got [2.0, 1.0]."),
        (lambda: fk.Potential("a*r", a=X(np.inf)), "got inf."),
        (lambda: fk.Agents(order=K(3)), "got 3."),
        (lambda: fk.Wall([0.0], np.array([X(0)])), "got [0.0]."),
        (lambda: fk.Scenario(fk.Law(fk.Proximity(1.0), [fk.Consensus()]), fk.State(np.eye(2)), X(-1)), "got -1.0."),
        (lambda: fk.start.box(K(0), side=1.0, seed=0), "got 0."),
    ],
)
def test_a_number_is_told_as_one(made: Callable[[], object], told: str) -> None:
    with pytest.raises(InvalidInput) as refused:
        made()
    assert told in str(refused.value)


def test_numbers_inside_other_values_too() -> None:
    assert said({"a": [X(1.5), (K(2), np.array([X(0.1)]))], "b": {K(3)}}) == "{'a': [1.5, (2, [0.1])], 'b': {3}}"
    assert len(said(list(range(1000)))) == 120
    assert "agents [1, 2]" in str(SimulationError("stopped", time=1.0, agents=(K(1), K(2))))  # type: ignore[arg-type]
