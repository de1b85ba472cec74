"""The compiled law of a running simulation: kernels, parameters in force, and the energies of the ledger."""

from __future__ import annotations

from copy import copy
from functools import cached_property

import numpy as np

from flocking.arrays import Indices, Numbers
from flocking.engine.adaptive_steps.limit_crossings import HeldNumbers
from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.adaptive_steps.state_tolerances import counted, natural_sizes
from flocking.engine.adaptive_steps.state_vectors import component_tolerances, further_columns, joined
from flocking.engine.exact.crossings.images import linked_paths
from flocking.engine.exact.crossings.switching import LinkState
from flocking.engine.exact.narrow_features import allowed_by_obstacles, allowed_share, is_pointed, zones_of
from flocking.engine.kernels.codegen import compiled_kernels
from flocking.engine.kernels.law_kernels import CompiledLaw, LawKernels, Pairs, Slots, stages
from flocking.engine.kernels.layout import Layout
from flocking.engine.kernels.ledger_rows import DEPARTED, fill_ledger
from flocking.engine.kernels.motion_source import RATES
from flocking.engine.kernels.pieces import FREE, free_pieces, limits
from flocking.errors import InvalidInput
from flocking.formula.compiled import Reading
from flocking.model.checks import Array
from flocking.model.law import Law, Scenario
from flocking.model.state import State

LEDGER = len(RATES)
"""Number of integrated quantities of the ledger."""

KNOWN_ENERGIES = 6
"""Number of energies cached: a step uses those of its ends, and of the companion's, several times."""

_START = np.zeros(1), np.zeros((1, 1))
"""Nodes and weights of a method whose only stage is at its start."""


class Dynamics:
    """The right-hand side of the state vector [q, p, further columns, departed, work, dissipated, supplied, places].

    ``departed`` is there for bodies that may depart from the desired motion, and ``supplied`` includes it. Places are
    the coordinates of leaders whose position has no closed form.

    Parameters
    ----------
    plant
        The law the agents really obey, if it is not the scenario's: powers and energies of the ledger remain those of
        the declared law.
    base
        The time at which the session's own time, the time of all functions here, is 0.

    Raises
    ------
    InvalidInput
        When the plant does not fit the scenario.
    """

    def __init__(self, scenario: Scenario, plant: Law | None, n: int, m: int, base: float = 0.0) -> None:
        self.scenario = scenario
        self.base = base
        self.n, self.m = n, m
        law = plant or scenario.law
        law.check_count(n, m)
        bodies = scenario.agents
        self.order = bodies.order
        self.columns = bodies.widths(m)
        self.layout = Layout(law, scenario.energy, bodies, scenario.space)
        self._kernels = LawKernels(compiled_kernels(self.layout, m), self.order)
        self.columns_size = n * (bodies.order * m + sum(self.columns.values()))
        self.departs = int(self._kernels.departs)
        self.motion_size = self.columns_size + self.departs
        self.held = HeldNumbers(bodies, n, m, scenario.tolerance, base)
        self._declared: tuple[LawKernels, Layout] | None = None
        if plant is not None:
            if self.departs:
                raise InvalidInput(
                    "ExactSession", "plant", "must not be given for bodies that depart from the desired motion",
                    type(bodies).__name__, "What departs is measured against the law that acts; leave the plant out.",
                )  # fmt: skip
            if len(law.graphs) != len(scenario.law.graphs):
                raise InvalidInput(
                    "ExactSession", "plant", "must have as many graphs as the declared law",
                    f"{len(law.graphs)} instead of {len(scenario.law.graphs)}",
                )  # fmt: skip
            declared = Layout(scenario.law, scenario.energy, bodies, scenario.space)
            self._declared = (LawKernels(compiled_kernels(declared, m), self.order), declared)
        self._reading = Reading()
        self._places = list(self.layout.places)
        self._known = len(self._places)
        if self._declared is not None:
            self._places += self._declared[1].places
        self._judge_contacts()
        self._energies: dict[tuple[float, bytes], tuple[float, float]] = {}

    @property
    def layouts(self) -> tuple[Layout, ...]:
        """The layout of the law that acts, and that of the declared one if it is another."""
        return self.layout, *(() if self._declared is None else (self._declared[1],))

    def repack(self, t: float) -> None:
        """Take the parameters in force from time ``t`` on."""
        self._energies.clear()
        self.held.draw(t)
        t = self._late(t)
        agents = self.scenario.agents
        self._slots = self._with_held(Slots(*self.layout.values(agents, self.n, t)))
        self._ledger = None
        if self._declared is not None:
            module, layout = self._declared
            self._ledger = (module, self._with_held(Slots(*layout.values(agents, self.n, t))))

    def _with_held(self, slots: Slots) -> Slots:
        return slots._replace(A=self.held.below(slots.A))

    def _put_held(self) -> None:
        """Write the numbers held between events where the kernels read them."""
        for slots in (self._slots, *(() if self._ledger is None else (self._ledger[1],))):
            self.held.put(slots.A)

    def recall_limits(self, acting: Array | None) -> None:
        """Take the limits that act from a session that was saved.

        Parameters
        ----------
        acting
            1 where they act, shape (limits, N); None where nothing was saved of them.
        """
        if acting is None or not self.held.limits:
            return
        self.held.rows[self.held.limits] = acting
        self._put_held()

    def follow_limits(self, t: float, y: Array) -> bool:
        """Change which limits of the bodies act according to a state vector ``y``; whether one changed."""
        return bool(self.held.limits) and self.held.follow(self._limit_signs, t, y, self._put_held)

    def check_limits(self, t: float, y: Array) -> None:
        """Refuse a state vector ``y`` at which limits have no finite numbers, see `HeldNumbers.check`."""
        if self.held.limits:
            self.held.check(self._limit_signs(t, y), t)

    def first_limit_change(self, segment: Segment) -> float | None:
        """The fraction of a segment at which the first limit begins or ends to act; None if none does."""
        return self.held.first_limit_change(self._limit_signs, segment)

    def _limit_signs(self, t: float, y: Array) -> Array:
        self._locate(y)
        return self._kernels.limit_signs(t + self.base, y, self._in_force(), len(self.held.limits))

    def _late(self, own: float) -> float:
        """The time at the session's own time, and not before a switch that falls on it."""
        t = own + self.base
        terms = self.layout.law.body_terms
        after = (s for term in terms for s in term.switch_times(t, np.nextafter(t + 4 * abs(np.spacing(t)), np.inf)))
        return max([t, *(s for s in after if s - self.base <= own)])

    def linked_pairs(self) -> tuple[Indices, Indices]:
        """Ordered pairs of linked agents."""
        senders, sensed, offsets = self.pairs[:3]
        end = offsets[len(self.layout.law.graphs)]
        return senders[:end], sensed[:end]

    def divide(self, links: LinkState) -> None:
        """Find how far the pieces of the formulas continue beyond `LinkState.borders`, and their narrow features."""
        self._energies.clear()
        self.__dict__.pop("_zones", None)
        all_borders = links.borders()
        self._zone_sources = all_borders, links.contacts.groups, self._slots
        rows = [np.array([FREE])]
        for k, borders in enumerate(all_borders):
            graphs = len(links.graphs)
            name = f"shape{k}" if k < graphs else f"shape_obstacles{k - graphs}"
            shape = self._kernels.shape(name)
            rows.append(np.tile(FREE, (len(borders), 1)) if shape is None else limits(borders, shape, self._slots))
        self._spans = np.concatenate(rows)
        if self._places:
            self._zones  # noqa: B018  before places of leaders are written among the parameters

    @property
    def pointed(self) -> bool:
        """Whether pairs of agents have a finite energy and a force at distance 0, where it has no direction."""
        return self._zones[3]

    @property
    def zones(self) -> Array:
        """Narrow features of the pair formulas of all graphs, see `zones_of`."""
        return self._zones[0]

    @property
    def zone_graphs(self) -> Numbers:
        """Graph of each of the `zones`."""
        return self._zones[1]

    @property
    def _obstacle_zones(self) -> list[Array]:
        return self._zones[2]

    @cached_property
    def _zones(self) -> tuple[Array, Numbers, list[Array], bool]:
        """Computed when a step is made: a law that is replaced before needs none."""
        borders, groups, slots = self._zone_sources
        name, shape, graphs = self._kernels.name, self._kernels.shape, len(self.layout.law.graphs)
        found = [zones_of(name, shape(f"shape{k}"), slots, ends) for k, ends in enumerate(borders[:graphs])]
        obstacles = [
            zones_of(name, shape(f"shape_obstacles{k}"), slots, ends, tuple(group.rows.values()))
            for k, (group, ends) in enumerate(zip(groups, borders[graphs:], strict=True))
        ]
        finite = [k for k in range(graphs) if not self.contacts[k]]
        pointed = any(is_pointed(shape(f"shape{k}"), slots, borders[k][0]) for k in finite)
        return np.concatenate(found), np.repeat(np.arange(len(found)), [len(x) for x in found]), obstacles, pointed

    def allowed_share(self, segment: Segment, links: LinkState) -> float:
        """The fraction of the step ``segment`` on which no pair moves too far within a narrow feature."""
        share = 1.0
        motion = segment.motion(self.n, self.m, self.order)
        B = motion.positions
        if len(self.zones):
            paths = linked_paths(self.scenario.space, motion, *self.pairs[:2])
            share = float(allowed_share(*paths, self.pairs.offsets, self.zones, self.zone_graphs))
        if any(map(len, self._obstacle_zones)):
            found = self._obstacle_zones
            share = min(share, allowed_by_obstacles(segment, B, links.contacts, links.active(), found, self.base))
        return share

    def relink(self, links: LinkState, pairs: Pairs | None = None) -> None:
        """Update the pairs from the ``links``, whose ``pairs`` the native loop may have found.

        Raises
        ------
        InvalidInput
            When a functional of the graph does not exist for these links.
        """
        self._energies.clear()
        senders, sensed, offsets, pieces = links.pairs() if pairs is None else pairs[:4]
        self.pairs = Pairs(senders, sensed, offsets, pieces, self._spans)
        # The pieces are those of the acting law.
        self._declared_pairs = self.pairs
        if self._declared is not None:
            self._declared_pairs = Pairs(senders, sensed, offsets, *free_pieces(len(pieces)))
        self._functionals = links.functionals()
        self._linked = int(np.count_nonzero(links.links[0]))

    def renumbered(self, scenario: Scenario) -> Dynamics | None:
        """The same kernels, links and pieces for a scenario whose law has other numbers; None if more changed.

        Call `repack` for the parameters, and then `divide` and `keep_pairs` for the spans of the pieces.
        """
        layout = Layout(scenario.law, scenario.energy, scenario.agents, scenario.space)
        if self._declared is not None or not layout.same_kernels(self.layout):
            return None
        found = copy(self)
        found.scenario, found.layout, found._energies, found._reading = scenario, layout, {}, Reading()
        found.held = self.held.copy()
        found._places = list(layout.places)
        found._judge_contacts()
        return found

    def _judge_contacts(self) -> None:
        """Find where potentials are infinite."""
        law, graphs = self.layout.law, self.layout.law.graphs
        self.barriers, self.contacts = [*map(law.has_barrier, graphs)], [*map(law.singular_at_contact, graphs)]
        self.singular = any(self.contacts)

    def keep_pairs(self) -> None:
        """Keep links and pieces, with the spans of the pieces found by `divide`."""
        self._energies.clear()
        self.pairs = self.pairs._replace(spans=self._spans)
        self._declared_pairs = self.pairs

    @property
    def unlinked(self) -> float:
        """Energy of all pairs without a link."""
        return 0.5 * (self.n * (self.n - 1) - self._linked) * self.scenario.energy.unlinked

    @property
    def compiled(self) -> CompiledLaw | None:
        """The law in force for native functions.

        None for leaders without a closed form, obstacles whose potentials have narrow features, or bodies with limits.
        """
        if self._places or self.held.limits or any(map(len, self._obstacle_zones)):
            return None
        return self._in_force()

    def _in_force(self) -> CompiledLaw:
        ledger = None
        if self._ledger is not None:
            # Work, the first of the columns, is that of the forces that act.
            begin, end = self.motion_size + 1, self.motion_size + LEDGER
            free = np.tile(FREE, (len(self.pairs.spans), 1))
            ledger = self._ledger[0].in_ledger(begin, end, free, self._ledger[1])
        return self._kernels.in_force(self.n, self.m, self.pairs, self._slots, self._functionals, ledger)

    def places(self, t: float) -> Array:
        """Coordinates at time ``t`` of the leaders whose position has no closed form."""
        return np.array([place.at(t + self.base) for _, place in self._places])

    def _locate(self, y: Array) -> None:
        """Write these coordinates where the kernels read them."""
        if not self._places:
            return
        known = y[self.motion_size + LEDGER :]
        for k, ((slot, _), coordinate) in enumerate(zip(self._places, known, strict=True)):
            slots = self._slots if k < self._known or self._ledger is None else self._ledger[1]
            slots[0][slot] = coordinate

    def slope(self, t: float, y: Array) -> Array:
        """dy/dt of a state vector ``y``; with a plant the ledger has the powers of the declared law."""
        if self._places:
            with self._reading:
                return self._slope(t, y)
        return self._slope(t, y)

    def accelerations(self, t: float, y: Array) -> Array:
        """Rates of change of velocities (order 2), or controls (order 1), at a state vector ``y``, shape (N, m)."""
        size = self.n * self.m
        return np.asarray(self.slope(t, y))[(self.order - 1) * size : self.order * size].reshape(self.n, self.m)

    def _slope(self, t: float, y: Array) -> Array:
        self._locate(y)
        t = t + self.base
        dy = np.zeros_like(y)
        nodes, weights = _START
        stages(self._in_force(), nodes, weights, 0, 1, -1, t, y, 0.0, dy[None], np.empty_like(y))
        for k, (_, place) in enumerate(self._places):
            dy[self.motion_size + LEDGER + k] = place.leader.velocity_at(t)[place.axis]
        return dy

    def stages(
        self, first: int, last: int, state_stage: int, t: float, y: Array, h: float, K: Array, nodes: Array,
        weights: Array,
    ) -> Array:  # fmt: skip
        """Slopes at stages ``first`` to ``last - 1`` of a Runge-Kutta step, and the state at the stage ``state_stage``.

        Parameters
        ----------
        t, y, h
            Where the step begins, and its length.
        K
            Slopes at the stages, one in each row; those before ``first`` are known.
        nodes, weights
            The method: its nodes c, shape (stages,), and its matrix a, shape (stages, stages).
        """
        if not self._places:
            found = np.empty(len(y))
            stages(self._in_force(), nodes, weights, first, last, state_stage, t + self.base, y, h, K, found)
            return found
        found = y
        for s in range(first, max(last, state_stage + 1)):
            z = y + h * (weights[s, :s] @ K[:s])
            found = z if s == state_stage else found
            if s < last:
                K[s] = self.slope(t + float(nodes[s]) * h, z)
        return found

    def energy(self, t: float, y: Array) -> tuple[float, float]:
        """Energy and kinetic energy of a state vector ``y`` under the declared law."""
        key = (t, y.tobytes())
        known = self._energies.get(key)
        if known is not None:
            return known
        self._locate(y)
        module, slots = self._ledger or (self._kernels, self._slots)
        q, p, _ = self.split(y)
        given = t + self.base, q, p, self._declared_pairs, slots, self._functionals
        pairs, bodies, kinetic = module.energies(*given)
        found = float(pairs + bodies + kinetic + self.unlinked), float(kinetic)
        self._keep_energy(key, found)
        return found

    def know_energy(self, t: float, y: Array, found: tuple[float, float]) -> None:
        """Cache energy and kinetic energy (``found``) of a state vector ``y``, see `energy`."""
        self._keep_energy((t, y.tobytes()), found)

    def _keep_energy(self, key: tuple[float, bytes], found: tuple[float, float]) -> None:
        while len(self._energies) >= KNOWN_ENERGIES:
            del self._energies[next(iter(self._energies))]
        self._energies[key] = found

    def split(self, y: Array) -> tuple[Array, Array, Array]:
        """Positions, velocities and integrated quantities of a state vector ``y``; views, if there are velocities."""
        count = self.n * self.m
        q = y[:count].reshape(self.n, self.m)
        p = y[count : 2 * count].reshape(self.n, self.m) if self.order == 2 else np.zeros_like(q)
        return q, p, y[self.columns_size :]

    def integrals(self, states: Array, velocity: Array, begin: Array) -> Array:
        """Result of `fill_ledger` for state vectors (``states``, ``velocity``, ``begin``)."""
        found = np.empty((len(states), DEPARTED + 1))
        each = np.full(self.n, self.scenario.agents.masses, dtype=np.float64)
        moving = self.n * self.m if self.order == 2 else -1
        lab = self.scenario.energy.frame == "lab"
        fill_ledger(states, each, velocity, begin, lab, moving, self.motion_size, self.departs, found)
        return found

    def further(self, y: Array) -> dict[str, Array]:
        """Further columns of a state vector ``y`` by name, shape (N, width) each; views."""
        return further_columns(y, self.order * self.n * self.m, self.n, self.columns)

    def join(self, state: State, integrated: Array) -> Array:
        """State vector of a state.

        Parameters
        ----------
        integrated
            Departure of bodies that depart, quantities of the ledger, positions of leaders that have no closed form.
        """
        return np.concatenate([joined(state, self.order, self.columns), integrated])

    def tolerances(self, state: State, energy: float) -> Array:
        """Absolute error tolerance of each component, from the size of the group at ``state`` and the ``energy``."""
        tolerance, duration = self.scenario.tolerance, self.scenario.t_end - self.scenario.start.t
        found = component_tolerances(state, self.order, self.columns, self.scenario)
        speed = natural_sizes(state, duration)[1]
        moving = 0.5 * float(np.full(self.n, self.scenario.agents.masses).sum()) * speed**2
        ledger = np.full(self.departs + LEDGER, tolerance * counted(abs(energy), max(abs(energy), moving)))
        return np.concatenate([found, ledger, np.full(len(self._places), found[0])])
