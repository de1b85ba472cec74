import dataclasses

import numpy as np
import pytest

import flocking as fk

PSI = fk.Potential("1/r + 1/(R - r)", R=4)
LAW = fk.Law(fk.Hysteresis(radius=4, gap=0.1), [fk.Gradient(PSI), fk.Consensus(1.0)])
LEADER = fk.Velocity([3.0, 3.0], start=[10.0, 10.0])


@pytest.fixture(scope="session")
def psi():
    return PSI


@pytest.fixture(scope="session")
def run():
    """Ten agents under the law of Zhou (8) for three seconds: links appear on the way."""
    begin = fk.start.box(10, side=8, speed=4, seed=1, connected_under=LAW.graph)
    made = fk.simulate(fk.Scenario(LAW, begin, t_end=3, frames=31))
    assert (made.switches["kind"] == "appear").any()
    return made


@pytest.fixture(scope="session")
def led(run):
    """The same frames in a scenario whose law also looks at a leader."""
    law = fk.Law(LAW.graph, [*LAW.terms, fk.Track(LEADER)])
    return dataclasses.replace(run, scenario=fk.Scenario(law, run.scenario.start, t_end=3))


@pytest.fixture(scope="session")
def synthetic(run):
    """Runs with frames drawn at random, of any size and dimension."""

    def make(n, m=2, frames=3, reach=1.6, moving=True):
        from scipy.spatial import KDTree

        rng = np.random.default_rng(7)
        p = rng.normal(size=(frames, n, m)) if moving else np.zeros((frames, n, m))
        q = rng.random((n, m)) * np.sqrt(n) + 0.1 * np.arange(frames)[:, None, None] * p
        links = np.zeros((frames, n, n), dtype=bool)
        for k in range(frames):
            i, j = KDTree(q[k]).query_pairs(reach, output_type="ndarray").T
            links[k, i, j] = links[k, j, i] = True
        start = fk.State(q[0], p[0])
        law = fk.Law(fk.Proximity(reach), [fk.Consensus(1.0)])
        scenario = fk.Scenario(law, start, t_end=float(frames - 1), frames=frames)
        return dataclasses.replace(
            run, scenario=scenario, t=np.arange(frames) * 1.0, q=q, p=p, links=links, switches=run.switches[:0],
            trace=run.trace[:0], closest_linked=type(run.closest)(), closest_unlinked=type(run.closest)(),
        )  # fmt: skip

    return make


@pytest.fixture(scope="session")
def part():
    """Finds the artist of some axes by its label."""

    def find(axes, gid):
        found = [a for a in axes.get_children() if a.get_gid() == gid]
        assert len(found) == 1, f"{len(found)} artists called {gid}"
        return found[0]

    return find


@pytest.fixture(scope="session")
def has():
    return lambda axes, gid: any(a.get_gid() == gid for a in axes.get_children())
