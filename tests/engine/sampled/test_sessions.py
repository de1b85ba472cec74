"""Sessions of held control: pieces, resuming, records, and what is refused."""

import numpy as np
import pytest

import flocking as fk
from flocking.engine.archives.data_checks import MalformedError
from flocking.engine.protocol.session import Stored
from flocking.engine.sampled.law_in_force import SampledLaw
from flocking.engine.sampled.session import SampledSession
from flocking.errors import InvalidInput, SimulationError, UnsupportedLaw

LAW = fk.Law(fk.Hysteresis(4, 0.3), [fk.Gradient(fk.Potential("1/r + 1/(R - r)", R=4.0)), fk.Consensus(1.0)])


def scenario(law=LAW, t_end=1.5, **parts):
    start = fk.start.box(8, side=6, speed=1, seed=1, connected_under=LAW.graph)
    given = {
        "control": fk.Held(np.linspace(0.02, 0.03, 8), latency=0.003),
        "information": fk.Messages(
            0.02, delay=0.05, jitter=0.01, loss=fk.GilbertElliott(0.1, 0.4), noise=fk.OrnsteinUhlenbeck(0.01, 0.01),
            predict=True, seed=5,
        ),
    }  # fmt: skip
    return fk.Scenario(law, start, t_end=t_end, frames=16, **{**given, **parts})


def same(a, b):
    return (
        fk.first_difference(a, b) is None and (a.trace == b.trace).all() and (a.switches.tolist() == b.switches.tolist()
        or np.array_equal(a.switches["time"], b.switches["time"])) and a.closest_linked == b.closest_linked
    )  # fmt: skip


def test_pieces_moments_and_stored_runs_give_the_same_bits(tmp_path):
    ideal = fk.simulate(scenario())
    assert ideal.fidelity.engine == "sampled"
    session = fk.start(scenario())
    for t in np.linspace(0.01, 1.5, 23):
        session.advance(float(t))
    assert same(session.run(), ideal)
    early = fk.start(scenario())
    early.advance(0.7123)
    again = early.moment()()
    again.advance(1.5)
    assert same(again.run(), ideal)
    stored = fk.simulate(scenario(), save=tmp_path / "run", progress=False)
    assert same(fk.read_run(tmp_path / "run"), stored)
    fk.write_scenario(scenario(), tmp_path / "world.toml")
    assert same(fk.simulate(fk.read_scenario(tmp_path / "world.toml")), ideal)


def test_closest_approaches_are_not_those_of_the_future():
    """Two agents that close in until 1 s: at 0.5 s they have come as close as they are."""
    start = fk.State([[0.0, 0.0], [2.0, 0.0]], [[1.0, 0.0], [-1.0, 0.0]])
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("0*r"))])
    session = fk.start(fk.Scenario(law, start, t_end=3, control=fk.Held(10.0)))
    for t, distance in ((0.5, 1.0), (1.5, 0.0), (3.0, 0.0)):
        session.advance(t)
        closest = session.closest_pairs[0]
        assert closest.distance == pytest.approx(distance, abs=1e-7)
        assert closest.time == pytest.approx(min(t, 1.0), abs=1e-7)


def test_true_links_switch_where_fine_samples_say():
    made = scenario(fk.Law(fk.Proximity(2.0), [fk.Consensus(0.1)]), t_end=4.0)
    run = fk.simulate(made)
    assert len(run.switches) > 4
    session = fk.start(made.with_(frames=1))
    links = session.state.links
    for row in run.switches:
        for before, sign in ((True, -1.0), (False, 1.0)):
            t = row["time"] + sign * 1e-7
            if t > session.time:
                session.advance(float(t))
            state = session.state
            d = np.linalg.norm(state.q[row["i"]] - state.q[row["j"]])
            assert d == pytest.approx(2.0, abs=1e-5)
            closer = d < 2.0
            assert closer == ((row["kind"] == "break") == before)
    links = session.state.links
    q = session.state.q
    distance = np.linalg.norm(q[:, None] - q, axis=2)
    assert (links == ((distance < 2.0) & ~np.eye(8, dtype=bool))).all()


def test_before_its_first_tick_an_agent_applies_no_force():
    control = fk.Held(0.5, phase=np.array([0.0, 0.3]), latency=0.1)
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2"))])
    session = fk.start(fk.Scenario(law, fk.State([[0.0], [2.0]]), t_end=1, control=control))
    for t, first, second in ((0.05, 0.0, 0.0), (0.15, 2.0, 0.0), (0.39, 2.0, 0.0), (0.45, 2.0, -1.96)):
        session.advance(t)
        assert session.accelerations()[:, 0] == pytest.approx([first, second], abs=1e-9)


def test_messages_of_another_instant_are_not_used():
    """At a tick that falls on a sample without delay the sample counts; with any delay it does not."""
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Consensus(1.0)])
    start = fk.State([[0.0], [1.0]], [[0.0], [1.0]])
    for delay, expected in ((0.0, 0), (1e-9, -1), (1e-12, 0)):
        made = fk.Scenario(law, start, t_end=0.05, control=fk.Held(0.1), information=fk.Messages(0.1, delay=delay))
        session = fk.start(made)
        session.advance(0.05)
        assert session.knowledge.newest[0, 1] == expected


def test_a_barrier_reached_ends_the_ledger_by_name():
    start = fk.State([[0.0, 0.0], [3.5, 0.0]], [[0.0, 0.0], [9.0, 0.0]])
    run = fk.simulate(fk.Scenario(LAW, start, t_end=1, control=fk.Held(0.5)))
    assert run.finished
    assert run.provenance["ledger ends"] == pytest.approx(0.0)
    assert np.isfinite(run.residual).all()
    assert run.switches["kind"][0] == "break"


def test_a_force_without_a_value_names_the_agent():
    law = fk.Law(fk.Proximity(4.0), [fk.Gradient(fk.Potential("1/r"))])
    start = fk.State([[0.0], [1.0]], [[0.0], [0.0]])
    information = fk.Messages(0.1, resolution=4.0)
    with pytest.raises(SimulationError, match="infinite or NaN") as error:
        fk.simulate(fk.Scenario(law, start, t_end=1, control=fk.Held(0.1), information=information))
    assert error.value.agents == (0,)
    assert error.value.run is not None


@pytest.mark.parametrize(
    ("engine", "parts"),
    [
        ("exact", {"information": fk.Instant()}), ("delayed", {"information": fk.Instant()}),
        ("exact", {"control": fk.Continuous()}), ("delayed", {}),
    ],
)  # fmt: skip
def test_other_engines_refuse_by_name(engine, parts):
    with pytest.raises(UnsupportedLaw, match=r"would be left out"):
        fk.start(scenario(**parts), engine=engine)
    with pytest.raises(UnsupportedLaw, match=r"would be left out"):
        fk.ExactSession(scenario())


def test_what_is_not_known_is_refused_by_name():
    with pytest.raises(UnsupportedLaw, match="control=Held"):
        fk.start(scenario(control=fk.Continuous(), information=fk.Instant()), engine="sampled")
    with pytest.raises(InvalidInput, match="one value for each of the 8 agents"):
        scenario(control=fk.Held([0.1, 0.2]))
    with pytest.raises(UnsupportedLaw, match="runs no plant"):
        fk.start(scenario(), "sampled", plant=LAW)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("newest", lambda x: x + 1000), ("newest", lambda x: x - 5), ("links", lambda x: x[:, :-1]),
        ("waiting_agent", lambda x: x + 50), ("sample_rows", lambda x: x[:0]), ("coefficients", lambda x: x * np.nan),
        ("crossing", lambda x: np.full((1, 3), 99)), ("ticked", lambda x: x - 10**6),
        ("force", lambda x: x.astype("f4")),
    ],
)  # fmt: skip
def test_crafted_checkpoints_are_refused(name, change):
    session = fk.start(scenario(control=fk.Held(0.03, latency=0.02)))
    session.advance(0.4855)
    numbers, arrays = session.pack()
    stored = Stored(session.scenario, None, session.records.counts, lambda: session.run("unfinished"))
    SampledSession.unpack((numbers, dict(arrays)), stored, {})
    with pytest.raises(MalformedError):
        SampledSession.unpack((numbers, {**arrays, name: change(arrays[name])}), stored, {})


def test_a_neighbour_that_is_not_heard_of_is_forgotten_at_its_age():
    """All messages are lost: the state told at the start serves until it is 0.25 old, not at that age."""
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Consensus(1.0)])
    start = fk.State([[0.0], [1.0]], [[0.0], [1.0]])
    for expires, last in ((0.251, 0.25), (0.25, 0.2)):
        information = fk.Messages(0.05, loss=1.0, expires=expires)
        session = fk.start(fk.Scenario(law, start, t_end=1, control=fk.Held(0.05), information=information))
        session.advance(last + 0.01)
        assert abs(session.accelerations()).max() > 0.1
        session.advance(last + 0.06)
        assert not session.accelerations().any()


@pytest.mark.parametrize("where", ["law", "energy"])
def test_a_leader_without_a_closed_form_is_refused_wherever_it_is(where):
    """The ledger of a frame whose leader stood where it was at the start would be wrong without a word."""
    leader = fk.Path(velocity=["exp(sin(t))", "cos(t**2)"], start=[0.0, 0.0])
    assert not leader.closed_form
    law = fk.Law(LAW.graph, [*LAW.terms, fk.Track(leader, 1.0, 1.0)]) if where == "law" else LAW
    energy = fk.Energy() if where == "law" else fk.Energy("leader", leader)
    with pytest.raises(UnsupportedLaw, match="closed form"):
        fk.start(scenario(law, energy=energy), "sampled")


def scheduled(**parts):
    """Two agents that do not act on each other and follow a leader with gains that change at 0.5, a tick, and 0.73."""
    start = fk.State([[0.0, 0.0], [1.0, 2.0]], [[0.0, 0.0], [0.0, 1.0]], 3.0)
    leader = fk.Velocity([1.0, 0.0], start_time=3.0)
    track = fk.Track(leader, fk.Schedule([3.5, 3.73], [0.0, 2.0, 0.5]), fk.Schedule([3.5], [0.5, 3.0]))
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("0*r")), track])
    energy = fk.Energy("leader", leader)
    return fk.Scenario(law, start, t_end=4.5, frames=16, energy=energy, **{"control": fk.Held(0.1), **parts})


def test_scheduled_gains_change_before_the_controls_of_their_instant():
    run = fk.simulate(scheduled(), progress=False)
    q, p, t = np.array([[0.0, 0.0], [1.0, 2.0]]), np.array([[0.0, 0.0], [0.0, 1.0]]), 0.0
    for k in range(15):
        position = 0.0 if k < 5 else 2.0 if k < 8 else 0.5
        u = position * (np.array([t, 0.0]) - q) + (0.5 if k < 5 else 3.0) * (np.array([1.0, 0.0]) - p)
        q, p, t = q + 0.1 * p + 0.005 * u, p + 0.1 * u, 0.1 * (k + 1)
        assert np.abs(run.q[k + 1] - q).max() < 1e-12
    # What a gain changes of the stored energy of the leader's spring is a jump of the ledger.
    assert np.unique(np.round(run.trace["jumped"], 6)).size == 3
    assert np.abs(run.residual).max() < 1e-9


def test_runs_with_scheduled_gains_go_on_with_the_same_bits():
    made = scheduled(control=fk.Held(0.1, phase=0.03))
    whole = fk.simulate(made, progress=False)
    for at in (3.4, 3.5, 3.6, 3.73, 3.9):
        session = fk.start(made)
        session.advance(at)
        again = session.moment()()
        again.advance(4.5)
        assert same(again.run(), whole)
    session = fk.start(made)
    session.advance(3.6)
    numbers, arrays = session.pack()
    stored = Stored(session.scenario, None, session.records.counts, lambda: session.run("unfinished"))
    # Checkpoints from before gains could change do not say how often they have.
    older = SampledSession.unpack(
        ({k: v for k, v in numbers.items() if k != "gains_changed"}, dict(arrays)), stored, {}
    )
    assert older.gains_changed == 1
    for wrong in (0.0, 2.0, 0.5):
        with pytest.raises(MalformedError, match="gains_changed must agree"):
            SampledSession.unpack(({**numbers, "gains_changed": wrong}, dict(arrays)), stored, {})


def pair_world(**messages):
    """One agent at rest, and one that moves past it at a speed of 1, with no force between them."""
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("0*r"))])
    start = fk.State([[0.0, 0.0], [0.0, 1.0]], [[0.0, 0.0], [1.0, 0.0]])
    world = {"control": fk.Held(0.1), "information": fk.Messages(0.1, **messages)}
    return fk.Scenario(law, start, t_end=4.0, frames=5, **world)


def used_by_the_first(session):
    """Newest sample of agent 1 that agent 0 used, by the number of its tick."""
    log = session.run().log
    found = {}
    for (instant, agent, count), first in zip(log.ticks.tolist(), log.firsts.tolist(), strict=True):
        if agent == 0:
            found[instant // 10**8] = int(log.uses[first : first + count, 2][-1])
    return found


def test_a_new_delay_is_that_of_samples_taken_from_then_on():
    """Sample k is taken at 0.1 k. Those before 1.05 take 0.3, those from then on 0.1: sample 11 overtakes 9 and 10."""
    session = fk.start(pair_world(delay=0.3))
    session.advance(1.05)
    session.replace_information(fk.Messages(0.1, delay=0.1))
    session.advance(2.0)
    newest = used_by_the_first(session)
    assert [newest[tick] for tick in (3, 9, 10, 11, 12, 13, 14)] == [0, 6, 7, 8, 11, 12, 13]
    session.replace_information(fk.Messages(0.1, delay=0.5))
    session.advance(3.0)
    newest = used_by_the_first(session)
    # Samples before 2.0 are as late as they were; the first slow one, 20, comes at 2.5.
    assert [newest[tick] for tick in (20, 21, 24, 25, 26)] == [19, 19, 19, 20, 21]


def test_new_losses_are_those_of_samples_taken_from_then_on():
    session = fk.start(pair_world())
    session.advance(1.05)
    session.replace_information(fk.Messages(0.1, loss=1.0))
    session.advance(2.05)
    session.replace_information(fk.Messages(0.1, loss=0.0))
    session.advance(3.0)
    newest = used_by_the_first(session)
    assert [newest[tick] for tick in (10, 11, 20, 21, 25)] == [10, 10, 10, 21, 25]


def test_new_noise_is_stationary_from_its_first_sample_on():
    """Of an Ornstein-Uhlenbeck error that began at zero the first samples would be too exact."""
    n = 200
    law = fk.Law(fk.Fixed(n, [(0, 1)]), [fk.Gradient(fk.Potential("0*r"))])
    rows = np.column_stack([np.arange(n), np.zeros(n)])
    world = {"control": fk.Held(0.1), "information": fk.Messages(0.1)}
    session = fk.start(fk.Scenario(law, fk.State(rows, 0 * rows), t_end=4.0, frames=2, **world))
    session.advance(1.05)
    session.replace_information(fk.Messages(0.1, noise=fk.OrnsteinUhlenbeck(0.5, 0.1, time_constant=10.0)))
    session.advance(1.15)
    samples = session.knowledge.samples
    errors = samples.of(np.arange(n), np.full(n, 11))[:, :2] - rows
    # The mean of 400 squares of standard normal draws lies within five of its standard deviations.
    assert abs((errors**2).mean() / 0.25 - 1.0) < 5 * np.sqrt(2 / 400)
    session.replace_information(fk.Messages(0.1))
    session.advance(1.25)
    assert (samples.of(np.arange(n), np.full(n, 12))[:, :2] == rows).all()


def test_a_changed_session_goes_on_bit_for_bit_from_a_moment():
    def driven(pieces):
        session = fk.start(scenario())
        for stop in (0.3, 0.6001, 0.9, 1.5):
            for t in np.linspace(session.time, stop, pieces + 1)[1:]:
                session.advance(float(t))
            if stop == 0.3:
                session.replace_information(fk.Messages(0.02, delay=0.2, loss=fk.DistanceLoss(3.0), predict=True))
            elif stop == 0.6001:
                terms = [fk.Gradient(fk.Potential("1/r + 1/(R - r)", R=4.0)), fk.Consensus(0.3)]
                session.replace(law=fk.Law(LAW.graph, terms))
                session = session.moment()()
            elif stop == 0.9:
                noise = fk.WhiteNoise(0.02)
                session.replace_information(fk.Messages(0.02, noise=noise, expires=0.1, predict=True))
                session = session.moment()()
        return session.run()

    one, many = driven(1), driven(7)
    assert same(one, many)
    assert one.provenance["changed at"] == [0.3, 0.6001, 0.9]
    with pytest.raises(UnsupportedLaw, match="changed while it went on"):
        fk.replay(one)


def test_a_replaced_law_jumps_in_the_ledger_and_acts_from_the_next_tick_on():
    """The energy of a spring, k/2 (r - 2)^2, doubles with k at once, the force at the next tick."""

    def law(k):
        return fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("k*(r - 2)**2/2", k=k))])

    start = fk.State([[0.0, 0.0], [1.0, 0.0]])
    session = fk.start(fk.Scenario(law(1.0), start, t_end=4.0, frames=5, control=fk.Held(0.1)))
    session.advance(0.05)
    assert session.accelerations()[0, 0] == pytest.approx(-1.0)
    length = np.ptp(session.state.q[:, 0])
    session.replace(law=law(2.0))
    assert session.run().trace["jumped"][-1] == pytest.approx(0.5 * (length - 2.0) ** 2, rel=1e-12)
    assert session.accelerations()[0, 0] == pytest.approx(-1.0)
    session.advance(0.1)
    length = np.ptp(session.state.q[:, 0])
    session.advance(0.101)
    assert session.accelerations()[0, 0] == pytest.approx(-2.0 * (2.0 - length), rel=1e-9)
    session.advance(4.0)
    run = session.run()
    trace, last = run.trace, run.trace[-1]
    moved = last["energy"] - trace["energy"][0] + last["dissipated"] - last["supplied"] - last["jumped"]
    assert moved == pytest.approx(last["departed"], abs=1e-9)


@pytest.mark.parametrize("avoids", [False, True])
def test_a_law_with_other_numbers_acts_as_if_it_were_built_anew(monkeypatch, avoids):
    """Barriers are found anew too: a pole beyond the radius keeps no pair together."""

    def law(reach, gain):
        ball = fk.Avoid([fk.Ball([2.0, 2.0], 0.5)], range=2.5, gamma_agents=False, repulsion_gain=gain)
        terms = [fk.Gradient(fk.Potential("1/r + 1/(R - r)", R=reach)), fk.Consensus(gain)]
        return fk.Law(LAW.graph, [*terms, ball] if avoids else terms)

    def driven():
        session = fk.start(scenario(law(4.0, 1.0)))
        session.advance(0.3)
        kernels = session._law.kernels
        session.replace(law=law(5.0, 0.3))
        found = session._law.kernels is kernels, list(session._law.barriers)
        session.advance(1.5)
        return session.run(), *found

    kept, kept_kernels, kept_barriers = driven()
    monkeypatch.setattr(SampledLaw, "renumbered", lambda *_: None)
    built, built_kernels, built_barriers = driven()
    assert (kept_kernels, built_kernels) == (True, False)
    assert kept_barriers == built_barriers == [False]
    assert same(kept, built)


@pytest.mark.parametrize("added", [True, False])
def test_obstacles_that_a_new_law_has_are_met_from_then_on(added):
    ball = fk.Avoid([fk.Ball([3.0, 3.0], 0.5)], range=3.0, gamma_agents=False, repulsion_gain=1.0)
    laws = [LAW, fk.Law(LAW.graph, [*LAW.terms, ball])]
    session = fk.start(scenario(laws[not added]))
    session.advance(0.3)
    session.replace(law=laws[added])
    met = session.obstacle_ranges.pairs
    assert [len(i) > 0 for i, _ in met] == [True] * added
    for found, expected in zip(session._pairs, session._law.pairs(session.links, met), strict=True):
        assert np.array_equal(found, expected)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: s.replace_information(fk.Messages(0.03, predict=True)), "keeps period, phase, predict and leader"),
        (lambda s: s.replace_information(fk.Messages(0.02)), "keeps period, phase, predict and leader"),
        (lambda s: s.replace_information(fk.Messages(0.02, phase=0.01, predict=True)), "keeps period, phase, predict"),
        (lambda s: s.replace_information(fk.Instant()), "not whether they are"),
        (lambda s: s.replace(law=fk.Law(fk.Proximity(3.0), LAW.terms)), "keeps the graphs"),
        (lambda s: s.replace(state=s.state), "neither law nor state"),
    ],
)
def test_what_a_running_session_cannot_change_to_is_refused_by_name(change, words):
    session = fk.start(scenario())
    session.advance(0.1)
    before = session.pack()[0]
    with pytest.raises(UnsupportedLaw, match=words):
        change(session)
    assert session.pack()[0] == before


@pytest.mark.parametrize("fault", ["since", "sent", "changed", "late"])
def test_crafted_changes_are_refused(fault):
    session = fk.start(scenario())
    session.advance(0.3)
    session.replace_information(fk.Messages(0.02, delay=0.2, predict=True))
    session.advance(0.5)
    data, arrays = session.pack()
    stored = Stored(session.scenario, None, session.records.counts, lambda: session.run("unfinished"))
    arrays = {name: np.array(values) for name, values in arrays.items()}
    if fault == "since":
        arrays["since"] = arrays["since"][:, :3]
    elif fault == "sent":
        data["sent"] = [{"kind": "instant"}]
    elif fault == "changed":
        data["changed"] = ["now"]
    else:
        arrays["since"] = arrays["since"] + 1000
    with pytest.raises(MalformedError):
        SampledSession.unpack((data, arrays), stored, {})


def test_damped_agents_of_different_masses_renew_their_pieces_together():
    """Ten agents whose pieces ended one by one would need ten times the events of the fastest."""
    law = fk.Law(fk.Fixed.complete(10), [fk.Consensus(1.0)])
    start = fk.start.box(10, side=3, speed=1, seed=0)
    masses = np.linspace(0.5, 1.0, 10)
    world = {"agents": fk.PointMass(masses, 1.0), "control": fk.Held(5.0)}
    session = fk.start(fk.Scenario(law, start, t_end=1.0, frames=2, **world))
    session.advance(1.0)
    # The fastest piece is 0.5/32 long: 64 of them, and rows at the start, the end and the tick.
    assert len(session.records.trace) <= 64 + 6


def test_several_events_at_one_instant_are_no_standstill():
    """A slice of wall time may end after each event; only one without any event would be a standstill."""
    law = fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)])
    square = np.array([[0.0, 0.0], [0.9, 0.0], [0.0, 0.9], [0.9, 0.9]])
    start = fk.State(square, 0.2 * (square - 0.45))
    session = fk.start(fk.Scenario(law, start, t_end=2.0, frames=3, control=fk.Held(5.0, phase=4.0)))
    while not session.reached(2.0):
        at = session.time, session.steps
        session.advance(2.0, 0.0)
        assert (session.time, session.steps) != at
    # All four sides grow to 1 at the same instant.
    assert len(session.run().switches) == 4
