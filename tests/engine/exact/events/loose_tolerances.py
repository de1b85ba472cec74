"""Runs with a loose tolerance against the same ones with a tight one."""

from __future__ import annotations

import numpy as np

import flocking as fk

LOOSE, TIGHT = 1e-5, 1e-11


def difference_within_errors(scenario: fk.Scenario) -> float:
    """Largest difference of the positions of the two runs, which is within the stated errors, as those of switches are.

    Zero where a switch is in doubt: then nothing is stated.
    """
    fine, coarse = (
        fk.simulate(scenario.with_(tolerance=tolerance), engine="exact", progress=False) for tolerance in (TIGHT, LOOSE)
    )
    assert coarse.accuracy is not None
    if np.isfinite(coarse.accuracy.known_until) or len(coarse.switches) != len(fine.switches):
        return 0.0
    off = np.abs(coarse.q - fine.q).max(axis=(1, 2))
    assert (off <= coarse.accuracy.frames[:, 0] + 1e-9).all()
    late = np.abs(coarse.switches["time"] - fine.switches["time"])
    assert (late <= coarse.switches["time_error"] + 1e-9).all()
    return float(off.max())
