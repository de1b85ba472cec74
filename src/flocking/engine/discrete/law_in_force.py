"""The desired forces of the law on a group at a tick, and their comparison with the declared law."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flocking.arrays import Array, Indices
from flocking.engine.discrete.cell_pairs import AXES, CellPairs
from flocking.engine.discrete.linked_pairs import MOST_DENSE, Neighbours
from flocking.engine.fixed_step.declared_law import POWERS, SAFETY, Declared, Group, LinkedPairs, Statement, means_of
from flocking.engine.fixed_step.law_gaps import EDGE, SPREAD, LawGaps
from flocking.engine.kernels.codegen import compiled_kernels
from flocking.engine.kernels.law_kernels import LawKernels, Slots, free_pairs
from flocking.engine.kernels.layout import Layout
from flocking.engine.kernels.obstacle_distances import ObstacleDistances
from flocking.engine.reference.steering import WIDER, everyone, farthest, seen_by, steering_forces, within
from flocking.errors import InvalidInput, LawNotObeyed
from flocking.model.bodies.discrete_bodies import Heading
from flocking.model.graph_functional import averages, graph_functional, uses_functional
from flocking.model.law import Scenario
from flocking.model.terms.steering import Seen
from flocking.model.world.control import Held
from flocking.model.world.times import NANOSECOND

CHECKED = 64
"""Number of agents whose forces are compared with the declared law at a tick that is checked."""

MOST_COMPARED = 4_000_000
"""Largest number of distances that such a comparison looks at."""

LARGEST = 1e18
"""Numbers up to which forces are compared: rounding is measured in single precision, which holds their squares."""

UNIT = float(np.finfo(np.float64).eps)
"""Rounding unit of the state."""

Judged = tuple[Indices, list[LinkedPairs]]
"""Agents whose forces are compared with the law, and their linked pairs under each graph."""


class Known(NamedTuple):
    """What agents know of themselves and of others.

    Parameters
    ----------
    heard
        Fixes, the newest first, shape (delay + 1, N, 2 m): agents know their own newest, and the oldest of others.
    range
        Distance, of the true positions, up to which others are heard.
    """

    heard: Array
    range: float

    def furthest_off(self, q: Array) -> float:
        """How far known distances of two agents may be from the true ones with agents at ``q``, shape (N, m)."""
        m = q.shape[1]
        own, late = (float(np.sqrt(((x[:, :m] - q) ** 2).sum(axis=1)).max()) for x in (self.heard[0], self.heard[-1]))
        return own + late

    def seen(self, agents: Indices, others: tuple[Indices, Indices]) -> Seen:
        """What agents know of others.

        Parameters
        ----------
        agents
            Numbers of the agents, shape (K,).
        others
            Pairs: places in ``agents``, and the others, shape (L,) each.
        """
        (of, j), m = others, self.heard.shape[2] // 2
        own, late = self.heard[0][agents], self.heard[-1][j]
        offset = late[:, :m] - own[of, :m]
        return Seen(own[:, :m], own[:, m:], of, offset, np.sqrt((offset**2).sum(axis=1)), late[:, m:])


class DiscreteLaw:
    """The law of a scenario on the present state.

    Parameters
    ----------
    scenario
        The scenario.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario, self.law = scenario, scenario.law
        self.n, self.m = scenario.start.q.shape
        self.layout = Layout(self.law, scenario.energy, scenario.agents, scenario.space, steering=True)
        self._reach = farthest(self.law.steering_terms)
        heard = getattr(scenario.information, "range", None)
        self._reach = heard if heard is not None else self._reach
        self._search: CellPairs | None = None
        if self._reach and self.m > AXES and self.n > MOST_DENSE:
            raise InvalidInput(
                "start", "engine", f"must be another one for more than {MOST_DENSE} agents that steer in more than "
                f"{AXES} dimensions", f"'discrete' for {self.n}", "It compares all pairs there at every tick.",
            )  # fmt: skip
        if self._reach and self.m <= AXES:
            self._search = CellPairs(scenario.space, self._reach * WIDER, self.n)
        self._kernels = LawKernels(compiled_kernels(self.layout, self.m), 2)
        self._obstacles = ObstacleDistances(self.law)
        begin = scenario.start.t
        # Times of ticks are whole nanoseconds: gains change at those nearest to the times of their schedule.
        self._changes = sorted({s for term in self.law.body_terms for s in term.switch_times(begin, np.inf)})
        used = [k for k in range(len(self.law.graphs)) if uses_functional(self.law, k)]
        self._averaging = [k for k in used if averages(self.law, k)]
        self._others = [k for k in used if k not in self._averaging]
        self._rates = np.empty(3)
        self._declared: Declared | None = None
        self._take_parameters(scenario.start.t)

    def _last_change(self, t: float) -> float:
        """When the gains that are in force at the scenario's time ``t`` began."""
        return max((s for s in self._changes if s <= t + 0.5 * NANOSECOND), default=self.scenario.start.t)

    def _take_parameters(self, t: float) -> None:
        """Take the gains that are in force at the scenario's time ``t``."""
        self._since = self._last_change(t)
        self._slots = Slots(*self.layout.values(self.scenario.agents, self.n, self._since))

    def forces(
        self, t: float, q: Array, p: Array, neighbours: list[Neighbours], known: Known | None = None
    ) -> Array:  # fmt: skip
        """Desired forces of the law on all agents, shape (N, m).

        Parameters
        ----------
        t
            The scenario's time.
        q, p
            Positions and velocities, shape (N, m).
        neighbours
            Linked pairs of each graph.
        known
            What agents know, where that is not the present.

        Raises
        ------
        InvalidInput
            When a functional of a graph does not exist for its links.
        """
        if self._last_change(t) != self._since:
            self._take_parameters(t)
        pairs = free_pairs([*(each.pairs for each in neighbours), *self._obstacles.met(q, t)])
        u = np.zeros((self.n, self.m))
        self._kernels.control(t, q, p, pairs, self._slots, self._functionals(neighbours), u, self._rates)
        return np.asarray(u + self._steering(q, p, known)) if self.law.steering_terms else u

    def _steering(self, q: Array, p: Array, known: Known | None = None) -> Array:
        """Forces of the steering terms, shape (N, m), on agents that a cell list finds, beyond its axes all pairs."""
        agents, space = np.arange(self.n), self.scenario.space
        reach, search = self._reach, self._search
        if known is not None and not np.isfinite(known.range) and reach:
            # All are heard: terms compare distances that are known, and agents further away may be known to be near.
            reach += known.furthest_off(q)
            search = None if search is None else CellPairs(space, reach * WIDER, self.n)
        others = everyone(agents, q, reach, space) if search is None else search.near(q)[:2]
        if known is None:
            seen = seen_by(agents, others, q, p, space)
        else:
            seen = known.seen(agents, within(others, agents, q, known.range))
        found = np.zeros((self.n, self.m))
        for term in self.law.steering_terms:
            found += term.steer(seen)
        return found

    def forces_in_turn(self, q: Array, p: Array, agent: int) -> Array:
        """Force that the steering terms ask of one agent, shape (m,).

        Parameters
        ----------
        q, p
            Positions and velocities of all agents at its turn, shape (N, m).
        agent
            Its number.
        """
        return np.asarray(steering_forces(self.law, q, p, self.scenario.space, np.array([agent]))[0])

    def _functionals(self, neighbours: list[Neighbours]) -> Array:
        """Functionals of the graphs, shape (graphs, N)."""
        found = np.ones((len(neighbours), self.n))
        for number in self._averaging:
            found[number] = 1.0 / (1.0 + np.bincount(neighbours[number].pairs[0], minlength=self.n))
        for number in self._others:
            each = neighbours[number]
            found[number] = graph_functional(self.law, number, each.matrix(each.pairs))
        return found

    def judged(
        self, step: int, neighbours: list[Neighbours], q: Array, slack: float = EDGE * UNIT, *, at_start: bool = False
    ) -> Judged | None:
        """Agents whose forces are to be compared, and their links by distances from all agents; None for no law.

        Parameters
        ----------
        step
            Number of the tick, which chooses the agents.
        neighbours
            Linked pairs of each graph before agents came to ``q``, shape (N, m).
        slack
            Relative difference of a distance from a radius within which a link is uncertain.
        at_start
            Whether nobody has moved yet.
        """
        if self._others:
            return None
        count = min(CHECKED, self.n, max(1, MOST_COMPARED // self.n))
        first = int(step * SPREAD * self.n) % self.n
        agents: Indices = np.unique((first + np.arange(count) * self.n // count) % self.n).astype(np.int64)
        return agents, [each.seen_by(agents, q, slack, at_start=at_start) for each in neighbours]

    def compare(
        self, judged: Judged, t: float, state: tuple[Array, Array], u: Array, gaps: LawGaps, known: Known | None = None,
        rounding: Array | None = None,
    ) -> None:  # fmt: skip
        """Compare forces of some agents with those of the declared law, while no number is too large for it.

        Parameters
        ----------
        judged
            The agents and their links, see `judged`.
        t, state
            The scenario's time; positions and velocities, shape (N, m) each.
        u
            The forces to compare, shape (N, m).
        gaps
            Takes the largest difference.
        known
            What agents know, where that is not the present.
        rounding
            Bound on the rounding error of the forces of these agents, shape (K,), where that is not of the terms.

        Raises
        ------
        LawNotObeyed
            When they are not those of the law.
        """
        if self._declared is None:
            self._declared = Declared(self.scenario, UNIT)
        (q, p), (agents, pairs) = state, judged
        if max(float(np.abs(x).max()) for x in (q, p, u)) > LARGEST:
            return
        masses = np.broadcast_to(np.asarray(self.scenario.agents.masses, dtype=np.float64), self.n)
        means = means_of(q, p, masses, np.asarray, self.n)
        group = Group(q, p, np.arange(self.n), t, self._since, np.zeros(self.m), means[0], means[1], means[2:])
        declared = self._declared.state(group, agents, pairs)
        if self.law.steering_terms:
            # The functions of arrays are the same: what is compared is who sees whom, here by comparison with all.
            steering = self._compared(agents, q, p, known)
            size = np.sqrt((steering**2).sum(axis=1))
            declared = replace(
                declared, force=declared.force + steering, size=declared.size + size,
                force_error=declared.force_error + SAFETY * UNIT * size,
            )  # fmt: skip
        damping = np.broadcast_to(np.asarray(self.scenario.agents.damping, dtype=np.float64), self.n)
        if rounding is None:
            rounding = np.zeros(len(agents))
        wrong = gaps.compare_forces(declared, u[agents] - damping[agents, None] * p[agents], rounding)
        self._count(gaps, t, None if wrong is None else int(agents[wrong]))

    def compare_headings(
        self, step: int, neighbours: list[Neighbours], t: float, state: tuple[Array, Array],
        turned: tuple[Array, Array], ticked: int, gaps: LawGaps,
    ) -> None:  # fmt: skip
        """Compare averages and headings that `flocking.engine.discrete.heading_updates` gave with law and body.

        Parameters
        ----------
        step, neighbours
            As for `judged`.
        t, state
            The scenario's time; positions and velocities before the update, shape (N, 2) each.
        turned
            What agents averaged, and the velocities that they set, shape (N, 2) each.
        ticked
            How often they had ticked before.
        gaps
            Takes the largest difference.

        Raises
        ------
        LawNotObeyed
            When one is not that of the law and the body.
        """
        (q, p), (means, found), body, control = state, turned, self.scenario.agents, self.scenario.control
        assert isinstance(body, Heading)
        assert isinstance(control, Held)
        period, speed = float(np.max(control.period)), float(np.max(body.speed))
        per_mean = float(np.max(body.masses)) / period
        radius = float(np.max(self.law.graph.break_radius))
        # Places are wrapped before they are compared, which rounds them.
        slack = (EDGE + SAFETY * max(float(np.abs(q).max()), *self.scenario.space.lengths) / radius) * UNIT
        judged = self.judged(step, neighbours, q, slack)
        if judged is None:
            return
        agents, [(of, _, _)] = judged
        u = per_mean * (means - p)
        neighbours_of = np.bincount(of, minlength=len(agents)).astype(np.float64)
        rounding = SAFETY * UNIT * speed * per_mean * (2.0 + neighbours_of)
        self.compare(judged, t, state, u, gaps, rounding=rounding)
        given = p[agents], u[agents], np.full(len(agents), period), agents, np.full(len(agents), ticked)
        off = np.linalg.norm(found[agents] - body.updated(*given), axis=1)
        # A vector to turn into that is short beside what adds up to it has a direction of few digits.
        parts = 1.0 + float(np.max(body.noise)) if body.noise_kind == "vectorial" else speed
        length = np.linalg.norm(body.desired(*given), axis=1)
        with np.errstate(divide="ignore"):
            wrong = off > SAFETY * UNIT * speed * (1.0 + parts / length)
        if wrong.any():
            raise LawNotObeyed(
                f"A computed heading is not that of {type(body).__name__}: velocities differ by {off.max():.3g}. This "
                "is an error of the engine; report the law.",
                time=t, agents=(int(agents[np.argmax(wrong)]),),
            )  # fmt: skip

    def _compared(self, agents: Indices, q: Array, p: Array, known: Known | None) -> Array:
        """Forces of the steering terms on some agents, shape (K, m), by comparison with all others."""
        if known is None:
            return steering_forces(self.law, q, p, self.scenario.space, agents)
        others = everyone(agents, q, known.range)
        seen = known.seen(agents, within(others, agents, q, known.range))
        return np.asarray(sum(term.steer(seen) for term in self.law.steering_terms))

    def compare_in_turn(self, t: float, state: tuple[Array, Array], agent: int, u: Array, gaps: LawGaps) -> None:
        """Compare the force of one agent at its turn with that of the law on what a cell list finds.

        Parameters
        ----------
        t
            The scenario's time.
        state
            Positions and velocities of all agents at its turn, shape (N, m) each.
        agent
            Its number.
        u
            Its force, shape (m,).
        gaps
            Takes the difference.

        Raises
        ------
        LawNotObeyed
            When it is not that of the law.
        """
        force = self._steering(*state)[agent]
        size = float(np.sqrt((force**2).sum()))
        none = np.zeros((1, len(POWERS)))
        stated = Statement(force[None], np.array([SAFETY * UNIT * size]), np.array([size]), none, none)
        wrong = gaps.compare_forces(stated, u[None], np.zeros(1))
        self._count(gaps, t, None if wrong is None else agent)

    @staticmethod
    def _count(gaps: LawGaps, t: float, wrong: int | None) -> None:
        """Count a comparison, and refuse to go on after a force that is not that of the law."""
        gaps.checks += 1
        if wrong is not None:
            raise LawNotObeyed(
                f"The computed forces are not those of the declared law: the error is {100 * gaps.gap:.3g} % of the "
                f"terms, and rounding explains {100 * gaps.allowed:.2g} %. This is an error of the engine; report "
                "the law.",
                time=t, agents=(wrong,),
            )  # fmt: skip
