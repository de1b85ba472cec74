"""Parts of the source of a kernel, and the parameters that they read."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flocking.engine.tiles.kernels.spec import KernelSpec
from flocking.formula.contact import ENDLESS

if TYPE_CHECKING:
    import sympy

    from flocking.engine.kernels.expressions import LawFormulas
    from flocking.engine.tiles.kernels.heard_samples import HeardSamples


class Writer:
    """Collects the parts of the source of a kernel.

    Parameters
    ----------
    spec
        Specification of the kernel.
    formulas
        Formulas of the law.
    controls
        Whether some agents of a tile may act while the links of the others stay as they are.
    heard
        How agents find what they know of each other; None where they know the present.
    logs
        Whether it is written beside each entry of a list who is used as a neighbour, and by which sample.
    """

    def __init__(
        self, spec: KernelSpec, formulas: LawFormulas, *, controls: bool = False, heard: HeardSamples | None = None,
        logs: bool = False,
    ) -> None:  # fmt: skip
        self.controls, self.heard, self.logs = controls, heard, logs
        from flocking.engine.tiles.kernels.printing import Lifter

        self.spec, self.formulas = spec, formulas
        self.axes = range(spec.dimension)
        self.periods = spec.layout.period_slots(spec.dimension)
        self.lifter = Lifter(self.uniform)
        self.per_agent: set[str] = set()
        self.obstacle_values: list[sympy.Expr] = []

    def uniform(self, name: str) -> bool:
        """Whether a symbol, by name, has one value for all agents."""
        if name in ("A0", "A1"):
            return not (self.spec.mass_each, self.spec.damping_each)[int(name[1])]
        return name in ("t", ENDLESS) or name.startswith(("P", "mean_"))

    def statements(
        self, results: dict[str, sympy.Expr], prefix: str, inverses: dict[str, str] | None = None
    ) -> list[str]:
        """Lines that compute ``results`` for one lane; records which rows of A they read.

        Parameters
        ----------
        results
            Formulas by name.
        prefix
            Start of the names of intermediate values.
        inverses
            Names of the reciprocals of symbols.
        """
        from flocking.engine.kernels.source_text import free_names
        from flocking.engine.tiles.kernels.printing import vector_statements

        lifted = {name: self.lifter.lift(value) for name, value in results.items()}
        names = free_names(lifted.values())
        self.per_agent |= {a for a in names.per_agent if not self.uniform(a)}
        weights = [self._weight(w) for w in names.per_pair]
        return weights + vector_statements(lifted, prefix, inverses)

    def _weight(self, name: str) -> str:
        number = int(name[1:])
        mine, theirs = "load(ids, base)", "gather(ids, j)"
        if self.spec.weights[number] == "hash":
            uniform = f"pair_uniform(seeds[{number}], {mine}, {theirs})"
            return f"{name} = narrow(seed_low{number} + seed_width{number} * {uniform}, T(0.0))"
        if self.spec.weights[number] != "matrix":
            return f"{name} = load({self.spec.weights[number]}, at)"
        return f"{name} = narrow(gather(matrices[{number}], widen({mine}) * width{number} + widen({theirs})), T(0.0))"

    def frame(self) -> list[str]:
        """Names of the velocity of the energy's frame, one per axis."""
        return [f"frame{k}" for k in self.axes]


def parameter(name: str) -> sympy.Symbol:
    """The symbol of a value that may have either sign."""
    import sympy

    return sympy.Symbol(name, real=True)


def distance() -> sympy.Symbol:
    """The symbol of the distance of a pair."""
    import sympy

    return sympy.Symbol("r", positive=True)
