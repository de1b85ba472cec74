"""Every mutant is caught by a claim that holds for the right system."""

from __future__ import annotations

import pytest

import flocking as fk
from flocking.papers import mutation
from flocking.study import mutants

LONG = {"swapped obstacle velocity", *(name for name in mutation.CASES if "," in name)}
"""A hundred agents among obstacles, in thousands of samples; and further laws under a mutation of which the default
tests have one."""


@pytest.mark.parametrize(
    "mutant", [pytest.param(x, marks=[pytest.mark.slow] if x in LONG else []) for x in mutation.CASES]
)
def test_mutant_is_caught(mutant: str) -> None:
    found = mutation.catch(mutant)
    assert "ledger" in found.truth, "the right system must balance its books from the same samples"
    assert found.caught
    assert "ledger" in found.fails


def test_the_default_tests_have_every_mutation_but_the_long_one() -> None:
    kept = {name for name in mutation.CASES if name not in LONG}
    assert {name.partition(",")[0] for name in mutation.CASES} - kept == {"swapped obstacle velocity"}


def test_a_mutant_that_does_not_apply_is_refused() -> None:
    law = fk.Law(fk.Proximity(1.0), [fk.Gradient(fk.Potential("(r - 1)**2"))])
    scenario = fk.Scenario(law, fk.State([[0.0, 0.0], [0.5, 0.0]]), t_end=1.0)
    for mutation_of in (mutants.flipped_sign, mutants.dropped_link, mutants.swapped_boundary_velocity):
        with pytest.raises(fk.InvalidInput, match="mutant"):
            mutation_of(scenario)


def test_a_wrong_plant_breaks_the_ledger_of_the_engine_itself() -> None:
    """The engine's own ledger holds the declared law while another one moves the agents."""
    declared = fk.papers.paper("tanner-2003-fixed").scenario(seed=0).with_(t_end=5.0, frames=11, name="")
    gradient, consensus = declared.law.terms
    assert fk.audit(fk.simulate(declared, progress=False))["ledger"].verdict == "holds"
    wrong = fk.Law(declared.law.graph, (gradient, fk.Consensus(consensus.gain * 1.001)))
    assert fk.audit(fk.simulate(declared, plant=wrong, progress=False))["ledger"].verdict == "fails"
