"""A scenario as a LAMMPS input deck and data file, for this engine and for export."""

from __future__ import annotations

import inspect
from dataclasses import dataclass

import numpy as np

from flocking.arrays import AnyArray, Array
from flocking.engine.kernels.layout import MASS, Layout
from flocking.engine.lammps.bodies import AXES, BodyDeck, body_deck
from flocking.engine.lammps.checks import check_supported
from flocking.engine.lammps.images import images_of, periods_of
from flocking.engine.lammps.library import FIRST_ORDER, LONGEST
from flocking.engine.lammps.neighbours import radius_of
from flocking.engine.lammps.pairs import PairPart, pair_commands, pair_part, table_text
from flocking.errors import InvalidInput, escaped
from flocking.model.checks import number
from flocking.model.law import Law, Scenario
from flocking.model.state import State
from flocking.model.terms.potential_reach import inner_edge

BALANCE_EVERY = 500
"""Steps between two checks of the load balance of ranks."""
UNEVEN = 1.1
"""Ratio of the largest to the mean number of agents per rank above which LAMMPS balances the load."""
BOX_MARGIN = 1e-6
"""Margin of the box around the agents, relative to the largest coordinate, above the rounding of coordinates."""
THICKNESS = 1e4
"""Half the thickness of the box in the plane: thicker than most cells of a scattered flock, as LAMMPS requires."""

SKIN_SHARE = 0.15
"""Default skin of the neighbour lists, in radii."""


@dataclass(frozen=True, eq=False)
class Deck:
    """A scenario for LAMMPS.

    Parameters
    ----------
    scenario
        The scenario to simulate.
    skin
        Skin of the neighbour lists.
    parts
        Pair terms per graph.
    body
        Body terms.
    A
        Values per agent, shape (slots, N).
    """

    scenario: Scenario
    skin: float
    parts: list[PairPart]
    body: BodyDeck
    A: Array

    @property
    def dimension(self) -> int:
        """Number of axes."""
        return self.scenario.start.dimension

    @property
    def _periods(self) -> Array:
        return periods_of(self.scenario.space, self.dimension)

    @property
    def order(self) -> int:
        """Order of the agents, 1 or 2."""
        return self.scenario.agents.order

    @property
    def reach(self) -> float:
        """Largest radius of a link."""
        return max(part.radius for part in self.parts)

    @property
    def columns(self) -> list[str]:
        """Slots of the per-agent values in the data file, besides positions and velocities."""
        masses = [MASS] if np.ndim(self.scenario.agents.masses) else []
        return masses + sorted(self.body.properties - {MASS}, key=lambda s: int(s[1:]))

    def properties(self) -> list[str]:
        """Commands that declare the per-agent values, before agents are read."""
        if not self.columns:
            return []
        columns = " ".join("rmass" if c == MASS else f"d_{c}" for c in self.columns)
        return [f"fix nature all property/atom {columns}"]

    def world(self) -> list[str]:
        """Commands before the agents: units, dimension, boundaries."""
        kinds = ["p" if period else "s" for period in self._periods] + ["p"] * (3 - self.dimension)
        meaning = "s: open, the box follows the agents"
        if self._periods.any():
            meaning = "p: repeats after the length of the box" + (f"; {meaning}" if "s" in kinds else "")
        return [
            "units lj", f"dimension {self.dimension}", f"boundary {' '.join(kinds)}  # {meaning}",
            "atom_style atomic", "newton on", "atom_modify map yes", "comm_style tiled",
            "comm_modify vel yes  # consensus needs the neighbours' velocities",
        ]  # fmt: skip

    def agents(self, data: str) -> list[str]:
        """Commands that read the agents from a data file."""
        extra = " fix nature NULL Nature" if self.columns else ""
        return [*self.properties(), f"read_data {data}{extra}"]

    def law(self, ranks: int = 1) -> list[str]:
        """Commands for neighbours, pair terms, motion and body terms.

        Parameters
        ----------
        ranks
            Number of ranks.
        """
        scenario = self.scenario
        lines = [f"neighbor {self.skin!r} bin", "neigh_modify every 1 delay 0 check yes", ""]
        for term in scenario.law.pair_terms:
            lines.append(f"# {_headline(term)}")
            lines += [f"#   {name} = {value!r}" for name, value in term.parameters.items()]
        if bound := max(part.table_error for part in self.parts):
            lines.append(f"# error bound of the tabulated forces: {bound:.1e}")
        lines += [
            *pair_commands(self.parts),
            "",
            *self._motion(),
        ]
        lines += [f"variable now equal time+({float(scenario.start.t)!r})", ""]
        for body in scenario.law.body_terms:
            lines.append(f"# {_headline(body)}")
        if self.order == 2 and np.any(scenario.agents.damping):
            lines.append("# and the agents' own damping -k_i p_i")
        lines += self.body.lines
        if self.dimension == 2:
            lines.append("fix flat all enforce2d")
        if ranks > 1:
            lines.append("# load balance of the ranks by recursive bisection")
            lines.append(f"fix even all balance {BALANCE_EVERY} {UNEVEN} rcb")
        return lines

    def _motion(self) -> list[str]:
        """Commands that move the agents."""
        if self.order == 2:
            return ["# velocity Verlet; forces use positions at t and velocities at t - h/2", "fix move all nve"]
        return [
            "# forward Euler: the velocity is the force, for friction 1; there is no noise at any temperature",
            f"fix move all {FIRST_ORDER} 1.0 1 rng none gamma_t 1.0",
        ]

    def data_text(self, state: State) -> str:
        """The data file of a state: agents, their velocities and per-agent values, with all digits.

        On axes that repeat it has their images in the box, and the whole lengths from there to the agents.
        """
        q, p, space = state.q, state.p, self.scenario.space
        n, m = q.shape
        low, high = _box(q)
        low, high = (
            np.where(self._periods > 0, side, open_side) for side, open_side in ((0.0, low), (self._periods, high))
        )
        lines = [f"{escaped(self.scenario.name) or 'flock'}: {n} agents", "", f"{n} atoms", "1 atom types", ""]
        lines += [f"{low[k]:.17g} {high[k]:.17g} {AXES[k]}lo {AXES[k]}hi" for k in range(m)]
        lines += [f"{-THICKNESS!r} {THICKNESS!r} zlo zhi"] if m == 2 else []
        mass = 1.0 if np.ndim(self.scenario.agents.masses) else float(self.scenario.agents.masses)
        lines += ["", "Masses", "", f"1 {mass!r}", "", "Atoms # atomic", ""]
        flat = np.zeros((n, 3 - m))
        if space.is_open:
            lines += _rows("%d 1 %.17g %.17g %.17g", q, flat)
        else:
            lines += _rows("%d 1 %.17g %.17g %.17g %d %d %d", space.wrapped(q), flat, images_of(space, q), flat)
        lines += ["", "Velocities", "", *_rows("%d %.17g %.17g %.17g", p, flat)]
        if self.columns:
            values = self.A[[int(c[1:]) for c in self.columns]].T
            lines += ["", "Nature", "", *_rows("%d" + " %.17g" * len(self.columns), values)]
        return "\n".join(lines) + "\n"

    def tables(self) -> dict[str, str]:
        """Files of tabulated forces by name."""
        return {f"table{k}.txt": table_text("REST", p.table) for k, p in enumerate(self.parts) if p.table is not None}


def _rows(pattern: str, *columns: AnyArray) -> list[str]:
    table = np.concatenate(columns, axis=1).tolist()
    return [pattern % (k, *row) for k, row in enumerate(table, start=1)]


def _box(q: Array) -> tuple[Array, Array]:
    """Corners of a box around all agents, with positive volume."""
    low, high = q.min(axis=0), q.max(axis=0)
    margin = BOX_MARGIN * np.maximum(1.0, np.maximum(np.abs(low), np.abs(high)))
    return low - margin, high + margin


def _headline(part: object) -> str:
    """First sentence of a part's docstring, with its equation in the papers."""
    return (inspect.getdoc(type(part)) or type(part).__name__).splitlines()[0]


def make_deck(scenario: Scenario, skin: float | None = None) -> Deck:
    """Translate a scenario to an input deck.

    Parameters
    ----------
    scenario
        The scenario to simulate.
    skin
        Skin of the neighbour lists; by default a fraction of the largest radius.

    Raises
    ------
    UnsupportedLaw
        If a part has no translation.
    """
    from flocking.engine.kernels.expressions import law_formulas
    from flocking.engine.kernels.flow_formulas import flow_formulas

    check_supported(scenario)
    layout = Layout(scenario.law, scenario.energy, scenario.agents)
    # The kernels of the exact engine compute the ledger; the deck needs only forces in closed form.
    formulas = law_formulas(layout, scenario.start.dimension, integrals=False)
    if scenario.agents.order == 1:
        formulas = flow_formulas(formulas)
    P, A, _ = layout.values(scenario.agents, scenario.start.n, scenario.start.t)
    parts = [
        pair_part(found, P, radius := radius_of(graph), inner_edge(_borders(scenario.law, number), radius))
        for number, (found, graph) in enumerate(zip(formulas.pairs, scenario.law.graphs, strict=True))
    ]
    reach = max(part.radius for part in parts)
    return Deck(scenario, _skin(scenario, reach, skin), parts, body_deck(formulas, layout, P, scenario.agents), A)


def _borders(law: Law, number: int) -> list[float]:
    """Distances at which pieces of the terms over one graph meet."""
    return [x for term in law.pair_terms if law.graph_number(term) == number for x in term.kinks()]


def _skin(scenario: Scenario, reach: float, given: float | None) -> float:
    """The skin of neighbour lists, which with the largest radius stays below each length after which space repeats.

    Lists have the images of agents, and forces act below the radius alone, which `check_space` holds below half a
    length: so a skin beyond half a length adds no force.
    """
    room = LONGEST * min(scenario.space.lengths, default=np.inf) - reach
    if given is None:
        return min(SKIN_SHARE * reach, room)
    width = number("engine='lammps'", "skin", given, above=0.0)
    if width > room:
        raise InvalidInput(
            "engine='lammps'", "skin", f"must be at most {room:.6g}, so that with the radius {reach:g} it is below the "
            "shortest length after which space repeats", width, "Leave it out.",
        )  # fmt: skip
    return width
