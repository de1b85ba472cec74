"""The second implementation of messages under continuous control, with laws and states that are replaced on the way."""

import numpy as np

from tests.engine.delayed.plain_messages import PlainMessages
from tests.engine.sampled.plain_world import NS


class ReplacedPlainMessages(PlainMessages):
    """As `PlainMessages`, until something is replaced: what is in the queues stays what it was.

    Parameters
    ----------
    scenario, slope, gain
        As for `PlainMessages`.
    """

    def __init__(self, scenario, slope, gain):
        super().__init__(scenario, slope, gain)
        self.end = np.concatenate([np.ravel(self.q), np.ravel(self.p)][: self.order]).astype(float)
        self.now = 0.0

    def on(self, to):
        """Go on to a time; what falls on an instant at it has taken place then."""
        y = self.end
        while True:
            instant = self.instants(2**62) / NS
            if instant <= self.now:
                self.take_up(round(instant * NS), y)
            elif self.now >= to:
                break
            else:
                y = self.move(self.now, min(instant, to), y)
                self.now = min(instant, to)
        self.end = y
        return self.split(y)

    def replace(self, *, slope=None, gain=None, radii=None, state=None):
        """Another law or another state from now on.

        Parameters
        ----------
        slope, gain
            Slope of the potential, and gain of the consensus.
        radii
            Distances at which links appear and break, of another graph, whose links are those of a start.
        state
            Positions and velocities.
        """
        self.slope, self.gain = slope or self.slope, self.gain if gain is None else gain
        if state is not None:
            self.end = np.concatenate([x.ravel() for x in state][: self.order])
        others = ~np.eye(self.n, dtype=bool)
        if radii is not None:
            self.enter, self.leave = radii
            q, _ = self.split(self.end)
            box = np.array(self.lengths)
            d = q - q[:, None]
            d -= np.where(np.isfinite(box), np.where(np.isfinite(box), box, 1.0) * np.rint(d / box), 0.0)
            self.links = (np.linalg.norm(d, axis=2) < self.leave) & others
        r = np.linalg.norm(self.apart(self.now, self.end)[0], axis=2)
        self.links = np.where(self.links, r < self.leave, r < self.enter) & self.here & others
