"""Pairs that come close within one fixed step, whether linked before it or not: their motion relative to distance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Array
from flocking.engine.fixed_step.step_checks import STRIDE, check_stride
from flocking.model.law import Law
from flocking.model.position_tree import tree_of
from flocking.model.space import OPEN, Space
from flocking.model.terms.pair_terms import Gradient

LEAST_SQUARE = 1e-300
"""Squared displacement that counts as the least: above zero and the subnormal numbers, below any displacement that is
distinguished."""


def singular_reach(law: Law) -> float:
    """Shortest radius of a moving graph over which a potential diverges at contact; infinite if there is none."""
    graphs = law.graphs
    return min(
        (
            float(np.max(np.asarray(graphs[law.graph_number(term)].break_radius)))
            for term in law.pair_terms
            if isinstance(term, Gradient)
            and graphs[law.graph_number(term)].moves
            and not np.isfinite(term.potential.at_contact)
        ),
        default=np.inf,
    )


def check_passing(
    q: Array, moved: Array, reach: float, step: float, *, time: float, ids: NDArray[np.integer] | None = None,
    space: Space = OPEN,
) -> None:  # fmt: skip
    """Check that no pair comes within ``reach`` on its straight path while it moves too far for its distance.

    Pairs closer than ``reach`` from the start are linked and checked elsewhere. If two agents move by more than
    `STRIDE` times a distance beyond ``reach``, one of them moves by more than half of that. Only such agents are
    compared with the others, the fastest first.

    Parameters
    ----------
    q, moved
        Positions before the step and displacements during it, shape (N, m).
    reach
        Radius of the potential.
    step
        The time step.
    ids
        Numbers of the agents, if they are not in order.
    space
        Their space.

    Raises
    ------
    StepTooLarge
        If a pair moves too far.
    """
    moved = moved - moved.mean(axis=0)
    length = np.sqrt((moved**2).sum(axis=1))
    fast = np.flatnonzero(length > 0.5 * STRIDE * reach)
    if not len(fast):
        return
    middle = space.wrapped(q + 0.5 * moved)
    tree = tree_of(middle, space)
    for i in fast[np.argsort(-length[fast], kind="stable")]:
        # Pairs with a faster agent have already been checked.
        others = np.array(tree.query_ball_point(middle[i], reach + length[i]), dtype=np.int64)
        others = others[others != i]
        shifts = space.lattice(2.0 * (reach + float(length[i])), q.shape[1])
        apart = (space.displacement(q[others] - q[i])[:, None] + shifts).reshape(-1, q.shape[1])
        others = np.repeat(others, len(shifts))
        displacement = moved[others] - moved[i]
        distance, square = np.sqrt((apart**2).sum(axis=1)), np.maximum((displacement**2).sum(axis=1), LEAST_SQUARE)
        share = np.clip(-(apart * displacement).sum(axis=1) / square, 0.0, 1.0)
        nearest = np.sqrt(((apart + share[:, None] * displacement) ** 2).sum(axis=1))
        met = np.where((distance >= reach) & (nearest < reach), np.sqrt(square) / distance, 0.0)
        if len(met) and met.max() > STRIDE:
            k = int(np.argmax(met))
            pair = [int(x if ids is None else ids[x]) for x in (i, others[k])]
            check_stride(
                step, float(distance[k]), float(np.sqrt(square[k])), time=time, agents=(min(pair), max(pair))
            )  # fmt: skip
