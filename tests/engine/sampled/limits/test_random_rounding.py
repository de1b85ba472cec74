"""The repetition of a run of held control with random errors: forces and motions have errors of the stated size."""

import numpy as np

import flocking as fk
from flocking.engine.sampled.random_rounding import UNITS, RandomRoundingSession
from flocking.engine.sampled.session import SampledSession


def test_forces_and_motions_have_errors_of_some_units_of_rounding():
    """A spring holds one force until 1: the first forces differ by their errors alone, and then the motion by its own.

    Nine units of rounding are what a polynomial of degree 9 may be off by, which the errors must exceed.
    """
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2"))])
    start = fk.State([[0.0, 0.0], [3.0, 1.0]], [[0.5, 0.2], [-0.3, 0.1]])
    made = fk.Scenario(law, start, t_end=1.0, frames=2, control=fk.Held(2.0))
    plain, other = SampledSession(made), RandomRoundingSession(made, 1)
    for session in (plain, other):
        session.advance(0.5)
    right, wrong = (np.asarray(x.run().log.forces) for x in (plain, other))
    off = np.abs(wrong - right)
    assert (off > 0.0).all()
    assert (off <= 1.01 * UNITS * np.abs(right).max()).all()
    assert 9.0 * np.finfo(float).eps <= UNITS <= 1e-13
    # What the errors of the forces lead to is taken off.
    late = other.motion.at(0.5)[0] - plain.motion.at(0.5)[0] - 0.125 * (wrong - right)
    assert 10.0 * np.finfo(float).eps < np.abs(late).max() <= UNITS * 4.0
