"""Laws and states that are replaced while delayed agents run: the past stays, and jumps are known a delay later."""

import numpy as np
import pytest

import flocking as fk
from flocking.engine.archives.data_checks import MalformedError
from flocking.errors import InvalidInput, UnsupportedLaw
from tests.engine.delayed.replaced_plain_delays import ReplacedPlainDelays

GRAPH = fk.Hysteresis(2.0, 0.3)
"""One object: with it the numbers of a law change alone."""

AT = 1.037
"""When something is replaced, in the middle of a step."""

LAST = 2.2


def law(stiff=1.5, gain=0.8, graph=GRAPH, formula="k*(r - 1)**2/2"):
    return fk.Law(graph, [fk.Gradient(fk.Potential(formula, k=stiff)), fk.Consensus(gain)])


CHANGES = {
    "numbers": (law(2.5, 0.3), {"slope": lambda r: 2.5 * (r - 1), "gain": 0.3}),
    "formula": (law(2.0, 0.8, formula="k*(r - 1)**4/4"), {"slope": lambda r: 2.0 * (r - 1) ** 3}),
    "graph": (law(graph=fk.Hysteresis(1.6, 0.2)), {"radii": (1.4, 1.6)}),
    "state": (None, {}),
    "both": (law(2.5, 0.3), {"slope": lambda r: 2.5 * (r - 1), "gain": 0.3}),
}
"""A new law, and what the second implementation is told of it."""


def world(order, delays, seed=3):
    rng, n = np.random.default_rng(seed), 5
    start = fk.State(rng.uniform(0, 2.6, (n, 2)), rng.normal(size=(n, 2)) if order == 2 else np.zeros((n, 2)))
    bodies = fk.PointMass(masses=rng.uniform(0.5, 2.0, n), damping=0.4) if order == 2 else fk.SingleIntegrator()
    tau = rng.choice([0.0, 0.11, 0.17, 0.3], (n, n))
    np.fill_diagonal(tau, 0.0)
    information = {"one": fk.Delayed(0.2), "late": fk.Delayed(0.2, self_delayed=True), "pairs": fk.Delayed(tau)}[delays]
    return fk.Scenario(
        law(), start, t_end=LAST, frames=12, information=information, bodies=bodies, tolerance=1e-10
    )  # fmt: skip


def moved(state):
    """A state with an agent elsewhere, and another one kicked, which agents of order 1 do not notice."""
    q, p = np.array(state.q), np.array(state.p)
    q[0] += (0.7, -0.4)
    p[1] += (-0.5, 0.8)
    return fk.State(q, p)


@pytest.mark.parametrize(
    ("order", "delays", "change"),
    [
        (2, "one", "numbers"), (2, "pairs", "numbers"), (1, "late", "numbers"), (2, "one", "formula"),
        (2, "pairs", "graph"), (2, "one", "state"), (1, "late", "state"), (2, "late", "state"), (2, "pairs", "state"),
        (1, "pairs", "both"), (2, "one", "graph"),
    ],
)  # fmt: skip
def test_a_replacement_is_what_a_second_implementation_computes(order, delays, change):
    """Positions and velocities agree, what agents know of links too; the ledger closes and names the jump."""
    made = world(order, delays)
    new, told = CHANGES[change]
    session = fk.start(made)
    assert session.engine == "delayed"
    session.advance(AT)
    state = moved(session.state) if change in ("state", "both") else None
    plain = ReplacedPlainDelays(made, lambda r: 1.5 * (r - 1), 0.8 if order == 2 else 0.0)
    plain.end = plain.begun()
    plain.on(0.0, AT)
    q, p = plain.split(plain.end)
    assert np.abs(session.state.q - q).max() < 1e-8
    session.replace(law=new, state=state)
    told = {**told, **({"state": (state.q, state.p)} if state else {})}
    if order == 1 and "gain" in told:
        told["gain"] = 0.0
    plain.replace(AT, **told)
    assert (session.known_links[0] == plain.links).all()
    session.advance(LAST)
    plain.on(AT, LAST)
    q, p = plain.split(plain.end)
    run = session.run()
    assert np.abs(run.q[-1] - q).max() < 1e-8
    assert np.abs(run.p[-1] - p).max() < 1e-8
    assert (session.known_links[0] == plain.links).all()
    assert np.abs(run.residual).max() <= 1e-9 * max(1.0, run.turnover)
    assert run.provenance["changed at"] == [AT]
    assert run.fidelity.changed


def same(a, b):
    return (
        fk.first_difference(a, b) is None and (a.trace == b.trace).all() and a.closest_linked == b.closest_linked
        and np.array_equal(a.switches["time"], b.switches["time"]) and a.provenance == b.provenance
    )  # fmt: skip


@pytest.mark.parametrize("delays", ["one", "pairs"])
def test_an_equal_law_changes_no_bit(delays):
    made = world(2, delays)
    whole = fk.simulate(made, progress=False)
    session = fk.start(made)
    for t in (0.0, 0.4, AT):
        session.advance(t)
        session.replace(law=law())
        session.replace(law=fk.Law(fk.Hysteresis(2.0, 0.3), law().terms))
        session.replace()
    session.advance(LAST)
    assert same(session.run(), whole)
    assert not session.run().fidelity.changed


@pytest.mark.parametrize("delays", ["one", "late", "pairs"])
@pytest.mark.parametrize("first", [0.0, 0.4])
def test_changed_sessions_go_on_bit_for_bit_from_a_moment(delays, first):
    """Moments lie right after replacements, between one and the time when others know of it, and later."""
    stops = [first, 0.5, 0.57, 0.9, 1.3, LAST]

    def driven(saved, pieces):
        session = fk.start(world(2, delays))
        for k, stop in enumerate(stops):
            for t in np.linspace(session.time, stop, pieces + 1)[1:]:
                session.advance(float(t))
            if k == 0:
                session.replace(state=moved(session.state))
            elif k == 1:
                session.replace(law=law(2.5, 0.3))
            elif k == 3:
                session.replace(law=law(graph=fk.Hysteresis(1.8, 0.2)), state=moved(session.state))
            if saved:
                session = session.moment()()
        return session.run()

    one = driven(False, 1)
    assert same(driven(True, 1), one)
    assert same(driven(False, 4), one)
    assert one.provenance["changed at"] == [first, 0.5, 0.9]


def test_bodies_with_limits_and_gusts_and_obstacles_go_on_too():
    """Replaced where a gust ends and elsewhere; moments right after it have the same bits, and the ledger closes."""
    ball = fk.Avoid([fk.Ball([0.9, 1.0], 0.1)], range=0.9, gamma_agents=False, repulsion_gain=1.0)
    bodies = fk.Limited(fk.Disturbed(fk.PointMass(), 0.3, 0.25), force=1.5)
    made = world(2, "one").with_(bodies=bodies, tolerance=1e-9)

    def driven(saved):
        session = fk.start(made)
        for k, stop in enumerate((0.25, 0.5, 0.8, LAST)):
            session.advance(stop)
            if k == 0:
                session.replace(law=fk.Law(GRAPH, [*law(3.0).terms, ball]))
            elif k == 1:
                session.replace(state=moved(session.state))
            elif k == 2:
                session.replace(law=law(3.0, 0.2))
            if saved:
                session = session.moment()()
        return session.run()

    one = driven(False)
    assert same(driven(True), one)
    assert "obstacle" in set(one.switches["kind"])
    assert np.abs(one.residual).max() <= 1e-7 * max(1.0, one.turnover)


def test_what_others_know_of_a_move_comes_a_delay_later():
    """A link that the move stretches breaks for the one who moves at once, for the other one a delay later."""
    still = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("k*r", k=0.0))])
    session = fk.start(fk.Scenario(still, fk.State([[0.0, 0.0], [1.0, 0.0]]), t_end=2.0, information=fk.Delayed(0.5)))
    session.advance(0.7)
    session.replace(state=fk.State([[0.0, 0.0], [3.0, 0.0]]))
    assert not session.state.links.any()
    for t, known in ((0.7, True), (1.19, True), (1.21, False)):
        session.advance(t)
        assert (session.known_links[0, 0, 1], session.known_links[0, 1, 0]) == (known, False)


def test_a_move_that_becomes_known_is_a_jump_of_the_force_of_who_learns_of_it():
    """Its breaking points are those of a jump at that time, not of one that others have passed on."""
    tau = np.array([[0.0, 0.3], [0.2, 0.0]])
    made = fk.Scenario(law(graph=fk.Fixed(2, [(0, 1)])), fk.State(np.eye(2)), t_end=2.0, information=fk.Delayed(tau))
    session = fk.start(made)
    session.advance(0.7)
    session.replace(state=fk.State([[1.0, 0.0], [0.5, 1.0]]))
    session.advance(1.1)
    found = session.delays.points.arrays()
    (row,) = np.flatnonzero((np.abs(found["breaks"] - 1.0) < 1e-12) & (found["jumps"][:, 0] == 0))
    assert found["jumps"][row, 1] == 0


@pytest.mark.parametrize("delays", ["one", "pairs"])
def test_a_law_over_other_links_with_another_state_has_its_own_links_at_once(delays):
    session = fk.start(world(2, delays).with_(law=law(graph=fk.Fixed(5, [(0, 1), (1, 2)]))))
    session.advance(AT)
    graph = fk.Fixed(5, [(2, 3), (3, 4)])
    session.replace(law=law(graph=graph), state=moved(session.state))
    assert (session.state.links == graph.initial(session.state.q)).all()
    assert (session.known_links[0] == session.state.links).all()


def test_links_that_are_cut_without_a_move_are_cut_in_what_agents_know():
    session = fk.start(world(2, "one"))
    session.advance(AT)
    state = session.state
    links = np.zeros_like(state.links)
    assert state.links.any()
    session.replace(state=fk.State(state.q, state.p, links=links))
    assert not session.known_links.any()
    assert not session.state.links.any()


def test_the_energy_that_a_new_law_adds_is_a_jump():
    """A spring that becomes twice as stiff has twice the energy; its force acts at once by what is known."""
    springs = [fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("k*(r - 2)**2/2", k=k))]) for k in (1.0, 2.0)]
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, 0.3]])
    session = fk.start(fk.Scenario(springs[0], start, t_end=2.0, frames=5, information=fk.Delayed(0.1)))
    session.advance(0.55)
    length, force = np.linalg.norm(session.state.q[1] - session.state.q[0]), session.accelerations()
    session.replace(law=springs[1])
    assert session.run().trace["jumped"][-1] == pytest.approx(0.5 * (length - 2.0) ** 2, rel=1e-12)
    assert session.accelerations() == pytest.approx(2.0 * force, rel=1e-12)


@pytest.mark.filterwarnings("ignore:.*has a pole at distance")
@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"law": fk.Law(GRAPH, [fk.Consensus(np.ones(4))])}, InvalidInput, "5 agents"),
        ({"state": fk.State(np.zeros((3, 2)))}, InvalidInput, r"must have the shape \(5, 2\)"),
        ({"law": law(formula="k/r"), "state": "met"}, InvalidInput, "state must give finite forces"),
        ({"law": law(formula="k/(r - 1)**2"), "state": "pole"}, InvalidInput, "state must have a finite energy"),
        ({"law": fk.Law(fk.Proximity(2.0), [fk.VelocityAverage(1.0)])}, UnsupportedLaw, "VelocityAverage"),
    ],
)
def test_what_cannot_be_replaced_is_refused_and_the_session_goes_on_as_it_was(change, error, words):
    made = world(2, "one")
    whole = fk.simulate(made, progress=False)
    session = fk.start(made)
    session.advance(AT)
    if change.get("state") == "met":
        # Agent 0 moves to where agent 1 was a delay ago, as agent 0 knows it.
        q = np.array(session.state.q)
        q[0] = session.history.at(AT - 0.2)[1, :2]
        change = {**change, "state": fk.State(q, session.state.p)}
    elif change.get("state") == "pole":
        q = np.array(session.state.q)
        q[:2] = [[0.0, 0.0], [1.0, 0.0]]
        change = {**change, "state": fk.State(q, session.state.p)}
    with pytest.raises(error, match=words):
        session.replace(**change)
    session.advance(LAST)
    assert same(session.run(), whole)


@pytest.mark.parametrize("wrong", ["agents", "begun", "time", "nobody"])
def test_checkpoints_with_gaps_that_no_replacement_explains_are_refused(wrong):
    session = fk.start(world(2, "one"))
    session.advance(AT)
    session.replace(state=moved(session.state))
    if wrong != "begun":
        session.advance(AT + 0.1)
    packed, stored = session.pack(), session.run()
    arrays = dict(packed[1])
    if wrong == "agents":
        arrays["replaced_agents"] = np.roll(arrays["replaced_agents"], 2, axis=1)
    elif wrong == "begun":
        del arrays["replaced_at"]
    elif wrong == "time":
        arrays["replaced"] = arrays["replaced"] - 1e-3
    else:
        arrays["replaced_agents"] = np.zeros_like(arrays["replaced_agents"])
    from flocking.engine.protocol.session import Stored

    with pytest.raises(MalformedError):
        type(session).unpack(
            (packed[0], arrays), Stored(session.scenario, None, session.records.counts, lambda: stored), {}
        )
