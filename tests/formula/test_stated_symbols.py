"""Formulas of users' parts with symbols that they were not given are refused: kernels have variables of such names."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pytest
import sympy

import flocking as fk

START = fk.State([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[0.5, 0.0], [0.0, 0.0], [0.0, 0.0]])
CAPTURED = ("n", "i", "j", "u0", "q0", "m", "zz")
"""Names of variables in generated code, and one that is none."""


@dataclass(frozen=True)
class Pushed(fk.PairTerm):
    """A force with a symbol of its own."""

    name: str = "n"

    @property
    def structure(self) -> tuple[object, ...]:
        return "Pushed", self.name

    @property
    def parameters(self) -> dict[str, float]:
        return {"gain": 2.0}

    def _number(self, x: Any) -> Any:
        return sympy.Symbol(self.name) if self.name else x.parameter("gain")

    def along(self, x: Any) -> Any:
        return self._number(x) * x.radial

    def dissipation(self, x: Any) -> Any:
        return self._number(x) * x.radial**2


def started(term: Any = None, **parts: Any) -> object:
    law = fk.Law(fk.Fixed.complete(3), [fk.Consensus(1.0) if term is None else term])
    return fk.start(fk.Scenario(law, START, t_end=1.0, frames=2, **parts))


@pytest.mark.parametrize("name", CAPTURED)
def test_terms(name: str) -> None:
    with pytest.raises(fk.InvalidInput, match=rf"Pushed: along must use no symbols .*; got '{name}'\."):
        started(Pushed(name))


def test_a_term_with_its_own_parameter_runs() -> None:
    started(Pushed(""))


def test_a_parameter_that_is_none_is_named() -> None:
    @dataclass(frozen=True)
    class Asking(Pushed):
        def along(self, x: Any) -> Any:
            return x.parameter("gane") * x.radial

    with pytest.raises(fk.InvalidInput, match=r"Asking: x\.parameter must name one of gain; got 'gane'"):
        started(Asking())


@dataclass(frozen=True, eq=False)
class Own(fk.Body):
    """A body of order 2 whose formulas are given."""

    made: Any = field(default=None)
    helped: Any = field(default=None)

    @property
    def order(self) -> int:
        return 2

    def lets(self, x: Any) -> Any:
        return {} if self.helped is None else self.helped(x)

    def rates(self, x: Any) -> Any:
        return {"p": self.made(x)}


@pytest.mark.parametrize("name", CAPTURED)
def test_rates_of_bodies(name: str) -> None:
    wrong = Own(made=lambda x: [x.u[0] + sympy.Symbol(name), x.u[1]])
    for bodies in (wrong, fk.Limited(wrong, force=1.0)):
        with pytest.raises(fk.InvalidInput, match=rf"must use no symbols .*; got '{name}'\."):
            started(bodies=bodies)


def test_the_symbols_that_are_given_may_be_used() -> None:
    def helped(x: Any) -> dict[str, Any]:
        return {"speed": sympy.sqrt(1 + x.p[0] ** 2 + x.p[1] ** 2), "twice": 2 * x.let("speed")}

    started(
        bodies=Own(
            made=lambda x: [a / x.mass - x.let("twice") * x.damping * sympy.cos(x.t) for a in x.u], helped=helped
        )
    )


@pytest.mark.parametrize(
    ("made", "helped", "words"),
    [
        (lambda x: x.u[0], None, "rates must give a list of rates for the column 'p'"),
        (lambda x: [x.let("speed")] * 2, None, "got 'let_speed'"),
        (lambda x: [x.parameter("drag")] * 2, None, r"x\.parameter must not be used: there is none; got 'drag'"),
        (lambda x: list(x.u), lambda x: {"a": x.let("b"), "b": x.p[0]}, "lets must use no symbols .* got 'let_b'"),
    ],
)
def test_other_faults_of_bodies_are_named(made: Any, helped: Any, words: str) -> None:
    with pytest.raises(fk.InvalidInput, match=words):
        started(bodies=Own(made=made, helped=helped))
