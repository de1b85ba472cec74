"""Body terms as atom-style variables, applied by ``fix addforce``."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Array
from flocking.engine.kernels.layout import DAMPING, MASS, Layout
from flocking.engine.lammps.pairs import numbers
from flocking.engine.lammps.printing import variable
from flocking.model.bodies.body import Body
from flocking.model.leaders_and_obstacles.leaders import Sink
from flocking.model.leaders_and_obstacles.obstacles import Ball, Obstacle

if TYPE_CHECKING:
    import sympy

    from flocking.engine.kernels.expressions import LawFormulas
    from flocking.engine.kernels.obstacle_formulas import ObstacleFormulas

AXES = "xyz"
MOST_GROUPS = 24
"""Largest number of dynamic groups of agents near obstacles; LAMMPS has 32 groups in total."""

MARGIN = 1e-6
"""Regions around spheres extend beyond the range of the forces by this fraction of their radius."""


@dataclass
class BodyDeck:
    """Commands for the body terms.

    Parameters
    ----------
    lines
        Commands, in order.
    properties
        Slots of per-agent parameters that the commands use.
    """

    lines: list[str] = field(default_factory=list)
    properties: set[str] = field(default_factory=set)


class _Names:
    """Names in LAMMPS of the symbols of formulas."""

    def __init__(self, dimension: int, masses_differ: bool, mass: float) -> None:
        self.fixed = {"t": "v_now", MASS: "mass" if masses_differ else repr(mass)}
        for k in range(dimension):
            self.fixed |= {f"q{k}": AXES[k], f"p{k}": f"v{AXES[k]}"}
            self.fixed |= {f"mean_q{k}": f"xcm(all,{AXES[k]})", f"mean_p{k}": f"vcm(all,{AXES[k]})"}
        self.properties: set[str] = set()

    def text(self, expression: sympy.Expr, P: Array, own: dict[str, str] | None = None) -> str:
        """A formula for ``variable``."""
        expression = numbers(P, expression)
        names = {**self.fixed, **(own or {})}
        for s in expression.free_symbols:
            if s.name[0] == "A" and s.name[1:].isdigit() and s.name not in names:
                names[s.name] = f"d_{s.name}"
                self.properties.add(s.name)
        return variable(expression, names)


def body_deck(formulas: LawFormulas, layout: Layout, P: Array, agents: Body) -> BodyDeck:
    """Translate all body terms and the damping of the agents.

    Parameters
    ----------
    formulas
        Formulas of the law.
    layout
        Slots of its parameters.
    P
        Values of the single-number parameters.
    agents
        Masses and damping.
    """
    import sympy

    m = formulas.dimension
    names = _Names(m, np.ndim(agents.masses) > 0, float(np.max(agents.masses)))
    deck = BodyDeck()
    damping: sympy.Expr = sympy.Symbol(DAMPING, real=True)
    if agents.order == 1:
        damping = sympy.Integer(0)
    elif not np.ndim(agents.damping):
        value = float(agents.damping)
        damping = sympy.Float(value, 17) if value else sympy.Integer(0)
    forces = [
        f.xreplace({sympy.Symbol(DAMPING, real=True): damping}) - damping * sympy.Symbol(f"p{k}", real=True)
        for k, f in enumerate(formulas.body.force)
    ]
    if any(f != 0 for f in forces):
        for k, f in enumerate(forces):
            deck.lines.append(f'variable force_{AXES[k]} atom "{names.text(f, P)}"')
        deck.lines.append(f"fix body all addforce {_vector('force_', m)}")
    _obstacles(deck, formulas, layout, P, names)
    deck.properties = names.properties
    return deck


def _vector(prefix: str, m: int) -> str:
    return " ".join(f"v_{prefix}{AXES[k]}" for k in range(m)) + (" 0.0" if m == 2 else "")


def _obstacles(deck: BodyDeck, formulas: LawFormulas, layout: Layout, P: Array, names: _Names) -> None:
    """Beta-agents: variables per obstacle, applied to a dynamic group of the agents near any of them."""
    import sympy

    m, rows = formulas.dimension, layout.obstacle_rows()
    met: list[tuple[str, float, object]] = []
    if layout.obstacle_groups():
        deck.lines += [
            "# Of each obstacle: signed distance of the agent, speed at which the boundary recedes, normal towards the",
            "# agent, velocity of the beta-agent (55)-(57) as it slides outside and as continued inside, force (54).",
        ]
    for number, (term, group) in enumerate(layout.obstacle_groups()):
        stages = formulas.obstacles[number].geometry
        needed_names = _needed(formulas.obstacles[number])
        for column, which in enumerate(group.numbers):
            prefix = f"o{number}_{which}_"
            table = {
                sympy.Symbol(f"O{k}", real=True): sympy.Float(float(row[column]), 17) for k, row in enumerate(rows)
            }
            own: dict[str, str] = {}
            deck.lines.append(f"# obstacle {which}: {_description(group.obstacles[column])}")
            for stage in stages:
                for name, e in stage.items():
                    if name in needed_names:
                        deck.lines.append(f'variable {prefix}{name} atom "{names.text(e.xreplace(table), P, own)}"')
                own |= {name: f"v_{prefix}{name}" for name in stage}
            near = f"v_{prefix}distance < {term.range!r}"
            for k, f in enumerate(formulas.obstacles[number].force):
                inside = names.text(f.xreplace(table), P, own)
                deck.lines.append(f'variable {prefix}{AXES[k]} atom "ternary({near}, {inside}, 0)"')
            met.append((prefix, term.range, group.obstacles[column]))
    if met:
        deck.lines.append("# Sum of the forces of the obstacles, for the agents near any of them.")
    chunks = np.array_split(np.arange(len(met)), min(MOST_GROUPS, len(met))) if met else []
    for number, chunk in enumerate(chunks):
        some = [met[k] for k in chunk]
        deck.lines += _near(f"near{number}", some)
        for k in range(m):
            total = "+".join(f"v_{prefix}{AXES[k]}" for prefix, *_ in some)
            deck.lines.append(f'variable avoid{number}_{AXES[k]} atom "{total}"')
        deck.lines.append(f"fix avoid{number} near{number} addforce {_vector(f'avoid{number}_', m)}")


def _near(name: str, some: list[tuple[str, float, sympy.Expr]]) -> list[str]:
    """A dynamic group of all agents within range of any of some obstacles."""
    if all(type(obstacle) is Ball and type(obstacle.centre) is Sink for _, _, obstacle in some):
        # Regions are evaluated much faster than formulas; the forces end exactly at the range.
        regions = []
        for prefix, reach, ball in some:
            x, y, z = (*(float(c) for c in ball.centre.point), 0.0)[:3]
            radius = (ball.radius + reach) * (1.0 + MARGIN)
            regions.append(f"region {prefix}region sphere {x!r} {y!r} {z!r} {radius!r}")
        union = regions[0].split()[1]
        if len(some) > 1:
            union = f"{name}_region"
            regions.append(f"region {union} union {len(some)} " + " ".join(line.split()[1] for line in regions))
        return [*regions, f"group {name} dynamic all region {union} every 1"]
    condition = " || ".join(f"(v_{prefix}distance < {reach!r})" for prefix, reach, _ in some)
    return [f'variable {name} atom "{condition}"', f"group {name} dynamic all var {name} every 1"]


def _needed(obstacle_group: ObstacleFormulas) -> set[str]:
    """Names of the stages that the force depends on, directly or indirectly."""
    needed_names = {s.name for f in obstacle_group.force for s in f.free_symbols} | {"distance"}
    for stage in reversed(obstacle_group.geometry):
        for name, e in stage.items():
            if name in needed_names:
                needed_names |= {s.name for s in e.free_symbols}
    return needed_names


def _description(obstacle: Obstacle) -> str:
    values = ", ".join(f"{name} = {value:g}" for name, value in obstacle.parameters.items())
    return f"{type(obstacle).__name__.lower()} with {values}"
