"""Sessions of held control: pieces, resuming, records, and what is refused."""

import numpy as np
import pytest

import flocking as fk
from flocking.engine.archives.data_checks import MalformedError
from flocking.engine.protocol.session import Stored
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


@pytest.mark.parametrize("engine", ["exact", "delayed", "lammps"])
def test_other_engines_refuse_by_name(engine):
    for parts in ({"information": fk.Instant()}, {"control": fk.Continuous()}):
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
    with pytest.raises(UnsupportedLaw, match="replaces neither"):
        fk.start(scenario()).replace(law=LAW)


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
        with pytest.raises(MalformedError, match="gains_changed must be as often"):
            SampledSession.unpack(({**numbers, "gains_changed": wrong}, dict(arrays)), stored, {})
