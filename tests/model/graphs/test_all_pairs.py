"""The complete graph without a list of pairs gives the motion of the one with such a list, in every engine."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import flocking as fk

TERMS = (fk.Gradient(fk.Potential("1/r + r**2/4")), fk.CuckerSmale(0.4, 0.8, 0.5), fk.Consensus(0.1))


def scenario(graph: fk.Graph, n: int = 7, **rest: object) -> fk.Scenario:
    begin = fk.start.ball(n, radius=2.0, speed=1.0, seed=4)
    return fk.Scenario(fk.Law(graph, TERMS), begin, t_end=1.0, frames=5, **rest)


@pytest.mark.parametrize(
    "world",
    [
        {},
        {"information": fk.Delayed(0.2)},
        {"control": fk.Held(0.1), "information": fk.Messages(0.1, delay=0.02, loss=0.2, seed=1)},
    ],
    ids=["ideal", "late", "messages"],
)
def test_the_run_is_that_of_the_listed_pairs(world) -> None:
    found, listed = (
        fk.simulate(scenario(graph, **world), progress=False) for graph in (fk.Complete(), fk.Fixed.complete(7))
    )
    assert_array_equal(found.q, listed.q)
    assert_array_equal(found.p, listed.p)
    assert_array_equal(found.links, listed.links)
    assert len(found.switches) == 0


def test_it_fits_any_number_of_agents_and_links_all_pairs() -> None:
    for n in (1, 2, 30):
        links = fk.Complete().initial(np.zeros((n, 2)))
        assert links.sum() == n * (n - 1)
        assert not links.diagonal().any()
    assert fk.Complete() == fk.Complete()
    assert not fk.Complete().moves


def test_images_of_a_periodic_space_are_refused() -> None:
    with pytest.raises(fk.InvalidInput, match="Complete"):
        scenario(fk.Complete(), space=fk.Periodic([9.0, 9.0]))


def test_agents_at_one_point_are_named_where_the_force_is_infinite() -> None:
    law = fk.Law(fk.Complete(), TERMS[:1])
    with pytest.raises(fk.InvalidInput, match="0 and 2"):
        fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]]), t_end=1.0)


def test_pair_styles_of_lammps_refuse_it_by_name() -> None:
    with pytest.raises(fk.FlockingError, match=r"Complete|LAMMPS"):
        fk.simulate(scenario(fk.Complete()), engine="lammps", forces="pair styles", progress=False)


def test_certificates_know_its_pairs() -> None:
    found, listed = (fk.certify(scenario(graph)) for graph in (fk.Complete(), fk.Fixed.complete(7)))
    for one, other in zip(found, listed, strict=True):
        assert (one.key, one.outcome) == (other.key, other.outcome)
    linear = fk.Law(fk.Complete(), [fk.Consensus(0.5)])
    rate = fk.certify(fk.Scenario(linear, scenario(fk.Complete()).start, t_end=1.0))["decay_rate"].bound
    assert_allclose([rate.lo, rate.hi], 3.5, rtol=1e-12)
