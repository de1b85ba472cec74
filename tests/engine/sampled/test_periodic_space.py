"""Space that repeats, under held control: explicit images and roots of quartics are the judge."""

from itertools import combinations, product

import numpy as np
import pytest

import flocking as fk
from flocking.errors import SimulationError
from tests.engine.sampled.test_independent import check
from tests.engine.sampled.test_sessions import same

BOX = (4.4, 5.1)
SOFT = fk.Potential("k*(1 - r/R)**2", k=3.0, R=2.0)


def images(lengths, reach):
    axes = [range(-reach, reach + 1) if np.isfinite(x) else (0,) for x in lengths]
    return [np.array([n * x if n else 0.0 for n, x in zip(cell, lengths, strict=True)]) for cell in product(*axes)]


def quartic(states, i, j, shift):
    """Coefficients of a squared distance, the highest power first."""
    d = np.array([0.5, 1.0, 1.0])[:, None] * (states[::-1, j] - states[::-1, i])
    d[2] += shift
    return sum(np.convolve(d[:, k], d[:, k]) for k in range(d.shape[1]))


def real_roots(coefficients, length):
    found = np.roots(np.trim_zeros(coefficients, "f"))
    return sorted(float(x.real) for x in found if abs(x.imag) < 1e-9 and 0.0 < x.real <= length)


def near_images(states, i, j, length, lattice, within):
    """Images of a pair that may come within a distance during a piece."""
    gap, speed, rate = states[:, j] - states[:, i]
    reach = within + np.linalg.norm(speed) * length + np.linalg.norm(rate) * length**2
    return lattice[((gap + lattice) ** 2).sum(axis=1) <= reach**2]


def true_switches(pieces, lengths, links, enter, leave, reach):
    """Every switch of true links, each image by itself, from the pieces of motion of the second implementation."""
    found, links, lattice = [], links.copy(), np.array(images(lengths, reach))
    for begin, length, states in pieces:
        for i, j in combinations(range(states.shape[1]), 2):
            events = []
            for shift in near_images(states, i, j, length, lattice, leave):
                c = quartic(states, i, j, shift)
                for level, kind in ((enter, "appear"), (leave, "break")):
                    lowered = c - np.array([0, 0, 0, 0, level**2])
                    for s in real_roots(lowered, length):
                        outwards = np.polyval(np.polyder(c), s) > 0
                        if outwards == (kind == "break"):
                            events.append((begin + s, kind))
            for t, kind in sorted(events):
                if (kind == "break") == bool(links[i, j]):
                    links[i, j] = links[j, i] = not links[i, j]
                    found.append((t, i, j, kind))
    return sorted(found)


def closest(pieces, lengths, reach):
    best, lattice = np.inf, np.array(images(lengths, reach))
    for _, length, states in pieces:
        for i, j in combinations(range(states.shape[1]), 2):
            for shift in near_images(states, i, j, length, lattice, np.sqrt(max(best, 0.0))):
                c = quartic(states, i, j, shift)
                at = [0.0, length, *real_roots(np.polyder(c), length)]
                best = min(best, *(float(np.polyval(c, s)) for s in at))
    return np.sqrt(max(best, 0.0))


@pytest.mark.parametrize("seed", range(4))
def test_random_worlds_in_a_box(seed):
    """States, links of knowledge, messages used, ledger; then every true switch and the closest approach."""
    run, plain = check(seed, fk.Periodic(BOX if seed % 3 else (BOX[0], None)))
    lengths = plain.lengths
    reach = int(np.ceil(np.abs(run.q).max() / min(BOX))) + 2
    start = np.array([[np.hypot(*plain.away(a, b)) < 2.0 for b in run.q[0]] for a in run.q[0]])
    expected = true_switches(plain.pieces, lengths, start, 2.0 - 0.3, 2.0, reach)
    found = [(float(s["time"]), int(s["i"]), int(s["j"]), str(s["kind"])) for s in run.switches]
    assert [e[1:] for e in found] == [e[1:] for e in expected]
    assert np.abs(np.array([e[0] for e in found]) - [e[0] for e in expected]).max(initial=0.0) < 1e-7
    best = min(run.closest_linked.distance, run.closest_unlinked.distance)
    assert best == pytest.approx(closest(plain.pieces, lengths, reach), abs=1e-7)


@pytest.mark.parametrize("lengths", [(6.0, 7.0), (5.0, None), (4.5, 5.5, 6.5)], ids=["both", "one axis", "three"])
def test_no_switch_is_missed_however_many_boxes_agents_cross_between_two_ticks(lengths):
    rng = np.random.default_rng(3)
    sides = [x or 5.0 for x in lengths]
    q, p = rng.random((5, len(sides))) * sides, rng.normal(size=(5, len(sides))) * 4.0
    p[0] *= 6.0
    law = fk.Law(fk.Hysteresis(2.0, 0.4), [fk.Consensus(0.0)])
    scenario = fk.Scenario(law, fk.State(q, p), 1.0, frames=2, space=fk.Periodic(lengths), control=fk.Held(2.0))
    run = fk.simulate(scenario, progress=False)
    ends = [x or np.inf for x in lengths]
    near = np.array([[np.linalg.norm(scenario.space.displacement(b - a)) < 2.0 for b in q] for a in q])
    pieces = [(0.0, 1.0, np.array([q, p, np.zeros_like(q)]))]
    expected = true_switches(pieces, ends, near, 1.6, 2.0, 9)
    assert len(expected) > 5
    assert [(int(s["i"]), int(s["j"]), str(s["kind"])) for s in run.switches] == [e[1:] for e in expected]
    assert np.abs(run.switches["time"] - [e[0] for e in expected]).max() < 1e-9
    assert ((run.switches["speed"] > 0) == (run.switches["kind"] == "break")).all()
    best = min(run.closest_linked.distance, run.closest_unlinked.distance)
    assert best == pytest.approx(closest(pieces, ends, 9), abs=1e-7)


def group(n=8, seed=1):
    rng = np.random.default_rng(seed)
    return fk.State(rng.random((n, 2)) * BOX, rng.normal(size=(n, 2)) * 2.0)


def world(start, t_end=2.0, **parts):
    law = fk.Law(fk.Hysteresis(2.0, 0.3), [fk.Gradient(SOFT), fk.Consensus(0.3)])
    information = fk.Messages(0.05, delay=0.02, loss=fk.Bernoulli(0.2, paired=True), predict=True, seed=4)
    given = {"control": fk.Held(0.05), "information": information, "space": fk.Periodic(BOX), "frames": 9, **parts}
    return fk.Scenario(law, start, t_end, **given)


def test_the_motion_is_the_same_wherever_it_begins():
    """Moved by any vector for all, and by a vector of the lattice for each agent: to rounding."""
    start = group()
    first = fk.simulate(world(start), progress=False)
    assert len(first.switches) > 10
    moves = np.random.default_rng(7).integers(-3, 4, size=(8, 2)) * np.array(BOX)
    for moved in (np.array([0.37, -51.3]), moves):
        run = fk.simulate(world(fk.State(start.q + moved, start.p)), progress=False)
        assert np.abs(run.q - moved - first.q).max() < 1e-11
        assert np.abs(run.p - first.p).max() < 1e-11
        assert run.switches[["i", "j", "kind"]].tolist() == first.switches[["i", "j", "kind"]].tolist()
        assert np.abs(run.switches["time"] - first.switches["time"]).max() < 1e-10
        assert np.abs(run.trace["energy"] - first.trace["energy"]).max() < 1e-8


def test_the_motion_is_the_same_for_observers_who_move_uniformly_where_samples_are_moved_on():
    start, wind = group(), np.array([7.0, -3.0])
    first = fk.simulate(world(start), progress=False)
    run = fk.simulate(world(fk.State(start.q, start.p + wind)), progress=False)
    assert np.abs(run.p - wind - first.p).max() < 1e-11
    assert np.abs(run.q - wind * run.t[:, None, None] - first.q).max() < 1e-11
    assert np.abs(run.switches["time"] - first.switches["time"]).max() < 1e-10


def test_momentum_is_kept_and_the_ledger_closes_without_messages():
    run = fk.simulate(world(group(), information=fk.Instant()), progress=False)
    assert np.abs(run.p.sum(axis=1) - run.p[0].sum(axis=0)).max() < 1e-12
    assert np.abs(run.residual).max() <= 1e-11 * run.turnover + run.fidelity.ledger.size


def test_ever_shorter_periods_lead_to_the_run_of_the_continuous_engine():
    start, errors = group(), []
    ideal = fk.simulate(world(start, 0.5, information=fk.Instant(), control=fk.Continuous()), progress=False)
    for period in (0.02, 0.01):
        run = fk.simulate(world(start, 0.5, information=fk.Instant(), control=fk.Held(period)), progress=False)
        errors.append(np.abs(run.q[-1] - ideal.q[-1]).max())
    assert errors[0] < 0.05
    assert 1.6 < errors[0] / errors[1] < 2.5


def test_a_session_in_a_box_goes_on_from_what_was_stored(tmp_path):
    ideal = fk.simulate(world(group()), progress=False)
    session = fk.start(world(group()))
    session.advance(0.7123)
    again = session.moment()()
    again.advance(2.0)
    assert same(again.run(), ideal)


def test_agents_that_pass_too_many_images_between_two_ticks_are_an_error_that_says_so():
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[1e7, 1e7], [0.0, 0.0]])
    with pytest.raises(SimulationError, match="images"):
        fk.simulate(world(start, control=fk.Held(1.0), information=fk.Instant()), progress=False)
