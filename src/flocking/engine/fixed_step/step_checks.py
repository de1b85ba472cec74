"""Checks of a fixed time step after the fact, and the error that says which step would do."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from flocking.errors import StepTooLarge
from flocking.model.checks import NO_LESS

STRIDE = 0.25
"""Largest share of a linked pair's distance that it may move in one step under a potential singular at contact."""

SPARE = 0.5
"""Share of the allowed stride that a recommended step would use: the next pair may be closer."""

SMALL_GAP = 0.2
"""Share of the allowed residual that a recommended step would leave: the order of the scheme is reached only for small
steps."""

LARGEST_GAP = 1e6
"""Residuals beyond so many times the energy moved are taken for it: a recommendation stays a number."""

RESIDUAL = 0.05
"""Largest share of the energy moved that the ledger may leave unexplained."""


def step_too_large(
    step: float, would_do: float, why: str, *, time: float, agents: tuple[int, ...] = (), instead: str = ""
) -> StepTooLarge:
    """The error that says which step would do; ``instead``: another way out, in words.

    Parameters
    ----------
    would_do
        The step to try.
    why
        What went wrong, in words.
    agents
        Numbers of the agents it is about.
    """
    error = StepTooLarge(
        f"The time step {step:.3g} is too large: {why}. A step of {would_do:.2g} would do{instead}.",
        time=time, agents=agents,
    )  # fmt: skip
    error.would_do = would_do
    return error


def check_stride(step: float, distance: float, moved: float, *, time: float, agents: tuple[int, ...]) -> None:
    """Whether a pair moved no more than its distance allows in one step.

    Parameters
    ----------
    agents
        Numbers of the two agents.

    Raises
    ------
    StepTooLarge
        When it moved further.
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
) -> None:  # fmt: skip
    """Whether the energy ledger closes well enough.

    Parameters
    ----------
    step
        The time step.
    first, last
        Rows of the ledger, fields `flocking.engine.runs.run.TRACE_FIELDS`.
    order
        Order of the scheme.
    rounding
        Energy that rounding may have lost.
    time
        Where the run stands.
    allowed
        Largest share of the energy moved that may be left unexplained.
    at_most
        Largest step that may be named.
    instead
        Another way out than a smaller step, in words.

    Raises
    ------
    StepTooLarge
        When more is left unexplained.
    """
    gap = (last[1] - first[1]) + (last[4] - first[4]) - (last[5] - first[5]) - (last[6] - first[6])
    moved = sum(abs(last[k] - first[k]) for k in (3, 4, 5, 6)) + first[2] + last[2] + rounding
    share = abs(gap) / max(moved, NO_LESS)
    if not share <= allowed:
        smaller = step * (SMALL_GAP * allowed / min(share, LARGEST_GAP)) ** (1.0 / order) if np.isfinite(share) else 0.1
        why = f"the energy ledger leaves {100 * share:.3g} % of the energy unexplained"
        raise step_too_large(step, min(smaller, step / 2, at_most()), why, time=time, instead=instead)
