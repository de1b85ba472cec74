"""What the lab says of a claim while a run goes on, and of what is guaranteed from a moment on."""

import pytest

import flocking as fk
from flocking.apps.lab.panels.measures import guarantees_of, verdicts_on
from flocking.study.claims.claim import Claim, Measure, Verdict, below
from flocking.study.claims.subjects import Subject, Witness, about
from flocking.study.evidence import Evidence

START = fk.State([[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [0.0, 0.0]])
LAW = fk.Law(fk.Complete(), [fk.Consensus(1.0)])


def first(e: Evidence) -> Witness:
    return Witness(float(e.t[0]), (0,))


@pytest.mark.parametrize(("lasting", "early"), [(True, "fails"), (False, "not yet")])
def test_a_failure_that_may_pass_is_none_before_the_end(lasting, early):
    """A speed was too large for good; agents that are too fast now may slow down until the end."""

    @about(Subject.VELOCITIES, first, lasting=lasting)
    def slow(e: Evidence) -> Measure:
        return below(float(e.speeds.max()), 0.5, "largest speed")

    claim = Claim("slow", "own question", "No agent is faster than a half.", slow)
    run = fk.simulate(fk.Scenario(LAW, START, 1.0, frames=5), progress=False)
    assert [x.word for x in verdicts_on(run.until(0.5), [claim])] == [early]
    assert [x.word for x in verdicts_on(run, [claim])] == ["fails"]


def test_what_an_error_leaves_open_is_told_with_the_error():
    def close(e: Evidence) -> Measure:
        return Measure(0.1, 0.25, "closest 1.1")

    claim = Claim("close", "own question", "Agents stay apart.", close)
    run = fk.simulate(fk.Scenario(LAW, START, 0.1, frames=2), progress=False)
    (shown,) = verdicts_on(run, [claim])
    assert (shown.word, shown.note) == (str(Verdict.NOT_RESOLVED), "closest 1.1, known to within 0.25")


def test_a_held_force_is_not_known_from_a_state():
    """From an intervention on forces and messages are on their way that no state contains: nothing is guaranteed."""
    held = fk.Scenario(LAW, START, 0.4, frames=3, control=fk.Held(0.1), information=fk.Messages(0.1))
    run = fk.simulate(held, progress=False)
    assert guarantees_of(run) is not None
    assert guarantees_of(run, untouched=False) is None
    ideal = fk.simulate(fk.Scenario(LAW, START, 0.4, frames=3), progress=False)
    assert guarantees_of(ideal, untouched=False) is not None
