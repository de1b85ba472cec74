"""What a reader of the papers needs is reachable from ``flocking`` or from the paper's package, and documented."""

from __future__ import annotations

import inspect
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

import flocking as fk
from flocking.papers import ALL_KEYS, paper

GIVEN = {
    "olfati-saber-2003": ("translational_energy", "gathering_energy", "contraction", "contraction_rate"),
    "tanner-2003-fixed": ("potential", "longest_path"),
    "tanner-2003-dynamic": ("potential", "inner_potential", "boundary_value", "energy"),
    "zhou-2015": ("potential", "largest_energy", "most_new_links"),
    "shi-2009": (
        "potential", "centre_motion", "steady_velocity_error", "free_motion", "ramp_motion", "exponential_motion",
        "exponential_leading_part", "jordan_form", "speed_bounds", "distance_bound",
    ),
    "olfati-saber-2006": (
        "action", "bump", "centre_motion", "metrics", "most_collisions", "obstacle_action", "pair_potential",
        "potential", "repulsion", "sigma_norm", "structural_energy", "uneven_sigmoid",
    ),
    "cucker-smale-2007": (
        "weights", "discrete_step", "discrete_motion", "scatter", "sufficient_condition", "pair_invariant",
        "final_distance", "final_speed", "delay_limits",
    ),
    "vicsek-1995": ("mean_directions", "deviations", "order_series", "random_order", "binder_cumulant",
                    "order_values", "measured_fluctuations", "stored_study"),
    "reynolds-1987": ("boid_force", "bird_force", "next_state", "observed"),
    "vasarhelyi-2018": (
        "braking_speed", "braking_distance", "cluster_radius", "error_variances", "lone_speeds", "next_state",
        "observed", "order_parameters",
    ),
}  # fmt: skip


@pytest.mark.parametrize("key", ALL_KEYS)
def test_a_paper_gives_its_functions_with_documentation(key: str) -> None:
    package = getattr(fk.papers, key.replace("-", "_"))
    assert package.PAPER is paper(key)
    for name in GIVEN[key]:
        assert name in package.__all__, name
        function = getattr(package, name)
        assert getattr(paper(key), name) is function
        text = inspect.getdoc(function) or ""
        assert text.split("\n")[0].endswith("."), name
        assert all(parameter in text for parameter in inspect.signature(function).parameters if parameter != "n"), name


def test_energies_of_a_state_are_those_of_the_papers() -> None:
    # Tanner II: two linked agents and one out of reach.
    tanner = fk.papers.tanner_2003_dynamic
    law = fk.Law(fk.Proximity(2.0), (fk.Gradient(tanner.inner_potential()), fk.Consensus()))
    state = fk.State([[0.0, 0.0], [1.5, 0.0], [9.0, 0.0]], [[1.0, 0.0], [0.0, 2.0], [0.0, 0.0]])
    linked, away = 1 / 1.5**2 + math.log(1.5**2), 1 / 4 + math.log(4)
    assert_allclose(tanner.boundary_value(), away, rtol=1e-12)
    assert_allclose(
        fk.agent_energies(law, state, tanner.energy()), [linked + away, linked + away, 2 * away], rtol=1e-12
    )
    assert_allclose(fk.total_energy(law, state, tanner.energy()), linked + 2 * away + (1 + 4) / 2, rtol=1e-12)


def test_largest_energy_is_that_of_the_start_and_of_every_link_still_to_come() -> None:
    zhou = fk.papers.zhou_2015
    assert zhou.most_new_links(10) == 36
    found = zhou.largest_energy(100.0, 10, zhou.potential(), 3.9)
    assert_allclose(found, 100.0 + 36 * (1 / 3.9 + 1 / 0.1), rtol=1e-12)


def test_closed_forms_take_any_gains() -> None:
    shi = fk.papers.shi_2009
    t = np.linspace(0.0, 60.0, 601)
    _, velocity = shi.centre_motion(15, t, [0.4, -0.3], [1.0, 2.0], h0=0.6, r0=2.5)
    error = np.linalg.norm(velocity[-1] - [math.sin(60.0), math.cos(60.0)])
    assert_allclose(error, shi.steady_velocity_error(15, 0.6, 2.5), rtol=1e-6)
    assert_allclose(error, 1 / math.hypot(1.5, 0.6), rtol=1e-6)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: fk.papers.shi_2009.centre_motion(9, [0.0], [0, 0], [0, 0]), "law: must be 8, 12 or 15"),
        (lambda: fk.papers.shi_2009.centre_motion(8, 0.0, [0, 0], [0, 0]), "centre_motion: t"),
        (lambda: fk.papers.shi_2009.centre_motion(8, [0.0], [0, 0], [0]), "v_start: must have as many components"),
        (lambda: fk.papers.shi_2009.centre_motion(8, [0.0], [0.0], [0.0]), "x_start: must be a point of the plane"),
        (lambda: fk.papers.shi_2009.free_motion(-1.0, 0.0, [0.0], [0.0], [0.0]), "free_motion: h0"),
        (lambda: fk.papers.shi_2009.steady_velocity_error(12, h0=float("nan")), "steady_velocity_error: h0"),
        (lambda: fk.papers.shi_2009.speed_bounds(-1.0, [1.0]), "speed_bounds: energy"),
        (lambda: fk.papers.shi_2009.potential(1.0, 0.2, 2.0), "potential: b: must be above a/e|b must be above a/e"),
        (lambda: fk.papers.shi_2009.potential(1.0, 4.0, 1.5), "must be above sqrt"),
        (lambda: fk.papers.zhou_2015.most_new_links(0), "most_new_links: n"),
        (lambda: fk.papers.zhou_2015.largest_energy(1.0, 3, fk.Potential("r"), 0.0), "largest_energy: appear_radius"),
        (lambda: fk.papers.tanner_2003_dynamic.boundary_value(0.0), "boundary_value: radius"),
    ],
)  # fmt: skip
def test_what_they_cannot_take_is_named(call, words) -> None:
    with pytest.raises(fk.InvalidInput) as found:
        call()
    assert any(part in str(found.value).replace(": must", " must") for part in
               (w.replace(": must", " must") for w in words.split("|"))), str(found.value)  # fmt: skip
