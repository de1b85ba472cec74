"""Equation tables of several papers, put together."""

from __future__ import annotations

from collections.abc import Sequence

from flocking.papers import KEYS, paper
from flocking.study.equation_table import Row


def equation_table(keys: Sequence[str] = KEYS) -> list[Row]:
    """All rows of the named papers, in the papers' order.

    Parameters
    ----------
    keys
        Keys of the papers.

    Raises
    ------
    InvalidInput
        When a key is unknown.
    """
    return [row for key in keys for row in paper(key).equations()]
