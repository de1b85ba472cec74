"""A session that has gone on beyond the end of its scenario can be gone back to, as before it."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from tests.engine.storage.crafted import ENGINES, scenario

END, BEYOND, LATER = 0.5, 0.62, 0.7
"""The end of the scenarios, the moment, and a time after it."""


@pytest.mark.parametrize("name", ["discrete", "heading", "delayed", "sampled", "messages", "held tiles"])
def test_a_moment_beyond_the_end_goes_on_with_the_same_bits(name: str) -> None:
    session = fk.start(scenario(name), ENGINES[name], **({"threads": 1} if name == "held tiles" else {}))
    assert session.scenario.t_end == END
    session.advance(BEYOND)
    again = session.moment()()
    assert (again.time, again.scenario) == (session.time, session.scenario)
    for each in (session, again):
        each.advance(LATER)
    assert np.array_equal(again.state.q, session.state.q)
    assert fk.first_difference(again.run(), session.run()) is None
