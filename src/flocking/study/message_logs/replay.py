"""A second computation of what agents knew and of the forces that follow: which entries of a log are wrong."""

from __future__ import annotations

import numpy as np

from flocking.engine.runs.run import Run
from flocking.formula.compiled import Reading
from flocking.model.world.control import Held
from flocking.model.world.information import Delayed
from flocking.study.message_logs.continuous_replay import ContinuousReplay
from flocking.study.message_logs.delayed_replay import DelayedReplay
from flocking.study.message_logs.held_replay import HeldReplay
from flocking.study.message_logs.logged_world import logged
from flocking.study.message_logs.replay_result import Replay


def replay(run: Run) -> Replay:
    """Compute again what agents used when they acted, and the forces that follow from that.

    The energy ledger proves that a run moves as recorded, not that agents used what they could know. Here the motion
    is computed from the logged forces, samples, arrivals, expiries and links from the declared world, and forces from
    the entries of the log, by plain code that shares with the engine the declared parts and their random numbers alone.
    Under continuous control with messages the motion is integrated under the law on what is in use by the log. With
    delayed knowledge it is taken from the frames, to the error of interpolation between them: links at frames, where
    links switch, and the forces then are computed again from what each agent knew, the motion is not. What that error
    leaves open is counted; more frames leave less open. Lagged forces at frames, and other columns of bodies that are
    integrated, are compared too; headings of bodies in closed form are not.

    Parameters
    ----------
    run
        A run with held control, or with messages or delayed knowledge under continuous control, whole or up to some
        time; stored ones have the log.

    Returns
    -------
    Replay
        What was found.

    Raises
    ------
    InvalidInput
        When it is no run, one without a log, one with numbers that are not finite, or with a log of agents that there
        are not.
    UnsupportedLaw
        When a safety filter changed the forces.

    Examples
    --------
    >>> import flocking as fk
    >>> law = fk.Law(fk.Proximity(4.0), [fk.Consensus(1.0)])
    >>> start = fk.start.box(4, side=3, speed=1, seed=0)
    >>> world = dict(control=fk.Held(0.1), information=fk.Messages(0.1, delay=0.03, loss=0.2))
    >>> fk.replay(fk.simulate(fk.Scenario(law, start, t_end=2, **world))).agrees
    True
    """
    scenario, log = logged(run)
    kind: type[HeldReplay | ContinuousReplay | DelayedReplay] = ContinuousReplay
    if isinstance(scenario.information, Delayed):
        kind = DelayedReplay
    elif isinstance(scenario.control, Held):
        kind = HeldReplay
    # Forces of a log may be too large to compute with; what they lead to then agrees with nothing.
    with Reading(), np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return kind(run, scenario, log).result()
