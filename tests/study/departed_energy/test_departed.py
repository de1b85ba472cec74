"""What departed energy is due to: sums, exact zeros, closed forms and an independent quadrature."""

import dataclasses

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput
from flocking.model.world.random_numbers import NOT_AN_AGENT
from flocking.study.departed_energy.departed import CAUSES
from tests.study.message_logs.test_replay import ran, world

BODIES = {"limits", "lag", "disturbance", "body"}

PAIR = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Consensus(1.0)])


def pair(**parts):
    start = fk.State([[0.0], [1.0]], [[0.0], [2.0]])
    given = {"control": fk.Held(0.1), "information": fk.Instant()}
    return fk.Scenario(PAIR, start, t_end=1.0, frames=3, energy=fk.Energy("lab"), **{**given, **parts})


def test_the_causes_add_up_to_what_departed():
    run = ran(world())
    found = fk.departed_causes(run)
    assert set(found.causes) == set(CAUSES)
    assert found.total is not run.trace["departed"]
    assert (found.total == run.trace["departed"]).all()
    assert np.abs(sum(found.causes.values()) - found.total).max() < 1e-12 * np.abs(run.trace["departed"]).max()
    for name in ("delay", "loss", "noise", "links", "hold"):
        assert np.abs(found.causes[name]).max() > 1e-3
    assert not any(found.causes[name].any() for name in BODIES)
    assert np.abs(found.remainder).max() < 1e-12 * np.abs(run.trace["departed"]).max()


@pytest.mark.parametrize(
    ("information", "none"),
    [
        (fk.Instant(), {"delay", "loss", "noise", "links"}),
        (fk.Messages(0.1), {"delay", "loss", "noise", "links"}),
        (fk.Messages(0.1, delay=0.05), {"loss", "noise", "links"}),
        (fk.Messages(0.1, loss=0.0, noise=fk.WhiteNoise(0.0, 0.2)), {"delay", "loss", "links"}),
        (fk.Messages(0.1, loss=0.4), {"delay", "noise", "links"}),
        (fk.Messages(0.1, loss=0.4, expires=0.15), {"delay", "noise"}),
    ],
)
def test_what_is_not_in_the_world_has_exactly_no_share(information, none):
    """Samples fall on the ticks: without delay they are the present, and loss alone makes them old."""
    found = fk.departed_causes(ran(pair(information=information)))
    shares = {name for name, values in found.causes.items() if not values.any()}
    assert shares == none | BODIES


def test_the_share_of_noise_is_the_work_of_its_errors():
    """Velocities of samples enter linearly: the force of an error e_j on agent i is e_j until the next tick."""
    noise = fk.WhiteNoise(0.0, 0.3)
    run = ran(pair(information=fk.Messages(0.1, noise=noise, seed=4)))
    found = fk.departed_causes(run)
    session, before, work = fk.start(pair(information=run.scenario.information), "sampled"), None, 0.0
    for k in range(11):
        session.advance(min(0.1 * k, 1.0))
        now = session.state.q[:, 0]
        if before is not None:
            errors = noise.normals(4, np.array([0, 1]), np.array([k - 1, k - 1]), 1)[1][:, 0] * 0.3
            work += float(errors[::-1] @ (now - before))
        before = now
    assert found.causes["noise"][-1] == pytest.approx(work, abs=1e-12)
    assert abs(work) > 1e-3


def test_the_share_of_hold_is_that_of_the_law_at_ticks_against_the_law_now():
    """The recursion of held consensus by hand, with an exact quadrature: both laws are linear in time."""
    run = ran(pair())
    found = fk.departed_causes(run)
    w, departed = np.array([0.0, 2.0]), 0.0
    for _ in range(10):
        u = w[::-1] - w
        # p(s) = w + u s and the law now is u + (u reversed - u) s: Simpson's rule is exact for their product.
        power = lambda s: float((-s * (u[::-1] - u)) @ (w + s * u))  # noqa: E731, B023
        departed += 0.1 / 6.0 * (power(0.0) + 4.0 * power(0.05) + power(0.1))
        w = w + 0.1 * u
    assert found.causes["hold"][-1] == pytest.approx(departed, abs=1e-12)
    assert abs(departed) > 1e-3


@pytest.mark.parametrize("order", [1, 2])
def test_of_agents_that_have_not_acted_the_law_itself_departs(order):
    """Two agents on a spring whose first force comes after the end: all of the law's work is missing."""
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("r**2/2"))])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.5 if order == 2 else 0.0, 0.0]])
    bodies = fk.SingleIntegrator() if order == 1 else fk.PointMass()
    run = fk.simulate(fk.Scenario(law, start, t_end=1.0, frames=3, bodies=bodies, control=fk.Held(0.3, phase=9.0)))
    causes = fk.departed_causes(run).causes
    # H = r**2/2 grows with r = 1 + t/2 to 9/8; agents of order 1 stand, and lose the 2 r**2 that flow would dissipate.
    assert causes["hold"][-1] == pytest.approx(5.0 / 8.0 if order == 2 else 2.0, rel=1e-9)
    assert all(not values.any() for name, values in causes.items() if name != "hold")


@pytest.mark.parametrize("velocity", [0.0, 0.7])
def test_what_departs_by_rounding_alone_is_no_sign_of_a_changed_run(velocity):
    """Three agents at the minimum of their springs, at rest or in uniform motion that samples are moved on with."""
    law = fk.Law(fk.Proximity(5.0), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0], [0.5, 0.75**0.5]], [[velocity, 0.3 * velocity]] * 3)
    run = fk.simulate(fk.Scenario(law, start, t_end=0.3, frames=4, information=fk.Messages(0.1, predict=True)))
    assert max(float(np.abs(x).max()) for x in fk.departed_causes(run).causes.values()) < 1e-14
    if velocity:
        trace = run.trace.copy()
        trace["departed"] += 1e-6 * np.arange(len(trace))
        with pytest.raises(InvalidInput, match="ledger that follows from its scenario"):
            fk.departed_causes(dataclasses.replace(run, trace=trace))


def test_it_is_drawn(tmp_path):
    from flocking.show.contents import contents

    run = ran(world())
    figure = fk.plot(run, "departed", save_as=tmp_path / "departed")
    assert (tmp_path / "departed.svg").exists()
    (panel,) = contents(figure)
    drawn = {mark.name: mark for mark in panel.marks if mark.kind == "line"}
    found = fk.departed_causes(run)
    for name in ("delay", "loss", "noise", "links", "hold"):
        assert drawn[name].points[-1, 1] == pytest.approx(found.causes[name][-1])
    assert drawn["total"].points[-1, 1] == pytest.approx(run.trace["departed"][-1])
    assert "limits" not in drawn


def test_pictures_of_runs_without_causes_say_why():
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [2.0, 0.0]])
    run = fk.simulate(pair().with_(start=start), engine="tiles", log=False, progress=False)
    with pytest.raises(InvalidInput, match="departed_causes: run must have a log of what agents used") as refused:
        fk.departed_causes(run)
    (axes,) = fk.plot(run, "departed").axes
    title = axes.get_title(loc="left").replace("\n", " ")
    assert title.startswith("no causes: departed_causes: run must have a log")
    assert title.removeprefix("no causes: ") == str(refused.value)
    assert len(axes.lines) == 2


PULL = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2"))])


def attracted(**parts):
    """Two agents of order 1 on a line at distance 1 that attract each other: H is half the squared distance."""
    given = {"agents": fk.SingleIntegrator(), "control": fk.Held(0.1), "information": fk.Instant()}
    return fk.Scenario(PULL, fk.State([[0.0], [1.0]]), t_end=0.4, frames=3, **{**given, **parts})


def test_of_order_1_differences_work_by_the_gradient_of_the_energy():
    """The distance x moves at the rate -x_k - x_j, with the sample j that is 1 or 2 ticks old; wanted is -2 x."""
    found = fk.departed_causes(ran(attracted(information=fk.Messages(0.1, delay=0.15))))
    x, delay, hold, past = 1.0, 0.0, 0.0, [1.0]
    for k in range(4):
        known = past[max(k - 2, 0)]
        end = x + 0.1 * (-x - known)
        mean = 0.5 * (x + end)
        delay += 0.1 * mean * ((-x - known) + 2.0 * x)
        hold += 0.1 * (-2.0 * x * mean + 2.0 * (x * x + x * end + end * end) / 3.0)
        x = end
        past.append(x)
    assert found.causes["delay"][-1] == pytest.approx(delay, abs=1e-13)
    assert found.causes["hold"][-1] == pytest.approx(hold, abs=1e-13)
    assert min(abs(delay), abs(hold)) > 1e-3
    assert not any(values.any() for name, values in found.causes.items() if name not in ("delay", "hold"))


def test_of_order_1_the_share_of_noise_is_the_work_of_its_errors():
    noise = fk.WhiteNoise(0.3)
    run = ran(attracted(information=fk.Messages(0.1, noise=noise, seed=4)))
    x, work = np.array([0.0, 1.0]), 0.0
    for k in range(4):
        errors = 0.3 * noise.normals(4, np.array([0, 1]), np.array([k, k]), 1)[0][:, 0]
        force = x[::-1] + errors[::-1] - x
        gradient = (x - x[::-1]) + 0.05 * (force - force[::-1])
        work += 0.1 * float(errors[::-1] @ gradient)
        x = x + 0.1 * force
    assert fk.departed_causes(run).causes["noise"][-1] == pytest.approx(work, abs=1e-13)
    assert abs(work) > 1e-3


def led(loss=None, **parts):
    """One agent of mass 1 that follows the velocity, sin(3 t), of a leader whose messages it holds."""
    leader = fk.Path(["sin(3*t)"])
    law = fk.Law(fk.Fixed(1, []), [fk.Track(leader, 0.0, 1.0)])
    given = {"information": fk.Messages(0.1, leader=True, delay=0.05, loss=loss, seed=3), "energy": fk.Energy("lab")}
    return fk.Scenario(law, fk.State([[0.0]], [[1.0]]), t_end=1.0, frames=3, **{**given, **parts})


def last_sample(k, lost=()):
    """Number of the newest sample with a delay of half a period that an agent has at tick k; -1 for the start's."""
    return next((j for j in range(k - 1, -1, -1) if j not in lost), -1)


@pytest.mark.parametrize("loss", [None, 0.5])
def test_late_and_lost_messages_of_leaders_have_their_shares(loss):
    run = ran(led(loss, control=fk.Held(0.1)))
    lost = set()
    if loss is not None:
        k = np.arange(11)
        drawn = run.scenario.information.loss.lost(3, np.full(11, NOT_AN_AGENT), np.zeros(11, dtype=int), k)
        lost = set(k[drawn].tolist())
        assert 2 <= len(lost) <= 9
    velocity = lambda k: np.sin(0.3 * max(k, 0))  # noqa: E731
    p, delay, missed = 1.0, 0.0, 0.0
    for k in range(10):
        used, newest = last_sample(k, lost), last_sample(k)
        way = 0.1 * p + 0.005 * (force := velocity(used) - p)
        missed += (velocity(used) - velocity(newest)) * way
        delay += (velocity(newest) - velocity(k)) * way
        p += 0.1 * force
    found = fk.departed_causes(run)
    assert found.causes["delay"][-1] == pytest.approx(delay, abs=1e-12)
    assert found.causes["loss"][-1] == pytest.approx(missed, abs=1e-12)
    assert abs(delay) > 1e-2
    assert found.causes["loss"].any() == (loss is not None)
    assert not any(values.any() for name, values in found.causes.items() if name not in ("delay", "loss", "hold"))


def test_messages_of_leaders_on_the_ticks_are_not_late():
    found = fk.departed_causes(ran(led(control=fk.Held(0.1), information=fk.Messages(0.1, leader=True))))
    assert {name for name, values in found.causes.items() if values.any()} == {"hold"}


def test_agents_that_meet_obstacles_keep_their_links():
    """Of agents that know the truth no share is due to links, whichever obstacles they meet."""
    avoid = fk.Avoid([fk.Ball([9.0, 9.0], 0.1), fk.Ball([2.0, 0.0], 0.5)], range=1.0, gamma_agents=False)
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Consensus(1.0), avoid])
    start = fk.State([[0.0, 0.0], [0.0, 2.0]], [[2.0, 0.1], [0.0, 0.0]])
    run = ran(fk.Scenario(law, start, t_end=1.0, frames=3, control=fk.Held(0.1)))
    assert (run.switches["kind"] == "obstacle").any()
    assert not fk.departed_causes(run).causes["links"].any()


@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_ledgers_that_hold_no_numbers_are_refused(number):
    run = ran(pair())
    trace = run.trace.copy()
    trace["departed"][-1] = number
    with pytest.raises(InvalidInput, match="must have a ledger that follows from its scenario"):
        fk.departed_causes(dataclasses.replace(run, trace=trace))


def test_runs_without_a_ledger_are_refused_by_name():
    law = fk.Law(fk.Proximity(2.0), [fk.VelocityAverage(1.0)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.1], [0.1, 0.0]])
    made = fk.Scenario(law, start, t_end=0.3, frames=2, agents=fk.Heading(0.1), control=fk.Held(0.1))
    with pytest.raises(InvalidInput, match="departed_causes: run must have an energy ledger"):
        fk.departed_causes(fk.simulate(made, progress=False))
