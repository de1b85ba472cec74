from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput


def test_a_state_is_a_read_only_copy():
    q = np.zeros((3, 2))
    state = fk.State(q)
    q[0, 0] = 9
    assert state.q[0, 0] == 0
    assert (state.p == 0).all()
    assert (state.n, state.dimension) == (3, 2)
    with pytest.raises(ValueError, match="read-only"):
        state.q[0, 0] = 1


def test_one_agent_is_a_group():
    law = fk.Law(fk.Proximity(2), [fk.Gradient(fk.Potential("1/r")), fk.Consensus()])
    assert fk.control(law, fk.State([[1.0, 2.0]])).tolist() == [[0, 0]]
    tracked = fk.Law(fk.Proximity(2), [fk.Track(fk.Sink([0, 0]), 1.0, 2.0)])
    assert fk.control(tracked, fk.State([[1.0, 2.0]], [[1.0, 0.0]])).tolist() == [[-3, -2]]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: fk.State(np.zeros((0, 2))), "at least 1 agent"),
        (lambda: fk.State(np.zeros((2, 0))), "at least 1 dimension|at least 1 agent in at least 1"),
        (lambda: fk.State(np.zeros(3)), "q must have 2 axes"),
        (lambda: fk.State([[0, np.nan]]), r"entry \(0, 1\) is not; got nan"),
        (lambda: fk.State([[0, np.inf]]), "must be finite"),
        (lambda: fk.State([[0, "x"]]), "array of numbers"),
        (lambda: fk.State([[0, 1j]]), "array of numbers"),
        (lambda: fk.State([[0, 1], [2]]), "array of numbers"),
        (lambda: fk.State([["0", "1"]]), "array of numbers"),
        (lambda: fk.State(np.array([["0", 1.0]], dtype=object)), "array of numbers"),
        (lambda: fk.State(np.array([["2020-01-01", "2020-01-02"]], dtype="datetime64[D]")), "array of numbers"),
        (lambda: fk.State(np.ma.array([[1.0, 2.0]], mask=[[True, False]])), "no masked entries; got '1 of 2 masked'"),
        (lambda: fk.start.box(2, side="3", seed=0), "side must be an array of numbers"),
        (lambda: fk.State(None), "q must"),
        (lambda: fk.State(np.zeros((3, 2)), np.zeros((2, 2))), r"p must have the shape of q, \(3, 2\)"),
        (lambda: fk.State(np.zeros((3, 2)), np.zeros((3, 3))), "p must have the shape of q"),
        (lambda: fk.State(np.zeros((3, 2)), np.full((3, 2), np.nan)), "p must be finite"),
        (lambda: fk.State(np.zeros((3, 2)), t=np.nan), "t must be finite"),
        (lambda: fk.State(np.zeros((3, 2)), links=np.ones((3, 3))), "links must be"),
        (lambda: fk.State(np.zeros((3, 2)), links=np.zeros((2, 2))), "links must be"),
        (lambda: fk.State(np.zeros((2, 2)), links=[[0.0, 0.5], [1.0, 0.0]]), "links must hold true or false"),
        (lambda: fk.State(np.zeros((2, 2)), links=[[0.0, np.nan], [1.0, 0.0]]), "links must hold true or false"),
        (lambda: fk.State(np.zeros((2, 2)), links=[["", "False"], ["x", ""]]), "links must hold true or false"),
        (lambda: fk.Agents(masses=0), "masses must be greater than 0"),
        (lambda: fk.Agents(masses=[1, -1]), "masses must be greater than 0"),
        (lambda: fk.Agents(damping=-1), "damping must be at least 0"),
        (lambda: fk.Agents(damping=[0, -1]), "for agent 1"),
        (lambda: fk.Agents(order=3), "order must be 1 or 2"),
        (lambda: fk.Agents(order=1, damping=0.5), "damping must be 0 for agents of order 1"),
        (lambda: fk.Agents(order=1, damping=[0.0, 0.5]), "damping must be 0 for agents of order 1"),
        (lambda: fk.Agents(masses=np.nan), "masses must be finite"),
        (lambda: fk.Agents(headings=np.zeros((2, 2))), "headings must have shape"),
        (lambda: fk.Agents(masses=["1", "2"]), "array of numbers"),
        (lambda: fk.Agents(masses=np.complex128(1 + 2j)), "masses must be a number"),
        (lambda: fk.Agents(masses=np.True_), "masses must be a number"),
        (lambda: fk.Agents(masses=np.array("3")), "masses must be a number"),
        (lambda: fk.Agents(masses=[1, 2]).check_count(3), "one value for each of the 3 agents"),
    ],
)
def test_bad_input_is_explained(make, words):
    with pytest.raises(InvalidInput, match=words):
        make()


def test_a_link_of_an_agent_to_itself_is_named_and_no_shape():
    with pytest.raises(fk.InvalidInput, match="got 'a link of agent 1 to itself'"):
        fk.State([[0.0, 0.0], [1.0, 0.0]], links=[[False, True], [True, True]])
    with pytest.raises(fk.InvalidInput, match=r"got 'shape \(3, 3\)'"):
        fk.State([[0.0, 0.0], [1.0, 0.0]], links=np.zeros((3, 3), dtype=bool))


@pytest.mark.parametrize("extent", [1e155, 1e300])
def test_a_group_whose_distances_are_too_large_for_squares_is_refused(extent):
    """Its agents would have no force on each other."""
    law = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("k*r", k=1.0))])
    state = fk.State([[0.0, 0.0], [extent, -extent]])
    with pytest.raises(InvalidInput, match="control: state must have places that differ by at most 1e"):
        fk.control(law, state)
    with pytest.raises(InvalidInput, match="Scenario: start must have places that differ by at most 1e"):
        fk.Scenario(law, state, t_end=1.0)


@pytest.mark.parametrize("extent", [1e-163, 1e-300])
def test_a_group_whose_distances_have_no_squares_is_refused(extent):
    """Its agents would count as one point, and a force of 1 between them as 0."""
    law = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("k*r", k=1.0))])
    state = fk.State([[0.0, 0.0], [extent, 0.0]])
    with pytest.raises(InvalidInput, match="control: state must have places that differ by more than 1e-140"):
        fk.control(law, state)
    with pytest.raises(InvalidInput, match="Scenario: start must have places that differ by more than 1e-140"):
        fk.Scenario(law, state, t_end=1.0)
    assert fk.control(law, fk.State([[0.0, 0.0], [1e-138, 0.0]]))[0].tolist() == [1.0, 0.0]
    assert fk.control(law, fk.State([[0.0, 0.0], [0.0, 0.0]])).tolist() == [[0.0, 0.0], [0.0, 0.0]]
