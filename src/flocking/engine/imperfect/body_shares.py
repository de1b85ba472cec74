"""What stands between the desired force and the motion, part by part: by how much each part changes the force."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flocking.arrays import Array
from flocking.engine.protocol.body_chains import has_energy_of_points, members_of
from flocking.errors import UnsupportedLaw
from flocking.model.bodies.actuators import Lagged, Limited, scaled_back
from flocking.model.bodies.body import Body
from flocking.model.bodies.disturbances import Disturbed
from flocking.model.bodies.point_bodies import PointMass, SingleIntegrator
from flocking.model.bodies.unicycles import Unicycle
from flocking.model.world.times import PER_SECOND

PARTS = ("limits", "lag", "disturbance", "body")
"""What may change a force: largest forces and speeds, a lag, gusts, and equations of motion that are not a point's."""

ROUNDED = 1e-13
"""Difference of two forces, relative to their size, below which it is the rounding of two ways to compute one: a
thousand units of the last place, since masses times accelerations are sums of several terms."""


class BodyShares:
    """By how much each part of the bodies changes the force of each agent.

    The parts act in the order of the chain, the outermost first; largest speeds act last. What a part changes is what
    leaves it minus what comes to it: a gust before a lag is counted where it enters, and what the lag keeps back of it
    is due to the lag, as is what a largest rate of the lagged force keeps back. What acts in the end minus what the
    known parts leave is due to largest speeds, or to the body where it does not move as a point does.

    Parameters
    ----------
    bodies
        What the agents are.
    n, m
        Numbers of agents and axes.

    Attributes
    ----------
    names
        Parts, of `PARTS`, that the bodies have.
    lags
        Whether the applied force is needed.
    reads_motion
        Whether the force that acts in the end is needed.

    Raises
    ------
    UnsupportedLaw
        When the kinetic energy of a body is not that of a point, or several parts are known by the motion alone.
    """

    def __init__(self, bodies: Body, n: int, m: int) -> None:
        self._n, self._m = n, m
        if bodies.order > 1 and not has_energy_of_points(bodies):
            raise UnsupportedLaw(
                f"departed_causes splits the work of forces on points; {type(bodies).__name__} agents have another "
                "kinetic energy, whose rate is the work of no force."
            )
        self._members = [
            (np.flatnonzero(np.broadcast_to(rows, n)), chain, _rest_of(chain, inner))
            for rows, chain, inner in members_of(bodies)
        ]
        parts = [x for _, chain, _ in self._members for x in chain]
        kinds = {rest for _, _, rest in self._members}
        kinds |= {"lag" for x in parts if isinstance(x, Lagged)}
        kinds |= {"disturbance" for x in parts if isinstance(x, Disturbed)}
        kinds |= {"limits" for x in parts if isinstance(x, Limited) and x.force is not None}
        self.names = tuple(name for name in PARTS if name in kinds)
        self.lags = "lag" in kinds
        self.reads_motion = any(rest for _, _, rest in self._members)
        self.constant = not self.lags and not self.reads_motion
        """Whether shares stay as they are while the desired force and the gusts do."""

    def at(self, elapsed: float, desired: Array, applied: Array | None, acting: Array | None) -> Array:
        """Shares of the parts in the force of each agent, in the order of `names`, shape (names, N, m).

        Parameters
        ----------
        elapsed
            Time since the start of the run; between two gusts, not where one begins.
        desired
            The desired forces, shape (N, m); desired velocities of agents of order 1.
        applied
            Column ``applied`` of lagged agents, shape (N, m).
        acting
            The force on a point that would move as the agent does, shape (N, m); its velocity where it is of order 1.
        """
        found = {name: np.zeros((self._n, self._m)) for name in self.names}
        for rows, chain, rest in self._members:
            now = desired[rows]
            for part in chain:
                out = now
                if isinstance(part, Disturbed):
                    number = int(elapsed * PER_SECOND) // part.period_in_nanoseconds
                    gust = _each(part.sigma, self._n)[rows] * part.gust_of(rows, number, self._m)
                    found["disturbance"][rows] += gust
                    now = now + gust
                    continue
                if isinstance(part, Lagged):
                    assert applied is not None
                    name, out = "lag", applied[rows]
                elif isinstance(part, Limited) and part.force is not None:
                    most = _each(part.force, self._n)[rows]
                    name, out = "limits", scaled_back(now, most, each_axis=part.shape == "box")
                else:
                    continue
                found[name][rows] += out - now
                now = out
            if rest:
                assert acting is not None
                gap = acting[rows] - now
                found[rest][rows] += np.where(np.abs(gap) <= ROUNDED * (np.abs(acting[rows]) + np.abs(now)), 0.0, gap)
        return np.array([found[name] for name in self.names]).reshape(-1, self._n, self._m)


def _rest_of(chain: Sequence[Body], inner: Body) -> str:
    """Which part is known by the motion alone, empty where none is; of one member of the group."""
    speeds = any(isinstance(x, Limited) and x.speed is not None for x in chain)
    strange = [x for x in chain if type(x) not in (Limited, Lagged, Disturbed)]
    points = PointMass().structure, SingleIntegrator().structure
    if type(inner) is not Unicycle and inner.structure not in points:
        strange.append(inner)
    if not strange:
        return "limits" if speeds else ""
    if speeds or (len(strange) > 1) or (strange[0] is not inner and strange[0] is not chain[-1]):
        raise UnsupportedLaw(
            f"departed_causes takes what a {type(strange[0]).__name__} body does from the motion alone, and cannot "
            "separate it from another part of the chain that is known by the motion alone."
        )
    return "body"


def _each(value: float | Array, n: int) -> Array:
    """A number of each agent, shape (n, 1)."""
    return np.broadcast_to(np.asarray(value, dtype=np.float64), n)[:, None]
