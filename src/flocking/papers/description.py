"""Description of a paper: citation, scenarios, claims, statements, figures and studies."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING

from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.model.law import Scenario
from flocking.papers.assumptions import Assumption, nothing
from flocking.papers.equation_files import has_table, read_statements
from flocking.papers.equation_table import Erratum, Row, errata_of
from flocking.papers.grounds import ClaimsOf
from flocking.show.declaration import Figures, drawn_figure
from flocking.study.potentials.potential_check import Definition

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture


@dataclass(frozen=True, eq=False, repr=False)
class Paper:
    """A paper.

    Other attributes are the functions and modules of the paper's package.

    Parameters
    ----------
    key
        Its key, for example ``"zhou-2015"``.
    title, authors, year, venue
        Citation; ``venue`` is the journal, the conference or the institution.
    scenario
        Makes a scenario of the paper; its parameters depend on the paper and include ``figure`` and ``seed``.
    scenarios
        Scenarios by name, each a function of the seed; the first is the paper's main one.
    claims
        Claims about a scenario by its name, each with the ground of its expected verdict.
    figures
        Figures by number.
    studies
        Names of the sweeps of its scenarios in the library.
    home
        Dotted name of its package, if it is not part of the library.
    potential_definition
        Its definition of a potential, if it has one.
    titles
        Titles of scenarios by their names, such as ``"Fig. 9: a hundred agents gather around a sink"``.
    questions
        What is asked of each scenario, by its name, in one sentence that the claims about it answer.
    assumes
        Why a scenario by the name of one of its own is not of the law, the agents or the energy that its claims are
        about; empty where it is. By default the name is enough.
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
    titles: Mapping[str, str] = field(default_factory=dict)
    questions: Mapping[str, str] = field(default_factory=dict)
    assumes: Assumption = nothing

    def __repr__(self) -> str:
        """In one line: what it is cited as."""
        return f"<Paper {self.key!r}: {self.citation}>"

    def title_of(self, scenario: str) -> str:
        """Title of the scenario of this name; its name where it has none."""
        return self.titles.get(scenario, scenario)

    def question_of(self, scenario: str) -> str:
        """What is asked of the scenario of this name, in one sentence; empty where nothing is stated."""
        return self.questions.get(scenario, "")

    @property
    def citation(self) -> str:
        """Authors, title, venue and year in one line."""
        return f"{self.authors}: {self.title}. {self.venue}, {self.year}"

    @property
    def short_citation(self) -> str:
        """Surnames of the authors and the year; of more than three authors the first alone is named."""
        names = [part.split()[-1] for part in self.authors.replace(" and ", ", ").split(", ") if part.strip()]
        if len(names) > 3:
            return f"{names[0]} and others {self.year}"
        *first, last = names
        return f"{', '.join(first)} and {last} {self.year}" if first else f"{last} {self.year}"

    @property
    def package(self) -> str:
        """Dotted name of its package."""
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
            A run of the scenario it shows; any run if it shows none.
        beside
            Runs of the further scenarios it shows, in their order.

        Raises
        ------
        InvalidInput
            If there is no such figure, the number of runs is wrong, or the run and the figure's scenario differ in
            having a leader.
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
