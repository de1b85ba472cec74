"""What bodies of users promise by their properties is held against the rates that they state."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
import sympy

import flocking as fk
from flocking.engine.kernels.expressions import MotionFormulas, motion_formulas
from flocking.engine.kernels.layout import Layout
from flocking.model.bodies.body import Limit

LAW = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(1.0)])
CURVE = fk.Path(["sin(t)", "0"])


def point(x: Any) -> dict[str, Any]:
    """Rates of a point mass."""
    return {"p": [(u - x.damping * v) / x.mass for u, v in zip(x.u, x.p, strict=True)]}


def nothing(_: Any) -> dict[str, Any]:
    """No lets, and no limits."""
    return {}


def energy(x: Any, w: Any) -> Any:
    """Kinetic energy of a point."""
    return x.mass * sum(a**2 for a in w) / 2


@dataclass(frozen=True, eq=False)
class Own(fk.Body):
    """A body whose formulas and properties are given."""

    masses: Any = 1.0
    damping: Any = 0.0
    gain: Any = 0.0
    order: int = 2
    made: Any = point
    stored: Any = energy
    helped: Any = nothing
    columns: Any = ()
    summary: Any = "own"
    homogeneous: Any = False
    inert: Any = False
    limited: Any = nothing
    parameters = property(lambda self: {"gain": self.gain})

    def __post_init__(self) -> None:
        self.check_fields()

    def lets(self, x: Any) -> Any:
        return self.helped(x)

    def rates(self, x: Any) -> Any:
        return self.made(x)

    def kinetic(self, x: Any, relative: Any) -> Any:
        return self.stored(x, relative) if self.order == 2 else sympy.Integer(0)

    def limits(self, x: Any) -> Any:
        return self.limited(x)

    def held(self, dimension: int) -> Any:
        return tuple(self.limited(Numbers()))


class Numbers:
    """Any number that a formula uses."""

    def __getattr__(self, name: str) -> Any:
        return [sympy.Symbol("a"), sympy.Symbol("b")]


def motion(body: fk.Body, energy: fk.Energy | None = None) -> MotionFormulas:
    """The formulas of a body in the plane."""
    return motion_formulas(Layout(LAW, fk.Energy() if energy is None else energy, body), 2)


def pulled(x: Any) -> dict[str, Any]:
    """Rates of a mass on a spring that stands at the origin."""
    return {"p": [u - q / 2 for u, q in zip(x.u, x.q, strict=True)]}


def dragged(x: Any) -> dict[str, Any]:
    """Rates with a drag."""
    return {"p": [(u - x.parameter("gain") * v) / x.mass for u, v in zip(x.u, x.p, strict=True)]}


def turned(x: Any) -> dict[str, Any]:
    """Rates under a force across the velocity, which does no work."""
    return {"p": [x.u[0] / x.mass - x.p[1], x.u[1] / x.mass + x.p[0]]}


REFUSED = {
    "a spring at the origin": (Own(made=pulled, homogeneous=True), "homogeneous must not be stated .* got 'q0, q1'"),
    "a wind that changes": (
        Own(made=lambda x: {"p": [u + sympy.sin(x.t) for u in x.u]}, homogeneous=True), "homogeneous .* got 't'",
    ),
    "a place in a let": (
        Own(made=lambda x: {"p": [u + x.let("a") for u in x.u]}, helped=lambda x: {"a": x.q[0]}, homogeneous=True),
        "homogeneous .* got 'q0'",
    ),
    "a limit at a place": (
        Own(limited=lambda x: {"wall": Limit(x.q[0], -x.q[0])}, homogeneous=True), "homogeneous .* got 'q0'",
    ),
    "a drag for all observers": (Own(made=dragged, gain=0.5, inert=True), "inert must not be stated .* got 'p0, p1'"),
    "order 1 for all observers": (
        Own(order=1, made=lambda x: {"q": list(x.u)}, inert=True), "inert must not be stated .* got 'order 1'",
    ),
    "a drag without words": (
        Own(made=dragged, gain=[0.0, 0.5, 0.0], summary=""), "summary must state .* rates are not",
    ),
    "thrust without words": (Own(made=dragged, gain=-0.5, summary=""), "summary must state .* rates are not"),
    "a force without work": (Own(made=turned, summary=""), "summary must state .* rates are not"),
    "masses that do not weigh": (
        Own(made=lambda x: {"p": list(x.u)}, masses=[1.0, 2.0, 1.0], summary=""), "summary must state .* rates are not",
    ),
    "an energy without words": (
        Own(stored=lambda x, w: 3 * energy(x, w), summary=""), "summary must state .* kinetic energies are not",
    ),
    "order 1 without words": (
        Own(order=1, made=lambda x: {"q": [2 * u for u in x.u]}, summary=""), "summary must state .* rates are not",
    ),
    "one of two bodies": (
        fk.Mixture((fk.PointMass(), Own(made=dragged, gain=0.5, summary="")), [0, 1, 1]), "Mixture: summary must state",
    ),
    "twice as fast": (
        Own(made=lambda x: {**point(x), "q": [2 * v for v in x.p]}), "rates must not give 'q' another .* got '2*",
    ),
    "a column twice": (
        Own(columns=(fk.Column("c"), fk.Column("c")), made=lambda x: {**point(x), "c": x.u}),
        "columns must be declared once each; got 'c'",
    ),
    "order 3": (Own(order=3), "order must be 1 or 2; got 3"),
    "an energy of place": (
        Own(stored=lambda x, w: energy(x, w) + x.q[0] ** 2), "kinetic must depend on the relative .* got 'q0'",
    ),
    "an energy of a column": (
        Own(
            columns=(fk.Column("c", 1),), made=lambda x: {**point(x), "c": [x.u[0]]},
            stored=lambda x, w: energy(x, w) + x.columns["c"][0] ** 2,
        ),
        "kinetic must depend on the relative .* got 'column_c_0'",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_what_rates_contradict_is_refused(what: str) -> None:
    body, words = REFUSED[what]
    with pytest.raises(fk.InvalidInput, match=words):
        motion(body)


ACCEPTED = {
    "a spring that says so": Own(made=pulled),
    "a drag of zero": Own(made=dragged, gain=[0.0, 0.0, 0.0], summary="", homogeneous=True, inert=True),
    "a drag elsewhere the same": Own(made=dragged, gain=0.5, homogeneous=True),
    "a point": Own(damping=[0.1, 0.2, 0.0], masses=[1.0, 2.0, 3.0], summary="", homogeneous=True),
    "unit masses": Own(made=lambda x: {"p": list(x.u)}, summary="", homogeneous=True, inert=True),
    "a point by lets": Own(
        helped=lambda x: {"a": 1 / x.mass}, made=lambda x: {"p": [u * x.let("a") for u in x.u]}, summary="", inert=True
    ),
    "velocities that are p": Own(made=lambda x: {**point(x), "q": list(x.p)}, summary=""),
    "an energy with words": Own(stored=lambda x, w: 3 * energy(x, w)),
    "points of two kinds": fk.Mixture((fk.PointMass(), Own(summary="", damping=0.3)), [0, 1, 1]),
    "points, one dragged": fk.Mixture((fk.PointMass(), Own(made=dragged, gain=0.5)), [0, 1, 1]),
    "order 1": Own(order=1, made=lambda x: {"q": list(x.u)}, summary="", homogeneous=True),
}


@pytest.mark.parametrize("what", ACCEPTED)
def test_what_rates_bear_out_is_accepted(what: str) -> None:
    assert motion(ACCEPTED[what]).rates


def test_energies_of_ones_own_need_a_frame_that_does_not_accelerate() -> None:
    """A leader's acceleration enters the ledger with the masses of points."""
    heavy = Own(stored=lambda x, w: 3 * energy(x, w))
    for frame in (fk.Energy(), fk.Energy("centre of mass"), fk.Energy("leader", fk.Path(["2", "0"]))):
        assert motion(heavy, frame).departs
    uneven = Own(stored=lambda x, w: (1 + x.parameter("gain")) * energy(x, w), gain=[0.0, 1.0, 2.0])
    quartic = Own(stored=lambda x, w: energy(x, w) ** 2)
    for body, frame in (
        (heavy, fk.Energy("leader", CURVE)), (uneven, fk.Energy("centre of mass")),
        (quartic, fk.Energy("centre of mass")),
    ):  # fmt: skip
        with pytest.raises(fk.InvalidInput, match="kinetic must be that of points"):
            motion(body, frame)
    assert motion(Own(), fk.Energy("leader", CURVE)).kinetic != 0


def test_a_spring_at_the_origin_moves_the_centre_as_an_oscillator() -> None:
    """The centre of three agents on springs of 1/2: c cos(w t) + (v/w) sin(w t), wherever they start."""
    start = fk.State([[100.0, 0.0], [101.0, 0.5], [99.0, 1.0]], [[0.5, 0.0], [0.0, 0.3], [0.1, 0.0]])
    scenario = fk.Scenario(LAW, start, t_end=3.0, frames=4, bodies=Own(made=pulled))
    run, w = fk.simulate(scenario, progress=False), np.sqrt(0.5)
    found = start.q.mean(axis=0) * np.cos(3 * w) + start.p.mean(axis=0) * np.sin(3 * w) / w
    assert np.abs(run.q[-1].mean(axis=0) - found).max() < 1e-6
    with pytest.raises(fk.InvalidInput, match="homogeneous"):
        fk.start(replace(scenario, agents=Own(made=pulled, homogeneous=True)))
