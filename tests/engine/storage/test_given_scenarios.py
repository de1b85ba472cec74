"""A scenario is given for a run that stores none: another than the run's own is never taken for it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import flocking as fk
from flocking.engine.storage.record import SCENARIO
from flocking.engine.storage.run_writer import RunWriter
from flocking.engine.storage.stored_runs import read_run, stored_facts, write_run
from flocking.errors import InvalidInput, StorageError
from tests.engine.storage.stored_runs import assert_same, finished, scenario, stopped_run

OTHER = fk.Law(fk.Hysteresis(radius=4, gap=0.1), [fk.Gradient(fk.Potential("(r - 9)^2"))])


class _Pull(fk.PairTerm):
    """A term from outside the library."""

    parameters = property(lambda self: {})
    structure = ("pull",)

    def drag(self, x: Any) -> Any:
        return 1 + 0 * x.r


PLANT = fk.Law(scenario().law.graph, [scenario().law.terms[0], fk.Consensus(0.5)])


@pytest.fixture
def stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """Save a run, stopped at its eighth frame."""

    return lambda **options: stopped_run(tmp_path / "run", scenario(), monkeypatch, **options)


def test_a_run_is_not_read_under_another_law(tmp_path: Path) -> None:
    write_run(finished(), tmp_path / "run")
    other = scenario().with_(law=OTHER)
    for call in (read_run, fk.resume):
        with pytest.raises(InvalidInput, match=r"scenario must be absent, for .* stores its own, which is another"):
            call(tmp_path / "run", scenario=other)
        with pytest.raises(InvalidInput, match="scenario must be a Scenario"):
            call(tmp_path / "run", scenario="ten agents")  # type: ignore[arg-type]
    assert_same(read_run(tmp_path / "run", scenario=scenario()), finished())


def test_a_stopped_run_does_not_go_on_under_another_law(stopped: Callable[..., Path]) -> None:
    folder = stopped()
    with pytest.raises(InvalidInput, match="stores its own"):
        fk.resume(folder, scenario=scenario().with_(law=OTHER), progress=False)
    with pytest.raises(InvalidInput, match="plant must be absent"):
        fk.resume(folder, scenario=scenario(), plant=PLANT, progress=False)
    with pytest.raises(
        InvalidInput, match="plant must be a Law, beside the scenario of a run that could not be stored"
    ):
        fk.resume(folder, plant=PLANT, progress=False)
    assert_same(fk.resume(folder, scenario=scenario(), progress=False), finished())


def test_the_plant_of_a_stored_run_stays_where_its_scenario_is_given_again(stopped: Callable[..., Path]) -> None:
    folder = stopped(plant=PLANT)
    whole = fk.simulate(scenario(), plant=PLANT, progress=False)
    assert_same(fk.resume(folder, scenario=scenario(), progress=False), whole)


def test_the_same_scenario_takes_the_place_of_a_damaged_one(tmp_path: Path) -> None:
    write_run(finished(), tmp_path / "run")
    (tmp_path / "run" / SCENARIO).write_bytes(b"{}")
    assert_same(read_run(tmp_path / "run", scenario=scenario()), finished())
    with pytest.raises(StorageError, match="does not match its checksum"):
        read_run(tmp_path / "run", scenario=scenario().with_(law=OTHER))


def test_a_scenario_that_is_not_stored_begins_where_the_run_does(tmp_path: Path) -> None:
    foreign = scenario().with_(law=fk.Law(fk.Proximity(2.0), [_Pull()]))
    write_run(dataclasses.replace(finished(), scenario=foreign), tmp_path / "run")
    moved = dataclasses.replace(foreign.start, q=foreign.start.q + 0.01)
    with pytest.raises(StorageError, match="begin elsewhere than those of the run"):
        read_run(tmp_path / "run", scenario=foreign.with_(start=moved))
    assert read_run(tmp_path / "run", scenario=foreign).scenario is foreign


class _Push(_Pull):
    """The same with a number."""

    def __init__(self, gain: float = 1.0) -> None:
        self.gain = gain

    parameters = property(lambda self: {"gain": self.gain})

    def drag(self, x: Any) -> Any:
        return x.parameter("gain") + 0 * x.r


def pushed(gain: float = 1.0, radius: float = 2.0, *more: fk.Term) -> fk.Scenario:
    return scenario().with_(law=fk.Law(fk.Proximity(radius), [_Push(gain), *more]))


@pytest.mark.parametrize(
    "other", [pushed(1.5), pushed(1.0, 2.5), pushed(1.0, 2.0, fk.Consensus(0.0)), scenario().with_(law=OTHER)]
)
def test_a_scenario_that_is_not_stored_has_the_law_of_the_run(other: fk.Scenario, tmp_path: Path) -> None:
    """A gain that was changed since in the program would go on as if it had been there from the start."""
    write_run(dataclasses.replace(finished(), scenario=pushed()), tmp_path / "run")
    with pytest.raises(StorageError, match="the law of the given scenario is not that of the run"):
        read_run(tmp_path / "run", scenario=other)
    assert read_run(tmp_path / "run", scenario=pushed()).finished


def test_a_run_of_a_plant_does_not_go_on_without_it(
    stopped: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor with one where it had none: the scenario is not stored, so that neither is."""
    given = pushed()
    plant = fk.Law(given.law.graph, [_Push(0.5)])
    monkeypatch.setattr("tests.engine.storage.test_given_scenarios.scenario", lambda: given)
    folder = stopped(plant=plant)
    with pytest.raises(InvalidInput, match=r"plant must be given, for the agents of .* follow another law"):
        fk.resume(folder, scenario=given, progress=False)
    whole = fk.simulate(given, plant=plant, progress=False)
    assert_same(fk.resume(folder, scenario=given, plant=plant, progress=False), whole)


def test_a_run_without_a_plant_does_not_go_on_with_one(
    stopped: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    given = pushed()
    monkeypatch.setattr("tests.engine.storage.test_given_scenarios.scenario", lambda: given)
    folder = stopped()
    with pytest.raises(InvalidInput, match=r"plant must be absent, for the agents of .* follow its law"):
        fk.resume(folder, scenario=given, plant=fk.Law(given.law.graph, [_Push(0.5)]), progress=False)
    assert_same(fk.resume(folder, scenario=given, progress=False), fk.simulate(given, progress=False))


def test_a_copy_that_was_killed_is_not_computed_by_an_engine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def killed(self: RunWriter, *given: object, **others: object) -> None:
        raise MemoryError

    with monkeypatch.context() as patch:
        patch.setattr(RunWriter, "append", killed)
        with pytest.raises(MemoryError):
            write_run(finished(), tmp_path / "run")
    assert not stored_facts(tmp_path / "run")["can_go_on"]
    with pytest.raises(StorageError, match="was being copied here, and nothing of it was stored"):
        fk.resume(tmp_path / "run", progress=False)


def test_a_copy_of_an_unfinished_run_of_no_engine_cannot_go_on(tmp_path: Path) -> None:
    made = dataclasses.replace(
        finished(), status="interrupted at t = 1", provenance={**finished().provenance, "engine": "nodes"}
    )
    write_run(made, tmp_path / "run")
    with pytest.raises(StorageError, match="this run cannot continue; it ended with: interrupted at t = 1"):
        fk.resume(tmp_path / "run", progress=False)


@pytest.mark.parametrize("threads", [0, -3, 2.0, "two", True, 10**6])
def test_a_number_of_threads_that_cannot_be_is_refused(tmp_path: Path, threads: object) -> None:
    write_run(finished(), tmp_path / "run")
    with pytest.raises(InvalidInput, match="resume: threads must be"):
        fk.resume(tmp_path / "run", progress=False, threads=threads)  # type: ignore[arg-type]


def test_what_is_no_run_and_no_path_is_refused_by_name(tmp_path: Path) -> None:
    run, words = finished(), "must be a"
    calls: list[Callable[[], object]] = [
        lambda: fk.simulate(scenario(), save=5, progress=False),  # type: ignore[arg-type]
        lambda: fk.simulate(scenario(), save=b"run", progress=False),  # type: ignore[arg-type]
        lambda: write_run(run, None),  # type: ignore[arg-type]
        lambda: write_run("run", tmp_path / "run"),  # type: ignore[arg-type]
        lambda: fk.export_run(run, 5),  # type: ignore[arg-type]
        lambda: fk.export_run("run", tmp_path / "run.csv"),  # type: ignore[arg-type]
    ]
    for call in calls:
        with pytest.raises(InvalidInput, match=words):
            call()
    with pytest.raises(InvalidInput, match="must be one of gsd"):
        fk.export_run(run, tmp_path / "run.csv", to=5)  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())
