from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.study.potentials.nonsmooth import (
    directional_derivative,
    energy_rates,
    filippov_corners,
    generalized_derivative,
    generalized_gradient,
    is_regular,
    one_sided_slopes,
    pairs_at_switch,
)

UP = fk.Potential("where(r < 1, r, 2*r - 1)")
DOWN = fk.Potential("where(r < 1, 2*r, r + 1)")
SMOOTH = fk.Potential("r**2 + 1/r")
TANNER = fk.Potential("1/r**2 + log(r**2)")


@pytest.mark.parametrize(("psi", "slopes"), [(UP, (1, 2)), (DOWN, (2, 1)), (SMOOTH, (1, 1))])
def test_one_sided_slopes(psi, slopes) -> None:
    np.testing.assert_allclose(one_sided_slopes(psi, 1.0), slopes, rtol=1e-7)


@pytest.mark.parametrize("psi", [UP, DOWN, SMOOTH])
@pytest.mark.parametrize("w", [-2.0, -0.5, 0.7, 3.0])
def test_derivatives_agree_with_their_definitions(psi, w) -> None:
    t = np.array([1e-7, 3e-7, 1e-6])
    usual = float(((psi(1 + t * w) - psi(1.0)) / t)[0])
    assert directional_derivative(psi, 1.0, w) == pytest.approx(usual, rel=1e-5)
    around = 1 + np.linspace(-1e-5, 1e-5, 401)[:, None]
    largest = float(np.max((psi(around + t * w) - psi(around)) / t))
    assert generalized_derivative(psi, 1.0, w) == pytest.approx(largest, rel=1e-4)


def test_a_kink_that_rises_is_regular_and_one_that_falls_is_not() -> None:
    assert is_regular(UP, 1.0)
    assert is_regular(SMOOTH, 1.0)
    assert not is_regular(DOWN, 1.0)
    assert not is_regular(TANNER.capped(2.0), 2.0)
    assert is_regular(TANNER.capped(2.0), 1.7)


def test_the_gradient_at_the_radius_of_tanner_is_an_interval() -> None:
    low, high = generalized_gradient(TANNER.capped(2.0), 2.0)
    assert low == pytest.approx(0.0, abs=1e-8)
    assert high == pytest.approx(0.75, rel=1e-8)


def pair(speed: float) -> fk.State:
    return fk.State([[0.0, 0.0], [2.0, 0.0], [0.4, 1.1]], [[0.0, 0.3], [speed, 0.0], [0.1, 0.1]])


LAW = fk.Law(fk.Proximity(2.0), [fk.Gradient(TANNER), fk.Consensus(1.0)])


def test_filippov_corners_are_the_controls_of_both_sides() -> None:
    state = pair(0.4)
    assert pairs_at_switch(LAW, state) == [(0, 1)]
    corners = filippov_corners(LAW, state)
    for outward, corner in ((1e-9, corners[0]), (-1e-9, corners[1])):
        q = state.q + outward * np.array([[-1.0, 0], [1, 0], [0, 0]])
        np.testing.assert_allclose(fk.control(LAW, fk.State(q, state.p)), corner, rtol=1e-6)
    assert filippov_corners(LAW, fk.State(state.q * 0.99, state.p)).shape == (1, 3, 2)


@pytest.mark.parametrize("speed", [-0.8, -0.3, 0.0, 0.2, 0.9])
def test_rates_are_the_intersection_over_the_gradient(speed) -> None:
    rates = energy_rates(LAW, TANNER.capped(2.0), state := pair(speed))
    p, slope = state.p, 0.75
    closing = p[1, 0] - p[0, 0]
    apart = float((p[0] - p[2]) @ (p[0] - p[2]) + (p[1] - p[2]) @ (p[1] - p[2]))
    joined = apart + float((p[0] - p[1]) @ (p[0] - p[1]))
    shares = np.linspace(0, 1, 401)
    # Rate for the gradient zeta slope and the control that weighs the linked side by the share.
    table = [
        [(zeta - share) * slope * closing - apart - share * (joined - apart) for share in shares] for zeta in shares
    ]
    assert rates.low == pytest.approx(np.max(np.min(table, axis=1)), abs=1e-7)
    assert rates.high == pytest.approx(np.min(np.max(table, axis=1)), abs=1e-7)
    assert rates.high <= 1e-12
    assert rates.empty == (np.max(np.min(table, axis=1)) > np.min(np.max(table, axis=1)) + 1e-9)


@pytest.mark.parametrize("speed", [0.5, 0.0])
def test_rates_of_parting_pairs_are_the_laplacian_forms_of_both_sides(speed) -> None:
    state = pair(speed)
    rates = energy_rates(LAW, TANNER.capped(2.0), state)
    p = state.p

    def form(edges):
        return -sum(float((p[i] - p[j]) @ (p[i] - p[j])) for i, j in edges)

    both = [form([(0, 2), (1, 2)]), form([(0, 1), (0, 2), (1, 2)])]
    assert rates.low == pytest.approx(min(both), abs=1e-7)
    assert rates.high == pytest.approx(max(both), abs=1e-7)
    assert rates.high <= 0


def test_rates_of_a_state_off_the_surface_are_one_number() -> None:
    state = fk.State(pair(0.3).q * 0.97, pair(0.3).p)
    rates = energy_rates(LAW, TANNER.capped(2.0), state)
    dissipated = fk.evaluate(LAW, state).dissipation
    assert rates.low == pytest.approx(-dissipated, rel=1e-7)
    assert rates.high == pytest.approx(-dissipated, rel=1e-7)


def test_too_many_pairs_on_the_surface_are_refused() -> None:
    circle = np.stack([np.cos(np.arange(6) * np.pi / 3), np.sin(np.arange(6) * np.pi / 3)], axis=1) * 2.0
    q = np.concatenate([np.zeros((1, 2)), circle, circle * 2])
    with pytest.raises(fk.InvalidInput, match="at most 12 pairs"):
        filippov_corners(fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)]), fk.State(q))


@pytest.mark.parametrize("unit", [1e-20, 1e-9, 1.0, 1e12])
@pytest.mark.parametrize("length", [1e-4, 1.0, 1e5])
def test_regularity_does_not_depend_on_units(unit, length) -> None:
    psi = fk.Potential("E*((d/r)**2 + log((r/d)**2))", E=unit, d=length)
    assert not is_regular(psi.capped(2 * length), 2 * length)
    assert is_regular(psi, length), "both slopes vanish at the minimum"
    assert is_regular(psi, 2 * length)
    rising = fk.Potential("E*where(r < d, r/d, 2*r/d - 1)", E=unit, d=length)
    falling = fk.Potential("E*where(r < d, 2*r/d, r/d + 1)", E=unit, d=length)
    assert is_regular(rising, length)
    assert not is_regular(falling, length)


def test_fixed_graphs_have_no_switching_surface() -> None:
    q = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.3]]
    law = fk.Law(fk.Fixed(3, [(0, 1)]), [fk.Gradient(TANNER)])
    assert pairs_at_switch(law, fk.State(q)) == []
    assert filippov_corners(law, fk.State(q)).shape == (1, 3, 2)


def test_links_of_hysteresis_switch_each_at_its_own_radius() -> None:
    law = fk.Law(fk.Hysteresis(4.0, 0.1), [fk.Gradient(fk.Potential("(r - 1)**2"))])
    none, both = np.zeros((2, 2), dtype=bool), ~np.eye(2, dtype=bool)
    for distance, links, expected in (
        (3.9, none, [(0, 1)]), (3.9, both, []), (4.0, none, []), (4.0, both, [(0, 1)]), (4.0, None, [(0, 1)]),
        (3.9, None, []),
    ):  # fmt: skip
        state = fk.State([[0.0, 0.0], [distance, 0.0]], links=links)
        assert pairs_at_switch(law, state) == expected, (distance, links)
        corners = filippov_corners(law, state)
        assert len(corners) == 1 + len(expected)
        if expected:
            np.testing.assert_allclose(sorted(corners[:, 0, 0]), [0.0, 2 * (distance - 1)], rtol=1e-12)


def test_one_way_links_switch_alone() -> None:
    law = fk.Law(fk.PerAgentRadii([1.0, 2.0]), [fk.Consensus(1.0)])
    for distance, pair_ in ((1.0, (0, 1)), (2.0, (1, 0))):
        state = fk.State([[0.0, 0.0], [distance, 0.0]], [[0.0, 0.0], [1.0, 0.0]])
        assert pairs_at_switch(law, state) == [pair_]
        beside = [fk.control(law, fk.State(state.q * s, state.p)) for s in (1 + 1e-6, 1 - 1e-6)]
        np.testing.assert_allclose(filippov_corners(law, state), beside)


def test_graphs_whose_surfaces_are_not_distances_alone_are_refused() -> None:
    state = fk.State([[0.0, 0.0], [2.0, 0.0]], links=~np.eye(2, dtype=bool))
    with pytest.raises(fk.InvalidInput, match="distances alone"):
        pairs_at_switch(fk.Law(fk.FieldOfView(2.0, 1.0), [fk.Consensus(1.0)]), state)
    two = fk.Law(fk.Proximity(3.0), [fk.Gradient(TANNER), fk.Consensus(1.0, over=fk.Proximity(2.0))])
    with pytest.raises(fk.InvalidInput, match="further graph"):
        filippov_corners(two, state)
    kinked = fk.Law(fk.Proximity(3.0), [fk.Gradient(DOWN)])
    with pytest.raises(fk.InvalidInput, match="kink"):
        filippov_corners(kinked, fk.State([[0.0, 0.0], [1.0, 0.0]]))


def test_rates_where_kinks_of_the_energy_are_not_the_radius_of_the_law() -> None:
    """Two agents that part at speed w; the energy is a matter of the potential, the control one of the law."""
    law = fk.Law(fk.Proximity(3.0), [fk.Consensus(1.0)])
    state = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.5, 0.0]])
    rates = energy_rates(law, DOWN, state)
    # The slope is anything from 1 to 2, the linked pair dissipates w^2: no rate is that of all slopes.
    assert rates.low == pytest.approx(2 * 0.5 - 0.25, abs=1e-6)
    assert rates.high == pytest.approx(1 * 0.5 - 0.25, abs=1e-6)
    assert rates.empty
    far = fk.State([[0.0, 0.0], [3.0, 0.0]], state.p)
    rates = energy_rates(law, DOWN, far)
    assert (rates.low, rates.high) == pytest.approx((0.5 - 0.25, 0.5), abs=1e-6)
    with pytest.raises(fk.InvalidInput, match="different places"):
        energy_rates(law, DOWN, fk.State([[0.0, 0.0], [0.0, 0.0]]))
