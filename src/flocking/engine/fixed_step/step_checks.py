"""Checks of a fixed time step after it was taken, and the error that recommends a smaller step."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from flocking.engine.runs.fidelity import LedgerRule
from flocking.engine.runs.recorder import Recorder
from flocking.errors import StepTooLarge
from flocking.model.checks import NO_LESS

ENERGY_ROUNDING = 1e3
"""Rounding error of a sum of energies in units of the machine epsilon; a generous bound for sums over many agents,
which ranks add in any order."""

STRIDE = 0.25
"""Largest motion of a linked pair in one step, relative to its distance, if the potential is singular at contact."""

SPARE = 0.5
"""Fraction of the allowed stride for a recommended step, since the next pair may be closer."""

SMALL_GAP = 0.2
"""Fraction of the allowed residual for a recommended step, since integrators reach their order only for small
steps."""

LARGEST_GAP = 1e6
"""Upper bound on the residual relative to the energy exchanged, so that the recommended step stays finite."""

UNKNOWN_STEP = 0.1
"""Bound on the recommended step if the residual of the ledger is not finite: that of automatic steps."""

DEPARTED = 7
"""Place of the departures in a row of the ledger."""

RESIDUAL = 0.05
"""Largest accepted residual of the ledger, relative to the energy exchanged."""


def step_too_large(
    step: float, would_do: float, why: str, *, time: float, agents: tuple[int, ...] = (), instead: str = ""
) -> StepTooLarge:
    """The error that recommends a step; ``instead``: text of an alternative.

    Parameters
    ----------
    would_do
        The recommended step.
    why
        The reason.
    agents
        Numbers of the agents concerned.
    """
    error = StepTooLarge(
        f"The time step {step:.3g} is too large: {why}. A step of {would_do:.2g} would do{instead}.",
        time=time, agents=agents,
    )  # fmt: skip
    error.would_do = would_do
    return error


def check_stride(step: float, distance: float, moved: float, *, time: float, agents: tuple[int, ...]) -> None:
    """Check that the relative displacement ``moved`` of a pair in one step is small compared with its ``distance``.

    Parameters
    ----------
    agents
        Numbers of the two agents.

    Raises
    ------
    StepTooLarge
        If it exceeds `STRIDE` times the distance.
    """
    share = moved / max(distance, NO_LESS)
    if share > STRIDE:
        raise step_too_large(
            step, step * SPARE * STRIDE / share, f"a pair at distance {distance:.3g} moved {moved:.3g} in one step",
            time=time, agents=agents,
        )  # fmt: skip


def check_ledger(
    step: float, first: Sequence[float], last: Sequence[float], *, order: int, rounding: float, time: float,
    allowed: float = RESIDUAL, at_most: Callable[[], float] = lambda: np.inf, instead: str = "",
    of_places: Callable[[], float] = lambda: 0.0,
) -> float:  # fmt: skip
    """Check that the residual of the energy ledger is small enough.

    Parameters
    ----------
    step
        The time step.
    first, last
        Rows of the ledger, fields `flocking.engine.runs.run.TRACE_FIELDS`.
    order
        Order of the integrator.
    rounding
        Bound on the rounding error of the energy.
    time
        Time of the run.
    allowed
        Largest accepted residual relative to the energy exchanged.
    at_most
        Largest step that may be recommended.
    instead
        Text of an alternative to a smaller step.
    of_places
        Change of the energy by the rounding of positions; called where the residual is too large. Where agents are at
        rest at their distances, all energy is such a change.

    Returns
    -------
    float
        That bound where it was needed, else 0.

    Raises
    ------
    StepTooLarge
        If the residual is larger.
    """
    gap = (last[1] - first[1]) + (last[4] - first[4]) - (last[5] - first[5]) - (last[6] - first[6])
    # Rows of earlier versions have no departures.
    departed = last[DEPARTED] - first[DEPARTED] if min(len(first), len(last)) > DEPARTED else 0.0
    gap -= departed
    moved = sum(abs(last[k] - first[k]) for k in (3, 4, 5, 6)) + abs(departed) + first[2] + last[2] + rounding
    share = abs(gap) / max(moved, NO_LESS)
    if share <= allowed:
        return 0.0
    rounded = of_places()
    if not abs(gap) <= 2.0 * rounded:
        smaller = (
            step * (SMALL_GAP * allowed / min(share, LARGEST_GAP)) ** (1.0 / order)
            if np.isfinite(share)
            else UNKNOWN_STEP
        )
        why = f"the energy ledger leaves {100 * share:.3g} % of the energy unexplained"
        raise step_too_large(step, min(smaller, step / 2, at_most()), why, time=time, instead=instead)
    return rounded


def ledger_rule(records: Recorder) -> LedgerRule:
    """The bound on the ledger of a run of a fixed step.

    Parameters
    ----------
    records
        Records of the run.
    """
    return LedgerRule("share", RESIDUAL, rounding=records.energy_rounding)
