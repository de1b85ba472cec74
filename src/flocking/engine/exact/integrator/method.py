"""The method of Dormand and Prince of order 8, driven by functions that compute several stages at once."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from flocking.engine import interruption
from flocking.model.checks import Array

STAGES = 12
"""Stages of a step; the slope at its end comes next, then three more stages for the polynomial."""

Stages = Callable[[int, int, int, float, Array, float, Array, Array, Array], Array]
"""What computes stages, see `flocking.engine.exact.dynamics.Dynamics.stages`."""


@cache
def tableau() -> tuple[Array, Array]:
    """Nodes c, shape (16,), and matrix a, shape (16, 16), of the method; row 12 is its end."""
    from scipy.integrate._ivp import dop853_coefficients as known

    return np.ascontiguousarray(known.C), np.ascontiguousarray(known.A)


def halves(stages: Stages, t: float, y: Array, h: float) -> tuple[Array, Array, Array]:
    """States at the middle and at the end of a step taken in two halves, and the powers of the second half.

    Parameters
    ----------
    stages
        Computes the stages.
    t, y, h
        Where the step begins, and its length.
    """
    nodes, weights = tableau()
    K = np.empty((len(nodes), len(y)))
    middle = stages(0, STAGES + 1, STAGES, t, y, 0.5 * h, K, nodes, weights)
    K[0] = K[STAGES]
    end = stages(1, len(nodes), STAGES, t + 0.5 * h, middle, 0.5 * h, K, nodes, weights)
    return middle, end, powers(K, 0.5 * h, middle, end)


def powers(K: Array, h: float, before: Array, after: Array) -> Array:
    """Coefficients of the polynomial of a step, shape (7, size), as in SciPy's dense output.

    Parameters
    ----------
    K
        Slopes at all 16 stages, shape (16, size).
    h
        Length of the step.
    before, after
        States at its ends, shape (size,).
    """
    from scipy.integrate._ivp import dop853_coefficients as known

    F = np.empty((7, len(after)))
    F[0] = after - before
    F[1] = h * K[0] - F[0]
    F[2] = 2 * F[0] - h * (K[STAGES] + K[0])
    F[3:] = h * np.dot(known.D, K)
    return F


@cache
def solver_type() -> Any:
    """SciPy's DOP853 with the stages of a step computed at once; the steps it chooses are the same."""
    from scipy.integrate import DOP853
    from scipy.integrate._ivp.rk import MAX_FACTOR, MIN_FACTOR, SAFETY

    base: Any = DOP853

    class Solver(base):  # type: ignore[misc]
        stages: Stages
        t: Any
        y: Any
        f: Any
        h_abs: Any
        asked = 0.0
        """Length of the step wanted last, which may have been too short to be tried."""
        tried = 0.0
        """Length of the step tried last."""

        def _step_impl(self) -> tuple[bool, str | None]:
            t, y = self.t, self.y
            shortest = 10 * abs(float(np.nextafter(t, np.inf)) - t)
            length: float = min(max(self.h_abs, shortest), self.max_step)
            nodes, weights = tableau()
            rejected = False
            while True:
                interruption.check()
                self.asked = length
                if length < shortest:
                    return False, self.TOO_SMALL_STEP
                end = min(t + length, self.t_bound)
                h = length = self.tried = end - t
                self.K[0] = self.f
                new = self.stages(1, STAGES + 1, STAGES, t, y, h, self.K_extended, nodes, weights)
                scale = self.atol + np.maximum(np.abs(y), np.abs(new)) * self.rtol
                error = self._estimate_error_norm(self.K, h, scale)
                if error < 1:
                    factor = min(MAX_FACTOR, SAFETY * error**self.error_exponent) if error > 0 else MAX_FACTOR
                    break
                length *= max(MIN_FACTOR, SAFETY * error**self.error_exponent)
                rejected = True
            self.h_previous, self.y_old = h, y
            self.t, self.y, self.f = end, new, self.K[STAGES].copy()
            self.h_abs = length * (min(1, factor) if rejected else factor)
            return True, None

        def errors_tried(self) -> Array:
            """Estimated error of each component on the step tried last, in units of its tolerance, shape (size,)."""
            with np.errstate(all="ignore"):
                scale = self.atol + np.abs(self.y) * self.rtol
                return np.asarray(np.abs(self.tried * np.dot(self.K.T, self.E5)) / scale)

        def polynomial(self) -> Array:
            """Coefficients of the polynomial of the last step, see `powers`."""
            h, K = self.h_previous, self.K_extended
            nodes, weights = tableau()
            self.stages(STAGES + 1, len(nodes), STAGES, self.t_old, self.y_old, h, K, nodes, weights)
            return powers(K, h, self.y_old, self.y)

    return Solver
