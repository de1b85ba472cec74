"""Parts of the wrong kind are refused in words when they are given."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.exact.session import ExactSession
from flocking.errors import FormulaError, InvalidInput
from flocking.model.graphs.distance_graphs import Graph

LAW = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("(r - 1)**2")), fk.Consensus(1.0)])
START = fk.State([[0.0, 0.0], [1.0, 0.0]])


@pytest.mark.parametrize("engine", ["exact", "tiles"])
@pytest.mark.parametrize("plant", ["consensus", fk.Scenario(LAW, START, 1.0), fk.Consensus(1.0), 0])
def test_a_plant_that_is_no_law_is_refused(engine: str, plant: object) -> None:
    with pytest.raises(InvalidInput, match="plant must be a Law, or None"):
        fk.simulate(fk.Scenario(LAW, START, 1.0), engine=engine, plant=plant, progress=False)  # type: ignore[arg-type]


def test_a_plant_that_is_no_law_is_refused_when_a_session_goes_on() -> None:
    snapshot = ExactSession(fk.Scenario(LAW, START, 1.0)).snapshot()
    with pytest.raises(InvalidInput, match="plant must be a Law, or None"):
        ExactSession.resume(snapshot, plant="consensus")  # type: ignore[arg-type]


@pytest.mark.parametrize("formula", [lambda r: r**2, None, np.sin, 3])
def test_a_potential_is_written_not_programmed(formula: object) -> None:
    with pytest.raises(FormulaError, match="must be a text or a SymPy expression"):
        fk.Potential(formula)  # type: ignore[arg-type]


def test_more_columns_than_space_has_dimensions_are_mentioned() -> None:
    with pytest.warns(UserWarning, match=r"2 agents in 10 dimensions: rows are agents"):
        fk.State(np.zeros((2, 10)))
    fk.State(np.zeros((10, 3)))


@pytest.mark.parametrize(
    ("declared", "other"),
    [
        (fk.Cone(1.5, 1.0), fk.Cone(1.5, 2.0)), (fk.Cone(1.5, 1.0), fk.Cone(1.5, 1.0, "wrapped")),
        (fk.FieldOfView(1.5, 1.0), fk.FieldOfView(1.5, 2.0)), (fk.Hysteresis(2.0, 0.5), fk.Hysteresis(2.0, 0.2)),
        (fk.Fixed(3, [(0, 1)]), fk.Fixed(3, [(1, 2)])), (fk.Proximity(1.0), fk.Smooth(1.0, 0.5)),
        (fk.SmoothCone(1.5, 0.3, 1.0), fk.SmoothCone(1.5, 0.3, 2.0)),
        (fk.SmoothCone(1.5, 0.3, 1.0), fk.SmoothCone(1.5, 0.6, 1.0)),
    ],
    ids=lambda graph: type(graph).__name__,
)  # fmt: skip
def test_a_plant_that_links_other_agents_is_refused_with_fixed_steps(declared: Graph, other: Graph) -> None:
    """Such engines follow the links of the declared graph alone, and take the factors of headings beside them."""
    terms, agents = (fk.Consensus(0.5),), fk.PointMass(headings=[0.0, 1.5, 3.0])
    start = fk.State([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    scenario = fk.Scenario(fk.Law(declared, terms), start, 1.0, agents=agents)
    with pytest.raises(InvalidInput, match="plant must have the graphs of the declared law"):
        fk.simulate(scenario, engine="tiles", step=0.1, plant=fk.Law(other, terms), progress=False)


def test_a_plant_whose_weights_begin_to_fall_elsewhere_is_run_with_fixed_steps() -> None:
    terms = (fk.Consensus(0.5),)
    declared, plant = fk.Law(fk.Smooth(1.5, 0.2), terms), fk.Law(fk.Smooth(1.5, 0.6), terms)
    start = fk.State([[0.0, 0.0], [1.2, 0.0], [0.0, 1.2]], [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    run, expected = (
        fk.simulate(fk.Scenario(law, start, 1.0), engine="tiles", step=0.1, plant=used, progress=False)
        for law, used in ((declared, plant), (plant, None))
    )
    np.testing.assert_array_equal(run.q, expected.q)
