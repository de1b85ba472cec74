"""Errors of late samples by which agents know themselves: each is used at once by the agent, and late by others."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.linalg import null_space

import flocking as fk

PERIOD, PLACE, RATE, SIGMA = 0.2, 1.3, 0.9, (0.1, 0.07)


def scenario(graph, order, delay, own, lost, keeps):
    """Linear consensus on samples that are some periods late, with errors, and lost with a probability."""
    terms = [fk.Gradient(fk.Potential("k*r**2/2", k=PLACE))] + ([fk.Consensus(RATE)] if order == 2 else [])
    options = {} if keeps else {"expires": round((delay + 1) * PERIOD, 9)}
    if lost:
        options["loss"] = fk.Bernoulli(lost)
    messages = fk.Messages(
        PERIOD, delay=round(delay * PERIOD, 9), noise=fk.WhiteNoise(SIGMA[0], SIGMA[1] if order == 2 else 0.0),
        self_known=own, **options,
    )  # fmt: skip
    q = np.random.default_rng(0).normal(size=(graph.n, 1))
    return fk.Scenario(
        fk.Law(graph, terms), fk.State(q), t_end=1.0, control=fk.Held(PERIOD), information=messages,
        bodies=fk.SingleIntegrator() if order == 1 else fk.PointMass(),
    )  # fmt: skip


def next_state(state, errors, arrives, links, order, own, keeps):
    """One period by plain queues: true places, samples taken before, and the last sample that came over each link.

    state: x (order, N), samples (delay, order, N), the newest first, kept (L, order).
    """
    x, samples, kept = state
    sample = x + errors
    sent = np.concatenate([sample[None], samples])
    force, kept = np.zeros(x.shape[1]), kept.copy()
    for k, (i, j) in enumerate(links):
        if arrives[k]:
            kept[k] = sent[-1][:, j]
        if arrives[k] or keeps:
            own_state = sample[:, i] if own == "measured" else x[:, i]
            force[i] += np.dot((PLACE, RATE)[:order], kept[k] - own_state)
    moved = x.copy()
    if order == 1:
        moved[0] += PERIOD * force
    else:
        moved[0] += PERIOD * x[1] + 0.5 * PERIOD**2 * force
        moved[1] += PERIOD * force
    return moved, sent[: len(samples)], kept


def stationary(graph, order, delay, own, lost, keeps):
    """Mean square deviation of places in the long run: second moments over all patterns of loss, enumerated."""
    n = graph.n
    links = [(int(i), int(j)) for i, j in np.argwhere(graph.initial(np.zeros((n, 1))))]
    shapes = [(order, n), (delay, order, n), (len(links), order)]
    sizes = [int(np.prod(s)) for s in shapes]
    total, ends = sum(sizes), np.cumsum(sizes)[:-1]

    def step(flat, errors, arrives):
        state = [part.reshape(s) for part, s in zip(np.split(flat, ends), shapes, strict=True)]
        return np.concatenate([part.ravel() for part in next_state(state, errors, arrives, links, order, own, keeps)])

    # All in one place, and all samples of it; where nothing is stored also one common velocity: no disagreement.
    first = np.arange(order) == 0
    common = [np.concatenate([*[np.repeat(first, n)] * (delay + 1), np.tile(first, len(links))]).astype(float)]
    if order == 2 and not delay:
        common.append(np.r_[np.zeros(n), np.ones(n), np.tile([0.0, 1.0], len(links))])
    basis = null_space(np.array(common))
    moments, added = np.zeros((basis.shape[1] ** 2,) * 2), np.zeros((basis.shape[1],) * 2)
    for arrives in product((0, 1), repeat=len(links)) if lost else [(1,) * len(links)]:
        weight = np.prod([1 - lost if x else lost for x in arrives])
        matrix = np.array([step(unit, np.zeros((order, n)), arrives) for unit in np.eye(total)]).T
        noise = np.array([
            step(np.zeros(total), SIGMA[k // n] * unit.reshape(order, n), arrives)
            for k, unit in enumerate(np.eye(order * n))
        ]).T  # fmt: skip
        matrix, noise = basis.T @ matrix @ basis, basis.T @ noise
        moments += weight * np.kron(matrix, matrix)
        added += weight * noise @ noise.T
    moment = np.linalg.solve(np.eye(len(moments)) - moments, added.ravel()).reshape(added.shape)
    centred = np.zeros((total, total))
    centred[:n, :n] = np.eye(n) - 1.0 / n
    return float(np.trace(centred @ basis @ moment @ basis.T)) / n


PATH, PAIR = fk.Fixed(3, ((0, 1), (1, 2))), fk.Fixed.complete(2)


@pytest.mark.parametrize("own", ["measured", "true"])
@pytest.mark.parametrize(
    ("graph", "order", "delay", "lost", "keeps"),
    [
        (PAIR, 1, 1, 0.0, True), (PAIR, 1, 2, 0.0, True), (PATH, 1, 2, 0.0, True), (PATH, 2, 0, 0.0, True),
        (PATH, 2, 1, 0.0, True), (PATH, 1, 1, 0.3, False), (PATH, 1, 1, 0.3, True), (PAIR, 1, 2, 0.4, True),
        (PAIR, 2, 1, 0.2, False),
    ],
)  # fmt: skip
def test_noise_of_late_samples_is_that_of_all_patterns_of_loss(graph, order, delay, lost, keeps, own):
    expected = stationary(graph, order, delay, own, lost, keeps)
    found = fk.certify(scenario(graph, order, delay, own, lost, keeps))["noise_in_world"]
    assert found.granted, found.reason
    assert found.bound.lo * (1 - 1e-9) <= expected <= found.bound.hi * (1 + 1e-9)
    assert found.bound.hi - found.bound.lo < 1e-6 * expected
