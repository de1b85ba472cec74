"""Links that a state gives: others than the graph has there are kept by other engines, and refused in tiles."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import flocking as fk
from flocking.errors import UnsupportedLaw

PSI = fk.Gradient(fk.Potential("(r - 1.5)**2"))
Q, P = [[0.0, 0.0], [1.0, 0.0], [0.0, 3.1]], [[0.0, 0.0], [0.5, 0.0], [0.0, -0.2]]
FEW = np.array([[0, 1, 0], [1, 0, 0], [0, 0, 0]], dtype=bool)
ALL = ~np.eye(3, dtype=bool)
HELD = {"control": fk.Held(0.1)}


def world(graph, links, **parts):
    return fk.Scenario(fk.Law(graph, [PSI]), fk.State(Q, P, links=links), t_end=0.2, frames=2, **parts)


@pytest.mark.parametrize("graph", [fk.Complete(), fk.Fixed.complete(3)])
@pytest.mark.parametrize("parts", [{}, HELD])
def test_tiles_refuse_links_that_are_not_those_of_the_graph(graph, parts):
    with pytest.raises(UnsupportedLaw, match="differ from it for agents 0 and 2"):
        fk.simulate(world(graph, FEW, **parts), engine="tiles", step=0.01, progress=False)
    fk.simulate(world(graph, ALL, **parts), engine="tiles", step=0.01, progress=False)


def test_fixed_links_of_the_state_give_the_run_of_engines_that_keep_them():
    kept = fk.simulate(world(fk.Complete(), FEW, **HELD), progress=False)
    graph = fk.Fixed(3, [(0, 1)])
    tiled = fk.simulate(world(graph, FEW, **HELD), engine="tiles", step=0.01, progress=False)
    assert_allclose(tiled.q, kept.q, atol=1e-12)
    assert kept.provenance["engine"] == "sampled"


def test_tiles_refuse_them_in_a_state_that_replaces_another():
    session = fk.start(world(fk.Complete(), None), engine="tiles", step=0.01)
    session.advance(0.1)
    with pytest.raises(UnsupportedLaw, match="agents 0 and 2"):
        session.replace(state=fk.State(Q, P, links=FEW))
    session.replace(state=fk.State(Q, P, links=ALL))
    session.advance(0.2)


FAR = np.array([[0, 1, 1], [1, 0, 0], [1, 0, 0]], dtype=bool)
NONE = np.zeros((3, 3), dtype=bool)


@pytest.mark.parametrize("graph", [fk.Proximity(2.5), fk.Hysteresis(2.5, gap=0.5), fk.PerAgentRadii([2.5, 2.5, 2.5])])
@pytest.mark.parametrize("parts", [{}, HELD])
def test_tiles_refuse_links_that_contradict_distances(graph, parts):
    for links, pair in ((NONE, "agents 0 and 1"), (FAR, "agents 0 and 2")):
        with pytest.raises(UnsupportedLaw, match=pair):
            fk.simulate(world(graph, links, **parts), engine="tiles", step=0.01, progress=False)
    fk.simulate(world(graph, FEW, **parts), engine="tiles", step=0.01, progress=False)
    if parts:
        return
    session = fk.start(world(graph, FEW), engine="tiles", step=0.01)
    session.advance(0.1)
    state = session.state
    with pytest.raises(UnsupportedLaw, match="agents 0 and 1"):
        session.replace(state=fk.State(state.q, state.p, links=NONE))
    session.replace(state=fk.State(state.q, state.p, links=FEW))
    session.advance(0.2)


def test_tiles_take_links_between_the_two_distances_as_the_state_gives_them():
    graph = fk.Hysteresis(3.3, gap=0.4)
    for links in (FEW, FAR):
        run = fk.simulate(world(graph, links), engine="tiles", step=0.01, progress=False)
        assert (run.links[0] == links).all()
