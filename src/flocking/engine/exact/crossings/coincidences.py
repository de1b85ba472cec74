"""Agents that nearly come to one point, where their force has no direction.

The potential of a pair may have a slope at distance 0: its force then turns round as two agents pass each other, and no
distance is crossed. A step whose stages all lie before or after a short time on the other side does not show it, and
is made shorter. Agents that pass slowly may as well turn back: which of both they do can lie within the error.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from flocking.arrays import Array, Indices
from flocking.engine.adaptive_steps.segment import Motion, Segment
from flocking.engine.exact.crossings.guards import squared_distance
from flocking.engine.exact.crossings.images import nearest_shift
from flocking.engine.kernels.bernstein import NEVER, smallest_value
from flocking.formula.native.functions import native_apart
from flocking.model.space import Space

REACH = 2.0
"""Distances, in errors of the distance, at which a pair may have come to one point."""

ROUNDED = 1e-14
"""Share of squared distances that is lost in a difference of them."""

PART = 0.25
"""Part of a step for which the force may have been that of the other side: stages weigh less than all of it, and stated
errors are `flocking.engine.exact.companion.SAFETY` times the difference."""

UNDECIDED = 4.0
"""Energy of passing, in energies that the error may take or give, below which a pair may have turned back."""


@native_apart
def short_passage(B: Array, far: Array, senders: Indices, sensed: Indices, count: int) -> float:
    """Where on a step one of the first ``count`` pairs is farthest on the other side of each other, if all are back.

    `NEVER` where no pair has turned by more than a right angle and back. The first such place of all pairs.

    Parameters
    ----------
    B, far
        Bernstein coefficients of the positions, shape (8, N, m), and bounds on the motions, shape (N,).
    senders, sensed
        The pairs.
    """
    found, ahead = NEVER, np.empty(8)
    for e in range(count):
        i, j = senders[e], sensed[e]
        d2 = 0.0
        for k in range(B.shape[2]):
            d2 += (B[0, j, k] - B[0, i, k]) ** 2
        if d2 > (far[i] + far[j]) ** 2:
            continue
        least = 0.0
        for a in range(8):
            ahead[a] = 0.0
            for k in range(B.shape[2]):
                ahead[a] += (B[a, j, k] - B[a, i, k]) * (B[0, j, k] - B[0, i, k])
            least = min(least, ahead[a])
        border = -ROUNDED * d2
        if least < border and ahead[7] > 0.0:
            _, x = smallest_value(ahead, border)
            if x <= 1.0:
                found = min(found, x)
    return found


@native_apart
def comes_to_one_point(B: Array, far: Array, senders: Indices, sensed: Indices, count: int, error: float) -> bool:
    """Whether one of the first ``count`` pairs may come to one point on a step.

    Parameters
    ----------
    B, far
        Bernstein coefficients of the positions, shape (8, N, m), and bounds on the motions, shape (N,).
    senders, sensed
        The pairs.
    error
        That of distances.
    """
    square, reach = np.empty(15), REACH * error
    for e in range(count):
        i, j = senders[e], sensed[e]
        d2 = 0.0
        for k in range(B.shape[2]):
            d2 += (B[0, j, k] - B[0, i, k]) ** 2
        if d2 > (far[i] + far[j] + reach) ** 2:
            continue
        squared_distance(B, i, j, square)
        border = reach * reach + ROUNDED * d2
        if smallest_value(square, border)[1] <= 1.0:
            return True
    return False


def pairs_at_one_point(
    space: Space, motion: Motion, senders: Indices, sensed: Indices, error: float
) -> list[tuple[int, int, float, Array]]:
    """Pairs that may come to one point on a step: the agents, where on the step, and the vector of the lattice between.

    Each pair is found once, also where both agents sense each other.

    Parameters
    ----------
    space
        Space of the agents.
    motion
        How they move on the step.
    senders, sensed
        The linked pairs.
    error
        That of distances.
    """
    B, found, known = motion.positions, [], set[tuple[int, int]]()
    apart = space.displacement(B[0, sensed] - B[0, senders])
    reach = motion.far[senders] + motion.far[sensed] + REACH * error
    for k in np.flatnonzero((apart**2).sum(axis=1) <= reach**2).tolist():
        i, j = int(senders[k]), int(sensed[k])
        shift, square = nearest_shift(space, B[0, j] - B[0, i]), np.empty(15)
        two = np.stack([B[:, i], B[:, j] + shift], axis=1)
        squared_distance(two, 0, 1, square)
        _, x = smallest_value(square, (REACH * error) ** 2 + ROUNDED * float((apart[k] ** 2).sum()))
        if x <= 1.0 and (j, i) not in known:
            known.add((i, j))
            found.append((i, j, float(x), shift))
    return found


class Passage(NamedTuple):
    """Two agents that come to one point.

    Parameters
    ----------
    time
        When they do.
    turn
        Change of the accelerations as they pass, of the controls of agents of order 1, shape (N, m).
    speed
        Relative speed there; of agents of order 1 before or behind it, the larger one.
    passed, undecided
        Whether they are on the other side at the end of the step, and whether they are so slow that they may turn back;
        of agents of order 1, whether they may part to either side.
    """

    time: float
    turn: Array
    speed: float
    passed: bool
    undecided: bool


def passage(
    segment: Segment, pair: tuple[int, int, float, Array], sizes: tuple[int, int, int], errors: tuple[float, float],
    accelerations: Callable[[float, Array], Array],
) -> Passage | None:  # fmt: skip
    """How two agents come to one point on a step; None if they are farther apart than the error.

    Parameters
    ----------
    segment
        The step.
    pair
        See `pairs_at_one_point`.
    sizes
        Numbers of agents and of axes, and order of the agents.
    errors
        Those of the distance and of the relative velocity of the two agents.
    accelerations
        Gives accelerations, or controls of agents of order 1, shape (N, m), at a time and a state vector.
    """
    (i, j, x, shift), (n, m, order), (bound, drift) = pair, sizes, errors
    t = segment.t0 + x * (segment.t1 - segment.t0)
    y = np.array(segment.at(t))
    places = y[: n * m].reshape(n, m)
    distance = float(np.linalg.norm(places[j] - places[i] + shift))
    if distance > REACH * bound:
        return None
    begin, end = (C[: n * m].reshape(n, m) for C in segment.coefficients[[0, -1]])
    along = begin[j] - begin[i] + shift
    passed = bool((end[j] - end[i] + shift) @ along < 0.0)
    size = float(np.linalg.norm(along))
    along = along / size if size > 0.0 else np.eye(m)[0]
    pulls = []
    for side in (1.0, -1.0):
        places[j] = places[i] - shift + side * max(bound, np.finfo(float).tiny) * along
        pulls.append(accelerations(t, y))
    turn = pulls[0] - pulls[1]
    if order == 1:
        fastest = max(float(np.linalg.norm(u[j] - u[i])) for u in pulls)
        # Where controls part them on both sides, agents may leave one point to either side.
        before, behind = (float((u[j] - u[i]) @ along) for u in pulls)
        return Passage(t, turn, fastest, passed, before > 0.0 > behind)
    speeds, kick = y[n * m : 2 * n * m].reshape(n, m), float(np.linalg.norm(turn[j] - turn[i]))
    speed = float(np.linalg.norm(speeds[j] - speeds[i]))
    undecided = speed**2 <= UNDECIDED * (kick * max(distance, bound) + 2.0 * speed * drift)
    return Passage(t, turn, speed, passed, undecided)


def kick_of(found: Passage, span: float, order: int, difference: Array) -> Array:
    """What a step over the turn of the force adds to the difference of the companion, shape (size,).

    Both solutions take the step, and neither locates the turn in it: the error may be of either sign.

    Parameters
    ----------
    found
        The passage.
    span
        Length of the step.
    order
        Order of the agents.
    difference
        Difference of the companion at the end of the step, shape (size,).
    """
    kick, first = PART * span * found.turn.ravel(), (order - 1) * found.turn.size
    own, pushed = slice(first, first + kick.size), np.zeros(difference.shape)
    pushed[own] = kick if kick @ difference[own] >= 0.0 else -kick
    return pushed
