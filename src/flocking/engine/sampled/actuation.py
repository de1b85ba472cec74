"""What bodies make of held forces: limits, gusts and a lag between the desired force and the point that moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array, Indices, Mask
from flocking.engine.protocol.body_chains import chain_of
from flocking.model.bodies.actuators import Lagged, Limited
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
        most = self.most[agents]
        if self.each_axis:
            return np.clip(force, -most, most)
        length = np.sqrt((force**2).sum(axis=1, keepdims=True))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(length > most, force * (most / length), force)


class Actuation:
    """The way from the forces that agents computed to what acts; of agents of order 1 velocities.

    Parameters
    ----------
    body
        What the agents are, see `flocking.engine.protocol.body_chains.check_bodies`.
    n, m
        Numbers of agents and axes.

    Attributes
    ----------
    gusts
        All sources of gusts.
    time_constant
        That of the lag, shape (N, 1); None where there is none.
    rate
        Largest rate of a lagged force, shape (N, 1); infinite where there is none.
    offset
        How far hand points lie in front of their axles, shape (N,); None where agents are no unicycles.
    """

    def __init__(self, body: Body, n: int, m: int) -> None:
        def each(value: float | Array | None) -> Array:
            return np.broadcast_to(np.asarray(value, dtype=np.float64), n)[:, None].copy()

        self._axes = m
        self.gusts: list[Gusts] = []
        self.time_constant: Array | None = None
        self.rate = np.full((n, 1), np.inf)
        chain, inner = chain_of(body)
        self.offset = each(inner.offset)[:, 0] if isinstance(inner, Unicycle) else None
        self._stages: list[_Limit | Gusts] = []
        """What happens to a force before it is lagged, in order."""
        self._beside: list[Gusts] = []
        """What is added to a lagged force."""
        last: list[_Limit] = []
        for part in chain:
            if isinstance(part, Disturbed):
                source = Gusts(part, part.period_in_nanoseconds, 0, np.zeros((n, m)))
                source.take(0)
                self.gusts.append(source)
                (self._stages if self.time_constant is None else self._beside).append(source)
            elif isinstance(part, Lagged):
                self.time_constant = each(part.time_constant)
            elif isinstance(part, Limited):
                if part.force is not None:
                    self._stages.append(_Limit(each(part.force), part.shape == "box"))
                if part.speed is not None:
                    last.insert(0, _Limit(each(part.speed), each_axis=False))
                if part.rate is not None:
                    self.rate = np.minimum(self.rate, each(part.rate))
        self._stages += last

    @property
    def largest_forces(self) -> tuple[Array, Mask]:
        """Limits in the order in which they act, shape (limits, N), and whether each axis is limited by itself.

        They are all that stands between a force and the motion where nothing is lagged and there are no gusts.
        """
        limits = [stage for stage in self._stages if isinstance(stage, _Limit)]
        most = np.array([x.most[:, 0] for x in limits]).reshape(len(limits), len(self.rate))
        return most, np.array([x.each_axis for x in limits], dtype=bool)

    def exerted(self, agents: Indices, force: Array) -> Array:
        """What ``agents`` exert of a ``force``, or what a lagged force tends to, shape (agents, m) each."""
        for stage in self._stages:
            force = stage.of(agents, force) if isinstance(stage, _Limit) else force + stage.values[agents]
        return force

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
