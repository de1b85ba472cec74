"""Margins of the papers' first scenarios that are stored in the library, and how they are computed again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from flocking.errors import InvalidInput
from flocking.papers import KEYS
from flocking.papers.margins import VARIED, margins
from flocking.study.margins.margin_table import Margins, margins_from

FILE = "margins.json"
"""Name of the file in the folder of a paper."""


@dataclass(frozen=True)
class MarginPlan:
    """What a stored table is computed from, as `flocking.papers.margins.margins` takes it.

    Parameters
    ----------
    levels
        Levels of the first grid by quantity; each quantity in it is varied.
    seeds
        Number of seeds, or the seeds.
    width
        Width of a bracket at which bisection ends; near 1 there is none.
    t_end
        End of the runs; that of the scenario when absent.
    most_runs
        Largest number of runs.
    reason
        Why the seeds or the end are other than those of the other plans, in a sentence; the report prints it.
    """

    levels: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    seeds: int | tuple[int, ...] = 3
    width: float = 0.99
    t_end: float | None = None
    most_runs: int = 200
    reason: str = ""

    @property
    def chosen_seeds(self) -> tuple[int, ...]:
        """The seeds."""
        return tuple(range(self.seeds)) if isinstance(self.seeds, int) else self.seeds


SMALL_GROUP = {
    "period": (0.2, 0.5, 1.0), "delay": (0.01, 0.05, 0.2), "loss": (0.1, 0.4, 0.8), "noise": (0.001, 0.01, 0.1),
    "limit": (5.0, 1.0, 0.2),
}  # fmt: skip
"""Levels for ten agents that settle in 100 units of time: about three for a quantity, a factor of 2 to 10 apart."""

LARGE_GROUP = {
    "period": (0.05, 0.1, 0.2), "delay": (0.02, 0.05, 0.2), "loss": (0.1, 0.4, 0.8), "noise": (0.001, 0.01, 0.1),
    "limit": (50.0, 10.0, 2.0),
}  # fmt: skip
"""The same for a hundred agents: there is no bisection, for runs of those that pass obstacles take over ten seconds."""

CONNECTED_SEEDS = (6, 7, 10, 14, 16)
"""The first seeds of Shi's start from which the ideal graph stays connected, and forces and velocities settle by then.

Of the seeds 0 to 399 the graph stays connected for 109 in the first 3 of 100 units of time, and for none from 0 to 5;
seed 9 is the one between 6 and 16 from which it does and forces have not settled.
"""

PLANS = {
    "olfati-saber-2003": MarginPlan(LARGE_GROUP, most_runs=48),
    "tanner-2003-fixed": MarginPlan(SMALL_GROUP, seeds=5, width=0.3, most_runs=400),
    "tanner-2003-dynamic": MarginPlan(SMALL_GROUP, seeds=5, width=0.3, most_runs=800),
    "zhou-2015": MarginPlan(SMALL_GROUP, seeds=5, width=0.3, most_runs=800),
    "shi-2009": MarginPlan(
        SMALL_GROUP,
        seeds=CONNECTED_SEEDS,
        width=0.3,
        most_runs=800,
        reason="Seeds are the first from which the graph of the ideal run stays connected, as the theorems suppose, "
        "and its limit is reached at t = 100, the paper's end; from seeds 0 to 5 the graph falls apart, and nothing "
        "but that agents stay apart could be judged.",
    ),
}
"""Plans by the keys of the papers. Of three seeds that all show a conclusion the interval begins at 0.29."""


def computed_margins(
    key: str, *, out: str | Path | None = None, workers: int | None = None, progress: bool = True
) -> Margins:
    """The table of a paper, computed now from its plan.

    Parameters
    ----------
    key
        Key of the paper.
    out
        Folder of the runs; the same call goes on with those that it holds.
    workers, progress
        As for `flocking.papers.margins.margins`.

    Raises
    ------
    InvalidInput
        When no plan of that paper is known.
    """
    plan = _plan(key)
    varied = [name for name in VARIED if name in plan.levels]
    return margins(
        key, varied, seeds=plan.chosen_seeds, levels=dict(plan.levels), width=plan.width, t_end=plan.t_end,
        most_runs=plan.most_runs, out=out, workers=workers, progress=progress,
    )  # fmt: skip


def is_stored(key: str) -> bool:
    """Whether a table of a paper comes with the library.

    Parameters
    ----------
    key
        Key of the paper.
    """
    return key in PLANS and _file(key).is_file()


@lru_cache(maxsize=len(KEYS))
def stored_margins(key: str) -> Margins:
    """The table of a paper that comes with the library; its provenance names the versions that made it.

    Parameters
    ----------
    key
        Key of the paper.

    Raises
    ------
    InvalidInput
        When no table of that paper is stored.
    """
    if not is_stored(key):
        stored = ", ".join(filter(is_stored, PLANS))
        raise InvalidInput("margins", "papers", f"must be of {stored}", key, "flocking margins KEY computes others.")
    return margins_from(json.loads(_file(key).read_text(encoding="utf-8")))


def _file(key: str) -> Traversable:
    return files(f"flocking.papers.{key.replace('-', '_')}").joinpath(FILE)


def _plan(key: str) -> MarginPlan:
    if key not in PLANS:
        raise InvalidInput("margins", "papers", f"must be of {', '.join(PLANS)}", key)
    return PLANS[key]


def reason_of_plan(key: str) -> str:
    """Why the plan of a paper has other seeds or another end than the others; empty where it has not.

    Parameters
    ----------
    key
        Key of the paper.

    Raises
    ------
    InvalidInput
        When no plan of that paper is known.
    """
    return _plan(key).reason


def as_text(table: Margins) -> str:
    """A ``table`` as the text of its file."""
    return json.dumps(table.as_dict(), indent=1, allow_nan=False, ensure_ascii=False) + "\n"
