"""Pieces of potentials that meet where links break, and jumps nearer than that, in ledgers of all worlds."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver.simulate import start
from flocking.engine.imperfect.true_law import TrueLaw
from flocking.errors import UnsupportedLaw
from flocking.model.terms.potential_reach import inner_edge, is_barrier, jumps_below

SPRING = fk.Potential("r**2/2")
WORLDS = {
    "held": ("sampled", {"control": fk.Held(0.07)}),
    "messages": ("sampled", {"control": fk.Held(0.05), "information": fk.Messages(0.05, delay=0.05)}),
    "limited": ("sampled", {"control": fk.Held(0.07), "bodies": fk.Limited(fk.PointMass(damping=0.1), force=50.0)}),
    "delayed": ("delayed", {"information": fk.Delayed(0.05)}),
    "late messages": ("delayed", {"information": fk.Messages(0.05, delay=0.02)}),
    "tiles": ("tiles", {}), "held tiles": ("tiles", {"control": fk.Held(0.07)}),
}  # fmt: skip
STARTS = {
    "leaving": fk.State([[0.0, 0.0], [1.6, 0.0], [2.5, 1.0]], [[-3.0, 0.0], [3.0, 0.0], [0.0, -1.0]]),
    "passing": fk.State([[0.0, 0.0], [2.6, 0.0], [2.5, 1.0]], [[3.0, 0.0], [-3.0, 0.0], [0.0, -1.0]]),
}  # fmt: skip


def run_of(psi: fk.Potential, graph: fk.Graph, world: str, start: str = "leaving") -> fk.Run:
    engine, parts = WORLDS[world]
    law = fk.Law(graph, [fk.Gradient(psi), fk.Consensus(0.3)])
    options = {"step": 0.002} if engine == "tiles" else {}
    scenario = fk.Scenario(law, STARTS[start], t_end=3.0, frames=16, **parts)
    return fk.simulate(scenario, engine=engine, progress=False, **options)


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("world", WORLDS)
def test_links_that_break_had_the_energy_of_below_the_radius(world, start):
    """Whatever a formula is at the radius and beyond: linked pairs have r^2/2, with which a link goes."""
    graph = fk.Hysteresis(2.0, 0.3)
    plain = run_of(SPRING, graph, world, start)
    assert abs(plain.trace["jumped"][-1]) > 0.5
    for psi in (SPRING.cut(2.0), fk.Potential("where(r >= 2, 100, r**2/2)")):
        found = run_of(psi, graph, world, start)
        assert found.trace["jumped"][-1] == pytest.approx(plain.trace["jumped"][-1], rel=1e-9)
        assert np.abs(found.residual).max() == pytest.approx(np.abs(plain.residual).max(), abs=1e-9)
        assert np.abs(found.q - plain.q).max() < 1e-9


@pytest.mark.parametrize("world", ["held", "delayed"])
def test_ranges_of_single_agents_count_too(world):
    """The range of agent 0 ends where the piece does, with agent 1 in it, and agent 2 sees nobody."""
    found, plain = (run_of(psi, fk.PerAgentRadii([2.0, 1.0, 0.5]), world) for psi in (SPRING.cut(2.0), SPRING))
    assert plain.trace["jumped"][-1] == pytest.approx(-1.0)
    assert found.trace["jumped"][-1] == pytest.approx(plain.trace["jumped"][-1], rel=1e-9)


@pytest.mark.parametrize("world", ["held", "delayed"])
def test_a_barrier_that_is_cut_off_is_one(world):
    """The ledger ends where a link is torn over it, instead of going on with 10^12 that departed."""
    barrier = fk.Potential("1/r + 1/(2 - r)")
    for psi in (barrier, barrier.cut(2.0), fk.Potential("where(r >= 2, 100, 1/r + 1/(2 - r))")):
        engine, parts = WORLDS[world]
        law = fk.Law(fk.Hysteresis(2.0, 0.3), [fk.Gradient(psi), fk.Consensus(1.0)])
        assert law.has_barrier(law.graph)
        parts = {"control": fk.Held(0.2)} if world == "held" else {"information": fk.Delayed(0.2)}
        found = fk.simulate(
            fk.Scenario(law, STARTS["leaving"], t_end=1.0, frames=2, **parts), engine=engine, progress=False
        )
        assert found.provenance["ledger ends"] < 0.2
        assert np.abs(found.trace["departed"]).max() < 1e3


@pytest.mark.parametrize("world", ["held", "messages", "limited", "delayed", "late messages"])
def test_what_pairs_lose_at_jumps_is_not_left_to_the_residual(world):
    """Three pairs come across a jump of 5, which is not located in these worlds: there is no ledger."""
    found = run_of(fk.Potential("where(r < 1, r**2/2, r**2/2 + 5)"), fk.Complete(), world, "passing")
    assert found.provenance["ledger ends"] == 0.0
    assert set(found.trace["time"]) == {0.0}
    meeting = run_of(fk.Potential("where(r < 1, r**2/2, 1/2)"), fk.Complete(), world, "passing")
    assert "ledger ends" not in meeting.provenance
    assert np.abs(meeting.residual).max() < 1e-4


@pytest.mark.parametrize("world", ["tiles", "held tiles"])
def test_tiles_have_no_ledger_of_jumps_and_give_no_shorter_step_for_it(world):
    """They run such laws without a ledger: the residual does not depend on the step."""
    jumping = fk.Potential("where(r < 1, r**2/2, r**2/2 + 5)")
    with pytest.raises(UnsupportedLaw, match=r"jumps at a distance of 1, .* or ledger=False"):
        run_of(jumping, fk.Proximity(3.0), world, "passing")
    _, parts = WORLDS[world]
    law = fk.Law(fk.Proximity(3.0), [fk.Gradient(jumping), fk.Consensus(0.3)])
    made = fk.Scenario(law, STARTS["passing"], t_end=3.0, frames=16, **parts)
    found = fk.simulate(made, engine="tiles", step=0.002, ledger=False, progress=False)
    plain = run_of(SPRING, fk.Proximity(3.0), world, "passing")
    assert np.abs(found.q - plain.q).max() < 1e-9


def test_tiles_refuse_such_a_law_later_too_and_go_on():
    laws = [
        fk.Law(fk.Proximity(3.0), [fk.Gradient(psi), fk.Consensus(0.3)])
        for psi in (SPRING, fk.Potential("where(r < 1, r**2/2, r**2/2 + 5)"))
    ]
    session, other = (
        start(fk.Scenario(laws[0], STARTS["passing"], t_end=3.0, frames=16), engine="tiles") for _ in range(2)
    )
    session.advance(0.5)
    with pytest.raises(UnsupportedLaw, match="jumps at a distance of 1"):
        session.replace(law=laws[1])
    for each in (session, other):
        each.advance(3.0)
    assert (session.run().q == other.run().q).all()


@pytest.mark.parametrize("world", ["held", "delayed"])
def test_a_law_that_comes_later_counts(world):
    engine, parts = WORLDS[world]
    laws = [
        fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("where(r < a, r**2/2, b)", a=a, b=b)), fk.Consensus(0.3)])
        for a, b in ((5.0, 0.0), (2.0, 7.0), (1.8, 7.0))
    ]
    scenario = fk.Scenario(laws[0], STARTS["leaving"], t_end=1.5, frames=16, **parts)
    session = start(scenario, engine=engine)
    session.advance(0.05)
    session.replace(law=laws[1])
    session.advance(0.5)
    found = session.run()
    assert found.trace["jumped"][-1] == pytest.approx(-2.0, abs=1e-6)
    session.replace(law=laws[2])
    session.advance(1.0)
    assert session.run().provenance["ledger ends"] == pytest.approx(0.5)


def test_what_is_at_a_radius():
    assert 2.0 - 1e-11 < inner_edge((1.0, 2.0), 2.0) < 2.0
    assert inner_edge((1.0, 2.0), 3.0) == 3.0
    assert not is_barrier(fk.Potential("where(r < 2, r, 1/(r - 2))"), 2.0)
    assert is_barrier(fk.Potential("where(r < 2, log(2 - r), 0)"), 2.0)
    assert jumps_below(fk.Potential("where(r < 1, r, r + 1e-6)"), 2.0) == 1.0
    for formula in (
        "where(r < 1, sqrt(abs(1 - r)), 3*(r - 1))",
        "where(r < 2, r, 0)",
        "where(r < 3, r, 0)",
        "abs(r - 1)",
    ):
        assert jumps_below(fk.Potential(formula), 2.0) is None


@pytest.mark.parametrize("close", [lambda psi, radius: psi.cut(radius), lambda psi, radius: psi.capped(radius)])
def test_papers_take_the_energy_at_the_radius_from_below(close):
    """Pairs without a link store V(R), also where a potential is written with zero from R on."""
    scenario = fk.papers.tanner_2003_dynamic.scenario(seed=1)
    (psi,) = (t.potential for t in scenario.law.terms if isinstance(t, fk.Gradient))
    rest = [t for t in scenario.law.terms if not isinstance(t, fk.Gradient)]
    law = fk.Law(scenario.law.graph, [fk.Gradient(close(psi, scenario.law.graph.radius)), *rest])
    assert fk.papers.tanner_2003_dynamic.PAPER.assumes(scenario.with_(law=law)) == ""


ENDS = {
    "spheres in contact": "where(r < 1, (1 - r)**2.5, 0)", "a bump": "where(r < 1, exp(-1/(1 - r)), 0)",
    "a parabola": "where(r < 1, (1 - r)**2, 0)", "a well": "where(r < 1, 5 + (1 - r)**2.5, 0)",
}  # fmt: skip
"""Formulas that have no value beyond the radius, or other ones than zero; the last one ends with a jump."""


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("name", ENDS)
def test_formulas_that_do_not_go_on_beyond_the_radius_have_ledgers_in_tiles(name, precision):
    law = fk.Law(fk.Proximity(1.0), [fk.Gradient(fk.Potential(ENDS[name])), fk.Consensus(0.3)])
    begin = fk.State([[0.0, 0.0], [0.8, 0.0], [0.3, 0.6]], [[-0.5, 0.0], [0.5, 0.0], [0.0, 0.5]])
    for control in ({}, {"control": fk.Held(0.02)}):
        made = fk.Scenario(law, begin, t_end=2.0, frames=5, **control)
        found = fk.simulate(made, engine="tiles", step=0.005, precision=precision, progress=False)
        exact = fk.simulate(made, engine="sampled" if control else "exact", progress=False)
        assert len(exact.switches) >= 2
        assert np.abs(found.residual).max() < 0.02
        assert found.trace["jumped"][-1] == pytest.approx(
            exact.trace["jumped"][-1], abs=1e-3 if name == "a well" else 1e-6
        )


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_agents_at_one_point_have_the_energy_of_the_innermost_piece(precision):
    psi = fk.Potential("where(r < 0.2, 0.04, where(r < 1, r**2, 0))")
    law = fk.Law(fk.Proximity(1.0), [fk.Gradient(psi), fk.Consensus(1.0)])
    begin = fk.State([[0.0, 0.0], [0.0, 0.0], [0.5, 0.0]], [[0.1, 0.0], [0.1, 0.0], [0.0, 0.0]])
    run = fk.simulate(
        fk.Scenario(law, begin, t_end=0.5, frames=2), engine="tiles", step=0.005, precision=precision, progress=False
    )
    kinetic = float(run.trace["kinetic"][0])
    assert run.trace["energy"][0] - kinetic == pytest.approx(0.04 + 2 * 0.25, abs=1e-6)
    assert np.abs(run.residual).max() < 0.01


@pytest.mark.parametrize("world", ["held", "delayed"])
def test_sessions_that_went_on_with_such_a_ledger_have_none_from_there(world, monkeypatch):
    """As earlier versions did."""
    engine, parts = WORLDS[world]
    law = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("where(r < 1, r**2/2, r**2/2 + 5)")), fk.Consensus(0.3)])
    with monkeypatch.context() as earlier:
        earlier.setattr(TrueLaw, "ledger_end", lambda self, time: np.inf)
        session = start(fk.Scenario(law, STARTS["passing"], t_end=3.0, frames=16, **parts), engine=engine)
        session.advance(0.2)
        moment = session.moment()
    again = moment()
    again.advance(3.0)
    assert again.run().provenance["ledger ends"] == pytest.approx(0.2)
