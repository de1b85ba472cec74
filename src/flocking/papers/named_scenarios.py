"""The function that makes a scenario of a paper by its name or the figure that shows it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol, overload

from flocking.model.checks import one_of
from flocking.model.law import Scenario
from flocking.model.parts.seeds import SeedNumber, seeded


class ScenarioByName(Protocol):
    """Makes the scenario of a figure, or that of a name, by default the first."""

    @overload
    def __call__(self, figure: int | str | None = ..., seed: int = ..., *, name: str = ...) -> Scenario: ...

    @overload
    def __call__(self, *values: object, rng: SeedNumber, **named: object) -> Scenario: ...


def scenario_by_name(
    scenarios: Callable[[], Mapping[str, Callable[[int], Scenario]]], figures: Mapping[int, str] | Mapping[str, str]
) -> ScenarioByName:
    """The function that makes a scenario by its name, or the one that a figure shows.

    It raises `InvalidInput` for a figure or a name that the paper does not have.

    Parameters
    ----------
    scenarios
        Scenarios by name, each a function of the seed; the first is the default.
    figures
        Names of the scenarios that figures show, by figure.
    """
    shown: Mapping[object, str] = dict(figures.items())

    @seeded
    def scenario(figure: int | str | None = None, seed: int = 0, *, name: str | None = None) -> Scenario:
        """A scenario by its name, or that of a figure.

        Parameters
        ----------
        figure
            A figure of the paper.
        seed
            Seed of all that is random; ``rng`` is another name, and takes a `numpy.random.SeedSequence` too.
        name
            Name of the scenario, if no figure is given; the first by default.

        Raises
        ------
        InvalidInput
            If there is no such figure or scenario.
        """
        known = scenarios()
        if figure is not None:
            one_of("scenario", "figure", figure, shown)
            name = shown[figure]
        name = next(iter(known)) if name is None else name
        one_of("scenario", "name", name, known)
        return known[name](seed)

    # Other processes find it in the module of the paper.
    scenario.__module__, scenario.__qualname__ = scenarios.__module__, "scenario"  # type: ignore[attr-defined]
    return scenario
