"""Search for an acceptable step: one that lost a link or jumped over a feature is tried again, smaller."""

from __future__ import annotations

import numpy as np

from flocking.engine import interruption
from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.adaptive_steps.stepper import Stepper, StepperMemory
from flocking.engine.exact.barriers import LedgerState, jumps_barrier, nearest_to_barrier
from flocking.engine.exact.crossings.coincidences import short_passage
from flocking.engine.exact.crossings.images import linked_paths
from flocking.engine.exact.crossings.switching import Crossing, LinkState
from flocking.engine.exact.dynamics import Dynamics
from flocking.engine.exact.failures import held_back, link_lost
from flocking.engine.exact.narrow_features import AIMED
from flocking.errors import StepTooSmall

SHORTENED = 0.25
"""Factor by which a step that is not acceptable is shortened."""

SHORTEST = 64 * float(np.finfo(float).eps)
"""Steps are not shortened below this share of the time, of 1, or of a shorter run: times would not resolve them."""

RETRIES = 30
"""Number of retries, each four times smaller."""


def _share_before_passage(dynamics: Dynamics, segment: Segment) -> float:
    """The fraction of a step before two linked agents pass each other and return unseen; 1 where none do."""
    if not dynamics.pointed:
        return 1.0
    motion, pairs = segment.motion(dynamics.n, dynamics.m, dynamics.order), dynamics.linked_pairs()
    x = float(short_passage(*linked_paths(dynamics.scenario.space, motion, *pairs), len(pairs[0])))
    return AIMED * x if x <= 1.0 else 1.0


def found_step(
    stepper: Stepper,
    links: LinkState,
    dynamics: Dynamics,
    bound: float,
    ledger: LedgerState | None,
    tried: tuple[Segment, StepperMemory] | None = None,
) -> tuple[Segment, list[Crossing]]:
    """The next segment, up to the first crossing, with what crosses at its end.

    Parameters
    ----------
    stepper
        Stands where the step begins, and at its end afterwards.
    links
        Links at its begin.
    dynamics
        The law in force.
    bound
        Where the step must end.
    ledger
        The ledger at its begin; none where the agents obey another law than the ledger holds.
    tried
        The whole step, where it is known, with the memory of the stepper at its end.

    Raises
    ------
    LinkLost
        When a link whose potential is infinite at its break radius reaches it.
    SimulationError
        When no step is possible.
    Noted
        When Ctrl-C was pressed; the stepper is then to be put back where it was.
    """
    before = stepper.memory
    scenario = dynamics.scenario
    shortest = SHORTEST * max(abs(before.t), min(1.0, scenario.t_end - scenario.start.t))
    longest = np.inf
    for _ in range(RETRIES):
        interruption.check()
        if tried is None:
            try:
                complete = stepper.step(bound, longest)
            except StepTooSmall:
                nearest = nearest_to_barrier(dynamics, links, before.y) if dynamics.held.limits else None
                if nearest is None:
                    raise
                raise held_back(before.t + dynamics.base, nearest) from None
        else:
            complete = tried[0]
            stepper.recall(tried[1])
            tried = None
        where, crossings = links.next_crossings(complete, dynamics.n, dynamics.m, dynamics.order)
        segment = complete.cut(where) if crossings else complete
        change = dynamics.first_limit_change(segment)
        # At the end of the step a limit and a pair may both change.
        if change is not None and change < 1.0:
            segment, crossings = segment.cut(change), []
        lost = links.lost_link(crossings, dynamics.barriers)
        share = min(dynamics.allowed_share(segment, links), _share_before_passage(dynamics, segment))
        kept = float(stepper.tolerance[dynamics.motion_size])
        jumped = ledger is not None and lost is None and share >= 1 and jumps_barrier(dynamics, segment, ledger, kept)
        if lost is None and share >= 1 and not jumped:
            break
        longest = (segment.t1 - segment.t0) * (share if share < 1 else SHORTENED)
        if longest <= shortest:
            break
        stepper.recall(before)
    if lost is not None:
        raise link_lost(before.t + dynamics.base, lost)
    return segment, crossings
