"""A potential that has no value, or never acts, within the radius of its graph is named when a scenario is built."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput, SuspectInput
from flocking.model.potentials.poles import poles, sides
from flocking.papers import olfati_saber_2003, shi_2009, tanner_2003_dynamic, tanner_2003_fixed, zhou_2015

START = fk.State([[0.0, 0.0], [1.5, 0.0], [3.0, 0.0]])


def scenario(formula: str, graph: float | fk.Graph, **parameters: float) -> fk.Scenario:
    graph = fk.Proximity(graph) if isinstance(graph, float) else graph
    return fk.Scenario(fk.Law(graph, [fk.Gradient(fk.Potential(formula, **parameters))]), START, t_end=1.0)


@pytest.mark.parametrize(
    ("formula", "parameters", "pole", "how"),
    [
        ("1/r + 1/(R - r)", {"R": 4.0}, "4", "falls without bound to its pole"),
        ("-1/(r - 1)**2", {}, "1", "falls without bound to its pole"),
        ("log(4 - r)", {}, "4", "has no value beyond its pole"),
        ("-log(1 - (r/a)**2)", {"a": 2.5}, "2.5", "has no value beyond its pole"),
    ],
)
def test_a_pole_that_neighbours_can_reach_is_refused(
    formula: str, parameters: dict[str, float], pole: str, how: str
) -> None:
    with pytest.raises(InvalidInput, match=f"{how} at distance {pole}, inside the radius 6 of its graph"):
        scenario(formula, 6.0, **parameters)
    with pytest.raises(InvalidInput, match="inside the radius 6"):
        scenario(formula, fk.Hysteresis(6.5, 0.5), **parameters)
    within = float(pole)
    scenario(formula, within, **parameters)
    scenario(formula, within / 2, **parameters)
    scenario(formula, fk.Fixed(3, ((0, 1), (1, 2))), **parameters)


@pytest.mark.parametrize(
    ("formula", "parameters", "at"),
    [
        ("sqrt(4 - r)", {}, "4.01"),
        ("(a - r)**1.5", {"a": 4.0}, "4.01"),
        ("(a - r)**b", {"a": 4.0, "b": 0.5}, "4.01"),
        ("log(r - 8)", {}, "0.015"),
    ],
)
def test_a_potential_without_values_where_neighbours_are_is_refused(
    formula: str, parameters: dict[str, float], at: str
) -> None:
    with pytest.raises(InvalidInput, match=f"has no value at distance {at}, inside the radius 6 of its graph"):
        scenario(formula, 6.0, **parameters)
    with pytest.raises(InvalidInput, match="has no value at distance"):
        scenario(formula, fk.Hysteresis(6.5, 3.0), **parameters)
    if at != "0.015":
        scenario(formula, 4.0, **parameters)


@pytest.mark.parametrize(
    "formula", ["sqrt(r)", "(r**2 + 1)**0.5", "where(r < 1, sqrt(1 - r), 0)", "r**-1.5", "r*log(r)"]
)
def test_roots_that_have_values_pass(formula: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", SuspectInput)
        scenario(formula, 6.0)


def test_a_link_that_appears_before_the_pole_never_comes_past_it() -> None:
    scenario("1/r + 1/(R - r)", fk.Hysteresis(4.04, 0.1), R=4.0)
    with pytest.raises(InvalidInput, match=r"inside the radius 4\.01"):
        scenario("1/r + 1/(R - r)", fk.Hysteresis(4.11, 0.1), R=4.0)


def test_a_pole_that_no_pair_can_pass_is_mentioned() -> None:
    with pytest.warns(SuspectInput, match="has a pole at distance 1, inside the radius 2 of its graph: no pair can"):
        scenario("1/(r - 1)**2", 2.0)


@pytest.mark.parametrize("formula", ["where(r < 3, 0, (r - 3)**2)", "where(r < 3, 0, where(r < 3.2, (r - 3)**2, 0))"])
def test_a_term_that_never_acts_is_mentioned(formula: str) -> None:
    with pytest.warns(
        SuspectInput, match="acts only at distances beyond 3, and its graph has neighbours only within 2"
    ):
        scenario(formula, 2.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error", SuspectInput)
        scenario(formula, 3.1)


@pytest.mark.parametrize("formula", ["0*r", "1/r", "where(r < 1, 0, r**2)", "where(r < 3, r**2, 9)", "exp(-r)"])
def test_other_potentials_pass_without_a_word(formula: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", SuspectInput)
        scenario(formula, 2.0)


@pytest.mark.parametrize("paper", [olfati_saber_2003, tanner_2003_fixed, tanner_2003_dynamic, shi_2009, zhou_2015])
def test_the_scenarios_of_the_papers_pass_without_a_word(paper) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", SuspectInput)
        for build in paper.scenarios().values():
            build(0)


def test_sides_of_poles() -> None:
    assert sides(fk.Potential("1/r + 1/(R - r)", R=4.0), 4.0) == ("rises", "falls")
    assert sides(fk.Potential("log(4 - r)"), 4.0) == ("falls", "ends")
    (pole,) = poles(fk.Potential("1/(r**3 - 8)"))
    assert np.isclose(pole, 2.0)
