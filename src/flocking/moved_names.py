"""Names that documentation has stated and that have moved: the old place warns and gives what is at the new one."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from importlib import import_module

MOVED: Mapping[str, Mapping[str, str]] = {
    "flocking.engine": {
        "companion": "flocking.engine.exact.companion", "run": "flocking.engine.runs.run",
    },
    "flocking.engine.exact": {"ExactSession": "flocking.engine.exact.session.ExactSession"},
    "flocking.model": {"avoidance": "flocking.model.terms.avoidance"},
    "flocking.model.graphs": {"Hysteresis": "flocking.model.graphs.distance_graphs.Hysteresis"},
    "flocking.model.terms": {"Gradient": "flocking.model.terms.pair_terms.Gradient"},
    "flocking.study": {
        "settled_run": "flocking.study.claims.settled_run", "settling": "flocking.study.claims.settling",
    },
    "flocking.study.claims": {"Claim": "flocking.study.claims.claim.Claim"},
    "flocking.study.nets": {"laplacian": "flocking.study.nets.matrices.laplacian"},
}  # fmt: skip
"""For each package the names that were there, and the modules, classes and functions that they stand for now."""


def found(place: str) -> object:
    """The module, or the class or function of a module, at a place.

    Parameters
    ----------
    place
        Its name with dots.
    """
    try:
        return import_module(place)
    except ModuleNotFoundError:
        module, _, name = place.rpartition(".")
        return getattr(import_module(module), name)


def moved_from(package: str) -> Callable[[str], object]:
    """The function ``__getattr__`` of a package that names have left.

    Parameters
    ----------
    package
        Name of the package, a key of `MOVED`.
    """
    names = MOVED[package]

    def moved(name: str) -> object:
        if name not in names:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        warnings.warn(f"{package}.{name} has moved to {names[name]}.", DeprecationWarning, stacklevel=2)
        return found(names[name])

    return moved
