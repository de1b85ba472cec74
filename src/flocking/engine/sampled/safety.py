"""The safety filter of held control: conditions on accelerations, and the acceleration that it takes instead."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array, Links
from flocking.engine.imperfect.messages.knowledge import Known
from flocking.engine.sampled.nearest_force import nearest
from flocking.engine.sampled.stopping import Planes, beside_balls, between, stopping_acceleration, stopping_paths
from flocking.errors import NotFinite, UnsupportedLaw
from flocking.model.bodies.point_bodies import is_point_mass
from flocking.model.law import Scenario
from flocking.model.space import Space
from flocking.model.world.safety_filters import SafetyFilter
from flocking.model.world.times import NANOSECOND

TOO_LONG = 1e-9
"""Share of the largest acceleration by which one may be longer: what rounding adds to its length."""

ASKED = 1e6
"""Largest acceleration that a condition requires, in those with which both agents can brake: for two that are too close
it would be larger."""


@dataclass
class FilterMemory:
    """What a safety filter goes on from.

    Parameters
    ----------
    normals
        Unit vectors of each ordered pair along which the two can brake, from j to i, shape (N, N, m).
    changed, relaxed
        How often the force of an agent was changed, and how often its conditions contradicted each other.
    first_relaxed
        When they first did, in nanoseconds from the start; -1 if never.
    """

    normals: Array
    changed: int = 0
    relaxed: int = 0
    first_relaxed: int = -1


def sampled_bound(r: Array, closing: Array, braking: Array, distance: Array, period: float) -> Array:
    """Least relative acceleration along a line, held for a period, after which two agents can still brake in time.

    Parameters
    ----------
    r, closing
        Distances along the line, and speeds at which they shrink.
    braking
        Sums of the largest accelerations of both.
    distance
        Distances before which they can brake.
    period
        The period.
    """
    gap = r - distance - 0.5 * closing * period
    # After the period they close in at y, and need y^2/(2 braking): r - (closing + y) period/2 - y^2/(2 braking) >= D.
    last = -0.5 * braking * period + np.sqrt(0.25 * (braking * period) ** 2 + 2.0 * braking * np.maximum(gap, 0.0))
    going_on = (closing - last) / period
    # They turn round within the period.
    room = np.maximum(r - distance, 0.0)
    with np.errstate(all="ignore"):
        turning = np.where(closing > 0.0, closing**2 / (2.0 * room), -np.inf)
    bound = np.where(gap >= 0.0, going_on, turning)
    return np.clip(np.where(np.isnan(bound), braking, bound), -ASKED * braking, ASKED * braking)


def continuous_bound(dp: Array, dv: Array, braking: Array, distance: float, gain: float) -> Array:
    """Least relative acceleration along the line of two agents by the condition in continuous time.

    Parameters
    ----------
    dp, dv
        Relative positions and velocities, from j to i, shape (K, m).
    braking
        As for `sampled_bound`.
    distance
        The distance that is kept.
    gain
        Gain of the condition.
    """
    r = np.linalg.norm(dp, axis=1)
    with np.errstate(all="ignore"):
        opening = (dp * dv).sum(axis=1) / r
        root = np.sqrt(2.0 * braking * (r - distance))
        across = ((dv**2).sum(axis=1) - opening**2) / r
        bound = -(gain * (root + opening) ** 3 + across + braking * opening / root)
    return np.clip(np.where(np.isfinite(bound), bound, braking), -ASKED * braking, ASKED * braking)


def check_filter(scenario: Scenario) -> None:
    """Refuse a safety filter of bodies that do not brake as it assumes.

    Parameters
    ----------
    scenario
        A scenario whose control is a safety filter.

    Raises
    ------
    UnsupportedLaw
        When there are such bodies.
    """
    bodies = scenario.agents
    if not is_point_mass(bodies) or np.any(np.asarray(bodies.damping)):
        raise UnsupportedLaw("SafetyFilter is for undamped point masses, which brake by their force alone.")


class ForceFilter:
    """The safety filter of a session.

    Parameters
    ----------
    control
        The filter.
    masses
        Masses of the agents, shape (N,).
    q
        Positions at the start, shape (N, m).
    space
        Space of the agents.
    start
        The scenario's time at the start.
    """

    def __init__(self, control: SafetyFilter, masses: Array, q: Array, space: Space, start: float = 0.0) -> None:
        self.control, self.space, self._start = control, space, start
        n, m = q.shape
        self.masses = np.broadcast_to(np.asarray(masses, dtype=np.float64), n)
        self.most = control.accelerations(n)
        # As it is, in whole nanoseconds, not as it was written.
        self.period: Array = np.asarray(control.schedule(n).period * NANOSECOND, dtype=np.float64)
        self.memory = FilterMemory(np.zeros((n, n, m)))

    def filtered(self, time: int, known: Known, force: Array) -> Array:
        """Forces of the agents that act now, shape (agents, m).

        Parameters
        ----------
        time
            Now, in nanoseconds from the start.
        known
            What they know.
        force
            Forces of the law on them, shape (agents, m).

        Raises
        ------
        NotFinite
            When numbers are too large to compute a force with: none is let through unfiltered.
        """
        m = force.shape[1]
        found = np.empty_like(force)
        with np.errstate(over="ignore", invalid="ignore"):
            positions = known.positions(m)
        for row, i in enumerate(known.agents.tolist()):
            mass, most = float(self.masses[i]), float(self.most[i])
            try:
                # An infinite number on the way can end as a finite one that means nothing.
                with np.errstate(over="raise", invalid="raise"):
                    desired = force[row] / mass
                    used, fits = self._accelerated(row, i, known, positions[row], desired)
                    size = float(np.linalg.norm(used))
                    changed = bool((used != desired).any())
                    found[row] = mass * used if changed else force[row]
                fault = not (np.isfinite(found[row]).all() and size <= most * (1.0 + TOO_LONG))
            except (FloatingPointError, OverflowError):
                fault = True
            if fault:
                raise NotFinite(
                    "The safety filter cannot compute a force: a position, a velocity or a force is too large or NaN.",
                    time=self._start + time * NANOSECOND, agents=(i,),
                )  # fmt: skip
            if not fits:
                self.memory.relaxed += 1
                if self.memory.first_relaxed < 0:
                    self.memory.first_relaxed = time
            self.memory.changed += changed
        return found

    def _accelerated(self, row: int, i: int, known: Known, place: Array, desired: Array) -> tuple[Array, bool]:
        """The acceleration of agent i instead of the desired one, and whether no condition was relaxed."""
        m, most = len(desired), float(self.most[i])
        others = known.there[row].copy()
        others[i] = False
        dp = -self.space.displacement(place - known.own[row, :m])[others]
        dv = known.own[row, m:] - known.rows[row, others, m:]
        if not (np.isfinite(desired).all() and np.isfinite(dp).all() and np.isfinite(dv).all()):
            raise FloatingPointError
        if self.control.form == "stopping":
            planes = self._planes(i, others, dp, known.rows[row, others, m:], known.own[row])
            own = np.asarray(known.own[row, m:])
            period = float(self.period[i])
            return stopping_acceleration(desired, own, planes, most, period, self.control.distance)
        normals, bounds = self._conditions(i, others, dp, dv)
        return nearest(desired, normals, bounds, most)

    def _planes(self, i: int, others: Links, dp: Array, v: Array, own: Array) -> Planes:
        """Planes that agent i keeps, relative to its position: one for each other agent and for each obstacle."""
        control, period, m = self.control, float(self.period[i]), dp.shape[1]
        path = stopping_paths(own[None, m:], float(self.most[i]), period)[0]
        paths = stopping_paths(v, self.most[others], np.asarray(self.period[others]))
        found = between(path, -dp, paths, control.guarded_distance)
        balls, walls = control.balls, control.walls
        if balls:
            centres = np.array([b.centre.at(0.0)[0] for b in balls]) - own[:m]
            radii = np.array([b.radius for b in balls])
            found = found.joined(beside_balls(path, centres, radii, control.guarded_clearance))
        if walls:
            normals = np.array([w.normal for w in walls])
            places = np.array([w.point.at(0.0)[0] for w in walls]) - own[:m]
            found = found.joined(Planes(normals, (normals * places).sum(axis=1) + control.guarded_clearance))
        return found

    def _conditions(self, i: int, others: Links, dp: Array, dv: Array) -> tuple[Array, Array]:
        """Unit vectors and least accelerations along them that agent i takes, one for each other agent."""
        control, own = self.control, self.most[i]
        braking = own + self.most[others]
        r = np.linalg.norm(dp, axis=1)
        # The line to an agent that is not known any more is dropped, as its link is.
        self.memory.normals[i, ~others] = 0.0
        held = self.memory.normals[i, others]
        apart = r > 0.0
        line = np.where(apart[:, None], dp / np.where(apart, r, 1.0)[:, None], held)
        if control.form == "continuous":
            return line, own / braking * continuous_bound(dp, dv, braking, control.guarded_distance, control.gain)
        choices = []
        for normal in (line, held):
            along, closing = (normal * dp).sum(axis=1), -(normal * dv).sum(axis=1)
            known = (normal**2).sum(axis=1) > 0.5
            choices.append((np.where(known, control.reserve(along, closing, braking), -np.inf), along, closing))
        better = choices[1][0] > choices[0][0]
        normals = np.where(better[:, None], held, line)
        left, along, closing = (np.where(better, b, a) for a, b in zip(*choices, strict=True))
        self.memory.normals[i, others] = normals
        period = float(self.period[i])
        floor = control.guarded_distance + np.maximum(left, 0.0) * np.exp(-control.gain * period)
        bound = sampled_bound(along, closing, braking, floor, period)
        return normals, own / braking * bound


def filter_counts(keeper: ForceFilter | None, base: float) -> dict[str, object]:
    """What a safety filter did, for the provenance of a run.

    Parameters
    ----------
    keeper
        The filter, where there is one.
    base
        The scenario's time at the start.
    """
    if keeper is None:
        return {}
    memory = keeper.memory
    found = {"forces changed by the safety filter": memory.changed, "its conditions relaxed": memory.relaxed}
    return found | ({"first relaxed at": base + memory.first_relaxed * NANOSECOND} if memory.relaxed else {})
