"""Terms that can be added to any law, with parameters that fit it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flocking.model.law import Law
from flocking.model.leaders_and_obstacles.leaders import Sink, Velocity
from flocking.model.potentials.potential import Potential
from flocking.model.state import State
from flocking.model.terms.body_terms import Compensate, Track
from flocking.model.terms.pair_terms import Consensus, Gradient, Term

LEADER_GAINS = (0.1, 0.5)
"""Gains on position and velocity of a leader that is put in: nearly damped critically, 0.5^2 < 4 0.1, slower than the
terms between pairs."""


def _reach(law: Law, state: State) -> float:
    radius = float(np.max(np.asarray(law.graph.break_radius)))
    return radius if np.isfinite(radius) else max(1.0, float(np.ptp(state.q)) / 4)


def _spring(law: Law, state: State) -> Term:
    return Gradient(Potential("k*(r - d)**2/2", k=1.0, d=_reach(law, state) / 2))


def _sink(_: Law, state: State) -> Term:
    return Track(Sink(state.q.mean(axis=0)), *LEADER_GAINS)


def _moving_leader(_: Law, state: State) -> Term:
    return Track(Velocity(state.p.mean(axis=0), start=state.q.mean(axis=0), start_time=state.t), *LEADER_GAINS)


TERMS: dict[str, Callable[[Law, State], Term]] = {
    "consensus": lambda law, state: Consensus(1.0), "spring": _spring, "sink": _sink, "moving leader": _moving_leader,
    "compensation of damping": lambda law, state: Compensate(),
}  # fmt: skip
"""By the names a page shows."""
