"""Verdicts of claims of papers over ten seeds that are stored in the library, and how they are computed again.

``make rates`` runs `make reproduce-all` and writes the file from its ``claims.json``.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from pathlib import Path

from flocking.formula.safe_digits import percent_text
from flocking.study.confidence_intervals import Interval, share_interval

FILE = "rates.json"
"""Name of the file in the folder of the papers."""


@dataclass(frozen=True)
class Rate:
    """How often a claim held over the seeds of a reproduction.

    Parameters
    ----------
    verdict
        Its verdict.
    held, decided, tried
        Numbers of seeds for which it held, for which it was decided, and that were tried. Those that are not decided
        do not meet its hypothesis, or are not resolved.
    """

    verdict: str
    held: int
    decided: int
    tried: int

    @property
    def interval(self) -> Interval:
        """95 % interval of the rate among those that are decided."""
        return share_interval(self.held, self.decided)

    @property
    def text(self) -> str:
        """Verdict and numbers in words, with the interval of the rate of an observation."""
        left = self.tried - self.decided
        counted = f"{self.held} of {self.decided} seeds" + (
            f" ({left} more decide{'s' * (left == 1)} nothing)" if left else ""
        )
        if self.verdict != OBSERVED or not self.decided:
            return f"{self.verdict}: {counted}"
        return f"{counted}: {percent_text(self.held / self.decided, self.interval.low, self.interval.high)}"


OBSERVED = "observed"
"""Verdict of claims without an expected one."""


@lru_cache(maxsize=1)
def _stored() -> dict[str, dict[str, list[str | int]]]:
    text = files("flocking.papers").joinpath(FILE).read_text(encoding="utf-8")
    found: dict[str, dict[str, list[str | int]]] = json.loads(text)
    return found


def stored_scenarios() -> tuple[str, ...]:
    """Names of the scenarios of which rates are stored."""
    return tuple(_stored())


def stored_rates(scenario: str) -> dict[str, Rate]:
    """Rates by the key of the claim; empty for a scenario of which none are stored.

    Parameters
    ----------
    scenario
        Name of the scenario.
    """
    rows = _stored().get(scenario, {})
    return {key: Rate(str(row[0]), *(int(x) for x in row[1:])) for key, row in rows.items()}


def as_text(rows: list[dict[str, object]]) -> str:
    """The text of the file, from the ``rows`` of ``claims.json`` of a reproduction: a claim a line."""
    found: dict[str, dict[str, list[object]]] = {}
    for row in rows:
        seeds = row["seeds"]
        assert isinstance(seeds, dict)
        numbers = [seeds[name] for name in ("held", "decided", "tried")]
        found.setdefault(str(row["scenario"]), {})[str(row["claim"])] = [row["verdict"], *numbers]
    blocks = [
        f"{json.dumps(name)}: {{\n" + ",\n".join(f" {json.dumps(k)}: {json.dumps(v)}" for k, v in of.items()) + "\n}"
        for name, of in found.items()
    ]
    return "{\n" + ",\n".join(blocks) + "\n}\n"


def write(claims: str | Path) -> None:
    """Write the stored file anew.

    Parameters
    ----------
    claims
        Path of the ``claims.json`` of a reproduction of all papers.
    """
    rows = json.loads(Path(claims).read_text(encoding="utf-8"))
    Path(str(files("flocking.papers").joinpath(FILE))).write_text(as_text(rows), encoding="utf-8")


if __name__ == "__main__":
    write(sys.argv[1])
