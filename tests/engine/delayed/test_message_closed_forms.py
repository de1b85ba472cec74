"""Messages under continuous control against closed forms, and in the limits of short periods."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

import flocking as fk
from tests.engine.delayed.test_messages import LAW

PULL = fk.Potential("a*r**2/2", a=0.8)
BOTH = fk.Fixed.complete(2)


@pytest.mark.parametrize("T", [0.1, 0.7, 1.5])
def test_two_agents_of_order_1_contract_by_a_known_factor(T):
    """q_i' = a (K_j - q_i) with K_j held: the distance becomes 2 exp(-a T) - 1 times as large; their mean stays."""
    start = fk.State([[0.0, 0.0], [1.0, 0.5]])
    made = fk.Scenario(fk.Law(BOTH, [fk.Gradient(PULL)]), start, t_end=4 * T, frames=5, bodies=fk.SingleIntegrator(),
                       information=fk.Messages(T), tolerance=1e-12)  # fmt: skip
    run = fk.simulate(made, progress=False)
    factor = 2.0 * math.exp(-0.8 * T) - 1.0
    assert run.q[:, 1] - run.q[:, 0] == pytest.approx(np.outer(factor ** np.arange(5), [1.0, 0.5]), abs=1e-10)
    assert run.q.mean(axis=1) == pytest.approx(np.tile([0.5, 0.25], (5, 1)), abs=1e-10)


def test_a_delay_shifts_the_times_at_which_knowledge_jumps():
    """From k T + delay on K is what was at k T: piece by piece D - d decays, D being the distance then told."""
    T, late, a = 0.5, 0.2, 0.8
    start = fk.State([[0.0, 0.0], [1.0, 0.0]])
    made = fk.Scenario(fk.Law(BOTH, [fk.Gradient(PULL)]), start, t_end=6 * T, frames=7, bodies=fk.SingleIntegrator(),
                       information=fk.Messages(T, delay=late), tolerance=1e-12)  # fmt: skip
    run = fk.simulate(made, progress=False)
    told, d, expected = 1.0, 1.0, [1.0]
    for _ in range(6):
        sent = d
        d = -told + (d + told) * math.exp(-a * late)
        told = sent
        d = -told + (d + told) * math.exp(-a * (T - late))
        expected.append(d)
    assert (run.q[:, 1] - run.q[:, 0])[:, 0] == pytest.approx(expected, abs=1e-10)


def test_predictions_of_order_1_use_the_velocity_before_the_sample():
    """d' = -a (D + s w + d) for the distance D and its rate w at the last sample; w is 0 at the start."""
    T, a = 0.5, 0.8
    start = fk.State([[0.0, 0.0], [1.0, 0.0]])
    made = fk.Scenario(fk.Law(BOTH, [fk.Gradient(PULL)]), start, t_end=5 * T, frames=6, bodies=fk.SingleIntegrator(),
                       information=fk.Messages(T, predict=True), tolerance=1e-12)  # fmt: skip
    run = fk.simulate(made, progress=False)
    d, w, expected = 1.0, 0.0, [1.0]
    for _ in range(5):
        told, rate = d, w
        fading = (2.0 * told - rate / a) * math.exp(-a * T)
        d = -(told + T * rate) + rate / a + fading
        w = -rate - a * fading
        expected.append(d)
    assert (run.q[:, 1] - run.q[:, 0])[:, 0] == pytest.approx(expected, abs=1e-10)


def braked(T, predict, t_end, delay=0.0):
    """Velocity at the end of two agents side by side that move alike, from 1."""
    law = fk.Law(BOTH, [fk.Gradient(PULL), fk.Consensus(0.6)])
    start = fk.State([[0.0, 0.0], [0.0, 1e-9]], [[1.0, 0.0], [1.0, 0.0]])
    made = fk.Scenario(law, start, t_end=t_end, frames=2, information=fk.Messages(T, predict=predict, delay=delay),
                       tolerance=1e-12)  # fmt: skip
    return float(fk.simulate(made, progress=False).p[-1, 0, 0])


@pytest.mark.slow
def test_held_neighbours_brake_a_common_velocity_and_predicted_ones_do_not():
    """x'' = -a (x - X) + b (V - x') from (X, V) at every sample: a factor a period; to first order the rate a T/2."""
    a, b = 0.8, 0.6
    for T, periods in ((0.1, 10), (0.4, 5)):
        A = np.array([[0.0, 1.0, 0.0], [-a, -b, b], [0.0, 0.0, 0.0]])
        factor = (expm(A * T) @ [0.0, 1.0, 1.0])[1]
        assert braked(T, predict=False, t_end=periods * T) == pytest.approx(factor**periods, abs=1e-10)
    rates = [-math.log(braked(T, predict=False, t_end=5 * T)) / (5 * T) for T in (0.02, 0.01)]
    assert rates[1] / (a * 0.01 / 2) == pytest.approx(1.0, abs=0.01)
    assert 2.0 * rates[1] - rates[0] == pytest.approx(0.0, abs=1e-4 * rates[0] / 0.01)
    for delay in (0.0, 0.05):
        assert braked(0.1, predict=True, t_end=1.0, delay=delay) == pytest.approx(1.0, abs=1e-11)


def test_short_periods_lead_to_the_ideal_run_at_first_order():
    """Errors halve with the period; where a link switches, how old a message is then varies from period to period."""
    for seed, switches in ((0, 0), (5, 1)):
        start = fk.start.box(4, side=3, speed=2.0, seed=seed)
        made = fk.Scenario(LAW, start, t_end=0.6, frames=2)
        ideal = fk.simulate(made, progress=False)
        assert len(ideal.switches) == switches
        periods, errors = np.array([0.02, 0.01, 0.005]), []
        for T in periods.tolist():
            run = fk.simulate(made.with_(information=fk.Messages(T)), progress=False)
            errors.append(np.abs(run.q[-1] - ideal.q[-1]).max())
        if switches:
            assert (errors / periods).max() < 0.6
        else:
            assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.02)
            assert errors[1] / errors[2] == pytest.approx(2.0, abs=0.01)


def test_held_control_of_a_short_period_leads_here_at_first_order():
    """The same messages: held forces tend to continuous ones, and both engines send and receive alike."""
    start = fk.start.box(4, side=3, speed=2.0, seed=4)
    # Messages arrive at ticks of all three periods: the rest of a period would add errors that do not halve with it.
    radio = fk.Messages(0.1, phase=[0.0, 0.02, 0.04, 0.06], delay=0.03, loss=0.2, noise=0.01, expires=0.4)
    made = fk.Scenario(LAW, start, t_end=0.6, frames=2, information=radio)
    run = fk.simulate(made, progress=False)
    errors = [
        np.abs(fk.simulate(made.with_(control=fk.Held(h)), progress=False).q[-1] - run.q[-1]).max()
        for h in (0.002, 0.001, 0.0005)
    ]
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.15)
    assert errors[1] / errors[2] == pytest.approx(2.0, abs=0.1)
    assert errors[2] < 2e-3
