"""Computations shared by the equation tables of several papers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flocking.engine.driver.simulate import simulate
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.model.checks import Array, integer
from flocking.model.law import Law, Scenario
from flocking.model.potentials.potential import Potential
from flocking.model.state import Agents, State
from flocking.papers.potential_definitions import check_potential
from flocking.study.claims.audit import audit
from flocking.study.claims.claim import Claim
from flocking.study.claims.judgement import Judgement, judge

if TYPE_CHECKING:
    from flocking.show.contents import PanelContents

STEP = 1e-5
"""Duration of the motions from which rates are computed."""

SEEDS = range(6)
"""Seeds of the runs behind the rows of theorems."""


def example_state(n: int = 5, *, spread: float = 1.5, seed: int = 7) -> State:
    """Positions and velocities in general position.

    Parameters
    ----------
    n
        Number of agents.
    spread
        Standard deviation of each coordinate.
    seed
        Seed of the draw.
    """
    rng = np.random.default_rng(seed)
    return State(rng.normal(size=(n, 2)) * spread, rng.normal(size=(n, 2)))


def balanced_square(potential: Potential, best: float = 1.0) -> Array:
    """Four linked agents in a square whose sides and diagonals balance; shape (4, 2).

    Parameters
    ----------
    potential
        Potential of every pair.
    best
        Distance of its minimum.
    """
    from scipy.optimize import brentq

    def outward(side: float) -> float:
        return float(np.sqrt(2.0) * potential.slope(side) + potential.slope(np.sqrt(2.0) * side))

    side = brentq(outward, 0.5 * best, best, xtol=1e-15, rtol=1e-15)
    return side * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def check_figure(figure: int | None, last: int) -> None:
    """Check that a figure is one of 1 to ``last``.

    Parameters
    ----------
    figure
        The number, or None.

    Raises
    ------
    InvalidInput
        If it is not.
    """
    if figure is not None and integer("scenario", "figure", figure, least=1) > last:
        raise InvalidInput("scenario", "figure", f"must be at most {last}", figure)


def displacement(scenario: Scenario, duration: float) -> Array:
    """Displacements of the agents of a scenario within ``duration``, shape (N, m)."""
    run = simulate(scenario.with_(t_end=duration, frames=(0.0, duration), name=""), progress=False)
    return np.asarray(run.q[-1] - run.q[0])


def velocity_change(scenario: Scenario, mass: float) -> Array:
    """Changes of the velocities of a scenario within that time if agents have ``mass``."""
    run = simulate(scenario.with_(t_end=STEP, frames=(0.0, STEP), name="", agents=Agents(masses=mass)), progress=False)
    return np.asarray(run.p[-1] - run.p[0])


@lru_cache(maxsize=16)
def shown(make: Callable[[], Scenario]) -> Run:
    """The run of a scenario for its figures."""
    return simulate(make(), progress=False)


@dataclass(frozen=True, eq=False)
class Pictured:
    """Content of a drawn figure.

    Parameters
    ----------
    run
        The run it shows; None for figures of no run.
    panels
        Its panels.
    declared
        Number, caption and scenarios of every figure of the paper, by number.
    """

    run: Run | None
    panels: tuple[PanelContents, ...]
    declared: dict[str, tuple[str, str, tuple[str, ...]]]


def pictured(
    key: str,
    number: int | str,
    make: Callable[[], Scenario] | None = None,
    *beside: Callable[[], Scenario],
) -> Callable[[float], Pictured]:
    """Builder of the content of a figure with scaled horizontal values.

    Parameters
    ----------
    key
        Key of the paper.
    number
        Number of the figure.
    make
        The scenario whose run it shows; None for figures without a run.
    beside
        Further scenarios whose runs it shows.
    """

    def build(scale: float) -> Pictured:
        from flocking.papers import paper
        from flocking.show.contents import contents

        run = None if make is None else shown(make)
        known = paper(key).figures()
        declared = {str(name): (f.number, f.caption, f.scenarios("")) for name, f in known.items()}
        (figure,) = (f for name, f in known.items() if name == number)
        return Pictured(run, contents(figure.draw(run, *map(shown, beside)), scale), declared)

    return build


def meets(key: str, radius: float | None, *potentials: Potential) -> tuple[tuple[bool | None, ...], ...]:
    """For each potential: whether it satisfies each item of a paper's definition of one.

    Parameters
    ----------
    key
        Key of the paper.
    radius
        Radius in the definition; None if the definition has none.
    potentials
        The potentials.
    """
    found = [check_potential(psi, radius=radius, definition=key).definitions[0] for psi in potentials]
    return tuple(tuple(row.holds for row in definition.rows) for definition in found)


def judged(
    make: Callable[[int], Scenario],
    plant: Callable[[Scenario], Law],
    claims: Sequence[Claim],
    seeds: Sequence[int] = SEEDS,
) -> dict[str, Judgement]:
    """Judgements of claims about runs with a plant instead of the declared law, by the keys of the claims.

    Parameters
    ----------
    make
        Scenario of a seed.
    plant
        Returns the law that agents follow, given the scenario.
    claims
        The claims.
    seeds
        The seeds.
    """
    reports = []
    for seed in seeds:
        scenario = make(seed)
        run: Run = simulate(scenario, progress=False, plant=plant(scenario))
        reports.append(audit(run, claims))
    return {j.claim.key: _with_counterexample(j) for j in judge(claims, reports)}


def _with_counterexample(found: Judgement) -> Judgement:
    """The judgement with the result of the claim's counter-example, if it has one."""
    make = found.claim.counterexample
    if make is None:
        return found
    return replace(found, counterexample=audit(shown(make), [found.claim])[found.claim.key])
