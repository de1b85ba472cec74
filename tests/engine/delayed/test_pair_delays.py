"""A delay for every ordered pair: a second implementation, closed forms, an invariant, links, and stored sessions."""

import itertools
import math

import numpy as np
import pytest
from scipy.optimize import brentq

import flocking as fk
from flocking.engine.archives.data_checks import MalformedError
from flocking.engine.delayed.breaking_points import APART, PairPoints
from flocking.engine.driver.registry import chosen_engine, engine_named
from flocking.engine.protocol.session import Stored
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.study.margins.quantities import quantities
from tests.engine.delayed.plain_delays import PlainDelays
from tests.engine.delayed.test_independent import random_world
from tests.engine.delayed.test_sessions import LAW, check_going_on, same, scenario

SPRING = fk.Gradient(fk.Potential("r**2/2"))


def random_delays(rng, n, late, choices=(0.0, 0.05, 0.12, 0.31)):
    """Delays of some values, one of them zero; of the agents themselves too where they are late."""
    tau = rng.choice(choices, size=(n, n)) * (1.0 if late else 1.0 - np.eye(n))
    tau[0, 1] = choices[1]
    if late:
        tau[0, 0] = choices[2]
    return tau


def check(seed):
    """The engine and the second implementation agree; how often a known link switched.

    Where they differ by more than 1e-8 both are made more accurate: a link that nearly touches its distance magnifies
    errors of either.
    """
    made, _ = random_world(seed)
    rng = np.random.default_rng(seed)
    late = bool(rng.random() < 0.5)
    choices = (0.0, 0.05, 0.12, 0.31) if rng.random() < 0.8 else (0.0, *rng.uniform(0.04, 0.3, 5))
    made = made.with_(information=fk.Delayed(random_delays(rng, made.start.n, late, choices), late))
    for tolerance, parts in ((1e-10, 8), (1e-12, 32)):
        plain = PlainDelays(made, lambda r: 1.5 * (r - 1), 0.8 if made.agents.order == 2 else 0.0)
        plain.parts = parts
        session = fk.start(made.with_(tolerance=tolerance))
        assert (session.known_links[0] == plain.links).all()
        session.advance(made.t_end)
        run = session.run()
        q, p, switches = plain.run(made.t_end)
        off = max(np.abs(run.q[-1] - q).max(), np.abs(run.p[-1] - p).max())
        if off < 1e-8:
            break
    assert off < 1e-8
    assert run.fidelity.engine == "delayed"
    assert (session.known_links[0] == plain.links).all()
    assert np.abs(run.residual).max() <= 1e-9 * max(1.0, run.turnover)
    return switches


def test_random_worlds():
    assert sum(check(seed) for seed in (2, 4, 5, 7)) > 12


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8, 68))
def test_60_more_random_worlds(seed):
    check(seed)


def everybody(tau, n, late):
    return tau * (np.ones((n, n)) - (0.0 if late else np.eye(n)))


@pytest.mark.parametrize("late", [False, True])
def test_equal_delays_are_one_delay(late):
    start = fk.start.box(5, side=3, speed=1, seed=2)
    for law, off in (
        (fk.Law(fk.Fixed.complete(5), LAW.terms), 1e-12),
        (fk.Law(fk.Hysteresis(2.5, 0.3), LAW.terms), 1e-9),
    ):
        made = fk.Scenario(law, start, t_end=1.0, frames=11, information=fk.Delayed(0.1, late))
        one = fk.simulate(made, progress=False)
        each = fk.simulate(made.with_(information=fk.Delayed(everybody(0.1, 5, late), late)), progress=False)
        assert np.abs(one.q - each.q).max() < off
        assert np.abs(one.trace["departed"][-1] - each.trace["departed"][-1]) < 100 * off
        assert len(one.switches) == len(each.switches)
        assert one.provenance["world"] == each.provenance["world"]


def test_two_agents_of_order_1_by_the_method_of_steps():
    """x' = y(t - a) - x and y' = x(t - b) - y from rest: exponentials until a, with a factor t until a + b."""
    a, b, x0, y0 = 0.3, 0.7, 1.0, -0.5
    law, start = fk.Law(fk.Fixed.complete(2), [SPRING]), fk.State([[x0, 0.0], [y0, 0.0]])
    made = fk.Scenario(law, start, t_end=1.0, frames=101, bodies=fk.SingleIntegrator(), tolerance=1e-11,
                       information=fk.Delayed([[0.0, a], [b, 0.0]]))  # fmt: skip
    run = fk.simulate(made, progress=False)

    def agent(t, own, other, tau):
        first = other + (own - other) * np.exp(-t)
        at = other + (own - other) * math.exp(-tau)
        s = t - tau
        later = own + (at - own + (other - own) * s) * np.exp(-s)
        return np.where(t <= tau, first, later)

    assert np.abs(run.q[:, 0, 0] - agent(run.t, x0, y0, a)).max() < 1e-10
    assert np.abs(run.q[:, 1, 0] - agent(run.t, y0, x0, b)).max() < 1e-10


def test_two_delays_brake_a_flock_as_their_mean_does():
    """Roots depend on the sum of the delays: (s^2 + 1 + s)^2 = (1 + s)^2 exp(-s (a + b))."""
    law = fk.Law(fk.Fixed.complete(2), [SPRING, fk.Consensus(1.0)])
    made = fk.Scenario(law, fk.State(np.zeros((2, 2)), [[5.0, 0.0]] * 2), t_end=30.0, frames=31,
                       information=fk.Delayed([[0.0, 0.04], [0.16, 0.0]]))  # fmt: skip
    speed = fk.simulate(made, progress=False).p[:, :, 0]
    rate = brentq(lambda s: s * s + (1 + s) * (1 - math.exp(-0.1 * s)), -0.2, -0.05, xtol=1e-14)
    assert np.log(speed[30] / speed[20]) / 10.0 == pytest.approx(np.full(2, rate), abs=1e-9)


@pytest.mark.parametrize("seed", range(2))
def test_agreement_of_order_1_bears_all_delays_and_ends_where_the_invariant_says(seed):
    """sum x_i + sum_ij w_ij (integral of x_j from t - tau_ij to t) stays: at rest before, and agreed in the end."""
    rng = np.random.default_rng(seed)
    n = 4
    tau = rng.uniform(0.2, 1.5, (n, n)) * (1.0 - np.eye(n))
    edges = [(0, 1), (1, 2), (2, 3), (3, 0)][: 3 + seed % 2]
    made = fk.Scenario(fk.Law(fk.Fixed(n, edges), [SPRING]), fk.State(rng.normal(size=(n, 2))), t_end=80.0, frames=3,
                       bodies=fk.SingleIntegrator(), information=fk.Delayed(tau), tolerance=1e-11)  # fmt: skip
    run = fk.simulate(made, progress=False)
    weight = np.ones(n)
    for i, j in edges:
        weight[j] += tau[i, j]
        weight[i] += tau[j, i]
    assert np.abs(run.q[-1] - weight @ run.q[0] / weight.sum()).max() < 1e-8
    found = fk.certify(made)["delay_in_world"]
    assert found.granted
    assert "each pair by its own delay, and for all other such delays" in found.statement


def test_each_ordered_pair_links_by_its_own_delay():
    """Agent 1 leaves at speed 1: agents at rest see it go late, each by its own delay, or at once."""
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("0*r"))])
    start = fk.State([[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]], [[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    tau = [[0.0, 0.5, 0.1], [0.3, 0.0, 0.3], [0.0, 0.0, 0.0]]
    session = fk.start(fk.Scenario(law, start, t_end=3.0, information=fk.Delayed(tau)))
    for t, known in ((0.99, (True, True, True)), (1.01, (True, False, False)), (1.49, (True, False, False)),
                     (1.51, (False, False, False))):  # fmt: skip
        session.advance(t)
        links = session.known_links[0]
        assert (links[0, 1], links[1, 0], links[2, 1]) == known
        assert (links[0, 2], links[2, 0]) == (True, True)
    assert [row["time"] for row in session.run().switches] == pytest.approx([1.0, 1.0], abs=1e-12)


def test_known_links_at_the_start_are_of_the_lines_before():
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [2.5, 0.0], [0.5, 0.0]], [[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    tau = [[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.4, 0.0]]
    session = fk.start(fk.Scenario(law, start, t_end=1.0, information=fk.Delayed(tau)))
    assert session.known_links[0].tolist() == [[False, True, True], [False, False, False], [True, True, False]]


@pytest.mark.parametrize("late", [False, True])
def test_pieces_moments_stored_runs_and_files_give_the_same_bits(late, tmp_path):
    tau = random_delays(np.random.default_rng(5), 8, late)
    made = scenario(information=fk.Delayed(tau, late), t_end=0.8)
    whole = fk.simulate(made, progress=False)
    assert whole.provenance["world"] == f"{'everybody' if late else 'neighbours'} known 0 to 0.31 late"
    assert len(whole.switches) > 1
    session = fk.start(made)
    for t in np.linspace(0.01, 0.8, 13):
        session.advance(float(t))
    assert same(session.run(), whole)
    check_going_on(made, whole, (0.0, 0.03, 0.4123), tmp_path)
    fk.write_scenario(made, tmp_path / "world.toml")
    read = fk.read_scenario(tmp_path / "world.toml")
    assert read.information == made.information
    assert hash(read.information) == hash(made.information)
    assert hash(fk.Delayed([[0.0, 0.1], [0.2, -0.0]])) == hash(fk.Delayed([[0.0, 0.1], [0.2, 0.0]]))
    assert same(fk.simulate(read, progress=False), whole)


def test_breaking_points_are_the_sums_of_delays_along_links():
    """All walks of up to three links away from an agent, enumerated; two that are closer than allowed are one."""
    tau = np.array([[0.0, 1.0, 1.9], [1.45, 0.0, 0.0], [2.3, 1.27, 0.0]])
    links = np.array([[[0, 1, 0], [1, 0, 1], [0, 1, 0]]], dtype=bool)
    points = PairPoints(tau)
    points.jump(0.5, np.array([0]), links)
    ends = set()
    for length in (1, 2, 3):
        for walk in itertools.product(range(3), repeat=length):
            steps = list(zip((0, *walk), walk, strict=False))
            if all(links[0, to, of] for of, to in steps):
                ends.add((round(0.5 + sum(tau[to, of] for of, to in steps), 9), length))
    found, t, last = [], 0.5, 0.5
    while (t := points.following(t, links)) < math.inf:
        found.append(round(t, 9))
        points.reach(t, links)
    expected = []
    for at, length in sorted(ends):
        if at > last and (length == 1 or at >= last + APART):
            expected.append(at)
            last = at
    assert found == expected
    assert len(found) >= 4
    assert points.arrays()["breaks"].size


def test_crafted_jumps_are_refused():
    made = scenario(information=fk.Delayed(random_delays(np.random.default_rng(5), 8, False)), t_end=0.4)
    session = fk.start(made)
    session.advance(0.2)
    numbers, arrays = session.pack()
    assert len(arrays["jumps"]) > 3
    stored = Stored(made, None, session.records.counts, lambda: session.run("unfinished"))
    for name, change in (("jumps", lambda x: x + 8), ("jumps", lambda x: x[1:]), ("breaks", lambda x: x[::-1].copy()),
                         ("breaks", lambda x: x - 1.0), ("times", lambda x: x * 3.0)):  # fmt: skip
        wrong = {key: x.copy() for key, x in arrays.items()} | {name: change(arrays[name])}
        with pytest.raises(MalformedError, match=name):
            type(session).unpack((dict(numbers), wrong), stored, {})


def test_audits_repeat_with_shares_of_the_least_delay():
    made = scenario(information=fk.Delayed(random_delays(np.random.default_rng(5), 8, False)), t_end=0.3)
    repeats = engine_named("delayed").repeats(fk.simulate(made, progress=False))
    assert repeats is not None
    assert "steps up to 0.5 of the least delay" in repeats.how
    tau = made.information.least
    session = repeats.sessions[-1]()
    session.advance(0.3)
    times = session.history.segments
    assert max(x.t1 - x.t0 for x in times) <= 0.5 * tau * (1 + 1e-12)


def test_wrong_delays_are_refused_by_name():
    for wrong, rule in (
        ([0.1, 0.2], "one number, or a row for every agent"), ([[0.0, -0.1], [0.1, 0.0]], "must not be negative"),
        ([[0.1, 0.1], [0.1, 0.0]], "zero on the diagonal unless self_delayed"), ([[0.0, 0.1]], "square"),
        ([[0.0, math.nan], [0.1, 0.0]], "finite"),
    ):  # fmt: skip
        with pytest.raises(InvalidInput, match=f"Delayed: tau.*{rule}"):
            fk.Delayed(wrong)
    with pytest.raises(InvalidInput, match="must not be zero on the whole diagonal"):
        fk.Delayed([[0.0, 0.1], [0.1, 0.0]], self_delayed=True)
    with pytest.raises(InvalidInput, match=r"shape \(8, 8\) for 8 agents"):
        scenario(information=fk.Delayed([[0.0, 0.1], [0.1, 0.0]]))
    assert fk.Delayed(np.zeros((3, 3))).ideal
    assert chosen_engine(scenario(information=fk.Delayed(np.zeros((8, 8)))), "auto") == "exact"
    short = np.full((8, 8), 0.1) - 0.1 * np.eye(8)
    short[3, 4] = 1e-9
    with pytest.raises(InvalidInput, match="Steps are no longer than the least delay"):
        fk.start(scenario(information=fk.Delayed(short)))
    short[3, 4] = 1e11  # so long a scale of times would take separate switches for one
    with pytest.raises(InvalidInput, match=r"at most 1e\+06 times as long as the run"):
        fk.start(scenario(information=fk.Delayed(short)))


def test_no_bound_for_one_delay_is_claimed_of_several():
    """Of everybody known late by pairs, and of order 2, nothing is claimed; margins refuse to overwrite the pairs."""
    tau = np.array([[0.1, 0.2], [0.3, 0.1]])
    made = fk.Scenario(fk.Law(fk.Fixed.complete(2), [SPRING]), fk.State([[1.0, 0.0], [0.0, 0.0]]), t_end=1.0,
                       bodies=fk.SingleIntegrator(), information=fk.Delayed(tau, self_delayed=True))  # fmt: skip
    found = fk.certify(made)["delay_in_world"]
    assert not found.granted
    assert "delays that differ" in found.reason
    with pytest.raises(UnsupportedLaw, match="a delay for every pair, which it would replace"):
        quantities()["delay"].world(made, 0.1, 0.01)


def test_the_past_is_kept_as_long_as_the_largest_delay():
    """Beyond that and one step nothing is kept; a state is read as long ago as the largest delay."""
    tau = np.array([[0.0, 0.05, 0.4], [0.05, 0.0, 0.0], [0.05, 0.0, 0.0]])
    law = fk.Law(fk.Fixed.complete(3), [SPRING])
    session = fk.start(fk.Scenario(law, fk.State(np.eye(3)), t_end=2.0, information=fk.Delayed(tau)))
    session.advance(2.0)
    past, now = session.history.segments, session.history.segments[-1].t1
    assert now - 0.4 - 2 * 0.05 - 1e-9 <= past[0].t0 <= now - 0.4
    assert max(x.t1 - x.t0 for x in past) <= 0.05 * (1 + 1e-12)
