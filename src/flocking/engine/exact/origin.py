"""Origin of a running simulation in space and time, so that translations and Galilean shifts lose no digits.

A session computes in coordinates relative to its origin. Its own time is 0 at the start of the run. If the law is
invariant under translations, positions are relative to a point in the middle of the group; if it is also invariant
under Galilean transformations, that point moves with the group.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from flocking.engine.kernels.ledger_rows import momentum_of
from flocking.model.checks import Array
from flocking.model.law import Law, Scenario
from flocking.model.state import State
from flocking.model.terms.body_terms import Compensate
from flocking.model.terms.pair_terms import PairTerm

OriginData = tuple[float, tuple[float, ...], tuple[float, ...], float]
"""An origin as plain data: its fields in order."""

QUANTUM = 4.0
"""Width of the grid of origins relative to the group; it is a power of two, so that subtracting an origin does not
round, and a group near the origin of its coordinates keeps them.
"""


@dataclass(frozen=True, eq=False)
class Origin:
    """An origin that moves uniformly.

    Parameters
    ----------
    time
        The time at which the session's own time is 0.
    place
        Where the origin is at its own time ``since``, shape (m,).
    velocity
        Its velocity, shape (m,).
    since
        See ``place``.
    """

    time: float
    place: Array
    velocity: Array
    since: float = 0.0

    def own_time(self, t: float) -> float:
        """The session's own time at time ``t``."""
        return t - self.time

    def time_at(self, own: float) -> float:
        """Time at the session's own time."""
        return own + self.time

    def latest(self, own: float) -> float:
        """The latest time that is not after the session's own time ``own``: own times are finer than times."""
        t = self.time_at(own)
        return t if self.own_time(t) <= own else float(np.nextafter(t, -np.inf))

    def at(self, own: float) -> Array:
        """Where the origin is at the session's own time, shape (m,)."""
        return self.place + self.velocity * (own - self.since)

    @cached_property
    def rests(self) -> bool:
        """Whether it is the origin of the user's coordinates."""
        return not (self.place.any() or self.moves)

    @cached_property
    def moves(self) -> bool:
        """Whether it has a velocity."""
        return bool(self.velocity.any())

    def inwards(self, state: State) -> State:
        """A state in the session's own time and coordinates."""
        own = self.own_time(state.t)
        if self.rests:
            return replace(state, t=own)
        return replace(state, q=state.q - self.at(own), p=state.p - self.velocity, t=own)

    def outwards(self, own: float, q: Array, p: Array) -> tuple[Array, Array]:
        """Positions and velocities in the user's coordinates, shape (N, m) each.

        Parameters
        ----------
        q, p
            Those relative to the origin.
        own
            The session's own time.
        """
        return (q, p) if self.rests else (q + self.at(own), p + self.velocity)

    def rounded(self, own: float, position: float, velocity: float) -> tuple[float, float]:
        """Errors of a position and a velocity in the user's coordinates, from those relative to the origin.

        Parameters
        ----------
        own
            The session's own time.
        """
        if self.rests:
            return position, velocity
        sizes = (np.abs(x).max(initial=0.0) for x in (self.at(own), self.velocity))
        q, p = (float(np.finfo(float).eps * size) for size in sizes)
        return position + q, velocity + p

    def added(self, scenario: Scenario, p: Array, begin: Array) -> tuple[float, float, float]:
        """Differences of kinetic energy, work and supply in the user's coordinates from those in the session's.

        Parameters
        ----------
        p
            Velocities relative to the origin, shape (N, m).
        begin
            Momentum relative to the origin when it came into use, shape (m,).
        """
        if not self.moves:
            return 0.0, 0.0, 0.0
        now = momentum(scenario, p)
        work = float(self.velocity @ (now - begin))
        if scenario.energy.frame != "lab":
            return 0.0, work, 0.0
        mass = float(np.broadcast_to(scenario.agents.masses, len(p)).sum())
        return float(self.velocity @ now + 0.5 * mass * (self.velocity @ self.velocity)), work, work

    def packed(self) -> OriginData:
        """As plain data."""
        return self.time, tuple(self.place.tolist()), tuple(self.velocity.tolist()), self.since

    @classmethod
    def unpacked(cls, data: OriginData) -> Origin:
        """From plain ``data``."""
        time, place, velocity, since = data
        return cls(time, np.array(place), np.array(velocity), since)


def origin_of(scenario: Scenario, plant: Law | None, state: State, time: float) -> Origin:
    """The origin for a run that begins at a state.

    Parameters
    ----------
    scenario, plant
        Scenario and plant. With a plant both laws must allow the origin.
    state
        The state.
    time
        The time at which the session's own time is 0.
    """
    zero = np.zeros(state.dimension)
    place = _middle(state.q) if all(knows_no_place(law, scenario) for law in _laws(scenario, plant)) else zero
    velocity = _middle(state.p) if all(knows_no_velocity(law, scenario) for law in _laws(scenario, plant)) else zero
    return Origin(time, place, velocity, state.t - time)


def may_have(scenario: Scenario, plant: Law | None, origin: Origin) -> bool:
    """Whether a run may keep an origin that was chosen for another law."""
    laws = _laws(scenario, plant)
    place = not origin.place.any() or all(knows_no_place(law, scenario) for law in laws)
    return place and (not origin.moves or all(knows_no_velocity(law, scenario) for law in laws))


def _laws(scenario: Scenario, plant: Law | None) -> list[Law]:
    return [scenario.law] if plant is None else [scenario.law, plant]


def momentum(scenario: Scenario, p: Array) -> Array:
    """Momentum of agents with velocities ``p`` of shape (N, m), shape (m,)."""
    return momentum_of(np.full(len(p), scenario.agents.masses, dtype=np.float64), p)


def knows_no_place(law: Law, scenario: Scenario) -> bool:
    """Whether the law and the energy of a scenario are invariant under translations of space and time."""
    alike = all(isinstance(term, PairTerm | Compensate) for term in law.terms)
    return alike and scenario.energy.leader is None and scenario.agents.homogeneous


def knows_no_velocity(law: Law, scenario: Scenario) -> bool:
    """Whether the law is also invariant under Galilean transformations."""
    return knows_no_place(law, scenario) and scenario.agents.inert and "galilean" in law.symmetries


def _middle(points: Array) -> Array:
    mean = points.mean(axis=0)
    spread = float(np.abs(points - mean).max(initial=0.0))
    if not np.isfinite(mean).all():
        return np.zeros_like(mean)
    if spread == 0.0:
        return np.array(points[0])
    quantum = QUANTUM * 2.0 ** np.ceil(np.log2(spread))
    return np.asarray(quantum * np.round(mean / quantum))
