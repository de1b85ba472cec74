"""Errors of imperfect motions, estimated by repetitions, against closed forms and exact recursions."""

from dataclasses import replace
from fractions import Fraction
from math import factorial

import numpy as np
import pytest

import flocking as fk
from flocking.papers.cucker_smale_2007 import system
from flocking.study.claims.claim import Claim, Measure
from flocking.study.claims.subjects import Subject, about
from flocking.study.evidence import Evidence, NotResolvable
from flocking.study.evidence.repetitions import SAFETY, Repetitions, repetitions_of

DURATION = 12.0


def relative_velocity(t, delay):
    """The solution of w'(t) = -w(t - delay) with w = 1 until t = 0, in exact arithmetic (method of steps)."""
    t, delay = Fraction(t), Fraction(delay)
    terms, k = Fraction(1), 1
    while t - (k - 1) * delay > 0:
        terms += Fraction(-1) ** k * (t - (k - 1) * delay) ** k / factorial(k)
        k += 1
    return float(terms)


def measured_at(frame):
    """The relative velocity at a frame, as a margin."""

    @about(Subject.VELOCITIES)
    def velocity(e):
        return Measure(float(e.p[frame, 0, 0] - e.p[frame, 1, 0]), 0.0, "relative velocity")

    return velocity


def late(delay, tolerance):
    made = system.late_pair(delay, duration=DURATION).with_(frames=25, tolerance=tolerance)
    return fk.simulate(made, progress=False)


@pytest.mark.parametrize(("delay", "tolerance"), [(1.5, 1e-9), (1.5, 1e-6), (0.375, 1e-9), (0.375, 1e-4)])
def test_stated_errors_cover_true_ones_and_are_of_their_size(delay, tolerance):
    """For the delay 0.375 most steps end at the delay: a smaller tolerance alone would give the same motion."""
    run = late(delay, tolerance)
    claims = [Claim(f"at-{k}", "here", "Positive.", measured_at(k)) for k in range(1, 25)]
    results = fk.audit(run, claims).results
    exact = np.array([relative_velocity(t, delay) for t in run.t[1:]])
    stated = np.array([result.error for result in results])
    off = np.abs(np.array([result.margin for result in results]) - exact)
    assert (off <= stated + 1e-15).all()
    assert 0.0 < stated.max() <= 10.0 * SAFETY * off.max()


def test_margins_within_the_estimate_are_left_open():
    run = late(1.5, 1e-6)
    values = run.p[:, 0, 0] - run.p[:, 1, 0]
    offs = np.abs(values - [relative_velocity(t, 1.5) for t in run.t])
    worst = int(offs.argmax())
    value, off = float(values[worst]), float(offs[worst])

    def judged(beyond):
        @about(Subject.VELOCITIES)
        def above_bound(e):
            return Measure(float(e.p[worst, 0, 0] - e.p[worst, 1, 0]) - (value - beyond))

        return str(fk.audit(run, [Claim("c", "here", "Above.", above_bound)])["c"].verdict)

    assert off > 1e-7
    assert [judged(share * off) for share in (0.5, -0.5, 50, -50)] == [
        "not resolved", "not resolved", "holds", "fails",
    ]  # fmt: skip


GROWING = fk.Law(fk.Fixed.complete(4), [fk.Gradient(fk.Potential("(r - 1)**2/2"))])


def test_motions_that_differ_too_much_are_no_estimate():
    """Oscillations that a delay drives grow, and so do the errors of coarse steps."""
    begin = fk.start.box(4, side=2, speed=1, seed=1)
    world = fk.Delayed(0.4)
    run = fk.simulate(
        fk.Scenario(GROWING, begin, t_end=20, frames=21, information=world, tolerance=0.05), progress=False
    )
    with pytest.raises(NotResolvable, match="of its extent"):
        Evidence(run).repetitions  # noqa: B018
    result = fk.audit(run, [Claim("c", "here", "Positive.", measured_at(0))])["c"]
    assert str(result.verdict) == "not resolved"
    assert "differ from it by" in result.note


def test_runs_that_are_not_repeated_say_why():
    run = late(1.5, 1e-6)
    with pytest.raises(NotResolvable, match="other frames"):
        Evidence(replace(run.until(6.0), status=run.status)).repetitions  # noqa: B018
    with pytest.raises(NotResolvable, match="too many"):
        Evidence(replace(run, provenance={**run.provenance, "steps": 10**6})).repetitions  # noqa: B018
    with pytest.raises(NotResolvable, match="not finished"):
        Evidence(replace(run, status="interrupted")).repetitions  # noqa: B018


def test_what_more_accurate_runs_leave_unsettled_is_left_open():
    run = late(1.5, 1e-6)

    @about(Subject.VELOCITIES)
    def settled(e):
        return Measure(1.0, 0.0, "measured", "" if e.run is run else "it still moves")

    result = fk.audit(run, [Claim("c", "here", "Settled.", settled)])["c"]
    assert str(result.verdict) == "not resolved"
    assert result.note == "measured; more accurate runs leave it unsettled"


def test_equal_margins_do_not_make_an_error_of_zero():
    assert Repetitions((), 1e-7).error(2.0, [2.0, 2.0]) == pytest.approx(SAFETY * 2e-7)
    assert Repetitions((), 0.0).error(1.0, [1.5, 2.0]) == SAFETY
    assert Repetitions((), 0.0).error(2.0, [1.5, 2.0]) == SAFETY * 0.5
    assert np.isnan(Repetitions((), 0.0).error(2.0, [1.5, np.nan]))
    assert np.isnan(Repetitions((), 0.0).error(2.0, [np.nan, 1.5]))


def exact_recursion(q, p, period, ticks):
    """Second-order consensus of a complete graph with held forces, in rational numbers: positions at every tick."""
    T = Fraction(period)
    q, p = ([[Fraction(x) for x in row] for row in values.tolist()] for values in (q, p))
    found = []
    for _ in range(ticks + 1):
        found.append([[float(x) for x in row] for row in q])
        n, m = len(q), len(q[0])
        u = [[sum(q[j][k] - q[i][k] + p[j][k] - p[i][k] for j in range(n)) for k in range(m)] for i in range(n)]
        q = [[q[i][k] + T * p[i][k] + T * T * u[i][k] / 2 for k in range(m)] for i in range(n)]
        p = [[p[i][k] + T * u[i][k] for k in range(m)] for i in range(n)]
    return np.array(found)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_rounding_grows_to_under_held_control_is_within_its_estimate(seed):
    """A period beyond the bound of stability: disagreement grows threefold a tick or so, and rounding with it.

    The period is a dyadic number, so that rational numbers say what the run would be without rounding.
    """
    rng = np.random.default_rng(seed)
    law = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("r**2/2")), fk.Consensus(1.0)])
    q, p = 1.0 + 1e-9 * rng.normal(size=(3, 2)), 3.0 + 1e-9 * rng.normal(size=(3, 2))
    made = fk.Scenario(law, fk.State(q, p), t_end=18.0, frames=19, control=fk.Held(1.0))
    run = fk.simulate(made, progress=False)
    exact = exact_recursion(q, p, 1.0, 18)
    off = float(np.abs(run.q - exact)[-1].max())
    found = Evidence(run).repetitions
    spread = [float(np.abs(one.q[-1] - run.q[-1]).max()) for one in found.runs]
    stated = [
        found.error(float(run.q[-1, i, k]), [float(one.q[-1, i, k]) for one in found.runs])
        for i in range(3)
        for k in range(2)
    ]
    # Amplified far beyond the rounding of one number, found, and not overstated a thousandfold.
    assert off > 1e-10
    assert off < max(stated)
    assert max(spread) < 1e3 * off
    assert "errors larger than those of rounding" in found.note


def discrete_pair(gain, frames=21):
    law = fk.Law(fk.Fixed.complete(2), [fk.Consensus(gain)])
    start = fk.State([[0.0, 0.0], [0.3, 0.0]], [[1.0, 0.0], [0.0, 0.1]])
    world = {"bodies": fk.Impulsive(), "control": fk.Held(0.1)}
    return fk.simulate(fk.Scenario(law, start, t_end=2.0, frames=frames, **world), progress=False)


def test_in_discrete_time_errors_are_those_that_rounding_grows_to():
    """The relative velocity is multiplied by 1 - 2 g T at every tick: growth by 9 a tick makes rounding visible."""
    run = discrete_pair(50.0)
    assert run.fidelity.engine == "discrete"
    claims = [Claim(f"at-{k}", "here", "Positive.", measured_at(k)) for k in range(1, 21)]
    results = fk.audit(run, claims).results
    factor = 1 - 2 * Fraction(50) * Fraction(0.1)
    k = [round(t / 0.1) for t in run.t[1:]]
    shown = np.array([result.margin for result in results])
    stated = np.array([result.error for result in results])
    exact = np.array([float(factor**j) for j in k])
    assert shown[0] == pytest.approx(exact[0], rel=1e-9)
    assert (np.abs(shown - exact) <= stated).all()
    assert (stated > 0).all()
    assert (stated < 1e-9 * np.abs(exact)).all()


def test_in_discrete_time_a_verdict_says_where_no_error_is_estimated():
    """Before, it stated an error of 0."""
    run = discrete_pair(0.5)
    claim = Claim("at-20", "here", "Positive.", measured_at(20))
    (small,) = fk.audit(run, [claim]).results
    assert small.verdict == "holds"
    assert small.error > 0
    other = replace(run, provenance={**run.provenance, "steps": 10**9})
    (large,) = fk.audit(other, [claim]).results
    assert large.verdict == "holds"
    assert np.isnan(large.error)
    assert "whose rounding errors are not estimated: 1000000000 steps of 2 agents are too many to repeat" in large.note
    assert large.as_dict()["error"] is None


def test_a_stored_run_that_states_few_steps_of_a_tiny_length_is_not_repeated():
    run = fk.simulate(
        fk.Scenario(fk.Law(fk.Complete(), [fk.Consensus(1.0)]), fk.start.box(2, side=1.0, seed=1), t_end=1.0, frames=3),
        engine="tiles", step=0.1, progress=False,
    )  # fmt: skip
    with pytest.raises(NotResolvable, match="1000000000 steps of 2 agents are too many to repeat"):
        Evidence(replace(run, provenance={**run.provenance, "step": 1e-9})).repetitions  # noqa: B018


@pytest.mark.parametrize("agents", [1, 3])
def test_one_agent_and_agents_of_one_velocity_have_an_extent(agents: int) -> None:
    """Their repetitions differ by rounding alone, a tiny share of the way that they go."""
    q = np.array([[0.0, 0.0], [9.0, 1.0], [-7.0, 2.0]])[:agents]
    start = fk.State(q, np.tile([0.7, -0.3], (agents, 1)))
    scenario = fk.Scenario(fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)]), start, t_end=3.0, frames=31)
    run = fk.simulate(scenario, engine="tiles", step=0.01, progress=False)
    assert repetitions_of(run).share < 1e-3
    agreed = next(r for r in fk.audit(run).results if r.claim.key == "velocities-agree")
    assert "inf" not in agreed.note
    assert agreed.verdict != "fails"
