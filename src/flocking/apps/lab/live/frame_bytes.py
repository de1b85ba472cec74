"""Frames as bytes for a page: a header in JSON, then arrays of 32 bits.

The length of the header, in bytes, stands in four bytes before it; it is padded so that the arrays begin at a multiple
of four. For each group they are positions relative to its centre, velocities, pairs of linked agents, the directions
that the header names, and, where it is stated there, the number of neighbours of each agent, its flock, energies, and
beta- and gamma-agents. Along an axis that repeats,
positions are those of the images in the box, and the centre is its middle.
"""

from __future__ import annotations

import json
import math
import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flocking.apps.lab.experiment.clock import Frame
from flocking.apps.lab.scene.solids import solids, virtual_agents
from flocking.arrays import Array
from flocking.model.graphs.connectivity import components
from flocking.model.law import Scenario
from flocking.model.space import Space
from flocking.model.state import State

LINK_BUDGET = 6000
"""Links that are drawn at most: more would delay the page and hide each other."""
OUTLINE_DIGITS = 6
"""Digits of the outline of an obstacle, relative to its size: a screen shows four."""
MOST_ENERGIES = 500
"""Agents up to which colours show energies: their cost grows with the number of pairs."""


@dataclass(frozen=True)
class RequestedParts:
    """What pages request of a frame beside its agents and links.

    Parameters
    ----------
    energies
        The potential energy of each agent.
    virtual_agents
        Beta- and gamma-agents.
    flocks
        The flock of each agent, where not all pairs are sent.
    """

    energies: bool = False
    virtual_agents: bool = False
    flocks: bool = False


def link_pairs(state: State, budget: int = LINK_BUDGET) -> tuple[NDArray[np.uint32], int]:
    """Linked pairs, shape (L, 2), at most ``budget`` of them evenly chosen; and how many there are.

    Parameters
    ----------
    state
        The state.
    """
    if state.links is None:
        return np.zeros((0, 2), dtype=np.uint32), 0
    i, j = np.nonzero(state.links)
    once = (i < j) | ~state.links[j, i]
    pairs = np.stack([i[once], j[once]], axis=1).astype(np.uint32)
    count = len(pairs)
    if count > budget:
        pairs = pairs[np.linspace(0, count - 1, budget).astype(np.intp)]
    return pairs, count


def placed(q: Array, space: Space) -> tuple[Array, Array, list[float | None]]:
    """Positions as they are drawn, what they are drawn around, and the lengths of the box, None on axes without end.

    Parameters
    ----------
    q
        Positions, shape (N, m).
    space
        The space of the agents.
    """
    here = np.asarray(q, dtype=np.float64) if space.is_open else space.wrapped(q)
    lengths = np.array(space.lengths or (np.inf,) * q.shape[1], dtype=np.float64)
    centre = np.where(np.isfinite(lengths), 0.5 * np.where(np.isfinite(lengths), lengths, 0.0), here.mean(axis=0))
    return here, centre, [float(x) if np.isfinite(x) else None for x in lengths]


def packed(frame: Frame, requested: RequestedParts, *, live: bool = True) -> bytes:
    """A frame as bytes.

    Parameters
    ----------
    requested
        What is added.
    live
        Whether it is the present one, not one of the record.
    """
    groups, arrays = [], []
    for state, scenario in zip(frame.states, frame.scenarios, strict=True):
        header, parts = _group(state, scenario, requested)
        groups.append(header)
        arrays += parts
    head = {"number": frame.number, "t": frame.time, "live": live, "groups": groups, "version": list(frame.versions)}
    text = json.dumps(head, allow_nan=False, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    return b"".join([struct.pack("<I", len(text)), text, *(np.ascontiguousarray(a).tobytes() for a in arrays)])


def _group(
    state: State, scenario: Scenario, requested: RequestedParts
) -> tuple[dict[str, object], list[NDArray[np.generic]]]:
    q, centre, box = placed(state.q, scenario.space)
    pairs, count = link_pairs(state)
    names = [name for name in scenario.agents.directions if state.columns[name].shape[1] == state.dimension]
    parts: list[NDArray[np.generic]] = [_single(q - centre), _single(state.p), pairs]
    parts += [_single(state.columns[name]) for name in names]
    header: dict[str, object] = {
        "n": state.n, "d": state.dimension, "centre": centre.tolist(), "links": len(pairs), "all_links": count,
        "linked": state.links is not None, "thinned": len(pairs) < count, "flock_labels": False,
        "velocities": scenario.agents.order > 1, "energies": False, "ghosts": 0, "box": box, "directions": names,
        "solids": [
            {
                "kind": x.kind, "path": list(x.path), "of": list(x.part), "position": x.position.tolist(),
                "outline": _rounded(x.outline), "radius": x.radius, "name": x.name,
            }
            for x in solids(scenario, state.t)
        ],
    }  # fmt: skip
    if state.links is not None:
        # Those whose states enter its force: links may be one-way.
        parts.append(state.links.sum(axis=1).astype(np.uint32))
        if requested.flocks and len(pairs) < count:
            header["flock_labels"] = True
            parts.append(components(state.links).astype(np.uint32))
    if requested.energies and state.n <= MOST_ENERGIES:
        from flocking.study.potentials.state_energy import agent_energies

        energies = agent_energies(scenario.law, state, scenario.energy, agents=scenario.agents, space=scenario.space)
        if np.isfinite(energies).all():
            header["energies"] = True
            parts.append(_single(energies))
    if requested.virtual_agents:
        ghosts = virtual_agents(scenario, state)
        header["ghosts"] = len(ghosts)
        parts.append(_single(ghosts - np.pad(centre, (0, max(0, 3 - len(centre))))[:3]))
    return header, parts


def _rounded(outline: Array) -> list[list[float]]:
    """Corners around a place with a few digits, whatever their unit."""
    size = float(np.abs(outline).max(initial=0.0))
    digits = OUTLINE_DIGITS - math.floor(math.log10(size)) if size > 0.0 else 0
    return [[round(x, digits) for x in corner] for corner in outline.tolist()]


def _single(values: Array) -> NDArray[np.float32]:
    return np.asarray(values, dtype=np.float32)
