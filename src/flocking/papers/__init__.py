"""The papers: scenarios, claims, figures and equation tables, one folder each."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flocking.papers.description import Paper

KEYS = ("olfati-saber-2003", "tanner-2003-fixed", "tanner-2003-dynamic", "zhou-2015", "shi-2009")
"""Keys of the papers, in the order they are reproduced."""


def paper(key: str) -> Paper:
    """A paper by its key.

    Raises
    ------
    InvalidInput
        When there is no such paper.
    """
    if key not in KEYS:
        from flocking.errors import InvalidInput

        raise InvalidInput("papers", "key", f"must be one of {', '.join(KEYS)}", key)
    found: Paper = _package(key).PAPER
    return found


def _package(key: str) -> ModuleType:
    return import_module(f"flocking.papers.{key.replace('-', '_')}")


def paper_of(scenario: str) -> str:
    """Key of the paper a scenario belongs to by its name; empty when it belongs to none."""
    return max((key for key in KEYS if scenario == key or scenario.startswith(f"{key}-")), key=len, default="")


def __getattr__(name: str) -> ModuleType:
    if name.replace("_", "-") in KEYS:
        return _package(name)
    raise AttributeError(f"module 'flocking.papers' has no attribute {name!r}")
