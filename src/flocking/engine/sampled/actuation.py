"""What bodies make of held forces: limits, gusts and a lag between the desired force and the point that moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array, Indices, Mask
from flocking.engine.kernels.held_speeds import fit_speeds, speed_terms
from flocking.engine.protocol.body_chains import members_of
from flocking.model.bodies.actuators import Lagged, Limited, scaled_back
from flocking.model.bodies.body import Body
from flocking.model.bodies.disturbances import Disturbed
from flocking.model.bodies.unicycles import Unicycle


@dataclass
class Gusts:
    """One source of gusts.

    Parameters
    ----------
    body
        What it is of.
    period
        How long a gust lasts, in nanoseconds.
    number
        The gust in force.
    values
        What it adds to the force, shape (N, m).
    """

    body: Disturbed
    period: int
    number: int
    values: Array

    def take(self, number: int) -> None:
        """Let a gust be in force.

        Parameters
        ----------
        number
            Its number.
        """
        self.number = number
        sigma = np.broadcast_to(np.asarray(self.body.sigma, dtype=np.float64), len(self.values))[:, None]
        self.values = sigma * self.body.gust(number, *self.values.shape)


@dataclass(frozen=True)
class _Limit:
    """A largest force, or velocity of agents of order 1.

    Parameters
    ----------
    most
        Of each agent, shape (N, 1).
    each_axis
        Whether axes are limited one by one.
    """

    most: Array
    each_axis: bool

    def of(self, agents: Indices, force: Array) -> Array:
        """A force of ``agents`` scaled back to it, shape (agents, m)."""
        return scaled_back(force, self.most[agents], each_axis=self.each_axis)


@dataclass
class _Chain:
    """What happens to the forces of some agents before they act, or before they are lagged.

    Parameters
    ----------
    rows
        Whose they are, shape (N,).
    stages
        What happens, in order.
    """

    rows: Mask
    stages: list[_Limit | Gusts]

    def of(self, agents: Indices, force: Array) -> Array:
        """What becomes of a force of ``agents``, shape (agents, m)."""
        for stage in self.stages:
            force = stage.of(agents, force) if isinstance(stage, _Limit) else force + stage.values[agents]
        return force


class Actuation:
    """The way from the forces that agents computed to what acts; of agents of order 1 velocities.

    Parameters
    ----------
    body
        What the agents are, see `flocking.engine.protocol.body_chains.check_bodies`.
    n, m
        Numbers of agents and axes.
    periods
        How long each force is held, in seconds, one or one for each agent.

    Attributes
    ----------
    gusts
        All sources of gusts.
    time_constant
        That of the lag, shape (N, 1); None where there is none.
    rate
        Largest rate of a lagged force, shape (N, 1); infinite where there is none.
    offset
        How far hand points lie in front of their axles, shape (N,), infinite where agents are no unicycles; None where
        nobody is.
    speed
        Largest speeds of agents with inertia, shape (N,), infinite where there are none; None where nobody has one.
    speed_terms
        See `flocking.engine.kernels.held_speeds.speed_terms`.
    """

    def __init__(self, body: Body, n: int, m: int, periods: float | Array) -> None:
        def each(value: float | Array | None) -> Array:
            return np.broadcast_to(np.asarray(value, dtype=np.float64), n)[:, None].copy()

        self._axes = m
        self.gusts: list[Gusts] = []
        self.time_constant: Array | None = None
        self.rate = np.full((n, 1), np.inf)
        offset, speed = np.full(n, np.inf), np.full(n, np.inf)
        self._chains: list[_Chain] = []
        self._beside: list[Gusts] = []
        """What is added to a lagged force."""
        sources: dict[int, Gusts] = {}
        for who, chain, inner in members_of(body):
            rows = np.broadcast_to(who, n)
            stages: list[_Limit | Gusts] = []
            last: list[_Limit] = []
            if isinstance(inner, Unicycle):
                offset[rows] = each(inner.offset)[rows, 0]
            for part in chain:
                if isinstance(part, Disturbed):
                    # A body around a mixture is one source for all its chains.
                    source = sources.get(id(part))
                    if source is None:
                        source = sources[id(part)] = Gusts(part, part.period_in_nanoseconds, 0, np.zeros((n, m)))
                        source.take(0)
                        self.gusts.append(source)
                    (stages if self.time_constant is None else self._beside).append(source)
                elif isinstance(part, Lagged):
                    self.time_constant = each(part.time_constant)
                elif isinstance(part, Limited):
                    if part.force is not None:
                        stages.append(_Limit(each(part.force), part.shape == "box"))
                    if part.speed is not None and body.order == 1:
                        last.insert(0, _Limit(each(part.speed), each_axis=False))
                    elif part.speed is not None:
                        speed[rows] = np.minimum(speed, each(part.speed)[:, 0])[rows]
                    if part.rate is not None:
                        self.rate = np.minimum(self.rate, each(part.rate))
            self._chains.append(_Chain(rows, [*stages, *last]))
        self.offset = offset if np.isfinite(offset).any() else None
        self.speed = speed if np.isfinite(speed).any() else None
        self.speed_terms = speed_terms(body, n, periods) if body.order == 2 else np.zeros((2, n))

    @property
    def one_chain(self) -> bool:
        """Whether the same happens to the forces of all agents."""
        return len(self._chains) == 1

    @property
    def largest_forces(self) -> tuple[Array, Mask]:
        """Limits in the order in which they act, shape (limits, N), and whether each axis is limited by itself.

        They are all that stands between a force and the motion, but for `speed`, where there is one chain, nothing is
        lagged and there are no gusts.
        """
        limits = [stage for stage in self._chains[0].stages if isinstance(stage, _Limit)]
        most = np.array([x.most[:, 0] for x in limits]).reshape(len(limits), len(self.rate))
        return most, np.array([x.each_axis for x in limits], dtype=bool)

    def exerted(self, agents: Indices, force: Array, p: Array) -> Array:
        """What ``agents`` exert of a ``force``, or what a lagged force tends to, shape (agents, m) each.

        Parameters
        ----------
        p
            Their velocities when it begins to act, shape (agents, m).
        """
        if self.one_chain:
            found = self._chains[0].of(agents, force)
        else:
            found = np.array(force, dtype=np.float64)
            for chain in self._chains:
                mine = chain.rows[agents]
                found[mine] = chain.of(agents[mine], force[mine])
        if self.speed is not None:
            found = np.array(found, dtype=np.float64)
            terms = np.ascontiguousarray(self.speed_terms[:, agents])
            fit_speeds(np.ascontiguousarray(p, dtype=np.float64), found, self.speed[agents], terms)
        return found

    def beside(self, agents: Indices) -> Array | None:
        """What acts on ``agents`` beside a lagged force, shape (agents, m); None where nothing is lagged."""
        if self.time_constant is None:
            return None
        found = np.zeros((len(agents), self._axes))
        for source in self._beside:
            found = found + source.values[agents]
        return found

    def next_gust(self) -> int | None:
        """When a gust ends next, in nanoseconds; None where there are none."""
        return min(((g.number + 1) * g.period for g in self.gusts), default=None)

    def begin_gusts(self, instant: int) -> bool:
        """Let the gusts begin that begin at an ``instant``; whether there is one."""
        begun = [g for g in self.gusts if (g.number + 1) * g.period == instant]
        for source in begun:
            source.take(source.number + 1)
        return bool(begun)
