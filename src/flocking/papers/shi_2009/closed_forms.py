"""Closed forms for the centre of mass: (9), (13), (16) with v0 = (sin t, cos t), and Examples 1-3, for any gains.

All follow from one linear equation for the centre of mass, (16) with an acceleration feed-forward g:
x'' = -h0 (x' - v0) - r0 (x - x0) + g a0. Its exact solution is the sum of the homogeneous solution and,
for a sinusoidal leader, the steady response.
"""

from __future__ import annotations

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, array, number
from flocking.papers.shi_2009.system import POSITION_GAIN, VELOCITY_GAIN

LAWS = (8, 12, 15)
"""Equation numbers of the control laws with a closed equation for the centre of mass."""


def feedback(law: int) -> tuple[float, float, float]:
    """Gains (h0, r0, g) of the simulations for the centre of mass under law (8), (12) or (15).

    Parameters
    ----------
    law
        8, 12 or 15; g is 1 where the acceleration a0 is known.

    Raises
    ------
    InvalidInput
        If the law is not one of these.
    """
    if law not in LAWS:
        raise InvalidInput("closed form", "law", "must be 8, 12 or 15", law)
    return VELOCITY_GAIN, POSITION_GAIN if law == 15 else 0.0, 1.0 if law == 8 else 0.0


def steady_velocity_error(law: int, h0: float | None = None, r0: float | None = None) -> float:
    """Steady |v* - v0| for v0 = (sin t, cos t): 1/sqrt(1 + h0^2) under (12), 1/sqrt((r0 - 1)^2 + h0^2) under (15).

    Parameters
    ----------
    law
        8, 12 or 15.
    h0, r0
        Gains on the velocity and the position error, in 1/s and 1/s^2; by default those of the simulations.

    Returns
    -------
    float
        The error, in the units of velocity.

    Raises
    ------
    InvalidInput
        If the law is not one of these, or a gain is out of range: h0 is positive, since without it no motion settles,
        and r0 is 0 under (8) and (12), which feed back no position.
    """
    h, r, g = _gains("steady_velocity_error", law, h0, r0)
    number("steady_velocity_error", "h0", h, above=0.0)
    return float(abs(_response(h, r, g) - 1.0))


def _gains(owner: str, law: int, h0: float | None, r0: float | None) -> tuple[float, float, float]:
    h, r, g = feedback(law)
    h = h if h0 is None else number(owner, "h0", h0, least=0.0)
    r = r if r0 is None else number(owner, "r0", r0, least=0.0)
    if r and law != 15:
        raise InvalidInput(owner, "r0", f"must be 0 under law ({law})", r0, "Law (15) feeds back the position.")
    return h, r, g


def _vectors(owner: str, *given: tuple[str, Array]) -> list[Array]:
    found = [array(owner, name, value, ndim=1) for name, value in given]
    for (name, value), vector in zip(given, found, strict=True):
        if vector.shape != found[0].shape:
            raise InvalidInput(owner, name, f"must have as many components as {given[0][0]}, {len(found[0])}", value)
    return found


def _response(h0: float, r0: float, g: float) -> complex:
    """Steady v*/v0 for v0 = exp(i t): the transfer function of the centre of mass at unit frequency."""
    s = 1j
    return complex(s * (g * s + h0 + r0 / s) / (s * s + h0 * s + r0))


def centre_motion(
    law: int,
    t: Array,
    x_start: Array,
    v_start: Array,
    h0: float | None = None,
    r0: float | None = None,
    *,
    start_time: float = 0.0,
) -> tuple[Array, Array]:
    """Position and velocity of the centre of mass for v0 = (sin t, cos t) and x0(0) = 0.

    Solution of (9) under law (8), of (13) under (12), and of (16) under (15).

    Parameters
    ----------
    law
        8, 12 or 15.
    t
        Times, shape (F,).
    x_start, v_start
        Position and velocity at the start, shape (2,) each.
    h0, r0
        Gains on the velocity and the position error, in 1/s and 1/s^2; by default those of the simulations.
    start_time
        Time of the start.

    Returns
    -------
    tuple of Array
        Positions and velocities, shape (F, 2) each.

    Raises
    ------
    InvalidInput
        If the law is not one of these, a gain is negative, r0 is not 0 under (8) or (12), h0 is 0 and r0 is 1, or a
        shape is wrong.
    """
    h0, r0, g = _gains("centre_motion", law, h0, r0)
    if h0 == 0.0 and r0 == 1.0:
        raise InvalidInput("centre_motion", "h0", "must be above 0 for r0 = 1, where the leader resonates", h0)
    t, begin = array("centre_motion", "t", t, ndim=1), number("centre_motion", "start_time", start_time)
    x_start, v_start = _vectors("centre_motion", ("x_start", x_start), ("v_start", v_start))
    if len(x_start) != 2:
        raise InvalidInput("centre_motion", "x_start", "must be a point of the plane", list(x_start))
    # sin t = Re(-i e^{it}), cos t = Re(e^{it}); x0 = (1 - cos t, sin t) has a constant part (1, 0).
    phases = np.array([-1j, 1.0])
    ratio = _response(h0, r0, g)
    v_steady, v_first = (ratio * np.exp(1j * time)[:, None] * phases for time in (t, np.array([begin])))
    x_steady, x_first = v_steady / 1j, v_first / 1j
    constant = np.array([1.0, 0.0]) if r0 else np.zeros(2)
    x_rest = x_start - x_first[0].real - constant
    v_rest = v_start - v_first[0].real
    x_free, v_free = _free_motion(h0, r0, t - begin, x_rest, v_rest)
    return x_steady.real + constant + x_free, v_steady.real + v_free


def _free_motion(h0: float, r0: float, t: Array, x: Array, v: Array) -> tuple[Array, Array]:
    """Solution of x'' = -h0 x' - r0 x: x C + (v + h0 x/2) S and its derivative v C - (r0 x + h0 v/2) S.

    C and S are exp(-h0 t/2) times cosh(w t) and sinh(w t)/w with w^2 = h0^2/4 - r0. Both are smooth in w^2, so there is
    no loss of digits if two eigenvalues of the matrix A of (16) nearly agree.
    """
    time = t[:, None]
    discriminant = h0 * h0 / 4 - r0
    w = np.sqrt(abs(discriminant))
    if discriminant > 0:
        fast = -h0 / 2 - w
        slow = r0 / fast if fast else 0.0
        C = (np.exp(slow * time) + np.exp(fast * time)) / 2
        S = -np.exp(slow * time) * np.expm1(-2 * w * time) / (2 * w)
    else:
        decay = np.exp(-h0 / 2 * time)
        C, S = decay * np.cos(w * time), decay * time * np.sinc(w * time / np.pi)
    return x * C + (v + h0 / 2 * x) * S, v * C - (r0 * x + h0 / 2 * v) * S


def free_motion(h0: float, r0: float, t: Array, x: Array, v: Array) -> tuple[Array, Array]:
    """Motion of x'' = -h0 x' - r0 x, the homogeneous part of (16).

    Parameters
    ----------
    h0, r0
        Gains on the velocity and the position, in 1/s and 1/s^2.
    t
        Times, shape (F,).
    x, v
        Start, shape (m,) each.

    Returns
    -------
    tuple of Array
        Positions and velocities, shape (F, m) each.

    Raises
    ------
    InvalidInput
        If a gain is negative or a shape is wrong.
    """
    h = number("free_motion", "h0", h0, least=0.0)
    r = number("free_motion", "r0", r0, least=0.0)
    place, velocity = _vectors("free_motion", ("x", x), ("v", v))
    return _free_motion(h, r, array("free_motion", "t", t, ndim=1), place, velocity)


def ramp_motion(h0: float, slope: float, t: Array, x: float, v: float) -> tuple[Array, Array]:
    """Centre of mass under (12) after a leader with v0 = alpha t: Example 2, whose velocity error tends to -alpha/h0.

    Parameters
    ----------
    h0, slope
        Gain, positive, and alpha.
    t
        Times, shape (F,).
    x, v
        Position and velocity at t = 0.

    Returns
    -------
    tuple of Array
        Positions and velocities, shape (F,) each.

    Raises
    ------
    InvalidInput
        If the gain is not positive, or a number is not finite.
    """
    h, alpha = number("ramp_motion", "h0", h0, above=0.0), number("ramp_motion", "slope", slope)
    times = array("ramp_motion", "t", t, ndim=1)
    lag = alpha / h
    place, speed = free_motion(h, 0.0, times, np.array([x]), np.array([v + lag]))
    return place[:, 0] + alpha * times**2 / 2 - lag * times, speed[:, 0] + alpha * times - lag


def jordan_form(h0: float, r0: float) -> tuple[Array, Array]:
    """P and J with A = P J P^-1, A = ((0, 1), (-r0, -h0)) the matrix of (16) for n = 1: Example 3 (i) and (ii).

    If the eigenvalues l1, l2 of A differ, J is diagonal and the columns of P are the eigenvectors (1, l1) and
    (1, l2). If they are equal, (1, l1) is the only eigenvector; the second column (1, 1 + l1) is a generalized one,
    (A - l1) (1, 1 + l1) = (1, l1), and J is a Jordan block.

    Parameters
    ----------
    h0, r0
        Gains.

    Returns
    -------
    tuple of Array
        P and J, shape (2, 2) each; complex if the eigenvalues are.

    Raises
    ------
    InvalidInput
        If a gain is negative or not finite.
    """
    h0, r0 = number("jordan_form", "h0", h0, least=0.0), number("jordan_form", "r0", r0, least=0.0)
    discriminant = h0 * h0 / 4 - r0
    if abs(discriminant) <= 4 * np.finfo(float).eps * h0 * h0:
        both = -h0 / 2
        return np.array([[1.0, 1.0], [both, 1.0 + both]]), np.array([[both, 1.0], [0.0, both]])
    root = np.sqrt(discriminant) if discriminant > 0 else 1j * np.sqrt(-discriminant)
    values = np.array([-h0 / 2 + root, -h0 / 2 - root])
    return np.array([np.ones(2), values]), np.diag(values)


def exponential_leading_part(h0: float, r0: float, growth: float, t: Array) -> tuple[Array, Array]:
    """Leading part of `exponential_motion` for large times, which does not depend on the start: Example 3 (i) and (ii).

    Parameters
    ----------
    h0, r0, growth
        Gains, h0 positive, and alpha, positive.
    t
        Times, shape (F,).

    Returns
    -------
    tuple of Array
        Positions and velocities, shape (F,) each.

    Raises
    ------
    InvalidInput
        If a number is out of range or not finite.
    """
    owner = "exponential_motion"
    h0, r0 = number(owner, "h0", h0, above=0.0), number(owner, "r0", r0, least=0.0)
    rate = number(owner, "growth", growth, above=0.0) * h0
    # x = c exp(rate t) - 1/rate solves x'' = -h0 (x' - v0) - r0 (x - x0), x0 = (exp(rate t) - 1)/rate.
    share = (rate * h0 + r0) / (rate**2 + rate * h0 + r0)
    grown = np.exp(rate * array(owner, "t", t, ndim=1))
    return (share * grown - 1.0) / rate, share * grown


def exponential_motion(h0: float, r0: float, growth: float, t: Array, x: float, v: float) -> tuple[Array, Array]:
    """Centre of mass under (15) after a leader with v0 = exp(alpha h0 t) that starts at 0: Example 3.

    Parameters
    ----------
    h0, r0, growth
        As for `exponential_leading_part`.
    t
        Times, shape (F,).
    x, v
        Position and velocity at t = 0.

    Returns
    -------
    tuple of Array
        Positions and velocities, shape (F,) each.

    Raises
    ------
    InvalidInput
        If a number is out of range or not finite.
    """
    (place,), (speed,) = exponential_leading_part(h0, r0, growth, np.zeros(1))
    left_place, left_speed = free_motion(h0, r0, t, np.array([x - place]), np.array([v - speed]))
    leading_place, leading_speed = exponential_leading_part(h0, r0, growth, t)
    return leading_place + left_place[:, 0], leading_speed + left_speed[:, 0]
