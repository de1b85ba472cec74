"""The compiled law of a running simulation: kernels, parameters in force, and the energies the ledger holds."""

from __future__ import annotations

import numpy as np

from flocking.engine.exact.crossings.switching import LinkState
from flocking.engine.exact.integrator.segment import Segment
from flocking.engine.exact.narrow_features import allowed_by_obstacles, allowed_share, zones_of
from flocking.engine.kernels.codegen import RATES, compiled_kernels
from flocking.engine.kernels.law_kernels import LawKernels, Pairs
from flocking.engine.kernels.layout import Layout
from flocking.engine.kernels.pieces import FREE, free_pieces, limits
from flocking.errors import InvalidInput
from flocking.formula.compiled import Reading
from flocking.model.checks import Array
from flocking.model.law import Law, Scenario
from flocking.model.state import State

LEDGER = len(RATES)
"""Number of integrated quantities of the ledger."""

KNOWN_ENERGIES = 6
"""How many energies are remembered: a step asks for those of its ends, and of the companion's, several times."""

_START = np.zeros(1), np.zeros((1, 1))
"""Nodes and weights of the method whose only stage is where it starts."""


class Dynamics:
    """The right-hand side of the state vector [q, p, work, dissipated, supplied, places].

    Places are the coordinates of leaders whose position has no closed form.

    Parameters
    ----------
    scenario
        What is simulated.
    plant
        The law the agents really obey, where it is not the scenario's: the ledger's powers and energies go on
        being those of the declared law.
    n, m
        Numbers of agents and dimensions.
    base
        The time at which the session's own time, which all functions here are given, is 0.

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
        self.order = scenario.agents.order
        self.layout = Layout(law, scenario.energy)
        self._kernels = LawKernels(compiled_kernels(self.layout, m, self.order), self.order)
        self._declared: tuple[LawKernels, Layout] | None = None
        if plant is not None:
            if len(law.graphs) != len(scenario.law.graphs):
                raise InvalidInput(
                    "ExactSession", "plant", "must have as many graphs as the declared law",
                    f"{len(law.graphs)} instead of {len(scenario.law.graphs)}",
                )  # fmt: skip
            declared = Layout(scenario.law, scenario.energy)
            self._declared = (LawKernels(compiled_kernels(declared, m, self.order), self.order), declared)
        self._reading = Reading()
        self._places = list(self.layout.places)
        self._known = len(self._places)
        if self._declared is not None:
            self._places += self._declared[1].places
        self.barriers = [law.has_barrier(g) for g in law.graphs]
        self.singular = law.singular_at_zero()
        self._energies: dict[tuple[float, bytes], tuple[float, float]] = {}

    def repack(self, t: float) -> None:
        """Take the parameters as they are from time ``t`` on."""
        self._energies.clear()
        t = self._late(t)
        agents = self.scenario.agents
        self._slots = self.layout.values(agents, self.n, t)
        self._ledger = None
        if self._declared is not None:
            module, layout = self._declared
            self._ledger = (module, layout.values(agents, self.n, t))

    def _late(self, own: float) -> float:
        """The time at the session's own time, and not before a switch that falls on it."""
        t = own + self.base
        terms = self.layout.law.body_terms
        after = (s for term in terms for s in term.switch_times(t, np.nextafter(t + 4 * abs(np.spacing(t)), np.inf)))
        return max([t, *(s for s in after if s - self.base <= own)])

    def linked_pairs(self) -> tuple[Array, Array]:
        """Ordered pairs of linked agents."""
        senders, sensed, offsets = self.pairs[:3]
        end = offsets[len(self.layout.law.graphs)]
        return senders[:end], sensed[:end]

    def divide(self, links: LinkState) -> None:
        """Find where the pieces of the formulas go on beyond `LinkState.borders`, and their narrow features."""
        self._energies.clear()
        rows = [np.array([FREE])]
        for k, borders in enumerate(links.borders()):
            graphs = len(links.graphs)
            name = f"shape{k}" if k < graphs else f"shape_obstacles{k - graphs}"
            shape = self._kernels.shape(name)
            rows.append(np.tile(FREE, (len(borders), 1)) if shape is None else limits(borders, shape, self._slots))
        self._spans = np.concatenate(rows)
        found = [
            zones_of(self._kernels.name, self._kernels.shape(f"shape{k}"), self._slots, borders)
            for k, borders in enumerate(links.borders()[: len(links.graphs)])
        ]
        self.zones = np.concatenate(found)
        self.zone_graphs = np.repeat(np.arange(len(found)), [len(rows) for rows in found])
        self._obstacle_zones = [
            zones_of(
                self._kernels.name, self._kernels.shape(f"shape_obstacles{k}"), self._slots, borders,
                tuple(group.rows.values()),
            )
            for k, (group, borders) in enumerate(
                zip(links.encounters.groups, links.borders()[len(links.graphs) :], strict=True)
            )
        ]  # fmt: skip

    def allowed_share(self, segment: Segment, links: LinkState) -> float:
        """Which fraction of a step nobody moves further within a narrow feature than it may.

        Parameters
        ----------
        segment
            The step.
        links
            Links and obstacles in range during it.
        """
        share = 1.0
        motion = segment.motion(self.n, self.m, self.order)
        B = motion.positions
        if len(self.zones):
            share = float(allowed_share(B, motion.far, *self.pairs[:3], self.zones, self.zone_graphs))
        if any(map(len, self._obstacle_zones)):
            found = self._obstacle_zones
            share = min(share, allowed_by_obstacles(segment, B, links.encounters, links.active(), found, self.base))
        return share

    def relink(self, links: LinkState) -> None:
        """Take the links as they are now.

        Raises
        ------
        InvalidInput
            When a functional of the graph does not exist for these links.
        """
        self._energies.clear()
        *pairs, pieces = links.pairs()
        self.pairs = (*pairs, pieces, self._spans)
        # The pieces are those of the acting law.
        self._declared_pairs: Pairs = self.pairs
        if self._declared is not None:
            self._declared_pairs = (*pairs, *free_pieces(len(pieces)))
        self._functionals = links.functionals()
        self._linked = int(np.count_nonzero(links.links[0]))

    @property
    def unlinked(self) -> float:
        """Energy of all pairs without a link."""
        return 0.5 * (self.n * (self.n - 1) - self._linked) * self.scenario.energy.unlinked

    @property
    def compiled(self) -> tuple[int | Array, ...] | None:
        """The law in force, as native functions take it: addresses, order, sizes, pairs, parameters and functionals.

        None where a step needs more: leaders without a closed form, the ledger of another law, or obstacles whose
        potentials have narrow features.
        """
        if self._places or self._ledger is not None or any(map(len, self._obstacle_zones)):
            return None
        sizes = self.order, self.n, self.m
        return (*self._kernels.addresses, *sizes, *self.pairs, *self._slots, self._functionals)

    def places(self, t: float) -> Array:
        """Coordinates at time ``t`` of the leaders whose position has no closed form."""
        return np.array([place.at(t + self.base) for _, place in self._places])

    def _locate(self, y: Array) -> None:
        """Put these coordinates where the kernels read them."""
        if not self._places:
            return
        known = y[self.order * self.n * self.m + LEDGER :]
        for k, ((slot, _), coordinate) in enumerate(zip(self._places, known, strict=True)):
            slots = self._slots if k < self._known or self._ledger is None else self._ledger[1]
            slots[0][slot] = coordinate

    def slope(self, t: float, y: Array) -> Array:
        """dy/dt; with a plant the ledger's powers are those of the declared law along the plant's motion.

        Parameters
        ----------
        y
            State vector: positions, velocities of agents of order 2, then the integrated quantities.
        """
        if self._places:
            with self._reading:
                return self._slope(t, y)
        return self._slope(t, y)

    def _slope(self, t: float, y: Array) -> Array:
        self._locate(y)
        t = t + self.base
        dy = np.zeros_like(y)
        nodes, weights = _START
        law = self.n, self.m, self.pairs, self._slots, self._functionals
        self._kernels.stages(0, 1, -1, t, y, 0.0, dy[None], nodes, weights, *law)
        if not self._places and self._ledger is None:
            return dy
        tail = self.order * self.n * self.m
        for k, (_, place) in enumerate(self._places):
            dy[tail + LEDGER + k] = place.leader.velocity_at(t)[place.axis]
        if self._ledger is None:
            return dy
        module, slots = self._ledger
        q, p, _ = self.split(y)
        rates = np.empty(LEDGER)
        module.control(t, q, p, self._declared_pairs, slots, self._functionals, np.empty_like(q), rates)
        dy[tail + 1 : tail + LEDGER] = rates[1:]
        return dy

    def stages(
        self, first: int, last: int, kept: int, t: float, y: Array, h: float, K: Array, nodes: Array, weights: Array
    ) -> Array:
        """Slopes at stages ``first`` to ``last - 1`` of a Runge-Kutta step, and the state at the stage ``kept``.

        Parameters
        ----------
        t, y, h
            Where the step begins, and its length.
        K
            Slopes at the stages, one in each row; those before ``first`` are known.
        nodes, weights
            The method: its nodes c, shape (stages,), and its matrix a, shape (stages, stages).
        """
        if not self._places and self._ledger is None:
            given = first, last, kept, t + self.base, y, h, K, nodes, weights
            return self._kernels.stages(*given, self.n, self.m, self.pairs, self._slots, self._functionals)
        found = y
        for s in range(first, max(last, kept + 1)):
            z = y + h * (weights[s, :s] @ K[:s])
            if s == kept:
                found = z
            if s < last:
                K[s] = self.slope(t + float(nodes[s]) * h, z)
        return found

    def energy(self, t: float, y: Array) -> tuple[float, float]:
        """Energy and kinetic energy of a state vector under the declared law.

        Parameters
        ----------
        y
            State vector: positions, velocities of agents of order 2, then the integrated quantities.
        """
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
        self.know_energy(t, y, found)
        return found

    def know_energy(self, t: float, y: Array, found: tuple[float, float]) -> None:
        """Remember energy and kinetic energy of a state vector, see `energy`.

        Parameters
        ----------
        t, y
            As for `energy`.
        found
            The energies.
        """
        while len(self._energies) >= KNOWN_ENERGIES:
            del self._energies[next(iter(self._energies))]
        self._energies[t, y.tobytes()] = found

    def split(self, y: Array) -> tuple[Array, Array, Array]:
        """Positions, velocities and the integrated quantities of a state vector; views, where there are velocities.

        Parameters
        ----------
        y
            State vector: positions, velocities of agents of order 2, then the integrated quantities.
        """
        count = self.n * self.m
        q = y[:count].reshape(self.n, self.m)
        p = y[count : 2 * count].reshape(self.n, self.m) if self.order == 2 else np.zeros_like(q)
        return q, p, y[self.order * count :]

    def join(self, state: State, integrated: Array) -> Array:
        """State vector of a state.

        Parameters
        ----------
        integrated
            Quantities of the ledger, then positions of leaders that have no closed form.
        """
        parts = [state.q.ravel(), state.p.ravel()] if self.order == 2 else [state.q.ravel()]
        return np.concatenate([*parts, integrated])

    def tolerances(self, state: State, energy: float) -> Array:
        """Absolute error tolerance of each component, from the size of the group at ``state``.

        Parameters
        ----------
        energy
            Energy at the same state, the scale of the ledger.
        """
        spread = float(np.abs(state.q - state.q.mean(axis=0)).max(initial=0.0))
        speed = float(np.abs(state.p).max(initial=0.0))
        tolerance = self.scenario.tolerance
        count = self.n * self.m
        parts = [np.full(count, tolerance * max(1.0, spread))]
        if self.order == 2:
            parts.append(np.full(count, tolerance * max(1.0, speed)))
        parts.append(np.full(LEDGER, tolerance * max(1.0, abs(energy))))
        return np.concatenate([*parts, np.full(len(self._places), tolerance * max(1.0, spread))])
