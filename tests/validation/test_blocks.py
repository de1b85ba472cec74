"""Random laws and starts: blocks of steps in native code give the run, or the error, that single steps give."""

from __future__ import annotations

from typing import Any

import pytest

import flocking as fk
from flocking.engine.exact import session
from flocking.engine.exact.blocks.block import take_block
from flocking.engine.runs.run_errors import accuracy_data
from tests.validation.draws import draw

TABLES = ("t", "q", "p", "links", "switches", "trace")


def outcome(scenario: fk.Scenario) -> tuple[Any, ...]:
    """All that a run says, or its error and what was computed until then."""
    error = None
    try:
        run = fk.simulate(scenario, progress=False)
    except fk.SimulationError as raised:
        run, error = raised.run, (type(raised), str(raised))
    assert run is not None
    assert run.accuracy is not None
    known = accuracy_data(run.accuracy), run.accuracy.frames.tobytes(), run.closest_linked, run.closest_unlinked
    return error, *(getattr(run, name).tobytes() for name in TABLES), *known, run.provenance["steps"]


def compare(numbers: range, monkeypatch: pytest.MonkeyPatch) -> None:
    steps, taken = 0, 0

    def counted(*given: Any, **how: Any) -> Any:
        nonlocal taken
        found = take_block(*given, **how)
        taken += 0 if found is None else found.taken
        return found

    for number in numbers:
        scenario = draw(31, number).scenario
        monkeypatch.setattr(session, "take_block", lambda *_, **__: None)
        expected = outcome(scenario)
        monkeypatch.setattr(session, "take_block", counted)
        assert outcome(scenario) == expected, f"draw {number}"
        steps += expected[-1]
    assert taken > 0.7 * steps


def test_random_runs_in_blocks_have_the_bits_of_single_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    compare(range(10), monkeypatch)


@pytest.mark.slow
def test_thousands_of_random_runs_in_blocks_have_the_bits_of_single_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    compare(range(10, 3000), monkeypatch)
