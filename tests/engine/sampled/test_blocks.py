"""The native loop over events: the bits of the loop in Python, to which it leaves what it does not know."""

import numpy as np
import pytest

import flocking as fk
from flocking.engine.imperfect.powers import FIFTEEN, SEVEN, integrate_powers, integrated, node_powers
from flocking.engine.kernels.counter_draws import drawn
from flocking.engine.sampled.blocks import block
from flocking.engine.sampled.blocks.block import EventBlocks
from flocking.engine.sampled.blocks.hearing import round_half_even
from flocking.engine.sampled.session import SampledSession
from flocking.formula.native.functions import native
from flocking.model.world.random_numbers import Purpose, uniform
from tests.engine.sampled.mutated_blocks import mutated_loop
from tests.engine.sampled.test_independent import random_world


def ended(scenario, steps=()):
    """A session that has reached the end, after advances to some times."""
    session = fk.start(scenario, "sampled")
    for t in (*steps, scenario.t_end):
        session.advance(float(t))
    return session


def same_bits(scenario, monkeypatch, steps=()):
    """A run by blocks and one without have the same records, and can be continued from the same numbers."""
    with monkeypatch.context() as patch:
        taken, take = [], EventBlocks.take
        patch.setattr(EventBlocks, "take", lambda *given: taken.append(take(*given)) or taken[-1])
        one = ended(scenario, steps)
        patch.setattr(SampledSession, "in_blocks", False)
        other = ended(scenario)
    a, b = one.run(), other.run()
    assert fk.first_difference(a, b) is None
    assert (a.trace == b.trace).all()
    for field in ("time", "i", "j", "kind", "graph", "speed", "tangential"):
        assert (a.switches[field] == b.switches[field]).all()
    (numbers, arrays), (expected, others) = one.pack(), other.pack()
    assert numbers == expected
    for name in others:
        np.testing.assert_array_equal(arrays[name], others[name], name)
    assert one.closest_pairs == other.closest_pairs
    return a, sum(x.events for x in taken)


@pytest.mark.parametrize("seed", [*range(4), *(pytest.param(k, marks=pytest.mark.slow) for k in range(4, 8))])
@pytest.mark.parametrize("kind", ["plain", "limited", "periodic", "late"])
def test_random_worlds_have_the_same_bits(monkeypatch, seed, kind):
    made, _ = random_world(
        500 + seed,
        fk.Periodic([6.0, 6.0]) if kind == "periodic" else None,
        limited=kind == "limited",
        late=kind == "late",
    )
    run, events = same_bits(made, monkeypatch, np.linspace(0.1, 1.9, 7))
    assert events >= len(np.unique(run.log.ticks[:, 0])) > 10


@pytest.mark.parametrize("kind", ["flow", "leader", "graphs", "damped", "boxed", "centre", "schedule"])
def test_other_laws_and_bodies_have_the_same_bits(monkeypatch, kind):
    made, _ = random_world(21)
    n, pairs = made.start.n, made.law.terms
    leader = fk.Velocity([1.0, 0.5], start=[1.0, 1.0])
    changes = {
        "flow": lambda: {
            "law": fk.Law(fk.Proximity(1.5), [fk.Gradient(fk.Potential("(r - 1)**2"))]),
            "agents": fk.SingleIntegrator(), "start": fk.State(made.start.q),
        },
        "leader": lambda: {
            "law": fk.Law(made.law.graph, [*pairs, fk.Track(leader, 0.3, 0.7)]),
            "energy": fk.Energy(frame="leader", leader=leader),
        },
        "graphs": lambda: {
            "law": fk.Law(fk.Proximity(1.8), [*pairs, fk.Consensus(0.4, over=fk.Fixed(n, [(0, 1), (1, 2)]))])
        },
        "damped": lambda: {"agents": fk.PointMass(np.linspace(0.5, 2.0, n), 0.7)},
        "boxed": lambda: {"agents": fk.Limited(fk.PointMass(damping=0.2), force=0.4, shape="box")},
        "centre": lambda: {"energy": fk.Energy(frame="centre of mass")},
        "schedule": lambda: {
            "law": fk.Law(made.law.graph, [*pairs, fk.Track(leader, 0.0, fk.Schedule([0.5, 0.77], [1.0, 2.0, 0.5]))])
        },
    }  # fmt: skip
    world = {"information": fk.Messages(0.07, delay=0.02, jitter=0.05, loss=0.2, predict=True, noise=0.01)}
    _, events = same_bits(made.with_(**world, **changes[kind]()), monkeypatch)
    assert events > 20


def test_a_group_that_outgrows_its_room_has_the_same_bits(monkeypatch):
    monkeypatch.setattr(block, "ROOM", 4)
    monkeypatch.setattr(block, "MOST_USES", 40)
    monkeypatch.setattr(block, "MOST_FRAMES", 2)
    made, _ = random_world(33)
    same_bits(made.with_(frames=40, information=fk.Messages(0.05, delay=1.0)), monkeypatch)


@pytest.mark.slow  # a loop that is compiled anew
def test_a_loss_that_rounding_decides_is_left_to_python(monkeypatch, tmp_path):
    """Every loss is in doubt in a copy of the loop: whatever it has begun of an event, Python goes on with."""
    made, _ = random_world(34)
    made = made.with_(information=fk.Messages(0.05, loss=fk.DistanceLoss(2.0), seed=3), control=fk.Held(0.05))
    _, events = same_bits(made, monkeypatch)
    loop = mutated_loop(tmp_path, "blocks_in_doubt", [("hearing.py", "NEAR = 1e-12", "NEAR = 1.0")])
    monkeypatch.setattr(block, "event_block", loop)
    _, fewer = same_bits(made, monkeypatch)
    assert fewer < events / 2


def test_what_the_native_loop_does_not_know_is_left_to_python():
    made, _ = random_world(35)

    def can(**parts):
        return EventBlocks.can(fk.start(made.with_(**parts), "sampled")._memory)

    assert can()
    assert not can(agents=fk.Lagged(fk.PointMass(), 0.2))
    assert not can(agents=fk.Disturbed(fk.PointMass(), 0.1, 0.05))
    assert not can(agents=fk.Unicycle(0.1))
    assert not can(control=fk.SafetyFilter(0.2, distance=0.1, acceleration=10.0))
    avoid = fk.Avoid([fk.Ball([9.0, 0.0], 1.0)], range=1.0, gamma_agents=False)
    assert not can(law=fk.Law(made.law.graph, [*made.law.terms, avoid]))

    class Own(fk.Bernoulli):
        """Of another package: nobody knows what it draws."""

    assert not can(information=fk.Messages(0.1, loss=Own(0.3)))
    session = fk.start(made.with_(information=fk.Messages(0.1)), "sampled")
    session.advance(0.5)
    assert EventBlocks.can(session._memory)
    session.replace_information(fk.Messages(0.1, loss=0.5))
    session.advance(0.8)
    assert not EventBlocks.can(session._memory)


def test_numbers_are_those_of_the_declaration():
    rng, draw, whole = np.random.default_rng(0), native(drawn), native(round_half_even)
    for _ in range(300):
        seed, i, j, k = int(rng.integers(2**62)), *map(int, rng.integers(0, 2000, 2)), int(rng.integers(2**50))
        assert draw(seed, int(Purpose.CHANNEL), i, j, k) == uniform(seed, Purpose.CHANNEL, i, j, k)
    values = [*rng.normal(size=100) * 10, 0.5, 1.5, 2.5, -0.5, -1.5, 0.49999999999999994, 2.0**52 + 1, -3e17, 0.0, -0.0]
    for x in values:
        assert whole(float(x)) == np.rint(x)
        assert np.signbit(whole(float(x))) == np.signbit(np.rint(x))


@pytest.mark.parametrize("rule", [SEVEN, FIFTEEN])
@pytest.mark.parametrize("length", [0.1, 1.5])
def test_the_native_quadrature_is_that_of_any_powers(rule, length):
    session = ended(random_world(36)[0])
    law, S = session._law.in_force(session._pairs), session._series(2.0)
    forces = np.ascontiguousarray(session.motion.acting_from(2.0))

    def powers(times):
        found = np.empty((len(times), 4))
        node_powers(law, 2.0, S, forces, times, found)
        return found

    expected, gap, size = integrated(powers, length, 1e-9, 0.0, rule)
    found = np.zeros((2, 4))
    largest = integrate_powers(law, 2.0, S, forces, length, 1e-9, 0.0, rule, found)
    assert largest == size > 0.0
    assert np.abs(expected[:3]).max() > 1e-3
    assert found[0] == pytest.approx(expected, rel=1e-13, abs=1e-13 * size)
    assert found[1] == pytest.approx(gap, rel=1e-3, abs=1e-13 * size)
