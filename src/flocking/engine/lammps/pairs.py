"""Pair terms as LAMMPS pair styles: an energy in ``lepton``, a table of the remaining force, and the drag."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Array
from flocking.engine.lammps.printing import lepton
from flocking.errors import UnsupportedLaw
from flocking.formula.derivatives import derivative

if TYPE_CHECKING:
    import sympy

    from flocking.engine.kernels.expressions import PairFormulas

TABLE_ROWS = 20_000
"""Number of rows of a table, evenly spaced in r^2."""

INNER = 1e-3
"""First distance of a table, relative to the radius."""

SEED = 1
"""Seed of the thermostat's noise; without effect, since the temperature is zero."""


@dataclass(frozen=True)
class PairPart:
    """The pair terms over one graph.

    Parameters
    ----------
    radius
        Break radius of the links.
    energy
        Energy of a pair as a Lepton expression; empty for none.
    table
        Distances and forces that are not part of the energy, shape (2, rows); None if there are none.
    drag
        Coefficient of p_j - p_i.
    break_energy
        Energy of a pair at the break radius, or just below it where pieces of a potential meet there, by which the
        energy jumps with a link.
    """

    radius: float
    energy: str
    table: Array | None
    drag: float
    break_energy: float

    @property
    def table_error(self) -> float:
        """Bound on the error of a tabulated force: the largest second difference of its rows.

        LAMMPS interpolates the rows by cubic splines. At a kink of the force their error is up to 0.34 of the second
        difference there, at a jump all of it; for a smooth force it is far smaller.
        """
        return 0.0 if self.table is None else float(np.abs(np.diff(self.table[1], 2)).max(initial=0.0))


def numbers(layout_values: Array, expression: sympy.Expr) -> sympy.Expr:
    """The expression with its single-number parameters ``P0``, ``P1``... replaced by their values.

    Parameters
    ----------
    layout_values
        Values of ``P0``, ``P1``... in order.
    """
    import sympy

    known = {
        s: sympy.Float(float(layout_values[int(s.name[1:])]), 17)
        for s in expression.free_symbols
        if s.name[0] == "P" and s.name[1:].isdigit()
    }
    return expression.xreplace(known)


def pair_part(formulas: PairFormulas, P: Array, radius: float, edge: float) -> PairPart:
    """Translate the pair terms over one graph.

    Parameters
    ----------
    formulas
        Formulas of the terms.
    P
        Values of the single-number parameters.
    radius
        Break radius of the links.
    edge
        Where the energy of a pair is taken as its link breaks; see `inner_edge`.

    Raises
    ------
    UnsupportedLaw
        If a force depends on more than distance and relative velocity, or the drag on the distance.
    """
    import sympy

    r = sympy.Symbol("r", positive=True)
    along, storage, drag = (numbers(P, e) for e in (formulas.along, formulas.storage, formulas.drag))
    if drag.free_symbols:
        raise UnsupportedLaw(
            "LAMMPS cannot run a consensus term whose weight depends on the distance (Consensus(weighted=True)): "
            "dpd/ext/tstat has one constant. Use engine='tiles' or 'exact', or Consensus(weighted=False)."
        )
    unsupported = (along.free_symbols | storage.free_symbols) - {r}
    if unsupported:
        raise UnsupportedLaw(
            f"LAMMPS cannot run a pair force that depends on {sorted(map(str, unsupported))[0]}, only on the distance. "
            "Use engine='tiles' or 'exact'."
        )
    slope = derivative(storage, r)
    # For a gradient the two are identical; otherwise the difference goes to the table.
    rest = sympy.Integer(0) if along == slope else along - slope
    energy = lepton(storage) if storage.has(r) else ""
    break_energy = float(storage.xreplace({r: sympy.Float(edge, 17)}))
    return PairPart(radius, energy, _table(rest, radius) if rest != 0 else None, float(drag), break_energy)


def _table(rest: sympy.Expr, radius: float) -> Array:
    import sympy

    from flocking.formula.printing import code

    inner = INNER * radius
    distances = np.sqrt(np.linspace(inner**2, radius**2, TABLE_ROWS))
    source = code(rest.xreplace({sympy.Symbol("r", positive=True): sympy.Symbol("r", real=True)}), arrays=True)
    with np.errstate(all="ignore"):
        # The source is printed from a formula of the restricted grammar.
        forces = -np.asarray(_evaluated(source, distances)) * np.ones(TABLE_ROWS)
    forces[-1] = 0.0 if not np.isfinite(forces[-1]) else forces[-1]
    return np.array([distances, forces])


def _evaluated(source: str, distances: Array) -> Array:
    from flocking.formula.compiled import generated_module

    module = generated_module(
        "lammps table", source, (), lambda: source, lambda text: f"import numpy\n\n\ndef force(r):\n    return {text}\n"
    )
    return np.asarray(module.force(distances))


def table_text(name: str, table: Array) -> str:
    """A table as the text of a file for ``pair_style table``."""
    distances, forces = table
    energies = np.concatenate([np.cumsum((0.5 * (forces[1:] + forces[:-1]) * np.diff(distances))[::-1])[::-1], [0.0]])
    head = f"# force that is not part of the lepton energy\n\n{name}\n"
    head += f"N {len(distances)} RSQ {distances[0]:.17g} {distances[-1]:.17g}\n\n"
    rows = zip(range(1, len(distances) + 1), distances, energies, forces, strict=True)
    return head + "".join(f"{k} {r:.17g} {e:.17g} {f:.17g}\n" for k, r, e, f in rows)


def pair_commands(parts: list[PairPart]) -> list[str]:
    """Commands for all pair styles; tables are read from files ``table0.txt``, ``table1.txt``...

    Parameters
    ----------
    parts
        One for each graph.
    """
    styles: list[tuple[str, str, str]] = []
    for number, part in enumerate(parts):
        if part.energy:
            styles.append(("lepton", f"{part.radius!r}", f'"{part.energy}" {part.radius!r}'))
        if part.table is not None:
            styles.append(("table", f"spline {TABLE_ROWS}", f"table{number}.txt REST {part.radius!r}"))
        if part.drag:
            settings = f"{part.drag!r} {part.drag!r} 0 0 {part.radius!r}"
            styles.append(("dpd/ext/tstat", f"0 0 {part.radius!r} {SEED}", settings))
    if not styles:
        return ["pair_style zero 1.0", "pair_coeff * *"]
    lines = ["pair_style hybrid/overlay &"]
    lines += [f"  {name} {arguments} &" for name, arguments, _ in styles]
    lines[-1] = lines[-1].removesuffix(" &")
    names = [name for name, _, _ in styles]
    for k, (name, _, settings) in enumerate(styles):
        which = f" {names[: k + 1].count(name)}" if names.count(name) > 1 else ""
        lines.append(f"pair_coeff 1 1 {name}{which} {settings}")
    return lines
