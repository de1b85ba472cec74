"""Body terms of a control law, which act on single agents, such as the pursuit of a leader."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from flocking.model.checks import Array, scalar_or_each, truth
from flocking.model.leaders_and_obstacles.leaders import Leader, Sink, Velocity
from flocking.model.parts.registration import register_part
from flocking.model.symmetries import SYMMETRIES
from flocking.model.terms.pair_terms import Term, Value
from flocking.model.terms.schedules import Schedule
from flocking.model.terms.symbols import BodySymbols

if TYPE_CHECKING:
    import sympy
    from numpy.typing import ArrayLike


class BodyTerm(Term):
    """A term that acts on one agent: u_i += force.

    A subclass defines its force, and if possible the stored energy and the balance of its power.
    """

    leader: Leader | None = None
    """Leader of the term."""
    uses_means: bool = False
    """Whether it needs the centre of mass, so that the law is not distributed."""

    def force(self, x: BodySymbols) -> Sequence[sympy.Expr]:
        """Force on agent i, m expressions."""
        raise NotImplementedError

    def storage(self, x: BodySymbols) -> sympy.Expr:
        """Energy stored by agent i."""
        import sympy

        return sympy.Integer(0)

    def balance(self, x: BodySymbols) -> tuple[sympy.Expr, sympy.Expr]:
        """Power dissipated and power supplied in the frame that moves with ``x.frame_p``.

        Their difference, with the rate of `storage`, is the power of the force. By default nothing is
        dissipated, and all power of the force is supplied.
        """
        import sympy

        power = sum((f * (v - w) for f, v, w in zip(self.force(x), x.p, x.frame_p, strict=True)), sympy.Integer(0))
        return sympy.Integer(0), power

    def switch_times(self, start: float, end: float) -> tuple[float, ...]:
        """Times in (start, end) at which the force jumps."""
        return ()

    @property
    def symmetries(self) -> frozenset[str]:
        """Relabelling and locality; a leader breaks the others."""
        return frozenset({"relabelling", "locality"})


@register_part("track")
@dataclass(frozen=True)
class Track(BodyTerm):
    """Pursuit of a leader: -c1 (q - x0) - c2 (p - v0) + g m a0 (Zhou (24), Shi (4), (12), (15), Olfati-Saber (50)).

    Parameters
    ----------
    leader
        The leader. A vector is a leader with that constant velocity.
    position_gain
        c1, for all or per agent; not negative. Each gain may be a `Schedule`, to change at given times.
    velocity_gain
        c2, for all or per agent; not negative. An agent with gain 0 is not informed.
    acceleration_gain
        g, for all or per agent: 1 where the agent knows the leader's acceleration, else 0.
    per_mass
        Whether c1 and c2 are multiplied by the agent's mass, as in Shi (4) and (15).
    shared
        Whether the feedback is of the centre of mass instead of the agent, as in Olfati-Saber (64) and (66).
    saturated
        Whether both errors are mapped by z/sqrt(1 + |z|^2), as in Olfati-Saber (64) and (66).

    Raises
    ------
    InvalidInput
        If a gain is negative or not finite.
    """

    leader: Leader = field()
    position_gain: float | Array | Schedule = 0.0
    velocity_gain: float | Array | Schedule = 1.0
    acceleration_gain: float | Array | Schedule = 0.0
    per_mass: bool = False
    shared: bool = False
    saturated: bool = False

    if TYPE_CHECKING:  # Lists are accepted.

        def __init__(
            self, leader: Leader, position_gain: ArrayLike | Schedule = 0.0,
            velocity_gain: ArrayLike | Schedule = 1.0, acceleration_gain: ArrayLike | Schedule = 0.0,
            per_mass: bool = False, shared: bool = False, saturated: bool = False,
        ) -> None: ...  # fmt: skip

    def __post_init__(self) -> None:
        if not isinstance(self.leader, Leader):
            object.__setattr__(self, "leader", Velocity(self.leader))
        for name in ("position_gain", "velocity_gain", "acceleration_gain"):
            value = getattr(self, name)
            if isinstance(value, Schedule):
                for each in value.values:
                    scalar_or_each("Track", name, each, least=0.0)
            else:
                object.__setattr__(self, name, scalar_or_each("Track", name, value, least=0.0))
        for name in ("per_mass", "shared", "saturated"):
            object.__setattr__(self, name, truth("Track", name, getattr(self, name)))

    @property
    def uses_means(self) -> bool:  # type: ignore[override]
        """True for shared feedback, which needs the centre of mass."""
        return self.shared

    def switch_times(self, start: float, end: float) -> tuple[float, ...]:
        """Times in (start, end) at which a scheduled gain changes."""
        gains = [g for g in self._active.values() if isinstance(g, Schedule)]
        return tuple(sorted({s for g in gains for s in g.switch_times(start, end)}))

    @property
    def _active(self) -> dict[str, float | Array | Schedule]:
        names = ("position_gain", "velocity_gain", "acceleration_gain")
        return {name: value for name in names if np.any(np.asarray(value := getattr(self, name)) != 0)}

    @property
    def parameters(self) -> dict[str, Value]:
        """The gains that are not zero, without the parameters of the leader."""
        return dict(self._active)

    @property
    def structure(self) -> tuple[object, ...]:
        """Nonzero gains and form of the feedback."""
        return ("Track", tuple(self._active), self.per_mass, self.shared, self.saturated)

    @property
    def symmetries(self) -> frozenset[str]:
        """Locality, and relabelling unless gains differ between agents; shared feedback is not local."""
        uneven = any(
            value.per_agent if isinstance(value, Schedule) else np.ndim(value) for value in self._active.values()
        )
        return (
            frozenset({"relabelling", "locality"})
            - ({"relabelling"} if uneven else set())
            - ({"locality"} if self.shared else set())
        )

    def _gain(self, x: BodySymbols, name: str) -> sympy.Expr:
        import sympy

        if name not in self._active:
            return sympy.Integer(0)
        scale = x.mass if self.per_mass and name != "acceleration_gain" else sympy.Integer(1)
        return x.parameter(name) * scale

    def _errors(self, x: BodySymbols) -> tuple[list[sympy.Expr], list[sympy.Expr]]:
        q, p = (x.mean_q, x.mean_p) if self.shared else (x.q, x.p)
        position = [a - b for a, b in zip(q, x.leader_q, strict=True)] if "position_gain" in self._active else []
        velocity = [a - b for a, b in zip(p, x.leader_p, strict=True)]
        return (_saturate(position), _saturate(velocity)) if self.saturated else (position, velocity)

    def force(self, x: BodySymbols) -> Sequence[sympy.Expr]:
        """The feedback of both errors, and the leader's acceleration."""
        position, velocity = self._errors(x)
        c1, c2, g = (self._gain(x, n) for n in ("position_gain", "velocity_gain", "acceleration_gain"))
        result = [g * x.mass * a - c2 * e for a, e in zip(x.leader_a, velocity, strict=True)]
        return [f - c1 * e for f, e in zip(result, position, strict=True)] if position else result

    def storage(self, x: BodySymbols) -> sympy.Expr:
        """c1 |q - o|^2 / 2 if the feedback is of the agent and linear, else 0.

        o is the sink, or the origin of a moving frame (the leader, or the centre of mass in Shi's J for (15)).
        """
        import sympy

        origin = self._origin(x)
        if origin is None:
            return sympy.Integer(0)
        return self._gain(x, "position_gain") * sum((a - b) ** 2 for a, b in zip(x.q, origin, strict=True)) / 2

    def _origin(self, x: BodySymbols) -> Sequence[sympy.Expr] | None:
        if "position_gain" not in self._active or self.shared or self.saturated:
            return None
        return x.leader_q if isinstance(self.leader, Sink) else x.frame_q

    def balance(self, x: BodySymbols) -> tuple[sympy.Expr, sympy.Expr]:
        """Linear velocity feedback dissipates c2 |p - frame|^2; the rest of its power is supplied."""
        import sympy

        zero = sympy.Integer(0)
        relative = [a - b for a, b in zip(x.p, x.frame_p, strict=True)]
        # Additional forces of a subclass count as supplied.
        supplied = sum(
            ((f - own) * v for f, own, v in zip(self.force(x), Track.force(self, x), relative, strict=True)), zero
        )
        if self.shared or self.saturated:
            return zero, supplied + sum((f * v for f, v in zip(Track.force(self, x), relative, strict=True)), zero)
        c1, c2, g = (self._gain(x, n) for n in ("position_gain", "velocity_gain", "acceleration_gain"))
        supplied += sum(
            ((g * x.mass * a + c2 * (b - c)) * v
             for a, b, c, v in zip(x.leader_a, x.leader_p, x.frame_p, relative, strict=True)),
            zero,
        )  # fmt: skip
        origin = self._origin(x)
        if origin is None:
            # Without an origin all power of the position feedback is supplied.
            supplied -= sum((c1 * (a - b) * v for a, b, v in zip(x.q, x.leader_q, relative, strict=True)), zero)
        elif isinstance(self.leader, Sink):
            # The stored energy depends on q - o with rate p - frame_p; the power of the frame's motion remains.
            supplied += sum((c1 * (a - b) * v for a, b, v in zip(x.q, origin, x.frame_p, strict=True)), zero)
        else:
            supplied += sum((c1 * (a - b) * v for a, b, v in zip(x.leader_q, origin, relative, strict=True)), zero)
        return c2 * sum((v**2 for v in relative), zero), supplied


def _saturate(error: Sequence[sympy.Expr]) -> list[sympy.Expr]:
    import sympy

    if not error:
        return []
    scale = sympy.sqrt(1 + sum(e**2 for e in error))
    return [e / scale for e in error]


@register_part("compensate")
@dataclass(frozen=True)
class Compensate(BodyTerm):
    """Cancels the velocity damping of the agents: + k_i p_i (Shi (2), the term delta).

    The damping gains are those of `Agents`; the term has no parameters.
    """

    @property
    def parameters(self) -> dict[str, Value]:
        """None."""
        return {}

    @property
    def structure(self) -> tuple[object, ...]:
        """The name."""
        return ("Compensate",)

    @property
    def symmetries(self) -> frozenset[str]:
        """All but momentum and Galilean shifts."""
        return SYMMETRIES - {"momentum", "galilean"}

    def force(self, x: BodySymbols) -> Sequence[sympy.Expr]:
        """k_i p_i."""
        return [x.damping * v for v in x.p]
