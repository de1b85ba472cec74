"""Parts of the wrong kind are refused in words when they are given."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.exact.session import ExactSession
from flocking.errors import FormulaError, InvalidInput

LAW = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("(r - 1)**2")), fk.Consensus(1.0)])
START = fk.State([[0.0, 0.0], [1.0, 0.0]])


@pytest.mark.parametrize("engine", ["exact", "tiles"])
@pytest.mark.parametrize("plant", ["consensus", fk.Scenario(LAW, START, 1.0), fk.Consensus(1.0), 0])
def test_a_plant_that_is_no_law_is_refused(engine: str, plant: object) -> None:
    with pytest.raises(InvalidInput, match="plant must be a Law, or None"):
        fk.simulate(fk.Scenario(LAW, START, 1.0), engine=engine, plant=plant, progress=False)  # type: ignore[arg-type]


def test_a_plant_that_is_no_law_is_refused_when_a_session_goes_on() -> None:
    snapshot = ExactSession(fk.Scenario(LAW, START, 1.0)).snapshot()
    with pytest.raises(InvalidInput, match="plant must be a Law, or None"):
        ExactSession.resume(snapshot, plant="consensus")  # type: ignore[arg-type]


@pytest.mark.parametrize("formula", [lambda r: r**2, None, np.sin, 3])
def test_a_potential_is_written_not_programmed(formula: object) -> None:
    with pytest.raises(FormulaError, match="must be a text or a SymPy expression"):
        fk.Potential(formula)  # type: ignore[arg-type]


def test_more_columns_than_space_has_dimensions_are_mentioned() -> None:
    with pytest.warns(UserWarning, match=r"2 agents in 10 dimensions: rows are agents"):
        fk.State(np.zeros((2, 10)))
    fk.State(np.zeros((10, 3)))
