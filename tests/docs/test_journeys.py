"""The journeys drawn on the page of the architecture are the ways that calls go, in their order, no file twice."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import flocking as fk
from flocking.apps.lab.experiment.experiment import Experiment
from flocking.apps.lab.panels.controls import Controls
from flocking.formula import compiled

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "src" / "flocking"
PAGE = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
DRAWN = PAGE.split("## Three journeys")[1].split("```")[1].removeprefix("text\n")
JOURNEYS = {
    title: re.findall(r"^  (\S+\.py) ", files, re.MULTILINE)
    for title, files in (block.split("\n", 1) for block in DRAWN.strip().split("\n\n"))
}
STATE = fk.State([[0.0, 0.0], [2.0, 0.0]], [[0.0, 0.1], [0.0, 0.0]])


def entered(go: Callable[[], object]) -> list[str]:
    """Files of the library in the order their functions are called, each as often as calls come to it from another."""
    found: list[str] = []

    def follow(frame, event, _) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(str(SOURCE)) and code.co_name != "<module>":
            name = Path(code.co_filename).relative_to(SOURCE).as_posix()
            if found[-1:] != [name]:
                found.append(name)

    before = sys.getprofile()
    sys.setprofile(follow)
    try:
        go()
    finally:
        sys.setprofile(before)
    return found


def missing(drawn: list[str], passed: list[str]) -> list[str]:
    """What is left of a journey where the first file comes that is not entered after the one before it."""
    way = iter(passed)
    return next((drawn[k:] for k, name in enumerate(drawn) if name not in way), [])


def law(formula: str) -> fk.Law:
    return fk.Law(fk.Hysteresis(4.0, 0.1), [fk.Gradient(fk.Potential(formula, R=4.0, b=1.5)), fk.Consensus(1.0)])


SHOWN = "(r - 2)**2 + b/(R + r)"


def scenario(formula: str = SHOWN) -> fk.Scenario:
    return fk.Scenario(law(formula), STATE, t_end=0.2, frames=2, name="shown")


def formula_to_kernel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    fk.start(scenario(), engine="exact").accelerations()
    monkeypatch.setenv("FLOCKING_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(compiled, "_modules", {})
    return entered(lambda: fk.start(scenario("(r - 2)**2 + b/(R + 3*r)"), engine="exact").accelerations())


def scenario_to_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    file = fk.write_scenario(scenario(), tmp_path / "shown.toml")

    def go() -> None:
        run = fk.simulate(fk.read_scenario(file), save=tmp_path / "run", progress=False)
        assert "ledger" in str(fk.audit(run))

    return entered(go)


def slider_to_force(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    experiment = Experiment(scenario(), "exact")
    experiment.advance(0.1)
    controls = Controls(
        lambda: experiment.scenario, lambda: experiment.state, lambda event, _: experiment.apply(dict(event))
    )

    def go() -> None:
        controls.move(["law", "terms", 1, "gain"], 1.25)
        experiment.session.accelerations()

    found = entered(go)
    assert experiment.scenario.law.terms[1].gain == 1.25
    return found


WAYS = {
    "a formula to a kernel": formula_to_kernel,
    "a scenario to a report": scenario_to_report,
    "a slider to a force": slider_to_force,
}


def test_three_journeys_are_drawn_and_pass_no_file_twice():
    assert set(JOURNEYS) == set(WAYS)
    for title, files in JOURNEYS.items():
        assert len(files) == len(set(files)) > 10, title
        assert [name for name in files if not (SOURCE / name).is_file()] == [], title


@pytest.mark.parametrize("title", WAYS)
def test_calls_go_the_way_that_is_drawn(title, tmp_path, monkeypatch):
    assert missing(JOURNEYS[title], WAYS[title](tmp_path, monkeypatch)) == []


def test_a_journey_that_goes_another_way_is_found():
    assert missing(["a", "b", "c"], ["a", "x", "b", "a", "c"]) == []
    assert missing(["a", "b", "c"], ["b", "a", "c"]) == ["b", "c"]
    assert missing(["a", "b"], ["a"]) == ["b"]
