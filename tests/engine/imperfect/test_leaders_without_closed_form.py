"""Leaders whose position has no closed form: engines of imperfect worlds, which need it at any time, refuse them."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.errors import UnsupportedLaw

WAVE = fk.Path(["sin(exp(sin(t)))", "0"])
START = fk.State([[0.0, 0.0], [1.0, 0.0]], np.zeros((2, 2)))


@pytest.mark.parametrize("engine", ["sampled", "delayed"])
@pytest.mark.parametrize("energy", [False, True])
def test_they_are_refused_also_where_the_energy_alone_is_in_their_frame(engine: str, energy: bool) -> None:
    assert not WAVE.closed_form
    terms = [fk.Consensus(1.0), *([] if energy else [fk.Track(WAVE)])]
    world = {"control": fk.Held(0.1)} if engine == "sampled" else {"information": fk.Delayed(0.1)}
    frame = {"energy": fk.Energy(frame="leader", leader=WAVE)} if energy else {}
    made = fk.Scenario(fk.Law(fk.Complete(), terms), START, t_end=1.0, **world, **frame)
    with pytest.raises(UnsupportedLaw, match="leaders whose position has a closed form"):
        fk.start(made, engine=engine)
