"""Many scenarios at once: the runs of `simulate`, bit for bit, in any order and in any number of threads."""

from __future__ import annotations

import signal
import threading
from functools import cache

import numpy as np
import pytest

import flocking as fk
from flocking.engine import interruption
from flocking.engine.driver import ensembles
from flocking.engine.driver.ensembles import simulate_many
from flocking.engine.driver.run_progress import Progress
from flocking.engine.protocol.session import Session
from flocking.engine.runs import recorder
from flocking.errors import InvalidInput, NotFinite, RunsFailed, UnsupportedLaw
from tests.engine.driver.test_chosen_engine import LAW
from tests.interrupting import interrupted_at

LONGEST = 600.0
"""Seconds after which a thread counts as one that never ends, on a busy machine."""

PSI = fk.Potential("1/r + 1/(R - r)", R=4)


def zhou(seed: int) -> fk.Scenario:
    law = fk.Law(fk.Hysteresis(4, 0.1), [fk.Gradient(PSI), fk.Consensus(1.0)])
    begin = fk.start.box(6, side=5, speed=2, seed=seed, connected_under=law.graph)
    return fk.Scenario(law, begin, t_end=4.0, frames=20)


def held(seed: int, **world: object) -> fk.Scenario:
    return fk.Scenario(LAW, fk.start.box(4, side=3, speed=1, seed=seed), t_end=1.0, frames=5, **world)


WORLDS = {
    "sampled": {"control": fk.Held(0.1), "information": fk.Messages(0.1, loss=fk.Bernoulli(0.3))},
    "delayed": {"information": fk.Delayed(0.1)},
    "discrete": {"control": fk.Held(0.1), "agents": fk.Impulsive()},
}


@cache
def simulated() -> list[fk.Run]:
    """The runs of six scenarios, one after another."""
    return [fk.simulate(zhou(seed), progress=False) for seed in range(6)]


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_the_runs_are_those_of_simulate(threads):
    scenarios = [zhou(seed) for seed in range(6)]
    single = simulated()
    assert len({len(run.switches) for run in single}) > 1
    order = np.random.default_rng(threads).permutation(6)
    runs = simulate_many([scenarios[k] for k in order], threads=threads, progress=False)
    for run, k in zip(runs, order, strict=True):
        assert run.status == "finished"
        assert fk.first_difference(run, single[k]) is None


@pytest.mark.parametrize("name", WORLDS)
def test_runs_of_every_engine_with_threads_are_those_of_simulate(name):
    scenarios = [held(seed, **WORLDS[name]) for seed in range(4)]
    runs = simulate_many(scenarios, threads=3, progress=False)
    for run, scenario in zip(runs, scenarios, strict=True):
        assert run.provenance["engine"] == name
        assert fk.first_difference(run, fk.simulate(scenario, progress=False)) is None


def test_an_engine_with_threads_of_its_own_runs_one_scenario_after_another(monkeypatch):
    counts = []
    run = ensembles._Ensemble.run
    monkeypatch.setattr(ensembles._Ensemble, "run", lambda self, n, bar: counts.append(n) or run(self, n, bar))
    scenarios = [held(seed) for seed in range(2)]
    runs = simulate_many(scenarios, engine="tiles", step=0.01, threads=2, progress=False)
    assert counts == [1]
    for each, scenario in zip(runs, scenarios, strict=True):
        assert fk.first_difference(each, fk.simulate(scenario, engine="tiles", step=0.01, progress=False)) is None


def test_failed_runs_are_counted_and_the_others_complete():
    falls = fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("-k*r**-2", k=5.0))])
    at = fk.State([[0.0, 0.0], [1.0, 0.0]])
    scenarios = [zhou(0), fk.Scenario(falls, at, t_end=10.0), zhou(1)]
    with pytest.raises(
        RunsFailed, match=r"1 of 3 runs could not go on; the first is scenarios\[1\]: .*agents \[0, 1\]"
    ) as found:
        simulate_many(scenarios, threads=2, progress=False)
    runs, failures = found.value.runs, found.value.failures
    with pytest.raises(fk.SimulationError) as alone:
        fk.simulate(scenarios[1], progress=False)
    assert list(failures) == [1]
    assert str(failures[1]) == str(alone.value)
    assert fk.first_difference(runs[1], alone.value.run) is None
    assert [runs[k].status for k in (0, 2)] == ["finished"] * 2
    assert fk.first_difference(runs[2], fk.simulate(scenarios[2], progress=False)) is None


def test_after_an_interrupt_every_run_holds_what_was_computed(monkeypatch):
    """Ctrl-C comes at a look of the main thread at the others, once the first two runs have taken steps."""
    looks, stepped, both = [], set(), threading.Event()
    advance = ensembles.advance_slice

    def noted(session: Session, to: float) -> None:
        advance(session, to)
        stepped.add(id(session))
        if len(stepped) == 2:
            both.set()

    def interrupted(self: Progress, done: int, failed: int) -> None:
        looks.append(done)
        if len(looks) == 1:
            assert both.wait(LONGEST)
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(Progress, "advance", interrupted)
    monkeypatch.setattr(ensembles, "advance_slice", noted)
    monkeypatch.setattr("flocking.engine.driver.simulate.GLANCE_SECONDS", 0.02)
    scenarios = [zhou(k).with_(t_end=4000.0, frames=2) for k in range(4)]
    runs = simulate_many(scenarios, threads=2, progress=False)
    assert len(runs) == 4
    assert all(run.status.startswith("interrupted at t = ") for run in runs)
    assert all(np.array_equal(run.q[0], each.start.q) for run, each in zip(runs, scenarios, strict=True))
    assert runs[0].trace["time"][-1] > 0.0
    assert runs[3].trace["time"][-1] == 0.0


def test_threads_leave_an_interrupt_to_the_main_thread(monkeypatch):
    """Their sessions look for one between steps, and have taken some before the main thread looks."""
    pressed, looked = threading.Event(), threading.Event()
    advance = ensembles.advance_slice

    def between(session: Session, to: float) -> None:
        if session.steps and not looked.is_set():
            assert pressed.wait(LONGEST)
            advance(session, session.time + 0.01)
            looked.set()
        advance(session, min(to, session.time + 0.01))

    def press(self: Progress, done: int, failed: int) -> None:
        if not pressed.is_set():
            signal.raise_signal(signal.SIGINT)
            pressed.set()
            assert looked.wait(LONGEST)

    monkeypatch.setattr(Progress, "advance", press)
    monkeypatch.setattr(ensembles, "advance_slice", between)
    (run,) = simulate_many([zhou(0).with_(t_end=1e9, frames=2)], threads=1, progress=False)
    assert run.status.startswith("interrupted at t = ")


def test_a_second_interrupt_ends_at_once(monkeypatch):
    """It does not wait for runs whose slice of work never ends; they end with that slice."""
    let_go, taken = threading.Event(), []
    looks = []

    def interrupted(self: Progress, done: int, failed: int) -> None:
        looks.append(done)
        signal.raise_signal(signal.SIGINT)

    def never_ending(session: Session, to: float) -> None:
        taken.append(threading.current_thread())
        let_go.wait()

    monkeypatch.setattr(Progress, "advance", interrupted)
    monkeypatch.setattr(ensembles, "advance_slice", never_ending)
    with pytest.raises(KeyboardInterrupt):
        simulate_many([zhou(0)], threads=1, progress=False)
    assert len(looks) == 2
    let_go.set()
    for thread in working() + taken:
        thread.join(LONGEST)
        assert not thread.is_alive()
    assert len(taken) <= 1


def working() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name.startswith("simulate_many")]


def test_an_interrupt_at_any_instruction_ends_all_threads(monkeypatch):
    """Runs that never end by themselves: an interrupt that is lost, or leaves a thread at work, is seen."""
    code = ensembles._Ensemble.run.__code__
    monkeypatch.setattr("flocking.engine.driver.simulate.GLANCE_SECONDS", 0.002)
    monkeypatch.setattr(ensembles, "WAIT_SECONDS", 0.002)
    endless = [zhou(seed).with_(t_end=1e9, frames=2) for seed in range(2)]
    shared = (threading.__file__, interruption.__file__)
    for instruction in range(1, 1000, 13):
        raised, runs, strike = False, (), None
        try:
            with interrupted_at(instruction, lambda x: x is code or x.co_filename in shared) as strike:
                runs = simulate_many(endless, threads=2, progress=False)
        except KeyboardInterrupt:
            raised = True
        assert strike is not None
        assert strike.came, instruction
        for thread in working():
            thread.join(LONGEST)
        assert working() == [], f"threads go on after an interrupt at instruction {instruction}"
        # It comes through only before the threads begin, or after they have ended.
        assert raised or [run.status.partition(" at ")[0] for run in runs] == ["interrupted"] * 2, instruction


def test_a_scenario_that_cannot_be_started_is_named():
    with pytest.raises(UnsupportedLaw, match=r"^scenarios\[0\] of simulate_many: "):
        simulate_many([zhou(0)], engine="sampled", progress=False)
    steep = fk.Law(fk.Proximity(50.0), [fk.Gradient(fk.Potential("exp(r**2)"))])
    far = fk.Scenario(steep, fk.State([[0.0, 0.0], [40.0, 0.0]]), t_end=1.0)
    with pytest.raises(InvalidInput, match=r"^scenarios\[1\] of simulate_many: .* must have a finite energy"):
        simulate_many([zhou(0), far], threads=1, progress=False)


def test_frames_that_do_not_fit_name_their_scenario(monkeypatch):
    monkeypatch.setattr(recorder, "MOST_FRAME_BYTES", 10_000)
    with pytest.raises(InvalidInput, match=r"^scenarios\[1\] of simulate_many: .* memory"):
        simulate_many([zhou(0).with_(frames=2), zhou(1).with_(frames=500)], engine="tiles", step=0.05, progress=False)


def test_an_engine_that_is_none_concerns_no_scenario():
    with pytest.raises(InvalidInput, match=r"^simulate_many: engine must be one of"):
        simulate_many([zhou(0)], engine="exac", progress=False)


def test_a_run_that_fails_at_its_start_has_no_records(monkeypatch):
    opened = ensembles.open_session

    def second_fails(engine, scenario, options):
        if scenario.seed == 1:
            raise NotFinite("The control at the start is infinite or NaN.", time=0.0)
        return opened(engine, scenario, options)

    monkeypatch.setattr(ensembles, "open_session", second_fails)
    with pytest.raises(
        RunsFailed, match=r"1 of 2 runs could not go on; the first is scenarios\[1\]: The control"
    ) as found:
        simulate_many([zhou(0), zhou(1).with_(seed=1)], threads=2, progress=False)
    assert found.value.runs[1] is None
    assert found.value.runs[0].status == "finished"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (lambda: (zhou(0),), "Use simulate for a single one"),
        (lambda: ([zhou(0), "zhou"],), r"scenarios\[1\] must be a Scenario; got 'zhou'"),
        (lambda: (3,), "must be several scenarios"),
    ],
)
def test_what_is_no_list_of_scenarios_is_refused(arguments, words):
    with pytest.raises(InvalidInput, match=words):
        simulate_many(*arguments())


@pytest.mark.parametrize("threads", [0, -1, True, 1.5, "2"])
def test_wrong_numbers_of_threads_are_refused(threads):
    with pytest.raises(InvalidInput, match=r"threads must be (an integer|at least 1)"):
        simulate_many([zhou(0)], threads=threads)


def test_no_scenario_gives_no_run():
    assert simulate_many([], progress=False) == ()


def test_numbers_of_threads_may_be_those_of_numpy():
    assert fk.simulate_many([], threads=np.int64(2), progress=False) == ()
