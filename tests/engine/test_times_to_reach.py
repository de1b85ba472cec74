"""Times that sessions are asked to reach: any number is one, and is noted as a plain float."""

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.engine.protocol.session import time_to_reach
from flocking.errors import InvalidInput

LAW = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("r**2/2")), fk.Consensus(1.0)])
START = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.3], [0.0, -0.3]])
WORLDS = {
    "exact": {}, "tiles": {}, "held tiles": {"control": fk.Held(0.1)}, "delayed": {"information": fk.Delayed(0.1)},
    "messages": {"information": fk.Messages(0.1)},
    "sampled": {"control": fk.Held(0.1), "information": fk.Messages(0.1)},
}  # fmt: skip


@pytest.mark.parametrize("kind", WORLDS)
@pytest.mark.parametrize("number", [np.float64, np.float32, lambda x: np.array(x)], ids=["float64", "float32", "array"])
def test_a_session_that_was_changed_at_a_numpy_time_goes_on(kind, number, tmp_path):
    made = fk.Scenario(LAW, START, t_end=1.0, frames=5, **WORLDS[kind])
    engine = kind.split()[-1]
    session = fk.start(made, **({"engine": engine} if engine in ("exact", "tiles") else {}))
    session.advance(number(0.5))
    assert type(session.time) is float
    if isinstance(made.information, fk.Messages):
        session.replace_information(replace(made.information, delay=0.05))
    elif kind == "delayed":
        session.replace(law=fk.Law(LAW.graph, [fk.Gradient(fk.Potential("r**2/2")), fk.Consensus(2.0)]))
    again = session.moment()()
    for each in (session, again):
        each.advance(number(1.0))
    assert np.array_equal(again.run().q, session.run().q)
    fk.write_run(session.run(), tmp_path / "run")
    assert np.array_equal(fk.read_run(tmp_path / "run").q, session.run().q)


@pytest.mark.parametrize("to", [0.2, np.nan, "soon", None])
@pytest.mark.parametrize("kind", WORLDS)
def test_what_is_no_later_time_is_refused_by_name(kind, to):
    engine = kind.split()[-1]
    session = fk.start(
        fk.Scenario(LAW, START, t_end=1.0, frames=5, **WORLDS[kind]),
        **({"engine": engine} if engine in ("exact", "tiles") else {}),
    )
    session.advance(0.5)
    with pytest.raises(InvalidInput, match="to "):
        session.advance(to)


def test_a_step_may_lie_just_before():
    assert time_to_reach("Session", np.float64(0.9), 1.0, 0.2) == 0.9
    with pytest.raises(InvalidInput):
        time_to_reach("Session", 0.7, 1.0, 0.2)


def opened(kind, start=START, duration=1.0):
    """A session of one of the worlds."""
    engine = kind.split()[-1]
    made = fk.Scenario(LAW, start, t_end=start.t + duration, frames=3, **WORLDS[kind])
    return fk.start(made, **({"engine": engine} if engine in ("exact", "tiles") else {}))


@pytest.mark.parametrize("seconds", [np.nan, "soon", None])
@pytest.mark.parametrize("kind", WORLDS)
def test_wall_time_that_is_no_number_is_refused_by_name(kind, seconds):
    session = opened(kind)
    with pytest.raises(InvalidInput, match="seconds "):
        session.advance(1.0, seconds)
    assert session.time == 0.0
    session.advance(1.0, np.float32(np.inf))
    assert session.time == 1.0


@pytest.mark.parametrize("kind", ["exact", "delayed", "messages", "sampled"])
def test_a_slice_does_not_end_where_its_time_only_rounds_to_the_end(kind):
    """Times near 1e16 are 2 apart, those since the start are not: a run is finished with its last frame."""
    start = replace(START, t=1e16)
    session, complete = opened(kind, start, 4.0), opened(kind, start, 4.0)
    for _ in range(1000):
        if session.reached(start.t + 4.0):
            break
        session.advance(start.t + 4.0, 0.0)
    complete.advance(start.t + 4.0)
    run = session.run()
    assert run.status == "finished"
    assert run.t.tolist() == [1e16, 1e16 + 2.0, 1e16 + 4.0]
    assert np.array_equal(run.q, complete.run().q)
