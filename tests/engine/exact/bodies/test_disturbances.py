"""Process noise: closed forms between gusts, stationary variances, and draws that depend on nothing else."""

import json

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_lyapunov
from scipy.stats import chi2

import flocking as fk
from flocking.engine.exact.session import ExactSession
from flocking.model.serial import from_data, to_data
from flocking.study.scenario_files.scenario_file import parse_scenario, scenario_to_text

N, T = 4, 0.13
PATH = np.diag(np.ones(N - 1), 1) + np.diag(np.ones(N - 1), -1)
LAPLACIAN = np.diag(PATH.sum(axis=0)) - PATH
EDGES = [(k, k + 1) for k in range(N - 1)]
ALPHA, BETA = 0.8, 0.6
SIGMA = np.array([0.1, 0.2, 0.3, 0.4])
# Along one line the force alpha r n of a spring of length zero is linear in the positions.
SPRING = fk.Gradient(fk.Potential("a*r**2/2", a=ALPHA))
START = fk.State(np.array([[0.0, 0.2], [1.0, 0.0], [2.5, 0.5], [3.0, -0.4]]), 0.1 * np.ones((N, 2)))


def system(order):
    """Matrix A of z' = A z + (0, g) for the positions, or positions and velocities, along one axis."""
    if order == 1:
        return -ALPHA * LAPLACIAN
    return np.block([[np.zeros((N, N)), np.eye(N)], [-ALPHA * LAPLACIAN, -BETA * LAPLACIAN]])


def sampled(A, inputs, period):
    """Matrices of the exact motion over one period under a constant input on the last ``inputs`` rows."""
    size = len(A)
    both = np.zeros((size + inputs, size + inputs))
    both[:size, :size], both[size - inputs : size, size:] = A, np.eye(inputs)
    found = expm(both * period)
    return found[:size, :size], found[:size, size:]


def scenario(order, t_end, sigma=SIGMA, seed=3):
    terms = [SPRING] if order == 1 else [SPRING, fk.Consensus(BETA)]
    body = fk.SingleIntegrator() if order == 1 else fk.PointMass()
    return fk.Scenario(
        fk.Law(fk.Fixed(N, EDGES), terms), START, t_end, frames=3, bodies=fk.Disturbed(body, sigma, T, seed=seed),
        tolerance=1e-11,
    )  # fmt: skip


@pytest.mark.parametrize("order", [1, 2])
def test_between_gusts_the_motion_is_the_closed_form(order):
    gusts = 12
    found = scenario(order, gusts * T)
    run = fk.simulate(found, progress=False)
    F, G = sampled(system(order), N, T)
    for axis in range(2):
        z = np.concatenate([START.q[:, axis], START.p[:, axis]][:order])
        for k in range(gusts):
            z = F @ z + G @ (SIGMA * found.agents.drawn((k + 0.5) * T, N, 2)[f"gust_{axis}"])
        expected = np.array(np.split(z, order))
        assert np.abs(run.q[-1, :, axis] - expected[0]).max() < 1e-9
        if order == 2:
            assert np.abs(run.p[-1, :, axis] - expected[1]).max() < 1e-9
    assert np.abs(run.residual).max() < 1e-9
    assert abs(run.trace["departed"][-1]) > 1e-3
    # Steps end at the gusts.
    assert np.abs(run.trace["time"][:, None] - T * np.arange(gusts + 1)).min(axis=0).max() < 1e-12


def variances(order, period, s=0.5):
    """Stationary variances of positions and velocities relative to the mean, per agent (discrete Lyapunov)."""
    A = system(order)
    F, G = sampled(A, N, period)
    mean = np.eye(N) - np.ones((N, N)) / N
    P = np.kron(np.eye(order), mean)
    F, G = P @ F, P @ G
    found = solve_discrete_lyapunov(F, G @ G.T * s**2 / period)
    return [float(np.trace(x) / N) for x in (found[:N, :N], found[N:, N:])[:order]]


def test_stationary_variances_tend_to_those_of_white_noise():
    s = 0.5
    eigenvalues = np.linalg.eigvalsh(LAPLACIAN)[1:]
    first = s**2 / (2 * N) * (1 / (ALPHA * eigenvalues)).sum()
    second = (
        s**2 / (2 * N) * (1 / (ALPHA * BETA * eigenvalues**2)).sum(), s**2 / (2 * N) * (1 / (BETA * eigenvalues)).sum()
    )  # fmt: skip
    for order, expected in ((1, (first,)), (2, second)):
        coarse, fine = (np.abs(np.array(variances(order, h)) / expected - 1) for h in (0.1, 0.05))
        assert (fine < 0.01).all()
        # The constant gusts correct them at the second order of the period.
        assert (coarse / np.maximum(fine, 1e-14) > 3.5).all()


@pytest.mark.parametrize("order", [1, 2])
def test_the_gusts_have_the_variance_that_is_declared(order):
    """Each agent and axis is a sample of its own of x' = -x + g, or x'' = -x - x' + g; a 99.99 % interval."""
    agents, period, spaced, samples, s = 300, 0.5, 24, 12, 0.7
    body = fk.Disturbed(fk.PointMass(), s, period, seed=11)
    A = np.array([[-1.0]]) if order == 1 else np.array([[0.0, 1.0], [-1.0, -1.0]])
    F, G = sampled(A, 1, period)
    z, kept = np.zeros((order, agents, 2)), []
    for k in range(spaced * samples):
        drawn = body.drawn(k * period, agents, 2)
        gust = s * np.stack([drawn["gust_0"], drawn["gust_1"]], axis=1)
        z = np.einsum("ab,bix->aix", F, z) + G[:, :, None] * gust
        if (k + 1) % spaced == 0:
            kept.append(z[0].ravel())
    expected = solve_discrete_lyapunov(F, G @ G.T * s**2 / period)[0, 0]
    values = np.concatenate(kept)
    low, high = chi2.ppf([0.5e-4, 1 - 0.5e-4], len(values)) * expected / len(values)
    assert low < (values**2).mean() < high
    assert abs(values.mean()) < 4 * np.sqrt(expected / len(values))
    assert abs(np.corrcoef(drawn["gust_0"], drawn["gust_1"])[0, 1]) < 0.25


def test_draws_are_functions_of_what_they_are_for():
    body = fk.Disturbed(fk.PointMass(), 1.0, T)
    few, many = body.drawn(7.2 * T, 2, 2), body.drawn(7.9 * T, 5, 3)
    for name, value in few.items():
        assert value.tobytes() == many[name][:2].tobytes()
    assert set(many) == {"gust_0", "gust_1", "gust_2"}
    assert (body.drawn(8 * T, 2, 2)["gust_0"] != few["gust_0"]).all()
    for k in range(2000):
        assert body.drawn_until(k * T) > k * T
        assert body.drawn_until(np.nextafter(body.drawn_until(k * T), 0)) == body.drawn_until(k * T)


def test_no_noise_departs_in_nothing():
    run = fk.simulate(scenario(2, 3 * T, sigma=0.0), progress=False)
    assert (run.trace["departed"] == 0.0).all()
    assert run.scenario.imperfections == ""
    assert scenario(2, T).imperfections == "gusts of intensity 0.4 every 0.13"


def test_a_session_goes_on_with_the_same_bits(tmp_path):
    whole = fk.simulate(scenario(2, 8 * T), progress=False, save=tmp_path / "run")
    assert fk.first_difference(whole, fk.read_run(tmp_path / "run")) is None
    for stop in (2.5 * T, 3 * T):
        session = ExactSession(scenario(2, 8 * T))
        session.advance(stop)
        other = ExactSession.resume(session.snapshot())
        other.advance(8 * T)
        assert fk.first_difference(other.run(), whole) is None


def test_a_late_start_has_the_same_gusts():
    early, late = scenario(2, 8 * T), scenario(2, 8 * T)
    moved = fk.State(START.q, START.p, 100.0)
    runs = [fk.simulate(x, progress=False) for x in (early, late.with_(start=moved, t_end=100 + 8 * T, frames=3))]
    assert np.abs(runs[0].q[-1] - runs[1].q[-1]).max() < 1e-8


def test_they_go_through_files():
    found = scenario(2, 1.0)
    again = parse_scenario(scenario_to_text(found))
    assert to_data(again) == to_data(found) == to_data(from_data(json.loads(json.dumps(to_data(found)))))


def test_where_the_noise_enters_the_chain():
    """Wind is a force at once; a noisy command passes the lag first."""
    wind = fk.Lagged(fk.Disturbed(fk.PointMass(), 1.0, T), 0.3)
    command = fk.Disturbed(fk.Lagged(fk.PointMass(), 0.3), 1.0, T)
    still = fk.State(np.array([[0.0, 0.0], [9.0, 0.0]]))
    law = fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)])
    runs = [
        fk.simulate(fk.Scenario(law, still, T, frames=[0.0, T / 2], bodies=body, tolerance=1e-11), progress=False)
        for body in (wind, command)
    ]
    gust, h = wind.body.drawn(0.0, 2, 2)["gust_0"], T / 2
    assert runs[0].p[-1, :, 0] == pytest.approx(gust * h, abs=1e-10)
    assert runs[1].p[-1, :, 0] == pytest.approx(gust * (h - 0.3 * (1 - np.exp(-h / 0.3))), abs=1e-10)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: fk.Disturbed(fk.PointMass(), -1.0, 0.1), "Disturbed: sigma must be at least 0"),
        (lambda: fk.Disturbed(fk.PointMass(), 1.0, 0.0), "Disturbed: period must be greater than 0"),
        (lambda: scenario(2, 1.0, sigma=[1.0, 2.0]), "Disturbed: sigma must have one value for each of the 4 agents"),
    ],
)
def test_wrong_values_are_refused(make, says):
    with pytest.raises(fk.InvalidInput, match=says):
        make()
