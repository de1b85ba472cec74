"""No certificate is contradicted by a run, and closed forms give the numbers that they promise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.study.certificates import comparison
from flocking.study.certificates.certificate import Certificates
from flocking.study.certificates.certify import certify
from flocking.study.certificates.comparison import compare
from flocking.study.certificates.laplacian_spectrum import laplacian_spectrum
from flocking.study.certificates.pieces import jump

SPRING = fk.Gradient(fk.Potential("r**2/2"))


def random_scenario(seed: int) -> fk.Scenario:
    """A law of known kind with random numbers, on random positions."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(2, 9)), 2 if seed < 1000 else int(rng.integers(2, 4))
    radius = float(rng.uniform(2.0, 5.0))
    q, p = rng.uniform(0, 1.2 * radius, (n, m)), rng.normal(size=(n, m)) * rng.uniform(0, 2)
    kind = rng.integers(5)
    near = fk.Potential("a/r + r**2", a=float(rng.uniform(0.1, 2)))
    pole = fk.Potential("a/r + 1/(R - r)", a=float(rng.uniform(0.1, 2)), R=radius)
    soft = fk.Potential("a*exp(-r) + r**2/4", a=float(rng.uniform(0.1, 20)))
    fixed = fk.Fixed.random_connected(n, 0.6, int(rng.integers(1000)))
    graph, potential = [
        (fixed, near), (fk.Proximity(radius), near), (fk.Hysteresis(radius, float(rng.uniform(0.05, 1.0))), pole),
        (fk.Smooth(radius, 0.4), soft), (fixed, soft),
    ][kind]  # fmt: skip
    terms = [fk.Gradient(potential)]
    first = bool(rng.random() < 0.15)
    if not first and rng.random() < 0.8:
        terms.append(fk.Consensus(float(rng.uniform(0.1, 3))))
    if not first and rng.random() < 0.4:
        leader = fk.Velocity(rng.normal(size=m), start=rng.normal(size=m))
        terms.append(fk.Track(leader, float(rng.uniform(0, 2)), float(rng.uniform(0, 2))))
    bodies = fk.SingleIntegrator() if first else fk.PointMass(rng.uniform(0.5, 2, n))
    if first:
        p = np.zeros_like(p)
    return fk.Scenario(fk.Law(graph, terms), fk.State(q, p), t_end=3.0, frames=31, bodies=bodies)


def contradictions(seeds: range) -> tuple[list[tuple[int, object]], dict[str, list[float]], int]:
    """Promises that runs broke, tightness by key, and number of certificates held against a run."""
    broken, tightness, count = [], {}, 0
    for seed in seeds:
        try:
            scenario = random_scenario(seed)
            found = certify(scenario)
            run = fk.simulate(scenario, engine="exact", progress=False)
        except fk.SimulationError as error:
            run = error.run
        except fk.InvalidInput:
            continue
        for row in compare(found, run):
            count += 1
            tightness.setdefault(row.key, []).append(row.tightness)
            if not row.kept:
                broken.append((seed, row))
    return broken, tightness, count


def test_random_scenarios_keep_what_is_promised():
    broken, tightness, count = contradictions(range(7))
    assert not broken
    assert count >= 24
    assert set(tightness) >= {
        "largest_energy", "closest_approach", "longest_link", "group_diameter", "links_kept", "largest_speed"
    }  # fmt: skip
    # What goes beyond a bound is the error of the integration.
    assert all(max(values) <= 1.0 + 1e-6 for key, values in tightness.items() if key != "links_kept")


@pytest.mark.slow
def test_two_thousand_random_scenarios_keep_what_is_promised():
    broken, tightness, count = contradictions(range(1000, 3000))
    assert not broken
    print(f"{count} promises; median tightness", {k: round(float(np.median(v)), 3) for k, v in tightness.items()})


@pytest.mark.parametrize("key", ["largest_energy", "closest_approach", "largest_speed", "group_diameter"])
def test_a_smaller_promise_would_be_contradicted(key):
    """The comparison can fail: two agents that oscillate along a line reach their bounds."""
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("1/r + r**2"))])
    scenario = fk.Scenario(law, fk.State([[0.0, 0], [1.5, 0]], [[-0.5, 0.0], [0.5, 0.0]]), t_end=10.0, frames=4001)
    found = certify(scenario)
    run = fk.simulate(scenario, engine="exact", progress=False)
    row = next(r for r in compare(found, run) if r.key == key)
    assert row.kept
    assert row.tightness > 1 - 2e-5
    certificate = found[key]
    factor = 1.001 if certificate.side == "at least" else 0.999
    bound = replace(certificate.bound, lo=certificate.bound.lo * factor, hi=certificate.bound.hi * factor)
    wrong = Certificates("", (replace(certificate, bound=bound),))
    assert not compare(wrong, run)[0].kept


def test_two_agents_on_a_line_have_closed_bounds():
    """psi = 1/r + r^2, at rest at distance 2: they turn where 1/r + r^2 = 4.5, at 2 and at the other root."""
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("1/r + r**2"))])
    found = certify(fk.Scenario(law, fk.State([[0.0, 0], [2.0, 0]], np.zeros((2, 2))), t_end=1.0))
    # r^3 - 4.5 r + 1 = (r - 2)(r^2 + 2 r - 0.5)
    inner = np.sqrt(1.5) - 1.0
    for key, exact in (("closest_approach", inner), ("longest_link", 2.0), ("group_diameter", 2.0)):
        bound = found[key].bound
        assert bound.lo - 1e-15 <= exact <= bound.hi + 1e-15
        assert bound.hi - bound.lo < 1e-11
    # At psi'(r) = 0, r^3 = 1/2, all energy is kinetic: two unit masses share it.
    least = 0.5 ** (-1 / 3) + 0.5 ** (2 / 3)
    assert found["largest_energy"].bound.lo <= 4.5 - least + 1e-12
    assert found["largest_energy"].bound.hi == pytest.approx(4.5 - least, abs=1e-11)
    assert found["largest_speed"].bound.hi == pytest.approx(np.sqrt(4.5 - least), abs=1e-11)


@pytest.mark.parametrize("name", ["tanner-2003-fixed-complete", "tanner-2003-dynamic", "shi-2009"])
def test_potentials_of_the_papers_bound_the_closest_approach(name):
    """1/r^2 + log r^2 and the pieces of Shi: the distance at which one pair has all the energy, by a root of mpmath."""
    import mpmath

    scenario = papers(name)
    found = certify(scenario)
    energy = mpmath.mpf(found["largest_energy"].bound.hi)
    if name == "shi-2009":
        energy = energy / mpmath.mpf(0.05)
        root = (
            mpmath.findroot(
                lambda s: mpmath.log(s) + 1 / s - 1 - energy, (0.5 / energy, 2 / energy), solver="bisect", verify=False
            )
            ** 0.5
        )
    else:
        root = mpmath.findroot(lambda r: mpmath.log(r**2) + 1 / r**2 - 1 - energy, (0.05, 0.9), solver="anderson")
    bound = found["closest_approach"].bound
    assert bound.lo == pytest.approx(float(root), rel=1e-9)
    assert bound.lo <= float(root) * (1 + 1e-12)
    rows = compare(found, fk.simulate(scenario.with_(t_end=2.0, frames=21), engine="exact", progress=False))
    assert all(row.kept for row in rows)
    assert "closest_approach" in {row.key for row in rows}


def papers(name: str) -> fk.Scenario:
    from flocking.apps.scenario_names import find_scenario

    return find_scenario(name, None, None)


@pytest.mark.parametrize(
    ("formula", "found"),
    [
        ("where(r < 1, 1/r, 2 - r)", ""), ("where(r < 1, 1/r, 2.001 - r)", "continuous at 1"),
        ("where(r <= sqrt(2), r**2, 2 + where(r < 3, 0, r - 3))", ""),
        ("where(r < 2, r**2, where(r < 3, 4, 5))", "at 3"),
        ("where(r < 1, cos(pi*r), where(r < 2, -1, -r/2))", ""), ("abs(r - 1)", ""),
        ("where(r**2 < 2, r, 1)", "does not compare"), ("abs(r - 1)/(r - 1)", "at 1"), ("atan(1/(r - 2))", "near 2"),
        ("1/r + atan(tan(3*r))", "near 0.523"), ("1/(1 + (r - 1)**2) + r/sqrt(r**2 + 1e-6)", ""), ("sin(r)/r", ""),
        ("1/(2 - exp(-r)) + 1/(r - 5)", ""), ("tanh(1/(r - 4.999))", "near 4.999"), ("tan(r/10)", ""),
    ],
)  # fmt: skip
def test_jumps_of_pieces_are_found_exactly(formula, found):
    import sympy

    r = sympy.Symbol("r", positive=True)
    text = jump(fk.Potential(formula).expression(r), r, 0.0, 5.0)
    assert (found in text) if found else not text


def test_new_links_count_under_hysteresis():
    """Zhou's count: each pair without a link may add psi at the radius where links appear, and no more."""
    psi = fk.Potential("1/r + 1/(4 - r)")
    law = fk.Law(fk.Hysteresis(4.0, 0.5), [fk.Gradient(psi), fk.Consensus(1.0)])
    q = [[0.0, 0], [2.0, 0], [6.5, 0]]
    start = fk.State([[0.0, 0], [3.0, 0], [6.9, 0]], np.zeros((3, 2)))
    found = certify(fk.Scenario(law, start, t_end=1.0))
    least = 1.0  # psi(2)
    links = float(psi(3.0) - least + psi(3.9) - least)
    assert found["largest_energy"].bound.hi == pytest.approx(links + float(psi(3.5)) - least, abs=1e-9)
    assert found["links_kept"].granted
    far = fk.Scenario(law, fk.State(q, np.zeros((3, 2))), t_end=1.0)
    assert "not connected" in certify(far)["group_diameter"].reason


def test_a_link_that_can_be_stretched_to_the_radius_is_not_promised():
    law = fk.Law(fk.Hysteresis(4.0, 0.5), [fk.Gradient(fk.Potential("1/r + r**2/8")), fk.Consensus(1.0)])
    fast = fk.State([[0.0, 0], [3.0, 0]], [[-3.0, 0], [3.0, 0]])
    found = certify(fk.Scenario(law, fast, t_end=3.0))
    assert not found["links_kept"].granted
    assert "stretch a link" in found["links_kept"].reason
    run = fk.simulate(fk.Scenario(law, fast, t_end=3.0), progress=False)
    assert (run.switches["kind"] == "break").any()


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"control": fk.Held(0.1)}, "ideal information"),
        ({"space": fk.Periodic([40.0, 40.0])}, "space repeats"),
        ({"law": fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("1/r + r")), fk.Consensus([1.0, 2.0, 1.0])])},
         "differ between i and j"),
        ({"law": fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("where(r < 1, 1/r, 3 - r)"))])}, "at 1"),
        ({"law": fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("1/r + where(r**2 < 2, 0, r**2 - 2)"))])},
         "compare r with a number"),
        ({"law": fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("1/r + 1/(3 - r)"))])}, "infinite where links"),
        ({"law": fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("1/r")),
                                            fk.Track(fk.Path(["cos(t)", "t"]), 1.0, 1.0)])}, "accelerates"),
        ({"law": fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("1/r")), fk.Track(fk.Velocity([1.0, 0.0]), 1.0)]),
          "bodies": fk.PointMass(1.0, 0.5)}, "damped while the leader moves"),
        ({"law": fk.Law(fk.Fixed(3, ((0, 1), (1, 2)), directed=True), [fk.Gradient(fk.Potential("1/r"))])}, "directed"),
    ],
)  # fmt: skip
def test_what_no_theorem_covers_is_refused_by_name(change, reason):
    law = fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("1/r + r")), fk.Consensus(1.0)])
    start = fk.State([[0.0, 0], [1.0, 0], [0, 1.0]], np.zeros((3, 2)))
    base = fk.Scenario(law, start, t_end=1.0)
    assert certify(base)["closest_approach"].granted
    found = certify(base.with_(**change))
    for key in ("largest_energy", "closest_approach", "links_kept", "largest_speed", "largest_force"):
        assert found[key].outcome == "refused"
        assert reason in found[key].reason


def test_forces_stay_below_their_bound():
    for seed in range(6):
        scenario = random_scenario(seed)
        bound = certify(scenario)["largest_force"]
        if bound.granted:
            run = fk.simulate(scenario, engine="exact", progress=False)
            for k in range(0, len(run.t), 6):
                u = fk.control(scenario.law, run.state(k), agents=scenario.agents)
                assert np.linalg.norm(u, axis=1).max() <= bound.safe_bound


@pytest.mark.parametrize(
    ("velocity", "reason"),
    [
        ("where(t < 0.5, 0, 5)", "continuous at 0.5"), ("abs(t - 0.5)/(t - 0.5)", "at 0.5"),
        ("where(t < 2, 1, 3)", ""), ("where(t < 0.5, 1, 2*t)", ""),
    ],
)  # fmt: skip
def test_a_leader_whose_velocity_jumps_adds_energy(velocity, reason):
    """Its acceleration is zero at all times but one, and no agent knows of that one."""
    leader = fk.Path([velocity, "0"])
    law = fk.Law(fk.Fixed.complete(2), [SPRING, fk.Track(leader, 0.0, 1.0, 1.0)])
    found = certify(fk.Scenario(law, fk.State([[0.0, 0], [1, 0]]), t_end=1.0))["largest_energy"]
    assert found.granted != bool(reason)
    assert reason in found.reason


@pytest.mark.slow
def test_limits_that_never_act_leave_every_guarantee():
    """Two agents on a spring: the force is largest at rest, 2, and so is the bound; speeds are at most sqrt(2)."""
    law = fk.Law(fk.Fixed.complete(2), [SPRING])
    free = fk.Scenario(law, fk.State([[0.0, 0], [2.0, 0]], np.zeros((2, 2))), t_end=6.0, frames=61)
    ideal = fk.simulate(free, engine="exact", progress=False)
    for limits, granted in (
        ({"force": 2.001}, True), ({"force": 1.95}, False), ({"speed": 1.4143}, True), ({"speed": 1.4}, False),
        ({"force": [2.1, 2.2], "speed": 1.5}, True), ({"force": [2.1, 1.9]}, False),
    ):  # fmt: skip
        found = certify(free.with_(bodies=fk.Limited(fk.PointMass(), **limits)))
        assert found["limit_never_acts"].granted == granted
        assert found["largest_speed"].granted == granted
        run = fk.simulate(free.with_(bodies=fk.Limited(fk.PointMass(), **limits)), engine="exact", progress=False)
        gap = np.abs(run.q - ideal.q).max()
        assert gap < 1e-7 if granted else gap > 1e-5
        assert all(row.kept for row in compare(found, run))
    found = certify(free)["limit_never_acts"]
    assert found.outcome == "not applicable"
    moving = free.with_(start=fk.State([[0.0, 0], [2.0, 0]], np.ones((2, 2))))
    reason = certify(moving.with_(bodies=fk.Limited(fk.PointMass(), speed=1.5)))["limit_never_acts"].reason
    assert "which may act" in reason
    lagged = certify(free.with_(bodies=fk.Limited(fk.Lagged(fk.PointMass(), 0.1), rate=2.0)))
    assert not lagged["limit_never_acts"].granted


def test_what_a_largest_force_can_do():
    """m v^2/(2 F) to stop; two agents that close in at w over g avoid contact if and only if w^2 <= 2 (a_i + a_j) g."""
    law = fk.Law(fk.Complete(), [SPRING])
    for speed, enough in ((1.0, True), (1.999, True), (2.001, False), (-3.0, True)):
        start = fk.State([[0.0, 0], [1.0, 0]], [[speed, 0], [0, 0]])
        bodies = fk.Limited(fk.PointMass([1.0, 2.0]), force=[1.0, 2.0])
        found = fk.certify(fk.Scenario(law, start, t_end=1.0, bodies=bodies))
        assert found["stopping_distance"].bound.hi == pytest.approx(speed**2 / 2)
        assert found["braking_suffices"].granted == enough
        if speed > 0:
            share = found["braking_suffices"].bound
            assert share is None or share.hi == pytest.approx(speed**2 / 4)
    still = fk.Scenario(law, fk.State([[0.0, 0], [0.0, 0]]), t_end=1.0, bodies=fk.Limited(fk.PointMass(), force=1.0))
    assert not fk.certify(still)["braking_suffices"].granted
    assert fk.certify(still.with_(bodies=fk.PointMass()))["stopping_distance"].outcome == "not applicable"


@pytest.mark.parametrize("n", [2, 7, 40])
def test_spectra_are_enclosed(n):
    """A path has 2 - 2 cos(pi k/N), a complete graph N."""
    path = fk.Fixed(n, tuple((k, k + 1) for k in range(n - 1)))
    found = laplacian_spectrum(path.initial(np.zeros((n, 2))))
    exact = 2 - 2 * np.cos(np.pi * np.arange(n) / n)
    assert (found.lo <= exact + 1e-15).all()
    assert (exact <= found.hi + 1e-15).all()
    assert (found.hi - found.lo).max() < 1e-11
    complete = laplacian_spectrum(fk.Fixed.complete(n).initial(np.zeros((n, 2))))
    assert (complete.lo[1:] <= n).all()
    assert (complete.hi[1:] >= n).all()


def consensus(graph: fk.Fixed, alpha: float, beta: float | None) -> Certificates:
    n = graph.n
    rng = np.random.default_rng(0)
    terms = [fk.Gradient(fk.Potential("a*r**2/2", a=alpha))] if alpha else []
    if beta is not None:
        terms.append(fk.Consensus(beta))
    bodies = fk.SingleIntegrator() if beta is None else fk.PointMass()
    start = fk.State(rng.normal(size=(n, 2)), np.zeros((n, 2)))
    return certify(fk.Scenario(fk.Law(graph, terms), start, t_end=1.0, bodies=bodies))


@pytest.mark.parametrize(
    ("graph", "alpha", "beta", "delay"),
    [
        (fk.Fixed.complete(4), 1.0, 1.0, 0.323705), (fk.Fixed.complete(2), 1.0, 0.3, 0.282350),
        (fk.Fixed.complete(7), 0.5, 2.0, 0.110907),
    ],
)  # fmt: skip
def test_delays_of_second_order(graph, alpha, beta, delay):
    found = consensus(graph, alpha, beta)
    assert found["delay"].bound.lo == pytest.approx(delay, abs=6e-7)
    assert found["neighbour_delay"].outcome == "refused"
    largest = graph.n
    assert found["control_period"].bound.hi == pytest.approx(min(2 * beta / alpha, 2 / (beta * largest)), rel=1e-12)
    roots = np.roots([1.0, beta * largest, alpha * largest])
    assert found["decay_rate"].bound.hi >= -roots.real.max() - 1e-7
    assert found["decay_rate"].bound.lo <= -roots.real.max() + 1e-7


def test_delays_and_periods_of_first_order():
    found = consensus(fk.Fixed.complete(5), 2.0, None)
    assert found["delay"].bound.hi == pytest.approx(np.pi / 20)
    assert found["neighbour_delay"].granted
    for d in range(1, 5):
        bound = found[f"control_period_delayed_{d}"].bound
        exact = 2 * np.sin(np.pi / (2 * (2 * d + 1))) / 10
        assert bound.lo <= exact <= bound.hi
        assert bound.hi - bound.lo < 1e-13
    assert found["settling_time"].bound.hi == pytest.approx(np.log(50) / 10)
    assert found["noise_variance"].bound.hi == pytest.approx(4 / (10 * 2 * 5))


def test_sampled_runs_end_on_the_promised_side_of_the_period():
    """K_4 under held control: the disagreement falls below the bound and grows above it."""
    graph = fk.Fixed.complete(4)
    law = fk.Law(graph, [SPRING])
    start = fk.State(np.random.default_rng(3).normal(size=(4, 2)), np.zeros((4, 2)))
    scenario = fk.Scenario(law, start, t_end=60.0, frames=2, bodies=fk.SingleIntegrator())
    bound = certify(scenario)["control_period"].bound
    for factor, stable in ((0.97, True), (1.03, False)):
        run = fk.simulate(scenario.with_(control=fk.Held(round(bound.lo * factor, 9))), progress=False)
        spread = [np.ptp(q, axis=0).max() for q in run.q]
        assert (spread[-1] < 0.1 * spread[0]) == stable


def test_errors_and_texts():
    with pytest.raises(fk.InvalidInput, match="must be a Scenario"):
        certify(SPRING)
    found = consensus(fk.Fixed.complete(3), 1.0, 1.0)
    with pytest.raises(KeyError, match="no certificate"):
        found["nonsense"]
    assert len(found) == len(found.all) == len(found.as_dict()["certificates"])
    assert "delay: granted" in str(found)


def test_the_error_of_an_energy_with_an_infinite_force_is_not_known(monkeypatch):
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("r**2/2"))])
    run = fk.simulate(fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]]), t_end=1), progress=False)
    frames = np.arange(len(run.t))
    assert 0 < comparison._energy_error(run, frames) < 1e-6
    monkeypatch.setattr(comparison, "control", lambda law, state, agents: np.full_like(state.q, np.inf))
    assert np.isnan(comparison._energy_error(run, frames))
