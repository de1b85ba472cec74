"""The papers: scenarios, claims, figures and equation tables, one folder each."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flocking.papers.description import Paper

KEYS = ("olfati-saber-2003", "tanner-2003-fixed", "tanner-2003-dynamic", "zhou-2015", "shi-2009")
"""Keys of the papers that are reproduced by default, in this order."""

STANDARD_KEYS = ("olfati-saber-2006", "cucker-smale-2007", "vicsek-1995", "reynolds-1987", "vasarhelyi-2018")
"""Keys of further standard laws of the literature, which are reproduced on demand."""

ALL_KEYS = (*KEYS, *STANDARD_KEYS)
"""Keys of all papers of the library."""

_added: dict[str, Paper] = {}


def keys() -> tuple[str, ...]:
    """Keys of all papers: those of the library, then those that were added."""
    return (*ALL_KEYS, *_added)


def default_keys() -> tuple[str, ...]:
    """Keys of the papers that are reproduced if none is named: `KEYS`, then those that were added."""
    return (*KEYS, *_added)


def add_paper(paper: Paper) -> None:
    """Register a paper of another package for audits, lists of scenarios, and reproduction.

    Parameters
    ----------
    paper
        The paper; ``home`` is the dotted name of its package.

    Raises
    ------
    InvalidInput
        If the library has a paper with its key, or names of its scenarios do not begin with the key.
    """
    from flocking.errors import InvalidInput

    if paper.key in ALL_KEYS or not paper.home:
        raise InvalidInput("add_paper", "key", "must be a new one, of a paper with a home", paper.key)
    if odd := [name for name in paper.scenarios() if name != paper.key and not name.startswith(f"{paper.key}-")]:
        raise InvalidInput("add_paper", "scenarios", f"must have names that begin with {paper.key}", odd[0])
    _added[paper.key] = paper


def paper(key: str) -> Paper:
    """A paper by its key.

    Raises
    ------
    InvalidInput
        If there is no such paper.
    """
    if key in _added:
        return _added[key]
    if key not in ALL_KEYS:
        from flocking.errors import InvalidInput

        raise InvalidInput("papers", "key", f"must be one of {', '.join(keys())}", key)
    found: Paper = _package(key).PAPER
    return found


def _package(key: str) -> ModuleType:
    return import_module(f"flocking.papers.{key.replace('-', '_')}")


def paper_of(scenario: str) -> str:
    """Key of the paper of a scenario, by its name; empty if there is none."""
    return max((key for key in keys() if scenario == key or scenario.startswith(f"{key}-")), key=len, default="")


def __getattr__(name: str) -> ModuleType:
    if name.replace("_", "-") in ALL_KEYS:
        return _package(name)
    raise AttributeError(f"module 'flocking.papers' has no attribute {name!r}")
