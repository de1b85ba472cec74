"""Documented names that have moved: the old name warns and gives the object at the new place."""

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
"""For each package its former names, and the modules, classes and functions that they now refer to."""


def found(place: str) -> object:
    """The module, or the class or function of a module, with the dotted name ``place``."""
    try:
        return import_module(place)
    except ModuleNotFoundError:
        module, _, name = place.rpartition(".")
        return getattr(import_module(module), name)


def moved_from(package: str) -> Callable[[str], object]:
    """The function ``__getattr__`` of a ``package`` that names have left, a key of `MOVED`."""
    names = MOVED[package]

    def moved(name: str) -> object:
        if name not in names:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        warnings.warn(f"{package}.{name} has moved to {names[name]}.", DeprecationWarning, stacklevel=2)
        return found(names[name])

    return moved
