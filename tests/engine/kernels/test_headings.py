"""Headings of unicycles along given motions: closed forms, and offsets that are too small."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.kernels.headings import turned
from flocking.errors import SimulationError

START = 2.0


@pytest.mark.parametrize("far", [0.3, 30.0, 3e4])
def test_heading_along_a_straight_line_is_its_closed_form(far: float) -> None:
    """Along (1, 0) the angle a obeys a' = -sin(a) v/d, so that tan(a/2) decays with exp(-v t/d)."""
    angles, offset, speed = np.array([0.5, 3.0, -2.0]), 0.01, 0.7
    C = np.zeros((3, 3, 2))
    C[1, :, 0] = speed
    span = far * offset / speed
    found = turned(C, np.full(3, offset), np.full(3, span), np.stack([np.cos(angles), np.sin(angles)], axis=1))
    expected = 2.0 * np.arctan(np.tan(angles / 2.0) * np.exp(-far))
    assert np.abs(found - np.stack([np.cos(expected), np.sin(expected)], axis=1)).max() < 1e-11


@pytest.mark.parametrize("offset", [1e-320, 1e-300, 1e-12, 1e-8])
@pytest.mark.parametrize("engine", ["sampled", "tiles"])
def test_an_offset_that_no_heading_can_follow_ends_the_run_by_name(engine: str, offset: float) -> None:
    n = 6
    rng = np.random.default_rng(1)
    heading = np.tile([1.0, 0.0], (n, 1))
    start = fk.State(rng.uniform(0, 6, (n, 2)), rng.uniform(-1, 1, (n, 2)), START, columns={"heading": heading})
    offsets = np.full(n, 0.1)
    offsets[4] = offset
    scenario = fk.Scenario(
        fk.Law(fk.Proximity(3.0), [fk.Consensus()]), start, agents=fk.Unicycle(offsets), control=fk.Held(0.1),
        t_end=START + 1.0, frames=5,
    )  # fmt: skip
    with pytest.raises(SimulationError, match=r"Unicycle\.offset") as caught:
        fk.simulate(scenario, engine=engine, progress=False, **({"step": 0.1} if engine == "tiles" else {}))
    assert caught.value.agents == (4,)
    assert START <= caught.value.time <= START + 0.1
    assert caught.value.run is not None
