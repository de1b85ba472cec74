"""How faithful a run is to the law it declares: what its engine states of itself, for audits to read."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

WATCHED = ("all", "linked", "none")
"""Pairs whose closest approach is looked at: all of them, linked ones alone, or none."""

LEDGER_RULES = ("tolerance", "share", "estimate", "unknown")
"""What the residual of a ledger is held to; see `LedgerRule`."""


@dataclass(frozen=True)
class LedgerRule:
    """What the residual of the energy ledger of a run is held to.

    Parameters
    ----------
    kind
        ``"tolerance"``: the energy moved times a relative tolerance, for steps whose length follows the error.
        ``"share"``: a share of the energy moved, for fixed steps, which close it to the order of their scheme.
        ``"estimate"``: an estimated error, for powers integrated between samples.
        ``"unknown"``: nothing is known of it.
    size
        The tolerance, the share or the estimated error; NaN where it is not known.
    switch_error
        What links that switched between samples add to an estimated error.
    """

    kind: str = "unknown"
    size: float = math.nan
    switch_error: float = 0.0


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
    """How far the forces and powers that acted were from those of the declared law.

    Parameters
    ----------
    checks
        Number of looks.
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
    """The account that a run gives of itself.

    By default nothing is known, which leaves open whatever would follow from it.

    Parameters
    ----------
    engine
        Name of the engine, or of what else the motion comes from.
    sampled
        Whether it is made of samples of a motion from elsewhere: nothing is known between them.
    switches_located
        Whether every switch of a link is found and recorded; else the frames alone say who was linked.
    approaches
        What is known of closest approaches.
    ledger
        What the residual of the ledger is held to.
    fixed_step
        The time step, where it is fixed; None where its length follows the error.
    law
        How far forces were from the declared law; None where nobody looked.
    """

    engine: str = ""
    sampled: bool = False
    switches_located: bool = False
    approaches: Approaches = field(default_factory=Approaches)
    ledger: LedgerRule = field(default_factory=LedgerRule)
    fixed_step: float | None = None
    law: LawAgreement | None = None


UNSTATED = Fidelity()
"""The account of a run that gives none."""
