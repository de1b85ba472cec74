"""Translations, shifts of time and Galilean shifts cost no digits; where they must, the run says so."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.exact.session import ExactSession
from flocking.errors import OutOfPrecision
from flocking.study.evidence import Evidence
from tests.engine.exact.groups import flight, simulate, spring, zhou

BREATHING = fk.Law(
    fk.Proximity(3 - 1e-6),
    [fk.Gradient(fk.Potential("k*(r-d)**2/2", k=1, d=2), over=fk.Fixed(2, ((0, 1),))), fk.Consensus(0.0)],
)
PAIR = ([[-1.0, 0.0], [1.0, 0.0]], [[-np.sqrt(0.5), 0.0], [np.sqrt(0.5), 0.0]])


def breathing(place: float = 0.0, time: float = 0.0, law: fk.Law = BREATHING) -> fk.Run:
    """Two agents on a spring whose largest distance exceeds the radius by a millionth."""
    start = flight(np.array(PAIR[0]) + place, PAIR[1], time)
    return simulate(law, start, time + 30.0, frames=[time, time + 15.0, time + 30.0])


@pytest.mark.parametrize("size", [1e8, 1e10, 1e12, 1e14])
def test_translations_change_nothing(size: float) -> None:
    here, there = breathing(), breathing(place=size)
    assert (here.switches["kind"] == "break").sum() == 7
    assert (there.switches == here.switches).all()
    assert (there.trace == here.trace).all()
    # Frames are in the user's coordinates, as exact as these are.
    np.testing.assert_allclose(there.q - size, here.q, atol=np.spacing(size))
    verdicts = [{r.claim.key: r.verdict for r in fk.audit(run).results} for run in (here, there)]
    assert verdicts[0] == verdicts[1]
    assert str(verdicts[0]["links-kept"]) == "fails"


@pytest.mark.parametrize("time", [1e8, 1e12, 1e14, -1e10])
def test_shifts_of_time_change_nothing(time: float) -> None:
    now, later = breathing(), breathing(time=time)
    assert len(later.switches) == len(now.switches)
    np.testing.assert_allclose(later.switches["time"] - time, now.switches["time"], atol=np.spacing(abs(time)))
    assert (later.q == now.q).all()
    assert (later.trace["energy"] == now.trace["energy"]).all()
    verdicts = [{r.claim.key: r.verdict for r in fk.audit(run).results} for run in (now, later)]
    assert verdicts[0] == verdicts[1]
    assert str(verdicts[0]["links-kept"]) == "fails"


@pytest.mark.parametrize("speed", [2.0**10, 2.0**20])
@pytest.mark.parametrize("directed", [False, True])
def test_galilean_shifts_change_nothing_but_the_frame(speed: float, directed: bool) -> None:
    n = 5
    rng = np.random.default_rng(4)
    q, p = (np.round(rng.uniform(-4, 4, (n, 2)) * 2**20) / 2**20 for _ in range(2))
    p = 0.25 * p - 0.5 * q
    law = (
        fk.Law(fk.PerAgentRadii([1.0, 2, 3, 2, 4]), [fk.Consensus(0.5)])
        if directed
        else spring(fk.Proximity(3.0), gain=0.1)
    )
    at_rest, moving = (simulate(law, flight(q, p + v), 8.0, frames=9) for v in (0.0, speed))
    assert len(at_rest.switches) >= 1
    assert [tuple(s)[1:5] for s in moving.switches] == [tuple(s)[1:5] for s in at_rest.switches]
    np.testing.assert_allclose(moving.switches["time"], at_rest.switches["time"], atol=1e-8)
    drift = speed * at_rest.t[:, None, None]
    np.testing.assert_allclose(moving.q - drift, at_rest.q, atol=1e-8 + 2 * np.spacing(drift.max()))
    for run in (at_rest, moving):
        kinetic = 0.5 * (run.p[-1] ** 2).sum()
        assert run.trace["kinetic"][-1] == pytest.approx(kinetic, rel=1e-12)
        assert Evidence(run).ledger_closes
    # The power of the control in a moving frame: work differs by V times the momentum gained.
    gained = speed * (at_rest.p[-1] - at_rest.p[0]).sum()
    assert moving.trace["work"][-1] == pytest.approx(at_rest.trace["work"][-1] + gained, abs=1e-8 * speed)


def test_a_moved_session_goes_on_bit_for_bit_and_may_be_given_another_law() -> None:
    q, p = np.random.default_rng(1).uniform(-2, 2, (2, 6, 2))
    scenario = fk.Scenario(zhou(), flight(q + 1e6, p + 300.0, 1e5), 1e5 + 6.0, frames=7)
    whole, parts = ExactSession(scenario), ExactSession(scenario)
    whole.advance(1e5 + 6)
    parts.advance(1e5 + 2.3)
    parts = ExactSession.resume(parts.snapshot())
    parts.advance(1e5 + 6)
    one, two = whole.run(), parts.run()
    for name in ("t", "q", "p", "links", "switches", "trace"):
        assert (getattr(one, name) == getattr(two, name)).all()
    # A law that knows places takes the group where it is; energy that comes with it is booked as a jump.
    before = whole.state
    whole.replace(law=fk.Law(zhou().graph, [*zhou().terms, fk.Track(fk.Sink(before.q.mean(axis=0)), 1.0, 1.0)]))
    assert whole.state.q.tolist() == before.q.tolist()
    whole.advance(1e5 + 8.0)
    assert Evidence(whole.run()).ledger_closes
    assert np.abs(whole.state.p).max() < np.abs(before.p).max()
    back = whole.state
    whole.replace(law=zhou())
    whole.advance(1e5 + 9.0)
    assert Evidence(whole.run()).ledger_closes
    drift = whole.state.q.mean(axis=0) - back.q.mean(axis=0)
    np.testing.assert_allclose(drift, back.p.mean(axis=0), atol=1e-6)


def test_a_plant_that_knows_places_keeps_the_users_origin() -> None:
    found = []
    for place in (0.0, 1e4):
        plant = fk.Law(BREATHING.graph, [*BREATHING.terms, fk.Track(fk.Sink([place + 1.0, place]), 0.1, 0.0)])
        session = ExactSession(fk.Scenario(BREATHING, flight(np.array(PAIR[0]) + place, PAIR[1]), 2.0), plant=plant)
        session.advance(2.0)
        found.append(session.state.q - place)
    assert np.abs(found[0].mean(axis=0)).max() > 0.1, "a plant that pulls nobody tests nothing"
    np.testing.assert_allclose(found[1], found[0], atol=1e-8)


def test_gains_change_at_their_times_wherever_the_start_is() -> None:
    for begin, change in np.random.default_rng(2).uniform([-3.0, 5.0], [4.0, 6.0], (12, 2)):
        gain = fk.Schedule([change], [1.0, 0.0])
        law = fk.Law(fk.Fixed(1, ()), [fk.Track(fk.Velocity([1.0]), 0.0, gain)])
        run = simulate(law, flight([[0.0]], [[3.0]], begin), 7.0, frames=2)
        # It decays towards the leader's velocity until the gain vanishes, and then stays.
        assert run.p[-1, 0, 0] == pytest.approx(1 + 2 * np.exp(-(change - begin)), abs=1e-8)


TRACKED = fk.Law(BREATHING.graph, [*BREATHING.terms, fk.Track(fk.Velocity([0.0, 0.0]), 0.0, 0.0)])
PULLED = fk.Law(BREATHING.graph, [*BREATHING.terms, fk.Track(fk.Sink([1e14, 0.0]), 1.0, 0.0)])


@pytest.mark.parametrize("size", [1e10, 1e14])
def test_a_law_that_knows_places_refuses_what_numbers_cannot_hold(size: float) -> None:
    with pytest.raises(OutOfPrecision, match="resolved only to") as caught:
        breathing(place=size, law=PULLED)
    assert caught.value.agents
    assert caught.value.time == 0.0


def test_a_law_that_knows_times_refuses_what_numbers_cannot_hold() -> None:
    with pytest.raises(OutOfPrecision, match="Times are resolved only to") as caught:
        breathing(time=1e14, law=TRACKED)
    assert caught.value.time == 1e14


def test_ordinary_places_and_times_are_kept_to_the_bit() -> None:
    session = ExactSession(fk.Scenario(zhou(), flight([[0, 0], [2.0, 1.0]], [[1, 0], [0, 1.0]]), 1.0))
    assert session._origin.rests
    assert session._origin.time == 0.0
