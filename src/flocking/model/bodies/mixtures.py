"""Groups in which some agents are other bodies than others."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Indices
from flocking.errors import InvalidInput
from flocking.model.bodies.body import MOVES_ON, Body, Column, Limit, MotionSymbols
from flocking.model.checks import Array, array, axes_of, check_each, has_truth_values
from flocking.model.parts.registration import register_part
from flocking.model.parts.structure import of_agents

if TYPE_CHECKING:
    from collections.abc import Callable

    import sympy
    from numpy.typing import ArrayLike

    from flocking.model.world.control import Control

KIND = "kind"
"""Parameter with the number of the body of an agent."""


@register_part("mixture")
@dataclass(frozen=True, eq=False)
class Mixture(Body):
    """Agents of several bodies of one order: agent i is ``bodies[kinds[i]]``.

    An agent has the columns of all bodies; those that its own body lacks are zero and stay it. Numbers that a body
    gives for each agent are given for the whole group, as everywhere; those of agents of another body are not used.

    Parameters
    ----------
    bodies
        The bodies.
    kinds
        Number of the body of each agent, counted from 0, shape (N,).

    Raises
    ------
    InvalidInput
        When there is no body or no agent, bodies differ in order, one sets its velocity at ticks, columns of one name
        differ in width, only some have headings, or a kind names no body.

    Examples
    --------
    >>> import flocking as fk
    >>> fk.Mixture((fk.PointMass(), fk.Lagged(fk.PointMass(), 0.2)), [0, 0, 1]).summary
    'agents of 2 bodies: PointMass, Lagged'
    """

    bodies: Sequence[Body]
    kinds: Array

    if TYPE_CHECKING:

        def __init__(self, bodies: Sequence[Body], kinds: ArrayLike) -> None: ...

    def __post_init__(self) -> None:
        given = (self.bodies,) if isinstance(self.bodies, Body) else self.bodies
        given = tuple(given) if isinstance(given, Iterable) and axes_of(given) else ()
        if not given or not all(isinstance(body, Body) for body in given):
            raise InvalidInput("Mixture", "bodies", "must be bodies, such as PointMass", self.bodies)
        object.__setattr__(self, "bodies", given)
        if len({body.order for body in given}) > 1 or any(body.discrete for body in given):
            raise InvalidInput(
                "Mixture", "bodies", "must all be of one order and move continuously",
                ", ".join(type(body).__name__ for body in given),
            )  # fmt: skip
        kinds = array("Mixture", "kinds", self.kinds, ndim=1, truth_values=True)
        if not len(kinds):
            raise InvalidInput("Mixture", "kinds", "must hold at least 1 agent", list(kinds))
        if has_truth_values(self.kinds):
            raise InvalidInput("Mixture", "kinds", "must be whole numbers", "truth values", "Count the bodies from 0.")
        wrong = ~((kinds >= 0) & (kinds < len(given)) & (kinds == np.rint(kinds)))
        if wrong.any():
            raise InvalidInput(
                "Mixture", "kinds", f"must be whole numbers from 0 to {len(given) - 1}", float(kinds[wrong][0]),
                "Count the bodies from 0.",
            )  # fmt: skip
        object.__setattr__(self, "kinds", kinds)
        every = [column for body in given for column in body.columns]
        for column in every:
            if any(column.name == other.name and column != other for other in every):
                raise InvalidInput("Mixture", "bodies", "must have columns of one name in one width", column.name)
        for name in ("masses", "damping"):
            object.__setattr__(self, name, self._chosen([getattr(body, name) for body in given]))
        self._take_headings()

    def _take_headings(self) -> None:
        """Take of each agent the heading of its body, where bodies have any."""
        found = [body.headings for body in self.bodies if body.headings is not None]
        if not found:
            return
        shapes = {each.shape for each in found}
        if len(found) < len(self.bodies) or len(shapes) > 1 or found[0].shape[:1] != self.kinds.shape:
            raise InvalidInput(
                "Mixture", "bodies", "must have headings of all bodies or of none, one for each agent of the group",
                f"{len(found)} of {len(self.bodies)} with shape {' and '.join(map(str, sorted(shapes)))}",
            )  # fmt: skip
        rows = np.arange(len(self.kinds))
        object.__setattr__(self, "headings", np.stack(found)[self.kinds.astype(np.int64), rows])

    def _chosen(self, values: Sequence[float | Array]) -> Array:
        """Of each agent the value of its body, shape (N,); `check_count` refuses arrays of another length."""
        found = np.zeros(len(self.kinds))
        for k, value in enumerate(values):
            rows = self.kinds == k
            fits = np.ndim(value) == 0 or np.shape(value) == found.shape
            found[rows] = np.broadcast_to(value, len(found))[rows] if fits else 1.0
        return found

    @property
    def order(self) -> int:
        """That of the bodies."""
        return self.bodies[0].order

    @property
    def columns(self) -> tuple[Column, ...]:
        """Those of all bodies, each once."""
        return tuple({column.name: column for body in self.bodies for column in body.columns}.values())

    @property
    def directions(self) -> tuple[str, ...]:
        """Those of all bodies; zero vectors of agents whose body has none."""
        return tuple(dict.fromkeys(name for body in self.bodies for name in body.directions))

    @property
    def parameters(self) -> dict[str, float | Array]:
        """The kinds, and the parameters of all bodies."""
        found: dict[str, float | Array] = {KIND: self.kinds}
        return found | {f"{_own(k)}{n}": x for k, body in enumerate(self.bodies) for n, x in body.parameters.items()}

    @property
    def structure(self) -> tuple[object, ...]:
        """Its own kind, and the structures of all bodies."""
        return (*super().structure, *(body.structure for body in self.bodies))

    def _seen(self, x: MotionSymbols, k: int) -> MotionSymbols:
        """What body ``k`` may use of an agent."""
        own = _own(k)

        def named(of: Callable[[str], sympy.Expr]) -> Callable[[str], sympy.Expr]:
            return lambda name: of(own + name)

        return replace(x, parameter=named(x.parameter), let=named(x.let), held=named(x.held))

    def _by_kind(self, x: MotionSymbols, values: Sequence[sympy.Expr]) -> sympy.Expr:
        """The expression of the agent's own body."""
        import sympy

        *others, last = values
        pairs = [(value, x.parameter(KIND) < k + 0.5) for k, value in enumerate(others)]
        return sympy.Piecewise(*pairs, (last, True)) if pairs else last

    def rates(self, x: MotionSymbols) -> dict[str, Sequence[sympy.Expr]]:
        """Those of each agent's own body; zero for columns that it lacks."""
        import sympy

        every = [body.rates(self._seen(x, k)) for k, body in enumerate(self.bodies)]
        names = dict.fromkeys(name for found in every for name in found)
        rates: dict[str, Sequence[sympy.Expr]] = {}
        for name in names:
            width = max(len(found[name]) for found in every if name in found)
            rows = [found.get(name, [sympy.Integer(0)] * width) for found in every]
            rates[name] = [self._by_kind(x, parts) for parts in zip(*rows, strict=True)]
        return rates

    def lets(self, x: MotionSymbols) -> dict[str, sympy.Expr]:
        """Those of all bodies."""
        found: dict[str, sympy.Expr] = {}
        for k, body in enumerate(self.bodies):
            found |= {_own(k) + name: e for name, e in body.lets(self._seen(x, k)).items()}
        return found

    def kinetic(self, x: MotionSymbols, relative: Sequence[sympy.Expr]) -> sympy.Expr:
        """That of each agent's own body.

        Parameters
        ----------
        x
            The agent.
        relative
            Its velocity relative to the frame.
        """
        return self._by_kind(x, [body.kinetic(self._seen(x, k), relative) for k, body in enumerate(self.bodies)])

    def held(self, dimension: int) -> tuple[str, ...]:
        """Those of all bodies."""
        return tuple(_own(k) + name for k, body in enumerate(self.bodies) for name in body.held(dimension))

    def limits(self, x: MotionSymbols) -> dict[str, Limit]:
        """Those of all bodies, which act on agents of that body alone."""
        import sympy

        found = {}
        for k, body in enumerate(self.bodies):
            there = sympy.And(x.parameter(KIND) > k - 0.5, x.parameter(KIND) < k + 0.5)
            for name, limit in body.limits(self._seen(x, k)).items():
                begins = sympy.Piecewise((limit.begins, there), (-1, True))
                found[_own(k) + name] = Limit(begins, sympy.Piecewise((limit.ends, there), (1, True)))
        return found

    def drawn(self, elapsed: float, n: int, dimension: int) -> dict[str, Array]:
        """Those of all bodies.

        Parameters
        ----------
        elapsed
            Time since the start of the run.
        n, dimension
            Numbers of agents and axes.
        """
        found: dict[str, Array] = {}
        for k, body in enumerate(self.bodies):
            found |= {_own(k) + name: x for name, x in body.drawn(elapsed, n, dimension).items()}
        return found

    def drawn_until(self, elapsed: float) -> float:
        """The first of those of all bodies.

        Parameters
        ----------
        elapsed
            Time since the start of the run.
        """
        return min(body.drawn_until(elapsed) for body in self.bodies)

    def missing_columns(self, given: Mapping[str, Array], q: Array, p: Array) -> dict[str, Array]:
        """Where columns begin that a start does not give: by the rule of each agent's own body, and at zero.

        Parameters
        ----------
        given
            Columns of the state by name.
        q, p
            Its positions and velocities, shape (N, m).
        """
        widths = self.widths(q.shape[1])
        found = {name: np.zeros((len(q), width)) for name, width in widths.items() if name not in given}
        for body, rows in self._groups(len(q)):
            mine = {name: x[rows] for name, x in given.items() if name in body.widths(q.shape[1]) and len(x) == len(q)}
            for name, values in body.missing_columns(mine, q[rows], p[rows]).items():
                if name in found:
                    found[name][rows] = values
        return found

    def check_scenario(self, control: Control, q: Array, p: Array) -> None:
        """Those of all bodies, each for its own agents.

        Parameters
        ----------
        control, q, p
            As for `Body.check_scenario`.

        Raises
        ------
        InvalidInput
            When a body refuses.
        """
        for body, rows in self._groups(len(q)):
            body.check_scenario(control, q[rows], p[rows])

    def _groups(self, n: int) -> Iterator[tuple[Body, Indices]]:
        """Bodies with the numbers of their own agents, and who these are; none if there are not ``n`` agents."""
        for k, body in enumerate(self.bodies):
            rows = np.flatnonzero(self.kinds == k)
            if rows.size and len(self.kinds) == n:
                yield of_agents(body, rows, n), rows

    @property
    def summary(self) -> str:
        """How many bodies there are, and which; empty where all are point masses or single integrators."""
        names = ", ".join(type(body).__name__ for body in self.bodies)
        return "" if not any(body.summary for body in self.bodies) else f"agents of {len(self.bodies)} bodies: {names}"

    @property
    def ideal(self) -> bool:
        """Whether all bodies are."""
        return all(body.ideal for body in self.bodies)

    @property
    def homogeneous(self) -> bool:
        """Whether all bodies are."""
        return all(body.homogeneous for body in self.bodies)

    @property
    def inert(self) -> bool:
        """Whether all bodies are."""
        return all(body.inert for body in self.bodies)

    @property
    def symmetries(self) -> frozenset[str]:
        """Those that all bodies keep; of order 1 momentum only where all agents have one mass."""
        uneven = self.order < MOVES_ON and np.ptp(np.asarray(self.masses))
        return frozenset.intersection(*(body.symmetries for body in self.bodies)) - ({"momentum"} if uneven else set())

    def check_count(self, n: int) -> None:
        """Check that kinds, and values of each agent, are given for ``n`` agents.

        Raises
        ------
        InvalidInput
            When an array has another length.
        """
        check_each("Mixture", "kinds", self.kinds, n)
        for body in self.bodies:
            body.check_count(n)


def _own(k: int) -> str:
    """What the names of lets, parameters and held numbers of body ``k`` begin with."""
    return f"kind{k}_"
