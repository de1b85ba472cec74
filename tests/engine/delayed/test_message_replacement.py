"""Laws and states that are replaced while messages are under way: samples that were taken state what they did."""

import numpy as np
import pytest

import flocking as fk
from flocking.engine.archives.data_checks import MalformedError
from flocking.engine.protocol.session import Stored
from flocking.errors import InvalidInput, UnsupportedLaw
from tests.engine.delayed.replaced_plain_messages import ReplacedPlainMessages
from tests.engine.delayed.test_message_sessions import same_logs
from tests.engine.delayed.test_messages import GAIN, STIFF, random_world
from tests.engine.delayed.test_sessions import same

GRAPH = fk.Hysteresis(2.0, 0.3)
"""One object: with it the numbers of a law change alone."""


def law(stiff=STIFF, gain=GAIN, graph=GRAPH, formula="k*(r - 1)**2/2"):
    return fk.Law(graph, [fk.Gradient(fk.Potential(formula, k=stiff)), fk.Consensus(gain)])


CHANGES = (
    (law(2.5, 0.3), {"slope": lambda r: 2.5 * (r - 1), "gain": 0.3}),
    (law(2.0, formula="k*(r - 1)**4/4"), {"slope": lambda r: 2.0 * (r - 1) ** 3, "gain": GAIN}),
    (law(graph=fk.Hysteresis(1.6, 0.2)), {"slope": lambda r: STIFF * (r - 1), "gain": GAIN}),
    (None, {}),
)
"""New laws, and what the second implementation is told of them."""


def moved(state, agent=0):
    """A state with an agent elsewhere, and another one kicked, which agents of order 1 do not notice."""
    q, p = np.array(state.q), np.array(state.p)
    q[agent] += (0.7, -0.4)
    p[agent - 1] += (-0.5, 0.8)
    return fk.State(q, p)


def check(seed):
    """The engine and the second implementation agree where law and state are replaced twice on a random world."""
    made, _ = random_world(seed)
    made = made.with_(law=law())
    rng = np.random.default_rng(seed)
    plain = ReplacedPlainMessages(made, lambda r: STIFF * (r - 1), GAIN if made.agents.order == 2 else 0.0)
    session = fk.start(made)
    # The second one falls on instants of messages where all periods are 0.1.
    times = round(float(rng.uniform(0.1, 0.6)), 3), 0.8
    for at, kind in zip(times, rng.permutation(len(CHANGES))[:2], strict=True):
        new, told = CHANGES[kind]
        session.advance(at)
        q, _ = plain.on(at)
        assert np.abs(session.state.q - q).max() < 1e-8
        state = moved(session.state, int(rng.integers(made.start.n))) if new is None or rng.random() < 0.5 else None
        session.replace(law=new, state=state)
        told = {**told, **({"gain": 0.0} if made.agents.order == 1 else {})}
        graph = session.scenario.law.graph
        if (graph.appear_radius, graph.break_radius) != (plain.enter, plain.leave):
            told = {**told, "radii": (graph.appear_radius, graph.break_radius)}
        plain.replace(**told, state=None if state is None else (state.q, state.p))
        assert (session.known_links[0] == plain.links).all()
        assert (session.knowledge.newest == [[x[0] for x in row] for row in plain.known]).all()
    session.advance(1.5)
    # The run has come to the end, where nothing of that instant has taken place.
    q, p = plain.on(1.5 - 1e-13)
    run = session.run()
    assert np.abs(run.q[-1] - q).max() < 1e-8
    if made.agents.order == 2:
        assert np.abs(run.p[-1] - p).max() < 1e-8
    assert (session.known_links[0] == plain.links).all()
    assert np.abs(run.residual).max() <= 1e-9 * max(1.0, run.turnover)
    assert len(run.provenance["changed at"]) == 2
    assert run.fidelity.changed
    return plain.switches


def test_replacements_are_what_a_second_implementation_computes():
    assert sum(check(seed) for seed in (0, 3)) > 1


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, *range(4, 44)])
def test_42_more_random_worlds_are_replaced(seed):
    check(seed)


def world(seed=3, **parts):
    """Five agents whose messages are late, lost, wrong and expire; sent at whole tenths by some of them."""
    rng, n = np.random.default_rng(seed), 5
    order = parts.get("bodies", fk.PointMass()).order
    start = fk.State(rng.uniform(0, 2.6, (n, 2)), rng.normal(size=(n, 2)) if order == 2 else np.zeros((n, 2)))
    radio = fk.Messages(
        0.1, phase=[0.0, 0.0, 0.04, 0.06, 0.08], delay=0.03, jitter=0.12, loss=fk.DistanceLoss(4.0),
        noise=fk.OrnsteinUhlenbeck(0.01, 0.01), expires=0.3, predict=True, seed=5,
    )  # fmt: skip
    return fk.Scenario(law(), start, **{"t_end": 1.4, "frames": 8, "information": radio, **parts})


@pytest.mark.parametrize(
    ("bodies", "first"),
    [
        (fk.PointMass(damping=0.3), 0.4),
        pytest.param(fk.PointMass(damping=0.3), 0.0, marks=pytest.mark.slow),
        pytest.param(fk.SingleIntegrator(), 0.0, marks=pytest.mark.slow),
        pytest.param(fk.SingleIntegrator(), 0.4, marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_changed_sessions_go_on_bit_for_bit_from_a_moment(bodies, first):
    """Moments lie right after replacements, at instants of messages and between them."""
    stops = [first, 0.5, 0.5, 0.57, 0.9, 1.0, 1.4]

    def driven(saved, pieces):
        session = fk.start(world(bodies=bodies))
        for k, stop in enumerate(stops):
            for t in np.linspace(session.time, stop, pieces + 1)[1:]:
                session.advance(float(t))
            if k in (0, 2):
                session.replace(state=moved(session.state))
            elif k == 1:
                session.replace(law=law(2.5, 0.3))
            elif k == 3:
                session.replace_information(fk.Messages(**{**vars(world().information), "delay": 0.05, "seed": 6}))
            elif k == 4:
                session.replace(law=law(graph=fk.Hysteresis(1.8, 0.2)), state=moved(session.state))
            if saved:
                session = session.moment()()
        return session.run()

    one = driven(False, 1)
    for other in (driven(True, 1), driven(False, 3)):
        assert same(other, one)
        assert same_logs(other, one)
    assert one.provenance["changed at"] == [first, 0.5, 0.57, 0.9]
    assert one.provenance["graphs changed at"] == 0.9
    assert one.provenance["world"].startswith("messages every 0.1")
    assert np.abs(one.residual).max() <= 1e-7 * max(1.0, one.turnover)
    with pytest.raises(UnsupportedLaw, match="this one was changed while it went on"):
        fk.replay(one)


def test_a_moment_right_after_two_replacements_with_one_step_between_them_is_whole():
    """The step before the first one ends where the state jumps, which nobody is to know of any more."""
    soft = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("0.1*r**2/2"))])
    made = fk.Scenario(soft, fk.State([[0.0, 0.0], [1.0, 0.0]]), t_end=1.0, information=fk.Messages(0.1))
    session = fk.start(made)
    session.advance(0.45)
    session.replace(state=fk.State([[0.0, 0.0], [2.0, 0.0]]))
    steps = session.steps
    session.advance(0.5)
    session.replace(law=fk.Law(soft.graph, [*soft.terms, fk.Consensus(1.0)]))
    assert session.steps == steps + 1
    again = session.moment()()
    for each in (session, again):
        each.advance(1.0)
    assert same(again.run(), session.run())


def test_an_equal_law_changes_no_bit():
    whole = fk.simulate(world(), progress=False)
    session = fk.start(world())
    for t in (0.0, 0.4, 0.437):
        session.advance(t)
        session.replace(law=law())
        session.replace()
    session.advance(1.4)
    assert same(session.run(), whole)
    assert same_logs(session.run(), whole)
    assert not session.run().fidelity.changed


@pytest.mark.parametrize("measured", [False, True])
def test_a_move_is_known_when_a_sample_arrives_that_was_taken_later(measured):
    """Agent 1 moves at 0.8, when both take a sample, out of the radius; samples of 1.2 arrive at 1.3.

    The one that moves knows at once, or with ``self_known="measured"`` by its sample of 1.2.
    """
    still = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("k*r", k=0.0))])
    radio = fk.Messages(0.4, delay=0.1, self_known="measured" if measured else "true")
    session = fk.start(fk.Scenario(still, fk.State([[0.0, 0.0], [1.0, 0.0]]), t_end=2.0, information=radio))
    session.advance(0.8)
    session.replace(state=fk.State([[0.0, 0.0], [3.0, 0.0]]))
    assert not session.state.links.any()
    for t, other, own in ((0.8, True, measured), (1.19, True, measured), (1.21, True, False), (1.31, False, False)):
        session.advance(t)
        assert (session.known_links[0, 0, 1], session.known_links[0, 1, 0]) == (other, own)


def test_a_new_law_acts_at_once_on_what_is_known_and_the_log_says_so():
    """A spring that becomes twice as stiff has twice the energy, and twice the force by the same samples."""
    springs = [fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("k*(r - 2)**2/2", k=k))]) for k in (1.0, 2.0)]
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, 0.3]])
    session = fk.start(fk.Scenario(springs[0], start, t_end=2.0, frames=5, information=fk.Messages(0.1)))
    session.advance(0.55)
    length, force = np.linalg.norm(session.state.q[1] - session.state.q[0]), session.accelerations()
    acts = len(session.run().log.ticks)
    session.replace(law=springs[1])
    run = session.run()
    assert run.trace["jumped"][-1] == pytest.approx(0.5 * (length - 2.0) ** 2, rel=1e-12)
    assert session.accelerations() == pytest.approx(2.0 * force, rel=1e-12)
    assert run.log.ticks[acts:, :2].tolist() == [[550_000_000, 0], [550_000_000, 1]]
    assert run.log.forces[acts:] == pytest.approx(2.0 * force, rel=1e-12)


@pytest.mark.parametrize("base", [0.0, 100_000.3, -7.7])
def test_the_sample_of_the_instant_of_a_move_states_where_the_agent_was(base):
    """Whatever the scenario's time: rounding of the difference of two times does not decide it."""
    still = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("k*r", k=0.0))])
    start = fk.State([[0.0], [1.0]], t=base)
    for at in (0.1, 0.3, 0.7, 1.1):
        session = fk.start(fk.Scenario(still, start, t_end=base + 2.0, information=fk.Messages(0.1)))
        session.advance(base + at)
        session.replace(state=fk.State([[0.0], [5.0]]))
        newest = round(10 * at)
        assert session.knowledge.taken[1] == newest + 1
        assert session.knowledge.samples.of(np.array([1]), np.array([newest]))[0, 0] == 1.0


def test_links_of_whom_nothing_is_known_are_not_among_those_of_a_new_graph():
    """What all have at the start is too old from 0.6 on; the first sample of 0.5 arrives at 0.75, lost for all."""
    laws = [fk.Law(fk.Proximity(r), [fk.Gradient(fk.Potential("r**2/2"))]) for r in (2.0, 3.0)]
    start = fk.State([[0.0, 0.0], [1.8, 0.0]])
    heard = fk.Messages(0.5, phase=0.5, delay=0.25, expires=0.6, loss=1.0)
    session = fk.start(fk.Scenario(laws[0], start, t_end=2.0, information=heard))
    session.advance(0.7)
    session.replace(law=laws[1])
    assert session.state.links[0, 1]
    assert not session.known_links.any()
    assert not session.accelerations().any()


@pytest.mark.slow
def test_bodies_with_limits_and_gusts_obstacles_and_schedules_go_on_too():
    """Replaced where a gust ends, where gains change, and elsewhere; moments right after it have the same bits."""
    ball = fk.Avoid([fk.Ball([0.9, 1.0], 0.1)], range=0.9, gamma_agents=False, repulsion_gain=1.0)
    bodies = fk.Limited(fk.Disturbed(fk.PointMass(), 0.3, 0.25), force=1.5)
    steered = fk.Track(fk.Velocity([0.3, 0.0]), fk.Schedule([0.8], [0.5, 1.0]), 0.5)
    made = world(bodies=bodies, tolerance=1e-9).with_(law=fk.Law(GRAPH, [*law().terms, steered]))

    def driven(saved):
        session = fk.start(made)
        for k, stop in enumerate((0.25, 0.5, 0.8, 1.4)):
            session.advance(stop)
            if k == 0:
                session.replace(law=fk.Law(GRAPH, [*law(3.0).terms, steered, ball]))
            elif k == 1:
                session.replace(state=moved(session.state))
            elif k == 2:
                session.replace(law=fk.Law(GRAPH, [*law(3.0, 0.2).terms, steered]))
            if saved:
                session = session.moment()()
        return session.run()

    one, other = driven(False), driven(True)
    assert same(other, one)
    assert same_logs(other, one)
    assert "obstacle" in set(one.switches["kind"])
    assert np.abs(one.residual).max() <= 1e-7 * max(1.0, one.turnover)


@pytest.mark.filterwarnings("ignore:.*has a pole at distance")
@pytest.mark.parametrize("at", [0.5, pytest.param(0.537, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"law": fk.Law(GRAPH, [fk.Consensus(np.ones(4))])}, InvalidInput, "5 agents"),
        ({"state": fk.State(np.zeros((3, 2)))}, InvalidInput, r"must have the shape \(5, 2\)"),
        ({"law": law(formula="k/r"), "state": "met"}, InvalidInput, "state must give finite forces"),
        ({"law": law(graph=fk.Proximity(2.5), formula="k/(r - 1)**2"), "state": "pole"}, InvalidInput, "finite energy"),
        (
            {"law": fk.Law(GRAPH, [*law().terms, fk.Consensus(1.0, over=fk.Proximity(3.0))])},
            UnsupportedLaw, "keeps the number of graphs of a law, 1, while",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_replaced_is_refused_and_the_session_goes_on_as_it_was(at, change, error, words):
    """At an instant at which gains change, too; a moment after the refusal has the same bits."""
    steered = fk.Track(fk.Velocity([0.3, 0.0]), fk.Schedule([0.5], [0.5, 1.0]), 0.5)
    made = world(t_end=0.7).with_(law=fk.Law(GRAPH, [*law().terms, steered]))
    whole = fk.simulate(made, progress=False)
    session = fk.start(made)
    session.advance(at)
    change = dict(change)
    if change.get("state") in ("met", "pole"):
        q = np.array(session.state.q)
        ahead = fk.start(made)
        ahead.advance(at + 1e-12)
        known = ahead.knowledge.known(ahead._states.points.heard, np.array([0]), *ahead.motion_at(ahead.time))
        # Agent 0 moves to where it assumes agent 2 to be; or two are at the pole of the energy.
        q[0] = known.rows[0, 2, :2] + (at - 1e-9 * known.begun[0, 2]) * known.rows[0, 2, 2:]
        if change["state"] == "pole":
            q[:2] = [[0.0, 0.0], [1.0, 0.0]]
        change["state"] = fk.State(q, session.state.p)
    with pytest.raises(error, match=words):
        session.replace(**change)
    again = session.moment()()
    for each in (session, again):
        each.advance(0.7)
        assert same(each.run(), whole)
        assert same_logs(each.run(), whole)


def test_a_refusal_before_the_first_instant_logs_nothing():
    made = world(t_end=0.3, information=fk.Messages(0.1))
    whole, session = fk.simulate(made, progress=False), fk.start(made)
    with pytest.raises(InvalidInput, match="must have the shape"):
        session.replace(state=fk.State(np.zeros((3, 2))))
    session.advance(0.3)
    assert same_logs(session.run(), whole)


def test_links_known_before_graphs_were_replaced_are_refused():
    session = fk.start(world())
    session.advance(0.5)
    session.replace(law=law(graph=fk.Hysteresis(1.6, 0.2)))
    session.advance(1.4)
    run = session.run()
    with pytest.raises(InvalidInput, match=r"needs a frame after 0.5, when graphs of the law were replaced"):
        run.known_links_at(0)
    known = session.known_links & session._states.points.there
    assert (run.known_links_at(len(run.t) - 1) == known).all()


@pytest.mark.parametrize("wrong", ["agents", "begun", "time", "graphs"])
def test_checkpoints_that_no_replacement_explains_are_refused(wrong):
    session = fk.start(world())
    session.advance(0.437)
    session.replace(state=moved(session.state), law=law(graph=fk.Hysteresis(1.6, 0.2)))
    if wrong != "begun":
        session.advance(0.437 + 1e-8)
    packed, stored = session.pack(), session.run()
    arrays = dict(packed[1])
    if wrong == "agents":
        arrays["replaced_agents"] = np.roll(arrays["replaced_agents"], 2, axis=1)
    elif wrong == "begun":
        del arrays["replaced_at"]
    elif wrong == "time":
        arrays["replaced"] = arrays["replaced"] - 1e-3
    else:
        arrays["graphs_changed"] = arrays["graphs_changed"] + 0.1
    with pytest.raises(MalformedError):
        type(session).unpack(
            (packed[0], arrays), Stored(session.scenario, None, session.records.counts, lambda: stored), {}
        )
