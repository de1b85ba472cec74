"""Deviation of the motion of a run from the declared law, at the checked steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array, Indices, Reals
from flocking.engine.fixed_step.declared_law import POWERS, Statement
from flocking.engine.runs.fidelity import LawAgreement
from flocking.model.checks import NO_LESS

EVERY = 1024
"""Number of steps between two checks of the forces of a long run."""


SPREAD = 0.6180339887498949
"""Golden section: successive checks begin at evenly spread agents."""

EDGE = 64.0
"""Pairs within this number of rounding units of a radius may be linked or not."""


def is_due(step: int) -> bool:
    """Whether the forces of a step are checked: the 1st, 4th, 16th, ... 1024th, and then every 1024th step.

    Steps are numbered from 1.
    """
    return step % EVERY == 0 or (0 < step < EVERY and step.bit_count() == 1 and step.bit_length() % 2 == 1)


@dataclass
class LawGaps:
    """The largest deviation of forces and powers from the declared law.

    Parameters
    ----------
    checks
        Number of checks.
    gap
        Largest deviation, relative to the sum of the absolute values of the terms of the force or power.
    allowed
        Relative rounding error at the check where the deviation was largest in units of it.
    worst
        Largest deviation in units of the rounding error.
    """

    checks: int = 0
    gap: float = 0.0
    allowed: float = 0.0
    worst: float = 0.0

    @property
    def about(self) -> dict[str, float]:
        """Entries of the run's provenance."""
        return {"law_checks": self.checks, "law_gap": self.gap, "law_gap_allowed": self.allowed}

    @property
    def agreement(self) -> LawAgreement:
        """The deviation for the run's `Fidelity`."""
        return LawAgreement(self.checks, self.gap, self.allowed)

    def recall(self, known: LawAgreement) -> None:
        """Go on from the agreement ``known`` that a stored run states."""
        self.checks, self.gap, self.allowed = known.checks, known.gap, known.allowed
        self.worst = known.gap / max(known.allowed, NO_LESS)

    def compare_forces(self, declared: Statement, force: Reals, rounding: Reals) -> int | None:
        """Compare forces with the law; returns the checked agent with the largest excess, or None.

        Parameters
        ----------
        declared
            Values by the law.
        force
            Computed control less damping, shape (S, m).
        rounding
            Bound on the rounding error of ``force``, shape (S,).
        """
        gap = np.sqrt(((force - declared.force) ** 2).sum(axis=1))
        return self._compare(gap, declared.force_error + rounding, declared.size)

    def compare_powers(self, declared: Statement, groups: Indices, found: Array) -> str | None:
        """Compare energies and powers of groups of checked agents with the law; the name of a wrong one, or None.

        Parameters
        ----------
        declared
            Values by the law.
        groups
            Index of the group of each checked agent, shape (S,).
        found
            Values of `POWERS` of each group, shape (G, 5).
        """
        wrong = None
        for k, name in enumerate(POWERS):
            power, error, size = (
                np.bincount(groups, x, minlength=len(found)).astype(np.float64)
                for x in (declared.powers[:, k], declared.power_errors[:, k], np.abs(declared.powers[:, k]))
            )
            if self._compare(np.abs(found[:, k] - power), error, size) is not None:
                wrong = name
        return wrong

    def _compare(self, gap: Reals, allowed: Reals, size: Reals) -> int | None:
        if not len(gap):
            return None
        gap = np.where(np.isfinite(gap), gap, np.inf)
        share = gap / np.maximum(allowed, NO_LESS)
        k = int(np.argmax(share))
        if share[k] > self.worst:
            self.worst = float(share[k])
            scale = max(float(size[k]), float(allowed[k]), NO_LESS)
            self.gap, self.allowed = float(gap[k]) / scale, float(allowed[k]) / scale
        return k if share[k] > 1.0 else None
