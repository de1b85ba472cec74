"""Numbers of flocks among obstacles, where links are in doubt."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from flocking.engine.runs.run import SWITCH_FIELDS
from flocking.papers.obstacle_passages import flock_counts
from flocking.study.evidence import NotResolvable

PAIR = ~np.eye(2, dtype=bool)
APART = np.zeros((2, 2), dtype=bool)


class Seen:
    """What is asked of the evidence of two agents that pass obstacles at t = 1 and 3, and part at t = 2 if at all."""

    known_until = np.inf
    loss_note = ""
    end_links = PAIR

    def __init__(self, *histories: list[tuple[float, Any]]) -> None:
        self.possible_histories, self.link_history = histories, histories[0]
        self.all_switches = np.zeros(2, dtype=SWITCH_FIELDS)
        self.all_switches["time"], self.all_switches["kind"] = [1.0, 3.0], "obstacle"

    @property
    def run(self) -> Any:
        return type("Run", (), {"accuracy": object()})

    def doubt_note(self) -> str:
        return "agents 0 and 1 are in doubt"


def test_flocks_are_counted_where_no_doubt_changes_them() -> None:
    parted = [(0.0, PAIR), (2.0, APART), (2.5, PAIR)]
    assert flock_counts(Seen(parted, parted)) == (1, 2, 1)  # type: ignore[arg-type]


def test_flocks_that_doubts_make_or_join_are_left_open() -> None:
    together, parted = [(0.0, PAIR)], [(0.0, PAIR), (2.0, APART), (2.5, PAIR)]
    with pytest.raises(NotResolvable, match="agents 0 and 1 are in doubt"):
        flock_counts(Seen(parted, together))  # type: ignore[arg-type]
