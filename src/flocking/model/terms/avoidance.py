"""Obstacle avoidance: repulsion by beta-agents on the obstacles, attraction by gamma-agents inside them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from flocking.errors import InvalidInput
from flocking.formula.derivatives import derivative
from flocking.model.checks import listed, number, truth
from flocking.model.leaders_and_obstacles.leaders import Leader, Velocity
from flocking.model.leaders_and_obstacles.obstacles import TINY, Obstacle
from flocking.model.parts.registration import register_part
from flocking.model.potentials.bumps import Bump, bump_named
from flocking.model.potentials.potential import Potential
from flocking.model.potentials.sigma_norm import SigmaNorm, sigma_share
from flocking.model.potentials.structural_potential import structural_potential
from flocking.model.terms.body_terms import BodyTerm
from flocking.model.terms.pair_terms import Value
from flocking.model.terms.symbols import BodySymbols, ObstacleSymbols

if TYPE_CHECKING:
    import sympy

REPULSION = "sqrt(1 + (r - d)**2) - (r - d)"
"""Potential of the beta-agents; its slope is phi_beta(r - d), phi_beta(z) = z/sqrt(1 + z^2) - 1 <= 0."""


@dataclass(frozen=True)
class PerObstacle:
    """A parameter with one value per obstacle of a group.

    Parameters
    ----------
    values
        The values.
    """

    values: tuple[float, ...]


@dataclass(frozen=True)
class ObstacleGroup:
    """Obstacles with the same structure: common formulas, with parameters in the columns of a table.

    Parameters
    ----------
    obstacles
        The obstacles.
    numbers
        Their numbers in the term.
    """

    obstacles: tuple[Obstacle, ...]
    numbers: tuple[int, ...]

    @property
    def structure(self) -> tuple[object, ...]:
        """The common structure."""
        return self.obstacles[0].structure

    @cached_property
    def rows(self) -> dict[str, PerObstacle]:
        """One value per obstacle for every parameter."""
        owned = [x.parameters for x in self.obstacles]
        return {name: PerObstacle(tuple(values[name] for values in owned)) for name in owned[0]}


class ObstacleTerm(BodyTerm):
    """A term that acts on agents near obstacles, for each obstacle within `range`.

    A pair (agent, obstacle) is active while their distance is at most `range`; engines locate the switch in time.
    A subclass defines the force of one active obstacle and the balance of its power.
    """

    obstacles: Sequence[Obstacle]
    range: float

    @abstractmethod
    def obstacle_force(self, x: ObstacleSymbols) -> Sequence[sympy.Expr]:
        """Force of one active obstacle on agent i, m expressions."""

    def obstacle_balance(self, x: ObstacleSymbols) -> tuple[sympy.Expr, sympy.Expr]:
        """Power dissipated and power supplied by one active obstacle, in the frame that moves with ``x.frame_p``."""
        import sympy

        force = self.obstacle_force(x)
        power = sum((f * (v - w) for f, v, w in zip(force, x.p, x.frame_p, strict=True)), sympy.Integer(0))
        return sympy.Integer(0), power

    def kinks(self) -> tuple[float, ...]:
        """Distances from the boundary at which the force has a kink."""
        return (0.0,)

    def force(self, x: BodySymbols) -> Sequence[sympy.Expr]:
        """Zero: the forces of obstacles are in `obstacle_force`."""
        import sympy

        return [sympy.Integer(0)] * len(x.q)

    @property
    def groups(self) -> tuple[ObstacleGroup, ...]:
        """The obstacles, sorted by type and structure."""
        found: dict[object, list[int]] = {}
        for k, obstacle in enumerate(self.obstacles):
            # A subclass may define other formulas and inherit the structure.
            found.setdefault((type(obstacle), obstacle.structure), []).append(k)
        return tuple(
            ObstacleGroup(tuple(self.obstacles[k] for k in numbers), tuple(numbers)) for numbers in found.values()
        )

    def solids(self, dimension: int) -> tuple[Obstacle, ...]:
        """The obstacles."""
        return tuple(self.obstacles)

    def check_dimension(self, dimension: int) -> None:
        """Check that all obstacles have ``dimension`` dimensions.

        Raises
        ------
        InvalidInput
            If one has not.
        """
        for obstacle in self.obstacles:
            if obstacle.dimension != dimension:
                raise InvalidInput(
                    type(obstacle).__name__, "dimension", f"must be that of the agents, {dimension}", obstacle.dimension
                )


@register_part("avoid")
@dataclass(frozen=True, eq=False)
class Avoid(ObstacleTerm):
    """Olfati-Saber (54): c3 rho phi_beta n(qhat - q) + phi_gamma n(x_k - q) + c4 (phat - p), for obstacles within r0.

    Distances to an obstacle are signed. Inside it the beta-agent repels outwards, with a force that grows with the
    depth, and only the velocity along the outward normal is damped.

    Parameters
    ----------
    obstacles
        The obstacles.
    leader
        Leader whose velocity is the desired direction n_d; a vector is a leader with that velocity. Only needed for
        gamma-agents.
    range
        r0; the paper takes r/2.
    repulsion_gain
        c3.
    damping_gain
        c4.
    repulsion
        Potential whose slope is phi_beta(. - d_beta); the default has d_beta = ``range``.
    attraction
        Potential whose slope is phi_gamma(. - d_gamma); the default has d_gamma = 7, a = 1, b = 5.
    offset
        lambda_d: the gamma-agent is at x_k = b_k + lambda_d n_d.
    onset, bump
        k0 and shape of the bump rho of distance/r0, which multiplies only the force of the beta-agent, as printed.
    gamma_agents
        Whether there are gamma-agents. A `Wall` has no centre and no gamma-agent.
    sigma_norm
        epsilon of the sigma-norm in which the bump compares distances, as in Olfati-Saber (2006); None for signed
        distances themselves. Inside an obstacle the sigma-norm is that of the depth, so that the bump fades there too.
    fading_damping
        Whether the bump multiplies the damping too, as in Olfati-Saber (2006).

    Raises
    ------
    InvalidInput
        If a value is out of range, an obstacle is invalid, or gamma-agents lack a direction.
    """

    obstacles: Sequence[Obstacle]
    leader: Leader | None = None
    range: float = field(kw_only=True)
    repulsion_gain: float = field(default=100.0, kw_only=True)
    damping_gain: float = field(default=2.0, kw_only=True)
    repulsion: Potential = field(default=None, kw_only=True)  # type: ignore[assignment]
    attraction: Potential = field(default=None, kw_only=True)  # type: ignore[assignment]
    offset: float = field(default=1.0, kw_only=True)
    onset: float = field(default=5 / 6, kw_only=True)
    bump: str | Bump = field(default="cosine", kw_only=True)
    gamma_agents: bool = field(default=True, kw_only=True)
    sigma_norm: float | None = field(default=None, kw_only=True)
    fading_damping: bool = field(default=False, kw_only=True)

    def __post_init__(self) -> None:
        given = (self.obstacles,) if isinstance(self.obstacles, Obstacle) else self.obstacles
        obstacles = tuple(listed("Avoid", "obstacles", given, "must be obstacles"))
        for obstacle in obstacles:
            if not isinstance(obstacle, Obstacle):
                raise InvalidInput(
                    "Avoid", "obstacles", "must be obstacles", obstacle, "Use Ball, Wall or ConvexPolygon."
                )
        object.__setattr__(self, "obstacles", obstacles)
        if self.leader is not None and not isinstance(self.leader, Leader):
            object.__setattr__(self, "leader", Velocity(self.leader))
        object.__setattr__(self, "range", number("Avoid", "range", self.range, above=0.0))
        for name in ("repulsion_gain", "damping_gain"):
            object.__setattr__(self, name, number("Avoid", name, getattr(self, name), least=0.0))
        object.__setattr__(self, "offset", number("Avoid", "offset", self.offset))
        object.__setattr__(self, "onset", number("Avoid", "onset", self.onset, above=0.0, below=1.0))
        bump_named("Avoid", self.bump)
        if self.repulsion is None:
            object.__setattr__(self, "repulsion", Potential(REPULSION, d=self.range))
        if self.attraction is None:
            object.__setattr__(self, "attraction", structural_potential(7.0))
        for name in ("repulsion", "attraction"):
            if not isinstance(getattr(self, name), Potential):
                raise InvalidInput("Avoid", name, "must be a Potential", getattr(self, name))
        for name in ("gamma_agents", "fading_damping"):
            object.__setattr__(self, name, truth("Avoid", name, getattr(self, name)))
        if self.sigma_norm is not None:
            object.__setattr__(self, "sigma_norm", number("Avoid", "sigma_norm", self.sigma_norm, above=0.0))
        if self.gamma_agents and self.leader is None:
            raise InvalidInput(
                "Avoid", "leader", "must be given for gamma-agents", None,
                "Give the desired velocity, or gamma_agents=False.",
            )  # fmt: skip

    @property
    def parameters(self) -> dict[str, Value]:
        """Gains, range, bump and the parameters of both potentials, without those of obstacles."""
        found: dict[str, Value] = {name: getattr(self, name) for name in ("range", "repulsion_gain", "damping_gain")}
        found |= {"onset": self.onset}
        if self.sigma_norm is not None:
            found |= {"sigma_norm": self.sigma_norm}
        found |= {f"repulsion_{name}": value for name, value in self.repulsion.parameters.items()}
        if self.gamma_agents:
            found |= {"offset": self.offset}
            found |= {f"attraction_{name}": value for name, value in self.attraction.parameters.items()}
        return found

    @property
    def structure(self) -> tuple[object, ...]:
        """The formulas, and the structures of the obstacles."""
        shape = bump_named("Avoid", self.bump).structure
        attraction = self.attraction.formula.structure if self.gamma_agents else None
        kinds = tuple(group.structure for group in self.groups)
        more = (*(() if self.sigma_norm is None else ("sigma-norm",)), *(("fading",) if self.fading_damping else ()))
        return ("Avoid", shape, self.repulsion.formula.structure, attraction, kinds, *more)

    def kinks(self) -> tuple[float, ...]:
        """The boundary, the onset of the bump, and the kinks of the repulsion."""
        begin = self.onset * self.range
        if self.sigma_norm is not None:
            norm = SigmaNorm(self.sigma_norm)
            begin = norm.inverse(self.onset * float(norm(self.range)))
        return tuple(sorted({0.0, begin, *self.repulsion.kinks()}))

    def _slope(self, potential: Potential, prefix: str, r: sympy.Expr, x: ObstacleSymbols) -> sympy.Expr:
        import sympy

        distance = sympy.Dummy("r", positive=True)
        psi = potential.expression(distance, {k: x.parameter(f"{prefix}_{k}") for k in potential.parameters})
        return derivative(psi, distance).subs(distance, r)

    def _fading(self, x: ObstacleSymbols) -> sympy.Expr:
        """The bump of the relative distance."""
        share = x.distance / x.parameter("range")
        if self.sigma_norm is not None:
            share = sigma_share(x.distance, x.parameter("range"), x.parameter("sigma_norm"))
        return bump_named("Avoid", self.bump).expression(share, x.parameter("onset"))

    def _damping(self, x: ObstacleSymbols) -> sympy.Expr:
        """Coefficient of the damping."""
        gain = x.parameter("damping_gain")
        return gain * self._fading(x) if self.fading_damping else gain

    def _forces(self, x: ObstacleSymbols) -> list[sympy.Expr]:
        """All forces except the damping."""
        import sympy

        rho = self._fading(x)
        push = -x.parameter("repulsion_gain") * rho * self._slope(self.repulsion, "repulsion", x.distance, x)
        found = [push * n for n in x.normal]
        if self.gamma_agents and x.anchor is not None:
            speed = sympy.sqrt(sum(v**2 for v in x.leader_p) + sympy.Float(TINY))
            place = [b + x.parameter("offset") * v / speed for b, v in zip(x.anchor, x.leader_p, strict=True)]
            away = [a - b for a, b in zip(place, x.q, strict=True)]
            far = sympy.sqrt(sum(d**2 for d in away) + sympy.Float(TINY))
            pull = self._slope(self.attraction, "attraction", far, x)
            found = [f + pull * d / far for f, d in zip(found, away, strict=True)]
        return found

    def obstacle_force(self, x: ObstacleSymbols) -> Sequence[sympy.Expr]:
        """(54)."""
        c4 = self._damping(x)
        return [f + c4 * (w - v) for f, w, v in zip(self._forces(x), x.boundary, x.p, strict=True)]

    def obstacle_balance(self, x: ObstacleSymbols) -> tuple[sympy.Expr, sympy.Expr]:
        """The damping dissipates c4 |phat - p|^2; all other power counts as supplied."""
        import sympy

        c4 = self._damping(x)
        slip = [w - v for w, v in zip(x.boundary, x.p, strict=True)]
        supplied = sum(
            (f * (v - frame) + c4 * s * (w - frame)
             for f, v, s, w, frame in zip(self._forces(x), x.p, slip, x.boundary, x.frame_p, strict=True)),
            sympy.Integer(0),
        )  # fmt: skip
        return c4 * sum(s**2 for s in slip), supplied
