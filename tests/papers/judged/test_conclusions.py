"""What the claims of the papers measure, on evidence of which the answer is known in closed form."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import flocking as fk
from flocking.engine.runs.run import SWITCH_FIELDS, Closest
from flocking.papers.olfati_saber_2003 import passage, system
from flocking.papers.olfati_saber_2003 import theorems as olfati
from flocking.papers.shi_2009 import theorems as shi
from flocking.papers.tanner_2003_dynamic import theorems as dynamic
from flocking.papers.tanner_2003_fixed import theorems as fixed
from flocking.papers.zhou_2015 import theorems as zhou
from flocking.study.claims import general_claims as general
from flocking.study.evidence import NotMeasurable
from tests.papers.homes.measures import evidence

T = np.linspace(0.0, 40.0, 401)
ZHOU = fk.Potential("1/r + 1/(R - r)", R=4.0)
PRICE = 1 / 3.9 + 1 / 0.1
"""psi(r - eps)."""


def zhou_law(**pull: object) -> fk.Law:
    track = fk.Track(fk.Velocity([3.0, 1.0], start=[10.0, 10.0]), **({"velocity_gain": 0.7} | pull))
    return fk.Law(fk.Hysteresis(4.0, 0.1), (fk.Gradient(ZHOU), fk.Consensus(), track))


def ledger(energy: list[float], jumped: list[float], **given: object) -> SimpleNamespace:
    trace = {"energy": np.array(energy), "jumped": np.array(jumped)}
    run = SimpleNamespace(n=given.pop("n", 3), trace=trace)
    rest = SimpleNamespace(potentials=[ZHOU])
    return evidence(run=run, law=zhou_law(), equilibrium=rest, ledger_bound=1e-6, switches_known=True, **given)


def test_the_energy_is_held_against_its_bound() -> None:
    # Of three agents one link is missing at most.
    found = zhou.energy_bounded(ledger([2.0, 9.0, 5.0], [0.0, 7.5, 7.5]))
    assert_allclose(found.margin, 2.0 + PRICE - 9.0, atol=2e-6)
    assert found.note == "largest 9, bound 12.26"
    for largest, holds in ((2.0, True), (2.1, False)):
        assert zhou.energy_bounded(ledger([2.0, largest], [0.0, 0.0], n=2)).holds is holds


@pytest.mark.parametrize("unit", [1.0, 1e-9])
def test_new_links_are_counted_and_priced(unit: float) -> None:
    psi = fk.Potential("k/r + k/(R - r)", k=unit, R=4.0)
    for created, paid, holds in ((2, 2 * PRICE, True), (2, 2 * PRICE * 1.00001, False), (1, 2 * PRICE, False),
                                 (0, 0.0, True), (0, 1e-3, False)):  # fmt: skip
        seen = ledger([1.0, 1.0], [0.0, paid * unit], links_created=created)
        seen.potential = psi
        found = zhou.new_links_cost_the_same(seen)
        assert found.holds is holds, (created, paid)
        allowed = 1e-6 * unit * max(PRICE, paid)
        assert_allclose(found.margin, allowed - unit * abs(paid - created * PRICE), rtol=1e-6, atol=1e-12 * unit)
        assert f"{created} new links" in found.note
    for created, holds in ((3, True), (4, False)):
        # Four agents that are connected lack three links at most.
        seen = ledger([1.0], [0.0], n=4, seen_created=created, links_created=created,
                      numbers=lambda kind, k=created: (k, k))  # fmt: skip
        assert zhou.new_links_bounded(seen).margin == 3.5 - created
        assert zhou.new_links_bounded(seen).holds is holds
        seen = ledger(
            [1.0],
            [0.0],
            n=4,
            seen_created=created,
            links_created=created,
            numbers=lambda kind: (3, 5),
            doubt_note=lambda kind: "in doubt",
        )
        assert zhou.new_links_bounded(seen).holds is None
        assert zhou.new_links_bounded(seen).margin == 0.5
    sampled = ledger([1.0], [0.0], n=4, seen_created=4)
    sampled.switches_known = False
    assert zhou.new_links_bounded(sampled).margin == -0.5
    assert zhou.new_links_bounded(sampled).holds is False


def test_unlinked_agents_are_held_against_the_radius_of_new_links() -> None:
    for distance, holds in ((3.9, True), (3.9 - 1e-6, False), (3.95, True)):
        seen = evidence(law=zhou_law(), closest_unlinked=Closest(distance, 1.0, (0, 1)), error_of=lambda found: 0.0)
        assert zhou.unlinked_apart(seen).holds is holds
        assert zhou.unlinked_apart(seen).note.startswith(f"closest unlinked pair {distance:.7g}"[:29])
    # Pairs come as near as the distance at which links appear, but for rounding: what holds is not read to fail.
    seen = evidence(law=zhou_law(), closest_unlinked=Closest(3.9 - 4e-13, 1.0, (0, 1)), error_of=lambda found: 0.0)
    found = zhou.unlinked_apart(seen)
    closest, threshold = (float(x) for x in re.findall(r"\d+\.?\d*", found.note))
    assert found.holds
    assert closest >= threshold


def led(q: np.ndarray, p: np.ndarray, law: fk.Law) -> SimpleNamespace:
    offsets = q - q.mean(axis=1, keepdims=True)
    return evidence(
        t=T, q=q, p=p, law=law, mean_velocity=p.mean(axis=1), diameter=2 * np.linalg.norm(offsets, axis=2).max(axis=1),
        speeds=np.linalg.norm(p, axis=2), velocity_spread=np.zeros(len(T)),
        run=SimpleNamespace(n=q.shape[1], scenario=SimpleNamespace(tolerance=1e-8)),
    )  # fmt: skip


def closed_form(gain: float, off: float = 0.0) -> SimpleNamespace:
    """Two agents of which the mean moves by (34), and its integral with an ``off`` of its last position."""
    goal, v, x = np.array([3.0, 1.0]), np.array([-1.0, 2.0]), np.array([0.5, -0.25])
    decay = np.exp(-gain * T)[:, None]
    travelled = (1 - decay) / gain if gain else T[:, None]
    p = goal + decay * v
    q = x + goal * T[:, None] + travelled * v
    q[-1] += off
    sides = np.array([[0.5, 0.0], [-0.5, 0.0]])
    return led(q[:, None] + sides, np.repeat(p[:, None], 2, axis=1), zhou_law(velocity_gain=gain))


@pytest.mark.parametrize("gain", [0.05, 0.7, 2.0, 0.0])
def test_the_place_beside_the_leader_is_the_integral_of_its_law(gain: float) -> None:
    assert zhou.leader_offset(closed_form(gain)).holds
    assert zhou.leader_offset(closed_form(gain, off=1e-2)).holds is False
    start, v = np.array([0.5, -0.25]) - 10.0, np.array([-1.0, 2.0])
    ends = float(np.linalg.norm(start + v * (1 - math.exp(-gain * 40.0)) / gain if gain else start + 40.0 * v))
    assert f"ends {ends:.3g} from" in zhou.leader_offset(closed_form(gain)).note
    assert zhou.mean_velocity_decays(closed_form(gain)).holds


def test_a_leader_is_met_or_followed() -> None:
    seen = closed_form(0.7)
    found = zhou.velocities_follow(seen)
    first, last = (math.sqrt(5.0) * math.exp(-0.7 * t) for t in (0.0, 40.0))
    assert_allclose(found.margin, 0.01 - last / first, rtol=1e-9)
    assert found.holds
    guide = seen.law.leaders[0].along(T)[0]
    for left, holds in ((0.0, True), (0.5, False)):
        # The group comes from (0.5, -0.25) and ends ``left`` of the first distance from the leader.
        place = guide + (np.array([0.5, -0.25]) - 10.0) * (left + (1 - left) * np.exp(-T))[:, None]
        meets = led(np.repeat(place[:, None], 2, axis=1), np.ones((len(T), 2, 2)), seen.law)
        assert zhou.leader_met(meets).holds is holds
        apart = math.hypot(9.5, 10.25)
        assert_allclose(zhou.leader_met(meets).margin, (0.01 - left) * apart, atol=1e-9)
    # Three agents, of which one keeps a fifth of its difference; and a group that follows from the start.
    fade = (0.2 + 0.8 * np.exp(-T))[:, None] * np.array([0.0, 3.0])
    p = np.stack([np.tile([3.0, 1.0], (len(T), 1)), np.array([3.0, 1.0]) + fade, np.tile([3.0, 2.0], (len(T), 1))], 1)
    assert_allclose(zhou.velocities_follow(led(np.zeros_like(p), p, seen.law)).margin, 0.01 - 1 / 3, atol=1e-9)
    same = np.tile([3.0, 1.0], (len(T), 2, 1))
    assert zhou.velocities_follow(led(np.zeros_like(same), same, seen.law)).margin == 0.01
    slow = led(np.zeros((len(T), 2, 2)), np.tile([[3.0, 1.0], [3.0, 2.0]], (len(T), 1, 1)), seen.law)
    assert zhou.velocities_follow(slow).holds is False


def test_closed_forms_of_one_gain_are_not_of_several() -> None:
    for pull in (np.array([1.0, 0.5]), fk.Schedule([1.0], [1.0, 0.5])):
        seen = closed_form(0.7)
        seen.law = zhou_law(velocity_gain=pull)
        for conclusion in (zhou.mean_velocity_decays, zhou.leader_offset):
            with pytest.raises(NotMeasurable, match="one velocity_gain"):
                conclusion(seen)
    with pytest.raises(NotMeasurable, match="no leader"):
        zhou.leader_met(
            led(np.zeros((len(T), 2, 2)), np.zeros((len(T), 2, 2)), fk.Law(fk.Proximity(1.0), [fk.Consensus()]))
        )


def test_speeds_relative_to_the_leader_are_bounded() -> None:
    goal = np.array([3.0, 1.0])
    for fast in (1.0, 9.0):
        seen = ledger([2.0, 2.0], [0.0, 0.0])
        seen.t, seen.p = T, goal + np.tile([[fast, 0.0], [fast, -0.0], [0.0, 0.5]], (len(T), 1, 1))
        seen.largest = lambda name, f=fast: SimpleNamespace(value=f, error=0.0, time=0.0)
        assert_allclose(zhou.relative_speeds_bounded(seen).margin, math.sqrt(2 * (2.0 + PRICE)) - fast, rtol=1e-9)


def test_agents_come_together_where_the_group_shrinks() -> None:
    for left, holds in ((0.0, True), (0.3, False)):
        seen = evidence(t=T, diameter=5.0 * (left + (1 - left) * np.exp(-T)))
        assert zhou.agents_coincide(seen).holds is holds
        assert_allclose(zhou.agents_coincide(seen).margin, 5.0 * (0.01 - left), atol=1e-9)


TANNER = fk.Potential("1/r**2 + log(r**2)")


def contact(energy: float) -> float:
    """Distance below 1 at which 1/r^2 + log r^2 is ``energy``, by bisection."""
    low, high = 1e-9, 1.0
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if 1 / middle**2 + math.log(middle**2) > energy else (low, middle)
    return low


def near(distance: float, pair: tuple[int, int], scale: float = 1.0) -> SimpleNamespace:
    found = Closest(distance, 1.0, pair)
    potential = fk.Potential("k/r**2 + k*log(r**2)", k=scale)
    law = fk.Law(fk.Proximity(2.0), (fk.Gradient(potential),))
    return evidence(
        run=SimpleNamespace(n=4, trace={"energy": np.array([12.0, 3.0]) * scale}), law=law,
        equilibrium=SimpleNamespace(potentials=[potential]), closest=found, closest_unlinked=found,
        error_of=lambda _: 0.0,
    )  # fmt: skip


def test_agents_are_held_against_the_distance_that_the_energy_forbids() -> None:
    found = fixed.unlinked_keep_distance(near(0.1, (1, 2)))
    assert_allclose(found.margin, 0.1 - contact(12.0), rtol=1e-6)
    assert "agents 1, 2" in found.note
    assert_allclose(fixed.unlinked_keep_distance(near(0.1, (1, 2), 2.5)).margin, 0.1 - contact(12.0), rtol=1e-6)
    linked = fixed.unlinked_keep_distance(near(math.inf, (-1, -1)))
    assert (linked.margin, linked.error, linked.note) == (math.inf, 0.0, "every pair is linked")
    # Of four agents six pairs share Q: five of them store the least value, 1 times the scale.
    for distance, scale in ((0.2, 1.0), (0.5, 1.0), (0.3, 2.5)):
        found = dynamic.without_collision(near(distance, (0, 3), scale))
        assert_allclose(found.margin, distance - contact(12.0 - 5.0), rtol=1e-6)


def chain(length: float, unlinked: float, *, over: float = 0.0) -> SimpleNamespace:
    """Three agents in a chain of two links, at all times, each link ``over`` its least value in the first agent."""
    each = 1 / length**2 + math.log(length**2)
    rest = SimpleNamespace(
        i=np.array([0, 1, 1, 2]), potentials=[TANNER], agent_potentials=np.array([each + over, 2 * each, each])
    )
    energy = SimpleNamespace(unlinked=unlinked)
    return evidence(
        t=T, law=fk.Law(fk.Proximity(2.0), (fk.Gradient(TANNER),)), equilibrium=rest, equilibrium_at=lambda _: rest,
        run=SimpleNamespace(n=3, scenario=SimpleNamespace(energy=energy)),
    )  # fmt: skip


def test_potentials_of_agents_count_pairs_without_a_link_where_the_paper_does() -> None:
    minimal = general.agents_at_their_minimum
    assert_allclose(minimal(chain(1.0, 0.0)).margin, 1e-3, atol=1e-9)
    assert_allclose(minimal(chain(1.0, 0.0, over=0.5)).margin, 1e-3 - 0.5 / 2, atol=1e-9)
    # U_i of the outer agents has V_R of the pair that they make, U_i at its minimum has 1 for every pair.
    outer = 0.25 + math.log(4.0)
    found = minimal(chain(1.0, outer))
    assert_allclose(found.margin, 1e-3 - (outer - 1) / (1 + outer), atol=1e-9)
    assert found.note == f"an agent's potential is {outer - 1:.3g} above its minimum"


def turning(h0: float, r0: float, *, late: float = 0.0, off: float = 0.0) -> SimpleNamespace:
    """Two agents about a centre of mass that moves by x'' = -h0 (x' - v0) - r0 (x - x0), integrated by SciPy."""
    from scipy.integrate import solve_ivp

    def rate(s: float, y: np.ndarray) -> np.ndarray:
        guide = np.array([math.sin(s), math.cos(s)])
        place = np.array([1 - math.cos(s), math.sin(s)])
        return np.concatenate([y[2:], -h0 * (y[2:] - guide) - r0 * (y[:2] - place)])

    t = T + late
    method, close = ("LSODA", 1e-11) if h0 > 10.0 else ("DOP853", 1e-12)
    y = solve_ivp(rate, (t[0], t[-1]), [0.4, -0.3, 1.0, 2.0], method, t_eval=t, rtol=close, atol=close).y.T
    y[-1] += off
    track = fk.Track(fk.Path(("sin(t)", "cos(t)")), r0, h0, per_mass=True)
    masses = np.array([0.5, 1.5])
    sides = np.array([[0.75, 0.0], [-0.25, 0.0]])
    found = evidence(
        t=t, q=y[:, None, :2] + sides, mean_velocity=y[:, 2:], masses=masses,
        law=fk.Law(fk.Proximity(4.0), (fk.Gradient(TANNER), track)),
        run=SimpleNamespace(scenario=SimpleNamespace(tolerance=1e-10, rest_frame="")),
    )  # fmt: skip
    found.p = np.repeat(y[:, None, 2:], 2, axis=1)
    return found


GAINS = [(12, 1.0, 0.0), (12, 2.0, 0.0), (12, 150.0, 0.0), (15, 1.0, 1.0), (15, 0.8, 3.0)]
"""Law, h0 and r0; a large h0 leaves an error below a hundredth of that of the start."""


@pytest.mark.parametrize(("law", "h0", "r0"), GAINS)
@pytest.mark.parametrize("late", [0.0, 3.0])
def test_the_centre_of_mass_is_held_against_the_gains_of_the_run(law: int, h0: float, r0: float, late: float) -> None:
    seen = turning(h0, r0, late=late)
    assert shi.centre_follows(law)(seen).holds
    assert shi.centre_follows(law)(turning(h0, r0, late=late, off=1e-3)).holds is False
    steady = 1 / math.hypot(r0 - 1, h0) if law == 15 else 1 / math.hypot(1, h0)
    found = shi.steady_error(law)(seen)
    assert found.holds
    assert f"closed form {steady:.6f}" in found.note
    tracked = shi.tracks_turning_leader(law)(seen)
    assert tracked.holds is False
    assert_allclose(tracked.margin, 0.01 - 1.0, atol=1e-4)


def errors(amplitude: np.ndarray, t: np.ndarray) -> SimpleNamespace:
    """Two agents of which one follows (sin t, cos t), and the other is off by an amplitude."""
    guide = np.stack([np.sin(t), np.cos(t)], axis=1)
    p = np.stack([guide, guide + amplitude[:, None] * np.array([0.6, -0.8])], axis=1)
    track = fk.Track(fk.Path(("sin(t)", "cos(t)")), velocity_gain=1.0)
    return evidence(
        t=t, p=p, velocity_spread=amplitude / 2, law=fk.Law(fk.Proximity(4.0), (track,)), mean_velocity=p.mean(axis=1),
        run=SimpleNamespace(scenario=SimpleNamespace(rest_frame="")),
    )  # fmt: skip


@pytest.mark.parametrize("late", [0.0, 3.0])
def test_errors_are_the_largest_of_the_last_period(late: float) -> None:
    t = T + late
    for before, last in ((6.2, 0.25), (6.4, 0.005)):
        # A swing before the end, within the last period of 2 pi or before it.
        amplitude = np.where(np.abs(t - t[-1] + before) < 0.01, 1.0, 0.02)
        amplitude[0] = 4.0
        for conclusion, first in ((shi.tracks_leader, 4.0), (shi.velocities_agree, 2.0)):
            found = conclusion(errors(amplitude, t))
            assert_allclose(found.margin, 0.01 - last, atol=1e-9)
            assert f"is {first * last:.1e} over the last period" in found.note
    for conclusion in (shi.tracks_leader, shi.velocities_agree):
        assert_allclose(conclusion(errors(np.zeros(len(t)), t)).margin, 0.01, atol=1e-12)
    for lasts, short in ((12.5, True), (12.6, False)):
        few = late + np.linspace(0.0, lasts, 401)
        assert ("two periods" in shi.tracks_leader(errors(np.full(401, 0.1), few)).unsettled) == short


def test_the_steady_error_is_that_of_the_last_period() -> None:
    steady = 1 / math.sqrt(2.0)
    for off in (0.0005, 0.002):
        amplitude = np.where(T[-1] - 6.4 > T, 0.3, steady + off)
        seen = errors(2 * amplitude, T)
        found = shi.steady_error(12)(seen)
        assert_allclose(found.margin, 1e-3 * steady - off, atol=1e-9)
        assert found.note == f"|v* - v0| = {steady + off:.6f}, closed form {steady:.6f}"
    few = np.linspace(0.0, 12.5, 401)
    assert "two periods" in shi.steady_error(12)(errors(np.full(401, 2 * steady), few)).unsettled


def test_other_leaders_have_no_such_closed_form() -> None:
    seen = turning(1.0, 0.0)
    conclusions = shi.centre_follows(12), shi.steady_error(12), shi.tracks_turning_leader(12)
    for leader in (fk.Path(("0.5", "0*t")), fk.Path(("sin(t)", "cos(t) + 1e-6")), fk.Velocity([1.0, 0.0, 0.0])):
        seen.law = fk.Law(seen.law.graph, (fk.Track(leader, 0.0, 1.0),))
        for conclusion in conclusions:
            with pytest.raises(NotMeasurable, match="sin t, cos t"):
                conclusion(seen)
    # Without feedback of the position the place of the leader is of no account.
    aside = fk.Path(("sin(t)", "cos(t)"), start=(5.0, 0.0))
    seen.law = fk.Law(seen.law.graph, (fk.Track(aside, 0.0, 1.0),))
    assert shi.centre_follows(12)(seen).holds
    seen.law = fk.Law(seen.law.graph, (fk.Track(aside, 1.0, 1.0),))
    with pytest.raises(NotMeasurable):
        shi.centre_follows(15)(seen)


# -- Olfati-Saber -----------------------------------------------------------------------------------------


def flock(p: list[list[float]], goal: list[float]) -> SimpleNamespace:
    velocities = np.tile(np.array(p, dtype=float), (len(T), 1, 1))
    # At first all go the other way, and so does a leader that turns round; at the end nobody does.
    velocities[:200] *= -1.0
    where = [f"where(t < 20, {-x}, {x})" for x in goal]
    law = fk.Law(system.hard_net(), (*system.alpha_terms(), fk.Track(fk.Path(where))))
    return evidence(t=T, p=velocities, law=law, state=lambda frame: fk.State(0 * velocities[frame], velocities[frame]))


def test_velocities_and_headings_are_held_against_the_leader_of_the_run() -> None:
    for goal, angle in (([10.0, 0.0], 0.0), ([0.0, 4.0], math.pi / 2), ([-2.0, -2.0], -3 * math.pi / 4)):
        speed = math.hypot(*goal)
        turned = [[speed * math.cos(angle + a), speed * math.sin(angle + a)] for a in (0.0, 0.07)]
        found = olfati.headings_agree(flock(turned, goal))
        assert_allclose(found.margin, 0.1 - 0.07, rtol=1e-9)
        assert not found.everywhere
        found = olfati.velocities_near_desired(flock(turned, goal))
        assert_allclose(found.margin, 0.1 - 2 * math.sin(0.035), rtol=1e-9)
        assert not found.everywhere
        assert olfati.velocities_near_desired(flock([[1.2 * x for x in goal]], goal)).holds is False
        assert olfati.headings_agree(flock([[-x for x in goal]], goal)).holds is False
    for conclusion in (olfati.headings_agree, olfati.velocities_near_desired):
        with pytest.raises(NotMeasurable, match="no desired direction"):
            conclusion(flock([[1.0, 0.0]], [0.0, 0.0]))


def test_the_gap_is_that_of_the_last_two_obstacles() -> None:
    scenario = system.obstacle_scenario(0, agents=3).with_(t_end=0.0, frames=1)
    run = fk.simulate(scenario, progress=False)
    assert passage.has_gap(run)
    *others, avoid = scenario.law.terms
    balls = avoid.obstacles
    leaving = fk.Ball(fk.Velocity([1.0, 0.0], start=[200.0, 50.0]), 20.0)
    placed = [fk.Ball([200.0, 55.0], 20.0), fk.Ball([200.0, 50.0], 21.0), leaving, fk.Wall([200.0, 30.0], [0.0, -1.0])]
    last = [(*balls[:-1], other) for other in placed]
    for changed in (*last, balls[:-1], (*balls, fk.Ball([0.0, 0.0], 1.0)), balls[-1:]):
        law = fk.Law(scenario.law.graph, (*others, replace(avoid, obstacles=changed)))
        other = scenario.with_(law=law, t_end=0.1, frames=2)
        seen = SimpleNamespace(run=fk.simulate(other, progress=False))
        assert not passage.has_gap(seen.run)
        with pytest.raises(NotMeasurable, match="obstacles"):
            olfati.squeezes(seen)


def test_the_centre_is_held_against_the_sink_of_the_run() -> None:
    for sink in ([0.0, 0.0], [30.0, 5.0]):
        law = fk.Law(system.hard_net(), (fk.Track(fk.Sink(sink), 1.0, 5.0),))
        for left, holds in ((0.0, True), (0.05, False)):
            away = (left + (1 - left) * np.exp(-T))[:, None, None] * np.array([[60.0, 0.0], [40.0, 0.0]])
            seen = evidence(t=T, q=np.array(sink) + away, law=law)
            found = olfati.centred(seen)
            assert found.holds is holds
            # The farthest agent begins 60 away.
            assert_allclose(found.margin, 0.6 - 50.0 * (left + (1 - left) * math.exp(-40.0)), atol=1e-9)


def lattice(q: list[list[float]], links: list[tuple[int, int]], d: float = 7.0) -> SimpleNamespace:
    matrix = np.zeros((len(q), len(q)), dtype=bool)
    for i, j in links:
        matrix[i, j] = matrix[j, i] = True
    places = np.tile(np.array(q, dtype=float), (len(T), 1, 1))
    # At first all agents are in a line, where links cross nothing and hold nothing.
    places[:3] = np.stack([np.arange(len(q)) * 7.0, np.zeros(len(q))], axis=1)
    gradient = fk.Gradient(fk.structural_potential(d))
    law = fk.Law(fk.Proximity(1.2 * d, closed=True), (gradient, fk.Consensus()))
    return evidence(
        t=T, q=places, p=np.zeros_like(places), law=law, end_links=matrix, links_at=lambda _: matrix,
        frame_links=[matrix] * len(T), displacement=lambda x: x, state=lambda _: fk.State(places[-1], links=matrix),
    )  # fmt: skip


def test_a_realization_has_the_length_of_the_runs_potential() -> None:
    for d in (7.0, 3.0):
        for length, holds in ((d, True), (1.01 * d, False)):
            found = olfati.realizes(lattice([[0.0, 0.0], [length, 0.0]], [(0, 1)], d))
            assert found.holds is holds
            assert_allclose(found.margin, 1e-3 - abs(length / d - 1), atol=1e-6)
        assert_allclose(olfati.link_energy(lattice([[0.0, 0.0], [d, 0.0]], [(0, 1)], d)), h0(d), rtol=1e-12)


def h0(d: float, a: float = 1.0, b: float = 5.0) -> float:
    """psi_alpha(0.2 d) of (29)."""
    c, z = abs(a - b) / (2 * math.sqrt(a * b)), 0.2 * d
    return (a + b) / 2 * (math.hypot(1, z + c) - math.hypot(1, c)) + (a - b) / 2 * z


TRIANGLE = [[0.0, 0.0], [7.0, 0.0], [3.5, 6.0]]
SQUARE = [[0.0, 0.0], [7.0, 0.0], [7.0, 7.0], [0.0, 7.0]]


def test_faces_are_counted_where_there_are_any() -> None:
    found = olfati.triangular(lattice(TRIANGLE, [(0, 1), (1, 2), (0, 2)]))
    assert (found.holds, found.note) == (True, "1.000 of the faces are triangles")
    ring = [(0, 1), (1, 2), (2, 3), (0, 3)]
    found = olfati.triangular(lattice(SQUARE, ring))
    assert (found.holds, found.note) == (False, "0.000 of the faces are triangles")
    found = olfati.triangular(lattice(SQUARE, [*ring, (0, 2), (1, 3)]))
    assert (found.holds, found.note) == (False, "links cross: there are no faces")
    assert olfati.planar(lattice(SQUARE, [*ring, (0, 2), (1, 3)])).margin == -0.5
    assert olfati.planar(lattice(SQUARE, ring)).margin == 0.5
    # A triangle on a square: half of the faces.
    found = olfati.triangular(lattice([*SQUARE, [3.5, 13.0]], [*ring, (2, 4), (3, 4)]))
    assert_allclose(found.margin, 0.5 - 0.75, atol=1e-12)
    assert found.note == "0.500 of the faces are triangles"
    with pytest.raises(NotMeasurable, match="no bounded face"):
        olfati.triangular(lattice(SQUARE, ring[:3]))


def test_rigidity_and_density_and_defect_are_those_of_the_end() -> None:
    ring = [(0, 1), (1, 2), (2, 3), (0, 3)]
    # Four bars of a square leave one flexing; a diagonal takes it.
    assert olfati.rigid(lattice(SQUARE, ring)).margin == -0.5
    assert olfati.rigid(lattice(SQUARE, [*ring, (0, 2)])).margin == 0.5
    for links, share in ((ring, 1.0), (ring[:2], 0.75), ([], 0.25)):
        assert_allclose(olfati.dense_at_end(lattice(SQUARE, links)).margin, share - 0.9, atol=1e-12)
    # Two agents 7.7 apart: mu_n = (psi + 2 w phi^2)/h_0, w = 0.01.
    c, z = 4 / (2 * math.sqrt(5.0)), 0.7
    psi = 3 * (math.hypot(1, z + c) - math.hypot(1, c)) - 2 * z
    phi = 3 * (z + c) / math.hypot(1, z + c) - 2
    found = olfati.little_defect(lattice([[0.0, 0.0], [7.7, 0.0]], [(0, 1)]))
    assert_allclose(found.margin, 0.5 - (psi + 0.02 * phi**2) / h0(7.0), rtol=1e-9)


def switching(links: list[int], jumps: list[float], extra: float = 0.0) -> SimpleNamespace:
    """Two rows of the ledger at each switching time, before and after its jump; links appear, or break if negative."""
    seen = lattice([[0.0, 0.0], [7.0, 0.0]], [(0, 1)])
    each = [(2.0 + k, "appear" if n > 0 else "break") for k, n in enumerate(links) for _ in range(abs(n))]
    seen.link_switches = np.zeros(len(each), SWITCH_FIELDS)
    for row, (time, kind) in enumerate(each):
        seen.link_switches[row]["time"], seen.link_switches[row]["kind"] = time, kind
    times = np.repeat(2.0 + np.arange(len(jumps)), 2)
    after = np.repeat(np.cumsum([0.0, *jumps]), 2)[1:-1]
    end = after[-1] if len(after) else 0.0
    seen.trace = {"time": np.array([0.0, *times, 40.0]), "jumped": np.array([0.0, *after, end + extra])}
    return seen


def test_jumps_are_h0_for_each_link() -> None:
    each = h0(7.0)
    for links, jumps, off in (
        ([1, 1, -1], [each, each, -each], 0.0),
        # Two links at one time, as in a symmetric group.
        ([2, -1, -3], [2 * each, -each, -3 * each], 0.0),
        ([], [], 0.0),
        ([1], [1.001 * each], 1e-3),
        ([1, 1], [each, 0.0], 1.0),
        ([-1], [each], 2.0),
        ([1, -1], [-each, each], 2.0),
    ):
        found = olfati.jumps_by_h0(switching(links, jumps))
        assert_allclose(found.margin, 1e-6 - off, atol=1e-12)
        assert found.note.startswith(f"{len(jumps)} jumps equal {each:.4g}")
    assert_allclose(olfati.jumps_by_h0(switching([1], [each], 0.5 * each)).margin, 1e-6 - 0.5, atol=1e-12)


def test_a_symmetric_group_jumps_by_two_links_at_once() -> None:
    """Two pairs approach at the same time, so that two links appear at once (31)."""
    q = np.array([[0.0, 0.0], [9.0, 0.0], [100.0, 0.0], [109.0, 0.0]])
    start = fk.State(q, [[0.5, 0.0], [-0.5, 0.0]] * 2)
    scenario = system.free_scenario(0, agents=4).with_(start=start, t_end=4.0, frames=41)
    found = fk.audit(fk.simulate(scenario, progress=False))["jumps"]
    assert found.verdict == "holds", found.note
