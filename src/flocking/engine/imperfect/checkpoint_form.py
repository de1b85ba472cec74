"""The form of what sessions of imperfect worlds have in common in a checkpoint, for a given scenario."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import cast

from flocking.arrays import Array, Links
from flocking.engine.archives.archive import Arrays
from flocking.engine.archives.data_checks import And, Form, MalformedError, Names, Real, squarable
from flocking.engine.imperfect.session import NUMBERS
from flocking.model.graphs.distance_graphs import Graph

LARGEST = squarable("f8")
"""Bound on positions, velocities and forces."""

MOST_COUNT = 2**61
"""Largest count or nanosecond in a checkpoint, so that sums of two stay within 64 bits."""

ROUNDED = 1e-14
"""Largest relative difference of two representations of one time."""

NEAR = 1e-6
"""By how much a distance may differ from one that it must have, relative to it and to the size of the coordinates."""

LATER = "gains_changed"
"""A number that checkpoints did not have before gains could change."""


def must(fits: object, name: str, rule: str) -> None:
    """Refuse a checkpoint unless something ``fits``; ``name`` and ``rule`` are for the message."""
    if not fits:
        raise MalformedError(f"{name} must {rule}")


def checked_numbers(
    data: object, base: float, t_end: float, more: Mapping[str, Form[object]] | None = None
) -> dict[str, float]:
    """The numbers of a checkpoint, after checks of each.

    Parameters
    ----------
    data
        What was read.
    base, t_end
        When the scenario begins and ends.
    more
        Forms of numbers beside `NUMBERS`, by their names.
    """
    ends = And(Real(least=base, finite=False), "not be NaN", lambda x: not math.isnan(x))
    free = Real(finite=False)
    positive = And(Real(least=0.0, finite=False), "not be NaN", lambda x: not math.isnan(x))
    forms: dict[str, Form[object]] = {
        "time": Real(base, t_end), "steps": Real(0.0, float(MOST_COUNT)), "accounted": Real(0.0),
        LATER: Real(0.0, float(MOST_COUNT)),
        "largest_power": positive, "ledger_ends": ends,
    }  # fmt: skip
    every = {name: forms.get(name, free) for name in NUMBERS} | dict(more or {})
    later: dict[str, Form[object]] = {LATER: every.pop(LATER)}
    return cast(dict[str, float], Names(every, later).check(data, ""))


def check_links(arrays: Arrays, graphs: Sequence[Graph], headings: Array | None, start: Links) -> None:
    """Refuse arrays ``links`` and ``known_links`` that are no links of these graphs.

    Parameters
    ----------
    graphs, headings
        The graphs of the law, and the headings of the agents.
    start
        Links at the start, shape (graphs, N, N).
    """
    for name in ("links", "known_links"):
        for k, (graph, links) in enumerate(zip(graphs, arrays[name], strict=True)):
            rule, where = f"be links of a {type(graph).__name__} graph", f"{name}[{k}]"
            must(not links.diagonal().any(), where, rule)
            must(graph.moves or (links == start[k]).all(), where, rule)
            must(graph.directed or name == "known_links" or (links == links.T).all(), where, rule)
            allowed = graph.allowed(headings)
            must(allowed is None or not (links & ~allowed).any(), where, rule)


def check_closest(closest: Array, n: int, accounted: float) -> None:
    """Refuse rows that cannot be the closest pairs of ``n`` agents until a time ``accounted`` since the start."""
    for square, time, i, j in closest.tolist():
        nobody = square == math.inf and math.isnan(time) and i == j == -1.0
        pair = square >= 0.0 and 0.0 <= time <= accounted and i in range(n) and j in range(n) and i < j
        must(nobody or pair, "closest", "name a pair, its squared distance and a time until now, or none")
