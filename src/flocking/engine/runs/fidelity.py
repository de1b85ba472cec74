"""What the engine of a run states of its accuracy, for audits to read."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

WATCHED = ("all", "linked", "none")
"""Pairs whose closest approach is recorded: all of them, linked ones alone, or none."""

LEDGER_RULES = ("tolerance", "share", "estimate", "forces", "unknown")
"""How the residual of a ledger is bounded; see `LedgerRule`."""


@dataclass(frozen=True)
class LedgerRule:
    """Bound on the residual of the energy ledger of a run.

    Parameters
    ----------
    kind
        ``"tolerance"``: a relative tolerance of the energy moved, for steps whose length follows the error.
        ``"share"``: a share of the energy moved, for fixed steps, whose residual has the order of their scheme.
        ``"estimate"``: an estimated error, for powers integrated between samples. ``"forces"``: there is no ledger,
        since velocities jump; the forces alone are compared with the law. ``"unknown"``: nothing is known of it.
    size
        The tolerance, the share or the estimated error; NaN where it is not known.
    switch_error
        Addition to an estimated error for links that switched between samples.
    rounding
        Bound on what the rounding of distances makes of the energy, where a residual above a share needed it.
    """

    kind: str = "unknown"
    size: float = math.nan
    switch_error: float = 0.0
    rounding: float = 0.0


@dataclass(frozen=True)
class Approaches:
    """What a run knows of the closest approach of its agents.

    Parameters
    ----------
    pairs
        Which pairs are looked at: ``"all"``, ``"linked"`` ones alone, or ``"none"``.
    error
        How much closer than recorded two agents may have come, in units of length; None where the recorded approach
        states its own error, NaN where it is not known.
    looked
        When distances are looked at, in words, where that is so rarely that it bounds nothing; empty otherwise.
    """

    pairs: str = "none"
    error: float | None = math.nan
    looked: str = ""


@dataclass(frozen=True)
class LawAgreement:
    """Difference of the forces and powers that acted from those of the declared law.

    Parameters
    ----------
    checks
        Number of comparisons.
    gap
        The gap that is largest compared with what rounding explains, as a share of all that adds up to the force.
    allowed
        The share that rounding explains there.
    """

    checks: int
    gap: float
    allowed: float


@dataclass(frozen=True)
class Fidelity:
    """What a run states of its own accuracy.

    By default nothing is known, and audits leave open what would follow from it.

    Parameters
    ----------
    engine
        Name of the engine, or of the other source of the motion.
    sampled
        Whether it is made of samples of a motion from elsewhere: nothing is known between them.
    switches_located
        Whether every switch of a link is found and recorded; else only the frames show who was linked.
    approaches
        What is known of closest approaches.
    ledger
        Bound on the residual of the ledger.
    fixed_step
        The time step, where it is fixed; None where its length follows the error.
    law
        Difference from the declared law; None where it was not measured.
    position_error, velocity_error
        Estimated errors of any coordinate of a sampled position and of any component of a velocity that was computed
        from positions; 0 for what is taken as exact, NaN where it is not known.
    changed
        Whether a session was given another law, another state or other messages while the run went on, or processes of
        its agents ended, began anew, were cut off or answered late, so that its scenario alone does not make it again.
        Runs of `tiles` that were saved and went on from there may lack it; their ledger has a jump of the energy.
    """

    engine: str = ""
    sampled: bool = False
    switches_located: bool = False
    approaches: Approaches = field(default_factory=Approaches)
    ledger: LedgerRule = field(default_factory=LedgerRule)
    fixed_step: float | None = None
    law: LawAgreement | None = None
    position_error: float = 0.0
    velocity_error: float = 0.0
    changed: bool = False


UNSTATED = Fidelity()
"""The fidelity of a run that states nothing."""
