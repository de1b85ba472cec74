"""The ledger of agents of order 1 under held control: what velocities that act do beyond those of the law departs."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import flocking as fk
from flocking.engine.tiles.engine import ENGINE
from flocking.engine.tiles.options import TilesOptions
from flocking.study.claims.claim import Verdict
from tests.engine.tiles.flow_laws import Pull, laws
from tests.engine.tiles.laws import states, structural

SPRING = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("r**2/2"))])
PATH = fk.Path(["sin(t)", "0.5*cos(2*t)"])


def tiled(scenario, **options):
    return fk.simulate(scenario, engine="tiles", progress=False, **options)


def sampled(scenario):
    return fk.simulate(scenario, engine="sampled", progress=False)


# Two agents that attract each other, by hand.


def pair_of(period, phase=0.0, t_end=0.8):
    return fk.Scenario(
        SPRING, fk.State([[0.0, 0.0], [1.0, 0.0]]), t_end=t_end, agents=fk.SingleIntegrator(),
        control=fk.Held(period, phase=phase), frames=2,
    )  # fmt: skip


@pytest.mark.parametrize("phase", [0.0, 0.1])
def test_two_agents_that_attract_each_other_depart_as_by_hand(phase):
    """H = x^2/2 of the distance x, which from a tick x_k on is x_k (1 - 2 s); the law wants x' = -2 x.

    What departs at the rate x (x' + 2 x) has the second derivative 16 x_k^2, as what is dissipated, 2 x^2: the
    trapezoidal rule of steps h adds h^2/12 times its integral to both, so that the balance is exact. Before the first
    tick agents stand still, and all that the law would dissipate departs.
    """
    period, t_end = 0.2, 0.8
    x, dissipated, departed, bend = 1.0, 2.0 * phase, 2.0 * phase, 0.0
    times = np.append(np.arange(phase, t_end, period), t_end)
    for span in np.diff(times):
        dissipated += 2 * x * x * (span - 2 * span**2 + 4 * span**3 / 3)
        departed -= 4 * x * x * (span**2 / 2 - 2 * span**3 / 3)
        bend += 16 * x * x * span
        x *= 1 - 2 * span
    for step in (0.05, 0.02, 0.01):
        run = tiled(pair_of(period, phase, t_end), step=step)
        last, excess = run.trace[-1], step**2 / 12 * bend
        assert last["energy"] == pytest.approx(0.5 * x * x, abs=1e-15)
        assert last["kinetic"] == last["supplied"] == last["jumped"] == 0.0
        assert last["dissipated"] == pytest.approx(dissipated + excess, abs=1e-13)
        assert last["departed"] == pytest.approx(departed + excess, abs=1e-13)
        assert np.abs(run.residual).max() < 1e-14
        assert excess > 1e-5


def test_at_the_limit_of_short_periods_nothing_departs_to_first_order():
    found = [abs(tiled(pair_of(period), step=period).trace["departed"][-1]) for period in (0.02, 0.01, 0.005)]
    fine = [abs(tiled(pair_of(period), step=period / 4).trace["departed"][-1]) for period in (0.02, 0.01, 0.005)]
    # With one step a period the trapezoidal rule itself is of first order in what departs; finer steps tell.
    for shares in (found, fine):
        assert shares[0] / shares[1] == pytest.approx(2.0, abs=0.1)
        assert shares[1] / shares[2] == pytest.approx(2.0, abs=0.05)
    assert fine[2] < 0.01


# Powers at single times, against differences of the energy.

MEANS = "gain beside masses in the centre of mass"


def under_held(n, m):
    """Laws that this engine runs under held control, with one whose energy depends on the motion of the mean."""
    found = {name: x for name, x in laws(n, m).items() if "obstacles" not in name and name != "shared leader"}
    path = fk.Path(["sin(t)", "0.5*cos(2*t)", "t"][:m])
    law = fk.Law(fk.Proximity(1.4), [fk.Gradient(structural()), fk.Track(path, position_gain=0.6)])
    return found | {MEANS: (law, fk.Energy("centre of mass"))}


QUICK = ("gain of each agent", "directed", "frame of the leader", MEANS)
ALL = [pytest.param(name, 2, "float64", marks=() if name in QUICK else pytest.mark.slow) for name in under_held(4, 2)]
FORMS = [pytest.param("gain of each agent", *form, marks=pytest.mark.slow) for form in ((3, "float64"), (2, "float32"))]


@pytest.mark.parametrize(("name", "m", "precision"), ALL + FORMS)
def test_powers_are_those_of_differences_of_the_energy(name, m, precision):
    """What departs is dH/dq . (v - u), whose two terms are differences of H at one time."""
    n = 40
    law, energy = under_held(n, m)[name]
    start = states(n, m, seed=n, side=1.1)["lattice" if name == "hysteresis" else "random"].q
    agents = fk.SingleIntegrator(np.random.default_rng(1).uniform(0.5, 2.0, n))
    held = fk.Scenario(
        law, fk.State(start, t=0.3), t_end=0.5, agents=agents, energy=energy, control=fk.Held(0.005, latency=0.002)
    )
    session = ENGINE.open(held, TilesOptions(step=0.0005, precision=precision))
    session.advance(0.312)
    share = 1e-8 if precision == "float64" else 1e-5
    seen = []
    for act in (False, True):
        if act:
            # Velocities that were computed at the tick before begin to act.
            session._act()
        state, v = session.state, session.accelerations()
        assert state.t == pytest.approx(0.312)
        now = {"agents": agents, "energy": energy}
        u = fk.evaluate(law, state, **now).u
        state = fk.State(state.q, t=state.t, links=state.links)

        def rate(velocity, at=state, given=now):
            places = [at.q + k * 1e-5 * velocity for k in (1, -1, 2, -2)]
            ends = [fk.evaluate(law, fk.State(q, t=at.t, links=at.links), **given).storage for q in places]
            return (8 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / 12e-5

        work, _, _, departed = session._memory.ledger.powers
        size = np.abs(u).sum() * np.abs(v - u).max() + 1e-3
        assert work == pytest.approx((v**2).sum(), rel=1e-12 if precision == "float64" else 1e-5)
        assert abs(departed - (rate(v) - rate(u))) < share * size
        seen.append(departed)
    assert abs(seen[0] - seen[1]) > 1e-4 * size


@pytest.mark.parametrize("event", ["rebuild", "gains", "motion"])
def test_velocities_of_the_law_are_computed_anew_after_what_changes_them(event):
    n = 40
    law, energy = laws(n)["gain of each agent"]
    held = fk.Scenario(
        law, fk.State(states(n, 2, seed=n)["random"].q), t_end=0.5, agents=fk.SingleIntegrator(), energy=energy,
        control=fk.Held(0.005, latency=0.002),
    )  # fmt: skip
    session = ENGINE.open(held, TilesOptions(step=0.0005))
    session.advance(0.012)
    particles = session._particles
    seen = particles.velocity_powers(0.012, particles.force)
    assert (seen == session._memory.ledger.powers[[0, 3]]).all()
    if event == "rebuild":
        particles.rebuild(0.0005)
    elif event == "gains":
        particles.pass_switch_time(held, 0.012)
        particles.successor[:] = np.nan
    else:
        particles.coast(0.01)
    found = particles.velocity_powers(0.012, particles.force)
    particles.evaluate(0.012, hold=True)
    assert (found == particles.velocity_powers(0.012, particles.force)).all()
    if event == "motion":
        assert abs(found[1] - seen[1]) > 1e-3 * abs(seen[1])
    else:
        assert found == pytest.approx(seen, rel=1e-12)


# Runs, against the engine that moves a group from event to event.


def smooth(n=20, **changes):
    """A motion without switches, after a leader that moves, with agents that pull each other unevenly."""
    law = fk.Law(
        fk.Proximity(50.0),
        [
            fk.Gradient(fk.Potential("log(4 + r**2)/5")),
            Pull(np.linspace(0.02, 0.1, n)),
            fk.Track(PATH, position_gain=0.5),
        ],
    )
    given = {"control": fk.Held(0.1, latency=0.02), "t_end": 0.6, "frames": 3, "agents": fk.SingleIntegrator()}
    return fk.Scenario(law, fk.State(fk.start.box(n, side=4, seed=3).q), **{**given, **changes})


WORLDS = {
    "held": {},
    "each by itself": {"control": fk.Held(np.where(np.arange(20) % 3, 0.1, 0.2), latency=0.02 * (np.arange(20) % 4))},
    "messages": {"information": fk.Messages(0.1, delay=0.05, loss=0.3, noise=fk.WhiteNoise(0.01), expires=1.0)},
    "limited": {"agents": fk.Limited(fk.SingleIntegrator(), speed=0.8)},
    "gusts": {"agents": fk.Disturbed(fk.SingleIntegrator(), 0.1, 0.06)},
    "centre of mass": {"energy": fk.Energy("centre of mass")},
}
LATE = ("each by itself", "gusts", "centre of mass")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name in LATE else ()) for name in WORLDS]
)
def test_the_ledger_is_that_of_sampled_to_order_two(name):
    """The error of the trapezoidal rule has even powers of the step where powers are smooth between ticks."""
    held = smooth(**WORLDS[name])
    truth = sampled(held).trace[-1]
    columns = ("dissipated", "supplied", "departed", "work")
    found, left = [], []
    for step in (0.02, 0.01, 0.005):
        run = tiled(held, step=step)
        found.append(np.array([run.trace[-1][k] for k in columns]))
        left.append(np.abs(run.residual).max())
        assert run.trace["energy"][-1] == pytest.approx(truth["energy"], rel=1e-12)
    exact = np.array([truth[k] for k in columns])
    off = [np.abs(each - exact) for each in found]
    ratios = np.log2(off[0][:3] / off[2][:3]) / 2
    assert ratios == pytest.approx(2, abs=0.1)
    assert np.log2(left[0] / left[2]) / 2 == pytest.approx(2, abs=0.1)
    halves = [(4 * fine - rough) / 3 for rough, fine in pairwise(found)]
    best = (16 * halves[1] - halves[0]) / 15
    assert np.abs(best - exact).max() < 1e-9 * (1 + np.abs(exact).max())
    assert np.abs(exact[[1, 2]]).min() > 0.01


def test_what_switches_of_links_change_is_a_jump():
    """Links switch at steps, to first order in the step."""
    near = fk.Law(fk.Hysteresis(1.5, 0.2), [fk.Gradient(structural()), Pull(np.linspace(0.5, 1.5, 40))])
    crowd = fk.Scenario(
        near, fk.State(fk.start.box(40, side=7.0, seed=4).q), t_end=0.4, frames=3, agents=fk.SingleIntegrator(),
        control=fk.Held(0.05),
    )  # fmt: skip
    truth, run = sampled(crowd), tiled(crowd, step=0.0005)
    assert truth.switches.size > 5
    assert abs(truth.trace["jumped"][-1]) > 0.05 * run.turnover
    for column in ("energy", "dissipated", "supplied", "jumped", "departed"):
        assert run.trace[column][-1] == pytest.approx(truth.trace[column][-1], abs=5e-3 * run.turnover)
    assert np.abs(run.residual).max() < 1e-3 * run.turnover


def test_the_split_of_what_departed_is_that_of_sampled():
    held = smooth(n=4, t_end=0.4, **WORLDS["messages"])
    run, truth = tiled(held, step=0.01, ledger_at="ticks"), fk.departed_causes(sampled(held))
    found = fk.departed_causes(run)
    largest = max(np.abs(x).max() for x in truth.causes.values())
    for name, share in found.causes.items():
        bound = 1e-2 if name == "hold" else 1e-9
        assert abs(share[-1] - truth.causes[name][-1]) < bound * largest, name
    assert min(np.abs(found.causes[name]).max() for name in ("delay", "noise", "loss", "hold")) > 1e-4 * largest


# Sessions.


def crowd_of(n, **changes):
    """Agents whose links switch, and who pull each other unevenly."""
    law = fk.Law(fk.Hysteresis(1.3, 0.1), [fk.Gradient(structural()), Pull(np.linspace(0.1, 0.5, n))])
    start = fk.State(fk.start.hexagonal(n, spacing=0.9, noise=0.1, seed=2).q)
    given = {"control": fk.Held(0.05, latency=0.02), "frames": 5}
    return fk.Scenario(law, start, t_end=0.3, agents=fk.SingleIntegrator(), **{**given, **changes})


@pytest.mark.parametrize("ledger_at", ["steps", "ticks"])
def test_pieces_threads_and_resuming_give_the_same_bits(ledger_at):
    """Cut between two steps, at a step, and where velocities begin to act."""
    held = crowd_of(1200)
    options = {"step": 0.005, "ledger_at": ledger_at, "skin": 0.05}
    whole = tiled(held, threads=1, **options)
    session = ENGINE.open(held, TilesOptions(threads=2, **options))
    for cut in (0.1, 0.12, 0.153, 0.2):
        session.advance(cut)
        session = session.moment()()
    session.advance(0.3)
    again = session.run()
    assert whole.provenance["rebuilds"] > 3
    for name in ("q", "trace"):
        assert (getattr(again, name) == getattr(whole, name)).all()
    assert np.abs(whole.trace["departed"]).max() > 0.01


def test_the_ledger_at_ticks_has_a_row_for_each():
    held = crowd_of(200, control=fk.Held(0.05), frames=2)
    coarse, fine = tiled(held, step=0.005, ledger_at="ticks"), tiled(held, step=0.005)
    assert coarse.trace["time"] == pytest.approx(np.arange(0, 0.31, 0.05), abs=1e-9)
    assert coarse.trace["energy"][-1] == pytest.approx(fine.trace["energy"][-1], rel=1e-13)
    assert coarse.provenance["ledger at"] == "ticks"


def test_verdicts_about_the_motion_rest_on_a_ledger_that_closes():
    """Agents stay apart; without what departed the ledger shows that other velocities than those of the law acted."""
    run = tiled(crowd_of(200), step=0.005)
    assert fk.audit(run)["all-apart"].verdict == Verdict.HOLDS
    trace = run.trace.copy()
    trace["departed"] = 0.0
    for other in (replace(run, trace=trace), tiled(crowd_of(200), step=0.005, ledger_at="ticks")):
        assert fk.audit(other)["all-apart"].verdict == Verdict.NOT_RESOLVED


def test_the_motion_does_not_depend_on_whether_there_is_a_ledger():
    held = crowd_of(200)
    with_it, without = tiled(held, step=0.005), tiled(held, step=0.005, ledger=False)
    assert (with_it.q == without.q).all()
    assert len(without.trace) == 0
    assert "ledger at" not in without.provenance


def test_single_precision_stays_within_its_rounding():
    double, single = (tiled(smooth(), step=0.01, precision=p) for p in ("float64", "float32"))
    for column in ("dissipated", "supplied", "departed"):
        assert single.trace[column][-1] == pytest.approx(double.trace[column][-1], abs=1e-5 * double.turnover)
    assert np.abs(single.residual).max() < 1e-3 * single.turnover


def test_an_automatic_step_closes_the_ledger():
    for law in (crowd_of(200).law, smooth().law):
        made = smooth() if law is smooth().law else crowd_of(200)
        run = tiled(made)
        assert np.abs(run.residual).max() < 0.03 * run.turnover
