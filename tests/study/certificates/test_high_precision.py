"""Enclosures against the same numbers in forty digits, from their formulas alone."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest

import flocking as fk

SQUARE = fk.Potential("a*r**2/2", a=1.3)


@pytest.fixture(autouse=True)
def forty_digits():
    with mp.workdps(40):
        yield


def encloses(bound, exact, width=1e-6):
    assert mp.mpf(bound.lo) <= exact <= mp.mpf(bound.hi)
    assert bound.hi - bound.lo <= width * abs(exact)


def length(rows, i, j):
    return mp.sqrt(sum((mp.mpf(a) - mp.mpf(b)) ** 2 for a, b in zip(rows[i], rows[j], strict=True)))


@pytest.mark.parametrize("seed", range(6))
def test_the_energy_of_two_agents(seed):
    rng = np.random.default_rng(seed)
    a, b = (float(x) for x in rng.uniform(0.1, 4, 2))
    masses, q, p = rng.uniform(0.3, 3, 2), rng.normal(size=(2, 2)), rng.normal(size=(2, 2))
    law = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("a/r + b*r**2", a=a, b=b))])
    found = fk.certify(fk.Scenario(law, fk.State(q, p), t_end=1.0, bodies=fk.PointMass(masses)))
    a, b, m = mp.mpf(a), mp.mpf(b), [mp.mpf(x) for x in masses]
    reduced = m[0] * m[1] / (m[0] + m[1])
    rest = (a / (2 * b)) ** (mp.mpf(1) / 3)
    r = length(q, 0, 1)
    whole = a / r + b * r * r + reduced * length(p, 0, 1) ** 2 / 2
    excess = whole - a / rest - b * rest**2
    places = [mp.re(x) for x in mp.polyroots([b, 0, -whole, a], maxsteps=500, extraprec=200) if mp.re(x) > 0]
    encloses(found["largest_energy"].bound, excess)
    encloses(found["closest_approach"].bound, min(places))
    encloses(found["longest_link"].bound, max(places))
    encloses(found["largest_speed"].bound, mp.sqrt(2 * excess * reduced) / min(m))


@pytest.mark.parametrize("seed", range(6))
def test_alignment_of_all_pairs(seed):
    """The rate too: that at the exact diameter, which is not known to the last digit."""
    rng = np.random.default_rng(seed)
    n, gain, exponent, scale, mass = 3, 0.9, float(rng.uniform(0.2, 0.9)), 1.4, 1.7
    q, p = rng.normal(size=(n, 2)), rng.normal(size=(n, 2)) * 0.1
    law = fk.Law(fk.Complete(), [fk.CuckerSmale(gain, exponent, scale)])
    found = fk.certify(fk.Scenario(law, fk.State(q, p), t_end=1.0, bodies=fk.PointMass(mass)))
    near, fast = (max(length(x, i, j) for i in range(n) for j in range(i)) for x in (q, p))

    def weight(r):
        return n * mp.mpf(gain) / mp.mpf(mass) / (mp.mpf(scale) ** 2 + r * r) ** mp.mpf(exponent)

    encloses(found["velocity_difference"].bound, fast)
    guess = mp.mpf(found["alignment_diameter"].bound.lo)
    far = mp.findroot(
        lambda x: mp.quad(weight, mp.linspace(near, x, 9)) - fast, (guess, guess * (1 + mp.mpf("1e-9"))), tol=1e-25
    )
    encloses(found["alignment_diameter"].bound, far)
    encloses(found["alignment_rate"].bound, weight(far))


@pytest.mark.parametrize("seed", range(4))
def test_undirected_spectra(seed):
    graph = fk.Fixed.random_connected(6, 0.6, seed)
    links = np.asarray(graph.initial(np.zeros((6, 2))), float)
    modes = sorted(mp.eigsy(mp.matrix((np.diag(links.sum(axis=1)) - links).tolist()), eigvals_only=True))[1:]
    start = fk.State(np.zeros((6, 2)), np.ones((6, 2)))
    first = fk.Scenario(fk.Law(graph, [fk.Gradient(SQUARE)]), fk.State(start.q), 1.0, bodies=fk.SingleIntegrator())
    found, a = fk.certify(first), mp.mpf(1.3)
    encloses(found["decay_rate"].bound, a * modes[0])
    encloses(found["settling_time"].bound, mp.log(50) / (a * modes[0]))
    encloses(found["delay"].bound, mp.pi / (2 * a * modes[-1]))
    encloses(found["noise_variance"].bound, sum(1 / (a * x) for x in modes) / 12)
    for d in range(1, 5):
        exact = 2 * mp.sin(mp.pi / (2 * (2 * d + 1))) / (a * modes[-1])
        encloses(found[f"control_period_delayed_{d}"].bound, exact)
    second = fk.Scenario(fk.Law(graph, [fk.Gradient(SQUARE), fk.Consensus(0.7)]), start, t_end=1.0)
    found, b = fk.certify(second), mp.mpf(0.7)
    slowest = min(-mp.re(s) for x in modes for s in mp.polyroots([1, b * x, a * x], maxsteps=200, extraprec=200))
    turns = [mp.sqrt(((x * b) ** 2 + mp.sqrt((x * b) ** 4 + 4 * (x * a) ** 2)) / 2) for x in modes]
    encloses(found["decay_rate"].bound, slowest)
    encloses(found["delay"].bound, min(mp.atan(w * b / a) / w for w in turns))
    encloses(found["control_period"].bound, min(2 * b / a, 2 / (b * modes[-1])))


@pytest.mark.parametrize("seed", range(4))
def test_directed_spectra(seed):
    rng, n, a = np.random.default_rng(seed), 5, mp.mpf(1.3)
    edges = {(k, int(rng.integers(k))) for k in range(1, n)} | {(0, 3), (2, 4)}
    laplacian = np.zeros((n, n))
    for i, j in edges:
        laplacian[i, j] -= 1.0
        laplacian[i, i] += 1.0
    modes = sorted(mp.eig(mp.matrix(laplacian.tolist()), left=False, right=False), key=abs)[1:]
    law = fk.Law(fk.Fixed(n, tuple(sorted(edges)), directed=True), [fk.Gradient(SQUARE)])
    found = fk.certify(fk.Scenario(law, fk.State(np.eye(n)[:, :2]), t_end=1.0, bodies=fk.SingleIntegrator()))
    if not found["directed_decay_rate"].granted:
        assert "dependent" in found["directed_decay_rate"].reason
        return
    angles = [mp.pi / 2 - abs(mp.arg(x)) for x in modes]
    encloses(found["directed_decay_rate"].bound, a * min(mp.re(x) for x in modes))
    encloses(found["directed_delay"].bound, min(w / (a * abs(x)) for w, x in zip(angles, modes, strict=True)))
    encloses(found["directed_period"].bound, min(2 * mp.re(x) / (a * abs(x) ** 2) for x in modes))
    late = min(2 * mp.sin(w / 3) / (a * abs(x)) for w, x in zip(angles, modes, strict=True))
    encloses(found["directed_period_delayed_1"].bound, late)


@pytest.mark.parametrize("frequency", [1.7, np.pi, 2.4735078941125264, 1.3350959781208993])
def test_errors_behind_a_leader(frequency):
    """Frequencies whose squares are rounded too: harmonics are told as such all the same."""
    track = fk.Track(fk.Path([f"sin({frequency!r}*t)", f"cos({frequency!r}*t)"]), 0.4, 0.9, per_mass=True)
    start = fk.State([[0.0, 0.0], [1.0, 1.0]], np.zeros((2, 2)))
    found = fk.certify(fk.Scenario(fk.Law(fk.Complete(), [fk.Consensus(0.3), track]), start, t_end=1.0))
    w, kappa, gamma = mp.mpf(frequency), mp.mpf(0.4), mp.mpf(0.9)
    exact = mp.sqrt(2) * w * w / mp.sqrt((kappa - w * w) ** 2 + (gamma * w) ** 2)
    encloses(found["steady_leader_error"].bound, exact)


@pytest.mark.parametrize("spare", [1e-3, 1e-5, 1e-7, 3e-8])
def test_noise_of_samples_near_the_bound_of_a_period(spare):
    """s^2/N T lambda/(2 - T lambda) of two agents: close to T lambda = 2 rounding is amplified as noise is."""
    period = round((1.0 - spare) / 1.3, 9)
    law = fk.Law(fk.Complete(), [fk.Gradient(SQUARE)])
    sent = fk.Messages(period, noise=0.3, self_known="measured")
    start, world = fk.State([[0.0], [1.0]]), {"control": fk.Held(period), "information": sent}
    made = fk.Scenario(law, start, t_end=1.0, agents=fk.SingleIntegrator(), **world)
    found = fk.certify(made)["noise_in_world"]
    assert found.granted, found.reason
    share = mp.mpf(period) * 2 * mp.mpf(1.3)
    encloses(found.bound, mp.mpf(0.3) ** 2 / 2 * share / (2 - share), width=1e-4)
