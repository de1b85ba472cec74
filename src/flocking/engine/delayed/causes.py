"""A session of delayed knowledge that also integrates what its departed energy is due to."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array
from flocking.engine.delayed.delayed_law import DelayedLaw
from flocking.engine.delayed.session import DelayedSession
from flocking.engine.imperfect.body_shares import BodyShares
from flocking.engine.imperfect.powers import POWERS, Powers, integrated
from flocking.model.bodies.actuators import APPLIED
from flocking.model.law import Scenario

LATE = ("delay", "links")
"""What is wrong with what agents know late, in the order in which it is switched off."""


class DelayedCauses(DelayedSession):
    """The session of a scenario, with the work of the differences of forces that each imperfection makes.

    Parameters
    ----------
    scenario
        What is simulated; its information is delayed.

    Attributes
    ----------
    names
        Imperfections: those of `LATE`, and parts of the bodies.

    Raises
    ------
    UnsupportedLaw
        When parts of the bodies cannot be separated.
    """

    def __init__(self, scenario: Scenario) -> None:
        n, m = scenario.start.q.shape
        self._bodies = BodyShares(scenario.agents, n, m)
        self._present, self._by_true = DelayedLaw(scenario), DelayedLaw(scenario)
        """The law by known links and true places, and by what is true."""
        self.names = LATE + self._bodies.names
        self._works = np.zeros(len(self.names))
        super().__init__(scenario)

    def works_until(self, t: float) -> Array:
        """Works until a time, in the order of `names`; later ones are not asked for before earlier ones.

        Parameters
        ----------
        t
            The scenario's time.
        """
        self.advance(t)
        self._account(t - self._base)
        return self._works.copy()

    def relink(self) -> None:
        """Take the true links and the obstacles within range as they are now, for the law on the truth too."""
        super().relink()
        self._present.relink(self.known_links, self.obstacles.true.pairs)
        self._by_true.relink(self.links, self.obstacles.true.pairs)

    def _relink_known(self) -> None:
        super()._relink_known()
        self._present.relink(self.known_links, self.obstacles.true.pairs)

    def _take_gains(self) -> None:
        super()._take_gains()
        changes = self.gains_changed
        for law in (self._present, self._by_true):
            law.take_parameters(self._schedule[changes - 1] if changes else self._base)

    def _integrated(self, length: float) -> tuple[Array, Array, float]:
        count, powers = len(POWERS) + len(self.names), self._powers(self.accounted)
        sums, errors, largest = integrated(
            powers, length, self.scenario.tolerance, self.largest_power, self.rule, count
        )
        self._works += sums[len(POWERS) :]
        return sums[: len(POWERS)], errors[: len(POWERS)], largest

    def _powers(self, seconds: float) -> Powers:
        ledger = super()._powers(seconds)

        def at(times: Array) -> Array:
            found = np.array([self._shares(s) for s in (seconds + times).tolist()])
            return np.concatenate([ledger(times), found], axis=1)

        return at

    def _shares(self, seconds: float) -> Array:
        """Powers of what each of `names` changes, shape (names,)."""
        t, m, law = self._base + seconds, self.m, self._law
        y = self._segment.at(seconds)
        true = self._true(y)
        q, p = (np.ascontiguousarray(true[:, part]) for part in (slice(m), slice(m, None)))
        late, bodies = self._force(seconds, y), self._bodies
        present = self._present.forces(t, true, true[self._present.linked[1]])
        differences = [late - present, np.zeros_like(late)]
        if (self.links != self.known_links).any():
            differences[1] = present - self._by_true.forces(t, true, true[self._by_true.linked[1]])
        middle = 0.5 * (self._segment.t0 + self._segment.t1)
        acting = law.acting(t, y, late) if bodies.reads_motion else None
        parts = bodies.at(middle, late, law.further(y).get(APPLIED), acting)
        return law.powers_of(t, q, p, np.concatenate([np.array(differences), parts]), self._pairs)
