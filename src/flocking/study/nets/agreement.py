"""The agreement protocol d theta_i/dt = sum_j a_ij (theta_j - theta_i) on given nets (Olfati-Saber (12)-(13))."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.model.checks import Array, array
from flocking.model.graphs.connectivity import Links
from flocking.model.graphs.distance_graphs import Fixed
from flocking.model.law import Law
from flocking.model.potentials.potential import Potential
from flocking.model.terms.pair_terms import Gradient
from flocking.study.evidence import Evidence
from flocking.study.nets.matrices import laplacian

SHORT, TERMS = 0.5, 16
"""Largest share of the fastest agent's time for which the series is summed, and its terms: what is left out,
0.5^17/17!, is 2e-20 of the sum."""


def agreement_law(links: Links) -> Law:
    """The protocol on one net, as a law for first-order agents on a line: the gradient of sum r^2/2.

    Use it with ``Agents(order=1)`` and the values theta_i as positions, shape (N, 1).

    Parameters
    ----------
    links
        Link matrix, shape (N, N): entry (i, j) where i senses j.
    """
    matrix = np.asarray(links, dtype=bool)
    directed = bool((matrix != matrix.T).any())
    edges = tuple((int(i), int(j)) for i, j in np.argwhere(matrix if directed else np.triu(matrix)))
    return Law(Fixed(len(matrix), edges, directed=directed), (Gradient(Potential("r**2/2")),))


def agree(theta: ArrayLike, nets: Sequence[ArrayLike], times: ArrayLike) -> Array:
    """Exact solution of d theta/dt = -L theta on a sequence of nets.

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
        When numbers of nets and times disagree, a net is one of other agents, or a number, or weights times a duration,
        is not finite.
    """
    moments = array("agree", "times", times, ndim=1)
    if len(moments) != len(nets) + 1 or (np.diff(moments) < 0).any():
        raise InvalidInput("agree", "times", f"must be {len(nets) + 1} ascending times", moments.tolist())
    values = [np.asarray(array("agree", "theta", theta, ndim=2 if np.ndim(theta) > 1 else 1))]
    for number, net in enumerate(nets):
        if np.shape(net) != (len(values[0]), len(values[0])):
            raise InvalidInput(
                "agree", f"nets[{number}]", f"must be a matrix of {len(values[0])} agents", f"shape {np.shape(net)}"
            )
    for net, length in zip(nets, np.diff(moments), strict=True):
        # Differences to the first value: what all have in common does not change.
        common = values[-1][:1]
        values.append(common + _propagator(laplacian(net), float(length)) @ (values[-1] - common))
    return np.array(values)


def _propagator(matrix: Array, length: float) -> Array:
    """exp(-L t) of a Laplacian L, shape (N, N), and a duration t, not negative.

    With weights that are not negative all its numbers are not, and its rows sum to 1. It is the series of
    exp(-x) exp(x B) for a short time, B = 1 - L/q, of which no term is negative, squared again and again with rows made
    to sum to 1: errors stay relative ones of the weights, however long the time. Without that each square doubles the
    error.
    """
    from scipy.linalg import expm

    weights = -matrix.copy()
    np.fill_diagonal(weights, 0.0)
    fastest = float(np.abs(matrix.diagonal()).max(initial=0.0))
    if not np.isfinite(fastest * length):
        raise InvalidInput("agree", "times", "must be such that weights times durations are finite", length)
    if (weights < 0.0).any():
        return np.asarray(expm(-matrix * length))
    if not fastest * length > 0.0:
        return np.eye(len(matrix))
    squares = max(0, int(np.ceil(np.log2(fastest * length / SHORT))))
    short = fastest * length * 2.0**-squares
    step = weights / fastest
    np.fill_diagonal(step, 1.0 - matrix.diagonal() / fastest)
    found = term = np.eye(len(matrix))
    for k in range(1, TERMS + 1):
        term = term @ step * (short / k)
        found = found + term
    found = found / found.sum(axis=1, keepdims=True)
    for _ in range(squares):
        found = found @ found
        found = found / found.sum(axis=1, keepdims=True)
    return np.asarray(found)


def nets_of(run: Run) -> tuple[list[Links], Array]:
    """The sequence of nets of a run under its law's graph, with the times at which each began and the end.

    Raises
    ------
    NotResolvable
        When the run does not record its switches.
    """
    history = Evidence(run).link_history
    return [links for _, links in history], np.array([*(t for t, _ in history), float(run.t[-1])])
