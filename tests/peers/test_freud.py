"""Periodic boxes by freud, a program of others: images, links, flocks, closest pairs, hexatic order, at every engine.

freud computes in single precision: pairs within `BORDER` of a radius are left out, and differences are compared to
`SINGLE`. A machine without freud fails here: `make test-peers` installs it.
"""

from __future__ import annotations

import importlib

import numpy as np
import pytest

import flocking as fk
from flocking.model import observables
from flocking.model.graphs.distance_graphs import pair_distances

pytestmark = pytest.mark.peers

SINGLE = 2e-5
"""Differences that single precision explains: coordinates up to some 30, of which 30 * 2**-23 = 4e-6 is rounding."""

BORDER = 1e-4
"""Distance from a radius within which single precision decides nothing."""

RADIUS = 1.5
"""Radius of the links."""

BOXES = [(7.0, 5.0), (9.0, 9.0), (8.0, None), (6.0, 5.0, 7.0), (6.0, None, 8.0)]
"""Lengths of the axes; None where they do not repeat."""

LONG = 60.0
"""Length that freud, which searches in boxes that repeat alone, is given for an axis without end: twelve times what the
agents spread over there."""


def freud():
    """The program, read where a test needs it: other tests run on machines without it."""
    return importlib.import_module("freud")


def box_of(lengths):
    """The box of freud for a space."""
    sides = [LONG if x is None else x for x in lengths]
    return freud().box.Box(*sides, is2D=True) if len(lengths) == 2 else freud().box.Box(*sides)


def in_three(q):
    """Points with three coordinates."""
    return np.concatenate([q, np.zeros((len(q), 3 - q.shape[1]))], axis=1)


def agents(lengths, seed, n=40):
    """Positions all over the box, and up to two boxes away from it; on axes without end within 5."""
    rng = np.random.default_rng(seed)
    sides = np.array([5.0 if x is None else x for x in lengths])
    far = np.array([0.0 if x is None else x for x in lengths]) * rng.integers(-2, 3, size=(n, len(lengths)))
    return rng.random((n, len(lengths))) * sides - 0.5 * sides + far


def neighbours(q, lengths, radius):
    """Pairs that freud finds within a radius, as a matrix, and their distances."""
    box = box_of(lengths)
    query = freud().locality.AABBQuery(box, box.wrap(in_three(q)))
    found = query.query(query.points, {"r_max": radius, "exclude_ii": True}).toNeighborList()
    distances = np.full((len(q), len(q)), np.inf)
    distances[found.query_point_indices, found.point_indices] = found.distances
    return np.isfinite(distances), distances


def agree(links, distances, q, lengths, radius=RADIUS):
    """Whether links are those of freud but for pairs at the radius; the number of pairs that decide."""
    space = fk.Periodic(lengths)
    clear = np.abs(pair_distances(q, space) - radius) > BORDER
    assert (links == np.isfinite(distances))[clear].all()
    return int((np.isfinite(distances) & clear).sum())


@pytest.mark.parametrize("lengths", BOXES)
@pytest.mark.parametrize("seed", range(5))
def test_displacements_and_distances_are_those_of_the_nearest_image(lengths, seed):
    q, space = agents(lengths, seed), fk.Periodic(lengths)
    difference = q[:, None] - q
    found = space.displacement(difference)
    expected = box_of(lengths).wrap(in_three(difference.reshape(-1, len(lengths))))
    gaps = np.abs(found.reshape(-1, len(lengths)) - expected[:, : len(lengths)])
    sides = np.array([np.inf if x is None else x for x in lengths])
    # Half a length away both images are as near.
    tied = np.abs(np.abs(found.reshape(-1, len(lengths))) - 0.5 * sides) < BORDER
    assert gaps[~tied].max() < SINGLE
    assert (np.abs(difference) > 0.5 * sides)[..., [x is not None for x in lengths]].any()
    reach = 0.49 * min(x for x in lengths if x is not None)
    linked, distances = neighbours(q, lengths, reach)
    assert np.abs(pair_distances(q, space) - distances)[linked].max() < SINGLE
    assert agree(pair_distances(q, space) < reach, distances, q, lengths, reach) > 50


@pytest.mark.parametrize("lengths", BOXES)
@pytest.mark.parametrize("seed", range(5))
def test_flocks_and_closest_pairs(lengths, seed):
    q, space = agents(lengths, seed), fk.Periodic(lengths)
    linked, distances = neighbours(q, lengths, RADIUS)
    box = box_of(lengths)
    clusters = freud().cluster.Cluster()
    clusters.compute((box, box.wrap(in_three(q))), neighbors={"r_max": RADIUS, "exclude_ii": True})
    links = fk.Proximity(RADIUS).links_in(space, q)
    if (np.abs(pair_distances(q, space) - RADIUS) > BORDER).all():
        assert observables.flocks(links) == clusters.num_clusters
    found, pair = observables.closest_pair(fk.State(q), space)
    assert found == pytest.approx(distances.min(), abs=SINGLE)
    assert distances[pair] == pytest.approx(found, abs=SINGLE)
    assert linked.any()


LAW = fk.Law(fk.Proximity(RADIUS), [fk.Gradient(fk.Potential("k*(1 - r/R)**2", k=2.0, R=RADIUS)), fk.Consensus(0.3)])
"""Agents that repel each other within the radius."""

WORLDS = {
    "exact": {},
    "sampled": {"control": fk.Held(0.05), "information": fk.Messages(0.05, delay=0.02, loss=0.2)},
    "delayed": {"information": fk.Delayed(0.05)},
    "tiles": {},
    "held tiles": {"control": fk.Held(0.05)},
}
"""What the engines need."""


@pytest.mark.parametrize("lengths", [(7.0, 5.0), (6.0, 5.0, 7.0)])
@pytest.mark.parametrize("name", WORLDS)
def test_links_of_every_frame_of_every_engine(name, lengths):
    q = agents(lengths, 3)
    rng = np.random.default_rng(4)
    start = fk.State(q, rng.normal(size=q.shape))
    made = fk.Scenario(LAW, start, t_end=3.0, frames=13, space=fk.Periodic(lengths), **WORLDS[name])
    run = fk.simulate(made, engine=name.removeprefix("held "), progress=False)
    decided = 0
    for k in range(len(run.t)):
        _, distances = neighbours(np.asarray(run.q[k], dtype=np.float64), lengths, RADIUS)
        links = run.links[k] if run.links.size else run.state(k).links
        if links is None:
            links = LAW.graph.links_in(made.space, np.asarray(run.q[k], dtype=np.float64))
        decided += agree(np.asarray(links), distances, np.asarray(run.q[k], dtype=np.float64), lengths)
    assert decided > 300
    # Agents have crossed borders, and links have changed.
    cells = np.floor(np.asarray(run.q[-1]) / lengths) != np.floor(np.asarray(run.q[0]) / lengths)
    assert cells.any()


def test_forces_are_sums_over_neighbours_of_freud():
    """The force of every agent from freud's displacements alone, and the momentum that all of them keep."""
    lengths = (7.0, 5.0)
    q = agents(lengths, 5)
    start = fk.State(q, np.random.default_rng(6).normal(size=q.shape))
    box = box_of(lengths)
    query = freud().locality.AABBQuery(box, box.wrap(in_three(q)))
    found = query.query(query.points, {"r_max": RADIUS, "exclude_ii": True}).toNeighborList()
    i, j, r = found.query_point_indices, found.point_indices, found.distances
    along = (2.0 * 2.0 * (1.0 - r / RADIUS) * (-1.0 / RADIUS))[:, None] * found.vectors[:, :2] / r[:, None]
    expected = np.zeros_like(q)
    np.add.at(expected, i, along + 0.3 * (start.p[j] - start.p[i]))
    forces = fk.control(LAW, start, space=fk.Periodic(lengths))
    assert np.abs(expected).max() > 1.0
    assert np.abs(forces - expected).max() < 100 * SINGLE
    run = fk.simulate(fk.Scenario(LAW, start, t_end=3.0, frames=4, space=fk.Periodic(lengths)), progress=False)
    assert np.abs(run.p.sum(axis=1) - start.p.sum(axis=0)).max() < 1e-9
    assert np.abs(run.residual).max() < 1e-7 * max(1.0, run.turnover)
