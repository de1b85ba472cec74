"""A start without a finite energy is refused by every engine, with the pair that makes it so."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput

START = fk.State([[0.0, 0.0], [1.0, 0.0], [0.0, 3.0]], np.zeros((3, 2)))


def scenario(start: fk.State = START, **world: object) -> fk.Scenario:
    graph = fk.Fixed(3, [(0, 1), (0, 2)])
    law = fk.Law(graph, [fk.Gradient(fk.Potential("log(a - r)", a=2.0)), fk.Consensus(1.0)])
    return fk.Scenario(law, start, t_end=1.0, **world)


@pytest.mark.parametrize(
    ("engine", "world"),
    [("exact", {}), ("tiles", {}), ("tiles", {"control": fk.Held(0.1)}), ("sampled", {"control": fk.Held(0.1)})],
)
def test_the_pair_and_its_distance_are_named(engine: str, world: dict[str, object]) -> None:
    said = (
        r"finite energy; got nan\. Agents 0 and 2 are neighbours at distance 3, where .*log\(a - r\).* no finite value"
    )
    with pytest.raises(InvalidInput, match=said):
        fk.start(scenario(**world), engine=engine)


def test_velocities_that_overflow_are_named() -> None:
    fast = fk.State([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[1e200, 0.0], [0.0, 0.0], [0.0, 0.0]])
    with pytest.raises(InvalidInput, match="Squares of the velocities overflow in float64"):
        fk.start(scenario(fast), engine="exact")
