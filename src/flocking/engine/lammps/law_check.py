"""A look at LAMMPS's own forces: they must be those of the declared law."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Forces
from flocking.engine.fixed_step.declared_law import Declared, Group
from flocking.engine.fixed_step.law_gaps import LawGaps
from flocking.engine.lammps.deck import Deck
from flocking.engine.lammps.neighbours import near_pairs
from flocking.engine.reference.control import frame_velocity
from flocking.errors import LawNotObeyed, UnsupportedLaw
from flocking.model.law import Scenario
from flocking.model.state import State

AGENTS = 1024
"""Agents looked at."""

CLOSEST = 1e-10
"""LAMMPS's pair styles leave out forces on velocities of pairs that are closer."""

EDGE = 1e-9
"""Share of a radius within which LAMMPS may find a pair linked or not."""


def check_apart(scenario: Scenario) -> None:
    """Refuse a start in which agents coincide: pair styles divide by the distance.

    Raises
    ------
    UnsupportedLaw
        When two agents that may be linked are at the same point.
    """
    from scipy.spatial import cKDTree

    if not scenario.law.pair_terms:
        return
    met = cKDTree(scenario.start.q).query_pairs(CLOSEST, output_type="ndarray")
    if len(met):
        i, j = (int(k) for k in met[0])
        raise UnsupportedLaw(
            f"LAMMPS cannot run agents {i} and {j} at the same point (t = {scenario.start.t:.9g}): its pair styles "
            "divide by their distance. Use engine='tiles' or 'exact', or move one of them."
        )


class LawCheck:
    """Holds the forces of LAMMPS against the law of a scenario; on the first rank.

    Parameters
    ----------
    scenario
        The declared law.
    deck
        What LAMMPS was given; its tables have an error of their own.
    """

    def __init__(self, scenario: Scenario, deck: Deck) -> None:
        self.scenario = scenario
        self.gaps = LawGaps()
        self._declared = Declared(scenario, float(np.finfo(np.float64).eps))
        self._tables = [float(part.table_error) for part in deck.parts]

    def look(self, state: State, forces: Forces, step: float, *, fatal: bool) -> None:
        """Judge the forces that moved the agents to ``state``.

        They saw positions of now and, of agents of order 2, velocities of half a step before.

        Parameters
        ----------
        forces
            LAMMPS's forces, shape (N, m).
        step
            The last step; 0 before the first one, whose forces are those of the start.
        fatal
            Whether a contradiction ends the run.

        Raises
        ------
        LawNotObeyed
            When they are not those of the declared law.
        """
        scenario, n = self.scenario, state.n
        masses = np.broadcast_to(scenario.agents.masses, n).astype(np.float64)
        second = scenario.agents.order == 2
        p = state.p - 0.5 * step * forces / masses[:, None] if second else np.zeros_like(state.p)
        half = State(state.q, p, state.t)
        judged = np.unique(np.linspace(0, n - 1, min(n, AGENTS)).astype(np.int64))
        number = np.full(n, -1)
        number[judged] = np.arange(len(judged))
        means = np.array([masses @ x / masses.sum() for x in (state.q, p)])
        frame = frame_velocity(scenario.energy, half, masses)
        seen = p if second else forces
        group = Group(state.q, seen, np.arange(n), state.t, scenario.start.t, frame, *means)
        pairs, tables = [], np.zeros(len(judged))
        for graph, error in zip(scenario.law.graphs, self._tables, strict=True):
            radius = float(np.max(graph.break_radius))
            i, j = near_pairs(state.q, radius * (1.0 + EDGE))
            i, j = i[number[i] >= 0], j[number[i] >= 0]
            r = np.sqrt(((state.q[j] - state.q[i]) ** 2).sum(axis=1))
            pairs.append((number[i], j, np.abs(r - radius) > EDGE * radius))
            tables += 2.0 * error * np.bincount(number[i], minlength=len(judged))
        declared = self._declared.state(group, judged, pairs)
        self.gaps.checks += 1
        # The half step back rounds; the table lies between its rows.
        rounding = tables + 1e-9 * declared.size + 1e-12 * masses[judged] * np.abs(p[judged]).sum(axis=1)
        wrong = self.gaps.compare_forces(declared, forces[judged], rounding)
        if fatal and wrong is not None:
            raise LawNotObeyed(
                f"LAMMPS's force on an agent is not what the declared law says: it is off by {100 * self.gaps.gap:.3g} "
                f"% of its parts, where rounding and tables explain {100 * self.gaps.allowed:.2g} %. The translation "
                "is at fault, not the step; use engine='tiles', and report the law.",
                time=state.t, agents=(int(judged[wrong]),),
            )  # fmt: skip
