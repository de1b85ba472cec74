"""The tiled engine in space that repeats: every image of every pair, taken one by one, is the judge."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import flocking as fk
from flocking.engine.runs.run import OBSERVED_FIELDS
from flocking.engine.tiles.neighbours.cell_list import choose_grid
from flocking.engine.tiles.observables import observe
from flocking.engine.tiles.session import TilesOptions, TilesSession
from flocking.errors import StepTooLarge
from flocking.model.graphs.smooth_graphs import PerAgentRadii

R = 1.0
GAIN = 0.4
PULL = fk.Potential("k*(r - d)**2", k=0.7, d=0.6)
BOXES = {
    "plane": (6.0, 7.0),
    "channel": (5.0, np.inf),
    "smallest": (2.0 * R * (1 + 1e-9), 2.5),
    "three cells": (3.1, 4.2),
    "space": (4.0, 5.0, 6.0),
    "tube": (np.inf, 2.2, np.inf),
}


def group(lengths, n=150, seed=0, far=3, speed=1.0):
    """Agents at random, most of them some lengths away from the box."""
    rng = np.random.default_rng(seed)
    finite = np.array([x if np.isfinite(x) else 6.0 for x in lengths])
    q = rng.random((n, len(lengths))) * finite
    moved = np.where(np.isfinite(lengths), finite, 0.0) * rng.integers(-far, far + 1, size=q.shape)
    return fk.State(q + moved, rng.normal(size=q.shape) * speed)


def images(lengths, q):
    """Displacements of every pair to every image that may be near, shape (K, N, N, m)."""
    d = q[None] - q[:, None]
    for k, length in enumerate(lengths):
        if np.isfinite(length):
            d[..., k] = np.fmod(d[..., k], length)
    cells = product(*((-1, 0, 1) if np.isfinite(x) else (0,) for x in lengths))
    return np.array([d + [c * x if c else 0.0 for c, x in zip(cell, lengths, strict=True)] for cell in cells])


def brute(lengths, q, p, linked=None, radius=R):
    """Forces and links: the pull of linked images and consensus, summed one by one; links as given, or near."""
    u, links = np.zeros_like(q), np.zeros((len(q), len(q)), dtype=bool)
    for d in images(lengths, q):
        r = np.sqrt((d**2).sum(axis=2))
        # Of linked pairs the image within half a length, of which there is one.
        near = (r < (radius if np.ndim(radius) == 0 else np.asarray(radius)[:, None])) & ~np.eye(len(q), dtype=bool)
        near = near if linked is None else near & linked
        links |= near
        along = np.where(near, 2 * 0.7 * (r - 0.6) / np.where(near, r, 1.0), 0.0)
        u += (along[..., None] * d).sum(axis=1) + GAIN * (near[..., None] * (p[None] - p[:, None])).sum(axis=1)
    return u, links


def law(graph):
    return fk.Law(graph, [fk.Gradient(PULL), fk.Consensus(GAIN)])


def scenario(lengths, start, graph=None, t_end=1.0, **fields):
    fields = {"frames": 5, **fields}
    return fk.Scenario(law(graph or fk.Proximity(R)), start, t_end, space=fk.Periodic(lengths), **fields)


@pytest.mark.parametrize("box", BOXES)
@pytest.mark.parametrize("n", [2, 17, 150])
def test_forces_and_links_are_those_of_all_images(box, n):
    lengths = BOXES[box]
    for seed in range(3):
        start = group(lengths, n, seed=seed)
        session = TilesSession(scenario(lengths, start), TilesOptions(step=1e-3))
        expected, links = brute(lengths, start.q, start.p)
        assert np.abs(session.accelerations() - expected).max() < 1e-11
        assert np.array_equal(session.state.links, links)
        assert links.any() or n == 2
        reference = fk.control(law(fk.Proximity(R)), start, space=fk.Periodic(lengths))
        assert np.abs(reference - expected).max() < 1e-11


@pytest.mark.parametrize("box", ["plane", "smallest", "space"])
def test_single_precision_sees_the_same_images(box):
    lengths = BOXES[box]
    start = group(lengths, seed=4, far=1)
    session = TilesSession(scenario(lengths, start), TilesOptions(step=1e-3, precision="float32"))
    rounded = start.q.astype(np.float32).astype(np.float64)
    expected, links = brute(lengths, rounded, start.p.astype(np.float32).astype(np.float64))
    distances = np.sqrt((images(lengths, rounded) ** 2).sum(axis=3))
    sure = (np.abs(distances - R) > 1e-4).all(axis=(0, 2))
    assert sure.sum() > 50
    # Positions of up to 14 are known to 1e-6; the pull of a hundred neighbours at short distances multiplies it.
    assert np.abs(session.accelerations() - expected)[sure].max() < 2e-4 * np.abs(expected).max()
    assert np.array_equal(session.state.links[sure], links[sure])


@pytest.mark.parametrize("box", ["plane", "channel", "space"])
def test_each_agent_senses_within_its_own_radius(box):
    lengths = BOXES[box]
    start = group(lengths, 90, seed=6)
    radii = np.random.default_rng(1).uniform(0.3, 1.4, 90)
    session = TilesSession(scenario(lengths, start, PerAgentRadii(radii)), TilesOptions(step=1e-3))
    assert np.abs(session.accelerations() - brute(lengths, start.q, start.p, radius=radii)[0]).max() < 1e-11
    # Pairs are counted from below by what every agent senses.
    assert session._particles.radii.certain_reaches() == [radii.min()]


def stepped(lengths, start, h, count, gap=0.0, order=2):
    """The scheme on explicit images: half-step Verlet, or forward Euler; links remember, judged at every step."""
    q, p, last = start.q.copy(), start.p.copy(), 0.0
    remembered = brute(lengths, q, p, radius=R)[1]
    changes = 0
    for _ in range(count):
        inside, appeared = (brute(lengths, q, p, radius=radius)[1] for radius in (R, R - gap))
        links = inside & (remembered | appeared)
        changes += int((links != remembered).sum())
        u = brute(lengths, q, p if order == 2 else 0 * p, links)[0]
        p = p + 0.5 * (last + h) * u if order == 2 else u
        q, last, remembered = q + h * p, h, links
    return q, changes


FEW = {(1, "plane"), (1, "space"), (2, "channel"), (2, "smallest"), (2, "three cells"), (2, "tube")}
"""Order and box of the cases that the default tests try."""


@pytest.mark.parametrize(
    ("order", "box"),
    [pytest.param(*x, marks=() if x in FEW else pytest.mark.slow) for x in product((1, 2), BOXES)],
)
def test_the_motion_and_the_memory_of_links_are_those_of_all_images(box, order):
    lengths, h, count = BOXES[box], 0.01, 60
    start = group(lengths, 50, seed=8, speed=2.0)
    bodies = fk.Agents() if order == 2 else fk.SingleIntegrator()
    found = fk.simulate(
        scenario(lengths, start, fk.Hysteresis(R, 0.2), h * count, agents=bodies, frames=2),
        engine="tiles", step=h, scheme="verlet" if order == 2 else "euler", ledger=False, progress=False,
    )  # fmt: skip
    expected, changes = stepped(lengths, start, h, count, gap=0.2, order=order)
    if order == 2:
        assert changes > 20
        assert found.provenance["rebuilds"] > 1
    assert np.abs(found.q[-1] - expected).max() < 1e-9


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("box", ["plane", "tube", "space"])
def test_momentum_is_kept_the_ledger_balances_and_the_law_is_obeyed(box, precision):
    lengths = BOXES[box]
    start = group(lengths, 120, seed=9, far=1)
    soft = fk.Law(fk.Smooth(R, 0.3), [fk.Gradient(fk.Potential("(R - r)**3", R=1.0)), fk.Consensus(0.3)])
    made = scenario(lengths, start).with_(law=soft)
    found = fk.simulate(made, engine="tiles", step=2e-3, scheme="rk4", precision=precision, progress=False)
    assert found.status == "finished"
    drift = np.abs(found.p.sum(axis=1) - found.p[0].sum(axis=0)).max()
    assert drift < (1e-11 if precision == "float64" else 1e-3)
    assert np.abs(found.residual).max() < (1e-7 if precision == "float64" else 1e-3) * found.turnover
    agreement = found.fidelity.law
    assert agreement.checks > 0
    assert agreement.gap <= agreement.allowed


def test_agents_that_have_gone_round_many_times_are_judged_by_what_single_precision_knows():
    lengths = BOXES["plane"]
    start = group(lengths, 120, seed=3, far=200)
    found = fk.simulate(
        scenario(lengths, start, t_end=0.1), engine="tiles", step=1e-3, precision="float32", progress=False
    )
    assert found.status == "finished"
    assert found.fidelity.law.checks > 0


def test_the_exact_engine_is_met_with_the_order_of_the_scheme():
    lengths = BOXES["plane"]
    soft = fk.Law(
        fk.Smooth(2.0, 0.2), [fk.Gradient(fk.Potential("(R - r)**5", R=2.0)), fk.Consensus(0.2, weighted=True)]
    )
    made = scenario(lengths, group(lengths, 12, seed=2, far=0), t_end=0.8, frames=2).with_(law=soft, tolerance=1e-11)
    exact = fk.simulate(made, progress=False)
    assert len(exact.switches) > 5
    # Weights whose second derivative jumps leave order 3 of the 4.
    for scheme, order in (("rk4", 3), ("verlet", 1)):
        errors = []
        for h in (0.02, 0.01):
            run = fk.simulate(made, engine="tiles", step=h, scheme=scheme, progress=False)
            errors.append(np.abs(run.q[-1] - exact.q[-1]).max())
        assert errors[1] < (1e-4 if scheme == "rk4" else 1e-2)
        assert np.log2(errors[0] / errors[1]) > order - 0.6


def test_any_number_of_threads_and_a_snapshot_give_the_same_bits():
    lengths = BOXES["space"]
    made = scenario(lengths, group(lengths, 400, seed=1), fk.Hysteresis(R, 0.2), t_end=0.3)
    runs = []
    for threads in (1, 3):
        session = TilesSession(made, TilesOptions(step=2e-3, threads=threads))
        session.advance(0.15)
        if threads == 3:
            session = TilesSession.resume(session.snapshot(), threads=2)
        session.advance(0.3)
        runs.append(session.run())
    for name in ("q", "p", "links", "trace"):
        assert np.array_equal(getattr(runs[0], name), getattr(runs[1], name))


def test_flocks_and_lengths_of_links_go_across_the_border():
    lengths = (8.0, np.inf)
    start = fk.State([[0.1, 0.0], [15.6, 0.0], [4.0, 0.0], [4.5, 0.3]], np.zeros((4, 2)))
    session = TilesSession(scenario(lengths, start), TilesOptions(step=1e-3))
    session.accelerations()
    row = observe(session._particles, 0.0, start.p)
    found = dict(zip(OBSERVED_FIELDS.names or (), row, strict=True))
    assert found["flocks"] == 2
    assert found["closest"] == pytest.approx(0.5)


@pytest.mark.parametrize("space", [fk.Open(), fk.Periodic([9.0, 9.0])])
def test_flocks_are_of_links_and_not_of_who_is_near(space):
    """A pair within its hysteresis that has not met is listed and is not linked: it is no flock, and has no length."""
    law = fk.Law(fk.Hysteresis(4.0, 0.5), [fk.Gradient(fk.Potential("(r - 3)**2/2"))])
    q = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 3.75]])
    links = np.zeros((3, 3), dtype=bool)
    links[0, 1] = links[1, 0] = True
    made = fk.Scenario(law, fk.State(q, np.zeros((3, 2)), links=links), 0.01, frames=2, space=space)
    seen = fk.simulate(made, engine="tiles", step=0.001, observe=True, progress=False).observables
    assert seen["flocks"].tolist() == [2, 2]
    assert seen["neighbours"] == pytest.approx([2 / 3] * 2)
    assert seen["density"] == pytest.approx([2 / 3] * 2)
    assert seen["closest"] == pytest.approx([3.0] * 2)


def test_cells_fill_the_length_and_are_never_narrower_than_the_reach_unless_all_are_neighbours():
    rng = np.random.default_rng(0)
    for _ in range(200):
        reach, length = rng.uniform(0.1, 2.0), rng.uniform(0.3, 30.0)
        high = np.array([10.0 ** rng.uniform(0, 6), 5.0])
        grid = choose_grid(np.zeros(2), high, reach, int(rng.integers(2, 10**5)), (length, np.inf))
        assert grid.inverse[0] * length == pytest.approx(grid.shape[0])
        assert grid.shape[0] == 3 or 1 / grid.inverse[0] > reach
        assert grid.inverse[1] == 1.0 / (reach * (1.0 + 1e-9))


def test_a_pair_that_flies_past_an_image_within_one_step_is_noticed():
    """They start half a length apart and meet across the border, in one step."""
    lengths = (10.0, 10.0)
    singular = fk.Law(fk.Hysteresis(1.0, 0.1), [fk.Gradient(fk.Potential("1/r + 1/(R - r)", R=1.0))])
    start = fk.State([[0.5, 0.0], [8.0, 0.0]], [[-40.0, 0.0], [40.0, 0.0]])
    made = fk.Scenario(singular, start, 0.2, frames=2, space=fk.Periodic(lengths))
    with pytest.raises(StepTooLarge, match="moved"):
        fk.simulate(made, engine="tiles", step=0.05, progress=False)
