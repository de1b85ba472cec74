"""A force that is no number, or one from beyond a pole, is refused by name."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput
from flocking.model.potentials.poles import poles

ZHOU = fk.Potential("1/r + 1/(R - r)", R=4.0)


def law(graph=None, psi=ZHOU):
    return fk.Law(graph or fk.Hysteresis(4.0, 0.5), [fk.Gradient(psi), fk.Consensus(1.0)])


def alone(distance, given=None):
    agent, neighbour = fk.Agent([1.0, 2], [0, 0], 3), fk.Agent([1.0 + distance, 2], [1, 0], 5)
    return fk.control_of(given or law(), agent, [neighbour])


@pytest.mark.parametrize(
    ("distance", "given", "words"),
    [
        (0.0, None, "agents 3 and 5 at distance 0.*same point"),
        (4.0, None, "agents 3 and 5 at distance 4.*infinite at distance 4"),
        (5.0, None, "agents 3 and 5 at distance 5.*infinite at distance 4"),
        (5.0, law(fk.Fixed.complete(6)), "infinite at distance 4"),
        (5.0, law(fk.Proximity(3.0)), "infinite at distance 4"),
        (3.5, law(psi=fk.Potential("-log(1 - (r/R)^2)", R=3.0)), "at distance 3.5.*no finite value"),
        (4.0, law(fk.Proximity(3.0), fk.Potential("1/(r^3 - 27)")), "infinite at distance 3"),
    ],
)
def test_neighbours_without_a_force_are_named(distance, given, words):
    with pytest.raises(InvalidInput, match=f"control_of: neighbours must be .*{words}"):
        alone(distance, given)


def test_a_group_with_an_infinite_force_is_told_which_agents():
    linked = np.array([[False, True], [True, False]])
    for distance in (0.0, 4.0):
        with pytest.raises(InvalidInput, match=f"control: neighbours .*agents 0 and 1 at distance {distance:g}"):
            fk.control(law(), fk.State([[0.0, 0], [distance, 0]], links=linked))


def test_what_lies_on_the_right_side_has_its_force():
    for r in (1e-3, 1.0, 3.999):
        assert alone(r)[0] == pytest.approx(-1 / r**2 + 1 / (4 - r) ** 2 + 1.0)
    outside = law(fk.Proximity(4.0), fk.Potential("1/(r - 2)^2"))
    assert alone(3.0, outside)[0] == pytest.approx(-1.0)
    assert alone(0.0, law(psi=fk.Potential("(r - 1)^2")))[0] == 1.0


@pytest.mark.parametrize(
    ("formula", "expected"),
    [
        ("1/r + 1/(4 - r)", (4.0,)), ("1/r", ()), ("(r - 1)^2/2", ()), ("sqrt(4 - r)", ()), ("1/(1 + r^2)", ()),
        ("where(r < 4, 1/r + 1/(4 - r), 0)", (4.0,)), ("where(r < 2.5, (r - 1)^2, 1/(r - 2))", ()),
        ("1/(r - 3)^2", (3.0,)), ("log(4 - r)", (4.0,)), ("1/((r - 1)*(r - 2))", (1.0, 2.0)),
        ("exp(1/(4 - r))", (4.0,)),
    ],
)  # fmt: skip
def test_poles_are_read_from_the_formula(formula, expected):
    assert poles(fk.Potential(formula)) == expected


def test_rates_of_limited_forces_are_found_without_a_warning():
    """Numbers of the branch that is not chosen overflow; a test turns what the library warns of into an error."""
    body = fk.Limited(fk.Lagged(fk.PointMass(), 0.2), force=8.0, rate=200.0)
    state = fk.State([[0.0, 0.0], [1.0, 0.3]], [[1.0, 0.0], [0.0, 1.0]], columns={"applied": [[1.0, 2.0], [0.0, 1.0]]})
    psi = fk.Potential("k*(r - 2)**2/2", k=50.0)
    found = fk.evaluate(fk.Law(fk.Complete(), [fk.Gradient(psi)]), state, agents=body)
    away = 2.0 - np.hypot(1.0, 0.3)
    np.testing.assert_allclose(np.linalg.norm(found.u, axis=1), 50.0 * away)
