"""The control of one agent, call by call, as a robot's own loop needs it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from flocking.arrays import Indices, Links
from flocking.engine.kernels.codegen import compiled_kernels
from flocking.engine.kernels.law_kernels import LawKernels, Pairs, Slots
from flocking.engine.kernels.layout import Layout
from flocking.engine.kernels.obstacle_distances import ObstacleDistances
from flocking.engine.kernels.pieces import free_pieces
from flocking.engine.reference.call_arguments import (
    OWNER,
    direction,
    identifiers,
    link_rows,
    numbers,
    refuse_shapes,
    time_stamps,
)
from flocking.engine.reference.controller_views import controller_view
from flocking.engine.reference.finite_forces import bounding_poles
from flocking.engine.reference.known_neighbours import (
    CLOSED,
    FIXED,
    NO_AGENT,
    NO_STAMP,
    NOT_FINITE,
    known_and_linked,
)
from flocking.errors import InvalidInput
from flocking.model.bodies.vector_lengths import FACTOR
from flocking.model.checks import Array, integer, number, truth
from flocking.model.energy import Energy
from flocking.model.graph_functional import averages
from flocking.model.graphs.seen_headings import body_directions
from flocking.model.graphs.weights import MatrixWeights
from flocking.model.law import Law
from flocking.model.space import OPEN, Space
from flocking.model.space_checks import check_space
from flocking.model.state import Agents
from flocking.model.terms.potential_reach import check_reach
from flocking.model.terms.schedules import Schedule

MOST_NEIGHBOURS = 1024
"""Number of agents that may be heard of where none is given."""

MOST_AGENTS, MOST_AXES = 10_000_000, 64
"""Largest number of agents that may be heard of, for which a controller takes half a gigabyte, and of axes, whose
formulas take a second to compile."""


class Controller:
    """The control law of one agent, with its link memory, for a loop of hundreds of calls a second.

    A call takes what the agent knows now and gives the force of the law, as `flocking.control_of` does for given
    neighbours; here the graph decides which of those it has samples of are neighbours, by its memory. At the first call
    links are those of a start, afterwards they appear and break at the distances of the graph. Whoever a call does not
    name is discarded, and its link must appear anew.

    Parameters
    ----------
    law
        The control law; it must be distributed, its graphs must link by distances or by headings that the agent knows:
        constant ones, its velocity or a direction of its body; leaders must have a closed form.
    agent
        Number of the agent, which selects its own parameters where they are given for each.
    agents
        Number of agents that may be heard of; identifiers are below it.
    mass, damping
        Of the agent.
    limit
        Largest force; longer ones are scaled back. None for no limit.
    expires
        Age from which what is known of a neighbour is not used; None where ages are not given.
    relative
        Whether positions and velocities of the others are given relative to the agent's own.
    space
        Space of the agents.
    dimension
        Number of axes.
    headings
        Constant headings of all agents, for cones and fields of view along them, as in `Agents`.

    Attributes
    ----------
    time
        Time of the last call; minus infinity before the first.
    links
        Which agents are linked, shape (graphs, agents).
    saturated
        Whether the last force was scaled back.

    Raises
    ------
    InvalidInput
        When the law is not such a one, or a value is out of range.

    Examples
    --------
    >>> import flocking as fk
    >>> law = fk.Law(fk.Hysteresis(4, 0.5), [fk.Gradient(fk.Potential("(r - 2)**2/2")), fk.Consensus()])
    >>> controller = fk.Controller(law, agents=3)
    >>> controller(0.0, [0, 0], [0, 0], ids=[1, 2], q=[[3, 0], [9, 0]], p=[[0, 0], [0, 0]])
    array([1., 0.])
    """

    def __init__(
        self, law: Law, agent: int = 0, *, agents: int = MOST_NEIGHBOURS, mass: float = 1.0, damping: float = 0.0,
        limit: float | None = None, expires: float | None = None, relative: bool = False, space: Space = OPEN,
        dimension: int = 2, headings: ArrayLike | None = None,
    ) -> None:  # fmt: skip
        if not isinstance(law, Law):
            raise InvalidInput("Controller", "law", "must be a Law", law)
        if not isinstance(space, Space):
            raise InvalidInput("Controller", "space", "must be a space, such as Open", space)
        self.law, self.space = law, space
        self.m = integer("Controller", "dimension", dimension, least=1)
        self.count = integer("Controller", "agents", agents, least=1)
        for parameter, most, given in (("dimension", MOST_AXES, self.m), ("agents", MOST_AGENTS, self.count)):
            if given > most:
                raise InvalidInput("Controller", parameter, f"must be at most {most}", given)
        self.agent = integer("Controller", "agent", agent, least=0)
        if self.agent >= self.count:
            raise InvalidInput("Controller", "agent", f"must be below the number of agents, {self.count}", agent)
        self.limit = None if limit is None else number("Controller", "limit", limit, above=0.0)
        self.expires = None if expires is None else number("Controller", "expires", expires, above=0.0)
        self.relative = truth("Controller", "relative", relative)
        masses, dampings = np.ones(self.count), np.zeros(self.count)
        masses[self.agent] = number("Controller", "mass", mass, above=0.0)
        dampings[self.agent] = number("Controller", "damping", damping, least=0.0)
        self._bodies = Agents(masses, dampings, headings=headings)
        self._check_law()
        law.check_count(self.count, self.m)
        check_space(space, law.graphs, law.body_terms, self.m)
        self._layout = Layout(law, Energy(), space=space)
        self._kernels = LawKernels(compiled_kernels(self._layout, self.m), 2)
        self._obstacles = ObstacleDistances(law)
        self._changes = sorted({s for term in law.body_terms for s in term.switch_times(-np.inf, np.inf)})
        rules = []
        for graph in law.graphs:
            kind = FIXED if not graph.moves else CLOSED if bool(getattr(graph, "closed", False)) else 0.0
            radii = (
                np.broadcast_to(np.asarray(x, np.float64), self.count)
                for x in (graph.appear_radius, graph.break_radius)
            )
            rules.append([*(float(x[self.agent]) for x in radii), kind])
        self._rules = np.array(rules)
        self._lengths = np.zeros(self.m)
        for axis, length in enumerate(space.lengths):
            self._lengths[axis] = length if np.isfinite(length) else 0.0
        self._averages = [averages(law, k) for k in range(len(law.graphs))]
        self._counts = any(self._averages)
        self._poles = [bounding_poles(law, k) for k in range(len(law.graphs))]
        # A link breaks before it comes to a pole at the radius itself.
        self._meets_poles = any(
            least > 0.0 or (most <= leave if kind == CLOSED else most < leave)
            for (least, most), (_, leave, kind) in zip(self._poles, rules, strict=True)
        )
        self._rates = np.empty(3)
        self._rows: dict[int, Array] = {}
        size = self.count + 1
        self._Q, self._V, self._r = np.empty((size, self.m)), np.empty((size, self.m)), np.empty(size)
        self._sensed = np.empty(size * len(law.graphs), dtype=np.int64)
        self._marks, self._calls = np.zeros(self.count, dtype=np.int64), 0
        self._pieces, self._ones = free_pieces(size * len(law.graphs)), np.ones((1, size))
        self._senders = np.zeros(size * (len(law.graphs) + 1) + MOST_NEIGHBOURS, dtype=np.int64)
        self._no_weights, self._no_stamps = np.zeros((0, 1, 1)), np.zeros(0)
        self._oldest = np.inf if self.expires is None else self.expires
        self.reset()

    def _check_law(self) -> None:
        if not self.law.distributed:
            raise InvalidInput(
                "Controller", "law", "must be distributed",
                f"a law that needs the {', '.join(self.law.beyond_neighbours)}", "No agent measures or receives these.",
            )  # fmt: skip
        self._bodies.check_count(self.count)
        for graph in self.law.graphs:
            graph.check_count(self.count)
        about = self.agent, self._bodies.headings, (self.count, self.m)
        views = [controller_view(graph, *about) for graph in self.law.graphs]
        self._views = [(g, view) for g, view in enumerate(views) if view is not None]
        directions = body_directions(self.law.graphs)
        if len(directions) > 1:
            raise InvalidInput(
                OWNER, "law", "must look along one direction of the body", " and ".join(directions),
                "A call takes one heading.",
            )  # fmt: skip
        self._along = "".join(directions)
        check_reach(self.law.pair_terms, self.law.graph)
        if Layout(self.law, Energy(), space=self.space).places:
            raise InvalidInput("Controller", "law", "must have leaders whose position has a closed form", "another")
        per_pair = [
            value
            for term in self.law.terms
            for given in term.parameters.values()
            if isinstance(value := given.at(0.0) if isinstance(given, Schedule) else given, MatrixWeights | np.ndarray)
        ]
        for value in per_pair:
            found = len(value.values if isinstance(value, MatrixWeights) else value)
            if found != self.count:
                raise InvalidInput(
                    "Controller", "agents", f"must be {found}, for which the law has parameters", self.count
                )

    def reset(self) -> None:
        """Discard all links and times, as before the first call."""
        self.time, self.saturated = -np.inf, False
        fixed = [np.zeros(self.count, dtype=bool) if g.moves else g.initial(np.zeros((self.count, 1)))[self.agent]
                 for g in self.law.graphs]  # fmt: skip
        self.links, self._after = np.array(fixed), np.array(fixed)
        self._started = False
        self._since = np.nan

    def recall(self, links: Links) -> None:
        """Go on with links that were found elsewhere, as those of a start.

        Parameters
        ----------
        links
            Which agents are linked, shape (graphs, agents).

        Raises
        ------
        InvalidInput
            When they are of another shape, or not true or false.
        """
        found = link_rows(links, self.links.shape)
        self.links, self._after, self._started = found, found.copy(), True

    def _take_parameters(self, t: float) -> None:
        """Take the gains that are in force."""
        since = max((s for s in self._changes if s <= t), default=-np.inf)
        if since != self._since:
            self._since = since
            single, each, weights = self._layout.numbers(self._bodies, t)
            own, others = np.full(self.count, self.agent), np.arange(self.count)
            # Its own row alone: a matrix of many agents takes more memory than there is.
            rows = [w.of_pairs(own, others, self._bodies.headings, self.count) for w in weights]
            self._P, self._W = self._layout.packed(single), np.array(rows) if rows else self._no_weights[:, 0]
            column = [np.broadcast_to(values, self.count)[self.agent] for values in each]
            self._column, self._rows = np.array(column)[:, None], {}

    def __call__(
        self, t: float, own_q: ArrayLike, own_p: ArrayLike, *, ids: ArrayLike, q: ArrayLike, p: ArrayLike,
        stamps: ArrayLike | None = None, heading: ArrayLike | None = None,
    ) -> Array:  # fmt: skip
        """The force of the law now, shape (m,).

        Parameters
        ----------
        t
            Now; not before the last call.
        own_q, own_p
            Position and velocity of the agent, shape (m,).
        ids
            Numbers of the other agents that it knows of, shape (k,).
        q, p
            Their positions and velocities, shape (k, m); relative to the agent's where that was declared.
        stamps
            When these were measured, shape (k,); needed where they expire, and checked wherever they are given.
        heading
            The direction of the agent's body along which a field of view of the law looks (its ``heading_column``), a
            unit vector of shape (m,); needed for such a law, and refused for others.

        Raises
        ------
        InvalidInput
            When an argument is malformed or not finite, the time is before that of the last call, a stamp is in the
            future, or the law has no force: at the place of a neighbour, or on the wrong side of a pole of a
            potential. Links are then those of the last call.
        """
        own, moving = numbers("own_q", own_q), numbers("own_p", own_p)
        who, places, speeds = identifiers(ids), numbers("q", q), numbers("p", p)
        if type(t) is not float:
            t = number("Controller", "t", t)
        if not (who.size or places.size or speeds.size):
            places, speeds = self._Q[:0], self._V[:0]
        axes, shape = (self.m,), (len(who), self.m)
        known = places.shape == shape and speeds.shape == shape
        if not (self.time <= t < np.inf and known and own.shape == axes and moving.shape == axes):
            refuse_shapes(self.m, t, self.time, (own, moving), (who, places, speeds))
        timed = stamps is not None or self.expires is not None
        measured = time_stamps(stamps, len(who)) if timed else self._no_stamps
        facing = own
        if heading is not None or self._along:
            facing = direction(heading, self.m, self._along)
        if self._changes or math.isnan(self._since):
            self._take_parameters(t)
        k, graphs = len(who), len(self._rules)
        self._calls += 1
        self._marks[self.agent] = self._calls
        offsets = np.empty(graphs + 1 + len(self._obstacles.groups), dtype=np.int64)
        Q, V = self._Q[: k + 1], self._V[: k + 1]
        fault = known_and_linked(
            self._calls, self.relative, self._started, own, moving, who, places,
            speeds, self._lengths, self._rules, self.links, self._after, self._marks, Q, V, self._r,
            self._sensed, offsets, t, measured, self._oldest,
        )  # fmt: skip
        if fault:
            self._refuse_known(int(fault), who, measured)
        if self._views:
            self._look(who, Q, (moving, facing), offsets)
        sensed = self._sensed
        for place, near in enumerate(self._obstacles.met_by_one(Q[:1], t) if self._obstacles.groups else ()):
            total = int(offsets[graphs + place])
            if len(near):
                sensed = np.concatenate([sensed[:total], near])
            offsets[graphs + place + 1] = total + len(near)
        u = self._force(t, Q, V, who, sensed[: int(offsets[-1])], offsets)
        size = math.hypot(*u.tolist())
        if self._meets_poles or not size < np.inf:
            self._refuse_no_force(u, who, offsets)
            if not size < np.inf and self.limit is not None:
                # Finite components whose length is not: the same direction.
                u = u * FACTOR
                size = math.hypot(*u.tolist())
        # Links of agents that this call did not name are discarded.
        self.links, self._after = self._after, self.links
        self._started, self.time = True, float(t)
        self.saturated = self.limit is not None and size > self.limit
        return u * (self.limit / size) if self.saturated and self.limit is not None else u

    def _look(self, who: Indices, Q: Array, along: tuple[Array, Array], offsets: Indices) -> None:
        """Take back the links of those who are not in view."""
        first, sensed, graphs = offsets.copy(), self._sensed.copy(), len(self._rules)
        views, total = dict(self._views), 0
        for g in range(graphs):
            rows, offsets[g] = sensed[first[g] : first[g + 1]], total
            if g in views and len(rows):
                seen = views[g].holds(who[rows - 1], Q[rows] - Q[0], self._r[rows - 1], *along)
                self._after[g, who[rows[~seen] - 1]] = False
                rows = rows[seen]
            self._sensed[total : total + len(rows)] = rows
            total += len(rows)
        offsets[graphs] = total

    def _force(self, t: float, Q: Array, V: Array, who: Indices, sensed: Indices, offsets: Indices) -> Array:
        """Force of the law by the compiled kernels."""
        n, count, graphs = len(Q), len(sensed), len(self._rules)
        # The formulas of a pair read the numbers of the agent that senses alone.
        rows, W = self._rows.get(n), self._no_weights
        if rows is None:
            rows = self._rows[n] = np.repeat(self._column, n, axis=1)
        if len(self._W):
            W = np.zeros((len(self._W), n, n))
            W[:, 0, 1:] = self._W[:, who]
        means = self._ones[:, :n] if graphs == 1 and not self._counts else np.ones((graphs, n))
        for g, average in enumerate(self._averages if self._counts else ()):
            if average:
                means[g, 0] = 1.0 / (1.0 + float(offsets[g + 1] - offsets[g]))
        rows_of, spans = self._pieces if count <= len(self._pieces[0]) else free_pieces(count)
        senders = self._senders[:count] if count <= len(self._senders) else np.zeros(count, dtype=np.int64)
        pairs = Pairs(senders, sensed, offsets, rows_of[:count], spans)
        u = np.zeros((n, self.m))
        self._kernels.control(t, Q, V, pairs, Slots(self._P, rows, W), means, u, self._rates)
        found: Array = u[0]
        return found

    def _refuse_known(self, fault: int, who: Indices, stamps: Array) -> None:
        """State what is wrong with what is known of the others."""
        if fault == NOT_FINITE:
            raise InvalidInput("Controller", "q", "must be finite, as p, own_q and own_p", "a number that is not")
        if fault == NO_AGENT:
            raise InvalidInput("Controller", "ids", f"must be from 0 to {self.count - 1}", who.tolist())
        if fault == NO_STAMP:
            raise InvalidInput(
                "Controller", "stamps", "must be finite and not in the future", stamps.tolist(),
                "Leave states out whose clock is ahead, until their time has come.",
            )  # fmt: skip
        raise InvalidInput("Controller", "ids", f"must differ from each other and from {self.agent}", who.tolist())

    def _refuse_no_force(self, u: Array, who: Indices, offsets: Indices) -> None:
        """Refuse neighbours where the law has no force."""
        for g, (least, most) in enumerate(self._poles):
            for place in self._sensed[int(offsets[g]) : int(offsets[g + 1])]:
                r = float(self._r[place - 1])
                if r >= most or (least > 0.0 and r <= least):
                    side, pole = ("nearer", most) if r >= most else ("farther", least)
                    raise InvalidInput(
                        "Controller", "q", f"must be {side} than the pole of the potential, {pole:.9g}",
                        f"agent {who[place - 1]} at distance {r:.9g}",
                    )  # fmt: skip
        if not np.isfinite(u).all():
            used = np.where(self._r[: len(who)] < 0.0, np.inf, self._r[: len(who)])
            near = int(np.argmin(used)) if (used < np.inf).any() else -1
            place_of = f"agent {who[near]} at distance {self._r[near]:.9g}" if near >= 0 else "no neighbour"
            raise InvalidInput("Controller", "q", "must be where the force of the law is finite", place_of)
