"""Errors of a worker process arrive with their words: they survive pickling, whatever was given."""

from __future__ import annotations

import inspect
import pickle

import numpy as np
import pytest

import flocking as fk
from flocking import errors

GIVEN = [3, "word", None, 0.5, np.arange(3.0), object(), lambda x: x, {"a": [1, 2]}]


@pytest.mark.parametrize("value", GIVEN, ids=[type(v).__name__ for v in GIVEN])
@pytest.mark.parametrize("kind", [errors.InvalidInput, errors.FormulaError])
def test_invalid_input_survives(kind, value) -> None:
    error = kind("Owner", "parameter", "must be right", value, "Make it right.")
    found = pickle.loads(pickle.dumps(error))
    assert type(found) is kind
    assert str(found) == str(error)
    assert (found.owner, found.parameter, found.rule, found.fix) == (
        "Owner",
        "parameter",
        "must be right",
        "Make it right.",
    )


KINDS = [
    kind for _, kind in inspect.getmembers(errors, inspect.isclass)
    if issubclass(kind, errors.SimulationError) and kind.__module__ == errors.__name__
]  # fmt: skip


@pytest.mark.parametrize("kind", KINDS, ids=[k.__name__ for k in KINDS])
def test_an_error_of_a_run_survives_with_its_time_and_agents(kind) -> None:
    error = kind("It stopped.", time=1.5, agents=(3, 7))
    found = pickle.loads(pickle.dumps(error))
    assert type(found) is kind
    assert (str(found), found.time, found.agents) == (str(error), 1.5, (3, 7))


def test_what_was_computed_comes_along() -> None:
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("-1/r**2"))])
    begin = fk.State([[0.0, 0.0], [0.2, 0.0]], [[0.0, 0.0], [0.0, 0.0]])
    with pytest.raises(fk.SimulationError) as raised:
        fk.simulate(fk.Scenario(law, begin, t_end=5.0, frames=51), progress=False)
    found = pickle.loads(pickle.dumps(raised.value))
    assert str(found) == str(raised.value)
    np.testing.assert_array_equal(found.run.q, raised.value.run.q)
