"""Reynolds: Flocks, Herds, and Schools: A Distributed Behavioral Model (SIGGRAPH 1987).

The paper describes rules in words. Parameters are those of its author's later open library, and of a public comparison
of frameworks for agent-based models.
"""

from __future__ import annotations

from flocking.papers.description import Paper
from flocking.papers.reynolds_1987.observations import Observed, observed
from flocking.papers.reynolds_1987.pictures import figures
from flocking.papers.reynolds_1987.rules import bird_force, boid_force, next_state
from flocking.papers.reynolds_1987.system import KEY, scenario, scenarios
from flocking.papers.reynolds_1987.theorems import claims

PAPER = Paper(
    key=KEY,
    title="Flocks, Herds, and Schools: A Distributed Behavioral Model",
    authors="C. W. Reynolds",
    year=1987,
    venue="Computer Graphics 21(4) (SIGGRAPH '87)",
    scenario=scenario,
    scenarios=scenarios,
    claims=claims,
    figures=figures,
    titles={
        "reynolds-1987": "200 boids with the parameters of the later library",
        "reynolds-1987-sequential": "The same, one after another as in the library",
        "reynolds-1987-comparison-small": "Comparison of frameworks, small: 200 birds",
        "reynolds-1987-comparison-large": "Comparison of frameworks, large: 400 birds",
    },
    questions={
        "reynolds-1987": "Do 200 boids that separate, align and stay close end as one polarised flock?",
        "reynolds-1987-sequential": "Does one polarised flock form, too, when boids move one after another?",
        "reynolds-1987-comparison-small": "Do 200 birds of speed 1 become one polarised flock?",
        "reynolds-1987-comparison-large": "Do 400 birds of speed 1 become one polarised flock?",
    },
)
TITLE, AUTHORS, YEAR = PAPER.title, PAPER.authors, PAPER.year
equations, errata, figure = PAPER.equations, PAPER.errata, PAPER.figure

__all__ = [
    "AUTHORS",
    "KEY",
    "PAPER",
    "TITLE",
    "YEAR",
    "Observed",
    "bird_force",
    "boid_force",
    "claims",
    "equations",
    "errata",
    "figure",
    "figures",
    "next_state",
    "observed",
    "scenario",
    "scenarios",
]
