"""Links and pairs of a law as arrays that the native loop may change."""

from __future__ import annotations

import numpy as np

from flocking.engine.exact.blocks.arrays import Switching
from flocking.engine.exact.crossings.switching import LinkState
from flocking.engine.exact.crossings.watch_tables import BallWatches
from flocking.engine.exact.dynamics import Dynamics
from flocking.engine.kernels.law_kernels import Pairs


def switching_tables(dynamics: Dynamics, links: LinkState) -> Switching:
    """What switches of pairs of agents change.

    Parameters
    ----------
    dynamics, links
        The law in force and the links.
    """
    watches = [watch for _, watch, _, _ in links.watched()]
    owners = np.array([watch.graph for watch in watches], dtype=np.int64)
    kinks = np.array([watch.kind == "kink" for watch in watches], dtype=bool)
    # Pairs of agents and obstacles follow those of agents.
    jumping = np.array([bool(watch.rise) or not watch.inner for watch in links.watches], dtype=bool)
    barred = [watch.kind == "link" and dynamics.barriers[watch.graph] for watch in watches]
    walls = [bar and bool((w.enter >= w.leave).any()) for bar, w in zip(barred, watches, strict=True)]
    directed = np.array([graph.directed for graph in links.graphs], dtype=bool)
    return Switching(
        not links.averages, np.array(links.links), directed, owners, kinks, jumping, np.array(walls, dtype=bool),
        float(dynamics.scenario.energy.unlinked),
    )  # fmt: skip


def with_room(pairs: Pairs, graphs: int, n: int, balls: BallWatches) -> Pairs:
    """The pairs in arrays that have room for all pairs of all graphs, and of all agents and balls.

    Parameters
    ----------
    pairs
        Those now.
    graphs, n
        Numbers of graphs and of agents.
    balls
        What agents meet.
    """
    count = len(pairs.senders)
    room = count + graphs * n * (n - 1) + n * int(balls.counts.sum())
    senders, sensed = np.empty(room, dtype=np.int64), np.empty(room, dtype=np.int64)
    pieces = np.empty(room, dtype=np.int32)
    senders[:count], sensed[:count], pieces[:count] = pairs.senders, pairs.sensed, pairs.pieces
    return Pairs(senders, sensed, np.array(pairs.offsets, dtype=np.int64), pieces, pairs.spans)


def without_room(pairs: Pairs) -> Pairs:
    """The ``pairs`` in use of those that `with_room` gave."""
    end = pairs.offsets[-1]
    return pairs._replace(senders=pairs.senders[:end], sensed=pairs.sensed[:end], pieces=pairs.pieces[:end])
