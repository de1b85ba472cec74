"""Headings of sorted agents against all pairs, against the general rule, and in any number of threads and pieces."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import flocking as fk
from flocking.engine.discrete import session as sessions
from flocking.engine.discrete.heading_updates import HeadingUpdates, why_not
from flocking.model.world.random_numbers import Purpose, normal_pairs, uniform

SPEED, PERIOD, RADIUS = 0.4, 0.5, 1.25


def group(n, width, height, body, *, frames=5, shift=0.0):
    rng = np.random.default_rng(body.seed % 1000)
    angles = rng.uniform(-np.pi, np.pi, n)
    q = rng.uniform(0, 1, (n, 2)) * [width, height] + shift
    start = fk.State(q, SPEED * np.column_stack([np.cos(angles), np.sin(angles)]))
    law = fk.Law(fk.Proximity(RADIUS), [fk.VelocityAverage(1 / PERIOD)])
    return fk.Scenario(
        law, start, t_end=(frames - 1) * PERIOD, frames=frames, agents=body, control=fk.Held(PERIOD),
        space=fk.Periodic([width, height]),
    )  # fmt: skip


def by_all_pairs(made):
    """The rule from its definition, over all pairs, shape (frames, N, 2) each."""
    body, lengths = made.agents, np.array(made.space.lengths)
    q, p = made.start.q.copy(), made.start.p.copy()
    places, velocities = [q], [p]
    for k in range(len(made.frame_times) - 1):
        d = q[None] - q[:, None]
        near = ((d - lengths * np.round(d / lengths)) ** 2).sum(axis=2) < RADIUS**2
        mean = near @ p / near.sum(axis=1)[:, None]
        agents = np.arange(len(q))
        if body.noise_kind == "vectorial":
            x = np.column_stack(normal_pairs(body.seed, Purpose.HEADING, agents, 0, k))
            mean = mean / SPEED + body.noise * x / np.linalg.norm(x, axis=1)[:, None]
            turn = 0.0
        else:
            turn = body.noise * (uniform(body.seed, Purpose.HEADING, agents, 0, k) - 0.5)
        angle = np.arctan2(mean[:, 1], mean[:, 0]) + turn
        new = SPEED * np.column_stack([np.cos(angle), np.sin(angle)])
        q = q + PERIOD * (p if body.update == "backward" else new)
        p = new
        places.append(q)
        velocities.append(p)
    return np.array(places), np.array(velocities)


bodies = st.builds(
    fk.Heading, speed=st.just(SPEED), noise=st.sampled_from([0.0, 0.6, 6.28]),
    noise_kind=st.sampled_from(["angular", "vectorial"]), update=st.sampled_from(["backward", "forward"]),
    seed=st.sampled_from([0, 4, 2**40 + 3]),
)  # fmt: skip


@settings(max_examples=30, deadline=None)
@given(bodies, st.integers(1, 90), st.floats(3.8, 9.0), st.floats(3.8, 40.0), st.sampled_from([0.0, -57.0, 1e4]))
def test_they_are_those_of_all_pairs(body, n, width, height, shift):
    made = group(n, width, height, body, shift=shift)
    assert not why_not(made)
    run = fk.simulate(made, progress=False)
    q, p = by_all_pairs(made)
    rounding = 1e-10 if shift else 1e-12
    assert np.abs(run.q - q).max() < rounding
    assert np.abs(run.p - p).max() < rounding


@pytest.mark.parametrize("update", ["backward", "forward"])
def test_the_general_rule_computes_the_same(update, monkeypatch):
    made = group(300, 9.0, 14.0, fk.Heading(SPEED, 0.5, "vectorial", update, 9))
    fast = fk.simulate(made, progress=False)
    monkeypatch.setattr(sessions, "heading_updates", lambda *given: None)
    general = fk.simulate(made, progress=False)
    assert np.abs(fast.q - general.q).max() < 1e-12
    assert np.abs(fast.p - general.p).max() < 1e-12
    assert (fast.links == general.links).all()
    assert fast.fidelity.law.checks == general.fidelity.law.checks == 2


def test_threads_and_pieces_change_no_bit(tmp_path):
    """A session that goes on from what was packed sorts its agents anew, from another order."""
    made = group(3000, 60.0, 40.0, fk.Heading(SPEED, 0.5, "angular", "backward", 9), frames=61).with_(frames=3)
    whole = fk.simulate(made, threads=1, progress=False)
    several = fk.simulate(made, threads=3, progress=False)
    early = fk.start(made, threads=2)
    early.advance(17.3)
    again = early.moment()()
    again.advance(made.t_end)
    for found in (several, again.run()):
        assert fk.first_difference(found, whole) is None
    with pytest.raises(fk.InvalidInput, match="DiscreteOptions: threads must be at least 1"):
        fk.start(made, threads=0)


def test_few_agents_in_a_wide_torus_need_few_cells():
    """A torus of 10^10 radii squared: cells are no smaller than a share of the agents needs."""
    made = group(5, 1e5, 2e5, fk.Heading(SPEED, 0.5))
    assert not why_not(made)
    assert np.abs(fk.simulate(made, progress=False).q - by_all_pairs(made)[0]).max() < 1e-10


def test_other_groups_are_computed_by_the_general_rule():
    made = group(40, 6.0, 6.0, fk.Heading(SPEED, 0.5))
    given = made.with_(start=fk.State(made.start.q, made.start.p, 0.0, np.zeros((40, 40), dtype=bool)))
    assert isinstance(fk.start(made)._headings, HeadingUpdates)
    assert fk.start(given)._headings is None
    again = made.with_(start=fk.simulate(made, progress=False).state(-1), t_end=4.0)
    assert isinstance(fk.start(again)._headings, HeadingUpdates)
    for changes, word in (
        ({"agents": fk.Heading(SPEED, np.full(40, 0.5))}, "one speed, noise and mass"),
        ({"space": fk.Periodic([6.0, None])}, "a torus in the plane"),
        ({"space": fk.Periodic([3.0, 6.0])}, "three radii"),
        ({"control": fk.Held(0.25)}, "a gain"),
        ({"law": fk.Law(fk.Proximity(RADIUS, closed=True), made.law.terms)}, "a graph that is not closed"),
        ({"t_end": 1e8}, "too far"),
    ):
        other = made.with_(**changes)
        assert word in why_not(other)
        assert fk.start(other)._headings is None


@pytest.mark.parametrize("angle", [0.0, 0.3, -2.0])
def test_equal_headings_stay(angle):
    """Without noise a group of one heading keeps it, whatever the rounding of averages is beside forces of zero."""
    made = group(200, 8.0, 8.0, fk.Heading(SPEED), frames=70)
    p = np.tile(SPEED * np.array([np.cos(angle), np.sin(angle)]), (200, 1))
    run = fk.simulate(made.with_(start=fk.State(made.start.q, p)), progress=False)
    assert np.abs(run.p - p).max() < 1e-14
    assert run.fidelity.law.checks == 4


def test_opposite_headings_keep_theirs():
    """An average of zero turns nobody."""
    q, p = [[1.0, 1.0], [1.5, 1.0]], [[SPEED, 0.0], [-SPEED, 0.0]]
    made = group(2, 6.0, 6.0, fk.Heading(SPEED), frames=2)
    run = fk.simulate(made.with_(start=fk.State(q, p)), progress=False)
    assert (run.p[1] == p).all()
