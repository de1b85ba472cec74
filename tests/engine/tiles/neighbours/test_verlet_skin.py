"""The lengths of lists that the choice of a skin counts on."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from flocking.engine.fixed_step.threads import Workers
from flocking.engine.tiles.neighbours import verlet_skin as skins
from flocking.engine.tiles.neighbours.cell_list import Sorter


def sorted_agents(n, dimension, side, reach=1.5):
    rng = np.random.default_rng(dimension)
    agents = np.concatenate([rng.random((n, dimension)) * side, rng.normal(size=(n, dimension))], axis=1)
    sorter = Sorter(n, Workers(2))
    sorter.sort(agents, sorter.survey(agents), reach)
    return agents, sorter


@pytest.mark.parametrize(("dimension", "side"), [(2, 40.0), (2, 3.0), (3, 9.0)])
def test_counted_lengths_are_those_of_the_lists(monkeypatch, dimension, side):
    """Against a k-d tree; the small box has fewer cells along an axis than the sample looks at."""
    agents, sorter = sorted_agents(1000 if side > 5 else 150, dimension, side)
    monkeypatch.setattr(skins, "SAMPLE", 10**6)
    limits = 1.2 * (1 + np.array(skins.SKIN_SHARES[:10]))
    found = skins._lengths(agents, sorter, limits)
    q = agents[sorter.order, :dimension]
    for limit, rows in zip(limits, found, strict=True):
        many = np.array([len(near) - 1 for near in cKDTree(q).query_ball_point(q, limit * (1 - 1e-12))])
        expected = np.pad(many, (0, -len(many) % 16)).reshape(-1, 16).max(axis=1).mean()
        assert rows == pytest.approx(expected, rel=1e-12)


def test_fast_agents_get_wide_skins():
    agents, sorter = sorted_agents(2000, 2, 60.0)
    chosen = [skins.best_skin(agents, sorter, 1.2, stride) for stride in (1e-5, 1e-3, 1e-2, 1e-1)]
    assert chosen == sorted(chosen)
    assert chosen[0] < chosen[-1]


def test_the_skin_is_narrower_the_more_a_step_does_with_the_lists():
    """With k passes to a step the skin is that of steps of a k-th of the length, which are k times as many."""
    agents, sorter = sorted_agents(2000, 2, 60.0)
    chosen = [skins.best_skin(agents, sorter, 1.2, 1e-2, passes=passes) for passes in (1.0, 2.0, 5.0, 20.0)]
    assert chosen == sorted(chosen, reverse=True)
    assert chosen[-1] < chosen[0]
    for passes, skin in zip((2.0, 5.0, 20.0), chosen[1:], strict=True):
        assert skin == skins.best_skin(agents, sorter, 1.2, 1e-2 / passes)


def test_a_lattice_gets_a_skin_up_to_its_next_shell():
    x, y = np.meshgrid(np.arange(60.0), np.arange(60.0))
    agents = np.stack([x.ravel(), y.ravel(), 0 * x.ravel(), 0 * x.ravel()], axis=1)
    sorter = Sorter(3600, Workers(1))
    sorter.sort(agents, sorter.survey(agents), 1.4)
    # Neighbours at 1, then at 1.414.
    chosen = 1.1 + skins.best_skin(agents, sorter, 1.1, 1e-3)
    assert 1.3 < chosen < 1.4142
