"""Where a result comes from: versions, engine, seed and time."""

from __future__ import annotations

import platform
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version

from flocking.model.law import Scenario


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
