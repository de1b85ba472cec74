"""Restart files of a flock that moves fast: LAMMPS must find everybody in them, whenever they are written."""

import numpy as np
import pytest

from flocking.engine.lammps.options import LammpsOptions
from flocking.engine.lammps.session import LammpsSession
from flocking.papers.showcases.shipped import showcase

pytestmark = pytest.mark.mpi


def test_a_flock_that_left_its_box_is_read_again():
    scenario = showcase("cluster-obstacles").scenario(agents=1000, until=4.0)
    options = LammpsOptions(step=0.02, ledger=0)
    going = LammpsSession(scenario, options)
    ends = []
    for t in (1.0, 1.5, 1.94, 2.02, 2.5):  # some of them long after lists were made
        going.advance(t)
        again = LammpsSession(scenario, options, restart=going.restart())
        assert again.time == going.time
        again.advance(2.9)
        ends.append(again.state.q)
        again.close()
    going.advance(2.9)
    for q in ends:
        assert np.abs(q - going.state.q).max() < 1e-11
    going.close()
