"""Last crossings of pairs: one row for each pair and watch, in the order in which they first crossed."""

from __future__ import annotations

from flocking.engine.exact.crossings.last_crossings import LastCrossings


def test_a_pair_has_one_row_under_each_watch():
    known = LastCrossings()
    assert known.of(0, 1, 2) == (-float("inf"), 1.0, 0)
    known.put(0, 1, 2, 0.5, 2.0, 0)
    known.put(1, 1, 2, 0.6, 3.0, 0)
    before = known.rows
    known.put(0, 1, 2, 0.7, 2.5, 4)
    assert known.rows.tolist() == [[0, 1, 2, 0.7, 2.5, 4], [1, 1, 2, 0.6, 3.0, 0]]
    assert before[0].tolist() == [0, 1, 2, 0.5, 2.0, 0], "copies of a session share the rows"
    assert known.of(0, 1, 2) == (0.7, 2.5, 4)
    assert known.of(0, 2, 1)[2] == 0
    assert LastCrossings.of_pairs(known.by_pair()).rows.tolist() == known.rows.tolist()
