"""What a paper is to the library: who wrote it, its scenarios, claims, statements, figures and studies."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Protocol

from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.model.law import Scenario
from flocking.papers.equation_files import has_table, read_statements
from flocking.papers.equation_table import Erratum, Row, errata_of
from flocking.show.declaration import Figures, drawn_figure
from flocking.study.claims.claim import Claim
from flocking.study.potentials.potential_check import Definition

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture


class ClaimsOf(Protocol):
    """Claims about one of a paper's scenarios, about its first where no name is given."""

    def __call__(self, scenario: str = ...) -> Sequence[Claim]:
        """Claims about the scenario of this name."""


@dataclass(frozen=True, eq=False)
class Paper:
    """A paper.

    Names that are not listed here are those of the paper's package: its own functions and modules.

    Parameters
    ----------
    key
        Its key, for example ``"zhou-2015"``.
    title, authors, year, venue
        What a citation names: ``venue`` is the journal, the conference or the institution.
    scenario
        Makes a scenario of the paper; its parameters are the paper's own, ``figure`` and ``seed`` among them.
    scenarios
        Scenarios by name, each a function of the seed; the first is the paper's main one.
    claims
        Claims about a scenario by its name, each with what its expected verdict rests on.
    figures
        Figures by number.
    studies
        Names of the sweeps of its scenarios that come with the library.
    home
        Dotted name of its package, where it is not one of the library.
    potential_definition
        Its definition of what counts as a potential, where it has one.
    """

    key: str
    title: str
    authors: str
    year: int
    venue: str
    scenario: Callable[..., Scenario]
    scenarios: Callable[[], dict[str, Callable[[int], Scenario]]]
    claims: ClaimsOf
    figures: Callable[[], Figures]
    studies: tuple[str, ...] = ()
    home: str = ""
    potential_definition: Definition | None = None

    @property
    def citation(self) -> str:
        """Authors, title, venue and year in one line."""
        return f"{self.authors}: {self.title}. {self.venue}, {self.year}"

    @property
    def package(self) -> str:
        """Dotted name of the package that holds its parts."""
        return self.home or f"flocking.papers.{self.key.replace('-', '_')}"

    @cached_property
    def _rows(self) -> tuple[Row, ...]:
        if self.home and not has_table(self.home):
            return ()
        return read_statements(self.package, self.key)

    def equations(self) -> tuple[Row, ...]:
        """Every numbered statement of the paper, from the file ``equations.toml`` of its package."""
        return self._rows

    def errata(self) -> list[Erratum]:
        """False statements and misprints of the paper."""
        return errata_of(self.equations())

    def figure(self, number: int | str, run: Run, *beside: Run) -> Picture:
        """Draw a figure of the paper from a run, or from the runs of all scenarios it shows.

        Parameters
        ----------
        number
            Its number.
        run
            A run of the scenario it shows; of any scenario where it shows no run.
        beside
            Runs of the further scenarios it shows, in their order.

        Raises
        ------
        InvalidInput
            When there is no such figure, it shows another number of scenarios, or a scenario with a leader and the run
            has none, or the reverse.
        """
        shown = {str(name): figure for name, figure in self.figures().items()}.get(str(number))
        names = shown.scenarios("") if shown is not None and len(shown.beside) == len(beside) else ()
        for given, name in zip((run, *beside) if names else (), names, strict=True):
            if name and bool(given.scenario.law.leaders) != bool(self.scenarios()[name](0).law.leaders):
                raise InvalidInput(
                    "figure", "run", f"must be a run of {name}", given.scenario.name, f"Use scenario(figure={number})."
                )
        return drawn_figure(self.figures(), number, run, *beside)

    def __getattr__(self, name: str) -> object:
        if not name.startswith("_"):
            module = import_module(self.package)
            if hasattr(module, name):
                return getattr(module, name)
        raise AttributeError(f"the paper {self.key!r} has no attribute {name!r}")
