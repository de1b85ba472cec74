"""The agreement protocol d theta_i/dt = sum_j a_ij (theta_j - theta_i) on given nets (Olfati-Saber (12)-(13))."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links
from flocking.model.graphs.distance_graphs import Fixed
from flocking.model.law import Law
from flocking.model.potentials.potential import Potential
from flocking.model.terms.pair_terms import Gradient
from flocking.study.nets.matrices import laplacian


def agreement_law(links: Links) -> Law:
    """The protocol on one net, as a law for first-order agents on a line: (13) is the gradient of sum r^2/2.

    Use it with ``Agents(order=1)`` and the values theta_i as positions, shape (N, 1).

    Parameters
    ----------
    links
        Link matrix, shape (N, N): entry (i, j) where i listens to j.
    """
    matrix = np.asarray(links, dtype=bool)
    directed = bool((matrix != matrix.T).any())
    edges = tuple((int(i), int(j)) for i, j in np.argwhere(matrix if directed else np.triu(matrix)))
    return Law(Fixed(len(matrix), edges, directed=directed), (Gradient(Potential("r**2/2")),))


def agree(theta: ArrayLike, nets: Sequence[ArrayLike], times: ArrayLike) -> Array:
    """Exact solution d theta/dt = -L theta on nets that follow one another.

    Parameters
    ----------
    theta
        Values at ``times[0]``, shape (N,) or (N, k).
    nets
        Links or weights of each net, shape (N, N): ``nets[s]`` holds from ``times[s]`` to ``times[s + 1]``.
    times
        Ascending times, one more than there are nets.

    Returns
    -------
    Array
        Values at all times, shape (S + 1, N) or (S + 1, N, k).

    Raises
    ------
    InvalidInput
        When numbers of nets and times disagree.
    """
    from scipy.linalg import expm

    moments = np.asarray(times, dtype=np.float64)
    if len(moments) != len(nets) + 1 or (np.diff(moments) < 0).any():
        raise InvalidInput("agree", "times", f"must be {len(nets) + 1} ascending times", moments.tolist())
    values = [np.asarray(theta, dtype=np.float64)]
    for net, length in zip(nets, np.diff(moments), strict=True):
        values.append(expm(-laplacian(net) * length) @ values[-1])
    return np.array(values)


def nets_of(run: Run) -> tuple[list[Links], Array]:
    """The nets a run went through under its law's graph, with the times at which each began and the end.

    Rebuilt from the first frame and the recorded switches. Times run from the first stored frame to the last.
    """
    links = np.array(run.links[0])
    directed = run.scenario.law.graph.directed
    nets, times = [links.copy()], [float(run.t[0])]
    for switch in run.switches:
        if (
            switch["graph"] != 0
            or switch["kind"] not in ("appear", "break")
            or not times[0] < switch["time"] <= run.t[-1]
        ):
            continue
        i, j = int(switch["i"]), int(switch["j"])
        links[i, j] = switch["kind"] == "appear"
        if not directed:
            links[j, i] = links[i, j]
        if switch["time"] > times[-1]:
            nets.append(links.copy())
            times.append(float(switch["time"]))
        else:
            nets[-1] = links.copy()
    return nets, np.array([*times, float(run.t[-1])])
