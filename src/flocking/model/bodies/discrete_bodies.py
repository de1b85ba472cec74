"""Bodies whose velocities are set at ticks of a clock and stay as they are between: headings, and impulses."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from flocking.arrays import Indices
from flocking.errors import InvalidInput
from flocking.model.bodies.body import Body, MotionSymbols
from flocking.model.bodies.vector_lengths import lowered, scaled
from flocking.model.checks import Array, one_of, scalar_or_each
from flocking.model.parts import values
from flocking.model.parts.registration import register_part
from flocking.model.parts.seeds import seed_number
from flocking.model.world.control import Control, Held
from flocking.model.world.random_numbers import Purpose, normal_axes, uniform

if TYPE_CHECKING:
    import sympy
    from numpy.typing import ArrayLike

UPDATES = ("backward", "forward", "sequential", "shuffled")
"""With which velocity a body moves after a tick, that before it or that which it sets, and on whose state it acts."""

IN_TURN = ("sequential", "shuffled")
"""Updates in which agents act one after another."""

UPDATE_RULE = "must be 'backward', 'forward', 'sequential' or 'shuffled'"

NOISES = ("angular", "vectorial")
"""What is random at a tick: the angle of a heading, or a vector added to the average of the neighbours."""

PLANE = 2
"""Dimensions in which an angle turns a heading."""

SPEED = 1e-9
"""Largest relative difference of a given speed from that of the body."""


class DiscreteBody(Body):
    """A body in discrete time: at each of its ticks it sets a velocity, and between ticks it moves in a straight line.

    With ``update="backward"`` the velocity that is set at a tick is that of the next interval but one: the body moves
    on to its next tick with the velocity it has, q(t + T) = q(t) + T p(t), and takes the new one there. With
    ``"forward"`` it takes the new one at once, q(t + T) = q(t) + T p(t + T) (Baglietto and Albano 2009 compare both).
    In both all agents that tick at one instant act on the same state. With ``"sequential"`` agents take the new one at
    once and act one after another, in the order of their numbers: each acts on the new velocities of those before it,
    and uses the places that they reach with these velocities by the next tick. ``"shuffled"`` is the same in a new
    random order at every tick (sequential random activation). A subclass states `updated`.
    """

    update: str = "backward"
    seed: int = 0
    discrete = True
    moves_itself = False
    """Whether it states how it moves until its next tick, as `flocking.model.bodies.velocity_units.VelocityUnit`."""

    @property
    def in_turn(self) -> bool:
        """Whether agents that tick together act one after another."""
        return self.update in IN_TURN

    def turns(self, n: int, tick: int) -> Indices:
        """The order in which ``n`` agents act one after another.

        Parameters
        ----------
        n
            Number of agents.
        tick
            How often they have ticked before.
        """
        if self.update != "shuffled":
            return np.arange(n)
        return np.argsort(uniform(self.seed, Purpose.TURN, np.arange(n), 0, tick), kind="stable")

    @property
    def draws(self) -> bool:
        """Whether it draws numbers at a tick, which are others for other agents."""
        return False

    @property
    def symmetries(self) -> frozenset[str]:
        """Those of any body; relabelling only where agents act together and draw nothing."""
        return super().symmetries - ({"relabelling"} if self.in_turn or self.draws else set())

    @abstractmethod
    def updated(self, p: Array, u: Array, period: Array, agents: Indices, tick: Indices) -> Array:
        """Velocities that ``agents`` set at a tick, shape (K, m).

        Parameters
        ----------
        p, u
            Their velocities, and the forces of the law, shape (K, m).
        period
            Time until the next tick of each, shape (K,).
        agents, tick
            Their numbers, and how often each has ticked before, shape (K,).
        """

    @property
    def order(self) -> int:
        """2: an agent has a velocity of its own."""
        return 2

    def rates(self, x: MotionSymbols) -> dict[str, Sequence[sympy.Expr]]:
        """No acceleration: between ticks the velocity stays as it is."""
        import sympy

        return {"p": [sympy.Integer(0) for _ in x.p]}

    def check_scenario(self, control: Control, q: Array, p: Array) -> None:
        """Refuse control that has no ticks, or whose forces act later.

        Parameters
        ----------
        control, q, p
            As for `flocking.model.bodies.body.Body.check_scenario`.

        Raises
        ------
        InvalidInput
            When it is so.
        """
        owner = type(self).__name__
        if not isinstance(control, Held):
            raise InvalidInput(
                "Scenario", "control", f"must be Held for {owner} agents, which set their velocity at ticks",
                type(control).__name__, "Give control=Held(period).",
            )  # fmt: skip
        if type(control) is not Held:
            raise InvalidInput(
                "Scenario", "control", f"must be Held alone for {owner} agents", type(control).__name__,
                "Other kinds of held control change forces of point masses.",
            )  # fmt: skip
        if self.in_turn and (np.ptp(np.asarray(control.period)) or np.ptp(np.asarray(control.phase))):
            raise InvalidInput(
                "Held", "period", f"must be the same for all agents, and their phase, with update={self.update!r}",
                "different ones", "Agents that act one after another do so at one tick.",
            )  # fmt: skip
        if control.latencies(len(q)).any():
            raise InvalidInput(
                "Held", "latency", f"must be 0 for {owner} agents", float(np.max(control.latency)),
                "With update='backward' a velocity that is set at a tick is taken at the next one.",
            )  # fmt: skip


@register_part("heading")
@dataclass(frozen=True, eq=False)
class Heading(DiscreteBody):
    """An agent of constant speed that sets its heading at ticks, with noise (Vicsek et al. 1995).

    At a tick it turns into the direction of w = p + T u/m, T its period and u the force of the law; with
    `flocking.model.terms.alignment.VelocityAverage` of gain 1/T and m = 1 that is the average velocity of the agent and
    its neighbours. Where w is zero it keeps its heading. Noise acts in one of two ways. ``"angular"``: the direction
    is turned by an angle drawn evenly from [-noise/2, noise/2] (Vicsek et al. 1995; in the plane). ``"vectorial"``:
    the direction is that of w/speed + noise x, with a random unit vector x (Gregoire and Chate 2004). Draws are
    functions of the seed, the agent and the number of its tick.

    Parameters
    ----------
    speed
        Speed, one for all agents or one for each; positive. Velocities of a start must have it.
    noise
        Width of the interval of angles in radians, or size of the random vector; not negative.
    noise_kind
        ``"angular"`` or ``"vectorial"``.
    update
        ``"backward"``, as in the paper, ``"forward"``, ``"sequential"`` or ``"shuffled"``; see `DiscreteBody`.
    seed
        Seed of the draws.
    masses
        Weight of an agent, and what divides the force; positive.

    Raises
    ------
    InvalidInput
        When a value is out of range.

    Examples
    --------
    >>> import flocking as fk
    >>> fk.Heading(0.03, noise=2.0).summary
    'headings set at ticks, with angular noise 2'
    """

    speed: Annotated[float | Array, values.hidden(values.NUMBER_OR_NUMBERS)]
    noise: float | Array = 0.0
    noise_kind: Annotated[str, values.choice(*NOISES)] = "angular"
    update: Annotated[str, values.choice(*UPDATES)] = "backward"
    seed: Annotated[int, values.SEED] = 0
    masses: float | Array = 1.0

    if TYPE_CHECKING:  # Lists are accepted.

        def __init__(
            self, speed: ArrayLike, noise: ArrayLike = 0.0, noise_kind: str = "angular", update: str = "backward",
            seed: int = 0, masses: ArrayLike = 1.0,
        ) -> None: ...  # fmt: skip

    def __post_init__(self) -> None:
        object.__setattr__(self, "speed", scalar_or_each("Heading", "speed", self.speed, above=0.0))
        object.__setattr__(self, "noise", scalar_or_each("Heading", "noise", self.noise, least=0.0))
        one_of("Heading", "noise_kind", self.noise_kind, NOISES, "must be 'angular' or 'vectorial'")
        one_of("Heading", "update", self.update, UPDATES, UPDATE_RULE)
        object.__setattr__(self, "seed", seed_number("Heading", self.seed))
        self.check_fields()

    @property
    def parameters(self) -> dict[str, float | Array]:
        """Speed and noise."""
        return {"speed": self.speed, "noise": self.noise}

    @property
    def draws(self) -> bool:
        """Whether there is noise."""
        return bool(np.any(np.asarray(self.noise)))

    @property
    def summary(self) -> str:
        """That headings are set at ticks, and the noise."""
        most = float(np.max(self.noise))
        return f"headings set at ticks, with {self.noise_kind} noise {most:g}" if most else "headings set at ticks"

    def check_scenario(self, control: Control, q: Array, p: Array) -> None:
        """Refuse control without ticks, velocities of another speed, and angles without a plane.

        Parameters
        ----------
        control, q, p
            As for `flocking.model.bodies.body.Body.check_scenario`.

        Raises
        ------
        InvalidInput
            When it is so.
        """
        DiscreteBody.check_scenario(self, control, q, p)
        if self.noise_kind == "angular" and np.max(self.noise) > 0.0 and q.shape[1] != PLANE:
            raise InvalidInput(
                "Heading", "noise_kind", f"must be 'vectorial' for noise in {q.shape[1]} dimensions", self.noise_kind,
                "An angle turns a heading in the plane alone.",
            )  # fmt: skip
        speed = np.broadcast_to(np.asarray(self.speed, dtype=np.float64), len(q))
        found = np.linalg.norm(p, axis=1)
        wrong = np.abs(found - speed) > SPEED * speed
        if wrong.any():
            agent = int(np.argmax(wrong))
            raise InvalidInput(
                "Scenario", "start", f"must have velocities of the speed of Heading, {speed[agent]:.10g}",
                f"{found[agent]:.10g} of agent {agent}", "Draw them with velocities='sphere', or scale them.",
            )  # fmt: skip

    def updated(self, p: Array, u: Array, period: Array, agents: Indices, tick: Indices) -> Array:
        """Velocities of the new headings.

        Parameters
        ----------
        p, u, period, agents, tick
            As for `DiscreteBody.updated`.
        """
        speed, noise = (_of_agents(x, agents) for x in (self.speed, self.noise))
        noisy = bool(np.max(noise) > 0.0)
        desired, length = lowered(self.desired(p, u, period, agents, tick))
        still = (length == 0.0)[:, None]
        found = np.where(still, p / speed[:, None], desired / np.where(still, 1.0, length[:, None]))
        if noisy and self.noise_kind == "angular":
            angle = noise * (uniform(self.seed, Purpose.HEADING, agents, 0, tick) - 0.5)
            c, s = np.cos(angle), np.sin(angle)
            found = np.column_stack([c * found[:, 0] - s * found[:, 1], s * found[:, 0] + c * found[:, 1]])
        return np.asarray(speed[:, None] * found)

    def desired(self, p: Array, u: Array, period: Array, agents: Indices, tick: Indices) -> Array:
        """Vectors into whose directions ``agents`` turn, before angular noise; of any length, shape (K, m).

        Parameters
        ----------
        p, u, period, agents, tick
            As for `DiscreteBody.updated`.
        """
        speed, noise, mass = (_of_agents(x, agents) for x in (self.speed, self.noise, self.masses))
        found = p + u * (period / mass)[:, None]
        if np.max(noise) > 0.0 and self.noise_kind == "vectorial":
            found = found / speed[:, None] + noise[:, None] * self._unit_vectors(p.shape[1], agents, tick)
        return np.asarray(found)

    def _unit_vectors(self, dimension: int, agents: Indices, tick: Indices) -> Array:
        """Unit vectors of random directions, shape (K, m)."""
        found = np.column_stack(normal_axes(self.seed, Purpose.HEADING, agents, tick, dimension))
        return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


@register_part("impulsive")
@dataclass(frozen=True, eq=False)
class Impulsive(DiscreteBody):
    """A mass whose velocity jumps at ticks: p becomes p + T (u - k p)/m, with limits of force and speed.

    It is the double integrator in discrete time: with ``update="backward"`` the explicit Euler method of a
    `flocking.model.bodies.point_bodies.PointMass` as a model of its own, as in the discrete-time law of Cucker and
    Smale (2007); with ``"forward"`` the symplectic one. Between ticks nothing acts.

    Parameters
    ----------
    masses, damping
        Masses, and gains k of the damping, one for all agents or one for each.
    force, speed
        Largest force and largest speed, one for all or one for each; longer vectors are scaled back. Infinite by
        default.
    update
        ``"backward"``, ``"forward"``, ``"sequential"`` or ``"shuffled"``; see `DiscreteBody`.
    seed
        Seed of the order of ``"shuffled"``.

    Raises
    ------
    InvalidInput
        When a value is out of range.

    Examples
    --------
    >>> import flocking as fk
    >>> fk.Impulsive(speed=9.0, force=27.0).summary
    'velocities set at ticks, force up to 27, speed up to 9'
    """

    masses: float | Array = 1.0
    damping: float | Array = 0.0
    force: float | Array | None = None
    speed: float | Array | None = None
    update: Annotated[str, values.choice(*UPDATES)] = "backward"
    seed: Annotated[int, values.SEED] = 0

    if TYPE_CHECKING:  # Lists are accepted.

        def __init__(
            self, masses: ArrayLike = 1.0, damping: ArrayLike = 0.0, force: ArrayLike | None = None,
            speed: ArrayLike | None = None, update: str = "backward", seed: int = 0,
        ) -> None: ...  # fmt: skip

    def __post_init__(self) -> None:
        for name in ("force", "speed"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, scalar_or_each("Impulsive", name, getattr(self, name), above=0.0))
        one_of("Impulsive", "update", self.update, UPDATES, UPDATE_RULE)
        object.__setattr__(self, "seed", seed_number("Impulsive", self.seed))
        self.check_fields()

    @property
    def parameters(self) -> dict[str, float | Array]:
        """The limits that there are."""
        return {name: value for name, value in (("force", self.force), ("speed", self.speed)) if value is not None}

    @property
    def structure(self) -> tuple[object, ...]:
        """The kind of body, and which limits there are."""
        return (*super().structure, self.force is not None, self.speed is not None)

    @property
    def summary(self) -> str:
        """That velocities are set at ticks, and the limits."""
        limits = (f"{name} up to {float(np.max(value)):g}" for name, value in self.parameters.items())
        return ", ".join(["velocities set at ticks", *limits])

    def updated(self, p: Array, u: Array, period: Array, agents: Indices, tick: Indices) -> Array:
        """Velocities after the impulse of one period.

        Parameters
        ----------
        p, u, period, agents, tick
            As for `DiscreteBody.updated`.
        """
        mass, damping = (_of_agents(x, agents) for x in (self.masses, self.damping))
        applied = _within(u, self.force, agents)
        return _within(p + (applied - damping[:, None] * p) * (period / mass)[:, None], self.speed, agents)


def _of_agents(value: float | Array, agents: Indices) -> Array:
    """Numbers of ``agents``, shape (K,), from one for all or one for each."""
    found = np.asarray(value, dtype=np.float64)
    return found[agents] if found.ndim else np.full(len(agents), float(found))


def _within(vectors: Array, limit: float | Array | None, agents: Indices) -> Array:
    """Vectors, shape (K, m), those longer than a limit scaled back to it."""
    if limit is None:
        return vectors
    most = _of_agents(limit, agents)
    with np.errstate(over="ignore"):
        longer = np.linalg.norm(vectors, axis=1) > most
    return scaled(vectors, longer, most)
