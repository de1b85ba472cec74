"""How far the motion of a run was from the declared law, where that was looked at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array, Indices, Reals
from flocking.engine.fixed_step.declared_law import POWERS, Statement
from flocking.engine.runs.fidelity import LawAgreement
from flocking.model.checks import NO_LESS

EVERY = 1024
"""Steps between two looks at the forces of a long run."""


def is_due(step: int) -> bool:
    """Whether the forces of step number ``step``, the first is 1, are looked at: the 1st, 4th, 16th, ... 1024th, and
    from there every 1024th.
    """
    return step % EVERY == 0 or (0 < step < EVERY and step.bit_count() == 1 and step.bit_length() % 2 == 1)


@dataclass
class LawGaps:
    """The largest gap found between what acted on the agents and the declared law.

    Parameters
    ----------
    checks
        Number of looks.
    gap
        Largest gap, as a share of all that adds up to the force or power in question.
    allowed
        Share that rounding explains, where the gap was largest compared with it.
    worst
        Largest gap in units of what rounding explains.
    """

    checks: int = 0
    gap: float = 0.0
    allowed: float = 0.0
    worst: float = 0.0

    @property
    def about(self) -> dict[str, float]:
        """The gap as a run's provenance says it."""
        return {"law_checks": self.checks, "law_gap": self.gap, "law_gap_allowed": self.allowed}

    @property
    def agreement(self) -> LawAgreement:
        """The gap as a run's account of its fidelity says it."""
        return LawAgreement(self.checks, self.gap, self.allowed)

    def compare_forces(self, declared: Statement, force: Reals, rounding: Reals) -> int | None:
        """Hold forces against the law; which of the judged agents contradicts it most, if one does.

        Parameters
        ----------
        declared
            What the law says.
        force
            Control less damping that acted, shape (S, m).
        rounding
            Bound on the rounding of the numbers it was read from, shape (S,).
        """
        gap = np.sqrt(((force - declared.force) ** 2).sum(axis=1))
        return self._compare(gap, declared.force_error + rounding, declared.size)

    def compare_powers(self, declared: Statement, groups: Indices, found: Array) -> str | None:
        """Hold energies and powers of groups of judged agents against the law; the name of a wrong one, if there is.

        Parameters
        ----------
        declared
            What the law says.
        groups
            Which group each judged agent is in, shape (S,).
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
        gap = np.where(np.isfinite(gap), gap, np.inf)
        share = gap / np.maximum(allowed, NO_LESS)
        k = int(np.argmax(share))
        if share[k] > self.worst:
            self.worst = float(share[k])
            scale = max(float(size[k]), float(allowed[k]), NO_LESS)
            self.gap, self.allowed = float(gap[k]) / scale, float(allowed[k]) / scale
        return k if share[k] > 1.0 else None
