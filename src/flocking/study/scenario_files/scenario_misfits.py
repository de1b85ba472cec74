"""Inconsistencies between valid parts of a scenario file: numbers of agents, dimensions, times."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TypeVar

from flocking.errors import InvalidInput
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.leaders_and_obstacles.leaders import Leader
from flocking.model.scenario_numbers import checked_end, checked_frames, checked_tolerance
from flocking.model.state import Agents, State
from flocking.model.terms.avoidance import ObstacleTerm
from flocking.model.terms.pair_terms import Term
from flocking.study.scenario_files.problems import Problem, problem_of

T = TypeVar("T")


def misfits(parts: Mapping[str, object], data: Mapping[str, object]) -> Iterator[Problem]:
    """Every inconsistency between parts.

    Parameters
    ----------
    parts
        The valid fields of the scenario.
    data
        The file, for the time of a start that has faults.
    """
    start = parts.get("start")
    if isinstance(start, State):
        yield from _group_misfits(parts, start)
    yield from _time_misfits(parts, start.t if isinstance(start, State) else _start_time(data))


def _group_misfits(parts: Mapping[str, object], start: State) -> Iterator[Problem]:
    for place, owner in _owners(parts):
        try:
            owner.check_count(start.n)
        except InvalidInput as error:
            yield problem_of(error, f"{place}.{error.parameter}")
        except (ArithmeticError, MemoryError):
            yield Problem(place, f"needs more memory than there is for {start.n} agents")
        if isinstance(owner, ObstacleTerm):
            try:
                owner.check_dimension(start.dimension)
            except InvalidInput as error:
                yield problem_of(error, f"{place}.obstacles")
        leader = getattr(owner, "leader", None)
        if isinstance(leader, Leader) and leader.dimension != start.dimension:
            rule = f"must have {start.dimension} components, as the agents have"
            yield Problem(f"{place}.leader", rule, str(leader.dimension))


def _owners(parts: Mapping[str, object]) -> Iterator[tuple[str, Graph | Agents | Term]]:
    """Parts that depend on the number of agents, each with its place."""
    terms = parts.get("terms")
    found = [("graph", parts.get("graph")), ("agents", parts.get("agents"))]
    for k, term in enumerate(terms if isinstance(terms, Sequence) else ()):
        found += [(f"terms[{k}]", term), (f"terms[{k}].over", getattr(term, "over", None))]
    for place, owner in found:
        if isinstance(owner, Graph | Agents | Term):
            yield place, owner


def _time_misfits(parts: Mapping[str, object], start: float) -> Iterator[Problem]:
    found: list[Problem] = []
    end = _tried(found, "t_end", parts, lambda t: checked_end(t, start))
    last = math.inf if end is None else end
    _tried(found, "tolerance", parts, checked_tolerance)
    frames = parts.get("frames")
    if isinstance(frames, int | list):
        _tried(found, "frames", parts, lambda _: checked_frames(frames, start, last))
    yield from found


def _tried(found: list[Problem], name: str, parts: Mapping[str, object], check: Callable[[object], T]) -> T | None:
    if name not in parts:
        return None
    try:
        return check(parts[name])
    except InvalidInput as error:
        found.append(problem_of(error, name))
        return None


def _start_time(data: Mapping[str, object]) -> float:
    table = data.get("start")
    t = table.get("t", 0.0) if isinstance(table, dict) else -math.inf
    return float(t) if isinstance(t, int | float) and not isinstance(t, bool) else -math.inf
