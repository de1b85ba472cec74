"""What a second computation says in words: never more than it decided."""

import numpy as np

import flocking as fk
from flocking.study.message_logs.replay_result import Replay, WrongEntry


def test_what_is_left_open_is_not_said_to_be_as_declared():
    assert str(Replay(8, 16, 0, ())) == "8 acts with 16 entries computed again: all as declared"
    for undecided in (1, 8, 20):
        said = str(Replay(8, 16, undecided, (), "interpolation"))
        assert "all as declared" not in said
        assert said.endswith(f"{undecided} left open by interpolation: what is not left open is as declared")
    wrong = WrongEntry(0.1, 2, None, "another force")
    assert "not as declared" in str(Replay(8, 16, 8, (wrong,)))


def test_a_run_of_few_frames_is_not_said_to_be_all_as_declared():
    """Of late knowledge the motion is that of the frames: of two of them nothing follows about what lies between."""
    law = fk.Law(fk.Proximity(1.5), [fk.Gradient(fk.Potential("(r - 1)**2")), fk.Consensus(1.0)])
    start = fk.State(np.array([[0.0, 0.0], [1.2, 0.0], [0.3, 1.4]]), np.array([[1.0, 0.0], [0.0, 0.5], [-1.0, 0.2]]))
    run = fk.simulate(fk.Scenario(law, start, t_end=0.8, frames=2, information=fk.Delayed(0.1)), progress=False)
    found = fk.replay(run)
    assert found.agrees
    assert found.undecided
    assert "all as declared" not in str(found)
