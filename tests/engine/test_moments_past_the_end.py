"""A session that has gone on beyond the end of its scenario can be gone back to, as before it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.apps.commands.run_summary import facts, summary
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


GUSTS = fk.Disturbed(fk.PointMass(damping=0.5), 0.5, 0.07, 3)
"""Gusts, two of which begin after the end."""


@pytest.mark.parametrize(
    ("name", "gusts"), [("sampled", False), ("sampled", True), ("held tiles", False), ("delayed", True)]
)
def test_a_run_of_a_session_that_went_on_is_read_and_computed_again(name: str, gusts: bool, tmp_path: Path) -> None:
    declared = scenario(name).with_(agents=GUSTS) if gusts else scenario(name)
    session = fk.start(declared, ENGINES[name], **({"threads": 1} if name == "held tiles" else {}))
    assert session.scenario.t_end == END
    session.advance(END)
    assert "went on until" not in session.run().provenance
    session.advance(LATER)
    run = session.run()
    assert run.provenance["went on until"] == pytest.approx(LATER, abs=0.01)
    assert run.log is not None
    # With delays an agent is logged where what it knows lets a link switch, which none does here after the end.
    assert name == "delayed" or run.log.ticks[:, 0].max() > END * 1e9
    read = fk.read_run(fk.write_run(run, tmp_path / "run"))
    assert fk.first_difference(read, run) is None
    assert fk.replay(read).agrees
    told = dict(facts(summary(read)))
    assert float(told["time reached"]) == pytest.approx(LATER, abs=0.01)
