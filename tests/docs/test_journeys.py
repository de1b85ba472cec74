"""The journeys drawn on `docs/inside.md` name the files that data reach, in the order in which they reach them first.

A journey follows one thing: a formula by a number in it, a scenario by its name, the value of a slider. A file is
reached when a function of it is given something in which that is found.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath

import numpy as np
import pytest

import flocking as fk
from flocking.apps.lab.experiment.experiment import Experiment
from flocking.apps.lab.panels.controls import Controls
from flocking.formula import compiled

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "src" / "flocking"
PAGE = (ROOT / "docs" / "inside.md").read_text(encoding="utf-8")
DRAWN = PAGE.split("## Three journeys")[1].split("```")[1].removeprefix("text\n")
JOURNEYS = {
    title: re.findall(r"^  (\S+\.py) ", files, re.MULTILINE)
    for title, files in (block.split("\n", 1) for block in DRAWN.strip().split("\n\n"))
}
STATE = fk.State([[0.0, 0.0], [2.0, 0.0]], [[0.0, 0.1], [0.0, 0.0]])


@dataclass(frozen=True)
class Followed:
    """What is followed: words in texts and formulas, and a number."""

    words: str = ""
    number: float = float("nan")

    def among(self, values: object, depth: int = 6) -> bool:
        """Whether it is found in values, in what they contain, and in the fields of this library's objects."""
        if isinstance(values, str | PurePath) or type(values).__module__.startswith("sympy"):
            return self.words != "" and self.words in str(values)
        if isinstance(values, int | float | np.number):
            return bool(values == self.number)
        if isinstance(values, np.ndarray):
            return values.dtype.kind in "fi" and bool((values == self.number).any())
        inner: list[object] = []
        if isinstance(values, Mapping):
            inner = [*values.keys(), *values.values()]
        elif isinstance(values, list | tuple | set | frozenset):
            inner = list(values)
        elif type(values).__module__.startswith("flocking") and not isinstance(values, type):
            inner = list(getattr(values, "__dict__", {}).values())
        return depth > 0 and any(self.among(x, depth - 1) for x in inner)


def reached(go: Callable[[], object], drawn: list[str], followed: Followed, behind: frozenset[str]) -> list[str]:
    """Drawn files in the order in which they are reached; calls during imports do not count.

    Parameters
    ----------
    behind
        Files that are given the machine code, in which nothing is found: they are reached by the first call that comes
        after the file drawn before them is reached.
    """
    found: list[str] = []
    importing = 0

    def follow(frame, event, _) -> None:
        nonlocal importing
        code = frame.f_code
        if code.co_name == "<module>":
            importing += {"call": 1, "return": -1}.get(event, 0)
        if event != "call" or importing or not code.co_filename.startswith(str(SOURCE)):
            return
        name = Path(code.co_filename).relative_to(SOURCE).as_posix()
        if name not in drawn or name in found:
            return
        if name in behind:
            if drawn[drawn.index(name) - 1] in found:
                found.append(name)
            return
        sys.setprofile(None)
        try:
            if any(followed.among(value) for value in frame.f_locals.values()):
                found.append(name)
        finally:
            sys.setprofile(follow)

    before = sys.getprofile()
    sys.setprofile(follow)
    try:
        go()
    finally:
        sys.setprofile(before)
    return found


def law(formula: str) -> fk.Law:
    return fk.Law(fk.Hysteresis(4.0, 0.1), [fk.Gradient(fk.Potential(formula, R=4.0, b=1.5)), fk.Consensus(1.0)])


def scenario(formula: str = "(r - 2)**2 + b/(R + r)") -> fk.Scenario:
    return fk.Scenario(law(formula), STATE, t_end=0.2, frames=2, name="shown")


NUMBER = 887653
"""A number that nothing else has."""

MACHINE_CODE = frozenset({"engine/kernels/law_kernels.py", "formula/native/entries.py"})


def formula_to_kernel(drawn: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    fk.start(scenario(), engine="exact").accelerations()
    monkeypatch.setenv("FLOCKING_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(compiled, "_modules", {})
    followed = Followed(str(NUMBER), float(NUMBER))
    made: list[fk.Scenario] = []

    def make() -> None:
        made.append(scenario(f"(r - 2)**2 + b/(R + {NUMBER}*r)"))

    end = drawn.index("model/law.py") + 1
    found = reached(make, drawn[:end], followed, MACHINE_CODE)
    # The law has checked the values of its potential; its kernels are made when it is simulated.
    monkeypatch.setattr(compiled, "_modules", {})
    return found + reached(
        lambda: fk.start(made[0], engine="exact").accelerations(), drawn[end:], followed, MACHINE_CODE
    )


def scenario_to_report(drawn: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    name = "followed-by-name"
    file = fk.write_scenario(scenario().with_(name=name), tmp_path / f"{name}.toml")

    def go() -> None:
        run = fk.simulate(fk.read_scenario(file), save=tmp_path / "run", progress=False)
        assert "ledger" in str(fk.audit(run))

    return reached(go, drawn, Followed(name), frozenset())


def slider_to_force(drawn: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    value = 1.234567
    experiment = Experiment(scenario(), "exact")
    experiment.advance(0.1)
    controls = Controls(
        lambda: experiment.scenario, lambda: experiment.state, lambda event, _: experiment.apply(dict(event))
    )

    def go() -> None:
        controls.move(["law", "terms", 1, "gain"], value)
        experiment.session.accelerations()

    found = reached(go, drawn, Followed(number=value), frozenset())
    assert experiment.scenario.law.terms[1].gain == value
    return found


WAYS = {
    "a formula to a kernel": formula_to_kernel,
    "a scenario to a report": scenario_to_report,
    "a slider to a force": slider_to_force,
}


def test_three_journeys_are_drawn_and_name_no_file_twice():
    assert set(JOURNEYS) == set(WAYS)
    for title, files in JOURNEYS.items():
        assert len(files) == len(set(files)) > 10, title
        assert [name for name in files if not (SOURCE / name).is_file()] == [], title


@pytest.mark.parametrize("title", WAYS)
def test_data_go_the_way_that_is_drawn(title, tmp_path, monkeypatch):
    """The order is that in which files are reached first: one drawn elsewhere, or not on the way, fails."""
    assert WAYS[title](JOURNEYS[title], tmp_path, monkeypatch) == JOURNEYS[title]


def test_a_journey_that_goes_another_way_is_found(tmp_path, monkeypatch):
    drawn = JOURNEYS["a slider to a force"]
    for k in range(len(drawn) - 1):
        swapped = [*drawn[:k], drawn[k + 1], drawn[k], *drawn[k + 2 :]]
        assert slider_to_force(swapped, tmp_path, monkeypatch) == drawn
    assert slider_to_force([*drawn, "engine/exact/recorder.py"], tmp_path, monkeypatch) == drawn


def test_what_is_followed_is_found_in_what_contains_it():
    followed = Followed("7.25", 7.25)
    held = law("(r - 7.25)**2 + b/(R + r)")
    for values in ("a 7.25", [1, {"x": 7.25}], np.array([1.0, 7.25]), held):
        assert followed.among(values)
    for values in ("7.3", None, [1, {"x": 7}], np.array([1.0]), law("(r - 2)**2 + b/(R + r)")):
        assert not followed.among(values)
