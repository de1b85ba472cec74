"""Comparison of forces and energy sums of sampled tiles with those of the declared law."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array, Indices, Mask, Reals
from flocking.engine.fixed_step.declared_law import POWERS, Declared, Group, LinkedPairs, Statement, means_of
from flocking.engine.fixed_step.law_gaps import EDGE, SPREAD, LawGaps
from flocking.engine.tiles.automatic_step import energy_doubt
from flocking.engine.tiles.body_check import BodyCheck
from flocking.engine.tiles.kernels.spec import HEADINGS
from flocking.engine.tiles.kernels.step_kernel import tile_kernels
from flocking.engine.tiles.kernels.tile_sums import SUMS
from flocking.engine.tiles.neighbours.neighbour_lists import NUMBER, WIDTH
from flocking.engine.tiles.particles.particle_arrays import ParticleArrays
from flocking.errors import LawNotObeyed
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.smooth_cones import SmoothCone
from flocking.model.graphs.views import VELOCITY, Cone, FieldOfView
from flocking.model.law import Scenario

TILES, MOST_TILES = 4, 64
"""Number of tiles that are checked, and of those from which the error of the energy is estimated."""

SAID = {
    "pairs": "energy", "bodies": "energy", "work": "power", "dissipated": "dissipated power",
    "supplied": "supplied power",
}  # fmt: skip
"""What the compared sums are in words."""


@dataclass(frozen=True)
class Moment:
    """Time of a check.

    Parameters
    ----------
    time
        Time of the state that is checked.
    gains_since
        Time whose scheduled gains apply.
    steps
        Number of steps before it.
    """

    time: float
    gains_since: float
    steps: int


class LawCheck:
    """Compares the motion of a group with the law that its scenario declares.

    If a step has one pass, the changes of velocities and positions in it are checked. Otherwise the accelerations (for
    agents of order 1 the velocities) of an extra pass over the state before the step are checked.

    Parameters
    ----------
    scenario
        The declared scenario.
    dtype
        Data type of the state.
    motion
        Whether a step has one pass, without damping within the kick: half-step-velocity Verlet and the Euler method.
    refuses
        Whether a deviation from the law is an error; for a plant it is only recorded.
    """

    def __init__(
        self, scenario: Scenario, dtype: type[np.float32] | type[np.float64], *, motion: bool, refuses: bool
    ) -> None:
        self.scenario, self.motion, self.refuses = scenario, motion, refuses
        self.order = scenario.agents.order
        self.eps = float(np.finfo(dtype).eps)
        self.declared = Declared(scenario, self.eps)
        self.bodies = BodyCheck(scenario, self.eps)

    def before_step(self, particles: ParticleArrays, moment: Moment, gaps: LawGaps) -> None:
        """Check the accelerations of the state before a step; the ledger and the links do not change.

        Parameters
        ----------
        particles
            The agents, with valid neighbour lists.
        moment
            Time of the check.
        gaps
            Receives the deviations.

        Raises
        ------
        LawNotObeyed
            If they are not those of the declared law.
        """
        if self.motion:
            return
        particles.move(moment.time, keep=0.0, kick=1.0, drift=0.0, exponential_damping=0.0, hold=True)
        if self.order == 1:
            particles.refresh_copies(particles.successor)
        places = self._places(particles, moment)
        q, p = (np.asarray(x.T) for x in (particles.X[: particles.m], particles.X[particles.m :]))
        mass = self._inertia(particles, places)
        force = mass[:, None] * particles.Y[particles.m :, places].T.astype(np.float64)
        if particles.spec.bodied:
            # The kernel states the control of the law beside the rates of bodies, which are judged by themselves.
            self.bodies.check(particles, places, moment.time, moment.gains_since)
            damping = np.broadcast_to(self.scenario.agents.damping, particles.everyone)[particles.ids[places]]
            force = particles.body_rows.controls[:, places].T.astype(np.float64)
            if self.order == 2:
                force -= damping[:, None] * particles.X[particles.m :, places].T.astype(np.float64)
        if self.order == 1:
            p = np.asarray(particles.Y[particles.m :].T)
        found = self._compared(particles, (q, p), places, force, np.zeros(len(places)), moment, gaps, remembered=True)
        self._require(found, moment, gaps)

    def after_step(self, particles: ParticleArrays, kick: float, h: float, moment: Moment, gaps: LawGaps) -> None:
        """Check the motion of a step of one pass. The state before it is still in ``particles.Y``.

        Parameters
        ----------
        kick, h
            Times for which forces acted on velocities (order 2 only), and velocities on positions.
        moment
            Time of the check.
        gaps
            Receives the deviations.

        Raises
        ------
        LawNotObeyed
            If it is not that of the declared law.
        """
        if self.refuses:
            self._check_links(particles, moment)
        if not self.motion:
            return
        if self.order == 1:
            particles.refresh_copies(particles.agents)
        m, places = particles.m, self._places(particles, moment)
        before, after = (x[:, places].T.astype(np.float64) for x in (particles.Y, particles.X))
        mass = self._inertia(particles, places)
        if self.order == 1:
            # The velocity of the step is stored with the position at its end.
            force, kick = after[:, m:].copy(), 1.0
            speed, rounding = np.abs(force).sum(axis=1), np.zeros(len(places))
        else:
            force = mass[:, None] * (after[:, m:] - before[:, m:]) / kick
            speed = np.maximum(np.abs(after[:, m:]).sum(axis=1), np.abs(before[:, m:]).sum(axis=1))
            rounding = 4.0 * self.eps * mass * speed / kick
        # An error of a position is converted to the force that would cause it.
        excess = np.sqrt(((after[:, :m] - before[:, :m] - h * after[:, m:]) ** 2).sum(axis=1))
        excess = np.maximum(excess - 4.0 * self.eps * (np.abs(after[:, :m]).sum(axis=1) + h * speed), 0.0)
        force += (mass * excess / (h * kick))[:, None]
        q = np.asarray(particles.Y[:m].T)
        p = np.asarray((particles.Y if self.order == 2 else particles.X)[m:].T)
        found = self._compared(particles, (q, p), places, force, rounding, moment, gaps, remembered=False)
        self._require(found, moment, gaps)

    def _check_links(self, particles: ParticleArrays, moment: Moment) -> None:
        """Hold the links that acted in a step, for some agents, against the graphs at the state before it.

        Entries of the lists are judged by their bits, and for one tile it is judged of all agents at hand whether they
        are listed. Links between the radii of a graph with a gap depend on the past, directions of bodies have gone on,
        and of a graph over which nothing acts the links are not kept up to date: they are not judged.

        Raises
        ------
        LawNotObeyed
            If a link is none by the declared graph, or one is missing.
        """
        m, places = particles.m, self._places(particles, moment)
        q, p = np.asarray(particles.Y[:m].T), np.asarray(particles.Y[m:].T)
        visited = tile_kernels(particles.spec).VISITED
        for number, kind in enumerate(particles.spec.graphs):
            lists = particles.lists[number]
            judged = kind.view in ("", HEADINGS) or (kind.view == VELOCITY and self.order == 2)
            if kind.fixed or lists is None or not len(lists.rows) or not (judged and visited[number]):
                continue
            k, j, bit = self._entries(particles, number, places)
            inside, outside = self._sides(particles, number, (q, p), places[k], j)
            wrong = (inside & ~bit) | (outside & bit) if kind.memory else np.zeros(len(k), dtype=bool)
            if wrong.any():
                first = int(np.argmax(wrong))
                self._refuse_link(particles, number, (places[k[first]], j[first]), q, moment)
            few = places[:WIDTH]
            all_k, all_j = (x.ravel() for x in np.indices((len(few), particles.n)))
            listed = np.zeros((len(few), particles.n), dtype=bool)
            near = (k < len(few)) & (j < particles.n)
            listed[k[near], j[near]] = True
            listed[np.arange(len(few)), few] = True
            missing = ~listed[all_k, all_j]
            all_k, all_j = all_k[missing], all_j[missing]
            inside, _ = self._sides(particles, number, (q, p), few[all_k], all_j)
            if inside.any():
                first = int(np.argmax(inside))
                self._refuse_link(particles, number, (few[all_k[first]], all_j[first]), q, moment)

    def _entries(self, particles: ParticleArrays, number: int, places: Indices) -> tuple[Indices, Indices, Mask]:
        """Entries of lists of the agents at some ``places``: number of the agent, index of the other, and its bit."""
        lists = particles.lists[number]
        assert lists is not None
        tile, lane = places // WIDTH, places % WIDTH
        row = np.arange(int(lists.count[tile].max(initial=0)))
        at = lists.first[tile][:, None] + np.minimum(row, np.maximum(lists.count[tile] - 1, 0)[:, None])
        entries = lists.rows[at, lane[:, None]]
        j = (entries & NUMBER).astype(np.int64)
        k, column = np.nonzero((row < lists.count[tile][:, None]) & (j != places[:, None]))
        return k, j[k, column], entries[k, column] > NUMBER

    def _sides(
        self, particles: ParticleArrays, number: int, state: tuple[Reals, Reals], i: Indices, j: Indices
    ) -> tuple[Mask, Mask]:
        """Which pairs of indices are linked for sure by a graph whatever was before, and which are not for sure."""
        q, p = state
        graph, kind = particles.radii.graphs[number], particles.spec.graphs[number]
        difference = q[j].astype(np.float64) - q[i].astype(np.float64)
        d = particles.space.displacement(difference)
        r = np.sqrt((d**2).sum(axis=1))
        who = particles.ids[i]
        leave, enter = (
            np.broadcast_to(np.asarray(x, dtype=np.float64), particles.everyone)[who]
            for x in (graph.break_radius, graph.appear_radius)
        )
        slack = EDGE * self.eps * (leave + np.abs(d - difference).sum(axis=1))
        inside, outside = r < enter - slack, r > leave + slack
        if kind.view:
            beyond = self._beyond_view(particles, graph, i, d, r, p)
            inside, outside = inside & (beyond < -slack), outside | (beyond > slack)
        if isinstance(graph, Cone | SmoothCone):
            similar = self._similar(particles, graph, i, j)
            inside, outside = inside & similar, outside | ~similar
        return inside, outside

    def _refuse_link(
        self, particles: ParticleArrays, number: int, pair: tuple[int, int], q: Reals, moment: Moment
    ) -> None:
        i, j = (int(particles.ids[x]) for x in pair)
        away = particles.space.displacement((q[pair[1]].astype(np.float64) - q[pair[0]].astype(np.float64))[None])
        raise LawNotObeyed(
            f"The computed motion does not follow the declared law: agent {j} counts wrongly as a neighbour of agent "
            f"{i} under graph {number}, or as none, at a distance of {float(np.linalg.norm(away)):.6g}. This is "
            "an error of the engine, not of the step; use engine='exact', and report the law.",
            time=moment.time, agents=(i, j),
        )  # fmt: skip

    def energy_rounding(self, particles: ParticleArrays, time: float) -> float:
        """Change of the energy by the rounding of positions and of its formulas, estimated from some tiles.

        Parameters
        ----------
        particles
            The agents, with neighbour lists of a pass over their positions.
        time
            Time of their state.
        """
        moment = Moment(time, time, 0)
        places = self._places(particles, moment, MOST_TILES)
        m = particles.m
        q, p = (np.asarray(x.T) for x in (particles.X[:m], particles.X[m:]))
        errors = self._declared(particles, (q, p), places, moment, remembered=True).power_errors[:, :2]
        total, count = particles.group_sum(np.array([errors.sum(), float(len(places))]))
        of_formulas = float(total) * particles.everyone / max(float(count), 1.0)
        return of_formulas + energy_doubt(particles, self.scenario.law)

    def _places(self, particles: ParticleArrays, moment: Moment, most: int = TILES) -> Indices:
        """Indices of the checked agents: evenly spread tiles, others at every check, and that of the closest pair.

        All agents of a tile are taken, since sums are per tile.
        """
        count = min(most, particles.tiles)
        if not count:
            return np.zeros(0, np.int64)
        first = int(moment.steps * SPREAD * particles.tiles / count) % particles.tiles
        tiles = (first + np.arange(count) * particles.tiles // count) % particles.tiles
        tiles = np.unique(np.append(tiles, np.argmin(particles.results.tile_extremes[:, 1])))
        places = (tiles[:, None] * WIDTH + np.arange(WIDTH)).ravel()
        within: Indices = places[places < particles.n]
        return within

    def _inertia(self, particles: ParticleArrays, places: Indices) -> Array:
        """Factor between rates of change and controls: the masses, and 1 for agents of order 1."""
        return self._mass(particles, places) if self.order == 2 else np.ones(len(places))

    def _mass(self, particles: ParticleArrays, places: Indices) -> Array:
        masses = self.scenario.agents.masses
        return np.broadcast_to(masses, particles.everyone)[particles.ids[places]].astype(np.float64)

    def _compared(
        self, particles: ParticleArrays, state: tuple[Reals, Reals], places: Indices, force: Reals, rounding: Reals,
        moment: Moment, gaps: LawGaps, *, remembered: bool,
    ) -> tuple[int | None, str | None]:  # fmt: skip
        """The agent whose force deviates from the law, and the name of a power that does; None for none.

        ``state`` contains positions and velocities; for agents of order 1 the velocities are those of the law.
        """
        declared = self._declared(particles, state, places, moment, remembered=remembered)
        gaps.checks += 1
        wrong = gaps.compare_forces(declared, force, rounding)
        tiles, which = np.unique(places // WIDTH, return_inverse=True)
        sums = particles.results.sums[tiles][:, [SUMS.index(name) for name in POWERS]]
        power = gaps.compare_powers(declared, which, sums)
        return None if wrong is None else int(particles.ids[places[wrong]]), power

    def _declared(
        self, particles: ParticleArrays, state: tuple[Reals, Reals], places: Indices, moment: Moment, *,
        remembered: bool,
    ) -> Statement:  # fmt: skip
        """Forces and powers of the agents at some places by the law; for ``state`` see `_compared`."""
        scenario = self.scenario
        q, p = state
        energy = scenario.energy
        means = np.vstack([np.full((2, particles.m), np.nan), np.zeros((2, particles.m))])
        if self.declared.uses_means:
            everybody = np.arange(particles.n)
            mass = self._mass(particles, everybody)
            means = means_of(q[everybody], p[everybody], mass, particles.group_sum, particles.everyone)
        frame = np.zeros(particles.m)
        if energy.frame == "centre of mass":
            frame = means[1]
        elif energy.leader is not None:
            frame = energy.leader.at(moment.time)[1]
        group = Group(q, p, particles.ids, moment.time, moment.gains_since, frame, means[0], means[1], means[2:])
        pairs = [self._pairs(particles, number, state, places, remembered) for number in range(len(particles.lists))]
        return self.declared.state(group, places, pairs)

    def _require(self, found: tuple[int | None, str | None], moment: Moment, gaps: LawGaps) -> None:
        agent, power = found
        if not self.refuses or (agent is None and power is None):
            return
        what = "force" if agent is not None else SAID[str(power)]
        raise LawNotObeyed(
            f"The computed motion does not follow the declared law: the {what} is off by {100 * gaps.gap:.3g} "
            f"% of its terms, and rounding explains {100 * gaps.allowed:.2g} %. This is an error of the engine, not "
            "of the step; use engine='exact', and report the law.",
            time=moment.time, agents=() if agent is None else (agent,),
        )  # fmt: skip

    def _pairs(
        self, particles: ParticleArrays, number: int, state: tuple[Reals, Reals], places: Indices, remembered: bool
    ) -> LinkedPairs:
        """Linked pairs of the checked agents under a graph: number of the agent, index of the other, certainty."""
        lists, kind, (q, p) = particles.lists[number], particles.spec.graphs[number], state
        assert lists is not None
        tile, lane = places // WIDTH, places % WIDTH
        rows = int(lists.count[tile].max(initial=0))
        row = np.arange(rows)
        entry_rows = lists.first[tile][:, None] + np.minimum(row, np.maximum(lists.count[tile] - 1, 0)[:, None])
        listed = row < lists.count[tile][:, None]
        if not len(lists.rows):
            none = np.zeros(0, np.int64)
            return none, none, np.zeros(0, dtype=bool)
        entries = lists.rows[entry_rows, lane[:, None]]
        j = (entries & NUMBER).astype(np.int64)
        listed &= j != places[:, None]
        k, column = np.nonzero(listed)
        j, bit = j[k, column], entries[k, column] > NUMBER
        if kind.fixed:
            return k, j, np.ones(len(k), dtype=bool)
        difference = q[j].astype(np.float64) - q[places[k]].astype(np.float64)
        d = particles.space.displacement(difference)
        r = np.sqrt((d**2).sum(axis=1))
        graph = particles.radii.graphs[number]
        who = particles.ids[places[k]]
        leave, enter = (
            np.broadcast_to(np.asarray(x, dtype=np.float64), particles.everyone)[who]
            for x in (graph.break_radius, graph.appear_radius)
        )
        # Displacements to an image are no more certain than the positions.
        slack = EDGE * self.eps * (leave + np.abs(d - difference).sum(axis=1))
        certain = (np.abs(r - leave) > slack) & (np.abs(r - enter) > slack)
        linked = bit if remembered else np.where(r < enter - slack, True, np.where(r > leave + slack, False, bit))
        if kind.view:
            beyond = self._beyond_view(particles, graph, places[k], d, r, p)
            certain &= np.abs(beyond) > slack
            linked = bit if remembered else linked & np.where(np.abs(beyond) > slack, beyond < 0.0, bit)
        if isinstance(graph, Cone | SmoothCone):
            linked = linked & self._similar(particles, graph, places[k], j)
        return k[linked], j[linked], certain[linked] | remembered

    def _similar(self, particles: ParticleArrays, graph: Cone | SmoothCone, i: Indices, j: Indices) -> Mask:
        """Which pairs of indices have similar headings."""
        headings = graph.checked_headings(self.scenario.agents.headings, particles.everyone)
        return graph.similar(headings, particles.ids[i], particles.ids[j])

    def _beyond_view(
        self, particles: ParticleArrays, graph: Graph, places: Indices, d: Array, r: Array, p: Reals
    ) -> Array:
        """How far along the headings of agents others are short of their views; negative within, shape (K,)."""
        assert isinstance(graph, FieldOfView)
        who, p = particles.ids[places], p[places].astype(np.float64)
        if graph.along_velocity:
            speed = np.linalg.norm(p, axis=1, keepdims=True)
            heading = np.divide(p, speed, out=np.zeros_like(p), where=speed > 0.0)
        elif graph.heading_column and not self.scenario.control.ideal:
            number = next(k for k, each in enumerate(particles.radii.graphs) if each is graph)
            heading = particles.radii.views[number][1:, places].T.astype(np.float64)
        elif graph.heading_column:
            first = particles.spec.row_of(graph.heading_column)
            heading = particles.body_rows.further[first : first + particles.m, places].T.astype(np.float64)
        else:
            heading = graph.directions(self.scenario.agents.headings)[who]
        found: Array = graph.cosines(self.scenario.start.n)[who] * r - (d * heading).sum(axis=1)
        if graph.along_velocity:
            # Agents at rest see all around.
            found = np.where(heading.any(axis=1), found, -r)
        return found


__all__ = ["LawCheck"]
