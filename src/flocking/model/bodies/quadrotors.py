"""Quadrotors: thrust acts along their own axis alone, so they turn to direct it along the force of the law."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.bodies.actuators import LARGEST_SQUARE
from flocking.model.bodies.body import Body, Column, Limit, MotionSymbols
from flocking.model.checks import Array, scalar_or_each
from flocking.model.parts.registration import register_part

if TYPE_CHECKING:
    import sympy
    from numpy.typing import ArrayLike

AXES = ("axis_1", "axis_2", "axis_3")
"""Columns of the attitude: where the axes of the body point, unit vectors; thrust acts along the last."""

SPIN, COMMAND, COMMAND_RATE = "spin", "command", "command_rate"
"""Columns of the angular velocity in the body's axes, of the filtered desired force, and of its rate."""

RULES = {COMMAND: "be", COMMAND_RATE: "make command + command_rate/command_frequency"}
"""What columns must do to be shorter than the weight: the filter of the force, two lags in a row, keeps both so."""

SPACE = 3
"""Dimensions in which a quadrotor flies."""

ORTHONORMAL = 1e-6
"""Largest difference of products of given axes from those of orthonormal ones: axes of a run, from whose states others
start, are off by what its tolerance adds up to."""

ACTING = 0.5
"""The held number that states that rotors idle is 0 or 1."""

Vector = Sequence["sympy.Expr"]


@register_part("quadrotor")
@dataclass(frozen=True, eq=False)
class Quadrotor(Body):
    """An aircraft with four rotors: a thrust along its third axis, and a moment that turns it as the force requires.

    The law's force passes a filter of order 2, critically damped, f'' = w_f^2 (s - f) - 2 w_f f', where s is the wanted
    force u scaled down smoothly to less than ``reach`` of the weight, s = u/sqrt(1 + |u|^2/(reach m g)^2). So the force
    F = f + m g e_3 that rotors are to exert never vanishes nor points down where the filter starts at rest, as it does
    unless a start gives ``command`` and ``command_rate``. The attitude follows the one whose third
    axis is along F and whose first is as near as possible to the first axis of space, by the controller on SE(3) of
    Lee, Leok and McClamroch (2010) with gains in proportion to the inertia: with the errors e_R of the attitude and e_W
    of the angular velocity, e_W' = -w_a^2 e_R - 2 z w_a e_W. The thrust is the component of F along the third axis;
    while that is negative, rotors idle. Rotors follow at once and have no upper limit, and air does not resist.

    Turned by exactly half a turn from the desired attitude the error e_R is zero: an unstable equilibrium, which the
    paper's Proposition 1 excludes. An aircraft that starts so, upside down and without spin, does not turn: it falls.

    Defaults of mass and inertia are those of the Crazyflie 2.0 (Foerster, "System Identification of the Crazyflie 2.0
    Nano Quadrocopter", ETH Zurich 2015), as commonly cited. Frequencies are chosen here.

    Parameters
    ----------
    masses, damping
        As for `PointMass`; in kg where gravity is in m/s^2.
    roll_inertia, pitch_inertia, yaw_inertia
        Moments of inertia about the three axes of the body; positive.
    attitude_frequency, attitude_damping
        Frequency w_a in radians per unit of time, and damping ratio z, of the attitude; positive.
    command_frequency
        Frequency w_f of the filter; positive.
    reach
        Largest desired force that passes, as a share of the weight; above 0, below 1.
    gravity
        Its acceleration; positive.

    Raises
    ------
    InvalidInput
        When a number is not positive, or the reach is not below 1.

    Examples
    --------
    >>> import flocking as fk
    >>> fk.Quadrotor().widths(3)["spin"]
    3
    """

    masses: float | Array = 0.028
    damping: float | Array = 0.0
    roll_inertia: float | Array = 16.571710e-6
    pitch_inertia: float | Array = 16.655602e-6
    yaw_inertia: float | Array = 29.261652e-6
    attitude_frequency: float | Array = 20.0
    attitude_damping: float | Array = 0.7
    command_frequency: float | Array = 10.0
    reach: float | Array = 0.8
    gravity: float | Array = 9.81

    if TYPE_CHECKING:  # Lists are accepted.

        def __init__(
            self, masses: ArrayLike = 0.028, damping: ArrayLike = 0.0, roll_inertia: ArrayLike = 1.657171e-05,
            pitch_inertia: ArrayLike = 1.6655602e-05, yaw_inertia: ArrayLike = 2.9261652e-05,
            attitude_frequency: ArrayLike = 20.0, attitude_damping: ArrayLike = 0.7,
            command_frequency: ArrayLike = 10.0, reach: ArrayLike = 0.8, gravity: ArrayLike = 9.81,
        ) -> None: ...  # fmt: skip

    def __post_init__(self) -> None:
        for name in self.parameters:
            object.__setattr__(self, name, scalar_or_each("Quadrotor", name, getattr(self, name), above=0.0))
        if (np.asarray(self.reach) >= 1.0).any():
            raise InvalidInput(
                "Quadrotor", "reach", "must be below 1", float(np.max(self.reach)),
                "Otherwise the thrust could have to be zero, which has no direction.",
            )  # fmt: skip
        self.check_fields()

    @property
    def order(self) -> int:
        """2: its centre of mass has a velocity."""
        return 2

    @property
    def columns(self) -> tuple[Column, ...]:
        """Attitude, angular velocity, and the filtered force with its rate."""
        return tuple(Column(name, SPACE) for name in (*AXES, SPIN, COMMAND, COMMAND_RATE))

    @property
    def directions(self) -> tuple[str, ...]:
        """The first axis, which is ahead, and the third, along which thrust acts."""
        return (AXES[0], AXES[2])

    @property
    def parameters(self) -> dict[str, float | Array]:
        """All numbers but mass and damping."""
        names = ("roll_inertia", "pitch_inertia", "yaw_inertia", "attitude_frequency", "attitude_damping",
                 "command_frequency", "reach", "gravity")  # fmt: skip
        return {name: getattr(self, name) for name in names}

    def lets(self, x: MotionSymbols) -> dict[str, sympy.Expr]:
        """Wanted force, desired attitude with its first two derivatives, and the errors of the attitude."""
        import sympy

        made: dict[str, sympy.Expr] = {}

        def number(name: str, value: sympy.Expr) -> sympy.Expr:
            made[name] = value
            return x.let(name)

        def vector(name: str, value: Vector) -> list[sympy.Expr]:
            return [number(f"{name}_{k}", part) for k, part in enumerate(value)]

        def unit(name: str, v: Vector, rate: Vector, second: Vector) -> tuple[list[sympy.Expr], ...]:
            """The direction of a vector with its first two derivatives."""
            length = number(f"{name}_length", sympy.sqrt(_dot(v, v)))
            e = vector(name, [a / length for a in v])
            s = number(f"{name}_stretch", _dot(e, rate))
            e1 = vector(f"{name}_rate", [(a - s * b) / length for a, b in zip(rate, e, strict=True)])
            s1 = number(f"{name}_stretch_rate", _dot(e1, rate) + _dot(e, second))
            e2 = [(a - s1 * b - 2 * s * c) / length for a, b, c in zip(second, e, e1, strict=True)]
            return e, e1, vector(f"{name}_second", e2)

        weight = number("weight", x.mass * x.parameter("gravity"))
        w = x.parameter("command_frequency")
        beyond = 1 + _dot(x.u, x.u) / (x.parameter("reach") * weight) ** 2
        # Of a force without a square the share would be 0: an infinite force ends the run instead.
        share = sympy.Piecewise((1 / sympy.sqrt(beyond), beyond < LARGEST_SQUARE), (LARGEST_SQUARE, True))
        scale = number("scale", share)
        f, rate = x.columns[COMMAND], x.columns[COMMAND_RATE]
        second = vector("command_second", [
            w**2 * (scale * u - a) - 2 * w * b for u, a, b in zip(x.u, f, rate, strict=True)
        ])  # fmt: skip
        force = vector("force", [f[0], f[1], f[2] + weight])
        b3 = unit("up", force, rate, second)
        across = [[_zero(), e[2], -e[1]] for e in b3]
        b2 = unit("left", *across)
        b1 = (
            vector("ahead", _cross(b2[0], b3[0])),
            vector("ahead_rate", _sum(_cross(b2[1], b3[0]), _cross(b2[0], b3[1]))),
            vector("ahead_second", _sum(
                _cross(b2[2], b3[0]), _cross(b2[1], b3[1]), _cross(b2[1], b3[1]), _cross(b2[0], b3[2])
            )),
        )  # fmt: skip
        turn = vector("turn", [_dot(b3[0], b2[1]), _dot(b1[0], b3[1]), _dot(b2[0], b1[1])])
        turning = vector("turning", [
            _dot(b3[1], b2[1]) + _dot(b3[0], b2[2]), _dot(b1[1], b3[1]) + _dot(b1[0], b3[2]),
            _dot(b2[1], b1[1]) + _dot(b2[0], b1[2]),
        ])  # fmt: skip
        r, desired = [x.columns[name] for name in AXES], [b1[0], b2[0], b3[0]]
        products = [[_dot(b, a) for a in r] for b in desired]
        vector("attitude_error", [(products[k][j] - products[j][k]) / 2 for j, k in ((1, 2), (2, 0), (0, 1))])
        in_space = [[sum((b[k] * c for b, c in zip(desired, v, strict=True)), _zero()) for k in range(SPACE)]
                    for v in (turn, turning)]  # fmt: skip
        seen = vector("turn_seen", [_dot(a, in_space[0]) for a in r])
        vector("turning_seen", [_dot(a, in_space[1]) for a in r])
        vector("spin_error", [a - b for a, b in zip(x.columns[SPIN], seen, strict=True)])
        number("lift", _dot(force, r[2]))
        return made

    def held(self, dimension: int) -> tuple[str, ...]:
        """Whether rotors idle."""
        return ("idle",)

    def limits(self, x: MotionSymbols) -> dict[str, Limit]:
        """Rotors idle while the thrust would have to be negative."""
        weight = x.mass * x.parameter("gravity")
        f, up = x.columns[COMMAND], x.columns[AXES[2]]
        lift = _dot([f[0], f[1], f[2] + weight], up)
        return {"idle": Limit(-lift, lift)}

    def moments(self, x: MotionSymbols) -> list[sympy.Expr]:
        """Moments about the axes of the body that rotors exert."""
        spin, inertia = x.columns[SPIN], self._inertia(x)
        w, z = x.parameter("attitude_frequency"), x.parameter("attitude_damping")

        def let(name: str) -> list[sympy.Expr]:
            return [x.let(f"{name}_{k}") for k in range(SPACE)]

        ahead = _cross(spin, let("turn_seen"))
        rates = [
            -(w**2) * a - 2 * z * w * b - c + d
            for a, b, c, d in zip(let("attitude_error"), let("spin_error"), ahead, let("turning_seen"), strict=True)
        ]
        gyroscopic = _cross(spin, [j * s for j, s in zip(inertia, spin, strict=True)])
        return [j * a + b for j, a, b in zip(inertia, rates, gyroscopic, strict=True)]

    def _inertia(self, x: MotionSymbols) -> list[sympy.Expr]:
        return [x.parameter(f"{name}_inertia") for name in ("roll", "pitch", "yaw")]

    def rates(self, x: MotionSymbols) -> dict[str, Sequence[sympy.Expr]]:
        """Those of a rigid body under thrust, moments and weight, and of the filter."""
        import sympy

        r, spin, inertia = [x.columns[name] for name in AXES], x.columns[SPIN], self._inertia(x)
        thrust = sympy.Piecewise((0, x.held("idle") > ACTING), (x.let("lift"), True))
        weight = [_zero(), _zero(), x.let("weight")]
        gyroscopic = _cross(spin, [j * s for j, s in zip(inertia, spin, strict=True)])
        turned = [
            [b * spin[2] - c * spin[1] for b, c in zip(r[1], r[2], strict=True)],
            [c * spin[0] - a * spin[2] for a, c in zip(r[0], r[2], strict=True)],
            [a * spin[1] - b * spin[0] for a, b in zip(r[0], r[1], strict=True)],
        ]
        # The axes stay orthonormal; what rounding and integration change of that is taken back.
        drift = [
            [(a[k] - sum((b[k] * _dot(a, b) for b in r), _zero())) / 2 for k in range(SPACE)] for a in r
        ]  # fmt: skip
        return {
            "p": [(thrust * a - g - x.damping * v) / x.mass for a, g, v in zip(r[2], weight, x.p, strict=True)],
            **{name: _sum(turned[k], drift[k]) for k, name in enumerate(AXES)},
            SPIN: [(m - g) / j for m, g, j in zip(self.moments(x), gyroscopic, inertia, strict=True)],
            COMMAND: x.columns[COMMAND_RATE],
            COMMAND_RATE: [x.let(f"command_second_{k}") for k in range(SPACE)],
        }

    def start(self, column: str, q: Array, p: Array) -> Array:
        """Axes along those of space, and nothing that moves.

        Parameters
        ----------
        column
            Its name.
        q, p
            Positions and velocities, shape (N, 3).
        """
        row = np.eye(SPACE)[AXES.index(column)] if column in AXES else np.zeros(SPACE)
        return np.tile(row, (len(q), 1))

    def missing_columns(self, given: Mapping[str, Array], q: Array, p: Array) -> dict[str, Array]:
        """Columns that a start does not give.

        Parameters
        ----------
        given
            Columns of the state by name.
        q, p
            Its positions and velocities, shape (N, m).

        Raises
        ------
        InvalidInput
            When space has not three dimensions, the axes are not orthonormal and right-handed, or a filtered force is
            not below the weight.
        """
        if q.shape[1] != SPACE:
            raise InvalidInput("Quadrotor", "start", f"must have {SPACE} dimensions", q.shape[1])
        found = super().missing_columns(given, q, p)
        axes = [given[name] if name in given else found[name] for name in AXES]
        if all(np.shape(a) == q.shape for a in axes):
            R = np.stack(axes, axis=2)
            off = np.abs(np.einsum("nki,nkj->nij", R, R) - np.eye(SPACE)).max(axis=(1, 2))
            wrong = (off > ORTHONORMAL) | (np.linalg.det(R) < 0.0)
            if wrong.any():
                agent = int(np.argmax(wrong))
                raise InvalidInput(
                    "Quadrotor", AXES[0], "must be right-handed orthonormal axes together with the other two",
                    f"products off by {off[agent]:.3g} of agent {agent}",
                )  # fmt: skip
        if COMMAND in given and given[COMMAND].shape == q.shape:
            self._check_command(COMMAND, given[COMMAND])
        filtered = [given[name] if name in given else found[name] for name in (COMMAND, COMMAND_RATE)]
        if all(np.shape(a) == q.shape for a in filtered):
            # The filter is two lags in a row, of which the first has this value: both stay in the ball that holds them.
            frequency = np.broadcast_to(np.asarray(self.command_frequency, dtype=np.float64), len(q))[:, None]
            self._check_command(COMMAND_RATE, filtered[0] + filtered[1] / frequency)
        return found

    def _check_command(self, name: str, command: Array) -> None:
        """Refuse filtered forces, shape (K, 3), that are not below the weight: then the sum of both may be zero."""
        weight = np.broadcast_to(np.asarray(self.masses) * np.asarray(self.gravity), len(command))
        size = np.linalg.norm(command, axis=1)
        wrong = ~(size < weight)
        if wrong.any():
            agent = int(np.argmax(wrong))
            raise InvalidInput(
                "Quadrotor", name, f"must {RULES[name]} shorter than the weight, {weight[agent]:.6g}",
                f"length {size[agent]:.6g} of agent {agent}",
                "The filter keeps it so from a start without it; leave the column out.",
            )  # fmt: skip

    @property
    def summary(self) -> str:
        """That forces are delayed by the turn of the aircraft."""
        return f"quadrotors that turn at {float(np.min(self.attitude_frequency)):g} before they push"

    @property
    def homogeneous(self) -> bool:
        """True."""
        return True

    @property
    def symmetries(self) -> frozenset[str]:
        """Those of any body, and Galilean shifts unless agents are damped: no velocity enters thrust and attitude."""
        return super().symmetries | (set() if np.any(np.asarray(self.damping)) else {"galilean"})


def _zero() -> sympy.Expr:
    import sympy

    return sympy.Integer(0)


def _dot(a: Vector, b: Vector) -> sympy.Expr:
    return sum((x * y for x, y in zip(a, b, strict=True)), _zero())


def _cross(a: Vector, b: Vector) -> list[sympy.Expr]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _sum(*vectors: Vector) -> list[sympy.Expr]:
    return [sum(parts, _zero()) for parts in zip(*vectors, strict=True)]
