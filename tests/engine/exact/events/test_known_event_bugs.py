"""Four errors of event location that other solvers are known for, with closed forms: none may be met here.

Several events in one step of which the first must win; an event at the very start; events that coincide; an event that
changes the motion so that it is at once due again.
"""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.exact import session
from tests.engine.exact.groups import flight, simulate, spring


@pytest.fixture(params=["blocks of steps", "single steps"], autouse=True)
def how(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Once with blocks of steps in native code, once with steps taken one by one."""
    if request.param == "single steps":
        monkeypatch.setattr(session, "take_block", lambda *_, **__: None)


def times(run: fk.Run, kind: str, i: int, j: int) -> list[float]:
    return [float(s["time"]) for s in run.switches if (s["kind"], s["i"], s["j"]) == (kind, i, j)]


def test_of_several_events_in_one_step_the_first_wins() -> None:
    """Agent 1 would meet agent 2 at t = 1.05; at t = 1 it meets agent 0, which stops it."""
    k, speed = 100.0, 2.0
    start = flight([[0.0, 0.0], [-3.0, 0.0], [-0.7, np.sqrt(1 - 0.2**2)]], [[0.0, 0.0], [speed, 0.0], [0.0, 0.0]])
    run = simulate(spring(fk.Proximity(1.0), gain=0.0, k=-k), start, 3.0)
    ends = np.unique(run.trace["time"])
    assert not ((ends > 0.6) & (ends < 1.0 - 1e-9)).any(), "both must fall into one step"
    # r'' = 2 k r between the two: a push that reverses their relative velocity.
    w = np.sqrt(2 * k)
    assert times(run, "appear", 0, 1) == pytest.approx([1.0], abs=1e-9)
    assert times(run, "break", 0, 1) == pytest.approx([1.0 + 2 * np.arctanh(speed / w) / w], abs=1e-9)
    assert len(run.switches) == 2
    np.testing.assert_allclose(run.p[-1], [[speed, 0.0], [0.0, 0.0], [0.0, 0.0]], atol=1e-8)


@pytest.mark.parametrize("speed", [-0.5, 0.5])
def test_an_event_at_the_very_start_is_neither_lost_nor_made_twice(speed: float) -> None:
    """Two agents at their radius: moving closer the spring acts from the start on, moving apart it never does."""
    k, t_end = 1.0, 0.3
    run = simulate(
        spring(fk.Proximity(1.0), gain=0.0, k=k), flight([[0.0, 0.0], [1.0, 0.0]], [[0, 0], [speed, 0]]), t_end
    )
    w = np.sqrt(2 * k)
    apart = np.cos(w * t_end) + speed / w * np.sin(w * t_end) if speed < 0 else 1.0 + speed * t_end
    assert run.q[-1, 1, 0] - run.q[-1, 0, 0] == pytest.approx(apart, abs=1e-8)
    assert len(run.switches) <= 1
    # It counts once it has passed the radius by more than coordinates are rounded.
    assert (run.switches["time"] < 1e-12).all()
    assert bool(run.links[-1, 0, 1]) == (speed < 0)


def test_events_that_coincide_are_all_made() -> None:
    """At t = 1 one pair comes within the radius and another, far away, leaves it."""
    k, t_end = 0.25, 1.25
    w = np.sqrt(2 * k)
    begin = 0.5
    rate = (1.0 - begin * np.cos(w)) * w / np.sin(w)
    positions = [[0.0, 0.0], [2.0, 0.0], [20.0, 0.0], [20.0 + begin, 0.0]]
    velocities = [[0.5, 0.0], [-0.5, 0.0], [-rate / 2, 0.0], [rate / 2, 0.0]]
    run = simulate(spring(fk.Proximity(1.0), gain=0.0, k=k), flight(positions, velocities), t_end)
    assert times(run, "appear", 0, 1) == pytest.approx([1.0], abs=1e-9)
    # The tolerance is relative to the size of the group, here 20.
    assert times(run, "break", 2, 3) == pytest.approx([1.0], abs=1e-8)
    assert len(run.switches) == 2
    late = t_end - 1.0
    near, far = run.q[-1, 1, 0] - run.q[-1, 0, 0], run.q[-1, 3, 0] - run.q[-1, 2, 0]
    leaving = -w * begin * np.sin(w) + rate * np.cos(w)
    assert near == pytest.approx(np.cos(w * late) - np.sin(w * late) / w, abs=1e-8)
    assert far == pytest.approx(1.0 + leaving * late, abs=1e-8)


@pytest.mark.parametrize("k", [1e4, 1e6])
def test_an_event_that_is_at_once_due_again_is_made_again(k: float) -> None:
    """A link whose force throws the pair out again, after a path of 2 / k."""
    speed, w = 2.0, np.sqrt(2 * k)
    start = flight([[0.0, 0.0], [-3.0, 0.0], [1.5, 0.0]], [[0.0, 0.0], [speed, 0.0], [0.0, 0.0]])
    run = simulate(spring(fk.Proximity(1.0), gain=0.0, k=-k), start, 3.0)
    inside = 2 * np.arctanh(speed / w) / w
    assert times(run, "appear", 0, 1)[0] == pytest.approx(1.0, abs=1e-9)
    assert times(run, "break", 0, 1)[0] == pytest.approx(1.0 + inside, abs=1e-9)
    kinds = [str(kind) for kind in run.switches["kind"]]
    assert kinds == ["appear", "break"] * (len(kinds) // 2)
    assert not run.links[-1].any()
    # Equal masses on a line exchange their velocities.
    np.testing.assert_allclose(run.p[-1, :, 0], [0.0, 0.0, speed], atol=1e-5)
