"""What claims look at: quantities computed once from a run."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from flocking.engine.run import Closest, Run
from flocking.engine.step_checks import RESIDUAL
from flocking.model.checks import Array
from flocking.model.connectivity import Links, components, is_connected
from flocking.model.graphs import pair_distances
from flocking.model.law import Law
from flocking.study.equilibrium import Equilibrium

LEDGER_FACTOR = 100.0
"""The ledger must close to this many tolerances times the total energy moved."""


SLACK = 1e-6
"""Share of a radius within which a pair may be linked or not."""

MOST_DENSE = 4000
"""Largest group whose pairs are all looked at at once."""


class NotMeasurable(Exception):  # noqa: N818  a verdict, not a fault
    """A quantity that this run does not let one compute; a claim that needs it is not applicable."""


class Evidence:
    """Measured quantities of a run, each computed when first asked for.

    Parameters
    ----------
    run
        The run.
    """

    def __init__(self, run: Run) -> None:
        self.run = run

    @property
    def law(self) -> Law:
        """The declared law."""
        return self.run.scenario.law

    @property
    def sampled(self) -> bool:
        """Whether the run is made of samples from elsewhere: nothing is known between them."""
        return self.run.provenance.get("engine") == "samples"

    @property
    def switches_known(self) -> bool:
        """Whether every switch of a link is recorded; else only the frames say who was linked."""
        return not self.sampled and self.run.provenance.get("switches") != "not recorded"

    @property
    def approach_error(self) -> float:
        """How much closer than recorded two agents may have come."""
        if self.sampled:
            return float(self.run.provenance["gap"])
        if "farthest" in self.run.provenance:
            return float(self.run.provenance["farthest"])
        if "closest" in self.run.provenance:
            raise NotMeasurable(f"agents' distances were looked at only {self.run.provenance['closest']}")
        return 10 * self.run.scenario.tolerance * max(1.0, float(self.diameter[0]))

    @property
    def closest_linked(self) -> Closest:
        """Closest approach ever of two linked agents; infinitely far where there was never a link."""
        found = self.run.closest_linked
        if not np.isfinite(found.distance) and self.run.links.any():
            raise NotMeasurable(f"the engine {self.run.provenance['engine']} did not look at linked agents' distances")
        return found

    @property
    def closest(self) -> Closest:
        """Closest approach ever of any two agents.

        Where an engine looks at linked pairs alone, all others are out of reach of each other, unless the graph
        is fixed.
        """
        if "farthest" not in self.run.provenance:
            return self.run.closest
        if not self.law.graph.moves:
            raise NotMeasurable(f"the engine {self.run.provenance['engine']} looks at linked agents' distances alone")
        reach = float(np.min(np.asarray(self.law.graph.appear_radius)))
        return min(self.closest_linked, Closest(reach), key=lambda c: c.distance)

    @property
    def masses(self) -> Array:
        """Mass of each agent, shape (N,)."""
        return np.broadcast_to(np.asarray(self.run.scenario.agents.masses, dtype=np.float64), self.run.n)

    @property
    def fixed_step(self) -> bool:
        """Whether the engine took fixed steps: its ledger closes to the order of its scheme, not to a tolerance."""
        return "scheme" in self.run.provenance

    @cached_property
    def step_residual(self) -> float:
        """Largest part of a single step's energy that the ledger does not explain, with rounding."""
        size = float(np.abs(self.run.trace["energy"]).max(initial=0.0))
        return float(np.abs(np.diff(self.run.residual)).max(initial=0.0)) + 1e-12 * size

    @cached_property
    def ledger_bound(self) -> float:
        """How large the ledger's residual may be: 100 tolerances times the energy moved, plus rounding.

        Between samples of a motion from elsewhere the powers are interpolated, and their error takes its place. A
        fixed step is held to what its engine holds it to, a share of the energy moved.
        """
        if self.fixed_step and len(self.run.trace):
            kinetic = self.run.trace["kinetic"]
            moved = self.run.turnover + float(np.abs(np.diff(self.run.trace["jumped"])).sum())
            return RESIDUAL * (moved + float(kinetic[0] + kinetic[-1])) + 1e-14
        if self.sampled:
            size = float(np.abs(self.run.trace["energy"]).max(initial=0.0))
            return 3 * float(self.run.provenance["ledger_error"]) + 1e-9 * size
        tolerance = float(self.run.provenance.get("tolerance", self.run.scenario.tolerance))
        size = float(np.abs(self.run.trace["energy"]).max(initial=0.0))
        return LEDGER_FACTOR * tolerance * self.run.turnover + 1e-12 * size + 1e-14

    @cached_property
    def residual(self) -> float:
        """Largest absolute residual of the energy ledger over the run."""
        if not len(self.run.trace):
            raise NotMeasurable("the run has no ledger to vouch for its motion")
        return float(np.abs(self.run.residual).max(initial=0.0))

    @cached_property
    def foreign_link(self) -> str:
        """What contradicts the declared graph at the last frame: a link too long, or one that is missing.

        The ledger of an engine adds over the links that were at work, whoever made them. Earlier frames may belong
        to a law that was replaced on the way.
        """
        graph, state = self.law.graph, self.run.state(-1) if len(self.run.t) else None
        if state is None or state.links is None or graph.sees_headings or not self.switches_known:
            return ""
        distance = pair_distances(state.q)
        if graph.moves:
            leaves, enters = (np.asarray(r)[..., None] for r in (graph.break_radius, graph.appear_radius))
            wrong = state.links & (distance > leaves * (1 + SLACK)) | ~state.links & (distance < enters * (1 - SLACK))
        else:
            wrong = state.links != graph.initial(state.q)
        if not wrong.any():
            return ""
        i, j = (int(k) for k in np.argwhere(wrong)[0])
        what = "are linked" if state.links[i, j] else "are not linked"
        return f"agents {i} and {j}, {distance[i, j]:.4g} apart, {what} at the end, against the declared graph"

    @property
    def ledger_closes(self) -> bool:
        """Whether the declared law explains the energy of the computed motion."""
        return self.residual <= self.ledger_bound and not self.foreign_link

    @property
    def ledger_note(self) -> str:
        """The residual and its bound in words."""
        share = f" ({100 * RESIDUAL:g} % of the energy moved, for a fixed step)" if self.fixed_step else ""
        return f"ledger residual {self.residual:.2e}, allowed {self.ledger_bound:.2e}{share}"

    @cached_property
    def mean_velocity(self) -> Array:
        """Velocity of the centre of mass at the frames, shape (F, m)."""
        self._need_frames()
        return np.asarray(np.einsum("i,fik->fk", self.masses, self.run.p) / self.masses.sum())

    @cached_property
    def velocity_spread(self) -> Array:
        """Largest |p_i - mean| at each frame, shape (F,); what was observed where the run keeps no frames."""
        seen = self.run.observables
        if not len(self.run.t) and seen is not None and len(seen) and not np.ptp(self.masses):
            return np.asarray(seen["spread"])
        offsets = self.run.p - self.mean_velocity[:, None, :]
        return np.asarray(np.linalg.norm(offsets, axis=2).max(axis=1))

    @cached_property
    def speeds(self) -> Array:
        """Largest speed at each frame, shape (F,)."""
        self._need_frames()
        return np.asarray(np.linalg.norm(self.run.p, axis=2).max(axis=1))

    @cached_property
    def diameter(self) -> Array:
        """Largest distance of two agents at each frame, shape (F,)."""
        self._need_all_pairs()
        found = []
        for q in self.run.q:
            offsets = q[None] - q[:, None]
            found.append(float(np.sqrt((offsets**2).sum(axis=2).max())))
        return np.array(found)

    @cached_property
    def distance_rate(self) -> float:
        """Largest rate of change of a pair distance at the last frame."""
        self._need_all_pairs()
        q, p = self.run.q[-1], self.run.p[-1]
        i, j = np.triu_indices(self.run.n, 1)
        if len(i) == 0:
            return 0.0
        d, v = q[j] - q[i], p[j] - p[i]
        r = np.linalg.norm(d, axis=1)
        return float(np.abs((d * v).sum(axis=1) / np.where(r > 0, r, 1.0)).max())

    def _need_frames(self) -> None:
        if not len(self.run.t):
            raise NotMeasurable("the run keeps no frames")

    def _need_all_pairs(self) -> None:
        self._need_frames()
        if self.run.n > MOST_DENSE:
            raise NotMeasurable(f"{self.run.n} agents have too many pairs")

    @cached_property
    def link_history(self) -> list[tuple[float, Links]]:
        """Link matrix of the law's graph from each time it changed on, the first at the start.

        At the frames where switches are not recorded.
        """
        if self.run.links.shape[1:] != (self.run.n, self.run.n):
            raise NotMeasurable(f"frames of {self.run.n} agents hold no link matrices")
        links = np.array(self.run.links[0])
        if not self.switches_known:
            return [(float(t), np.asarray(x)) for t, x in zip(self.run.t, self.run.links, strict=True)]
        history = [(float(self.run.t[0]), links.copy())]
        directed = self.law.graph.directed
        for row in self.link_switches:
            i, j = int(row["i"]), int(row["j"])
            value = row["kind"] == "appear"
            links[i, j] = value
            if not directed:
                links[j, i] = value
            if float(row["time"]) == history[-1][0]:
                history[-1] = (history[-1][0], links.copy())
            else:
                history.append((float(row["time"]), links.copy()))
        return history

    @cached_property
    def link_switches(self) -> np.ndarray[Any, Any]:
        """Switches of links of the law's own graph."""
        s = self.run.switches
        return np.asarray(s[(s["graph"] == 0) & ((s["kind"] == "appear") | (s["kind"] == "break"))])

    @cached_property
    def first_disconnected(self) -> float:
        """First time at which the graph is not connected; infinite when it always is."""
        if (seen := self._observed_flocks) is not None:
            return next((float(row["time"]) for row in seen if row["flocks"] > 1), np.inf)
        return next((t for t, links in self.link_history if not is_connected(links)), np.inf)

    @cached_property
    def flocks_at_end(self) -> int:
        """Number of flocks at the end."""
        if (seen := self._observed_flocks) is not None:
            return int(seen["flocks"][-1])
        return int(components(self.link_history[-1][1]).max()) + 1

    @property
    def _observed_flocks(self) -> np.ndarray[Any, Any] | None:
        """What was observed, where there are no link matrices to look at instead."""
        seen, run = self.run.observables, self.run
        bare = not len(run.t) or run.links.shape[1:] != (run.n, run.n)
        return seen if bare and seen is not None and len(seen) else None

    @property
    def connected_at_start(self) -> bool:
        """Whether the graph is connected at the start."""
        if (seen := self._observed_flocks) is not None:
            return bool(seen["flocks"][0] == 1)
        return bool(is_connected(self.link_history[0][1]))

    @property
    def looks(self) -> int:
        """How many times the links were looked at."""
        return len(self.link_history if self._observed_flocks is None else self._observed_flocks)

    @property
    def links_created(self) -> int:
        """Number of links that appeared."""
        return int((self.link_switches["kind"] == "appear").sum())

    @property
    def links_lost(self) -> int:
        """Number of links that broke."""
        return int((self.link_switches["kind"] == "break").sum())

    @cached_property
    def last_switch(self) -> float:
        """Time of the last link switch; the start when there was none."""
        switches = self.link_switches
        return float(switches["time"][-1]) if len(switches) else float(self.run.t[0])

    @cached_property
    def equilibrium(self) -> Equilibrium:
        """Forces and stiffness of the potentials at the last frame."""
        self._need_all_pairs()
        return Equilibrium(self.law, self.run.state(-1))
