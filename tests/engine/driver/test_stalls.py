"""Runs that hardly advance warn once, with the time and the agents; others do not."""

from __future__ import annotations

import warnings

import pytest

import flocking as fk
from flocking.engine.driver import stalls
from flocking.engine.driver.simulate import drive
from flocking.errors import HardlyAdvances, SimulationError

FAST = 3.0
"""Speed at which two agents part: the potential holds them, and what limits or delays its force lets them go on."""


def parting(**world: object) -> fk.Scenario:
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("1/(R - r) + 1/r", R=2.0))])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[-FAST, 0.0], [FAST, 0.0]])
    return fk.Scenario(law, start, t_end=5.0, **world)


@pytest.mark.parametrize(
    "world",
    [
        pytest.param({"agents": fk.Lagged(fk.PointMass(), 0.1)}, id="lagged"),
        pytest.param({"information": fk.Delayed(0.2)}, id="delayed", marks=pytest.mark.slow),
    ],
)
def test_a_run_that_comes_to_a_pole_and_never_to_its_end_says_so_once(
    world: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stalls, "STALLED_STEPS", 50)
    # Without this the exact engine ends the run of lagged bodies where positions do not resolve the force.
    monkeypatch.setattr("flocking.engine.exact.session.check_resolved", lambda *_: None)
    slices, session = [], fk.start(parting(**world))

    def watch(session: object) -> None:
        slices.append(len(told))
        if slices.count(1) == 3:
            raise SimulationError("that is enough", time=0.0)

    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", HardlyAdvances)
        with pytest.raises(SimulationError, match="enough"):
            drive(session, progress=False, watch=watch)
    (warning,) = (each for each in told if each.category is HardlyAdvances)
    assert "steps have shrunk to" in str(warning.message)
    assert "agents 0 and 1" in str(warning.message)
    # They are a distance of 1 from the pole at the start, and part at a speed of 6 or a little less.
    assert 1.0 / 6.0 - 1e-3 < session.time < 5.0


def test_a_run_that_comes_to_its_end_does_not_warn() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", HardlyAdvances)
        assert fk.simulate(parting(), progress=False).finished
