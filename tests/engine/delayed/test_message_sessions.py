"""Sessions of messages under continuous control: pieces, resuming, ties of instants, expiry, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.errors import FlockingError, SimulationError, UnsupportedLaw
from tests.engine.delayed.test_messages import LAW
from tests.engine.delayed.test_sessions import same

START = fk.start.box(5, side=3, speed=1.5, seed=3, connected_under=LAW.graph)
RADIO = fk.Messages(
    0.1, phase=[0.0, 0.02, 0.04, 0.06, 0.08], delay=0.03, jitter=0.12, loss=fk.DistanceLoss(4.0),
    noise=fk.OrnsteinUhlenbeck(0.01, 0.01), resolution=0.001, expires=0.3, predict=True, seed=5,
)  # fmt: skip


def scenario(law=LAW, t_end=1.0, start=START, **parts):
    return fk.Scenario(law, start, t_end=t_end, frames=11, **{"information": RADIO, **parts})


def same_logs(a, b):
    return all(np.array_equal(getattr(a.log, x), getattr(b.log, x)) for x in ("ticks", "forces", "uses"))


@pytest.mark.parametrize(
    "bodies",
    [
        pytest.param(fk.PointMass(damping=0.1), id="masses"),
        pytest.param(fk.SingleIntegrator(), id="integrators", marks=pytest.mark.slow),
    ],
)
def test_pieces_moments_and_stored_runs_give_the_same_bits(bodies, tmp_path):
    made = scenario(bodies=bodies)
    whole = fk.simulate(made, progress=False)
    assert whole.fidelity.engine == "delayed"
    assert whole.provenance["world"].startswith("messages every 0.1, first at 0 to 0.08, 0.03 to 0.15 late")
    session = fk.start(made)
    for t in np.linspace(0.01, 1.0, 23):
        session.advance(float(t))
    assert same(session.run(), whole)
    assert same_logs(session.run(), whole)
    for at in (0.0, 0.03, 0.5, 0.7123):
        early = fk.start(made)
        early.advance(at)
        again = early.moment()()
        again.advance(1.0)
        assert same(again.run(), whole)
        assert same_logs(again.run(), whole)
    stored = fk.simulate(made, save=tmp_path / "run", progress=False)
    assert same(fk.read_run(tmp_path / "run"), stored)
    assert same_logs(fk.read_run(tmp_path / "run"), whole)
    fk.write_scenario(made, tmp_path / "world.toml")
    assert same(fk.simulate(fk.read_scenario(tmp_path / "world.toml"), progress=False), whole)


def test_a_message_that_a_later_one_has_overtaken_is_no_instant():
    """Sessions that go on from any moment between the two have the same steps as the one that went on."""
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("r**2/2"))])
    late = fk.Messages(0.1, jitter=0.3, seed=1)
    made = fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 1.0], [0.0, 0.0]]), t_end=1.5, information=late)
    whole = fk.simulate(made, progress=False)
    arrived = whole.log.uses[:, 2].max()
    k = np.arange(15)
    draws = fk.start(made).knowledge.arrivals(np.zeros(15, dtype=np.int64), np.ones(15, dtype=np.int64), k)
    overtaken = [n for n in k[:-1] if (draws[n + 1 :] < draws[n]).any() and draws[n] < 1.4e9]
    assert overtaken
    assert arrived > 10
    for n in overtaken:
        session = fk.start(made)
        session.advance(1e-9 * float(draws[n] + draws[n + 1 :].min()) / 2)
        session = session.moment()()
        session.advance(1.5)
        assert same(session.run(), whole)


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_messages_that_overtake_each_other_go_on_bit_for_bit(seed):
    """Jitter of five periods: most samples arrive after newer ones, and change nothing."""
    law = fk.Law(fk.Hysteresis(2.0, 0.3), [fk.Gradient(fk.Potential("(r-1)**2/2")), fk.Consensus(0.5)])
    rng = np.random.default_rng(0)
    start = fk.State(rng.uniform(0, 2.5, (4, 2)), rng.normal(size=(4, 2)) * 0.5)
    made = fk.Scenario(law, start, t_end=1.5, frames=11, information=fk.Messages(0.1, jitter=0.5, seed=seed))
    session = fk.start(made)
    session.advance(0.93)
    again = session.moment()()
    for each in (session, again):
        each.advance(1.5)
    assert same(again.run(), session.run())
    assert same_logs(again.run(), session.run())


def test_a_link_switches_where_the_known_distance_crosses_its_radius():
    """Agent 1 leaves at speed 1 from 1 on; told every 0.4 from 0 on, radius 2.

    Agent 0 rests and learns at 1.2 that the other one is at 2.2. Agent 1 assumes agent 0 at rest where it is, and knows
    itself: its own link breaks at 1, between two messages. With predictions both break at 1.
    """
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("0*r"))])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [1.0, 0.0]])
    for predict, breaks in ((False, 1.2), (True, 1.0)):
        session = fk.start(fk.Scenario(law, start, t_end=3.0, information=fk.Messages(0.4, predict=predict)))
        session.advance(3.0)
        ticks = session.run().log.ticks
        found = {int(agent): instant for instant, agent, count in ticks.tolist() if count == 0}
        assert found[0] == pytest.approx(breaks * 1e9, abs=2)
        assert found[1] == pytest.approx(1e9, abs=2)
        (switch,) = session.run().switches
        assert switch["time"] == pytest.approx(1.0, abs=1e-12)


def test_a_sample_that_expires_clears_the_memory_of_its_link():
    """Linked below 2, appearing below 1.5; at distance 1.8 the link holds until nothing is known, and does not return.

    Nothing is lost, but the first sample is taken at 0.5 and arrives at 0.75: what all have at the start is too old
    from 0.6 on.
    """
    law = fk.Law(fk.Hysteresis(2.0, 0.5), [fk.Gradient(fk.Potential("0*r"))])
    start = fk.State([[0.0, 0.0], [1.8, 0.0]], links=[[False, True], [True, False]])
    heard = fk.Messages(0.5, phase=0.5, delay=0.25, expires=0.6)
    session = fk.start(fk.Scenario(law, start, t_end=2.0, information=heard))
    for t, known in ((0.59, True), (0.61, False), (0.9, False), (1.9, False)):
        session.advance(t)
        assert session.known_links[0, 0, 1] == known
        assert session.state.links[0, 1]
    instants = session.run().log.ticks[:, 0]
    assert instants[instants > 0].tolist() == [600_000_000, 600_000_000]
    fixed = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("r**2/2"))])
    session = fk.start(fk.Scenario(fixed, fk.State(start.q), t_end=2.0, information=heard))
    for t, acts in ((0.59, True), (0.61, False), (0.74, False), (0.76, True), (1.05, True), (1.11, False)):
        session.advance(t)
        assert session.accelerations().any() == acts, t


def test_at_one_instant_a_message_arrives_before_the_old_one_expires_and_is_used_at_once():
    """Sampled every 0.2 without delay and used up to an age of 0.2: something is known at every moment."""
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("r**2/2"))])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]])
    made = fk.Scenario(law, start, t_end=1.0, frames=2, information=fk.Messages(0.2, expires=0.2))
    run = fk.simulate(made, progress=False)
    assert same(run, fk.simulate(made.with_(information=fk.Messages(0.2)), progress=False))
    assert run.log.ticks[:, 0].tolist() == sorted([k * 200_000_000 for k in range(5)] * 2)
    assert run.log.uses[:, 2].tolist() == sorted([*range(5)] * 2)
    assert run.log.forces[0] == pytest.approx([1.0, 0.0])


def test_a_message_that_comes_when_a_link_crosses_its_radius_decides():
    """By the old message agent 0 loses the other one at 1.0; the message of that instant says that it is near."""
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("0*r"))])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[-1.0, 0.0], [-1.5, 0.0]])
    session = fk.start(fk.Scenario(law, start, t_end=1.5, frames=2, information=fk.Messages(1.0)))
    session.advance(1.0)
    # Rounding decides whether the crossing is found at the end of that step: here it is.
    session.pending = np.array([[0, 1, 0]])
    session.advance(1.5)
    assert session.known_links[0, 0, 1]
    assert not [row for row in session.run().log.ticks.tolist() if row[2] == 0]


def test_a_link_to_somebody_of_whom_nothing_is_known_does_not_appear():
    """Below the appear radius of what is forgotten, and beyond it, but not beyond the break radius, of what comes.

    What all have at the start is too old from 0.6 on. Agent 0 passes 1.5 before that place at 0.65, and learns at 0.75
    that the other one was at 2.3, 1.955 away.
    """
    law = fk.Law(fk.Hysteresis(2.0, 0.5), [fk.Gradient(fk.Potential("0*r"))])
    start = fk.State([[0.0, 0.0], [1.8, 0.0]], [[0.46, 0.0], [1.0, 0.0]], links=[[False, True], [True, False]])
    heard = fk.Messages(0.5, phase=0.5, delay=0.25, expires=0.6)
    session = fk.start(fk.Scenario(law, start, t_end=2.0, information=heard))
    for t, known in ((0.55, True), (0.62, False), (0.7, False), (0.8, False)):
        session.advance(t)
        assert session.known_links[0, 0, 1] == known, t


def test_a_force_without_a_value_names_the_agent():
    """The first sample of agent 1, rounded, is where agent 0 is."""
    law = fk.Law(fk.Proximity(4.0), [fk.Gradient(fk.Potential("1/r"))])
    start = fk.State([[0.0], [1.0]], [[0.0], [0.0]])
    with pytest.raises(SimulationError, match="infinite or NaN") as error:
        fk.simulate(fk.Scenario(law, start, t_end=1, information=fk.Messages(0.1, resolution=4.0)), progress=False)
    assert error.value.agents == (0,)
    assert error.value.run is not None


def test_a_link_that_would_switch_without_end_is_named():
    """Pushed away within 2 of the place known, and drawn to it beyond."""
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("-5*r")), fk.Track(fk.Velocity([0.0, 0.0]), 1.0, 1.0)])
    start = fk.State([[0.0, 0.0], [3.0, 0.0]])
    made = fk.Scenario(law, start, t_end=2.0, bodies=fk.SingleIntegrator(), information=fk.Messages(0.5))
    with pytest.raises(SimulationError, match=r"it would switch without end\. Use a graph with hysteresis") as error:
        fk.simulate(made, progress=False)
    assert error.value.agents == (1, 0)


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ({"law": fk.Law(fk.Proximity(2.0), [fk.VelocityAverage(1.0)])}, "engine='delayed' does not count neighbours"),
        ({"information": fk.Messages(1e-8)}, "Messages: period must be at least 1e-07 of the length of the run"),
        ({"control": fk.Held(0.1), "information": fk.Delayed(0.1)}, "No engine runs Delayed under held control"),
    ],
)  # fmt: skip
def test_what_is_not_covered_is_refused_by_name(parts, said):
    with pytest.raises(FlockingError, match=said):
        fk.start(scenario(**parts))


def test_how_messages_are_sent_may_change_while_a_run_goes_on():
    """To the same messages nothing changes; without any from 0.5 on, what is on its way arrives, and then nothing."""
    whole, session = fk.simulate(scenario(), progress=False), fk.start(scenario())
    session.advance(0.5)
    session.replace_information(RADIO)
    session.advance(1.0)
    assert np.array_equal(session.run().q, whole.q)
    session = fk.start(scenario())
    session.advance(0.5)
    before = session.knowledge.newest.copy()
    session.replace_information(replace(RADIO, loss=1.0))
    session.advance(0.6)
    again = session.moment()()
    for each in (session, again):
        each.advance(1.0)
    assert same(session.run(), again.run())
    assert same_logs(session.run(), again.run())
    assert not (session.knowledge.newest > before + 2).any()
    assert session.run().provenance["changed at"] == [0.5]
    assert not session._states.points.there[~np.eye(5, dtype=bool)].any()
    with pytest.raises(UnsupportedLaw, match="this one was changed"):
        fk.replay(session.run())


def test_other_changes_of_a_running_session_are_refused_and_a_change_is_stated():
    session = fk.start(scenario())
    session.advance(0.2)
    with pytest.raises(UnsupportedLaw, match="keeps period, phase, predict, leader, expires and self_known of"):
        session.replace_information(replace(RADIO, expires=0.5))
    with pytest.raises(UnsupportedLaw, match="not whether they are"):
        session.replace_information(fk.Instant())
    assert not session.fidelity.changed
    session.replace_information(replace(RADIO, loss=1.0))
    assert session.fidelity.changed


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("control", [fk.Held(0.1), fk.Continuous()], ids=["held", "continuous"])
def test_huge_errors_of_samples_hide_agents_without_a_warning(control):
    """A distance of 1e300 has no square: no link appears, and agents fly on."""
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("(r-1)**2/2")), fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [1.5, 0.0]], [[0.0, 0.1], [0.0, 0.0]])
    made = fk.Scenario(
        law, start, t_end=0.5, frames=3, control=control, information=fk.Messages(0.1, noise=fk.WhiteNoise(1e300)),
    )  # fmt: skip
    run = fk.simulate(made, progress=False)
    assert run.q[-1] == pytest.approx(start.q + 0.5 * start.p)
