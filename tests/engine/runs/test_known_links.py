"""Links by what agents know, read from the log of a run, against the running session and the true ones."""

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput

N = 8
LAW = fk.Law(
    fk.Hysteresis(2.5, gap=0.4),
    [fk.Gradient(fk.Potential("(r - 1.5)**2/2")), fk.Consensus(0.5, over=fk.Proximity(1.8))],
)
EACH = np.arange(N)
WORLD = {
    "control": fk.Held(np.where(EACH % 2, 0.1, 0.15), phase=np.where(EACH % 3, 0.0, 0.05), latency=0.02),
    "information": fk.Messages(0.1, delay=0.12, jitter=0.05, loss=0.4, expires=0.35, seed=2),
}


def scenario(**world):
    start = fk.start.box(N, side=4, speed=1.5, seed=3)
    return fk.Scenario(LAW, start, t_end=3.0, frames=41, **{**WORLD, **world})


def test_known_links_of_frames_are_those_of_the_session_then(tmp_path):
    made = scenario()
    run = fk.simulate(made, progress=False, save=tmp_path / "run")
    again = fk.read_run(tmp_path / "run")
    session = fk.start(made)
    seen = np.zeros(3, dtype=int)
    for frame, t in enumerate(run.t):
        # Before the controls of that instant.
        session.advance(t - 1e-6 if frame else t)
        known = run.known_links_at(frame)
        assert known.shape == (2, N, N)
        assert (known == session.known_links).all()
        assert (again.known_links_at(frame) == known).all()
        seen += [(known[0] != run.links_at(frame)).any(), (known[0] != known[0].T).any(), (known[1] != known[0]).any()]
    # They differ from the true ones, between both directions, and between graphs.
    assert (seen > 10).all()
    assert (run.known_links_at(0)[0] == run.links_at(0)).all()


def test_a_frame_at_a_tick_shows_what_was_known_before_it():
    """Two agents that part: at 0.2 the second one learns of it, and the frame of that time does not know yet."""
    start = fk.State([[0.0], [1.5]], [[0.0], [2.0]])
    made = fk.Scenario(
        fk.Law(fk.Proximity(1.8), [fk.Consensus(1e-9)]), start, t_end=0.4, frames=5, control=fk.Held(0.2, phase=0.2)
    )
    run = fk.simulate(made, progress=False)
    assert [bool(run.known_links_at(k)[0, 0, 1]) for k in range(5)] == [True, True, True, False, False]
    assert [bool(run.links_at(k)[0, 1]) for k in range(5)] == [True, True, False, False, False]


def test_part_of_a_run_knows_what_the_whole_knew():
    run = fk.simulate(scenario(), progress=False)
    part = run.until(1.4)
    assert (part.known_links_at(len(part.t) - 1) == run.known_links_at(len(part.t) - 1)).all()


def test_a_run_without_a_log_says_so():
    run = fk.simulate(scenario(control=fk.Continuous(), information=fk.Instant()), progress=False)
    with pytest.raises(InvalidInput, match="needs a log of what agents used"):
        run.known_links_at(0)
