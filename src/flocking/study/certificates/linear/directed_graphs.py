"""Linear consensus of first order on a fixed directed graph: the complex spectrum of its Laplacian, enclosed.

An agent i moves by a times the sum of x_j - x_i over those it senses. Ordered by strongly connected components the
Laplacian is block triangular, so that its eigenvalues are those of the blocks. If one component senses no other one and
all others lead to it, zero is a simple eigenvalue and all others have positive real parts (Ren, Beard 2005). A mode of
eigenvalue s = a lambda decays at the rate Re s; x' = -s x(t - tau) is stable if and only if
|s| tau < pi/2 - |arg s| (roots of z + s exp(-z tau) on the imaginary axis: z = i w with w = |s| and
w tau = pi/2 - |arg s|); and x(t + T) = (1 - T s) x(t) if and only if T < 2 Re s/|s|^2.
"""

from __future__ import annotations

import numpy as np

from flocking.arrays import Links
from flocking.formula.intervals import Interval
from flocking.study.certificates.enclosed_matrices import eigenvalues, exact

SLACK = 1e-12
"""Relative widening of what is computed of an eigenvalue's disc, some thousand units of rounding."""


def roots_of(links: Links) -> list[np.ndarray]:
    """The strongly connected components that sense no agent of another one.

    Parameters
    ----------
    links
        ``links[i, j]`` states that i senses j, shape (N, N).
    """
    from scipy.sparse.csgraph import connected_components

    count, of = connected_components(links, directed=True, connection="strong")
    members = [np.flatnonzero(of == k) for k in range(count)]
    return [m for m in members if not links[m][:, of != of[m[0]]].any()]


class DirectedSpectrum:
    """Discs that hold the eigenvalues of the Laplacian of a directed graph but the zero.

    Parameters
    ----------
    links
        ``links[i, j]`` states that i senses j, shape (N, N); one component, and no other, senses no other one.
    """

    def __init__(self, links: Links) -> None:
        from scipy.sparse.csgraph import connected_components

        adjacency = np.asarray(links, dtype=np.float64)
        laplacian = np.diag(adjacency.sum(axis=1)) - adjacency
        root = set(roots_of(links)[0].tolist())
        count, of = connected_components(links, directed=True, connection="strong")
        centres, radii, self.reason = [], [], ""
        for k in range(count):
            members = np.flatnonzero(of == k)
            found = eigenvalues(exact(laplacian[np.ix_(members, members)]))
            if found is None:
                self.reason = "eigenvectors of the Laplacian are too close to dependent"
                return
            values, radius = found
            if set(members.tolist()) == root:
                # One of them is zero; which one is certain where its disc touches no other.
                zero = int(np.argmin(np.abs(values)))
                others = np.delete(values, zero)
                if (np.abs(others - values[zero]) <= 2.0 * radius * (1.0 + SLACK)).any():
                    self.reason = "the eigenvalue zero of the Laplacian is not distinguished from others"
                    return
                values = others
            centres.append(values)
            radii.append(np.full(len(values), radius))
        self.centres, self.radii = np.concatenate(centres), np.concatenate(radii)
        if (self.centres.real - self.radii <= 0.0).any():
            self.reason = "eigenvalues of the Laplacian are not distinguished from the imaginary axis"

    def rate(self, gain: Interval) -> Interval:
        """The smallest real part, times a gain.

        Parameters
        ----------
        gain
            The gain a, positive.
        """
        real = self.centres.real
        slack = self.radii + SLACK * np.abs(self.centres)
        return gain * Interval.of((real - slack).min(), (real + slack).min())

    def delay(self, gain: Interval) -> Interval:
        """The largest delay of all states that every mode stands.

        Parameters
        ----------
        gain
            The gain a, positive.
        """
        size, angle = np.abs(self.centres), np.abs(np.angle(self.centres))
        slack = self.radii + SLACK * size
        # A disc that does not hold zero is seen from there under an angle of arcsin(radius/distance) to each side.
        turn = np.arcsin(np.minimum(slack / size, 1.0)) + SLACK
        least, most = 0.5 * np.pi - angle - turn, 0.5 * np.pi - np.maximum(angle - turn, 0.0)
        lo = np.maximum(least, 0.0) / (size + slack) * (1.0 - SLACK)
        hi = most / (size - slack) * (1.0 + SLACK)
        return Interval.of(lo.min(), hi.min()) / gain

    def period(self, gain: Interval, samples: int = 0) -> Interval:
        """The largest period of held control that every mode stands, with a delay of whole samples of all states.

        On the unit circle z^(d + 1) - z^d + T s = 0 has |T s| = 2 sin(f) for z = exp(2 i f) and, of least T,
        (2 d + 1) f = pi/2 - |arg s|. Without delay it is 2 Re s/|s|^2.

        Parameters
        ----------
        gain
            The gain a, positive.
        samples
            The delay d.
        """
        size, angle = np.abs(self.centres), np.abs(np.angle(self.centres))
        slack = self.radii + SLACK * size
        turn = np.arcsin(np.minimum(slack / size, 1.0)) + SLACK
        least, most = 0.5 * np.pi - angle - turn, 0.5 * np.pi - np.maximum(angle - turn, 0.0)
        lo = 2.0 * np.sin(np.maximum(least, 0.0) / (2 * samples + 1)) / (size + slack) * (1.0 - SLACK)
        hi = 2.0 * np.sin(most / (2 * samples + 1)) / (size - slack) * (1.0 + SLACK)
        return Interval.of(lo.min(), hi.min()) / gain
