"""Comparison of the forces computed by LAMMPS with those of the declared law."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Forces, Indices
from flocking.engine.fixed_step.automatic_step import SAMPLE
from flocking.engine.fixed_step.certain_pairs import ENTRY_BYTES, certain_pairs, lists_limit, too_crowded
from flocking.engine.fixed_step.declared_law import Declared, Group, Statement, means_of
from flocking.engine.fixed_step.energy_rounding import energy_rounding
from flocking.engine.fixed_step.law_gaps import LawGaps
from flocking.engine.lammps.deck import Deck
from flocking.engine.lammps.neighbours import near_pairs, sampled_pairs
from flocking.engine.reference.control import frame_velocity
from flocking.engine.tiles.particles.displacement import ROUNDINGS
from flocking.errors import LawNotObeyed, UnsupportedLaw
from flocking.model.law import Scenario
from flocking.model.position_tree import tree_of
from flocking.model.state import State

FORCE_ERROR = 1e-9
"""Error of a force of LAMMPS relative to the sum of its parts, with room for its single terms and the half step
back."""

MOMENTUM_ERROR = 1e-12
"""Rounding of momenta in the half step back, relative to them: some thousand units of 1.1e-16."""

AGENTS = 1024
"""Number of agents that are checked."""

CLOSEST = 1e-10
"""Distance below which LAMMPS's pair styles omit velocity-dependent forces."""

EDGE = 1e-9
"""Relative distance from a radius within which LAMMPS may treat a pair as linked or not."""


def check_not_crowded(scenario: Scenario) -> None:
    """Check that the neighbour lists of LAMMPS fit into memory at the start.

    Raises
    ------
    TooCrowded
        If they do not, because too many agents are within one radius.
    """
    limit = lists_limit()
    for graph in scenario.law.graphs:
        reach, n = float(np.max(graph.break_radius)), scenario.start.n
        # Lists hold each pair once. Where not even all pairs are too many, nobody need count them.
        if not np.isfinite(reach) or 0.5 * ENTRY_BYTES * n * (n - 1.0) <= limit:
            continue
        needed = 0.5 * ENTRY_BYTES * certain_pairs(scenario.space.wrapped(scenario.start.q), reach)
        if needed > limit:
            raise too_crowded(needed, limit, scenario.start.t, "Spread the agents or shorten the radius.")


def check_apart(scenario: Scenario) -> None:
    """Check that no agents coincide at the start, since pair styles divide by the distance.

    Raises
    ------
    UnsupportedLaw
        If two agents that may be linked are at the same point.
    """
    if not scenario.law.pair_terms:
        return
    met = tree_of(scenario.start.q, scenario.space).query_pairs(CLOSEST, output_type="ndarray")
    if len(met):
        i, j = (int(k) for k in met[0])
        raise UnsupportedLaw(
            f"LAMMPS cannot run agents {i} and {j} at the same point (t = {scenario.start.t:.9g}): its pair styles "
            "divide by their distance. Use engine='tiles' or 'exact', or move one of them."
        )


class LawCheck:
    """Compares the forces of LAMMPS with the law of a scenario, on the first rank.

    Parameters
    ----------
    scenario
        The declared law.
    deck
        The input deck; its tables have an error bound.
    """

    def __init__(self, scenario: Scenario, deck: Deck) -> None:
        self.scenario = scenario
        self.gaps = LawGaps()
        self._declared = Declared(scenario, float(np.finfo(np.float64).eps))
        self._tables = [float(part.table_error) for part in deck.parts]

    def look(self, state: State, forces: Forces, step: float, *, fatal: bool) -> None:
        """Check the forces that moved the agents to ``state``.

        Forces depend on current positions and, for agents of order 2, on velocities of half a step before.

        Parameters
        ----------
        forces
            LAMMPS's forces, shape (N, m).
        step
            The last step; 0 before the first one, where forces are those of the start.
        fatal
            Whether a deviation is an error.

        Raises
        ------
        LawNotObeyed
            If they are not those of the declared law.
        """
        n, second = state.n, self.scenario.agents.order == 2
        masses = np.broadcast_to(self.scenario.agents.masses, n).astype(np.float64)
        p = state.p - 0.5 * step * forces / masses[:, None] if second else np.zeros_like(state.p)
        judged = _judged(n)
        declared, tables = self._stated(State(state.q, p, state.t), p if second else forces, judged)
        self.gaps.checks += 1
        # Rounding of the half step back, and interpolation error of the table.
        rounding = (
            tables + FORCE_ERROR * declared.size + MOMENTUM_ERROR * masses[judged] * np.abs(p[judged]).sum(axis=1)
        )
        wrong = self.gaps.compare_forces(declared, forces[judged], rounding)
        if fatal and wrong is not None:
            raise LawNotObeyed(
                f"LAMMPS's forces do not follow the declared law: the error of a force is {100 * self.gaps.gap:.3g} "
                f"% of its terms, and rounding and tables explain {100 * self.gaps.allowed:.2g} %. This is an error of "
                "the translation, not of the step; use engine='tiles', and report the law.",
                time=state.t, agents=(int(judged[wrong]),),
            )  # fmt: skip

    def energy_rounding(self, state: State) -> float:
        """Change of the energy by the rounding of positions and of its formulas, estimated from some agents.

        Parameters
        ----------
        state
            The state of all agents.
        """
        judged = _judged(state.n)
        errors = self._stated(state, state.p, judged)[0].power_errors[:, :2]
        sampled = sampled_pairs(self.scenario.law, state.q, state.p, self.scenario.space)
        blur = ROUNDINGS * float(np.finfo(np.float64).eps) * float(np.abs(state.q).max(initial=0.0))
        share = len(range(0, state.n, max(1, state.n // SAMPLE))) / state.n
        return float(errors.sum()) * state.n / len(judged) + energy_rounding(self.scenario.law, sampled, blur) / share

    def _stated(self, state: State, seen: Array, judged: Indices) -> tuple[Statement, Array]:
        """Forces and powers of the checked agents by the law, and the errors of tables in their forces.

        ``seen`` are velocities, of agents of order 1 their controls, shape (N, m).
        """
        scenario, n = self.scenario, state.n
        masses = np.broadcast_to(scenario.agents.masses, n).astype(np.float64)
        number = np.full(n, -1)
        number[judged] = np.arange(len(judged))
        frame = frame_velocity(scenario.energy, state, masses)
        means = means_of(state.q, seen, masses, np.asarray, n)
        group = Group(state.q, seen, np.arange(n), state.t, scenario.start.t, frame, means[0], means[1], means[2:])
        pairs, tables = [], np.zeros(len(judged))
        for graph, error in zip(scenario.law.graphs, self._tables, strict=True):
            radius = float(np.max(graph.break_radius))
            i, j = near_pairs(state.q, radius * (1.0 + EDGE), scenario.space)
            i, j = i[number[i] >= 0], j[number[i] >= 0]
            r = np.sqrt((scenario.space.displacement(state.q[j] - state.q[i]) ** 2).sum(axis=1))
            pairs.append((number[i], j, np.abs(r - radius) > EDGE * radius))
            tables += 2.0 * error * np.bincount(number[i], minlength=len(judged))
        return self._declared.state(group, judged, pairs), tables


def _judged(n: int) -> Indices:
    """Numbers of the checked agents among ``n``, evenly spread."""
    return np.unique(np.linspace(0, n - 1, min(n, AGENTS)).astype(np.int64))
