"""Groups of several bodies: what an agent does is what its own body does."""

import json

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.model.serial import from_data, to_data
from flocking.study.scenario_files.scenario_file import parse_scenario, scenario_to_text

APART = fk.Law(fk.Fixed(4, []), [fk.Track(fk.Velocity([1.0, 0.5]), 1.0, 2.0)])
"""Agents that follow a leader and not each other: each moves as it would among its like."""
START = fk.State([[0.0, 0.0], [5.0, 1.0], [1.0, 6.0], [-4.0, 2.0]], [[0.5, 0.1], [0.0, -0.7], [-0.3, 0.2], [0.4, 0.4]])
BODIES = (
    fk.PointMass(damping=0.3),
    fk.Lagged(fk.PointMass(masses=2.0), 0.3),
    fk.Limited(fk.PointMass(), force=1.5),
    fk.Unicycle(0.2),
)


def run(bodies, law=APART, **parts):
    made = fk.Scenario(law, START, t_end=3.0, frames=13, bodies=bodies, tolerance=1e-11, **parts)
    return fk.simulate(made, progress=False)


@pytest.mark.parametrize("control", [fk.Continuous(), fk.Held(0.1)], ids=["continuous", "held"])
def test_each_agent_moves_as_among_its_like(control):
    """Under held control the mixture is integrated between ticks, and groups of one body move in closed form."""
    found = run(fk.Mixture(BODIES, [0, 1, 2, 3]), control=control)
    for k, body in enumerate(BODIES):
        alike = run(body, control=control)
        assert np.abs(found.q[:, k] - alike.q[:, k]).max() < 1e-8
        assert np.abs(found.p[:, k] - alike.p[:, k]).max() < 1e-8
        for name, values in alike.columns.items():
            assert np.abs(found.columns[name][:, k] - values[:, k]).max() < 1e-8
    assert not found.columns["applied"][:, [0, 2, 3]].any()
    assert not found.columns["heading"][:, :3].any()
    assert np.abs(found.residual).max() < 1e-7 * max(1.0, found.turnover)
    assert abs(found.trace["departed"][-1]) > 1e-3


def test_one_body_in_a_mixture_is_that_body():
    spring = fk.Law(fk.Fixed.complete(4), [fk.Gradient(fk.Potential("(r - 2)**2/2")), fk.Consensus(0.5)])
    lagged = fk.Lagged(fk.PointMass(), 0.2)
    one, other = run(fk.Mixture((lagged, lagged), [0, 1, 1, 0]), spring), run(lagged, spring)
    assert np.abs(one.q - other.q).max() < 1e-8
    assert one.trace["departed"][-1] == pytest.approx(other.trace["departed"][-1], abs=1e-7)


def test_mixtures_go_through_files_and_go_on(tmp_path):
    made = fk.Scenario(APART, START, t_end=3.0, frames=13, bodies=fk.Mixture(BODIES, [0, 1, 2, 3]))
    data = json.loads(json.dumps(to_data(made)))
    again = parse_scenario(scenario_to_text(made))
    assert to_data(from_data(data)) == to_data(again) == to_data(made)
    assert again.agents.kinds.tolist() == [0, 1, 2, 3]
    whole = fk.simulate(again, progress=False, save=tmp_path / "run")
    assert fk.first_difference(whole, fk.read_run(tmp_path / "run")) is None
    session = fk.start(again)
    session.advance(1.2)
    back = session.moment()()
    back.advance(3.0)
    assert np.array_equal(back.state.q, whole.q[-1])
    assert np.array_equal(back.state.columns["heading"], whole.columns["heading"][-1])


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: fk.Mixture((), [0]), "bodies must be bodies"),
        (lambda: fk.Mixture((fk.PointMass(), fk.SingleIntegrator()), [0, 1]), "must all be of one order"),
        (lambda: fk.Mixture((fk.PointMass(),), [0, 1]), "kinds must be whole numbers from 0 to 0"),
        (lambda: fk.Mixture((fk.PointMass(),), [0.5]), "kinds must be whole numbers"),
        (lambda: run(fk.Mixture((fk.PointMass(),), [0, 0])), "kinds"),
        (lambda: run(fk.Mixture((fk.PointMass(masses=[1.0, 2.0]),), [0, 0, 0, 0])), "masses"),
    ],
)
def test_wrong_values_are_refused(make, says):
    with pytest.raises(InvalidInput, match=says):
        make()


@pytest.mark.parametrize("engine", ["tiles", "lammps"])
def test_other_engines_refuse_them_by_name(engine):
    made = fk.Scenario(APART, START, t_end=1.0, bodies=fk.Mixture(BODIES, [0, 1, 2, 3]))
    with pytest.raises(UnsupportedLaw, match="Mixture"):
        fk.start(made, engine)


@pytest.mark.parametrize(
    ("bodies", "kinds", "words"),
    [
        (3, [0], "bodies must be bodies, such as PointMass; got 3"),
        ("PointMass", [0], "bodies must be bodies"),
        ([fk.PointMass()], [True, False], "kinds must be whole numbers"),
        ([fk.PointMass(), fk.PointMass()], [0, True], "kinds must be whole numbers; got 'truth values'"),
        ([fk.PointMass()], [], "kinds must hold at least 1 agent"),
        ([fk.PointMass(headings=[0.1, 0.2]), fk.PointMass()], [0, 1], "headings of all bodies or of none"),
        (
            [fk.PointMass(headings=[0.1, 0.2]), fk.PointMass(headings=[0.1])],
            [0, 1],
            "headings of all bodies or of none",
        ),
    ],
)
def test_what_is_no_mixture_is_refused_in_a_sentence(bodies, kinds, words):
    with pytest.raises(fk.InvalidInput, match=words):
        fk.Mixture(bodies, kinds)


def test_agents_of_a_mixture_keep_the_headings_of_their_bodies():
    """They were dropped, and graphs that look at headings refused the group."""
    one, two = np.array([0.1, 0.2, 0.3]), np.array([1.1, 1.2, 1.3])
    bodies = fk.Mixture([fk.PointMass(headings=one), fk.Lagged(fk.PointMass(headings=two), 0.2)], [1, 0, 1])
    assert bodies.headings.tolist() == [1.1, 0.2, 1.3]
    start = fk.State([[0.0, 0.0], [0.3, 0.9], [0.9, 0.4]], [[0.1, 0.0], [0.0, 0.2], [0.0, 0.0]])
    law = fk.Law(fk.FieldOfView(2.0, 1.0), [fk.Consensus(1.0)])
    run = fk.simulate(fk.Scenario(law, start, 0.1, bodies=bodies, frames=2), progress=False)
    assert (run.links[0] == law.graph.start_links(start.q, bodies.headings)).all()
    assert fk.Mixture([fk.PointMass(), fk.Unicycle(0.1)], [0, 1]).headings is None
