"""The controller of one agent: the force of `control_of`, the memory of its graph, and what it refuses."""

import time
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import flocking as fk
from flocking.errors import InvalidInput
from flocking.model.graphs.seen_headings import links_at_state
from tests.contracts.strategies import STRUCTURES, case_of

PSI = fk.Potential("1/r + 1/(R - r)", R=4.0)
LAW = fk.Law(fk.Hysteresis(4.0, 0.5), [fk.Gradient(PSI), fk.Consensus(0.7)])
TRIO = fk.Fixed.complete(3)
TURNED = np.tile(np.eye(2), (2, 1, 1))


class Beside(fk.FieldOfView):
    """A field of view of a user, who may see others."""


OTHERS = Beside(2.0, 1.0)
LEFT = fk.FieldOfView(2.0, 1.0, "axis_2")
CALM = {"own_p": [0.0, 0.0], "p": [[0.0, 0.0]]}


def distributed(name):
    case = case_of(STRUCTURES[name], 5, 2, 1)
    return case.law.distributed and all(not g.moves or g.follows_radii for g in case.law.graphs)


@settings(max_examples=15, deadline=None)
@given(st.sampled_from(sorted(n for n in STRUCTURES if distributed(n))), st.integers(0, 10**6), st.booleans())
def test_the_force_is_that_of_the_law(name, seed, relative):
    """Every agent alone finds the force that the whole group has at a start."""
    case = case_of(STRUCTURES[name], 6, 2, seed)
    start = fk.State(case.state.q, case.state.p, case.state.t)
    u = fk.control(case.law, start, agents=case.agents)
    for i in range(6):
        others = [j for j in range(6) if j != i]
        controller = fk.Controller(
            case.law, i, agents=6, mass=float(case.agents.masses[i]), damping=float(case.agents.damping[i]),
            relative=relative,
        )  # fmt: skip
        own = start.q[i] * relative, start.p[i] * relative
        q, p = start.q[others] - own[0], start.p[others] - own[1]
        found = controller(start.t, start.q[i], start.p[i], ids=others, q=q, p=p)
        size = 1.0 + np.abs(u).max() + np.abs(start.q).max()
        assert found == pytest.approx(u[i], abs=1e-10 * size)


def test_links_follow_the_graph_call_by_call():
    """The links of a controller are the agent's row of the links of the group, over a run with hysteresis."""
    run = fk.simulate(
        fk.Scenario(LAW, fk.start.box(9, side=7, speed=3, seed=2, connected_under=LAW.graph), t_end=4.0, frames=400)
    )
    controller = fk.Controller(LAW, 3, agents=9)
    others = [j for j in range(9) if j != 3]
    links, switched = LAW.graph.initial(run.q[0]), 0
    for t, q, p in zip(run.t, run.q, run.p, strict=True):
        before, links = links, LAW.graph.update(q, links)
        switched += int((before != links)[3].sum())
        found = controller(float(t), q[3], p[3], ids=others, q=q[others], p=p[others])
        assert (controller.links[0] == links[3]).all()
        expected = fk.control(LAW, fk.State(q, p, float(t), links))[3]
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert switched > 3


def test_who_is_not_named_is_forgotten_and_must_appear_anew():
    controller = fk.Controller(LAW, agents=2)

    def linked(t, distance=None):
        if distance is None:
            controller(t, [0.0, 0.0], [0.0, 0.0], ids=[], q=[], p=[])
        else:
            controller(t, [0.0, 0.0], ids=[1], q=[[distance, 0.0]], **CALM)
        return bool(controller.links[0, 1])

    # Between the distances at which links appear, 3.5, and break, 4.
    assert [linked(0.0, 3.8), linked(1.0, 3.9), linked(2.0), linked(3.0, 3.8), linked(4.0, 3.4), linked(5.0, 3.8)] == [
        True, True, False, False, True, True]  # fmt: skip
    controller.reset()
    assert linked(0.0, 3.8)


def test_old_states_are_not_used():
    controller = fk.Controller(LAW, agents=3, expires=0.5)
    known = {"ids": [1, 2], "q": [[2.0, 0.0], [0.0, 3.0]], "p": [[0.0, 0.0]] * 2, "own_p": [0.0, 0.0]}
    both = controller(1.0, [0.0, 0.0], stamps=[1.0, 0.6], **known)
    assert controller.links[0].tolist() == [False, True, True]
    one = controller(1.1, [0.0, 0.0], stamps=[1.1, 0.6], **known)
    assert controller.links[0].tolist() == [False, True, False]
    assert both[1] != 0.0 == one[1]
    wrong = (None, [1.0], [9.0, 1.0], [np.nan, 1.0], [-np.inf, 1.0], ["1.0", "1.0"], [[1.0, 1.0]], 1.0, [1j, 1.0])
    # They are checked where nothing expires, too; and nobody has none.
    for keeper in (controller, fk.Controller(LAW, agents=3)):
        for stamps in wrong if keeper is controller else wrong[1:]:
            with pytest.raises(InvalidInput, match="Controller: stamps"):
                keeper(1.2, [0.0, 0.0], stamps=stamps, **known)
        assert keeper(1.2, [0.0, 0.0], [0.0, 0.0], ids=[], q=[], p=[]).tolist() == [0.0, 0.0]
    assert (fk.Controller(LAW, agents=3)(1.0, [0.0, 0.0], stamps=[1.0, 0.1], **known) == both).all()


def test_a_neighbour_whose_squared_distance_overflows_is_not_taken_for_an_old_one():
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Consensus(1.0)])
    for stamps in (None, [1.0]):
        controller = fk.Controller(law, agents=2, expires=None if stamps is None else 0.5)
        found = controller(1.0, [0.0, 0.0], [0.0, 0.0], ids=[1], q=[[1e200, 0.0]], p=[[2.0, 3.0]], stamps=stamps)
        assert found.tolist() == [2.0, 3.0]


def test_forces_are_limited_by_length():
    free, limited = fk.Controller(LAW, agents=2), fk.Controller(LAW, agents=2, limit=0.5)
    u = free(0.0, [0.0, 0.0], ids=[1], q=[[0.4, 0.3]], **CALM)
    scaled = limited(0.0, [0.0, 0.0], ids=[1], q=[[0.4, 0.3]], **CALM)
    assert np.linalg.norm(u) > 0.5
    assert scaled == pytest.approx(u * 0.5 / np.linalg.norm(u))
    assert (free.saturated, limited.saturated) == (False, True)
    limited(1.0, [0.0, 0.0], ids=[1], q=[[2.0, 0.0]], **CALM)
    assert not limited.saturated


def test_space_averages_schedules_and_fixed_graphs():
    torus = fk.Periodic([10.0, 10.0])
    near = fk.Controller(LAW, agents=2, space=torus)(0.0, [0.5, 0.0], ids=[1], q=[[29.0, 0.0]], **CALM)
    assert near == pytest.approx([-(-1 / 1.5**2 + 1 / 2.5**2), 0.0])
    mean = fk.Law(fk.Proximity(2.0), [fk.VelocityAverage(3.0)])
    found = fk.Controller(mean, agents=9)(
        0.0, [0.0, 0.0], [1.0, 0.0], ids=[4, 7, 8], q=[[1.0, 0.0], [0.0, 1.0], [9.0, 0.0]], p=[[0.0, 0.0]] * 3
    )
    assert found == pytest.approx([-2.0, 0.0])
    track = fk.Track(fk.Velocity([0.0, 0.0]), fk.Schedule([1.0], [1.0, 4.0]), 0.0)
    controller = fk.Controller(fk.Law(fk.Proximity(1.0), [track]), agents=1)
    for t, gain in ((0.0, 1.0), (0.999, 1.0), (1.0, 4.0), (2.0, 4.0)):
        assert controller(t, [1.0, 0.0], [0.0, 0.0], ids=[], q=[], p=[]) == pytest.approx([-gain, 0.0])
    fixed = fk.Controller(fk.Law(fk.Fixed(3, [(0, 2)]), [fk.Consensus(1.0)]), agents=3)
    for t in (0.0, 1.0, 2.0):
        known = {"ids": [1, 2], "q": [[1.0, 0.0], [99.0, 0.0]], "p": [[5.0, 0.0], [1.0, 2.0]]}
        assert fixed(t, [0.0, 0.0], [0.0, 0.0], **known) == pytest.approx([1.0, 2.0])


def test_forces_whose_length_overflows_are_limited():
    """The limit in the direction of the force, where its length is no finite number."""
    sink = fk.Law(fk.Proximity(1.0), [fk.Track(fk.Sink([0.0, 0.0]), 1.5e308)])
    u = fk.Controller(sink, agents=1, limit=2.0)(0.0, [1.0, -1.0], [0.0, 0.0], ids=[], q=[], p=[])
    assert u == pytest.approx([-np.sqrt(2.0), np.sqrt(2.0)], rel=1e-15)


class Odd:
    """Something that is no number."""


class Unprintable:
    """Something that cannot be said in a message either."""

    def __repr__(self):
        raise RuntimeError


LOOP: list = []
LOOP.append(LOOP)


@pytest.mark.parametrize("name", ["t", "own_q", "own_p", "ids", "q", "p", "stamps"])
@pytest.mark.parametrize(
    "wrong",
    [None, "a", "1", b"1", ["a"], [["1", "2"]], [None], [[1.0], [1.0, 2.0]], {}, {"a": 1}, Odd(), [Odd()], 1j,
     [1j, 0.0], np.array([1j, 0.0]), [10**400], 10**400, [[[1.0]]], np.array(["1"]), object, [True],
     np.datetime64("2026-01-01"), Unprintable(), [Unprintable()], LOOP],
    ids=lambda x: type(x).__name__,
)  # fmt: skip
def test_arguments_of_other_types_are_refused_in_a_sentence(name, wrong):
    if name == "stamps" and wrong is None:
        return
    controller = fk.Controller(LAW, agents=3)
    usual = {"t": 0.0, "own_q": [0.0, 0.0], "ids": [1], "q": [[2.0, 0.0]], **CALM}
    before = controller(**usual)
    with pytest.raises(InvalidInput, match=f"Controller: {'own_q|own_p' if 'own' in name else 'q|p|ids|t|stamps'}"):
        controller(**{**usual, name: wrong})
    assert (controller(**usual) == before).all()


@pytest.mark.parametrize("links", ["ab", None, [[1, 0], [1]], [[2, 0, 1]], [[np.nan, 0, 1]], [["a", "", ""]], [[True]]])
def test_links_of_other_types_are_refused(links):
    controller = fk.Controller(LAW, agents=3)
    with pytest.raises(InvalidInput, match="Controller: links must"):
        controller.recall(links)
    assert not controller.links.any()
    controller.recall([[False, True, False]])
    assert controller.links[0].tolist() == [False, True, False]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"ids": []}, "q must be 2 numbers"), ({"own_q": [0.0]}, "own_q must have 2"),
        ({"q": [[1.0, 0.0, 0.0]]}, "q must be 2 numbers for each of ids"),
        ({"ids": [1, 2]}, "q must be 2 numbers"), ({"ids": [5]}, "ids must be from 0 to 2"),
        ({"ids": [0]}, "ids must differ"), ({"ids": [1.5]}, "ids must be a list of whole numbers"),
        ({"ids": [[1]]}, "ids must be a list"), ({"own_p": [0.0]}, "own_q must have 2"),
        ({"p": [[0.0]]}, "q must be 2 numbers"),
        ({"ids": [2, 2], "q": [[2.0, 0.0]] * 2, "p": [[0.0, 0.0]] * 2}, "ids must differ"),
        ({"ids": [-1]}, "ids must be from 0"), ({"t": -1.0}, "t must not be before"),
        ({"t": np.nan}, "t must be finite"), ({"t": np.inf}, "t must be finite"),
            ({"q": [[np.nan, 0.0]]}, "must be finite"),
        ({"own_p": [np.inf, 0.0]}, "must be finite"), ({"q": [[0.0, 0.0]]}, "where the force of the law is finite"),
    ],
)  # fmt: skip
def test_malformed_calls_are_refused_and_change_nothing(arguments, said):
    controller = fk.Controller(LAW, agents=3)
    usual = {"t": 0.0, "own_q": [0.0, 0.0], "ids": [1], "q": [[2.0, 0.0]], **CALM}
    before = controller(**usual)
    with pytest.raises(InvalidInput, match=f"Controller: .*{said}"):
        controller(**{**usual, **arguments})
    assert controller.links[0].tolist() == [False, True, False]
    assert controller.time == 0.0
    assert (controller(**{**usual, "t": 1.0}) == before).all()


def test_a_neighbour_beyond_a_pole_is_named():
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("1/(4 - r)"))])
    with pytest.raises(InvalidInput, match="nearer than the pole of the potential, 4; got 'agent 1 at distance 5'"):
        fk.Controller(law, agents=2)(0.0, [0.0, 0.0], ids=[1], q=[[3.0, 4.0]], **CALM)


SIDED = [
    ("1/(r - 1)", {0.0: "farther", 0.5: "farther", 1.0: "farther", 2.0: ""}),
    ("-log(r - 1)", {0.5: "farther", 2.0: ""}),
    ("1/(4 - r)", {3.0: "", 4.0: "nearer", 5.0: "nearer"}), ("-log(4 - r)", {3.0: "", 5.0: "nearer"}),
    ("1/(r - 1)**2", {0.5: "", 2.0: "", 1.0: "finite"}),
    ("1/(r - 1) + 1/(4 - r)", {0.5: "farther", 2.0: "", 5.0: "nearer"}),
]  # fmt: skip
"""Potentials between which fixed links hold agents, and at which distances they are refused, with which words."""


@pytest.mark.parametrize(("formula", "distances"), SIDED, ids=[formula for formula, _ in SIDED])
def test_poles_have_a_wrong_side_by_what_the_potential_does_there(formula, distances):
    """Agents that a barrier keeps apart act at all distances beyond it, as in a simulation."""
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential(formula))])
    for r, said in distances.items():
        controller = fk.Controller(law, agents=2)
        others = [fk.Agent([r, 0.0], [0.0, 0.0], 1)]
        if said:
            with pytest.raises(InvalidInput, match=f"Controller: q must be .*{said}"):
                controller(0.0, [0.0, 0.0], ids=[1], q=[[r, 0.0]], **CALM)
            with pytest.raises(InvalidInput, match="control_of: neighbours must be at distances"):
                fk.control_of(law, fk.Agent([0.0, 0.0], [0.0, 0.0], 0), others)
        else:
            expected = fk.control(law, fk.State([[0.0, 0.0], [r, 0.0]], np.zeros((2, 2))))[0]
            assert controller(0.0, [0.0, 0.0], ids=[1], q=[[r, 0.0]], **CALM) == pytest.approx(expected, rel=1e-12)
            found = fk.control_of(law, fk.Agent([0.0, 0.0], [0.0, 0.0], 0), others)
            assert found == pytest.approx(expected, rel=1e-12)


def test_poles_within_the_reach_of_links_are_watched():
    """A link from before a pole may be carried past it; the slope of a logarithm goes on where it has no value."""
    for formula in ("1/(3.7 - r)", "-log(3.7 - r)"):
        controller = fk.Controller(fk.Law(fk.Hysteresis(4.0, 0.5), [fk.Gradient(fk.Potential(formula))]), agents=2)
        controller(0.0, [0.0, 0.0], ids=[1], q=[[3.4, 0.0]], **CALM)
        with pytest.raises(InvalidInput, match=r"nearer than the pole of the potential, 3\.7"):
            controller(1.0, [0.0, 0.0], ids=[1], q=[[3.9, 0.0]], **CALM)
    inside = fk.Law(fk.Proximity(4.0), [fk.Gradient(fk.Potential("1/(3 - r)"))])
    with pytest.raises(InvalidInput, match="must be finite wherever agents are neighbours"):
        fk.Controller(inside, agents=2)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: fk.Controller(fk.Law(TRIO, [fk.Consensus(functional=True)]), agents=3), "distributed"),
        (lambda: fk.Controller(3), "law must be a Law"),
        (lambda: fk.Controller(LAW, 5, agents=5), "agent must be below"),
        (lambda: fk.Controller(LAW, agents=10**12), "agents must be at most 10000000"),
        (lambda: fk.Controller(LAW, dimension=10**9), "dimension must be at most 64"),
        (lambda: fk.Controller(LAW, limit=0.0), "limit"), (lambda: fk.Controller(LAW, expires=-1.0), "expires"),
        (lambda: fk.Controller(LAW, mass=0.0), "mass"), (lambda: fk.Controller(LAW, space=2), "space"),
        (lambda: fk.Controller(fk.Law(fk.FieldOfView(2.0, 1.0), [fk.Consensus()])), "headings must be given"),
        (lambda: fk.Controller(fk.Law(fk.FieldOfView(2.0, 1.0, "axis_1"),
                                      [fk.Consensus(), fk.Gradient(fk.Potential("r"), over=LEFT)])),
         "must look along one direction of the body; got 'axis_1 and axis_2'"),
        (lambda: fk.Controller(fk.Law(fk.Cone(2.0, 1.0), [fk.Consensus()]), agents=3, headings=[0.0]), "headings must"),
        (lambda: fk.Controller(LAW, agents=3, headings=[0.0]), "headings must have one value for each of the 3"),
        (lambda: fk.Controller(LAW, agents=3, headings=[[0.0], [1.0, 2.0], 3.0]), "sequences of different lengths"),
        (lambda: fk.Controller(fk.Law(fk.FieldOfView([2.0, 1.0], 1.0), [fk.Consensus()]), agents=3,
                               headings=[0.0, 1.0, 2.0]), "radius must have one value for each of the 3"),
        (lambda: fk.Controller(fk.Law(fk.FieldOfView(2.0, [1.0, 2.0], "p"), [fk.Consensus()]), agents=3), "half_angle"),
        (lambda: fk.Controller(fk.Law(fk.Cone(2.0, 1.0), [fk.Consensus()]), agents=2,
                               headings=TURNED), "'rotation' for"),
        (lambda: fk.Controller(fk.Law(fk.Cone(2.0, 1.0, "rotation"), [fk.Consensus()]), agents=2,
                               headings=2.0 * TURNED), "must be rotation matrices"),
        (lambda: fk.Controller(fk.Law(fk.FieldOfView(2.0, 1.0), [fk.Consensus()]), agents=2, headings=2.0 * TURNED),
         "must be rotation matrices"),
        (lambda: fk.Controller(fk.Law(OTHERS, [fk.Consensus()])), "must link by distances or fields of view"),
        (lambda: fk.Controller(fk.Law(fk.FieldOfView(2.0, 1.0), [fk.Consensus()]), agents=2, headings=[0.0, 1.0],
                               dimension=3), "must be directions in 3 dimensions"),
        (lambda: fk.Controller(fk.Law(fk.Proximity(1.0), [fk.Consensus([1.0, 2.0])])), "agents must be 2"),
        (lambda: fk.Controller(fk.Law(fk.Proximity(1.0), [fk.Track(fk.Sink([0.0, 0.0]), shared=True)])), "distributed"),
    ],
)  # fmt: skip
def test_wrong_controllers_are_refused(make, said):
    with pytest.raises(InvalidInput, match=said):
        make()


@pytest.mark.parametrize("relative", [False, True])
@pytest.mark.parametrize(
    "graph",
    [
        fk.FieldOfView(3.0, 1.1), fk.FieldOfView(np.linspace(2.0, 4.0, 9), np.linspace(0.4, np.pi, 9)),
        fk.FieldOfView(3.0, 1.3, "p"), fk.FieldOfView(3.0, np.linspace(0.4, np.pi, 9), "heading"),
        fk.Cone(np.linspace(2.0, 4.0, 9), np.linspace(0.5, 2.5, 9), "wrapped"),
        fk.SmoothCone(3.0, 0.3, 2.0, measure="wrapped"),
    ],
    ids=["view", "views of each", "along velocities", "along bodies", "cones of each", "smooth cone"],
)  # fmt: skip
def test_whom_an_agent_sees_follows_headings_and_velocities(graph, relative):
    """Forces and links are those of the whole group, which `links_at_state` and `fk.evaluate` give, call by call."""
    rng, headings = np.random.default_rng(4), np.linspace(-4.0, 4.0, 9)
    terms = [fk.Gradient(fk.Potential("(r - 2)**2/2")), fk.Consensus(0.5, weighted=True)]
    law, agents = fk.Law(graph, terms), fk.Agents(headings=headings)
    turns = getattr(graph, "heading_column", "") == "heading"
    given = {"agents": 9, "headings": headings, "relative": relative}
    controllers, changed, before = [fk.Controller(law, i, **given) for i in range(9)], 0, None
    for k in range(20):
        q, p = rng.uniform(0.0, 7.0, (9, 2)), rng.normal(size=(9, 2))
        p[k % 9] = 0.0
        angles = rng.uniform(-np.pi, np.pi, 9)
        pointing = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        state = fk.State(q, p, columns={"heading": pointing} if turns else {})
        links = links_at_state(graph, fk.Open(), state, headings)
        expected = fk.evaluate(law, fk.State(q, p, links=links), agents=agents).u
        for i, controller in enumerate(controllers):
            others = [j for j in range(9) if j != i]
            own = q[i] * relative, p[i] * relative
            looking = {"heading": pointing[i]} if turns else {}
            found = controller(0.1 * k, q[i], p[i], ids=others, q=q[others] - own[0], p=p[others] - own[1], **looking)
            assert (controller.links[0] == links[i]).all()
            assert found == pytest.approx(expected[i], abs=1e-11)
        changed += 0 if before is None else int((links != before).sum())
        before = links
    assert changed > 50
    assert 0 < before.sum() < 40


@pytest.mark.parametrize("graph", [fk.FieldOfView(2.0, 1e-9), fk.FieldOfView(2.0, 1e-9, "p"), fk.Cone(2.0, 0.5)])
def test_agents_at_the_border_itself_are_neighbours(graph):
    """Straight ahead within a view whose cosine is 1, at the radius itself, with the opening as the gap of headings."""
    controller = fk.Controller(fk.Law(graph, [fk.Consensus()]), agents=2, headings=[0.0, 0.5])
    known = {"ids": [1], "q": [[2.0, 0.0]], "p": [[1.0, 0.0]]}
    assert controller(0.0, [0.0, 0.0], [3.0, 0.0], **known) == pytest.approx([-2.0, 0.0])
    assert controller.links.tolist() == [[False, True]]


@pytest.mark.parametrize("weights", [None, fk.HashedWeights(0.5, 1.5, seed=3)], ids=["headings", "hashed"])
def test_weights_of_pairs_take_the_memory_of_one_row(weights):
    """Those of all pairs of 3,000 agents take 72 MB."""
    graph = fk.Proximity(2.0) if weights is not None else fk.SmoothCone(2.0, 0.3, 1.0)
    gain = {"weights": weights} if weights is not None else {"weighted": True}
    law, known = fk.Law(graph, [fk.Consensus(1.0, **gain)]), {"ids": [1], "q": [[0.5, 0.0]], "p": [[1.0, 0.0]]}
    found = []
    for agents in (2, 3000):
        tracemalloc.start()
        controller = fk.Controller(law, agents=agents, headings=np.linspace(0.0, 0.5, agents) if agents == 2 else
                                   np.r_[0.0, np.full(agents - 1, 0.5)])  # fmt: skip
        found.append(controller(0.0, [0.0, 0.0], [0.0, 0.0], **known).tolist())
        assert tracemalloc.get_traced_memory()[1] < 20e6
        tracemalloc.stop()
    assert found[0] == found[1]
    assert 0.0 < found[0][0] < 1.5


def test_a_call_takes_a_small_part_of_the_general_function():
    """Ten neighbours, the best of many stretches of each, side by side."""
    rng = np.random.default_rng(0)
    q, p = rng.normal(size=(11, 2)) * 1.2, rng.normal(size=(11, 2))
    controller = fk.Controller(LAW, agents=11)
    known = {"ids": np.arange(1, 11), "q": q[1:].copy(), "p": p[1:].copy()}
    agents = [fk.Agent(q[j], p[j], j) for j in range(11)]
    near = [agents[j] for j in range(1, 11) if np.linalg.norm(q[j] - q[0]) < 4.0]
    fast, slow = [], []
    # Short stretches of processor time: on a busy machine some of them meet nobody else.
    for _ in range(40):
        begin = time.thread_time()
        for _ in range(25):
            controller(0.0, q[0], p[0], **known)
        fast.append((time.thread_time() - begin) / 25)
        begin = time.thread_time()
        fk.control_of(LAW, agents[0], near)
        slow.append(time.thread_time() - begin)
    assert min(fast) < min(slow) / 10


def test_a_call_takes_less_than_four_times_ten_additions_of_numpy():
    """Ten neighbours. Where ten additions of short arrays take 5 microseconds a call takes less than 20."""
    rng = np.random.default_rng(0)
    q, p = rng.normal(size=(11, 2)) * 1.2, rng.normal(size=(11, 2))
    controller = fk.Controller(LAW, agents=11)
    known = {"ids": np.arange(1, 11), "q": q[1:].copy(), "p": p[1:].copy()}
    short, call, reference = np.arange(20.0), [], []
    for _ in range(60):
        begin = time.thread_time()
        for _ in range(25):
            controller(0.0, q[0], p[0], **known)
        call.append(time.thread_time() - begin)
        begin = time.thread_time()
        for _ in range(25):
            x = short
            for _ in range(10):
                x = np.add(x, 1.0)
        reference.append(time.thread_time() - begin)
    assert min(call) < 4.0 * min(reference)


FACING = fk.Law(fk.FieldOfView(2.0, 1.0, "heading"), [fk.Consensus()])


@pytest.mark.parametrize(
    ("law", "heading", "said"),
    [
        (FACING, None, "heading must be given, as a field of view looks along the 'heading' of the body"),
        (FACING, [1.0, 0.0, 0.0], "heading must have 2 components"), (FACING, [0.0, 0.0], "must be a unit vector"),
        (FACING, [np.nan, 0.0], "must be a unit vector"), (FACING, [1.0, 1.0], "must be a unit vector"),
        (FACING, "north", "heading must be real numbers"),
        (LAW, [1.0, 0.0], "heading must be left out where no graph looks along"),
    ],
)  # fmt: skip
def test_a_wrong_heading_is_refused_and_changes_nothing(law, heading, said):
    controller = fk.Controller(law, agents=3)
    with pytest.raises(InvalidInput, match=said):
        controller(0.0, [0.0, 0.0], [0.0, 0.0], ids=[1], q=[[1.0, 0.0]], p=[[0.0, 0.0]], heading=heading)
    assert controller.time == -np.inf
    assert not controller.links.any()


HIDDEN = np.ma.array([1.0, 0.0], mask=[False, True])
"""A measurement of which one component is missing; zero stands behind the mask."""


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"heading": HIDDEN}, "heading must have no masked"), ({"own_q": HIDDEN}, "own_q must have no masked"),
        ({"own_p": HIDDEN}, "own_p must have no masked"), ({"q": HIDDEN[None]}, "q must have no masked"),
        ({"p": HIDDEN[None]}, "p must have no masked"),
        ({"stamps": np.ma.array([0.0], mask=[True])}, "stamps must have no masked"),
        ({"ids": np.ma.array([1], mask=[True])}, "ids must have no masked"),
        ({"heading": [1e308, 1e308]}, "heading must be a unit vector"),
    ],
)  # fmt: skip
def test_what_stands_behind_a_mask_is_not_taken_for_measured(given, said):
    controller = fk.Controller(FACING, agents=3)
    call = {"own_q": [0.0, 0.0], "own_p": [0.0, 0.0], "ids": [1], "q": [[1.0, 0.0]], "p": [[0.0, 1.0]],
            "heading": [1.0, 0.0]}  # fmt: skip
    assert controller(0.0, **(call | {"own_q": np.ma.array([0.0, 0.0])})).tolist() == [0.0, 1.0]
    with pytest.raises(InvalidInput, match=said):
        controller(0.0, **(call | given))


@pytest.mark.parametrize("seed", range(3))
def test_robots_with_cameras_on_their_bodies_drive_as_those_of_a_run(seed):
    """The force that a run holds from tick to tick is that which each controller finds from headings at the ticks."""
    rng, n, period = np.random.default_rng(seed), 7, 0.1
    angles = rng.uniform(-np.pi, np.pi, n)
    start = fk.State(rng.uniform(0.0, 3.0, (n, 2)), rng.normal(size=(n, 2)),
                     columns={"heading": np.stack([np.cos(angles), np.sin(angles)], axis=1)})  # fmt: skip
    law = fk.Law(fk.FieldOfView(2.0, 1.2, "heading"), [fk.Consensus(0.8), fk.Gradient(fk.Potential("(r - 1)**2/2"))])
    scenario = fk.Scenario(law, start, t_end=3.0, frames=31, bodies=fk.Unicycle(0.2), control=fk.Held(period))
    run = fk.simulate(scenario, progress=False)
    controllers = [fk.Controller(law, i, agents=n) for i in range(n)]
    turned = np.degrees(np.arccos(np.clip((run.columns["heading"] * start.columns["heading"]).sum(axis=2), -1, 1)))
    assert turned.max() > 60.0
    counts = set()
    for k in range(30):
        for i, controller in enumerate(controllers):
            others = [j for j in range(n) if j != i]
            force = controller(run.t[k], run.q[k, i], run.p[k, i], ids=others, q=run.q[k, others], p=run.p[k, others],
                               heading=run.columns["heading"][k, i])  # fmt: skip
            counts.add(int(controller.links.sum()))
            np.testing.assert_allclose(run.p[k + 1, i] - run.p[k, i], period * force, rtol=0.0, atol=1e-11)
    assert {0, 1, 2} <= counts
