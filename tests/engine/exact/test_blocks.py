"""Blocks of steps in native code give the run that steps taken one by one in Python give, bit for bit."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import flocking as fk
from flocking.engine.adaptive_steps.integration_method import RELATIVE, error_norm
from flocking.engine.exact import barriers, session
from flocking.engine.exact.blocks import block, tried_steps
from flocking.engine.exact.blocks.arrays import LENGTH, TIME, TRIED
from flocking.engine.runs.run_errors import accuracy_data
from flocking.errors import LinkLost, OutOfPrecision
from tests.engine.exact.groups import flight, spring, zhou

TABLES = ("t", "q", "p", "links", "switches", "trace")


def kinked() -> fk.Law:
    psi = fk.Potential("where(r < 1.5, (r - 1)**2, r - 1.25)")
    return fk.Law(fk.Proximity(2.0), [fk.Gradient(psi), fk.Consensus(0.3)])


def obstacles() -> fk.Law:
    balls = tuple(fk.Ball([x, y], 0.4) for x in (4.0, 6.5) for y in (-1.0, 1.0, 3.0, 5.0, 7.0))
    terms = [fk.Gradient(fk.Potential("k/r", k=0.3)), fk.Avoid(balls, range=1.5, gamma_agents=False)]
    return fk.Law(fk.Proximity(2.5), terms)


def two_kinds_of_obstacles() -> fk.Law:
    """Groups of unequally many balls, with ranges and kinks of their own, and a kink between agents before them."""
    psi = fk.Potential("where(r < 1.5, (r - 1)**2, r - 1.25)")
    few, many = (tuple(fk.Ball([x, y, 2.5], 0.4) for y in ys) for x, ys in ((2.0, (1.0, 4.0)), (4.0, (0.0, 2.0, 5.0))))
    terms = [fk.Avoid(few, range=1.5, gamma_agents=False), fk.Avoid(many, range=0.8, onset=0.3, gamma_agents=False)]
    return fk.Law(fk.Proximity(2.5), [fk.Gradient(psi), *terms])


def repelled_by_a_ball() -> fk.Law:
    ball = fk.Avoid((fk.Ball([2.0, 2.5], 0.3),), range=1.0, gamma_agents=False)
    return fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("2*(2 - r)**2")), ball])


def led() -> fk.Law:
    leader = fk.Path(["sin(t)", "t/2"])
    return fk.Law(fk.Hysteresis(3.0, 0.2), [fk.Gradient(fk.Potential("k*r**2/2", k=0.2)), fk.Track(leader, 0.5, 0.5)])


def start(n: int, seed: int, m: int = 2, speed: float = 2.0) -> fk.State:
    return fk.start.box(n, side=5, speed=speed, seed=seed, dimension=m)


def cases() -> dict[str, fk.Scenario]:
    agents = fk.Agents(masses=np.linspace(1.0, 2.0, 6), damping=0.1)
    zhou_start = fk.start.box(8, side=5, speed=2, seed=2, connected_under=zhou().graph)
    return {
        "springs that break": fk.Scenario(spring(fk.Proximity(2.0)), start(8, 3), t_end=4.0, frames=41),
        "frames by the hundred": fk.Scenario(spring(fk.Proximity(2.0)), start(8, 3), t_end=4.0, frames=401),
        "links kept": fk.Scenario(zhou(), zhou_start, t_end=6.0, frames=21),
        "kinks": fk.Scenario(kinked(), start(6, 4), t_end=4.0, frames=11),
        "a smooth graph": fk.Scenario(spring(fk.Smooth(3.0, 0.5)), start(6, 5), t_end=4.0, frames=11),
        "masses and damping": fk.Scenario(
            spring(fk.Proximity(2.0)), start(6, 6), t_end=4.0, frames=11, agents=agents
        ),
        "space": fk.Scenario(spring(fk.Proximity(3.0)), start(6, 7, 3), t_end=3.0, frames=11),
        "one agent": fk.Scenario(spring(fk.Proximity(2.0)), start(1, 7), t_end=3.0, frames=5),
        "agents without inertia": fk.Scenario(
            fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("k*r**2/2", k=1.0))]),
            start(6, 8, speed=0.0), t_end=2.0, frames=11, agents=fk.Agents(order=1),
        ),
        "balls": fk.Scenario(obstacles(), start(6, 9), t_end=5.0, frames=11),
        "balls of two kinds": fk.Scenario(two_kinds_of_obstacles(), start(8, 12, 3), t_end=5.0, frames=11),
        "balls without inertia": fk.Scenario(
            repelled_by_a_ball(), start(8, 8, speed=0.0), t_end=2.0, frames=11, agents=fk.Agents(order=1)
        ),
        "a leader": fk.Scenario(led(), start(6, 10), t_end=5.0, frames=11),
        "a near miss": fk.Scenario(
            spring(fk.Proximity(2.0)),
            flight([[-3.0, 0.0], [0.0, 2.0], [1.0, 4.5]], [[1.0, 0.0], [0.0, 0.0], [0.0, 0.0]]), t_end=6.0, frames=11,
        ),
        "late": fk.Scenario(spring(fk.Proximity(2.0)), dataclasses.replace(start(8, 3), t=1e6), t_end=1e6 + 2.0),
    }  # fmt: skip


def run(scenario: fk.Scenario, plant: fk.Law | None = None) -> fk.Run:
    return fk.simulate(scenario, plant=plant, progress=False)


def one_by_one(monkeypatch: pytest.MonkeyPatch, scenario: fk.Scenario, plant: fk.Law | None = None) -> fk.Run:
    with monkeypatch.context() as patch:
        patch.setattr(session, "take_block", lambda *_, **__: None)
        return run(scenario, plant)


def counted(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Number of steps of each block."""
    found: list[int] = []

    def take(*given: Any, **how: Any) -> Any:
        taken = block.take_block(*given, **how)
        found.append(0 if taken is None else taken.taken)
        return taken

    monkeypatch.setattr(session, "take_block", take)
    return found


def assert_same(a: fk.Run, b: fk.Run) -> None:
    for name in TABLES:
        assert getattr(a, name).tobytes() == getattr(b, name).tobytes(), name
    assert a.accuracy is not None
    assert b.accuracy is not None
    assert a.accuracy.frames.tobytes() == b.accuracy.frames.tobytes()
    assert accuracy_data(a.accuracy) == accuracy_data(b.accuracy)
    assert (a.closest_linked, a.closest_unlinked) == (b.closest_linked, b.closest_unlinked)
    assert a.provenance["steps"] == b.provenance["steps"]


@pytest.mark.parametrize("name", ["a near miss", "links kept", "springs that break"])
@pytest.mark.parametrize("often", ["by the clock", "at every frame", "within steps"])
def test_errors_of_frames_do_not_depend_on_stops(name: str, often: str) -> None:
    """A near miss counts for all frames of its step, also for those that are recorded before the step is left."""
    scenario = cases()[name]
    expected, stopped = run(scenario), fk.start(scenario)
    stops = scenario.frame_times if often == "at every frame" else np.linspace(*expected.t[[0, -1]], 97)
    for t in [scenario.t_end] if often == "by the clock" else stops:
        while not stopped.reached(t):
            stopped.advance(t, 0.0 if often == "by the clock" else np.inf)
    assert_same(stopped.run("finished"), expected)


@pytest.mark.parametrize("name", list(cases()))
def test_blocks_give_the_bits_of_single_steps(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = cases()[name]
    expected = one_by_one(monkeypatch, scenario)
    sizes = counted(monkeypatch)
    assert_same(run(scenario), expected)
    if name == "a near miss":
        assert expected.accuracy is not None
        assert len(expected.accuracy.doubts) > 0
    # All but the first step, whose length is still to be found, and those that need a closer look.
    assert sum(sizes) >= 0.9 * expected.provenance["steps"] - 1
    assert max(sizes) > 1


@pytest.mark.parametrize("name", ["kinks", "links kept", "springs that break", "balls", "agents without inertia"])
def test_blocks_of_a_plant_have_the_ledger_of_the_declared_law(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = cases()[name]
    # Among balls a step is made anew since its ledger does not close, which is not asked of a plant.
    if name != "balls":
        assert_same(run(scenario, scenario.law), run(scenario))
    if name == "kinks":
        other = spring(scenario.law.graph)
    else:
        other = fk.Law(scenario.law.graph, [*scenario.law.terms, fk.Gradient(fk.Potential("k*r**2/2", k=0.05))])
    expected = one_by_one(monkeypatch, scenario, other)
    sizes = counted(monkeypatch)
    assert_same(found := run(scenario, other), expected)
    assert sum(sizes) >= 0.9 * expected.provenance["steps"] - 1
    # At each row the energy is that of the declared law, whatever moved the agents there.
    assert found.trace["energy"][0] == run(scenario).trace["energy"][0] != run(scenario, other).trace["energy"][-1]
    assert np.abs(found.residual).max() > 100 * np.abs(run(scenario).residual).max()


@pytest.mark.parametrize("name", [name for name in cases() if "balls" in name])
def test_contacts_are_applied_by_the_loop(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = cases()[name]
    by_session, write = [], session.write_switch

    def counting(*given: Any) -> tuple[int, ...]:
        by_session.append(given[1])
        return write(*given)

    monkeypatch.setattr(session, "write_switch", counting)
    kinds = run(scenario).switches["kind"].tolist()
    assert kinds.count("obstacle") > 2
    assert len(by_session) <= 0.1 * len(kinds)


@pytest.mark.parametrize("bound", ["MOST_STEPS", "MOST_FRAMES", "MOST_CROSSINGS"])
def test_buffers_that_are_full_lose_nothing(bound: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = cases()["springs that break"]
    corners = [[x, y] for x in (-1.0, 1.0) for y in (-1.0, 1.0)]
    ring = fk.State(np.array(corners) * 0.3 + [0.1, 0.7], np.array(corners))
    at_once = fk.Scenario(spring(fk.Proximity(2.0), gain=0.0, k=0.1), ring, t_end=4.0, frames=41)
    expected = one_by_one(monkeypatch, scenario), one_by_one(monkeypatch, at_once)
    assert len(np.unique(expected[1].switches["time"])) < len(expected[1].switches)
    monkeypatch.setattr(block, bound, 1)
    assert_same(run(scenario), expected[0])
    assert_same(run(at_once), expected[1])


def test_a_link_that_is_lost_is_told_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    """A barrier that a coarse tolerance steps over: the same error at the same time."""
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("-log(1 - r/R)*1e-9", R=2.0))])
    scenario = fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [1.0, 0.0]]), t_end=4.0, tolerance=1e-3)
    told = []
    for take in (block.take_block, lambda *_, **__: None):
        monkeypatch.setattr(session, "take_block", take)
        with pytest.raises(fk.SimulationError) as error:
            run(scenario)
        told.append((type(error.value), str(error.value), error.value.run.q.tobytes()))
    assert told[0] == told[1]
    assert told[0][0] is LinkLost


def test_positions_that_lose_their_digits_end_a_run_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    """Agents that follow a leader to where numbers are too far apart for the tolerance."""
    far = fk.Law(fk.Proximity(2.0), [fk.Track(fk.Path(["1e9*t", "0*t"]), 1.0, 1.0), fk.Consensus(1.0)])
    begin = flight([[0.0, 0.0], [1.0, 0.0]], [[1e9, 0.0], [1e9, 0.0]])
    scenario = fk.Scenario(far, begin, t_end=2.0, tolerance=1e-9)
    told = []
    for take in (block.take_block, lambda *_, **__: None):
        monkeypatch.setattr(session, "take_block", take)
        with pytest.raises(OutOfPrecision) as error:
            run(scenario)
        assert error.value.run is not None
        told.append((str(error.value), error.value.run.q.tobytes()))
    assert told[0] == told[1]


def test_a_step_of_too_large_an_error_is_not_taken_however_short(monkeypatch: pytest.MonkeyPatch) -> None:
    """No length is left to try: the loop must leave the step to the session, which says why."""
    given: list[Any] = []

    class GivenError(Exception):
        pass

    def keep(*arguments: Any) -> None:
        given.extend(arguments)
        raise GivenError

    monkeypatch.setattr(block, "step_block", keep)
    with pytest.raises(GivenError):
        fk.start(cases()["springs that break"]).advance(1.0)
    law, method, watches, _, limits, _, solution, *_ = given
    solution.progress[TIME], solution.progress[LENGTH] = 1e12, 0.0
    work = tried_steps.new_work(law, watches.pairs, solution)
    work.new[:] = 0.0

    def tried(scale: float) -> tuple[float, bool]:
        """Error of the shortest step where errors of this size count as one, and whether the step is fine."""
        largest = np.maximum(np.abs(solution.y), np.abs(work.new))
        components = np.full_like(solution.y, scale) - largest * RELATIVE
        _, fine = tried_steps.try_step(
            law, method, limits._replace(components=components, bound=np.inf), solution, work
        )
        h, (third, fifth) = solution.progress[TRIED], method.tableau[2:4]
        return float(error_norm(solution.K, h, solution.y, work.new, components, third, fifth)), fine

    tried(1.0)
    first, fine = tried(1.0)
    assert fine
    assert 0.0 < first < 1e-12
    for wanted in (0.5, 0.9, 1.1, 30.0, 900.0):
        error, fine = tried(first / wanted)
        assert error == pytest.approx(wanted, rel=0.1)
        assert fine == (error < 1.0)


def test_a_pair_of_agent_and_obstacle_is_no_pair_of_agents(monkeypatch: pytest.MonkeyPatch) -> None:
    """More obstacles than agents: their numbers are those of no agents where close encounters are looked for."""
    scenario = cases()["balls"]
    seen: list[int] = []
    before = barriers.deepest_dip

    def looked(B: Any, far: Any, senders: Any, sensed: Any) -> float:
        seen.extend(sensed.tolist())
        assert len(senders) == len(sensed)
        return float(before(B, far, senders, sensed))

    monkeypatch.setattr(barriers, "deepest_dip", looked)
    found = one_by_one(monkeypatch, scenario)
    assert found.switches["kind"].tolist().count("obstacle") > 2
    assert seen
    assert max(seen) < scenario.start.n
