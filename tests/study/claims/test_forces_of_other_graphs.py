"""Claims about the potential's equilibrium: a law whose graph is named again for a term, and further forces at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import flocking as fk

PSI = fk.Potential("(r - 1)**2")
WIDE = fk.Proximity(50.0)
START = fk.State([[0.0, 0.0], [1.4, 0.0], [0.6, 1.2], [1.9, 1.1]])
KEYS = ("forces-vanish", "potential-minimal")


@dataclass(frozen=True)
class Spring(fk.PairTerm):
    """Attraction in proportion to the distance, with its energy."""

    structure = ("Spring",)
    parameters = property(lambda self: {})

    def along(self, x):
        return x.r

    def storage(self, x):
        return x.r**2 / 2


@dataclass(frozen=True)
class Pull(fk.PairTerm):
    """The same without a stated energy: its power counts as supplied."""

    structure = ("Pull",)
    parameters = property(lambda self: {})

    def along(self, x):
        return x.r


@dataclass(frozen=True)
class Resistance(fk.PairTerm):
    """Acts on agents that approach or retreat alone."""

    structure = ("Resistance",)
    parameters = property(lambda self: {})

    def along(self, x):
        return x.radial

    def dissipation(self, x):
        return x.radial**2


def verdicts(terms, t_end):
    run = fk.simulate(fk.Scenario(fk.Law(WIDE, terms), START, t_end=t_end), progress=False)
    found = fk.audit(run)
    return [found[key] for key in KEYS], float(np.abs(fk.control(run.scenario.law, run.state(-1))).max())


def test_a_term_that_names_the_graph_of_its_law_is_judged_as_one_that_names_none():
    """Its forces were left out, so that those of a group that swings on counted as balanced."""
    one, left = verdicts([fk.Gradient(PSI), fk.Consensus(1e-4)], 3.0)
    other, _ = verdicts([fk.Gradient(PSI, over=WIDE), fk.Consensus(1e-4)], 3.0)
    assert left > 1.0
    assert [(r.verdict, r.note) for r in other] == [(r.verdict, r.note) for r in one]
    assert not any(str(r.verdict) == "holds" for r in other)


def test_an_equal_graph_is_another_one():
    found, _ = verdicts([fk.Gradient(PSI, over=fk.Proximity(50.0)), fk.Consensus(1e-4)], 3.0)
    assert [(str(r.verdict), r.note) for r in found] == [("not applicable", "a potential acts over another graph")] * 2


@pytest.mark.parametrize("further", [Spring(), Pull()], ids=lambda term: type(term).__name__)
def test_where_further_terms_act_on_agents_at_rest_the_potential_alone_is_not_judged(further):
    """All forces balance at the end; those of the potential do not, nor are they the whole."""
    found, left = verdicts([fk.Gradient(PSI), further, fk.Consensus(2.0)], 60.0)
    assert left < 1e-6
    assert [str(r.verdict) for r in found] == ["not applicable"] * 2
    assert type(further).__name__ in found[0].note


def test_terms_that_resist_motion_leave_the_potential_to_be_judged():
    found, _ = verdicts([fk.Gradient(PSI), Resistance(), fk.Consensus(2.0)], 60.0)
    assert [str(r.verdict) for r in found] == ["holds"] * 2
