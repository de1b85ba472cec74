"""Formulas of agents within range of obstacles, and the loops of the kernels that are printed from them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from flocking.engine.kernels.layout import MASS, Layout
from flocking.engine.kernels.pieces import held, piece_lines
from flocking.errors import InvalidInput
from flocking.formula.origins import canonical, library_states_all
from flocking.model.leaders_and_obstacles.obstacles import Obstacle
from flocking.model.terms.avoidance import ObstacleGroup
from flocking.model.terms.symbols import ObstacleSymbols

if TYPE_CHECKING:
    import sympy

Motion = tuple[Sequence["sympy.Expr"], Sequence["sympy.Expr"], Sequence["sympy.Expr"]]
"""Position, velocity and acceleration of a leader."""


@dataclass(frozen=True)
class ObstacleFormulas:
    """What one group of obstacles does to an agent within range.

    Parameters
    ----------
    geometry
        Stages of named formulas; see `Obstacle.geometry`.
    force
        Force on the agent, m expressions.
    dissipation, supply
        Powers of the ledger.
    counts
        Numbers of slots; see `Layout.counts`.
    """

    geometry: tuple[dict[str, sympy.Expr], ...]
    force: tuple[sympy.Expr, ...]
    dissipation: sympy.Expr
    supply: sympy.Expr
    counts: tuple[int, int]

    def stages(self) -> list[dict[str, sympy.Expr]]:
        """All formulas in the order in which they must be computed."""
        forces = {f"force{k}": f for k, f in enumerate(self.force)}
        return [*self.geometry, {**forces, "dissipation": self.dissipation, "supply": self.supply}]

    @property
    def after_distance(self) -> dict[str, sympy.Expr]:
        """The formulas that may depend on the distance by its name."""
        stages = self.stages()
        begin = next((k for k, stage in enumerate(stages) if "distance" in stage), len(stages))
        return {name: value for stage in stages[begin + 1 :] for name, value in stage.items()}


def obstacle_formulas(
    layout: Layout, dimension: int, frame: Sequence[sympy.Expr], motions: dict[int | None, Motion]
) -> tuple[ObstacleFormulas, ...]:
    """Formulas of every group of obstacles of a law.

    Parameters
    ----------
    frame
        Velocity of the frame of the energy, m expressions.
    motions
        Motion of each leader by its number in the layout, and zeros for None.
    """
    import sympy

    def symbol(name: str) -> sympy.Symbol:
        return sympy.Symbol(name, real=True)

    q, p = ([symbol(f"{letter}{k}") for k in range(dimension)] for letter in "qp")
    t = symbol("t")
    found = []
    for number, (term, group) in enumerate(layout.obstacle_groups()):
        obstacle = group.obstacles[0]

        def owned(name: str, owner: str = f"obstacles{number}") -> sympy.Symbol:
            return symbol(layout.slot(owner, name))

        def parameter(name: str, owner: str = layout.term_owner(term)) -> sympy.Symbol:
            return symbol(layout.slot(owner, name))

        x = ObstacleSymbols(
            q, p, t, symbol(MASS), symbol("distance"), [symbol(f"normal{k}") for k in range(dimension)],
            [symbol(f"boundary{k}") for k in range(dimension)], obstacle.anchor(t, owned), frame,
            *motions[layout.leader_number(term.leader)], parameter,
        )  # fmt: skip
        dissipated, supplied = term.obstacle_balance(x)
        geometry = tuple(obstacle.geometry(q, p, t, owned))
        _check_common(group, lambda other: (other.geometry(q, p, t, owned), other.anchor(t, owned)))
        found.append(ObstacleFormulas(geometry, tuple(term.obstacle_force(x)), dissipated, supplied, layout.counts))
    return tuple(found)


def _check_common(group: ObstacleGroup, stated: Callable[[Obstacle], object]) -> None:
    """Refuse obstacles of one structure and different formulas, which would share a kernel; users may write such."""
    if library_states_all(group.obstacles):
        return
    first = canonical(stated(group.obstacles[0]))
    for obstacle in group.obstacles[1:]:
        if canonical(stated(obstacle)) != first:
            raise InvalidInput(
                type(obstacle).__name__, "structure", "must differ between obstacles whose formulas differ",
                obstacle.structure, "Add what the formulas depend on to the structure, or make it a parameter.",
            )  # fmt: skip


def _slots(stages: Iterable[dict[str, sympy.Expr]], letter: str) -> list[str]:
    names = {str(s) for stage in stages for e in stage.values() for s in e.free_symbols}
    return sorted((n for n in names if re.fullmatch(letter + r"\d+", n)), key=lambda n: int(n[1:]))


def _statements(stages: Sequence[dict[str, sympy.Expr]], arrays: bool, prefix: str) -> list[str]:
    from flocking.formula.printing import statements

    return [
        line
        for k, stage in enumerate(stages)
        for line in statements(stage, arrays=arrays, prefix=f"{prefix}{k}_")
    ]  # fmt: skip


def obstacle_slot(name: str, formulas: Sequence[ObstacleFormulas], obstacle: str) -> str:
    """Source of the value of a slot per obstacle; empty where ``name`` is none.

    Parameters
    ----------
    formulas
        Formulas of the groups of obstacles.
    obstacle
        Source of the number of the obstacle.
    """
    if not (formulas and re.fullmatch(r"O\d+", name)):
        return ""
    scalars, rows = formulas[0].counts
    return f"P[{scalars} + {name[1:]} * ((P.shape[0] - {scalars}) // {rows}) + {obstacle}]"


def obstacle_loop(number: int, first: int, formulas: ObstacleFormulas, m: int, tail: Sequence[str]) -> str:
    """Source of the loop over the active pairs (agent, obstacle) of one group, then the ``tail`` lines.

    The pairs follow those of the ``first`` graphs in ``senders`` and ``sensed``.

    Parameters
    ----------
    number
        Number of the group of obstacles.
    formulas
        Formulas of the group.
    """
    stages = formulas.stages()
    scalars, rows = formulas.counts
    lines = [f"    {n} = P[{n[1:]}]" for n in _slots(stages, "P")]
    if rows:
        lines += [f"    columns = (P.shape[0] - {scalars}) // {rows}"]
    lines += [f"    for e in range(offsets[{first + number}], offsets[{first + number + 1}]):"]
    body = ["i = senders[e]", "o = sensed[e]"]
    used = {str(s) for stage in stages for e in stage.values() for s in e.free_symbols}
    body += [f"{x}{k} = {x}[i, {k}]" for x in "qp" for k in range(m) if f"{x}{k}" in used]
    body += [f"{n} = A[{n[1:]}, i]" for n in _slots(stages, "A")]
    body += [f"{n} = P[{scalars} + {n[1:]} * columns + o]" for n in _slots(stages, "O")]
    for k, stage in enumerate(stages):
        formulas_held, split = held(stage, "distance")
        body += piece_lines("distance") if split else []
        body += _statements([formulas_held], False, f"o{number}_{k}_")
    body += tail
    return "\n".join([*lines, *(f"        {line}" for line in body)]) + "\n"


def obstacle_function(number: int, formulas: ObstacleFormulas) -> str:
    """Source of the NumPy function ``obstacles<number>``: force, dissipation and supply of many active pairs.

    Parameters
    ----------
    formulas
        Formulas of the group.
    """
    stages = formulas.stages()
    own = {key for stage in stages for key in stage}
    free = {str(s) for stage in stages for e in stage.values() for s in e.free_symbols} - own
    scalars = _slots(stages, "P")
    lines = [f"{n} = P[{n[1:]}]" for n in scalars]
    lines += [f"{n} = values[{n!r}]" for n in sorted(free - set(scalars))]
    lines += _statements(stages, True, "x")
    lines += ["return {" + ", ".join(f"{k!r}: {k}" for k in stages[-1]) + "}"]
    return f"def obstacles{number}(P, values):\n" + "".join(f"    {line}\n" for line in lines) + "\n\n"
