"""The safety filter with numbers up to the ends of their range: a force that keeps its conditions, or a clear error."""

from __future__ import annotations

import copy
import re

import numpy as np
import pytest

import flocking as fk
from flocking.engine.imperfect.messages.knowledge import Known
from flocking.engine.sampled.nearest_force import nearest
from flocking.engine.sampled.safety import ForceFilter
from flocking.errors import InvalidInput, NotFinite
from flocking.model.space import Open

EDGES = np.array([
    0.0, -0.0, 5e-324, -5e-324, 1e-310, 1e-160, -1e-160, 1e-20, 1.0, -1.0, 1e8, 1e150, -1e150, 1e154, 1e300, -1e300,
    1.7e308, -1.7e308,
])  # fmt: skip
KEPT = 1e-7
"""Share of the largest acceleration by which a condition may be missed: a million times the rounding of numbers up to a
million times as large."""
CASES = 120
"""Random cases of each form by default; the first of the four hundred that are marked as repetitions."""


def drawn(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Usual numbers, extreme ones, or both."""
    usual = rng.normal(size=shape) * 10.0 ** rng.uniform(-3, 3)
    return np.where(rng.random(shape) < rng.choice([0.0, 0.1, 1.0]), rng.choice(EDGES, shape), usual)


def positive(rng: np.random.Generator) -> float:
    if rng.random() < 0.4:
        return float(rng.choice([1e-60, 1e-30, 1e-6, 1.0, 1e6, 1e30, 1e60]))
    return float(10.0 ** rng.uniform(-2, 2))


def case(rng: np.random.Generator, form: str) -> tuple[ForceFilter, Known, np.ndarray]:
    """A filter of some agents, what all know, and the forces of the law."""
    n, m = int(rng.integers(1, 6)), int(rng.choice([2, 3]))
    balls = (fk.Ball(drawn(rng, (m,)), positive(rng)),) if form == "stopping" and rng.random() < 0.4 else ()
    control = fk.SafetyFilter(
        float(10.0 ** rng.uniform(-3, 1)), distance=positive(rng), acceleration=[positive(rng) for _ in range(n)],
        form=form, gain=positive(rng), obstacles=balls,
    )  # fmt: skip
    q, p, force = (drawn(rng, (n, m)) for _ in range(3))
    masses = np.array([positive(rng) ** rng.choice([1, 1, 5]) for _ in range(n)])
    own = np.hstack([q, p])
    there = np.ones((n, n), dtype=bool)
    known = Known(np.arange(n), own, np.repeat(own[None], n, axis=0), there, None, 0)
    return ForceFilter(control, masses, q, Open(), 5.0), known, force


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("form", ["sampled", "continuous", "stopping"])
def test_a_force_is_within_its_bounds_or_there_is_none(form: str) -> None:
    forces_of_drawn_cases(form, 14, CASES)


@pytest.mark.repeated
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("form", ["sampled", "continuous", "stopping"])
def test_a_force_is_within_its_bounds_or_there_is_none_in_many_cases(form: str) -> None:
    forces_of_drawn_cases(form, 14, 400)


def forces_of_drawn_cases(form: str, seed: int, cases: int) -> None:
    """Forces of so many random cases are within their bounds; a case without one is told in words."""
    rng = np.random.default_rng(seed)
    came, refused = 0, list[NotFinite]()
    for _ in range(cases):
        keeper, known, force = case(rng, form)
        before = copy.deepcopy(keeper)
        try:
            found = keeper.filtered(2_000_000_000, known, force)
        except NotFinite as error:
            refused.append(error)
            continue
        came += 1
        assert np.isfinite(found).all()
        for i in range(len(found)):
            with np.errstate(over="ignore"):
                # Also where the product underflows.
                largest = max(keeper.masses[i] * keeper.most[i], 1e-300)
            share = np.linalg.norm(found[i] / largest)
            assert share <= 1 + 1e-8
            if form != "stopping" and keeper.memory.relaxed == 0:
                others = np.arange(len(found)) != i
                dp, dv = (known.own[i] - known.own)[others].reshape(-1, 2, force.shape[1]).swapaxes(0, 1)
                normals, bounds = before._conditions(i, others, dp, dv)
                least = bounds / keeper.most[i]
                assert (normals @ (found[i] / largest) >= least - KEPT).all() or keeper.masses[i] < 1e-200
    assert came > cases / 8
    assert len(refused) > cases / 8
    for error in refused:
        assert "safety filter cannot compute a force" in str(error)
        assert error.time == 7.0
        assert len(error.agents) == 1


@pytest.mark.parametrize("form", ["sampled", "continuous", "stopping"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("where", ["force", "position", "velocity", "other"])
def test_what_is_not_finite_is_never_let_through(form: str, value: float, where: str) -> None:
    control = fk.SafetyFilter(0.1, distance=0.5, acceleration=2.0, form=form)
    own = np.array([[0.0, 0.0, 0.1, 0.0], [3.0, 0.0, 0.0, 0.0]])
    rows, force = np.repeat(own[None], 2, axis=0), np.zeros((2, 2))
    if where == "force":
        force[0, 1] = value
    elif where == "other":
        rows[0, 1, 3] = value
    else:
        own[0, 1 if where == "position" else 3] = value
    known = Known(np.arange(2), own, rows, np.ones((2, 2), dtype=bool), None, 0)
    keeper = ForceFilter(control, np.ones(2), np.zeros((2, 2)), Open())
    with pytest.raises(NotFinite, match=r"safety filter cannot compute.*agents \[0\]"):
        keeper.filtered(0, known, force)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("form", ["sampled", "continuous", "stopping"])
@pytest.mark.parametrize("speed", [1e60, 1e100, 1e150, 5e153])
def test_a_run_with_such_numbers_is_finite_or_ends_with_an_error_of_the_library(form: str, speed: float) -> None:
    law = fk.Law(fk.Fixed.complete(2), [fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [3.0, 0.0]], [[speed, 0.0], [-speed, 0.0]])
    control = fk.SafetyFilter(0.1, distance=0.5, acceleration=2.0, form=form)
    said = ""
    try:
        run = fk.simulate(fk.Scenario(law, start, t_end=1.0, frames=3, control=control), progress=False)
    except fk.FlockingError as error:
        said = str(error)
    else:
        assert np.isfinite(run.q).all()
        assert np.isfinite(run.p).all()
    assert not said or re.search("too large|precision|infinite|overflow", said), said


@pytest.mark.parametrize("value", [1e-300, 5e-324, 1e-61, 1e61, 1e300])
@pytest.mark.parametrize("name", ["distance", "acceleration", "gain", "clearance"])
def test_numbers_of_a_filter_whose_products_leave_the_range_are_refused(name: str, value: float) -> None:
    given: dict[str, float] = {"distance": 1.0, "acceleration": 1.0, name: value}
    with pytest.raises(InvalidInput, match=f"{name} must lie between 1e-60 and 1e\\+60"):
        fk.SafetyFilter(0.1, **given)  # type: ignore[arg-type]


def test_largest_accelerations_of_each_agent_are_checked() -> None:
    with pytest.raises(InvalidInput, match="acceleration must lie between"):
        fk.SafetyFilter(0.1, distance=1.0, acceleration=[1.0, 1e-200])


@pytest.mark.parametrize("unit", [2.0**-200, 2.0**-45, 2.0**60])
def test_the_nearest_acceleration_does_not_depend_on_the_unit(unit: float) -> None:
    for seed in range(3):
        rng = np.random.default_rng(seed)
        normals = rng.normal(size=(5, 2))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        bounds, desired = rng.uniform(-1.0, 0.2, 5), 2.0 * rng.normal(size=2)
        expected, fits = nearest(desired, normals, bounds, 1.0)
        found, still = nearest(desired * unit, normals, bounds * unit, unit)
        assert still == fits
        assert np.abs(found / unit - expected).max() < 1e-9
