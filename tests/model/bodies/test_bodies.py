"""Bodies: declarations are checked, and a scenario completes what a start leaves out."""

import warnings
from dataclasses import dataclass, replace

import numpy as np
import pytest

import flocking as fk
from flocking.engine.kernels.expressions import motion_formulas
from flocking.engine.kernels.layout import Layout
from flocking.model.serial import from_data, to_data
from tests.bodies import Actuated

LAW = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
START = fk.State(np.array([[0.0, 0.0], [1.0, 0.5], [0.2, 1.1]]), np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.2]]))


def motion(body, dimension=2):
    return motion_formulas(Layout(LAW, fk.Energy(), body), dimension)


def test_agents_are_point_masses_or_single_integrators():
    for agents, body in (
        (fk.Agents(2.0, 0.3), fk.PointMass(2.0, 0.3)), (fk.Agents(order=1), fk.SingleIntegrator()),
    ):  # fmt: skip
        assert motion(agents) == motion(body)
        assert agents.structure == body.structure
        assert agents.order == body.order


def test_runs_of_agents_and_of_bodies_are_equal_to_the_bit():
    for agents, body in (
        (fk.Agents(2.0, 0.3), fk.PointMass(2.0, 0.3)), (fk.Agents(order=1), fk.SingleIntegrator()),
    ):  # fmt: skip
        one, two = (fk.simulate(fk.Scenario(LAW, START, 1.0, agents=x, frames=3)) for x in (agents, body))
        assert fk.first_difference(one, two) is None


def test_bodies_is_another_word_for_agents():
    body = fk.PointMass(2.0)
    scenario = fk.Scenario(LAW, START, 1.0, bodies=body)
    assert scenario.agents is scenario.bodies is body
    assert scenario.with_(bodies=fk.SingleIntegrator()).agents.order == 1
    assert replace(scenario, t_end=2.0).bodies is body
    with pytest.raises(fk.InvalidInput, match="Scenario: bodies must be given once"):
        fk.Scenario(LAW, START, 1.0, agents=body, bodies=body)
    with pytest.raises(fk.InvalidInput, match="must be a body, such as PointMass"):
        fk.Scenario(LAW, START, 1.0, bodies=2.0)


def test_an_ideal_body_departs_in_nothing():
    assert motion(fk.PointMass()).departure == 0
    assert motion(fk.SingleIntegrator()).departure == 0
    assert motion(Actuated()).departure != 0


def test_a_scenario_has_every_column():
    scenario = fk.Scenario(LAW, START, 1.0, bodies=Actuated())
    assert scenario.start.columns["force"].tolist() == [[0.0, 0.0]] * 3
    given = replace(START, columns={"force": np.ones((3, 2))})
    assert fk.Scenario(LAW, given, 1.0, bodies=Actuated()).start.columns["force"].tolist() == [[1.0, 1.0]] * 3


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({"torque": np.zeros((3, 2))}, "columns of Actuated alone, which are: force"),
        ({"force": np.zeros((3, 3))}, "2 numbers for each agent in column 'force'"),
        ({"force": np.zeros((2, 2))}, "a row for each of the 3 agents"),
        ({"force": np.full((3, 2), np.nan)}, "must be finite"),
    ],
)
def test_columns_that_do_not_fit_are_refused(columns, says):
    with pytest.raises(fk.InvalidInput, match=says):
        fk.Scenario(LAW, replace(START, columns=columns), 1.0, bodies=Actuated())


def test_columns_of_a_body_without_any_are_refused():
    with pytest.raises(fk.InvalidInput, match="columns of Agents alone, which are: none"):
        fk.Scenario(LAW, replace(START, columns={"force": np.zeros((3, 2))}), 1.0)


@pytest.mark.parametrize("name", ["q", "p", "not a name", 3])
def test_names_of_columns_are_checked(name):
    with pytest.raises(fk.InvalidInput, match="identifier other than q and p"):
        fk.Column(name)


@pytest.mark.parametrize("width", [0, -1, 1.5, True])
def test_widths_of_columns_are_checked(width):
    with pytest.raises(fk.InvalidInput, match="positive integer"):
        fk.Column("force", width)


@pytest.mark.parametrize(
    ("kind", "fields", "says"),
    [
        (fk.PointMass, {"masses": 0.0}, "PointMass: masses must be greater than 0"),
        (fk.PointMass, {"damping": -1.0}, "PointMass: damping"),
        (fk.SingleIntegrator, {"masses": [1.0, -1.0]}, "SingleIntegrator: masses must be greater than 0"),
        (fk.PointMass, {"headings": np.zeros((2, 2))}, "PointMass: headings"),
    ],
)
def test_values_of_bodies_are_checked(kind, fields, says):
    with pytest.raises(fk.InvalidInput, match=says):
        kind(**fields)


def test_values_of_other_groups_are_refused():
    with pytest.raises(fk.InvalidInput, match="time_constant must have one value for each of the 3 agents"):
        fk.Scenario(LAW, START, 1.0, bodies=Actuated(time_constant=np.ones(4)))


def test_rates_that_do_not_fit_the_columns_are_refused():
    @dataclass(frozen=True, eq=False)
    class Silent(Actuated):
        def rates(self, x):
            return {"p": list(x.u)}

    with pytest.raises(fk.InvalidInput, match="Silent: rates must be those of"):
        fk.simulate(fk.Scenario(LAW, START, 1.0, bodies=Silent()))


def test_agents_of_order_1_may_move_otherwise_than_wanted():
    @dataclass(frozen=True, eq=False)
    class Slow(fk.SingleIntegrator):
        summary = "agents are half as fast"

        def rates(self, x):
            return {"q": [u / 2 for u in x.u]}

    law = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("r**2/2"))])
    slow, fast = (
        fk.simulate(fk.Scenario(law, START, t, bodies=body, tolerance=1e-11))
        for t, body in ((1.0, Slow()), (0.5, fk.SingleIntegrator()))
    )
    assert slow.q[-1] == pytest.approx(fast.q[-1], abs=1e-9)
    # Half of what the ideal run dissipates on the same way is missing.
    assert slow.trace["departed"][-1] == pytest.approx(fast.trace["dissipated"][-1], abs=1e-9)
    assert np.abs(slow.residual).max() < 1e-9


def test_bodies_go_through_files():
    for body in (fk.PointMass([1.0, 2.0, 3.0], 0.1), fk.SingleIntegrator(2.0)):
        scenario = fk.Scenario(LAW, START, 1.0, bodies=body)
        again = from_data(to_data(scenario))
        assert to_data(again) == to_data(scenario)
        assert type(again.agents) is type(body)


@pytest.mark.parametrize(("engine", "held", "said"), [
    ("lammps", None, "Actuated agents on ranks, only points and unicycles"),
    ("tiles", 0.1, "Actuated agents under held control, only points and unicycles"),
])  # fmt: skip
def test_other_engines_refuse_other_bodies_by_name(engine, held, said):
    control = fk.Continuous() if held is None else fk.Held(held)
    with pytest.raises(fk.FlockingError, match=said):
        fk.simulate(fk.Scenario(LAW, START, 1.0, bodies=Actuated(), control=control), engine=engine)


def test_the_control_of_limited_bodies_at_rest_warns_of_nothing() -> None:
    """Formulas of limits that do not act divide by the speed, or by the force, of an agent that has none."""
    law = fk.Law(fk.Fixed(2, ((0, 1),)), [fk.Gradient(fk.Potential("r**2/2"))])
    state = fk.State([[0.0, 0.0], [2.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]])
    for body in (fk.Limited(fk.PointMass(), speed=1.5), fk.Limited(fk.PointMass(), force=3.0)):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert fk.control(law, state, agents=body) == pytest.approx(np.array([[2.0, 0.0], [-2.0, 0.0]]))


@pytest.mark.parametrize("command", [[0.0, 0.0, -1.0], [0.0, 0.0, -1.5], [3.0, 0.0, -1.0]])
def test_quadrotors_do_not_start_with_a_filtered_force_beyond_their_weight(command):
    """The sum of both may vanish, and its direction and that of the first axis may be one."""
    weight = 0.5 * 9.81
    body = fk.Quadrotor([0.5, 0.5, 0.7])
    law = fk.Law(fk.Fixed(3, []), [fk.Consensus()])
    columns = {"command": weight * np.array([[0.0] * 3, command, [0.0] * 3])}
    with pytest.raises(fk.InvalidInput, match=r"must be shorter than the weight, 4.905; got 'length .* agent 1"):
        fk.Scenario(law, fk.State(np.zeros((3, 3)), columns=columns), t_end=1.0, agents=body)
    mixed = fk.Mixture((fk.PointMass(), body), [0, 1, 1])
    fk.Scenario(law, fk.State(np.zeros((3, 3)), columns={"command": 0.9 * columns["command"] / 3}), 1.0, agents=mixed)


def test_quadrotors_of_a_mixture_are_judged_by_their_own_weights():
    """The filtered force of the light one is below the weight of the heavy one alone."""
    heavy = fk.Quadrotor(masses=[1.0, 1.0, 9.0])
    mixed = fk.Mixture([heavy, fk.Quadrotor(reach=0.3, masses=[1.0, 1.0, 9.0])], [0, 1, 0])
    law = fk.Law(fk.Complete(), [fk.Consensus(1.0)])
    for agent, allowed in ((0, False), (1, False), (2, True)):
        command = np.zeros((3, 3))
        command[agent, 2] = -5.0 * heavy.gravity
        start = fk.State(np.eye(3), columns={"command": command})
        if allowed:
            fk.Scenario(law, start, 1.0, agents=mixed)
            continue
        with pytest.raises(fk.InvalidInput, match="command must be shorter than the weight"):
            fk.Scenario(law, start, 1.0, agents=mixed)


@dataclass(frozen=True, eq=False)
class Slow(fk.PointMass):
    """One that refuses a start at a speed of more than 1."""

    def check_scenario(self, control, q, p):
        if (np.linalg.norm(p, axis=1) > 1.0).any():
            raise fk.InvalidInput("Slow", "start", "must be slow", p)


def test_a_body_checks_scenarios_within_chains_and_mixtures_too():
    law, start = fk.Law(fk.Fixed(2, []), [fk.Consensus()]), fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [2.0, 0.0]])
    bodies = [fk.Lagged(Slow(), 0.1), fk.Limited(fk.Lagged(Slow(), 0.1), force=1.0)]
    for body in [Slow(), *bodies, fk.Mixture((fk.PointMass(), Slow()), [0, 1])]:
        with pytest.raises(fk.InvalidInput, match="Slow: start must be slow"):
            fk.Scenario(law, start, t_end=1.0, agents=body)
    fk.Scenario(law, start, t_end=1.0, agents=fk.Mixture((fk.PointMass(), Slow()), [1, 0]))


def test_a_rate_of_the_filtered_force_may_not_carry_it_over_the_weight():
    """Two lags in a row: the force f follows g = f + f'/w, and g the desired one, so that f stays where g is.

    From f = 0 and f' = v the force peaks at v/(e w) after the time 1/w: a rate of w times the weight is too fast for
    the bound that the filter keeps, and one of e w times the weight would reach the weight itself.
    """
    body = fk.Quadrotor(masses=1.0, gravity=10.0, command_frequency=5.0)
    law = fk.Law(fk.Complete(), [fk.Consensus(1.0)])
    for rate, fits in ((49.0, True), (51.0, False), (5.0 * 10.0 * np.e, False)):
        start = fk.State([[0.0, 0.0, 0.0]], columns={"command_rate": [[rate, 0.0, 0.0]]})
        if fits:
            run = fk.simulate(fk.Scenario(law, start, t_end=1.0, frames=11, bodies=body), progress=False)
            assert np.linalg.norm(run.columns["command"], axis=2).max() < rate / (np.e * 5.0) + 1e-6
            continue
        with pytest.raises(fk.InvalidInput, match=r"Quadrotor: command_rate must make .* shorter than the weight, 10"):
            fk.Scenario(law, start, t_end=1.0, bodies=body)
    both = fk.State([[0.0, 0.0, 0.0]], columns={"command": [[9.0, 0.0, 0.0]], "command_rate": [[-90.0, 0.0, 0.0]]})
    assert fk.Scenario(law, both, t_end=1.0, bodies=body) is not None
