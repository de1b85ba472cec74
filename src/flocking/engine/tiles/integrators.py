"""Fixed-step schemes: what one step does to the crowd and to the integrals of the ledger."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from flocking.engine.tiles.kernels.tile_sums import SUMS
from flocking.engine.tiles.particle_arrays import Crowd
from flocking.formula.native.functions import native

INTEGRATED = ("work", "dissipated", "supplied")
"""Sums of the kernel that the ledger integrates over time."""


@dataclass
class Books:
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

    integrals: Any = field(default_factory=lambda: np.zeros(3))
    jumped: float = 0.0
    sums: dict[str, float] = field(default_factory=dict)
    ahead: Any = field(default_factory=lambda: np.zeros(3))

    def copy(self) -> Books:
        """A copy that shares nothing."""
        return Books(self.integrals.copy(), self.jumped, dict(self.sums), self.ahead.copy())

    def catch_up(self) -> None:
        """Count what a step has integrated beyond the time of the sums."""
        self.integrals, self.ahead = self.integrals + self.ahead, np.zeros(3)

    def read(self, crowd: Crowd) -> Any:
        """Take the sums of the last pass, in a fixed order of tiles; returns the three powers."""
        totals = crowd.sums.sum(axis=0)
        self.sums = dict(zip(SUMS, (float(x) for x in totals), strict=False))
        # Of velocities relative to the mean half a step ago; the mean has moved since.
        self.sums["kinetic"] -= 0.5 * float((totals[len(SUMS) :] ** 2).sum()) / crowd.mass
        return np.array([self.sums[name] for name in INTEGRATED])


class Scheme(ABC):
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
        self.books = Books()
        self.last = 0.0
        self.counted = False

    @abstractmethod
    def step(self, crowd: Crowd, t: float, h: float) -> None:
        """Advance by ``h`` from time ``t``; the old state stays in ``crowd.Y``."""

    @abstractmethod
    def look(self, crowd: Crowd, t: float, h: float) -> Any:
        """Velocities at the time of the positions, shape (m, size), and books up to date; ``h`` the coming step."""

    def _count(self, crowd: Crowd, duration: float) -> None:
        """Add the powers of the pass just made to the ledger, once a step."""
        if not self.ledger:
            return
        powers = self.books.read(crowd)
        if not self.counted:
            self.books.integrals = self.books.integrals + duration * powers
            self.counted = True
        self.books.jumped += self.books.sums["jumped"]

    def memory(self) -> dict[str, Any]:
        """What the scheme must know to go on."""
        return {"last": self.last, "counted": self.counted, "books": self.books.copy()}

    def recall(self, memory: dict[str, Any]) -> None:
        """Go back to ``memory``."""
        books = memory["books"]
        self.last, self.counted = memory["last"], memory["counted"]
        self.books = books.copy()


class Verlet(Scheme):
    """Half-step-velocity Verlet: velocities lie half a step behind positions, as in LAMMPS.

    Order 2 where forces depend on positions alone, order 1 with velocity-dependent forces. With ``damped`` the
    agent's own damping (neighbours' velocities held) is integrated exactly: stable for any strength of damping.
    """

    order = 1

    def step(self, crowd: Crowd, t: float, h: float) -> None:
        """Kick by half the last and half the coming step, drift by the coming one."""
        crowd.require_lists(h)
        crowd.move(t, keep=1.0, kick=0.5 * (self.last + h), drift=h, whole=0.5 * self.last)
        self._count(crowd, self.last)
        crowd.swap(h)
        self.last, self.counted = h, False

    def look(self, crowd: Crowd, t: float, h: float) -> Any:
        """Half a kick, without a drift, beside the state."""
        crowd.require_lists(h)
        crowd.move(t, keep=1.0, kick=0.5 * self.last, drift=0.0, whole=0.5 * self.last)
        self._count(crowd, self.last)
        return crowd.Y[crowd.m :] if self.last else crowd.X[crowd.m :]


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


class RungeKutta(Scheme):
    """Classical Runge-Kutta of order 4 with a fixed step; links are held during a step."""

    order = 4
    _stages = ((1.0 / 6.0, 0.5, 0.0), (1.0 / 3.0, 0.5, 0.5), (1.0 / 3.0, 1.0, 0.5), (1.0 / 6.0, 0.0, 1.0))
    """Weight, reach of the next stage, and time of each stage, in steps."""

    def step(self, crowd: Crowd, t: float, h: float) -> None:
        """Four passes; where a stage strays too far for the lists, they are built anew with a wider skin."""
        crowd.require_lists(h)
        self.books.catch_up()
        self._jumped = 0.0
        for attempt in range(6):
            base = crowd.agents.copy()
            if self._try(crowd, t, h, base):
                crowd.successor = base
                self.last, self.counted = h, False
                return
            stray = crowd.strayed()
            crowd.agents[:] = base
            wider = None if attempt == 0 else max(2.0 * crowd.skin, 2.5 * stray) if np.isfinite(stray) else None
            crowd.rebuild(h, skin=wider)
        raise FloatingPointError("stages stray further than any skin")

    def _try(self, crowd: Crowd, t: float, h: float, base: Any) -> bool:
        T = crowd.dtype
        gained = np.empty_like(base)
        powers = np.zeros(3)
        for number, (weight, ahead, when) in enumerate(self._stages):
            crowd.move(t + when * h, keep=0.0, kick=1.0, drift=0.0, soft=0.0, hold=number > 0)
            if self.ledger:
                if number == 0:
                    first = self.books.read(crowd)
                    powers += weight * first
                    # A repeated step finds its links switched already.
                    self._jumped += self.books.sums["jumped"]
                    kept = dict(self.books.sums)
                else:
                    powers += weight * self.books.read(crowd)
            if number == 0:
                tops = crowd.tops.copy()
            both = crowd.agents, crowd.successor
            crowd.workers.each(_combine, crowd.size, base, gained, *both, T(weight * h), T(ahead * h), number == 0)
            if number == 3:
                np.add(base, gained, out=crowd.agents)
            if crowd.obstacles is not None:
                crowd.obstacles.used = np.inf
            crowd.bound = np.inf
            if not crowd.usable() and number < 3:
                return False
        square = (crowd.X[crowd.m :, : crowd.n] - crowd.C[:, None]).astype(np.float64) ** 2
        crowd.tops[:] = tops
        top = square.sum(axis=0).max()
        crowd.tops[0, 0] = top if np.isfinite(top) else np.inf
        crowd.read_tops()
        crowd.top_speed = float(np.sqrt(top))
        crowd.elapsed += h
        crowd.bound = np.inf if crowd.moving else 0.0
        if self.ledger:
            self.books.ahead = h * powers
            self.books.jumped += self._jumped
            self.books.sums = kept
        return True

    def look(self, crowd: Crowd, t: float, h: float) -> Any:
        """One pass without a move; velocities are those of the state."""
        crowd.require_lists(h)
        crowd.move(t, keep=0.0, kick=1.0, drift=0.0, soft=0.0)
        if self.ledger:
            self.books.catch_up()
            self.books.read(crowd)
            self.books.jumped += self.books.sums["jumped"]
        return crowd.X[crowd.m :]


def scheme_named(name: str, ledger: bool) -> Scheme:
    """The scheme of a name in `flocking.engine.tiles.kernels.spec.SCHEMES`.

    Parameters
    ----------
    ledger
        Whether energies are summed on the way.
    """
    return RungeKutta(ledger) if name == "rk4" else Verlet(ledger)
