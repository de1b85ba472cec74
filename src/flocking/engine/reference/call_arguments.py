"""What a call of a controller is given, as arrays; what is of another type or shape is refused in a sentence."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from flocking.arrays import Array, Indices, Links
from flocking.errors import InvalidInput
from flocking.model.bodies.unicycles import UNIT

OWNER = "Controller"
"""Whose arguments these are, in messages."""


def _array(parameter: str, given: object, kinds: str, rule: str) -> np.ndarray[tuple[int, ...], np.dtype[np.generic]]:
    """An array of numbers of some kinds; an empty one is of any kind."""
    # Whatever stands behind a mask is no measured value.
    if np.ma.is_masked(given):
        raise InvalidInput(OWNER, parameter, "must have no masked entries", given, "Leave them out, or fill them.")
    try:
        found = np.asarray(given)
    except (TypeError, ValueError, OverflowError):
        raise InvalidInput(OWNER, parameter, rule, given) from None
    if found.dtype.kind not in kinds and (found.size or found.dtype.kind == "O"):
        raise InvalidInput(OWNER, parameter, rule, given)
    return found


def numbers(parameter: str, given: ArrayLike) -> Array:
    """Real numbers as an array in one block.

    Parameters
    ----------
    parameter
        Name of the argument.
    given
        The argument.

    Raises
    ------
    InvalidInput
        When it has other things than real numbers, or rows of different lengths.
    """
    if type(given) is not np.ndarray or given.dtype != np.float64:
        given = _array(parameter, given, "fiu", "must be real numbers, in rows of one length")
    return np.ascontiguousarray(given, dtype=np.float64)


def identifiers(given: ArrayLike) -> Indices:
    """Numbers of agents, shape (k,).

    Parameters
    ----------
    given
        The argument.

    Raises
    ------
    InvalidInput
        When it is no list of whole numbers of 64 bits.
    """
    rule = "must be a list of whole numbers"
    found = _array("ids", given, "iu", rule)
    if found.ndim != 1 or (
        found.dtype == np.uint64 and found.size and int(found.astype(np.uint64).max()) > np.iinfo(np.int64).max
    ):
        raise InvalidInput(OWNER, "ids", rule, found.tolist())
    return np.ascontiguousarray(found, dtype=np.int64)


def link_rows(given: Links, shape: tuple[int, ...]) -> Links:
    """Which agents are linked.

    Parameters
    ----------
    given
        The argument.
    shape
        Shape that it must have.

    Raises
    ------
    InvalidInput
        When it has another one, or other things than true and false.
    """
    found = _array("links", given, "biu", "must be true or false")
    if found.shape != shape:
        raise InvalidInput(OWNER, "links", f"must have the shape {shape}", found.shape)
    if not ((found == 0) | (found == 1)).all():
        raise InvalidInput(OWNER, "links", "must be true or false", found.tolist())
    return found.astype(bool)


def time_stamps(given: ArrayLike | None, count: int) -> Array:
    """When states were measured, shape (count,).

    Parameters
    ----------
    given
        The argument.
    count
        Number of states.

    Raises
    ------
    InvalidInput
        When they are not so many, or no numbers.
    """
    if given is None:
        given = [] if count == 0 else np.nan
    found = numbers("stamps", given)
    if found.shape != (count,):
        raise InvalidInput(OWNER, "stamps", "must be one for each of ids, where states expire", given)
    return found


def direction(given: ArrayLike | None, m: int, column: str) -> Array:
    """The direction of the agent's body along which it looks.

    Parameters
    ----------
    given
        The argument.
    m
        Number of axes.
    column
        Name of the direction, empty where no graph looks along one.

    Raises
    ------
    InvalidInput
        When it is no unit vector, missing, or given where no graph looks along it.
    """
    if not column:
        raise InvalidInput(
            OWNER, "heading", "must be left out where no graph looks along a direction of the body", given
        )
    if given is None:
        raise InvalidInput(
            OWNER, "heading", f"must be given, as a field of view looks along the {column!r} of the body", "none"
        )
    found = numbers("heading", given)
    if found.shape != (m,):
        raise InvalidInput(OWNER, "heading", f"must have {m} components", found.tolist())
    if not abs(math.hypot(*found.tolist()) - 1.0) <= UNIT:
        raise InvalidInput(OWNER, "heading", "must be a unit vector", found.tolist())
    return found


def refuse_shapes(
    m: int, t: float, last: float, own: tuple[Array, Array], others: tuple[Indices, Array, Array]
) -> None:
    """State what is wrong with arguments, where something is.

    Parameters
    ----------
    m
        Number of axes.
    t, last
        Now, and the time of the last call.
    own
        Position and velocity of the agent.
    others
        Numbers, positions and velocities of others.

    Raises
    ------
    InvalidInput
        When a shape is another than it must be, the time is not finite, or before the last one.
    """
    who, places, speeds = others
    if own[0].shape != (m,) or own[1].shape != (m,):
        raise InvalidInput(OWNER, "own_q", f"must have {m} components, as own_p", own[0].tolist())
    if places.shape != (len(who), m) or speeds.shape != places.shape:
        raise InvalidInput(OWNER, "q", f"must be {m} numbers for each of ids, as p", f"{places.shape}, {speeds.shape}")
    if not np.isfinite(t):
        raise InvalidInput(OWNER, "t", "must be finite", t)
    if not t >= last:
        raise InvalidInput(OWNER, "t", f"must not be before the last call, {last:g}", t, "Call reset() to begin anew.")
