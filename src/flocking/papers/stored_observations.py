"""Quantities observed over seeds that are stored in the library, and how they are computed again.

``python -m flocking.papers.stored_observations`` runs the scenarios and writes the files anew.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import TypedDict

import numpy as np

from flocking.engine.driver.simulate import simulate
from flocking.errors import InvalidInput
from flocking.model.checks import Array, one_of
from flocking.papers import paper
from flocking.study.confidence_intervals import Interval, mean_interval

FILE = "observed.json"
"""Name of the file in the folder of a paper."""

OBSERVING = ("reynolds-1987", "vasarhelyi-2018")
"""Papers of which quantities are observed: those that prove nothing. Their modules `observations` name them."""

SEEDS = range(10)
"""Seeds of the stored values, those of `make reproduce-all`."""


@dataclass(frozen=True, eq=False)
class Observations:
    """Values of quantities of one scenario, one for each seed.

    Parameters
    ----------
    scenario
        Name of the scenario.
    seeds
        The seeds.
    values
        Values by the name of the quantity, one for each seed; NaN where a run has none.
    """

    scenario: str
    seeds: tuple[int, ...]
    values: Mapping[str, Array]

    def mean(self, name: str) -> float:
        """Mean over the seeds; NaN where no run has a value.

        Parameters
        ----------
        name
            Name of the quantity.
        """
        found = self._of(name)
        return float(found.mean()) if len(found) else float("nan")

    def interval(self, name: str, level: float = 0.95) -> Interval:
        """Interval of the mean over runs.

        Parameters
        ----------
        name
            Name of the quantity.
        level
            Level of confidence.
        """
        return mean_interval(self._of(name), level)

    def _of(self, name: str) -> Array:
        one_of("Observations", "name", name, self.values)
        found = self.values[name]
        return np.asarray(found[~np.isnan(found)])


class _File(TypedDict):
    """Content of a file: the seeds, and values by scenario and quantity."""

    seeds: list[int]
    scenarios: dict[str, dict[str, list[float | None]]]


def observe(name: str, seeds: Sequence[int] = SEEDS) -> Observations:
    """Run a scenario with several seeds and observe its quantities.

    Parameters
    ----------
    name
        Name of a scenario of a paper in `OBSERVING`.
    seeds
        The seeds.

    Raises
    ------
    InvalidInput
        When no quantities of that scenario are observed.
    """
    key = _key(name)
    made, quantities = paper(key).scenarios()[name], import_module(f"{paper(key).package}.observations").quantities
    rows = [quantities(simulate(made(seed), progress=False)) for seed in seeds]
    return Observations(name, tuple(seeds), {each: np.array([row[each] for row in rows]) for each in rows[0]})


def stored_observations(name: str) -> Observations:
    """The values of a scenario that come with the library.

    Parameters
    ----------
    name
        Name of a scenario of a paper in `OBSERVING`.

    Raises
    ------
    InvalidInput
        When no quantities of that scenario are observed.
    """
    found = _stored(_key(name))
    one_of("stored_observations", "name", name, found["scenarios"])
    rows = found["scenarios"][name]
    values = {each: np.array([np.nan if x is None else x for x in row]) for each, row in rows.items()}
    return Observations(name, tuple(found["seeds"]), values)


def observed_scenarios(key: str) -> tuple[str, ...]:
    """Names of the scenarios of a paper of which quantities are observed.

    Parameters
    ----------
    key
        Key of the paper.
    """
    return tuple(import_module(f"{paper(key).package}.observations").OBSERVED) if key in OBSERVING else ()


def _key(name: str) -> str:
    for key in OBSERVING:
        if name in observed_scenarios(key):
            return key
    known = ", ".join(each for key in OBSERVING for each in observed_scenarios(key))
    raise InvalidInput("observations", "scenario", f"must be one of {known}", name)


def _file(key: str) -> Traversable:
    return files(paper(key).package).joinpath(FILE)


@lru_cache(maxsize=len(OBSERVING))
def _stored(key: str) -> _File:
    found: _File = json.loads(_file(key).read_text(encoding="utf-8"))
    return found


DIGITS = 6
"""Significant digits of stored values: far more than their intervals resolve."""


def as_text(found: Sequence[Observations]) -> str:
    """Observations of the scenarios of a paper, all ``found`` with the same seeds, as the text of its file."""
    rows = {
        each.scenario: {
            name: [None if np.isnan(x) else float(f"{x:.{DIGITS}g}") for x in values]
            for name, values in each.values.items()
        }
        for each in found
    }
    return json.dumps({"seeds": list(found[0].seeds), "scenarios": rows}, indent=1, allow_nan=False) + "\n"


def write(keys: Sequence[str] = OBSERVING) -> None:
    """Run the scenarios of the papers named by ``keys``, and write their files anew."""
    for key in keys:
        found = [observe(name) for name in observed_scenarios(key)]
        Path(str(_file(key))).write_text(as_text(found), encoding="utf-8")


if __name__ == "__main__":
    write()
