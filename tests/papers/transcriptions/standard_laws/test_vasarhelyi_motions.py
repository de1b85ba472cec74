"""Wrong motions of a flock are told from the right one by the states at its ticks, whichever program made them.

The right motion is that of a transcription of the program agent by agent, which shares no formula with the package.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import flocking as fk
from flocking.papers.vasarhelyi_2018 import rules, system, theorems
from flocking.study.trajectory import run_from_samples
from tests.papers.transcriptions.standard_laws import vasarhelyi as by_hand

N, TICKS, LATE = 14, 24, 5
HALF, DISCS = 125.0, ((-55.0, -50.0, 15.0), (55.0, 30.0, 20.0), (-25.0, 70.0, 12.0))
plus, times, minus = by_hand.plus, by_hand.times, by_hand.minus


@cache
def scenario():
    """Fourteen agents in a corner of the arena, around an obstacle: some close to each other, some at a wall."""
    made = system.quiet(N, seed=3, duration=0.2 * TICKS)
    q = np.random.default_rng(11).uniform([30.0, -10.0], [124.0, 70.0], (N, 2))
    return made.with_(start=fk.State(q, 2.0 * made.start.p))


def known(past):
    """Places and velocities now, and what agents know: own states now, those of others a second ago."""
    q, v = past[-1]
    return q, v, list(zip(q, v, strict=True)), list(zip(*past[max(len(past) - 1 - LATE, 0)], strict=True))


def wanted(past, i, half=HALF, discs=DISCS):
    q, v, now, late = known(past)
    return by_hand.known_wanted(q, v, i, now, late, half, discs)


def flown(past, i, w, most=6.0):
    q, v = past[-1]
    return by_hand.flown(q[i], v[i], by_hand.shortened(w, 8.0), most=most)


def right(past, i, **changes):
    """Place and velocity of agent i at the next tick, from the states at all ticks so far."""
    return flown(past, i, wanted(past, i, **changes))


def no_walls(past, i):
    return right(past, i, half=1e9)


def no_obstacles(past, i):
    return right(past, i, discs=())


def no_delay(past, i):
    return right([past[-1]], i)


def known_late_to_itself(past, i):
    """Acts on its own state of a second ago too."""
    q, v, _, late = known(past)
    return flown(past, i, by_hand.known_wanted(q, v, i, late, late, HALF, DISCS))


def _with(name, value, past, i):
    usual = getattr(by_hand, name)
    setattr(by_hand, name, value)
    try:
        return right(past, i)
    finally:
        setattr(by_hand, name, usual)


def no_braking(past, i):
    """Aligns, and is repelled by walls, whatever the distance to brake."""
    return _with("decay", lambda x, p, a: 0.0, past, i)


def no_alignment(past, i):
    return _with("friction", lambda *_: [0.0, 0.0], past, i)


def uncut_repulsion(past, i):
    """The repulsion of each neighbour is not cut at its largest."""
    q, _, _, late = known(past)
    more = [0.0, 0.0]
    for j in range(N):
        away = minus(q[i], late[j][0])
        r = by_hand.length(away)
        if j != i and r < 25.6668:
            more = plus(more, times(max(0.4 * (25.6668 - r) - 6.19664, 0.0), by_hand.unit(away)))
    return flown(past, i, plus(wanted(past, i), more))


def slower_lag(past, i):
    """A time constant of 1.01 s."""
    (place, speed), goal = (x[i] for x in past[-1]), by_hand.shortened(wanted(past, i), 8.0)
    for _ in range(20):
        place = plus(place, times(0.01, speed))
        speed = plus(speed, by_hand.shortened(times(0.01 / 1.01, minus(goal, speed)), 0.06))
    return place, speed


def unlimited(past, i):
    return flown(past, i, wanted(past, i), most=1e9)


def new_velocity(past, i):
    """Places move with the velocity after each step."""
    q, v = right(past, i)
    return plus(q, times(0.01, minus(v, past[-1][1][i]))), v


def of_rule(rule):
    """The run of a rule, as samples that another program made."""
    made = scenario()
    past = [(made.start.q.tolist(), made.start.p.tolist())]
    for _ in range(TICKS):
        moved = [rule(past, i) for i in range(N)]
        past.append(([q for q, _ in moved], [v for _, v in moved]))
    return run_from_samples(made, np.array(made.frame_times), *(np.array(x) for x in zip(*past, strict=True)))


def verdicts(run):
    return {r.claim.key: str(r.verdict) for r in fk.audit(run, theorems.claims(system.QUIET)).results}


def test_the_right_motion_of_another_program_holds():
    assert verdicts(of_rule(right)) == dict.fromkeys(("rule", "places", "acceleration"), "holds")


@pytest.mark.parametrize(
    ("rule", "failing"),
    [
        (no_walls, {"rule"}), (no_obstacles, {"rule"}), (no_delay, {"rule"}), (known_late_to_itself, {"rule"}),
        (no_braking, {"rule"}), (no_alignment, {"rule"}), (uncut_repulsion, {"rule"}), (slower_lag, {"rule"}),
        (unlimited, {"rule", "acceleration"}), (new_velocity, {"places"}),
    ],
)  # fmt: skip
def test_a_wrong_motion_fails(rule, failing):
    found = {key for key, verdict in verdicts(of_rule(rule)).items() if verdict == "fails"}
    # What changes velocities within a tick changes places by the end of it.
    assert found - {"places"} == failing - {"places"}
    assert failing <= found


def test_the_engine_moves_as_the_transcription():
    run, typed = fk.simulate(scenario(), progress=False), of_rule(right)
    np.testing.assert_allclose(run.q, typed.q, atol=1e-9)
    np.testing.assert_allclose(run.p, typed.p, atol=1e-9)


def other_law():
    law = fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)])
    return fk.Scenario(law, scenario().start, t_end=1.0, frames=6)


@pytest.mark.parametrize(
    ("made", "reason"),
    [
        (lambda: scenario().with_(agents=system.unit(noise=0.1)), "there is noise"),
        (lambda: scenario().with_(information=system.knowledge(noise=0.1)), "there is noise"),
        (lambda: scenario().with_(frames=TICKS // 2 + 1), "not those of every tick"),
        (lambda: scenario().with_(control=fk.Held(0.4), information=system.knowledge(noise=0.0)), "act at their fixes"),
        (other_law, "not told velocities at ticks"),
    ],
)
def test_runs_whose_motion_does_not_follow_from_their_frames_are_told(made, reason):
    made = made()
    t = np.array(made.frame_times)
    still = (np.broadcast_to(x, (len(t), N, 2)) for x in (made.start.q, made.start.p))
    found = fk.audit(run_from_samples(made, t, *still), theorems.claims(system.QUIET)).results
    assert {str(r.verdict) for r in found} == {"not applicable"}
    assert all(reason in r.note for r in found), [r.note for r in found]


def test_the_rule_refuses_a_scenario_with_noise():
    made = system.flock(3, duration=1.0)
    with pytest.raises(fk.InvalidInput, match="must be one whose motion follows from its states"):
        rules.next_state(made, made.start.q[None], made.start.p[None], 0)
