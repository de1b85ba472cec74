"""Sessions in discrete time: pieces, resuming, files, comparisons with the law, and what is refused."""

import dataclasses

import numpy as np
import pytest

import flocking as fk
from flocking.engine.discrete.heading_updates import HeadingUpdates
from flocking.engine.discrete.law_in_force import DiscreteLaw
from flocking.errors import InvalidInput, LawNotObeyed, SimulationError, UnsupportedLaw
from tests.engine.discrete.test_motion import vicsek

LAW = fk.Law(fk.Hysteresis(2.0, 0.3), [fk.Gradient(fk.Potential("(r - 1)**2")), fk.VelocityAverage(0.5)])


def impulsive(**parts):
    start = fk.start.box(20, side=6, speed=1, seed=1)
    given = {"agents": fk.Impulsive(speed=2.0), "control": fk.Held(np.linspace(0.02, 0.03, 20), 0.005), **parts}
    return fk.Scenario(LAW, start, t_end=1.5, frames=16, **given)


def same(a, b):
    return fk.first_difference(a, b) is None and str(a.fidelity) == str(b.fidelity)


@pytest.mark.parametrize("made", [vicsek(frames=40), impulsive(), impulsive(agents=fk.Impulsive(update="forward"))])
def test_pieces_moments_and_stored_runs_give_the_same_bits(made, tmp_path):
    whole = fk.simulate(made)
    session = fk.start(made)
    for t in np.linspace(0.01, 1.0, 23) * made.t_end:
        session.advance(float(t))
        assert session.state.t == float(t)
    assert same(session.run(), whole)
    for share in (0.3, 0.4712, 0.5):
        early = fk.start(made)
        early.advance(share * made.t_end)
        again = early.moment()()
        again.advance(made.t_end)
        assert same(again.run(), whole)
    stored = fk.simulate(made, save=tmp_path / "run", progress=False)
    assert same(fk.read_run(tmp_path / "run"), stored)
    fk.write_scenario(made, tmp_path / "world.toml")
    assert same(fk.simulate(fk.read_scenario(tmp_path / "world.toml")), whole)


def test_frames_between_ticks_lie_on_straight_lines():
    made = vicsek(t_end=3.0, frames=[0.0, 0.25, 0.5, 1.0, 1.75, 3.0])
    run = fk.simulate(made)
    assert np.abs(run.q[2] - (run.q[0] + 0.5 * run.p[0])).max() < 1e-15
    assert np.abs(run.q[4] - (run.q[3] + 0.75 * run.p[3])).max() < 1e-15
    assert (run.p[4] == run.p[3]).all()
    assert (run.p[3] != run.p[2]).any()


def test_links_of_frames_are_those_of_their_positions():
    run = fk.simulate(impulsive())
    links = LAW.graph.initial(run.q[0])
    assert (run.links[0] == links).all()
    session = fk.start(impulsive())
    for t in np.arange(0.0, 1.5, 0.001):
        session.advance(float(t))
        links = LAW.graph.update(session.state.q, links)
    session.advance(1.5)
    differ = links != session.state.links
    distance = np.linalg.norm(session.state.q[:, None] - session.state.q, axis=2)
    # Between two ticks a pair may cross the band and come back unseen, as the definition says.
    assert (distance[differ] > 1.7).all()
    assert (session.state.links[(distance < 1.7) & (distance > 0)]).all()
    assert not session.state.links[distance > 2.0].any()


def test_forces_are_compared_with_the_law(monkeypatch):
    run = fk.simulate(vicsek(t_end=70.0))
    assert run.fidelity.law.checks == 4
    assert run.fidelity.law.gap <= run.fidelity.law.allowed
    forces = DiscreteLaw.forces
    monkeypatch.setattr(DiscreteLaw, "forces", lambda self, *given: 1.0000001 * forces(self, *given))
    with pytest.raises(LawNotObeyed, match="not those of the declared law") as error:
        fk.simulate(vicsek(side=2.5))
    assert error.value.run is not None


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("turn", lambda found: found * 1.0000001, "not those of the declared law"),
        ("waiting", lambda found: found[:, ::-1].copy(), "A computed heading is not that of Heading"),
    ],
)
def test_headings_of_sorted_agents_are_compared_with_the_law(monkeypatch, name, change, said):
    """Wrong averages, and right averages with wrong headings."""
    kept = HeadingUpdates.__dict__[name]
    given = kept.fget if isinstance(kept, property) else kept

    def changed(self, *parts, **named):
        found = given(self, *parts, **named)
        return found if found is None else change(found)

    monkeypatch.setattr(HeadingUpdates, name, property(changed) if isinstance(kept, property) else changed)
    with pytest.raises(LawNotObeyed, match=said):
        fk.simulate(vicsek())


def test_a_lost_neighbour_is_noticed(monkeypatch):
    from flocking.engine.discrete.linked_pairs import Neighbours

    near = Neighbours.near
    monkeypatch.setattr(Neighbours, "near", lambda self, q: tuple(x[1:] for x in near(self, q)))
    with pytest.raises(LawNotObeyed):
        fk.simulate(vicsek(n=8, side=2.5, t_end=70.0))


def test_audits_rest_on_the_forces():
    """No ledger is kept: claims about the motion are judged where forces were compared with the law."""
    made = impulsive(agents=fk.Impulsive(), control=fk.Held(0.01)).with_(t_end=100.0, frames=401)
    run = fk.simulate(made)
    found = {result.claim.key: result for result in fk.audit(run).results}
    assert str(found["velocities-agree"].verdict) == "holds"
    assert str(found["ledger"].verdict) == "not applicable"
    never = dataclasses.replace(run, fidelity=dataclasses.replace(run.fidelity, law=None))
    found = {result.claim.key: result for result in fk.audit(never).results}
    assert str(found["velocities-agree"].verdict) == "not resolved"
    assert "never compared" in found["velocities-agree"].note
    wrong = dataclasses.replace(run.fidelity.law, gap=0.1)
    false = dataclasses.replace(run, fidelity=dataclasses.replace(run.fidelity, law=wrong))
    found = {result.claim.key: result for result in fk.audit(false).results}
    assert str(found["velocities-agree"].verdict) == "not resolved"


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ({"control": fk.Continuous()}, "Scenario: control must be Held for Heading agents"),
        ({"control": fk.Held(1.0, latency=0.1)}, "Held: latency must be 0 for Heading agents"),
        ({"agents": fk.Heading(0.04)}, "must have velocities of the speed of Heading, 0.04; got .0.03 of agent 0"),
        ({"agents": fk.Lagged(fk.PointMass(), 0.1)}, "engine='discrete' does not move Lagged agents"),
    ],
)
def test_what_does_not_go_together_is_refused(parts, said):
    with pytest.raises((InvalidInput, UnsupportedLaw), match=said):
        fk.start(vicsek(**parts), engine="discrete")


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: fk.Heading(0.0), "speed must be greater than 0"),
        (lambda: fk.Heading(1.0, noise=-1.0), "noise must be at least 0"),
        (lambda: fk.Heading(1.0, noise_kind="white"), "must be 'angular' or 'vectorial'"),
        (lambda: fk.Heading(1.0, update="both"), "must be 'backward', 'forward', 'sequential' or 'shuffled'"),
        (lambda: fk.Impulsive(force=0.0), "force must be greater than 0"),
        (lambda: fk.Limited(fk.Heading(1.0), force=1.0), "body must move continuously"),
        (lambda: fk.Lagged(fk.Impulsive(), 1.0), "body must move continuously"),
    ],
)
def test_wrong_values_are_refused(make, said):
    with pytest.raises(InvalidInput, match=said):
        make()


@pytest.mark.parametrize("engine", ["exact", "tiles", "sampled", "delayed", "lammps"])
def test_engines_of_continuous_time_refuse_by_name(engine):
    with pytest.raises(UnsupportedLaw, match="Heading agents, which are in discrete time"):
        fk.start(vicsek(space=fk.Open()), engine=engine)


def test_angular_noise_needs_a_plane():
    start = fk.start.box(5, side=2, dimension=3, speed=1.0, velocities="sphere", seed=1)
    with pytest.raises(InvalidInput, match="must be 'vectorial' for noise in 3 dimensions"):
        fk.Scenario(LAW, start, t_end=1, agents=fk.Heading(1.0, noise=0.1), control=fk.Held(0.1))


def test_a_force_without_a_value_names_the_agent():
    law = fk.Law(fk.Proximity(4.0), [fk.Gradient(fk.Potential("1/r"))])
    start = fk.State([[0.0], [1.0]], [[1.0], [0.0]])
    with pytest.raises(SimulationError, match="infinite or NaN") as error:
        fk.simulate(fk.Scenario(law, start, t_end=3, agents=fk.Impulsive(), control=fk.Held(1.0, 1.0)))
    assert error.value.agents == (0,)
    assert error.value.time == 1.0


def test_a_motion_without_bound_ends_by_name():
    """An explicit step three times too long: positions grow until they are no numbers, before the velocities do."""
    law = fk.Law(fk.Proximity(1.0), [fk.Track(fk.Sink([0.0, 0.0]), 1e6, 0.0)])
    start = fk.State([[1.0, 0.0]], [[0.0, 0.0]])
    session = fk.start(fk.Scenario(law, start, t_end=1e4, frames=2, agents=fk.Impulsive(), control=fk.Held(10.0)))
    with pytest.raises(SimulationError, match="is infinite or NaN") as error:
        session.advance(1e4)
    assert error.value.agents == (0,)
    assert np.isfinite(session.state.q).all()


def test_scheduled_gains_change_at_the_nearest_nanosecond():
    track = fk.Track(fk.Velocity([1.0], start_time=3.0), fk.Schedule([3.3], [0.0, 2.0]), 0.5)
    law = fk.Law(fk.Proximity(1.0), [track])
    start = fk.State([[0.0]], [[0.0]], 3.0)
    made = fk.Scenario(law, start, t_end=4, frames=11, agents=fk.Impulsive(), control=fk.Held(0.1))
    run = fk.simulate(made)
    q, p = 0.0, 0.0
    for k in range(11):
        assert run.q[k, 0, 0] == pytest.approx(q, abs=1e-12)
        u = (2.0 if k >= 3 else 0.0) * (0.1 * k - q) + 0.5 * (1.0 - p)
        q, p = q + 0.1 * p, p + 0.1 * u
