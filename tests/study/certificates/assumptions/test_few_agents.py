"""Groups of one or two agents, and groups without a link: nothing empty is granted, and no number is lost."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import flocking as fk
from flocking.study.certificates.comparison import compare

POLE = fk.Potential("1/r + r**2")
OF_PAIRS = ("closest_approach", "simultaneous_collisions", "longest_link", "links_kept", "group_diameter")


def _scenario(graph, q, p, **fields):
    return fk.Scenario(fk.Law(graph, [fk.Gradient(POLE), fk.Consensus(1.0)]), fk.State(q, p), t_end=1.0, **fields)


@pytest.mark.parametrize(
    "graph", [fk.Complete(), fk.Fixed(1, ()), fk.Proximity(4.0), fk.Hysteresis(radius=4.0, gap=0.1)], ids=str
)
def test_of_one_agent_nothing_is_said_about_pairs(graph):
    limited = fk.Limited(fk.PointMass(), force=1.0)
    found = fk.certify(_scenario(graph, [[0.0, 0.0]], [[1.0, 0.0]], bodies=limited))
    for key in (*OF_PAIRS, "braking_suffices"):
        assert found[key].outcome == "not applicable", key
        assert found[key].reason == "there is one agent alone"
    for each in found:
        assert "pairs" not in each.statement
        if "two agents or more" in each.reason:
            assert "one agent" in each.reason
    assert found["stopping_distance"].granted


def test_a_filter_of_one_agent_keeps_no_distance():
    control = fk.SafetyFilter(0.1, distance=0.5, acceleration=4.0, form="stopping")
    found = fk.certify(_scenario(fk.Complete(), [[0.0, 0.0]], [[1.0, 0.0]], control=control))
    assert found["safe_distance"].outcome == "not applicable"


def test_of_fixed_links_that_are_none_nothing_is_said():
    found = fk.certify(_scenario(fk.Fixed(2, ()), [[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [0.0, 0.0]]))
    for key in OF_PAIRS[:-1]:
        assert found[key].reason == "links are fixed, and there is none"
    assert not found["group_diameter"].granted


@pytest.mark.parametrize("energy", [0.0, 1e-9, 1e-3, 0.02])
def test_two_agents_of_little_energy_are_far_from_contact(energy):
    """At rest at the smallest distance that the energy allows: the bound is that distance, or just below it."""
    least = 0.5 ** (1 / 3)
    floor = 1.0 / least + least**2
    nearest = least if energy == 0.0 else brentq(lambda r: 1.0 / r + r * r - floor - energy, 0.1, least)
    found = fk.certify(_scenario(fk.Complete(), [[0.0, 0.0], [nearest, 0.0]], np.zeros((2, 2))))
    bound = found["closest_approach"].safe_bound
    assert nearest - 1e-7 < bound <= nearest * (1.0 + 1e-15)


def test_a_speed_of_rounding_is_no_speed():
    """The mean of these velocities is exactly zero: the statement gives no number as the speed."""
    found = fk.certify(_scenario(fk.Proximity(3.0), [[0.0, 0.0], [10.0, 0.0]], [[0.0, 1.0], [0.0, -1.0]]))
    assert "with a speed of at most" in found["steady_drift"].statement
    moving = fk.certify(_scenario(fk.Proximity(3.0), [[0.0, 0.0], [10.0, 0.0]], [[0.5, 0.0], [0.5, 0.0]]))
    assert moving["steady_drift"].statement.endswith("with the speed 0.5.")


def test_an_excess_of_energy_is_not_seen_as_negative():
    scenario = _scenario(fk.Proximity(3.0), [[0.0, 0.0]], [[0.3, 0.4]])
    rows = {row.key: row for row in compare(fk.certify(scenario), fk.simulate(scenario, progress=False))}
    assert rows["largest_energy"].observed == 0.0


def test_what_is_against_the_stopping_distance_is_named():
    scenario = _scenario(fk.Complete(), [[0.0, 0.0], [1.0, 0.0]], np.zeros((2, 2)))
    for body, words in (
        (fk.Limited(fk.PointMass(damping=0.2), force=1.0), "they are damped"),
        (fk.Limited(fk.PointMass(), force=1.0, shape="box"), "it is one of each axis"),
    ):
        found = fk.certify(scenario.with_(bodies=body))["stopping_distance"]
        assert found.outcome == "not applicable"
        assert found.reason.endswith(words)


def test_a_space_that_repeats_is_named():
    scenario = _scenario(fk.Proximity(3.0), [[0.0, 0.0], [1.0, 0.0]], np.zeros((2, 2)), space=fk.Periodic([9.0, 9.0]))
    assert fk.certify(scenario)["decay_rate"].reason.endswith("open space: space repeats")
