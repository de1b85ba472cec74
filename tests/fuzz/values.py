"""Values no caller should give."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import strategies as st

NAN, INF = float("nan"), float("inf")

NUMBERS = st.sampled_from(
    [NAN, INF, -INF, 0, -0.0, 1, -1, 0.5, 2, 3, 1e-320, 1e308, -1e308, 10**400, -(10**400), 10**12, 2**63, 1e-300]
)

ODD = st.sampled_from(
    [
        None,
        True,
        False,
        "",
        "x",
        "1",
        "\0",
        "1/r",
        "lab",
        b"1",
        1j,
        object(),
        int,
        Ellipsis,
        NotImplemented,
        {},
        set(),
        {"a": 1},
        (),
        [],
        [[]],
        [None],
        ["a"],
        [[1, 2], [3]],
        range(3),
        lambda: 1,
        slice(3),
        "\ud800",
        "a" * 5000,
    ]
)

ARRAYS = st.sampled_from(
    [
        np.zeros(0),
        np.zeros((0, 2)),
        np.zeros((3, 0)),
        np.zeros((2, 2)),
        np.ones((3, 2)),
        np.eye(3),
        np.full((3, 2), NAN),
        np.full(3, INF),
        np.array(["a", "b"]),
        np.array([None, 1]),
        np.array(1.0),
        np.zeros((2, 2, 2)),
        np.ones(3, dtype=bool),
        np.array([1j, 2]),
        np.ma.masked_all(3),
        np.array(["2020-01-01"], dtype="datetime64[D]"),
        np.full((3, 2), 1e308),
        np.zeros(3, dtype=[("a", int)]),
        [1, 2],
        [1.0, 2.0, 3.0],
        [[0, 1], [1, 2]],
        [[0.0, 0.0], [1.0, 1.0]],
    ]
)

HOSTILE: st.SearchStrategy[Any] = NUMBERS | ODD | ARRAYS | st.floats() | st.text(max_size=8)
