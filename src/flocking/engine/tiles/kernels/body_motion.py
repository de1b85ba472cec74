"""What bodies make of the desired forces of the law, as lines of a kernel: rates of their columns and what departs.

Limits have no memory here: one acts in a pass where it begins to.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from flocking.engine.kernels.motion_source import motion_values
from flocking.engine.tiles.kernels.spec import KernelSpec
from flocking.engine.tiles.kernels.writer import Writer, parameter
from flocking.model.bodies.actuators import LARGEST_SQUARE
from flocking.model.bodies.body import LIMIT_ROUNDS

if TYPE_CHECKING:
    import sympy


def further_names(spec: KernelSpec) -> list[str]:
    """Names of the numbers that an agent has beside position and velocity, in the order of the rows.

    Parameters
    ----------
    spec
        Specification of the kernel.
    """
    widths = spec.layout.bodies.widths(spec.dimension)
    return [f"{name}{k}" for name, width in widths.items() for k in range(width)]


LARGEST_SINGLE = 1e38
"""What stands for `LARGEST_SQUARE` in single precision, whose numbers end at 3.4e38: a force of such a square times it
is infinite."""


def body_motion(
    w: Writer, controls: dict[sympy.Symbol, sympy.Expr]
) -> tuple[dict[str, sympy.Expr], dict[sympy.Symbol, sympy.Expr], list[str]]:
    """Rates and departure of an agent, the symbols of its controls, and lines that compute and store these.

    Parameters
    ----------
    w
        Parts of the kernel.
    controls
        Formula of each control.
    """
    import sympy

    spec, motion = w.spec, w.formulas.body.motion
    bodies, rows = spec.layout.bodies, spec.layout.held_rows(spec.dimension)
    values = motion_values(motion)
    if spec.precision == "float32":
        single = {sympy.Float(LARGEST_SQUARE): sympy.Float(LARGEST_SINGLE)}
        values = {name: e.xreplace(single) for name, e in values.items()}
    acts = {}
    for k, name in enumerate(_limit_names(spec)):
        begins = sympy.Gt(values[f"begins_{k}"], 0, evaluate=False)
        acts[parameter(f"A{rows[name]}")] = sympy.Piecewise((1, begins), (0, True))
    found = {name: e for name, e in values.items() if not name.startswith(("begins_", "ends_"))}
    for _ in range(LIMIT_ROUNDS * max(1, len(acts))):
        if not any(e.free_symbols & set(acts) for e in found.values()):
            break
        found = {name: e.xreplace(acts) for name, e in found.items()}
    assert not any(e.free_symbols & set(acts) for e in found.values()), type(bodies).__name__
    widths = bodies.widths(spec.dimension)
    columns = [f"column_{name}_{k}" for name, width in widths.items() for k in range(width)]
    lines = [f"{name} = load(E[{k}], base)" for k, name in enumerate(columns)]
    lines += w.statements({str(u): formula for u, formula in controls.items()}, "w_")
    lines += [f"store(U[{k}], base, {u})" for k, u in enumerate(controls)]
    return found, {u: u for u in controls}, lines


def _limit_names(spec: KernelSpec) -> tuple[str, ...]:
    """Names of the numbers that state which limits act, in the order of the limits."""
    bodies, m = spec.layout.bodies, spec.dimension
    return tuple(name for name in bodies.held(m) if name not in bodies.drawn(0.0, 1, m))
