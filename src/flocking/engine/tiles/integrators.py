"""Fixed-step schemes: what one step does to the crowd and to the integrals of the ledger.

Arrays of agents hold position and velocity. Agents of order 1 have no velocity of their own; theirs is that of the last
step, which no formula reads: neighbour lists and checks do.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TypedDict

import numpy as np

from flocking.arrays import Array, Reals
from flocking.engine.tiles.kernels.tile_sums import SUMS
from flocking.engine.tiles.particles.particle_arrays import ParticleArrays
from flocking.formula.native.functions import native

INTEGRATED = ("work", "dissipated", "supplied")
"""Sums of the kernel that the ledger integrates over time."""


@dataclass
class LedgerSums:
    """The energy ledger of a crowd while it runs.

    Parameters
    ----------
    integrals
        Work, dissipation and supply until now.
    jumped
        Energy that appeared or vanished where links switched.
    sums
        Energies and powers at one moment, until which the integrals reach.
    ahead
        What a step integrated beyond that moment.
    """

    integrals: Array = field(default_factory=lambda: np.zeros(3))
    jumped: float = 0.0
    sums: dict[str, float] = field(default_factory=dict)
    ahead: Array = field(default_factory=lambda: np.zeros(3))

    def copy(self) -> LedgerSums:
        """A copy that shares nothing."""
        return LedgerSums(self.integrals.copy(), self.jumped, dict(self.sums), self.ahead.copy())

    def catch_up(self) -> None:
        """Count what a step has integrated beyond the time of the sums."""
        self.integrals, self.ahead = self.integrals + self.ahead, np.zeros(3)

    def read(self, particles: ParticleArrays) -> Array:
        """Take the sums of the last pass, in a fixed order of tiles; returns the three powers."""
        totals = particles.sums.sum(axis=0)
        self.sums = dict(zip(SUMS, (float(x) for x in totals), strict=False))
        # Of velocities relative to the mean half a step ago; the mean has moved since.
        self.sums["kinetic"] -= 0.5 * float((totals[len(SUMS) :] ** 2).sum()) / particles.parameters.mass
        return np.array([self.sums[name] for name in INTEGRATED])


class IntegratorMemory(TypedDict):
    """What a fixed-step integrator must know to go on: its last step, whether that is counted, and the ledger."""

    last: float
    counted: bool
    books: LedgerSums


class Integrator(ABC):
    """A fixed-step integrator of a crowd.

    `begin` looks at the state of the present step (forces, energies, closest pair) without moving it;
    `step` moves. Both leave the agents' velocities as `velocities_lag` says.

    Parameters
    ----------
    ledger
        Whether energies are summed on the way.
    """

    order: int
    """Order of convergence for laws whose forces depend on velocities."""

    def __init__(self, ledger: bool) -> None:
        self.ledger = ledger
        self.ledger_sums = LedgerSums()
        self.last = 0.0
        self.counted = False

    @abstractmethod
    def step(self, particles: ParticleArrays, t: float, h: float) -> None:
        """Advance by ``h`` from time ``t``; the old state stays in ``particles.Y``."""

    @abstractmethod
    def look(self, particles: ParticleArrays, t: float, h: float) -> Reals:
        """Velocities at the time of the positions, shape (m, size), and books up to date; ``h`` the coming step."""

    def _count(self, particles: ParticleArrays, duration: float) -> None:
        """Add the powers of the pass just made to the ledger, once a step."""
        if not self.ledger:
            return
        powers = self.ledger_sums.read(particles)
        if not self.counted:
            self.ledger_sums.integrals = self.ledger_sums.integrals + duration * powers
            self.counted = True
        self.ledger_sums.jumped += self.ledger_sums.sums["jumped"]

    def memory(self) -> IntegratorMemory:
        """What the scheme must know to go on."""
        return {"last": self.last, "counted": self.counted, "books": self.ledger_sums.copy()}

    def recall(self, memory: IntegratorMemory) -> None:
        """Go back to ``memory``."""
        ledger_sums = memory["books"]
        self.last, self.counted = memory["last"], memory["counted"]
        self.ledger_sums = ledger_sums.copy()


class Verlet(Integrator):
    """Half-step-velocity Verlet: velocities lie half a step behind positions, as in LAMMPS.

    Order 2 where forces depend on positions alone, order 1 with velocity-dependent forces. With ``damped`` the
    agent's own damping (neighbours' velocities held) is integrated exactly: stable for any strength of damping.
    """

    order = 1

    def step(self, particles: ParticleArrays, t: float, h: float) -> None:
        """Kick by half the last and half the coming step, drift by the coming one."""
        particles.require_lists(h)
        particles.move(t, keep=1.0, kick=0.5 * (self.last + h), drift=h, velocity_lag=0.5 * self.last)
        self._count(particles, self.last)
        particles.swap(h)
        self.last, self.counted = h, False

    def look(self, particles: ParticleArrays, t: float, h: float) -> Reals:
        """Half a kick, without a drift, beside the state."""
        particles.require_lists(h)
        particles.move(t, keep=1.0, kick=0.5 * self.last, drift=0.0, velocity_lag=0.5 * self.last)
        self._count(particles, self.last)
        return particles.Y[particles.m :] if self.last else particles.X[particles.m :]


class Euler(Integrator):
    """The forward Euler method for agents of order 1: q' = q + h u(q). Links are held during a step.

    Order 1. The ledger's integrals are taken by the same rule, and close to that order.
    """

    order = 1

    def step(self, particles: ParticleArrays, t: float, h: float) -> None:
        """Drift by the control at the begin of the step."""
        particles.require_lists(h)
        self.ledger_sums.catch_up()
        particles.move(t, keep=0.0, kick=1.0, drift=h, exponential_damping=0.0)
        if self.ledger:
            self.ledger_sums.ahead = h * self.ledger_sums.read(particles)
            self.ledger_sums.jumped += self.ledger_sums.sums["jumped"]
        particles.swap(h)
        self.last, self.counted = h, False

    def look(self, particles: ParticleArrays, t: float, h: float) -> Reals:
        """One pass without a move; agents of order 1 have no velocity."""
        return _looked(self, particles, t, h)


@native
def _combine(first, last, base, gained, agents, slopes, weight, ahead, begin):  # type: ignore[no-untyped-def]
    """Add a stage's slope (velocity of ``agents``, acceleration in ``slopes``) to the gain; set the next stage."""
    m = agents.shape[1] // 2
    for i in range(first, last):
        for k in range(m):
            speed, pull = agents[i, m + k], slopes[i, m + k]
            if begin:
                gained[i, k] = weight * speed
                gained[i, m + k] = weight * pull
            else:
                gained[i, k] += weight * speed
                gained[i, m + k] += weight * pull
            agents[i, k] = base[i, k] + ahead * speed
            agents[i, m + k] = base[i, m + k] + ahead * pull


@native
def _combine_flow(first, last, base, gained, agents, slopes, weight, ahead, begin):  # type: ignore[no-untyped-def]
    """The same for agents of order 1, whose velocity lies in ``slopes``."""
    m = agents.shape[1] // 2
    for i in range(first, last):
        for k in range(m):
            speed = slopes[i, m + k]
            if begin:
                gained[i, k] = weight * speed
            else:
                gained[i, k] += weight * speed
            agents[i, k] = base[i, k] + ahead * speed


def _looked(scheme: Integrator, particles: ParticleArrays, t: float, h: float) -> Reals:
    """Velocities of agents after a pass that moves nobody, from which the ledger is brought up to date."""
    particles.require_lists(h)
    particles.move(t, keep=0.0, kick=1.0, drift=0.0, exponential_damping=0.0)
    if scheme.ledger:
        scheme.ledger_sums.catch_up()
        scheme.ledger_sums.read(particles)
        scheme.ledger_sums.jumped += scheme.ledger_sums.sums["jumped"]
    velocities = particles.X[particles.m :]
    return velocities if particles.spec.order == 2 else np.zeros_like(velocities)


class RungeKutta(Integrator):
    """Classical Runge-Kutta of order 4 with a fixed step, for agents of either order; links are held during a step.

    Order 4 between switches; the ledger's integrals are taken by the same rule.
    """

    order = 4
    _stages = ((1.0 / 6.0, 0.5, 0.0), (1.0 / 3.0, 0.5, 0.5), (1.0 / 3.0, 1.0, 0.5), (1.0 / 6.0, 0.0, 1.0))
    """Weight, reach of the next stage, and time of each stage, in steps."""

    def step(self, particles: ParticleArrays, t: float, h: float) -> None:
        """Four passes; where a stage strays too far for the lists, they are rebuilt with a wider skin."""
        particles.require_lists(h)
        self.ledger_sums.catch_up()
        self._jumped = 0.0
        for attempt in range(6):
            base = particles.agents.copy()
            if self._try(particles, t, h, base):
                particles.successor = base
                self.last, self.counted = h, False
                return
            displacement = particles.displacement_bound()
            particles.agents[:] = base
            wider = (
                None
                if attempt == 0
                else max(2.0 * particles.displacement.skin, 2.5 * displacement)
                if np.isfinite(displacement)
                else None
            )
            particles.rebuild(h, skin=wider)
        raise FloatingPointError("stages stray further than any skin")

    def _try(self, particles: ParticleArrays, t: float, h: float, base: Reals) -> bool:
        T = particles.dtype
        gained, second = np.empty_like(base), particles.spec.order == 2
        combine = _combine if second else _combine_flow
        powers = np.zeros(3)
        for number, (weight, ahead, when) in enumerate(self._stages):
            particles.move(t + when * h, keep=0.0, kick=1.0, drift=0.0, exponential_damping=0.0, hold=number > 0)
            if self.ledger:
                if number == 0:
                    first = self.ledger_sums.read(particles)
                    powers += weight * first
                    # A repeated step finds its links switched already.
                    self._jumped += self.ledger_sums.sums["jumped"]
                    sums_before = dict(self.ledger_sums.sums)
                else:
                    powers += weight * self.ledger_sums.read(particles)
            if number == 0:
                tile_extremes = particles.tile_extremes.copy()
            both = particles.agents, particles.successor
            particles.workers.each(
                combine, particles.size, base, gained, *both, T(weight * h), T(ahead * h), number == 0
            )
            if number == 3 and second:
                np.add(base, gained, out=particles.agents)
            elif number == 3:
                m = particles.m
                np.add(base[:, :m], gained[:, :m], out=particles.agents[:, :m])
                np.divide(gained[:, :m], T(h), out=particles.agents[:, m:])
            if particles.obstacles is not None:
                particles.obstacles.used = np.inf
            particles.displacement.bound = np.inf
            if not particles.usable() and number < 3:
                return False
        square = (particles.X[particles.m :, : particles.n] - particles.displacement.velocity[:, None]).astype(
            np.float64
        ) ** 2
        particles.tile_extremes[:] = tile_extremes
        top = square.sum(axis=0).max()
        particles.tile_extremes[0, 0] = top if np.isfinite(top) else np.inf
        particles.read_tile_extremes()
        particles.top_speed = float(np.sqrt(top))
        particles.displacement.elapsed += h
        particles.displacement.bound = np.inf if particles.moving else 0.0
        if self.ledger:
            self.ledger_sums.ahead = h * powers
            self.ledger_sums.jumped += self._jumped
            self.ledger_sums.sums = sums_before
        return True

    def look(self, particles: ParticleArrays, t: float, h: float) -> Reals:
        """One pass without a move; velocities are those of the state, of agents of order 1 zero."""
        return _looked(self, particles, t, h)


def integrator_named(name: str, ledger: bool) -> Integrator:
    """The scheme of a name among the ``SCHEMES`` of `flocking.engine.tiles.kernels.spec`.

    Parameters
    ----------
    ledger
        Whether energies are summed on the way.
    """
    kinds: dict[str, type[Integrator]] = {"rk4": RungeKutta, "euler": Euler}
    return kinds.get(name, Verlet)(ledger)
