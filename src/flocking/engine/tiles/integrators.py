"""Fixed-step integrators: the update of the particle arrays and of the integrals of the ledger.

Arrays of agents contain positions and velocities. For agents of order 1 the velocity is that of the last step; it is
read by neighbour lists and checks, but by no formula.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TypedDict

import numpy as np

from flocking.arrays import Array, Reals
from flocking.engine.tiles.kernels.spec import KernelSpec
from flocking.engine.tiles.kernels.tile_sums import SUMS
from flocking.engine.tiles.particles.particle_arrays import ParticleArrays
from flocking.formula.native.functions import native
from flocking.model.law import Scenario

SKIN_SPARE = 2.5
"""Ratio of a new skin to the displacement of a stage that left the lists; half of the skin exceeds it by a fourth."""

INTEGRATED = ("work", "dissipated", "supplied")
"""Sums of the kernel that are integrated over time."""


@dataclass
class LedgerSums:
    """Sums and integrals of the energy ledger.

    Parameters
    ----------
    integrals
        Work, dissipation and supply so far, and where agents are more than points what departed.
    jumped
        Change of energy at switches of links so far.
    sums
        Energies and powers at the time up to which the integrals are computed.
    ahead
        Integrals of the last step beyond that time.
    """

    integrals: Array = field(default_factory=lambda: np.zeros(len(INTEGRATED)))
    jumped: float = 0.0
    sums: dict[str, float] = field(default_factory=dict)
    ahead: Array = field(default_factory=lambda: np.zeros(len(INTEGRATED)))

    def copy(self) -> LedgerSums:
        """A deep copy."""
        return LedgerSums(self.integrals.copy(), self.jumped, dict(self.sums), self.ahead.copy())

    def catch_up(self) -> None:
        """Add the integrals of the last step beyond the time of the sums."""
        self.integrals, self.ahead = self.integrals + self.ahead, np.zeros_like(self.ahead)

    def read(self, particles: ParticleArrays) -> Array:
        """Add up the sums of the last pass in a fixed order of tiles; returns the powers, see `integrals`."""
        totals = particles.total_sums()
        self.sums = dict(zip(SUMS, (float(x) for x in totals), strict=False))
        powers = [self.sums[name] for name in INTEGRATED]
        if particles.spec.departs:
            powers.append(float(totals[-1]))
            totals = totals[:-1]
        # Velocities were taken relative to the mean of half a step before, which has changed since.
        self.sums["kinetic"] -= 0.5 * float((totals[len(SUMS) :] ** 2).sum()) / particles.parameters.mass
        return np.array(powers)


class IntegratorMemory(TypedDict):
    """State of a fixed-step integrator, by its names in files: the last step, whether the ledger has it, the ledger."""

    last: float
    counted: bool
    books: LedgerSums


class Integrator(ABC):
    """Base class of the fixed-step integrators.

    `look` evaluates forces, energies and the closest pair of the current state without changing it;
    `step` advances it.

    Parameters
    ----------
    ledger
        Whether energies are summed.
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
        """Velocities at the time of the positions, shape (m, size), with the ledger updated; ``h`` is the next step."""

    def change_gains(
        self, particles: ParticleArrays, scenario: Scenario, before: float, t: float, h: float
    ) -> None:  # fmt: skip
        """Use the values of scheduled gains from time ``t`` on; what they change of stored energies is a jump.

        Parameters
        ----------
        particles
            The agents at this time.
        scenario
            Has the gains.
        before
            Time from which the values of now were used.
        t
            The time.
        h
            The next step.
        """
        end = float(np.nextafter(t, np.inf))
        if not (self.ledger and any(term.switch_times(before, end) for term in scenario.law.body_terms)):
            particles.pass_switch_time(scenario, t)
            return
        self.look(particles, t, h)
        stored = self.ledger_sums.sums["bodies"]
        particles.pass_switch_time(scenario, t)
        self.look(particles, t, h)
        self.ledger_sums.jumped += self.ledger_sums.sums["bodies"] - stored

    def _count(self, particles: ParticleArrays, duration: float) -> None:
        """Add the powers of the last pass to the ledger, once per step."""
        if not self.ledger:
            return
        powers = self.ledger_sums.read(particles)
        if not self.counted:
            self.ledger_sums.integrals = self.ledger_sums.integrals + duration * powers
            self.counted = True
        self.ledger_sums.jumped += self.ledger_sums.sums["jumped"]

    def memory(self) -> IntegratorMemory:
        """The state of the integrator for a checkpoint."""
        return {"last": self.last, "counted": self.counted, "books": self.ledger_sums.copy()}

    def recall(self, memory: IntegratorMemory) -> None:
        """Restore the state from ``memory``."""
        ledger_sums = memory["books"]
        self.last, self.counted = memory["last"], memory["counted"]
        self.ledger_sums = ledger_sums.copy()


class Verlet(Integrator):
    """Half-step-velocity Verlet: velocities lag half a step behind positions, as in LAMMPS.

    Order 2 where forces depend on positions alone, order 1 with velocity-dependent forces. With ``damped`` the
    agent's own damping (neighbours' velocities held) is integrated exactly: stable for any strength of damping.
    """

    order = 1

    def step(self, particles: ParticleArrays, t: float, h: float) -> None:
        """Kick by half the last and half the next step, drift by the next step."""
        particles.require_lists(h)
        particles.move(t, keep=1.0, kick=0.5 * (self.last + h), drift=h, velocity_lag=0.5 * self.last)
        self._count(particles, self.last)
        particles.swap(h)
        self.last, self.counted = h, False

    def look(self, particles: ParticleArrays, t: float, h: float) -> Reals:
        """Half a kick without a drift; the state is not changed."""
        particles.require_lists(h)
        particles.move(t, keep=1.0, kick=0.5 * self.last, drift=0.0, velocity_lag=0.5 * self.last)
        self._count(particles, self.last)
        return particles.Y[particles.m :] if self.last else particles.X[particles.m :]


class Euler(Integrator):
    """The forward Euler method for agents of order 1: q' = q + h u(q). Links are held during a step.

    Order 1. The integrals of the ledger use the same rule and have the same order.
    """

    order = 1

    def step(self, particles: ParticleArrays, t: float, h: float) -> None:
        """Drift with the control at the start of the step."""
        particles.require_lists(h)
        self.ledger_sums.catch_up()
        particles.move(t, keep=0.0, kick=1.0, drift=h, exponential_damping=0.0)
        if self.ledger:
            self.ledger_sums.ahead = h * self.ledger_sums.read(particles)
            self.ledger_sums.jumped += self.ledger_sums.sums["jumped"]
        particles.swap(h)
        self.last, self.counted = h, False

    def look(self, particles: ParticleArrays, t: float, h: float) -> Reals:
        """One pass that does not change the state; agents of order 1 have no velocity."""
        return _looked(self, particles, t, h)


@native
def _combine(first, last, base, gained, agents, slopes, weight, ahead, begin):  # type: ignore[no-untyped-def]
    """Add a stage's slope (velocity of ``agents``, acceleration in ``slopes``) to the sum; set the next stage."""
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
    """The same for agents of order 1, whose velocity is in ``slopes``."""
    m = agents.shape[1] // 2
    for i in range(first, last):
        for k in range(m):
            speed = slopes[i, m + k]
            if begin:
                gained[i, k] = weight * speed
            else:
                gained[i, k] += weight * speed
            agents[i, k] = base[i, k] + ahead * speed


def _looked(integrator: Integrator, particles: ParticleArrays, t: float, h: float) -> Reals:
    """Velocities of agents after a pass that does not change the state; updates the ledger."""
    particles.require_lists(h)
    particles.move(t, keep=0.0, kick=1.0, drift=0.0, exponential_damping=0.0)
    if integrator.ledger:
        integrator.ledger_sums.catch_up()
        integrator.ledger_sums.read(particles)
        integrator.ledger_sums.jumped += integrator.ledger_sums.sums["jumped"]
    velocities = particles.X[particles.m :]
    return velocities if particles.spec.order == 2 else np.zeros_like(velocities)


class RungeKutta(Integrator):
    """Classical Runge-Kutta of order 4 with a fixed step, for agents of either order; links are held during a step.

    Order 4 between switches; the integrals of the ledger use the same rule.
    """

    order = 4
    _stages = ((1.0 / 6.0, 0.5, 0.0), (1.0 / 3.0, 0.5, 0.5), (1.0 / 3.0, 1.0, 0.5), (1.0 / 6.0, 0.0, 1.0))
    """Weight, step to the next stage, and time of each stage, in units of the step."""

    def step(self, particles: ParticleArrays, t: float, h: float) -> None:
        """Four passes; if a stage leaves the range of the lists, they are rebuilt with a wider skin."""
        particles.require_lists(h)
        self.ledger_sums.catch_up()
        self._jumped = 0.0
        for attempt in range(6):
            particles.refresh_copies(particles.agents)
            base, further = particles.agents.copy(), particles.body_rows.further.copy()
            if self._try(particles, t, h, base):
                particles.successor = base
                self.last, self.counted = h, False
                return
            displacement = particles.displacement_bound()
            particles.agents[:], particles.body_rows.further[:] = base, further
            wider = (
                None
                if attempt == 0
                else max(2.0 * particles.displacement.skin, SKIN_SPARE * displacement)
                if np.isfinite(displacement)
                else None
            )
            particles.rebuild(h, skin=wider)
        raise FloatingPointError("stages move agents beyond any skin")

    def _try(self, particles: ParticleArrays, t: float, h: float, base: Reals) -> bool:
        T = particles.dtype
        gained, second = np.empty_like(base), particles.spec.order == 2
        combine = _combine if second else _combine_flow
        powers = np.zeros(len(INTEGRATED) + particles.spec.departs)
        further, risen = particles.body_rows.further.copy(), np.zeros_like(particles.body_rows.further)
        for number, (weight, ahead, when) in enumerate(self._stages):
            particles.move(t + when * h, keep=0.0, kick=1.0, drift=0.0, exponential_damping=0.0, hold=number > 0)
            if self.ledger:
                if number == 0:
                    first = self.ledger_sums.read(particles)
                    powers += weight * first
                    # In a repeated step the links have already switched.
                    self._jumped += self.ledger_sums.sums["jumped"]
                    sums_before = dict(self.ledger_sums.sums)
                else:
                    powers += weight * self.ledger_sums.read(particles)
            if number == 0:
                tile_extremes = particles.results.tile_extremes.copy()
            both = particles.agents, particles.successor
            particles.workers.each(
                combine, particles.size, base, gained, *both, T(weight * h), T(ahead * h), number == 0
            )
            if len(further):
                risen += T(weight * h) * particles.body_rows.slopes
                particles.body_rows.further[:] = further + (
                    risen if number == 3 else T(ahead * h) * particles.body_rows.slopes
                )
            if number == 3 and second:
                np.add(base[: particles.size], gained[: particles.size], out=particles.agents[: particles.size])
            elif number == 3:
                m, own = particles.m, slice(particles.size)
                np.add(base[own, :m], gained[own, :m], out=particles.agents[own, :m])
                np.divide(gained[own, :m], T(h), out=particles.agents[own, m:])
            if particles.obstacles is not None:
                particles.obstacles.used = np.inf
            particles.displacement.bound = np.inf
            if not particles.usable() and number < 3:
                return False
        square = (particles.X[particles.m :, : particles.n] - particles.displacement.velocity[:, None]).astype(
            np.float64
        ) ** 2
        particles.results.tile_extremes[:] = tile_extremes
        if particles.tiles:
            top = square.sum(axis=0).max()
            particles.results.tile_extremes[:, 0] = 0.0
            # Columns that are no numbers end the run as velocities do that are none.
            finite = np.isfinite(top) and np.isfinite(particles.body_rows.further[:, : particles.n]).all()
            particles.results.tile_extremes[0, 0] = top if finite else np.inf
        particles.read_tile_extremes()
        particles.top_speed = float(np.sqrt(particles.results.extremes[0]))
        particles.displacement.elapsed += h
        particles.displacement.bound = np.inf if particles.moving else 0.0
        if self.ledger:
            self.ledger_sums.ahead = h * powers
            self.ledger_sums.jumped += self._jumped
            self.ledger_sums.sums = sums_before
        return True

    def look(self, particles: ParticleArrays, t: float, h: float) -> Reals:
        """One pass that does not change the state; velocities are those of the state, zero for agents of order 1."""
        return _looked(self, particles, t, h)


def integrator_named(name: str, spec: KernelSpec) -> Integrator:
    """The integrator with one of the names in ``INTEGRATORS`` of `flocking.engine.tiles.kernels.spec`.

    Parameters
    ----------
    spec
        Whether energies are summed, and what bodies do beyond the law.
    """
    kinds: dict[str, type[Integrator]] = {"rk4": RungeKutta, "euler": Euler}
    found = kinds.get(name, Verlet)(spec.ledger)
    if spec.departs:
        found.ledger_sums = LedgerSums(np.zeros(len(INTEGRATED) + 1), ahead=np.zeros(len(INTEGRATED) + 1))
    return found
