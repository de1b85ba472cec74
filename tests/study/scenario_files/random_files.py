"""Random changes of scenario files."""

import tomllib

from hypothesis import strategies as st

from flocking.study.scenario_files.scenario_file import (
    scenario_to_text,
)
from tests.study.scenario_files.scenarios import SCENARIOS

VALUES = st.recursive(
    st.none().map(lambda _: "soon")
    | st.booleans()
    | st.integers(-(10**30), 10**30)
    | st.floats(allow_nan=True, allow_infinity=True)
    | st.text(max_size=12)
    | st.sampled_from(["gradient", "fixed", "1/r", "r**r**r", "__import__('os')", "leader_1", "x" * 3000, "lab"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)
BASED = ("hysteresis", "shared leader", "matrix", "obstacles", "messages", "lost messages", "far messages", "periodic")
BASES = [tomllib.loads(scenario_to_text(SCENARIOS[n])) for n in BASED]


def places(table, path=()):
    yield path
    children = table.items() if isinstance(table, dict) else enumerate(table) if isinstance(table, list) else ()
    for key, child in children:
        yield from places(child, (*path, key))
