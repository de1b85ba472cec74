"""Combined equation tables of several papers."""

from __future__ import annotations

from collections.abc import Sequence

from flocking.papers import keys as all_keys
from flocking.papers import paper
from flocking.papers.equation_table import Row


def equation_table(keys: Sequence[str] | None = None) -> list[Row]:
    """All rows of the named papers, in the papers' order.

    Parameters
    ----------
    keys
        Keys of the papers; all by default.

    Raises
    ------
    InvalidInput
        If a key is unknown.
    """
    return [row for key in (all_keys() if keys is None else keys) for row in paper(key).equations()]
