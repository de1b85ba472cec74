"""The summary of a run in words: which pairs it is about, and times of runs that begin late."""

from __future__ import annotations

import pytest

import flocking as fk
from flocking.apps.commands.run_summary import facts, summary


def passing(t: float, engine: str) -> dict[str, str]:
    """Facts of two agents without a link that pass at a distance of 1 after a second, beside a linked pair 3 apart."""
    law = fk.Law(fk.Fixed(4, [(2, 3)]), [fk.Gradient(fk.Potential("(r - 3)**2/2"))])
    q = [[0.0, 0.0], [2.0, 1.0], [50.0, 0.0], [53.0, 0.0]]
    start = fk.State(q, [[1.0, 0.0], [-1.0, 0.0], [0.0, 0.0], [0.0, 0.0]], t)
    run = fk.simulate(fk.Scenario(law, start, t_end=t + 4.0, frames=5), engine=engine, progress=False)
    return dict(facts(summary(run)))


@pytest.mark.parametrize("t", [0.0, 1.76e9])
def test_the_closest_pair_of_all_and_of_linked_pairs_alone_are_distinguished(t):
    found = passing(t, "exact")
    assert found["closest pair"].startswith("1, agents 0 and 1")
    assert "closest linked pair" not in found
    tiled = passing(t, "tiles")
    assert tiled["closest linked pair"].startswith("3, agents 2 and 3")
    assert "closest pair" not in tiled


def test_times_of_runs_that_begin_late_have_the_digits_that_differ():
    found = passing(1.76e9, "exact")
    assert found["time reached"] == "1760000004"
    assert found["closest pair"].endswith("t = 1760000001")


def test_an_energy_that_is_known_for_a_part_of_the_run_is_not_that_at_the_end():
    """Under held forces two agents leave a barrier at a distance of 1, where the energy is infinite."""
    law = fk.Law(fk.Proximity(1.0), [fk.Gradient(fk.Potential("-log(1 - r**2)"))])
    start = fk.State([[0.0, 0.0], [0.5, 0.0]], [[0.0, 0.0], [3.0, 0.0]])
    run = fk.simulate(fk.Scenario(law, start, t_end=3.0, frames=4, control=fk.Held(0.1)), progress=False)
    found = summary(run)
    assert dict(facts(found))["energy"].endswith("at t = 0.1, where the ledger ends")
    assert found["energy"]["ledger_ends"] == run.trace["time"][-1] == 0.1
