"""What terms state of their energies: right statements pass, wrong ones are refused with their factor."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass, replace

import numpy as np
import pytest
import sympy

import flocking as fk
from flocking.engine.reference.control import evaluate
from flocking.model.terms.avoidance import ObstacleTerm
from flocking.model.terms.balances import from_library

PSI = fk.Potential("k*(r - d)**2/2 + log(r)", k=2.0, d=1.5)


@dataclass(frozen=True)
class Spring(fk.PairTerm):
    """A damped spring whose force, storage, dissipation and supply may be off by factors."""

    force: float = 1.0
    damping: float = 1.0
    stored: float = 1.0
    dissipated: float = 1.0
    supplied: float = 1.0

    @property
    def parameters(self):
        return {"k": 3.0, "c": 0.7, "push": 0.2}

    @property
    def structure(self):
        return ("Spring", self.force, self.damping, self.stored, self.dissipated, self.supplied)

    def along(self, x):
        return self.force * x.parameter("k") * (x.r - 1) * x.weight - x.parameter("push") * x.speed2

    def drag(self, x):
        return self.damping * x.parameter("c") / (1 + x.r**2)

    def storage(self, x):
        r = sympy.Symbol("r", positive=True)
        assert x.r == r
        return self.stored * sympy.integrate(x.parameter("k") * (r - 1), r)

    def dissipation(self, x):
        return self.dissipated * x.parameter("c") / (1 + x.r**2) * x.speed2

    def supply(self, x):
        return self.supplied * x.parameter("push") * x.speed2 * x.radial


@dataclass(frozen=True)
class Tether(fk.BodyTerm):
    """A damped spring to a leader, with a wind, whose statements may be off by factors."""

    leader: fk.Leader
    stored: float = 1.0
    dissipated: float = 1.0
    supplied: float = 1.0

    @property
    def parameters(self):
        return {"k": 2.0, "c": 0.5}

    @property
    def structure(self):
        return ("Tether", self.stored, self.dissipated, self.supplied)

    def force(self, x):
        k, c = x.parameter("k"), x.parameter("c")
        gap = zip(x.q, x.leader_q, x.p, x.leader_p, strict=True)
        return [k * (b - a) + c * (w - v) + x.t for a, b, v, w in gap]

    def storage(self, x):
        return self.stored * x.parameter("k") * sum((a - b) ** 2 for a, b in zip(x.q, x.leader_q, strict=True)) / 2

    def balance(self, x):
        k, c = x.parameter("k"), x.parameter("c")
        slip = [v - w for v, w in zip(x.p, x.leader_p, strict=True)]
        lost = c * sum(s**2 for s in slip)
        gaps = zip(x.q, x.leader_q, x.p, x.leader_p, slip, x.frame_p, strict=True)
        given = sum(x.t * (v - f) - c * s * (w - f) + k * (a - b) * (f - w) for a, b, v, w, s, f in gaps)
        return self.dissipated * lost, self.supplied * given


@dataclass(frozen=True, eq=False)
class Fender(fk.Avoid):
    """Obstacle avoidance whose damping may be off by factors."""

    dissipated: float = 1.0
    damped: float = 1.0

    @property
    def structure(self):
        return ("Fender", self.dissipated, self.damped, *super().structure)

    def obstacle_force(self, x):
        push = super().obstacle_force(replace(x, boundary=x.p))
        c4 = x.parameter("damping_gain")
        return [f + self.damped * c4 * (w - v) for f, w, v in zip(push, x.boundary, x.p, strict=True)]

    def obstacle_balance(self, x):
        lost, given = super().obstacle_balance(x)
        return self.dissipated * lost, given


SMOOTH = fk.Smooth(2.0, 0.5)
PATHS = [fk.Velocity([1.0, 0.5]), fk.Sink([1.0, 2.0]), fk.Path(["sin(t)", "a*t"], a=0.3), fk.Path(["exp(-t**4)", "1"])]


def spring_law(*, graph=None, **factors):
    return fk.Law(graph or fk.Proximity(2.0), [Spring(**factors)])


def tether_scenario(leader=None, order=2, frame="lab", compensate=False, **factors):
    leader = leader or PATHS[0]
    energy = fk.Energy(frame, leader) if frame == "leader" else fk.Energy(frame)
    terms = [Tether(leader, **factors)] + ([fk.Compensate()] if compensate else [])
    state = fk.State([[0.0, 0.0], [1.0, 0.2]], [[0.1, 0.0], [0.0, 0.3]])
    agents = fk.Agents([1.0, 2.0], [0.1, 0.0] if order == 2 else 0.0, order)
    return fk.Scenario(fk.Law(fk.Proximity(2.0), terms), state, 1.0, agents=agents, energy=energy)


def fender_scenario(**factors):
    term = Fender(
        (fk.Ball([3.0, 0.0], 1.0), fk.Wall([0.0, -5.0], [0.0, 1.0])), fk.Velocity([1.0, 0.0]), range=2.0, **factors
    )
    return fk.Scenario(fk.Law(fk.Proximity(2.0), [term]), fk.State([[0.0, 0.0]], [[0.1, 0.0]]), 1.0)


def test_right_statements_are_accepted():
    assert spring_law().terms
    for leader in PATHS:
        assert tether_scenario(leader).law.terms
    assert fender_scenario().law.terms


@pytest.mark.parametrize("factor", [0.5, 10.0, -3.0, 1.01, 1 + 1e-6])
@pytest.mark.parametrize(("name", "argument"), [
    ("dissipation", "dissipated"), ("storage", "stored"), ("supply", "supplied"),
])  # fmt: skip
def test_a_wrong_statement_of_a_pair_term_is_refused_with_its_factor(name, argument, factor):
    with pytest.raises(fk.InvalidInput, match=f"Spring: {name} must be that of the stated forces; got '{factor:.6g} "):
        spring_law(**{argument: factor})


@pytest.mark.parametrize("factor", [0.5, 10.0, -3.0])
@pytest.mark.parametrize(("name", "argument"), [("storage", "force"), ("dissipation", "damping")])
def test_a_wrong_force_is_refused(name, argument, factor):
    with pytest.raises(fk.InvalidInput, match=f"Spring: {name} .* got '{1 / factor:.6g} times"):
        spring_law(**{argument: factor})


@pytest.mark.parametrize("factor", [0.5, 10.0, -3.0])
@pytest.mark.parametrize(("name", "argument"), [
    ("dissipation", "dissipated"), ("storage", "stored"), ("supply", "supplied"),
])  # fmt: skip
@pytest.mark.parametrize(("frame", "order", "compensate"), [
    ("lab", 2, False), ("lab", 1, False), ("centre of mass", 2, True), ("leader", 2, False), ("leader", 1, False),
])  # fmt: skip
def test_a_wrong_statement_of_a_body_term_is_refused_with_its_factor(name, argument, factor, frame, order, compensate):
    with pytest.raises(fk.InvalidInput, match=f"Tether: {name} must be that of the stated forces; got '{factor:.6g} "):
        tether_scenario(frame=frame, order=order, compensate=compensate, **{argument: factor})


@pytest.mark.parametrize("factor", [0.5, 10.0, -3.0])
def test_a_wrong_statement_near_obstacles_is_refused(factor):
    with pytest.raises(fk.InvalidInput, match=f"Fender: dissipation .* got '{factor:.6g} times"):
        fender_scenario(dissipated=factor)
    with pytest.raises(fk.InvalidInput, match="Fender: "):
        fender_scenario(damped=factor)


@pytest.mark.parametrize("factor", [0.5, 10.0, -3.0])
@pytest.mark.parametrize("name", ["along", "drag", "storage", "dissipation"])
@pytest.mark.parametrize(("right", "graph"), [
    (fk.Gradient(PSI), fk.Proximity(2.0)), (fk.Gradient(PSI), SMOOTH),
    (fk.Consensus(1.5, weighted=True), SMOOTH), (fk.Consensus([1.0, 2.0]), fk.PerAgentRadii([1.0, 2.0])),
])  # fmt: skip
def test_library_terms_with_one_formula_overridden_are_foreign(right, graph, name, factor):
    kind = type(right)
    wrong = type(
        f"Own{kind.__name__}", (kind,), {name: lambda self, x: factor * getattr(super(type(self), self), name)(x)}
    )
    copy = object.__new__(wrong)
    copy.__dict__.update(right.__dict__)
    assert not from_library(copy)
    if getattr(kind, name) is getattr(fk.PairTerm, name):
        assert fk.Law(graph, [copy]).terms  # nothing, times a factor
    elif name == "drag" and factor > 0:
        # The inherited dissipation is that of the drag, whatever it is.
        assert fk.Law(graph, [copy]).terms
    else:
        with pytest.raises(fk.InvalidInput, match=f"Own{kind.__name__}: (storage|dissipation)"):
            fk.Law(graph, [copy])


def test_a_drag_that_pushes_apart_is_no_dissipation():
    class Apart(fk.Consensus):
        def drag(self, x):
            return -super().drag(x)

    with pytest.raises(fk.InvalidInput, match="Apart: dissipation must not be negative"):
        fk.Law(fk.Proximity(2.0), [Apart(1.0)])


def test_storage_is_a_function_of_positions():
    class Odd(Spring):
        def storage(self, x):
            return x.speed2

    with pytest.raises(fk.InvalidInput, match=r"Odd: storage must be a function of r .* got 'speed2'"):
        fk.Law(fk.Proximity(2.0), [Odd()])


def test_formulas_that_nowhere_have_a_value_are_refused():
    class Nowhere(Spring):
        def drag(self, x):
            return sympy.sqrt(-1 - x.r)

    with pytest.raises(fk.InvalidInput, match="finite values"):
        fk.Law(fk.Proximity(2.0), [Nowhere()])


def test_a_term_that_states_nothing_is_supplied_with_all_its_power():
    class Bare(fk.PairTerm):
        @property
        def parameters(self):
            return {"k": 0.5}

        @property
        def structure(self):
            return ("Bare",)

        def along(self, x):
            return x.parameter("k") * x.r

        def drag(self, x):
            return -x.parameter("k")

    law = fk.Law(fk.Proximity(9.0), [Bare()])
    q, p = np.array([[0.0, 0.0], [2.0, 0.0]]), np.array([[0.0, 1.0], [3.0, 0.0]])
    found = evaluate(law, fk.State(q, p))
    assert found.dissipation == found.storage == 0
    assert found.supply == pytest.approx((found.u * p).sum(), rel=1e-14)


def test_rounding_alone_is_no_fault():
    class Squared(fk.PairTerm):
        """A slope written in a way that cancels."""

        @property
        def parameters(self):
            return {"k": 1e6}

        @property
        def structure(self):
            return ("Squared",)

        def along(self, x):
            return (x.r + x.parameter("k")) ** 2 - x.r**2 - x.parameter("k") ** 2

        def storage(self, x):
            return x.parameter("k") * x.r**2

    assert fk.Law(fk.Proximity(2.0), [Squared()]).terms


def test_terms_of_the_library_need_no_sympy_when_their_law_is_built():
    source = (
        "import sys, flocking as fk\n"
        "law = fk.Law(fk.Smooth(2.0, 0.5), [fk.Gradient(fk.Potential('r**2')), fk.Consensus(1.0), "
        "fk.Track(fk.Velocity([1.0, 0.0])), fk.Compensate()])\n"
        "fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]]), 1.0)\n"
        "sys.exit('sympy' in sys.modules)\n"
    )
    # The first process prints the potential's functions; later ones find them.
    subprocess.run([sys.executable, "-c", source], check=False)
    assert subprocess.run([sys.executable, "-c", source], check=False).returncode == 0


def test_an_obstacle_term_inherits_the_whole_power_as_supply():
    class Own(fk.Avoid):
        def obstacle_force(self, x):
            return [2 * f for f in super().obstacle_force(x)]

        def obstacle_balance(self, x):
            return ObstacleTerm.obstacle_balance(self, x)

    term = Own((fk.Ball([3.0, 0.0], 1.0),), fk.Velocity([1.0, 0.0]), range=2.0)
    state = fk.State([[0.0, 0.0]], [[0.1, 0.0]])
    assert fk.Scenario(fk.Law(fk.Proximity(2.0), [term]), state, 1.0).law.terms
