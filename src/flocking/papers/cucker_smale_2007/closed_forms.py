"""Closed forms and the discrete system of Cucker and Smale."""

from __future__ import annotations

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, integer, number
from flocking.model.graphs.distance_graphs import pair_distances
from flocking.model.state import State


def weights(q: Array, gain: float = 1.0, exponent: float = 0.4, scale: float = 1.0) -> Array:
    """a_ij = K/(sigma^2 + |x_i - x_j|^2)^beta, zero for i = j; shape (N, N).

    Parameters
    ----------
    q
        Positions, shape (N, m).
    gain, exponent, scale
        K, beta and sigma.
    """
    found = gain / (scale**2 + pair_distances(np.asarray(q, dtype=np.float64)) ** 2) ** exponent
    np.fill_diagonal(found, 0.0)
    return np.asarray(found)


def discrete_step(state: State, step: float, gain: float = 1.0, exponent: float = 0.4, scale: float = 1.0) -> State:
    """One step of the discrete system: x(t + h) = x + h v, v(t + h) = (1 - h L_x) v.

    Parameters
    ----------
    state
        Positions and velocities.
    step
        h, positive.
    gain, exponent, scale
        K, beta and sigma.

    Raises
    ------
    InvalidInput
        If the step is not positive.
    """
    h = number("discrete_step", "step", step, above=0.0)
    a = weights(state.q, gain, exponent, scale)
    pull = a @ state.p - a.sum(axis=1)[:, None] * state.p
    return State(state.q + h * state.p, state.p + h * pull, t=state.t + h)


def discrete_motion(
    state: State, step: float, steps: int, gain: float = 1.0, exponent: float = 0.4, scale: float = 1.0
) -> tuple[Array, Array]:
    """Positions and velocities of the discrete system, each of shape (steps + 1, N, m).

    Parameters
    ----------
    state
        The first state.
    step, steps
        h, and the number of steps.
    gain, exponent, scale
        K, beta and sigma.
    """
    q, p = [state.q], [state.p]
    for _ in range(integer("discrete_motion", "steps", steps, least=0)):
        state = discrete_step(state, step, gain, exponent, scale)
        q.append(state.q)
        p.append(state.p)
    return np.stack(q), np.stack(p)


def scatter(points: Array) -> float:
    """Gamma of positions, Lambda of velocities: half the sum of |x_i - x_j|^2 over all ordered pairs.

    Parameters
    ----------
    points
        Positions or velocities, shape (N, m).
    """
    x = np.asarray(points, dtype=np.float64)
    mean = x.mean(axis=0)
    # The sum over pairs is N times the scatter about the mean.
    return float(len(x) * ((x - mean) ** 2).sum())


def sufficient_condition(
    position_scatter: float, velocity_scatter: float, gain: float, exponent: float, scale: float = 1.0,
    norm_constant: float = 1.0,
) -> float:  # fmt: skip
    """By how much the condition of 2007 for convergence is met, as it is commonly cited; positive where it is.

    For beta < 1/2 there is none, and the result is infinite. For beta = 1/2 it is Lambda < (nu K)^2/8. Above,
    [(1/(2 beta))^(1/(2 beta - 1)) - (1/(2 beta))^(2 beta/(2 beta - 1))] ((nu K)^2/(8 Lambda))^(1/(2 beta - 1)) must
    exceed 2 Gamma + sigma^2.

    Parameters
    ----------
    position_scatter, velocity_scatter
        Gamma and Lambda of the start.
    gain, exponent, scale
        K, beta and sigma.
    norm_constant
        nu, by which the authors relate norms of velocities.

    Raises
    ------
    InvalidInput
        If a number is out of range.
    """
    owner = "sufficient_condition"
    spread = number(owner, "position_scatter", position_scatter, least=0.0)
    speed = number(owner, "velocity_scatter", velocity_scatter, above=0.0)
    beta, sigma = number(owner, "exponent", exponent, least=0.0), number(owner, "scale", scale, above=0.0)
    strength = (number(owner, "norm_constant", norm_constant, above=0.0) * number(owner, "gain", gain, above=0.0)) ** 2
    if beta < 0.5:
        return np.inf
    if beta == 0.5:
        return strength / 8.0 - speed
    power, base = 1.0 / (2.0 * beta - 1.0), 1.0 / (2.0 * beta)
    # By logarithms: near beta = 1/2 the power is so large that powers of either factor leave the range of numbers.
    size = power * np.log(base) + np.log1p(-base) + power * (np.log(strength) - np.log(8.0 * speed))
    with np.errstate(over="ignore"):
        return float(np.exp(size) - (2.0 * spread + sigma**2))


def pair_invariant(distance: Array, speed: Array, gain: float = 1.0) -> Array:
    """W + K arctan(r): constant while two agents on a line with psi = 1/(1 + r^2) move apart, since w' = -K psi(r) r'.

    Parameters
    ----------
    distance, speed
        r and w = r', arrays of one shape.
    gain
        K.
    """
    return np.asarray(speed) + gain * np.arctan(np.asarray(distance))


def final_distance(distance: float, speed: float, gain: float = 1.0) -> float:
    """Limit of the distance of two agents on a line with psi = 1/(1 + r^2); infinite where they part for ever.

    They stay together if and only if w(0) < K (pi/2 - arctan r(0)), K times the integral of psi from r(0) on; then the
    limit is tan(arctan r(0) + w(0)/K). At equality they part with a speed that tends to zero.

    Parameters
    ----------
    distance, speed
        r and w at the start, not negative.
    gain
        K, positive.
    """
    r = number("final_distance", "distance", distance, least=0.0)
    w = number("final_distance", "speed", speed, least=0.0)
    turned = w / number("final_distance", "gain", gain, above=0.0)
    # The tangent of a sum, with the rest of a right angle as arctan(1/r): the difference loses digits for large r.
    rest = np.arctan2(1.0, r) - turned
    if not rest > 0.0:
        return np.inf
    return float(1.0 / np.tan(rest)) if turned else r


def final_speed(distance: float, speed: float, gain: float = 1.0) -> float:
    """Limit of their relative speed: what w(0) exceeds K times the integral of psi from r(0) on by, or 0.

    Parameters
    ----------
    distance, speed, gain
        As in `final_distance`.
    """
    r = number("final_speed", "distance", distance, least=0.0)
    w = number("final_speed", "speed", speed, least=0.0)
    # arctan(1/r) is pi/2 - arctan r, without the difference of numbers that nearly agree.
    return max(w - number("final_speed", "gain", gain, above=0.0) * float(np.arctan2(1.0, r)), 0.0)


def delay_limits(rate: float) -> tuple[float, float]:
    """Delays of w'(t) = -lambda w(t - tau): 1/(e lambda), up to which w keeps its sign, and the stable pi/(2 lambda).

    Parameters
    ----------
    rate
        lambda, positive; 2 K/N of two agents with constant weights K/N.

    Raises
    ------
    InvalidInput
        If the rate is not positive.
    """
    found = number("delay_limits", "rate", rate, above=0.0)
    if not np.isfinite(1.0 / found):
        raise InvalidInput("delay_limits", "rate", "must not be that small", rate)
    return 1.0 / (np.e * found), np.pi / (2.0 * found)
