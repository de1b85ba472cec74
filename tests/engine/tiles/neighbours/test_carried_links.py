"""Links that lists carry over when they are built anew: those of before, by the numbers of the agents."""

from __future__ import annotations

import numpy as np
import pytest

from flocking.engine.fixed_step.threads import Workers
from flocking.engine.tiles.neighbours.cell_list import Sorter
from flocking.engine.tiles.neighbours.neighbour_lists import LINKED, NUMBER, WIDTH, ListBuilder, Listed, TileLists


def pairs_of(lists: TileLists, ids, n):
    """Numbers of the listed pairs, and of the linked ones."""
    listed, linked = set(), set()
    for tile in range(len(lists.count)):
        for row in lists.rows[lists.first[tile] : lists.first[tile] + lists.count[tile]]:
            for lane, entry in enumerate(row):
                i, j = tile * WIDTH + lane, int(entry & NUMBER)
                if i < n and i != j:
                    listed.add((int(ids[i]), int(ids[j])))
                    if entry & LINKED:
                        linked.add((int(ids[i]), int(ids[j])))
    return listed, linked


class Group:
    """Agents that are sorted and listed again and again."""

    def __init__(self, q, workers):
        self.n, m = q.shape
        size = -(-self.n // WIDTH) * WIDTH
        self.sorter, self.ids = Sorter(self.n, workers), np.arange(size, dtype=np.int32)
        self.agents = np.zeros((size, 2 * m))
        self.agents[: self.n, :m] = q
        self.builder = ListBuilder(self.n, 1e9, workers, np.zeros(0))
        self.lists = None

    def build(self, reach):
        """Build the lists; returns the linked pair that is missing, by numbers, or None."""
        m = self.agents.shape[1] // 2
        self.sorter.sort(self.agents, self.sorter.survey(self.agents), reach)
        target, ids = np.zeros_like(self.agents), np.zeros_like(self.ids)
        place = self.sorter.arrange(self.agents, self.ids, target, ids, np.zeros((len(ids), m)))
        # Pads stand where the last agent stands.
        target[self.n :], self.agents, self.ids = target[self.n - 1], target, ids
        self.lists, lost = self.builder.build(
            self.agents, Listed(reach, np.zeros(1) + reach), self.sorter.grid, self.sorter.start, self.lists,
            self.sorter.order, place, None, True,
        )  # fmt: skip
        return None if lost is None else (int(self.ids[lost[0]]), int(self.ids[lost[1]]))

    def link(self, chosen):
        """Set the link bits of some pairs, by numbers."""
        place = np.argsort(self.ids[: self.n])
        for i, j in chosen:
            tile, lane = divmod(int(place[i]), WIDTH)
            rows = self.lists.rows[self.lists.first[tile] : self.lists.first[tile] + self.lists.count[tile]]
            rows[rows[:, lane] == place[j], lane] |= LINKED


@pytest.mark.parametrize(("n", "m", "threads"), [(5, 2, 1), (37, 2, 1), (300, 2, 1), (2500, 2, 2), (400, 3, 1)])
def test_links_are_those_of_before(n, m, threads):
    rng = np.random.default_rng(n)
    side = (n / 3.0) ** (1.0 / m)
    group = Group(rng.uniform(0, side, (n, m)), Workers(threads))
    assert group.build(1.5) is None
    listed, linked = pairs_of(group.lists, group.ids, n)
    assert not linked
    # One of each two directions of a pair, and few or many to an agent.
    chosen = {pair for pair in sorted(listed) if rng.random() < 0.6}
    group.link(chosen)
    assert pairs_of(group.lists, group.ids, n)[1] == chosen
    for _ in range(3):
        group.agents[:n, :m] += rng.uniform(-0.1, 0.1, (n, m))
        lost = group.build(1.5)
        listed, linked = pairs_of(group.lists, group.ids, n)
        assert linked == chosen & listed
        missing = chosen - listed
        assert (lost in missing) if missing else lost is None
        chosen = linked


def test_a_link_to_the_other_end_of_a_crowd_is_carried():
    # All in one place: the lists have far more rows than a tile has agents.
    rng = np.random.default_rng(0)
    n = 150
    group = Group(rng.uniform(0, 1, (n, 2)), Workers(1))
    group.build(3.0)
    chosen = {(0, 149), (149, 0), (3, 4), (17, 90)}
    group.link(chosen)
    group.agents[:n, :2] = rng.uniform(0, 1, (n, 2))
    assert group.build(3.0) is None
    assert pairs_of(group.lists, group.ids, n)[1] == chosen
