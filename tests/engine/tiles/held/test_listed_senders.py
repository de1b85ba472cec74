"""Numbers of senders beside lists of neighbours; how far ahead samples are fetched changes no bit."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.tiles.engine import ENGINE
from flocking.engine.tiles.held import held_particles, messages
from flocking.engine.tiles.held.listed_senders import take_senders, tiles_ahead
from flocking.engine.tiles.held.news import MOST_FETCHED, older_places
from flocking.engine.tiles.neighbours.neighbour_lists import LINKED, WIDTH, TileLists
from flocking.engine.tiles.options import TilesOptions

STEP = 0.01


def random_lists(tiles: int, places: int) -> TileLists:
    """Lists with some linked entries, and rows between those of the tiles that no tile has."""
    rng = np.random.default_rng(0)
    count = rng.integers(0, 5, tiles).astype(np.int32)
    first = np.concatenate([[0], np.cumsum(count + 2)[:-1]]).astype(np.int64)
    rows = rng.integers(0, places, (int((count + 2).sum()), WIDTH)).astype(np.uint32)
    return TileLists(rows | np.where(rng.random(rows.shape) < 0.3, LINKED, np.uint32(0)), first, count)


def test_senders_are_the_agents_at_the_places_in_the_lists():
    lists = random_lists(20, 400)
    ids = np.random.default_rng(1).permutation(400).astype(np.int32)
    found, used = np.full((2, lists.rows.size), 12345, np.uint32)
    take_senders(0, 20, lists.rows.reshape(-1), lists.first, lists.count, ids, found, used)
    found, used = found.reshape(-1, WIDTH), used.reshape(-1, WIDTH)
    named = np.zeros(len(found), dtype=bool)
    for tile in range(20):
        for row in range(lists.first[tile], lists.first[tile] + lists.count[tile]):
            named[row] = True
            assert found[row].tolist() == [ids[int(entry) % 2**31] for entry in lists.rows[row]]
    assert (found[~named] == 12345).all()
    assert (used[named] == 0).all()
    assert (used[~named] == 12345).all()


def test_the_distance_is_that_of_the_last_neighbours_of_most_tiles():
    tiles, width = 200, 30
    rows = np.minimum(np.arange(tiles)[:, None] * WIDTH + np.arange(WIDTH) + width * WIDTH, tiles * WIDTH - 1)
    rows[0] = tiles * WIDTH - 1  # As in periodic space: a neighbour at the other end.
    lists = TileLists(rows.astype(np.uint32), np.arange(tiles), np.ones(tiles, np.int32))
    assert width <= tiles_ahead(lists, tiles * WIDTH) <= 2 * width
    nobody = TileLists(np.zeros((0, WIDTH), np.uint32), np.zeros(3, np.int64), np.zeros(3, np.int32))
    assert tiles_ahead(nobody, 48) == 1


@pytest.mark.parametrize(
    ("loss", "jitter", "places"),
    [
        (None, 0.0, 0),
        (None, 0.5, 1),
        (None, 2.5, 3),
        (fk.Bernoulli(0.2), 0.0, 2),  # 0.2^2 = 0.04 is more than 1/32, 0.2^3 = 0.008 less.
        (fk.Bernoulli(0.03), 0.0, 0),
        (fk.Bernoulli(0.2), 1.0, 3),
        (fk.Bernoulli(0.9), 3.0, MOST_FETCHED),
        (fk.Bernoulli(1.0), 0.0, MOST_FETCHED),
        (fk.GilbertElliott(0.1, 0.4), 0.0, 2),
    ],
)
def test_older_samples_are_fetched_where_enough_are_used(loss, jitter, places):
    assert older_places(loss, jitter, 1.0) == places


def final_state(n: int, **information):
    """State after twenty steps of agents that are fast enough for their lists to be rebuilt."""
    rng = np.random.default_rng(2)
    start = fk.State(rng.uniform(0, n**0.5, (n, 2)), rng.normal(size=(n, 2)))
    law = fk.Law(fk.Proximity(1.5), [fk.Gradient(fk.Potential("0.5*(r - 1)**2")), fk.Consensus(0.5)])
    sent = fk.Messages(STEP, expires=5 * STEP, delay=0.5 * STEP, **information)
    scenario = fk.Scenario(law, start, t_end=1.0, control=fk.Held(STEP), information=sent)
    session = ENGINE.open(scenario, TilesOptions(step=STEP, threads=1, keep_frames=False, observe=False))
    session.advance(20 * STEP)
    assert session._particles.search.rebuilds > 1
    return np.concatenate([session.state.q, session.state.p])


@pytest.mark.parametrize("ahead", [1, 10**6])
def test_how_far_ahead_samples_are_fetched_changes_no_bit(monkeypatch, ahead):
    information = {"loss": 0.4, "jitter": 1.5 * STEP}
    expected = final_state(300, **information)
    monkeypatch.setattr(held_particles, "tiles_ahead", lambda lists, n: ahead)
    monkeypatch.setattr(messages, "older_places", lambda loss, jitter, period: ahead)
    assert (final_state(300, **information) == expected).all()
