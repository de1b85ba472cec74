"""Margins of the conclusions about a scenario: those of its paper, or those for any law."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from flocking.errors import InvalidInput
from flocking.model.law import Scenario
from flocking.papers import keys, paper, paper_of
from flocking.study.claims.claim import Claim
from flocking.study.claims.conclusions.limits import positions_agree
from flocking.study.claims.general_claims import GENERAL
from flocking.study.margins.computed_runs import about_motion
from flocking.study.margins.margin_table import Margins
from flocking.study.margins.quantities import Quantity
from flocking.study.margins.search import MOST_RUNS, find_margins

VARIED = ("period", "delay", "loss", "noise", "limit")
"""Quantities that are varied when none are named."""

WIDTH = 0.2
"""Width of the bracket of a margin when none is given, as a share of its larger end."""

SEEDS = 5
"""Seeds when none are named: a level that all show has a probability of 0.48 at least, with 95 % confidence."""


def conclusions(scenario: Scenario) -> tuple[Claim, ...]:
    """Claims whose conclusions have margins: of the scenario's paper or, elsewhere, of any law; none about energy."""
    key = paper_of(scenario.name)
    if key and scenario.name in paper(key).scenarios():
        return about_motion(tuple(paper(key).claims(scenario.name)))
    if scenario.agents.order == 1:
        agree = Claim("positions-agree", "any law", "All positions become the same.", positions_agree)
        return (agree, *about_motion(GENERAL))
    return about_motion(GENERAL)


def margins(
    scenario: Scenario | str | Callable[[int], Scenario],
    vary: Sequence[str | Quantity] | str | Quantity = VARIED,
    *,
    claims: Sequence[Claim] | None = None,
    seeds: int | Sequence[int] = SEEDS,
    levels: Mapping[str, Sequence[float]] | None = None,
    period: float | None = None,
    t_end: float | None = None,
    share: float = 1.0,
    width: float = WIDTH,
    confidence: float = 0.95,
    most_runs: int = MOST_RUNS,
    out: str | Path | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    progress: bool = True,
) -> Margins:
    """How much imperfection of the world each conclusion about a scenario stands: a table of observations.

    One quantity at a time is varied from its ideal value outwards, over a grid and then by bisection of the first level
    at which a conclusion is not shown. What else the quantity needs is the base world: the scenario's own control and
    messages, or a force held for ``period`` and, where it is about messages, exact ones of that period without delay.

    Parameters
    ----------
    scenario
        A scenario, the name of one of a paper, or a function that makes one from a seed.
    vary
        Names of quantities (`flocking.study.margins.quantities.quantities`), or quantities of one's own.
    claims
        Claims whose conclusions are measured; those of the paper or of any law when absent.
    seeds
        Number of seeds, from 0 on, or the seeds; those of starts and of what is random about messages and bodies.
    levels
        Levels of the first grid by name of the quantity.
    period
        Period of the base world.
    t_end
        End of the runs; that of the scenario when absent.
    share
        Share of the runs that must show a conclusion at a level.
    width
        Width of the bracket of a margin, as a share of its larger end.
    confidence
        Level of confidence of the intervals.
    most_runs
        Largest number of runs.
    out
        Folder of the results. The same call goes on with those that it holds.
    workers, cluster, progress
        As for `flocking.sweep`.

    Raises
    ------
    InvalidInput
        When an argument breaks a rule.
    StorageError
        When ``out`` holds other results, or cannot be written.
    """
    make = _maker(scenario)
    if t_end is not None:
        make = _Until(make, t_end)
    if isinstance(seeds, bool) or (isinstance(seeds, int) and seeds < 1):
        raise InvalidInput("margins", "seeds", "must be a positive number of seeds, or the seeds", seeds)
    chosen = range(seeds) if isinstance(seeds, int) else tuple(seeds)
    if not chosen:
        raise InvalidInput("margins", "seeds", "must not be empty", list(chosen))
    first = make(chosen[0])
    if not isinstance(first, Scenario):
        raise InvalidInput("margins", "scenario", "must be a Scenario, or a function that gives one", first)
    several = [vary] if isinstance(vary, str | Quantity) else vary
    return find_margins(
        make, conclusions(first) if claims is None else tuple(claims), several,
        seeds=chosen, levels=levels, period=period, share=share, width=width, confidence=confidence,
        most_runs=most_runs, out=out, workers=workers, cluster=cluster, progress=progress,
    )  # fmt: skip


class _Until:
    """The same scenarios with another end."""

    def __init__(self, make: Callable[[int], Scenario], t_end: float) -> None:
        self._make, self._end = make, t_end

    def __call__(self, seed: int) -> Scenario:
        """The scenario of a ``seed``."""
        return self._make(seed).with_(t_end=self._end)


class _Same:
    """One scenario for every seed."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario

    def __call__(self, seed: int) -> Scenario:
        """The scenario, whatever the ``seed``."""
        return self._scenario


class _Named:
    """The scenario of a paper by its name."""

    def __init__(self, name: str, key: str) -> None:
        self._name, self._key = name, key

    def __call__(self, seed: int) -> Scenario:
        """The scenario of a ``seed``."""
        return paper(self._key).scenarios()[self._name](seed)


def _maker(scenario: Scenario | str | Callable[[int], Scenario]) -> Callable[[int], Scenario]:
    if isinstance(scenario, Scenario):
        return _Same(scenario)
    if isinstance(scenario, str):
        key = paper_of(scenario)
        if not key or scenario not in paper(key).scenarios():
            names = [name for each in keys() for name in paper(each).scenarios()]
            raise InvalidInput("margins", "scenario", f"must be one of {', '.join(names)}", scenario)
        return _Named(scenario, key)
    if not callable(scenario):
        raise InvalidInput("margins", "scenario", "must be a Scenario, a name, or a function of the seed", scenario)
    return scenario
