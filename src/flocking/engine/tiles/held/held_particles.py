"""Particle arrays of agents under held control: the forces that act, and the links by what agents know."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Array, Indices, Numbers, Numbers32, Reals
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.tiles.held.facing_particles import FacingParticles
from flocking.engine.tiles.held.held_actuation import HeldActuation
from flocking.engine.tiles.held.held_motion import HeldMotion, coast
from flocking.engine.tiles.held.known_leaders import KnownLeaders, known_leaders
from flocking.engine.tiles.held.lagged_motion import LaggedForces, coast_lagged
from flocking.engine.tiles.held.listed_senders import take_senders, tiles_ahead
from flocking.engine.tiles.held.messages import SampleStore
from flocking.engine.tiles.held.used_samples import UsedSamples
from flocking.engine.tiles.kernels.control_kernel import control_kernel, control_spec
from flocking.engine.tiles.kernels.spec import KernelSpec
from flocking.engine.tiles.neighbours.neighbour_lists import ListBuilder, TileLists
from flocking.engine.tiles.particles.departing_velocities import DepartingVelocities
from flocking.engine.tiles.simd.aligned_memory import aligned
from flocking.model.bodies.body import Body
from flocking.model.law import Scenario
from flocking.model.state import State
from flocking.model.world.control import Held
from flocking.model.world.information import Messages

SPARE = 1.25
"""Ratio of the width for which lists are built to the deviation of what is known at the time: speeds may grow a little
before they are built anew."""

DRAWING_COST, LOOK_COST = 3.3, 1.6
"""Cost of the controls of all agents where messages are drawn, and of the look at the true state for the ledger, in
passes of a step under ideal control: 29 and 15 ms over 9.3 ms of a million agents. Constants, as `PASS_COST`."""


class HeldParticles(FacingParticles):
    """Particle arrays with a force of each agent that stays until the agent acts again.

    Parameters
    ----------
    scenario, state, spec, workers, memory_limit, skin
        As for `ParticleArrays`.
    logs
        Whether the kernel writes down what agents use when they act.

    Attributes
    ----------
    force
        The force that acts on each agent, or what a lagged one tends to, shape (m, size); of agents of order 1 their
        velocity.
    actuation
        What stands between the forces that agents compute and those; None for nothing.
    known
        Lists of each graph with the links by what agents know, where these have memory; None where the lists of the
        true state serve, whose links nobody reads who looks for samples.
    used, senders
        For each entry of the lists of a graph the sample used last, see `flocking.engine.tiles.kernels.heard_samples`,
        and the number of the agent that it stands for; no entries where nothing is drawn.
    leaders
        Leaders as agents know them by messages; None where they know them exactly.
    logged
        What agents used when they acted; None where it is not written down.
    powers
        By tile, powers of the forces at rest at the beginning and at the end of the last step, shape (tiles, 2); no
        rows where they are not summed.
    """

    leaders: KnownLeaders | None = None
    _lawful = False

    def __init__(
        self, scenario: Scenario, state: State, spec: KernelSpec, workers: Workers, memory_limit: float,
        skin: float | None = None, *, logs: bool = False,
    ) -> None:  # fmt: skip
        self.leaders = known_leaders(scenario, spec)
        super().__init__(scenario, state, spec, workers, memory_limit, skin)
        self.force: Reals = np.zeros((self.m, self.size), self.dtype)
        self.acting: Numbers32 = np.zeros(self.size, np.int32)
        self.all_act = False
        assert isinstance(scenario.control, Held)
        self._periods = np.asarray(scenario.control.period, dtype=np.float64)
        self.motion = HeldMotion(scenario.agents, self.everyone, self.dtype)
        self.control_spec = control_spec(spec if self.leaders is None else self.leaders.spec, scenario.law.graphs)
        self.store: SampleStore | None = None
        heard = None
        self._shared: tuple[int, ...] = ()
        if isinstance(scenario.information, Messages):
            if spec.order == 1:
                self.agents[:, self.m :] = 0.0
            self.store = self._new_store(scenario, memory_limit)
            repeats = tuple(k for k, slot in enumerate(spec.layout.period_slots(self.m)) if slot is not None)
            self._shared = tuple(
                k for k, kind in enumerate(spec.graphs) if kind.fixed and self.radii.edges[k] is None
            )  # fmt: skip
            heard = self.store.heard(self.m, repeats, self._shared)
        self.logged = UsedSamples(messages=heard is not None) if logs else None
        self.control = control_kernel(self.control_spec, heard, logs=logs).control
        self._draws, self._tested = heard is not None and heard.draws, 0
        self.used: list[NDArray[np.uint32]] = [np.zeros(0, np.uint32) for _ in spec.graphs]
        self.senders: list[NDArray[np.uint32]] = [np.zeros(0, np.uint32) for _ in spec.graphs]
        self._ahead = 1
        self.known: list[TileLists | None] = [None] * len(spec.graphs)
        self.known_builders = [ListBuilder(self.n, memory_limit, workers, self.search.box) for _ in scenario.law.graphs]
        self._first_known_links = state.links
        self._fastest = np.zeros(self.tiles)
        self.powers: Array = np.zeros((0, 2))
        self._departing = DepartingVelocities(spec) if spec.ledger and spec.order == 1 else None

    def _new_store(self, scenario: Scenario, memory_limit: float) -> SampleStore:
        return SampleStore(scenario, self.agents, self.n, self.dtype, memory_limit, self.workers)

    def new_actuation(self, body: Body, start: State) -> HeldActuation:
        """What stands between the forces that agents compute and those that act, at the start.

        Parameters
        ----------
        body
            What the agents are.
        start
            The start of all agents.
        """
        return HeldActuation(body, start, self.dtype, self.ids[: self.size], self.workers, self._periods)

    def _set_parameters(self, scenario: Scenario, t: float) -> None:
        super()._set_parameters(scenario, t)
        self._lawful = False
        if self.leaders is not None:
            self.leaders.take_parameters(scenario, t, self.ids[: self.size], self.n)

    def _reorder(self, order: Numbers32) -> None:
        super()._reorder(order)
        self._lawful = False
        if self.leaders is not None:
            self.leaders.parameters.reorder(order)

    def rebuild(self, step: float, skin: float | None = None) -> None:
        """Sort the agents with their forces, and rebuild all lists."""
        super().rebuild(step, skin)
        if self.moving:
            self.force[:, : self.n] = np.take(self.force, self.search.sorter.order, axis=1, mode="clip")
            self.force[:, self.n :] = self.force[:, self.n - 1 : self.n]
            if self.actuation is not None:
                self.actuation.reorder(self.search.sorter.order)
            if self.store is not None:
                self.store.reorder(self.search.sorter.order)
        self.motion.reorder()
        self._build_known()

    def _sort(self, step: float, skin: float | None) -> None:
        """Sort the agents into cells for lists of who may be known to be near."""
        if self.store is not None:
            self.search.margin = SPARE * self.store.deviation(None)
        super()._sort(step, skin)

    def _passes(self, step: float) -> float:
        """As for all agents; at least one pass, so that groups that seldom act have the lists of ideal control."""
        one = (DRAWING_COST if self._draws else 1.0) + (LOOK_COST if self.spec.ledger else 0.0)
        return max(1.0, one * min(1.0, float(np.mean(step / self._periods))))

    def known_in_reach(self, now: int) -> bool:
        """Whether the lists hold everybody who may be known to be within a radius at the nanosecond ``now``."""
        return self.store is None or not self.moving or self.store.deviation(now) <= self.search.margin

    @property
    def _known_with_memory(self) -> list[int]:
        """Graphs whose links by what agents know have memory, and lists of their own to hold it."""
        return [k for k, kind in enumerate(self.control_spec.graphs) if kind.memory and not kind.fixed]

    def _build_known(self) -> None:
        """Build the lists of the graphs whose links by what agents know have memory."""
        sorter, radii = self.search.sorter, self.radii
        beyond = self.displacement.skin + self.search.margin
        before, self.known = self.known, [None] * len(self.known)
        for number in self._known_with_memory:
            old = before[number]
            listed, inside = radii.searched(number, beyond, self.ids, self.workers)
            # The sort leaves the new place of each agent in its buffer.
            self.known[number], _ = self.known_builders[number].build(
                self.agents, listed, sorter.grid, sorter.start, old, sorter.order,
                sorter.key_buffer, begin=inside if old is None else None, remember=True,
            )  # fmt: skip
        if self._first_known_links is not None:
            self._remember_first_links()
        self.forget_used()

    def forget_used(self) -> None:
        """Drop the record of which samples were used: the next search finds them again."""
        self._tested, self._ahead = 0, 1
        if self._draws:
            for number in range(len(self.known)):
                if number in self._shared:
                    continue
                lists = self._lists_of(number)
                if self.used[number].size != lists.rows.size:
                    self.used[number] = aligned((lists.rows.size,), np.uint32)
                    self.used[number][:] = 0
                    self.senders[number] = aligned((lists.rows.size,), np.uint32)
                self.workers.each(
                    take_senders, self.tiles, lists.rows.reshape(-1), lists.first, lists.count, self.ids,
                    self.senders[number], self.used[number],
                )  # fmt: skip
                self._ahead = max(self._ahead, tiles_ahead(lists, self.n))

    def _lists_of(self, number: int) -> TileLists:
        """Lists of the neighbours of one graph by what agents know."""
        known = self.known[number]
        found = known if known is not None else self.lists[number]
        assert found is not None
        return found

    def _remember_first_links(self) -> None:
        from flocking.engine.tiles.neighbours.listed_pairs import remember_links

        links, self._first_known_links = self._first_known_links, None
        if self.known[0] is not None and self.control_spec.graphs[0].memory and links is not None:
            remember_links(self.known[0], np.asarray(links), self.ids)

    def measure(self, now: int) -> None:
        """Take the samples that are due at the nanosecond ``now``."""
        if self.store is not None and self.store.due(now).any():
            self.refresh_copies(self.agents)
            self.store.measure(now, self.agents, self.ids)

    def act(self, t: float, now: int) -> None:
        """Compute the controls of the agents marked in `acting`, and follow their links.

        Parameters
        ----------
        t
            The time.
        now
            The same in nanoseconds from the start.
        """
        lists = self.graph_arguments([self._lists_of(number) for number in range(len(self.known))])
        own = self.agents
        if self.store is None:
            self.refresh_copies(self.agents)
        else:
            own = self.store.own(now, own, self.ids)
            news = self.store.news(now, self.ids, self._tested, self._ahead)
            lists += [self.store.rows, news, *self.used, *self.senders]
            # Where everybody acts, all entries have been looked at until now.
            self._tested = self.store.settled(now) if self.store.alike and self.all_act else 0
        if self.logged is not None:
            lists += self.logged.arrays([self._lists_of(number) for number in range(len(self.known))])
        lists += self.obstacle_arguments(t, places=None if own is self.agents else own.T[: self.m, : self.size])
        parameters = self.parameters
        if self.leaders is not None:
            self.leaders.put(now, self.ids[: self.n])
            parameters = self.leaders.parameters
        self.workers.each(
            self.control, self.tiles, float(t), self.acting, own, self.agents, self.n, *lists, parameters.P,
            parameters.A, self.kernels.obstacle_rows, self.ids, parameters.seeds, parameters.matrices,
            self.results.means, self.desired,
        )  # fmt: skip

    @property
    def desired(self) -> Reals:
        """The forces that agents computed last, shape (m, size)."""
        return self.force if self.actuation is None else self.actuation.desired

    def exert(self, now: int, begun: Numbers32 | None = None, *, gusts: bool) -> None:
        """Let bodies make of the forces that agents computed last what acts from the nanosecond ``now`` on.

        Parameters
        ----------
        begun
            Whose forces begin to act, see `HeldActuation.act`.
        gusts
            Whether gusts begin.
        """
        if self.actuation is None:
            return
        if gusts:
            self.actuation.take_gusts(now, self.ids[: self.size])
        self.actuation.act(self.ids[: self.size], self.force, self.agents[: self.size], begun)

    @property
    def acting_force(self) -> Reals:
        """The force that acts now, shape (m, size); of agents of order 1 their velocity."""
        return self.force if self.actuation is None else self.actuation.acting(self.force)

    def mean_force(self, h: float) -> Reals:
        """`acting_force`, or where forces lag what counts as it for a step ``h``, see `HeldActuation.mean_acting`."""
        if self.actuation is None or self.actuation.lag is None:
            return self.acting_force
        return self.actuation.mean_acting(self.force, h, self.ids[: self.size])

    @property
    def seen_force(self) -> Reals:
        """The force that acts at the time that is looked at, shape (m, size); of agents of order 1 their velocity."""
        actuation = self.actuation
        if actuation is None or actuation.lag is None:
            return self.force
        lag = actuation.lag if actuation.seen is None else actuation.seen[0]
        assert lag is not None
        return lag + actuation.beside

    def coast(self, h: float, target: Reals | None = None) -> float:
        """Move all agents by ``h`` under the forces that act; returns the largest speed in the frame of the lists.

        Parameters
        ----------
        target
            Takes the state; None to change that of the agents. Columns go to `HeldActuation.seen`.
        """
        into = self.agents if target is None else target
        self._lawful = self._lawful and target is not None
        actuation, frame, size = self.actuation, self.displacement.velocity, self.size
        heading = lag = None
        if actuation is not None:
            heading = actuation.turned(self.agents[:size], self.force, h, self.motion.body, self.ids[:size])
        if actuation is None or actuation.lag is None or actuation.constants is None:
            constants = self.motion.over(h, self.ids)
            sums = self.spec.ledger and self.spec.order == 2 and target is None
            powers = np.zeros((self.tiles if sums else 0, 2))
            self.workers.each(
                coast, self.tiles, self.agents, into, self.force, constants, frame, self.n, self._fastest, powers
            )
            if sums:
                self.powers = powers
        else:
            lag = actuation.lag if target is None else np.empty_like(actuation.lag)
            limits = actuation.largest_rates(self.ids[:size])
            forces = LaggedForces(self.force, actuation.beside, actuation.lag, lag, limits)
            rows, second = actuation.constants.over(h, self.ids), self.spec.order == 2
            self.workers.each(
                coast_lagged, self.tiles, self.agents, into, forces, rows, frame, self.n, second, self._fastest
            )
        if actuation is not None:
            if heading is not None and np.isnan(heading[: self.n]).any():
                self._fastest[:1] = np.inf  # All processes then look at their agents.
            if target is None:
                actuation.heading = heading
            else:
                actuation.seen = (lag, heading)
        top = self._fastest_of_all(float(np.sqrt(self._fastest.max(initial=0.0))))
        if target is None:
            self.moved(h, max(self.top_speed, top))
            self.top_speed = top
        return top

    def _fastest_of_all(self, speed: float) -> float:
        """The largest speed of all processes from that here."""
        return speed

    def evaluate(self, t: float, *, hold: bool = False, writes: bool = True) -> None:
        """Evaluate the law on the true state, which does not change; `move` with a unit kick and no drift.

        Parameters
        ----------
        t
            The time.
        hold, writes
            As for `move`.
        """
        self.move(t, keep=0.0, kick=1.0, drift=0.0, exponential_damping=0.0, hold=hold, writes=writes)
        self._lawful = writes

    def velocity_powers(self, t: float, velocity: Reals) -> Array:
        """Of agents of order 1 the sums of v . v and of dH/dq . (v - u), with the velocities u of the law, shape (2,).

        Parameters
        ----------
        t
            The time; the law is evaluated anew where its velocities of this time are not there any more.
        velocity
            The velocities v that act, shape (m, size).
        """
        if not self._lawful:
            self.evaluate(t, hold=True)
        assert self._departing is not None
        return self._departing.powers(self, t, velocity)

    def numbers_of(self, marked: NDArray[np.bool_]) -> Indices:
        """Numbers of the agents here that are marked, ascending.

        Parameters
        ----------
        marked
            For each agent of the group, shape (N,), or for all, shape (1,).
        """
        own = np.sort(self.ids[: self.n]).astype(np.int64)
        found: Indices = own if len(marked) == 1 else own[marked[own]]
        return found

    def places_of(self, agents: Indices) -> Indices:
        """Indices of agents that are here.

        Parameters
        ----------
        agents
            Their numbers.
        """
        own = self.ids[: self.n]
        order: Indices = np.argsort(own, kind="stable")
        return order[np.searchsorted(own[order], agents)] if len(agents) else order[:0]

    def recall_known(self, force: Reals, known: list[TileLists | None], rooms: list[Numbers]) -> None:
        """Go on with forces and lists of a checkpoint.

        Parameters
        ----------
        force, known
            See the attributes.
        rooms
            Capacity of the lists of each graph in rows, for each chunk.
        """
        self.force = force.copy()
        self.known = [None if each is None else each.copy() for each in known]
        if self.search.rebuilds:
            self._first_known_links = None
        for builder, room in zip(self.known_builders, rooms, strict=True):
            builder.capacity, builder.spare = room.copy(), None
        self.motion.reorder()
        if self.search.rebuilds or not self.moving:
            self.forget_used()
