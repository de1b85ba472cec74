"""A run says in one line what it is."""

from __future__ import annotations

import flocking as fk


def test_a_run_is_one_short_line() -> None:
    law = fk.Law(fk.Proximity(1.5), [fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[-1.0, 0.0], [1.0, 0.0]])
    run = fk.simulate(fk.Scenario(law, start, t_end=2.0, frames=5, name="two"), progress=False)
    assert repr(run) == "<Run 'two', 2 agents, 5 frames (t = 0 to 2), 1 switches, finished>"
    assert "'" not in repr(fk.simulate(fk.Scenario(law, start, t_end=1.0, frames=2), progress=False))
