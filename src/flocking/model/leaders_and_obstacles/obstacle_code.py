"""Code of the distance and the geometry of an obstacle on arrays, from its formulas."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import sympy


def point_symbols(letter: str, dimension: int) -> list[sympy.Symbol]:
    """Symbols of the components of a vector.

    Parameters
    ----------
    letter
        What their names begin with.
    dimension
        Their number.
    """
    import sympy

    return [sympy.Symbol(f"{letter}{k}", real=True) for k in range(dimension)]


def array_source(stages: Sequence[Mapping[str, sympy.Expr]], dimension: int, names: Sequence[str]) -> str:
    """Source of a module with the functions ``geometry`` and ``distance``.

    Parameters
    ----------
    stages
        Expressions by name; those of a stage may use the names of earlier ones. The distance needs all but the last.
    dimension
        Number of space dimensions.
    names
        Names of the parameters.
    """
    from flocking.formula.printing import statements

    q, p = (point_symbols(letter, dimension) for letter in "qp")

    def function(
        name: str, arguments: Sequence[sympy.Symbol], steps: Sequence[Mapping[str, sympy.Expr]], result: str
    ) -> str:
        lines = [s for k, stage in enumerate(steps) for s in statements(stage, arrays=True, prefix=f"stage{k}_")]
        body = "".join(f"    {line}\n" for line in [*lines, f"return {result}"])
        return f"def {name}({', '.join(map(str, [*arguments, 't', *names]))}):\n{body}\n\n"

    results = ", ".join(f"{name!r}: {name}" for stage in stages for name in stage)
    alone = [{k: v for k, v in stage.items() if k in ("feature", "distance")} for stage in stages[:-1]]
    return (
        "import numpy\n\n\n"
        + function("geometry", [*q, *p], stages, f"{{{results}}}")
        + function("distance", q, alone, "distance")
    )
