"""Sessions: snapshots, replacement, interruption, determinism and the runs they leave."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

import flocking as fk
from flocking.engine.exact.blocks.block import take_block
from flocking.engine.exact.session import ExactSession
from flocking.engine.runs.run_errors import accuracy_data
from flocking.errors import InvalidInput, NotFinite, StepTooSmall
from tests.engine.exact.groups import SPRING, flight, simulate, spring, zhou

TABLES = ("t", "q", "p", "links", "switches", "trace")


def same(a: fk.Run, b: fk.Run) -> bool:
    equal = all(getattr(a, name).tobytes() == getattr(b, name).tobytes() for name in TABLES)
    known = [(accuracy_data(x.accuracy), x.accuracy.frames.tobytes()) for x in (a, b) if x.accuracy is not None]
    equal = equal and len(known) == 2 and known[0] == known[1]
    return equal and a.closest_linked == b.closest_linked and a.closest_unlinked == b.closest_unlinked


def particles(seed: int = 3) -> fk.Scenario:
    begin = fk.start.box(8, side=5, speed=2, seed=seed)
    return fk.Scenario(spring(fk.Proximity(2.0)), begin, t_end=4.0, frames=41)


def test_the_same_scenario_gives_the_same_bits() -> None:
    assert same(fk.simulate(particles(), progress=False), fk.simulate(particles(), progress=False))


@pytest.mark.parametrize("plant", [None, spring(fk.Proximity(2.0), gain=0.4)])
@pytest.mark.parametrize("when", [0.0, 0.3777, 1.9, 4.0])
def test_a_snapshot_goes_on_bit_for_bit(when: float, plant: fk.Law | None) -> None:
    whole = fk.start(particles(), plant=plant)
    whole.advance(4.0)
    assert len(whole.run().switches) > 10
    first = fk.start(particles(), plant=plant)
    first.advance(when)
    snapshot = first.snapshot()
    first.advance(4.0)
    second = ExactSession.resume(snapshot)
    second.advance(4.0)
    assert same(first.run(), whole.run())
    assert same(second.run(), whole.run())


def test_snapshots_at_every_switch_and_every_step_go_on_bit_for_bit() -> None:
    whole = fk.start(particles())
    whole.advance(4.0)
    expected = whole.run()
    times = sorted({*expected.switches["time"][::3].tolist(), *expected.trace["time"][::4].tolist()})
    walker = fk.start(particles())
    for t in times:
        walker.advance(t)
        walker = ExactSession.resume(walker.snapshot())
    walker.advance(4.0)
    assert same(walker.run(), expected)


def test_going_on_beyond_the_end_and_in_small_bites_changes_nothing() -> None:
    one, two = fk.start(particles()), fk.start(particles())
    one.advance(6.0)
    for t in np.linspace(0, 6, 50):
        two.advance(float(t))
    assert same(one.run(), two.run())
    with pytest.raises(InvalidInput, match="must not be before"):
        one.advance(5.0)


def test_frames_at_a_switch_hold_the_links_before_it() -> None:
    law = spring(fk.Proximity(1.0), gain=0.0, k=0.0)
    begin = flight([[0, 0], [-3, 0]], [[0, 0], [1, 0]])
    t = float(simulate(law, begin, 2.5).switches["time"][0])
    run = simulate(law, begin, 2.5, frames=[0.0, t, float(np.nextafter(t, 3.0)), 2.5])
    assert run.links[:, 0, 1].tolist() == [False, False, True, True]


@pytest.mark.parametrize("frames", [1, 2, 5])
def test_frames_of_a_run_and_of_one_that_ends_at_once(frames: int) -> None:
    begin = fk.start.box(3, side=2, speed=1, seed=0)
    law = spring(fk.Proximity(2.0))
    run = simulate(law, begin, 1.0, frames=frames)
    assert run.t.tolist() == np.linspace(0, 1, frames).tolist()
    nothing = simulate(law, begin, 0.0, frames=frames)
    assert nothing.finished
    assert set(nothing.t) == {0.0}
    assert (nothing.q[-1] == begin.q).all()


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_one_agent_alone_flies_straight(dimension: int) -> None:
    begin = fk.State(np.ones((1, dimension)), np.full((1, dimension), 2.0))
    run = simulate(spring(fk.Proximity(1.0)), begin, 3.0)
    np.testing.assert_allclose(run.q[-1], 7.0, rtol=1e-14)
    assert run.closest.distance == np.inf
    assert len(run.switches) == 0


def test_replacing_the_law_keeps_links_and_books_the_energy() -> None:
    graph = fk.Hysteresis(radius=2.0, gap=0.5)
    begin = flight([[0, 0], [3.0, 0]], [[0, 0], [-0.5, 0.0]])
    session = fk.start(fk.Scenario(spring(graph, gain=0.0, k=0.0), begin, t_end=4.0))
    session.advance(2.6)
    assert not session.state.links[0, 1]  # type: ignore[index]
    # At 1.7 the pair is within the radius but not yet within radius - gap: a new start would link it.
    session.replace(law=spring(graph, gain=0.5, k=1.0))
    assert not session.state.links[0, 1]  # type: ignore[index]
    session.advance(4.0)
    run = session.run()
    assert run.switches["time"][0] == pytest.approx(3.0, abs=1e-9)
    assert np.abs(run.residual).max() < 1e-7
    moved = fk.State(session.state.q * 1.1, session.state.p)
    session.replace(state=moved)
    session.advance(5.0)
    assert np.abs(session.run().residual).max() < 1e-7
    snapshot = session.snapshot()
    session.advance(6.0)
    again = ExactSession.resume(snapshot)
    again.advance(6.0)
    assert same(again.run(), session.run())


def test_a_bad_replacement_leaves_the_session_as_it_was() -> None:
    one, two = fk.start(particles()), fk.start(particles())
    one.advance(1.0)
    two.advance(1.0)
    with pytest.raises(InvalidInput, match="shape"):
        one.replace(state=fk.State(np.zeros((3, 2))))
    with pytest.raises(InvalidInput, match="same point"):
        one.replace(law=zhou(), state=fk.State(np.zeros((8, 2))))
    one.advance(4.0)
    two.advance(4.0)
    assert same(one.run(), two.run())


def pressed_after(monkeypatch: pytest.MonkeyPatch, calls: int) -> None:
    """Ctrl-C while what computes a block of steps is called for the so-many-th time, or after it has."""
    left = calls

    def block(*given: Any, **how: Any) -> Any:
        nonlocal left
        left -= 1
        if left == 0:
            raise KeyboardInterrupt
        found = take_block(*given, **{**how, "seconds": 0.0})
        if left == -calls:
            raise KeyboardInterrupt
        return found

    monkeypatch.setattr("flocking.engine.exact.session.take_block", block)


def test_ctrl_c_keeps_what_was_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    pressed_after(monkeypatch, 30)
    run = fk.simulate(particles(), progress=False)
    monkeypatch.undo()
    whole = fk.simulate(particles(), progress=False)
    assert run.status.startswith("interrupted at t = ")
    assert not run.finished
    assert 1 < len(run.t) < 41
    assert run.q.tobytes() == whole.q[: len(run.t)].tobytes()
    assert run.switches.tobytes() == whole.switches[: len(run.switches)].tobytes()


def test_an_interrupted_session_goes_on_bit_for_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    pressed_after(monkeypatch, 10)
    session = fk.start(particles())
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            session.advance(4.0)
    session.advance(4.0)
    monkeypatch.undo()
    assert same(session.run(), fk.simulate(particles(), progress=False))


def test_nan_and_blow_up_are_told_and_keep_the_run() -> None:
    # The slope of a negative quartic grows faster than any step can follow: infinite in finite time.
    law = fk.Law(fk.Fixed(2, ((0, 1),)), [fk.Gradient(fk.Potential("-k*r**6", k=1.0))])
    with pytest.raises((NotFinite, StepTooSmall)) as error:
        simulate(law, flight([[0, 0], [1.0, 0]], [[0, 0], [1.0, 0]]), 100.0, frames=2001)
    run = error.value.run
    assert run is not None
    assert not run.finished
    assert len(run.t) >= 3
    assert np.isfinite(run.q).all()
    assert run.t[-1] <= error.value.time


def test_snapshots_can_be_pickled() -> None:
    session = fk.start(particles())
    session.advance(1.0)
    again = ExactSession.resume(pickle.loads(pickle.dumps(session.snapshot())))
    session.advance(2.0)
    again.advance(2.0)
    assert same(again.run(), session.run())


def test_a_plant_is_driven_by_its_own_law_and_booked_by_the_declared_one() -> None:
    scenario = fk.Scenario(
        spring(fk.Fixed(2, ((0, 1),)), gain=0.5), flight([[0, 0], [1, 0]], [[0, 0], [0, 1]]), t_end=2.0
    )
    wrong = spring(fk.Fixed(2, ((0, 1),)), gain=0.25)
    run = fk.simulate(scenario, plant=wrong, progress=False)
    assert run.q.tobytes() != fk.simulate(scenario, progress=False).q.tobytes()
    assert np.abs(run.residual).max() > 1e-2
    # The potential is the same: all that is lost is what the plant dissipates, half of what the declared law would.
    energy = run.trace["energy"]
    np.testing.assert_allclose(run.trace["dissipated"], 2.0 * (energy[0] - energy), rtol=1e-6, atol=1e-8)
    stiffer = fk.Law(wrong.graph, [*wrong.terms, fk.Gradient(fk.Potential("k*r", k=0.1))])
    pulled = fk.simulate(scenario, plant=stiffer, progress=False)
    left = pulled.trace["energy"][-1] - energy[0] + pulled.trace["dissipated"][-1] / 2.0
    apart = np.linalg.norm(pulled.q[[0, -1], 1] - pulled.q[[0, -1], 0], axis=1)
    assert left == pytest.approx(-0.1 * (apart[1] - apart[0]), rel=1e-6)
    two = fk.Law(wrong.graph, [fk.Gradient(SPRING), fk.Consensus(1.0, over=fk.Proximity(1.0))])
    with pytest.raises(InvalidInput, match="as many graphs"):
        fk.start(scenario, plant=two)


def test_a_run_that_was_left_early_says_so_and_its_claims_are_open():
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("(r - 1)**2/2"))])
    apart = fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]], [[-3.0, 0.0], [3.0, 0.0]]), t_end=3.0)
    session = fk.start(apart)
    session.advance(0.05)
    early = session.run()
    assert early.status == "interrupted at t = 0.05"
    assert str(fk.audit(early)["connected"].verdict) == "not yet"
    session.advance(3.0)
    assert session.run().finished
    assert str(fk.audit(session.run())["connected"].verdict) == "fails"
