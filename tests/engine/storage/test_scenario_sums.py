"""Runs of parts from outside this library go on, and are read, with the parts that they had alone."""

from __future__ import annotations

import dataclasses
import functools
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import flocking as fk
from flocking.engine.storage.foreign_code import code_of
from flocking.engine.storage.record import read_record
from flocking.engine.storage.run_writer import RunWriter
from flocking.engine.storage.scenario_sums import scenario_sums, unlike
from flocking.engine.storage.stored_runs import read_run, write_run
from flocking.errors import StorageError
from tests.engine.storage.stored_runs import assert_same, finished, scenario, stopped_run


def pull(strength: float) -> type[fk.PairTerm]:
    """A term of no parameters, by the same name whatever its strength is."""

    class Pull(fk.PairTerm):
        parameters = property(lambda self: {})
        structure = ("pull",)

        def drag(self, x):
            return strength + 0 * x.r

    return Pull


def foreign(strength: float = 1.0, formula: str = "(r - 1)**2", **changes: object) -> fk.Scenario:
    law = fk.Law(fk.Proximity(2.0), [pull(strength)(), fk.Gradient(fk.Potential(formula))])
    return scenario().with_(law=law, **changes)


@pytest.mark.parametrize(
    ("other", "named"),
    [
        (lambda: foreign(2.0), "formulas"),
        (lambda: foreign(formula="(r - 1.5)**2"), "law"),
        (lambda: foreign(agents=fk.PointMass(2.0)), "agents"),
        (lambda: foreign(tolerance=1e-6), "tolerance"),
        (lambda: foreign(space=fk.Periodic([50.0, 50.0])), "space"),
        (lambda: foreign(energy=fk.Energy("centre of mass")), "energy"),
    ],
)
def test_a_run_that_is_not_stored_with_its_scenario_is_of_that_one_alone(
    other: Callable[[], fk.Scenario], named: str, tmp_path: Path
) -> None:
    write_run(dataclasses.replace(finished(), scenario=foreign()), tmp_path / "run")
    assert read_run(tmp_path / "run", scenario=foreign()).finished
    with pytest.raises(StorageError, match=f"the scenario is not that of the run: .*{named}.* differ"):
        read_run(tmp_path / "run", scenario=other())


def test_a_stopped_run_does_not_go_on_under_another_formula(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = stopped_run(tmp_path / "run", foreign(), monkeypatch)
    with pytest.raises(StorageError, match="the scenario is not that of the run: formulas differ"):
        fk.resume(folder, scenario=foreign(1.01), progress=False)
    assert_same(fk.resume(folder, scenario=foreign(), progress=False), fk.simulate(foreign(), progress=False))


def test_a_stopped_run_does_not_go_on_with_another_plant(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plant, other = foreign(0.5).law, foreign(0.6).law
    folder = stopped_run(tmp_path / "run", foreign(), monkeypatch, plant=plant)
    with pytest.raises(StorageError, match="the plant is not that of the run: formulas differ"):
        fk.resume(folder, scenario=foreign(), plant=other, progress=False)
    whole = fk.simulate(foreign(), plant=plant, progress=False)
    assert_same(fk.resume(folder, scenario=foreign(), plant=foreign(0.5).law, progress=False), whole)


def ring(reach: float) -> type[fk.Graph]:
    """A graph whose rule is code that states no formula."""

    @dataclasses.dataclass(frozen=True)
    class Ring(fk.Fixed):
        def initial(self, q):
            return np.asarray(super().initial(q)) & (reach > 0.0)

    return Ring


def test_a_stopped_run_does_not_go_on_with_other_code_and_is_read_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    edges = ((0, 1), (1, 2))

    def made(reach: float) -> fk.Scenario:
        return scenario().with_(law=fk.Law(ring(reach)(scenario().start.n, edges), [fk.Consensus(1.0)]))

    folder = stopped_run(tmp_path / "run", made(1.0), monkeypatch)
    with pytest.raises(StorageError, match="the code of its classes differ"):
        fk.resume(folder, scenario=made(2.0), progress=False)
    assert len(read_run(folder, scenario=made(2.0)).t) > 1
    assert fk.resume(folder, scenario=made(1.0), progress=False).finished


def test_a_registered_part_whose_formula_was_changed_since_does_not_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def register(strength: float) -> type[fk.PairTerm]:
        @fk.register_part("towed")
        @dataclasses.dataclass(frozen=True)
        class Towed(fk.PairTerm):
            gain: float = 1.0
            over: fk.Graph | None = None
            parameters = property(lambda self: {"gain": self.gain})
            structure = ("towed",)

            def drag(self, x):
                return strength * x.parameter("gain") + 0 * x.r

        return Towed

    made = scenario().with_(law=fk.Law(fk.Proximity(2.0), [register(1.0)(0.5)]))
    folder = stopped_run(tmp_path / "run", made, monkeypatch)
    register(2.0)
    with pytest.raises(StorageError, match="the scenario is not that of the run: formulas differ"):
        fk.resume(folder, progress=False)
    register(1.0)
    assert fk.resume(folder, progress=False).finished


def test_scenarios_of_the_library_have_no_sums_and_runs_of_earlier_versions_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert scenario_sums(scenario()) is None
    folder = stopped_run(tmp_path / "run", foreign(), monkeypatch)
    assert "sums" in read_record(folder)["scenario"]
    with RunWriter.reopen(folder) as writer:
        del writer.record["scenario"]["sums"]
        writer.commit(writer.record["status"])
    assert "sums" not in read_record(folder)["scenario"]
    assert read_run(folder, scenario=foreign(2.0)).status


SAYS = """
import sys
sys.path.insert(0, {root!r})
from tests.engine.storage.test_scenario_sums import foreign
from flocking.engine.storage.scenario_sums import scenario_sums
print(scenario_sums(foreign()))
"""


def test_sums_are_the_same_in_another_process() -> None:
    root = str(Path(__file__).parents[3])
    text = SAYS.format(root=root)
    environment = {**os.environ, "PYTHONHASHSEED": "12345"}
    found = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, env=environment, check=True)
    assert found.stdout.strip() == str(scenario_sums(foreign()))


def using(kind: str, number: float) -> type:
    """A class by the same name whose method uses a number by way of something else."""
    helpers = ModuleType("numbers_of_a_user")
    vars(helpers)["GAIN"] = number
    table, whole, potential = {"near": number}, np.int64(number), fk.Potential(f"(r - {number})**2")
    bound = functools.partial(max, number)

    @functools.lru_cache
    def cached(x: float) -> float:
        return x * number

    uses: dict[str, Callable[[object], object]] = {
        "module": lambda self: helpers.GAIN,
        "table": lambda self: table["near"],
        "whole number": lambda self: whole,
        "partial": lambda self: bound(1.0),
        "cached": lambda self: cached(1.0),
        "dataclass": lambda self: potential,
    }
    return type("Used", (), {"__module__": "of_a_user", "initial": uses[kind]})


@pytest.mark.parametrize("kind", ["module", "table", "whole number", "partial", "cached", "dataclass"])
def test_what_code_uses_counts_wherever_it_stands(kind: str) -> None:
    assert code_of(using(kind, 1.0)) == code_of(using(kind, 1.0))
    assert code_of(using(kind, 1.0)) != code_of(using(kind, 2.0))


def test_what_code_fills_as_it_goes_does_not_count() -> None:
    def filling(known: dict[float, float]) -> type:
        def initial(self: object, x: float) -> float:
            known[x] = 2.0 * x
            return known[x]

        return type("Filling", (), {"__module__": "of_a_user", "initial": initial})

    assert code_of(filling({})) == code_of(filling({1.0: 2.0}))


def ruled(rule: Callable[[np.ndarray], np.ndarray]) -> fk.Scenario:
    """A graph that holds the function by which it links agents."""

    @dataclasses.dataclass(frozen=True)
    class Ruled(fk.Fixed):
        rule: Callable[[np.ndarray], np.ndarray] = np.sign

        def initial(self, q):
            return np.asarray(super().initial(q)) & (self.rule(q).sum() > 0.0)

    graph = Ruled(scenario().start.n, ((0, 1), (1, 2)), rule=rule)
    return scenario().with_(law=fk.Law(graph, [fk.Consensus(1.0)]))


def test_functions_that_parts_hold_count() -> None:
    def near(reach: float) -> Callable[[np.ndarray], np.ndarray]:
        return lambda q: q * 0.0 + reach

    one, same, other, sine, cosine = (
        scenario_sums(ruled(rule)) for rule in (near(1.0), near(1.0), near(2.0), np.sin, np.cos)
    )
    assert one is not None
    assert sine is not None
    assert unlike(one, {**same}, code=True) == ""
    assert unlike(one, {**other}, code=True) == "the code of its classes"
    assert unlike(sine, {**cosine}, code=True) != ""
