"""Requests of the world to an agent and its answers, as JSON: numbers keep their bits."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from typing import TypedDict

from flocking.engine.nodes.nodes import Node, Sample
from flocking.errors import FlockingError

LONGEST = 64_000_000
"""Bytes of the longest message that is read: a scenario with its start."""


class Request(TypedDict, total=False):
    """A request to an agent.

    ``do`` is ``"measure"``, for which ``number``, ``now``, ``q`` and ``p`` state what its sensors read, or ``"act"``,
    for which ``heard`` are samples that have arrived since the last time.
    """

    do: str
    now: int
    number: int
    q: list[float]
    p: list[float]
    heard: list[list[object]]


class Answer(TypedDict, total=False):
    """What it answers: its sample, or its force, its links and what its safety filter did, or why there is none."""

    sample: list[object]
    force: list[float]
    links: list[list[int]]
    filtered: list[bool]
    fault: str


def packed(data: Mapping[str, object]) -> bytes:
    """Data as bytes."""
    return json.dumps(data).encode()


def unpacked(data: bytes) -> dict[str, object]:
    """Data from bytes; empty where they are none."""
    if len(data) > LONGEST:
        return {}
    try:
        found = json.loads(data)
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def row_of(sample: Sample) -> list[object]:
    """A sample as a list."""
    return [sample.sender, sample.number, sample.stamp, list(sample.q), list(sample.p)]


def sample_of(row: list[object]) -> Sample:
    """A sample from a list.

    Parameters
    ----------
    row
        The list.
    """
    sender, number, stamp, q, p = row
    assert isinstance(sender, int)
    assert isinstance(number, int)
    assert isinstance(stamp, int)
    assert isinstance(q, list)
    assert isinstance(p, list)
    return Sample(sender, number, stamp, tuple(map(float, q)), tuple(map(float, p)))


def well_formed(found: object, agent: int, request: Request, sizes: tuple[int, int, int]) -> bool:
    """Whether an answer is one to a request: a fault, or numbers of the right shapes and ranges.

    Parameters
    ----------
    found
        What came.
    agent
        The agent of the request.
    request
        The request.
    sizes
        Numbers of axes, of agents and of graphs.
    """
    m, n, graphs = sizes
    if not isinstance(found, dict):
        return False
    if "fault" in found:
        return isinstance(found["fault"], str)
    if request["do"] == "measure":
        row = found.get("sample")
        known = [agent, request["number"], request["now"]]
        return isinstance(row, list) and len(row) == 5 and row[:3] == known and all(_numbers(x, m) for x in row[3:])
    links, filtered = found.get("links"), found.get("filtered")
    return (
        _numbers(found.get("force"), m)
        and isinstance(links, list) and len(links) == graphs
        and all(isinstance(row, list) and all(type(j) is int and 0 <= j < n for j in row) for row in links)
        and isinstance(filtered, list) and len(filtered) == 2 and all(type(x) is bool for x in filtered)
    )  # fmt: skip


def _numbers(found: object, count: int) -> bool:
    """Whether something is a list of so many finite numbers."""
    return (
        isinstance(found, list)
        and len(found) == count
        and all(type(x) in (int, float) and abs(x) <= sys.float_info.max for x in found)
    )


def answer(node: Node, request: Request) -> Answer:
    """What an agent answers.

    Parameters
    ----------
    node
        The agent.
    request
        The request.
    """
    now, q, p = request["now"], request["q"], request["p"]
    if request["do"] == "measure":
        return {"sample": row_of(Sample(node.agent, request["number"], now, tuple(q), tuple(p)))}
    try:
        for row in request.get("heard", []):
            node.hear(sample_of(row), now)
        force = node.act(now, q, p).tolist()
        return {"force": force, "links": node.links, "filtered": list(node.filtered)}
    except FlockingError as error:
        return {"fault": str(error)}
