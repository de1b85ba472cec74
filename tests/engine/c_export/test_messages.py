"""Which samples an exported law keeps: those measured last, of those it is linked with and then of the nearest."""

import ctypes

import numpy as np
import pytest

import flocking as fk
from flocking.engine.c_export.message_source import LATEST
from tests.engine.c_export.building import CODES, CompiledLaw, needs_compiler
from tests.engine.c_export.test_on_this_machine import LAW, scenario_of

pytestmark = needs_compiler
REST = [0.0, 0.0]
SECOND = 10**9


def forgotten(compiled, memory, sender):
    return compiled.library.law_forget(ctypes.byref(memory), ctypes.c_uint16(sender))


def known(memory):
    return [memory.known[slot].sender for slot in memory.order[: memory.count]]


@pytest.mark.parametrize("expires", [None, 60.0])
def test_a_sender_that_begins_to_count_anew_is_heard(expires, tmp_path):
    """Its numbers begin at 0 again; what it measured later counts, and what was measured before does not."""
    information = fk.Messages(0.1, expires=expires)
    compiled = CompiledLaw(tmp_path, scenario_of(LAW, 3, information=information, control=fk.Held(0.1)))
    memory = compiled.begin(0)
    assert compiled.receive(memory, 1, [2.0, 0.0], REST, number=1000, stamp=100 * SECOND) == CODES["OK"]
    _, before = compiled.control(memory, REST, REST, 100 * SECOND)
    for number, place in enumerate((2.5, 3.0)):
        now = (101 + number) * SECOND
        assert compiled.receive(memory, 1, [place, 0.0], REST, number=number, stamp=now) == CODES["OK"]
        expected = fk.control_of(LAW, fk.Agent(REST, REST, 0), [fk.Agent([place, 0.0], REST, 1)])
        _, after = compiled.control(memory, REST, REST, now)
        assert after == pytest.approx(expected, rel=1e-12)
        assert (after != before).any()
    # Of before the restart, arrived late.
    late = compiled.receive(memory, 1, [2.0, 0.0], REST, number=1001, stamp=100 * SECOND + 1, now=103 * SECOND)
    assert late == CODES["OLD"]
    # Of one instant the higher number counts, as after a start.
    same = compiled.receive(memory, 1, [3.1, 0.0], REST, number=2, stamp=102 * SECOND, now=103 * SECOND)
    assert same == CODES["OK"]


def test_a_sender_whose_clock_was_set_back_is_old_until_it_is_forgotten(tmp_path):
    compiled = CompiledLaw(tmp_path, scenario_of(LAW, 4))
    memory, now = compiled.begin(0), 100 * SECOND
    assert compiled.receive(memory, 1, [2.0, 0.0], REST, number=9, stamp=now) == CODES["OK"]
    assert compiled.receive(memory, 2, [0.0, 2.0], REST, number=9, stamp=now) == CODES["OK"]
    compiled.control(memory, REST, REST, now)
    assert compiled.links(memory) == [1, 2]
    assert compiled.receive(memory, 1, [3.0, 0.0], REST, number=0, stamp=SECOND, now=now) == CODES["OLD"]
    assert forgotten(compiled, memory, 1) == CODES["OK"]
    assert forgotten(compiled, memory, 1) == forgotten(compiled, memory, 3) == CODES["NO_AGENT"]
    assert (known(memory), compiled.links(memory)) == ([2], [2])
    assert compiled.receive(memory, 1, [3.0, 0.0], REST, number=0, stamp=SECOND, now=now) == CODES["OK"]
    assert compiled.control(memory, REST, REST, now)[0] == CODES["OK"]
    assert compiled.links(memory) == [1, 2]


def test_times_out_of_range_have_a_code(tmp_path):
    """Differences of times never overflow: a stamp of long ago would not expire."""
    information = fk.Messages(0.1, expires=0.5)
    compiled = CompiledLaw(tmp_path, scenario_of(LAW, 3, information=information, control=fk.Held(0.1)))
    memory = compiled.begin(0)
    for stamp, now in ((-(2**63), 5), (-LATEST - 1, 5), (5, LATEST + 1), (6, 5)):
        assert compiled.receive(memory, 1, [2.0, 0.0], REST, stamp=stamp, now=now) == CODES["TIME"]
    assert compiled.receive(memory, 1, [2.0, 0.0], REST, stamp=-LATEST, now=LATEST) == CODES["OLD"]
    for now in (-(2**63), -LATEST - 1, LATEST + 1):
        assert compiled.control(memory, REST, REST, now)[0] == CODES["TIME"]
        assert compiled.start(memory, REST, now) == CODES["TIME"]
    assert compiled.control(memory, REST, REST, LATEST)[0] == CODES["OK"]
    assert known(memory) == []


@pytest.mark.parametrize("single", [False, True])
def test_a_message_that_has_expired_when_it_arrives_takes_the_place_of_none(single, tmp_path):
    information = fk.Messages(0.1, expires=0.5)
    scenario = scenario_of(LAW, 4, information=information, control=fk.Held(0.1))
    compiled = CompiledLaw(tmp_path, scenario, float32=single, neighbours=1)
    memory, now = compiled.begin(0), 10 * SECOND
    assert compiled.receive(memory, 2, [50.0, 0.0], REST, stamp=now) == CODES["OK"]
    assert compiled.control(memory, REST, REST, now)[0] == CODES["OK"]
    late = now - SECOND // 2
    assert compiled.receive(memory, 1, [2.0, 0.0], REST, stamp=late, now=now) == CODES["OLD"]
    assert (known(memory), memory.lost) == ([2], 0)
    # One nanosecond younger it is used, and takes the place of the one that is farther.
    assert compiled.receive(memory, 1, [2.0, 0.0], REST, stamp=late + 1, now=now) == CODES["ROOM"]
    assert known(memory) == [1]
    # A later sample of the same sender that has expired leaves what is known, which has too, to the next call.
    assert compiled.receive(memory, 1, [3.0, 0.0], REST, stamp=late + 2, now=now + SECOND) == CODES["OLD"]
    assert compiled.control(memory, REST, REST, now + SECOND)[0] == CODES["OK"]
    assert known(memory) == []


def test_a_start_is_not_before_the_last_call_nor_before_a_message(tmp_path):
    compiled = CompiledLaw(tmp_path, scenario_of(LAW, 3))
    memory = compiled.begin(0)
    assert compiled.receive(memory, 1, [3.8, 0.0], REST, stamp=10) == CODES["OK"]
    assert compiled.start(memory, REST, 9) == CODES["TIME"]
    assert (memory.begun, compiled.links(memory)) == (0, [])
    assert compiled.start(memory, REST, 20) == CODES["OK"]
    assert compiled.links(memory) == [1]
    assert compiled.control(memory, REST, REST, 30)[0] == CODES["OK"]
    compiled.receive(memory, 1, [3.9, 0.0], REST, number=1, stamp=31)
    before = bytes(memory)
    assert compiled.start(memory, REST, 29) == CODES["TIME"]
    assert compiled.start(memory, [float("nan"), 0.0], 40) == CODES["NOT_FINITE"]
    assert bytes(memory) == before
    assert compiled.start(memory, REST, 31) == CODES["OK"]
    assert compiled.control(memory, REST, REST, 30)[0] == CODES["TIME"]


def test_a_start_forgets_what_has_expired(tmp_path):
    information = fk.Messages(0.1, expires=0.5)
    compiled = CompiledLaw(tmp_path, scenario_of(LAW, 3, information=information, control=fk.Held(0.1)))
    memory = compiled.begin(0)
    compiled.receive(memory, 1, [2.0, 0.0], REST, stamp=0)
    compiled.receive(memory, 2, [0.0, 2.0], REST, stamp=SECOND // 2)
    assert compiled.start(memory, REST, SECOND // 2) == CODES["OK"]
    assert (known(memory), compiled.links(memory)) == ([2], [2])


def bits(memory):
    """Number of slots in use."""
    return sum(word.bit_count() for word in memory.used)


@pytest.mark.parametrize("remover", ["control", "start", "receive"])
def test_what_has_expired_takes_its_slot_and_its_links_with_it(remover, tmp_path):
    """The next sender in that slot is linked by its own distance, not because the one before was."""
    information = fk.Messages(0.1, expires=0.5)
    compiled = CompiledLaw(tmp_path, scenario_of(LAW, 4, information=information, control=fk.Held(0.1)), neighbours=2)
    memory, now = compiled.begin(0), SECOND
    for sender, place in ((1, [3.0, 0.0]), (2, [0.0, 3.0])):
        assert compiled.receive(memory, sender, place, REST, stamp=0) == CODES["OK"]
    assert compiled.control(memory, REST, REST, 0)[0] == CODES["OK"]
    assert compiled.links(memory) == [1, 2]
    if remover == "control":
        assert compiled.control(memory, REST, REST, now)[0] == CODES["OK"]
    elif remover == "start":
        assert compiled.start(memory, REST, now) == CODES["OK"]
    # Between the two distances of the hysteresis: linked only if it was before.
    assert compiled.receive(memory, 3, [3.8, 0.0], REST, stamp=now) == CODES["OK"]
    assert (known(memory), bits(memory), memory.lost) == ([3], 1, 0)
    assert compiled.control(memory, REST, REST, now)[0] == CODES["OK"]
    assert compiled.links(memory) == []


def test_slots_beyond_the_first_word_are_given_back_with_their_links(tmp_path):
    """Links are bits of words of 32: who is forgotten loses its own bit, and nobody another one."""
    n = 41
    compiled = CompiledLaw(tmp_path, scenario_of(LAW, n))
    memory = compiled.begin(0)
    angles = 2.0 * np.pi * np.arange(n) / n
    ways = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for step, distance in enumerate((3.0, 3.8)):
        for j in range(1, n - 1):
            assert compiled.receive(memory, j, distance * ways[j], REST, number=step, stamp=step) == CODES["OK"]
        assert compiled.control(memory, REST, REST, step)[0] == CODES["OK"]
        assert compiled.links(memory) == list(range(1, n - 1))
    for gone in (35, 3):
        assert forgotten(compiled, memory, gone) == CODES["OK"]
        assert compiled.links(memory) == [j for j in range(1, n - 1) if j not in {35, gone}]
    assert compiled.receive(memory, 3, 3.8 * ways[3], REST, stamp=2) == CODES["OK"]
    assert compiled.receive(memory, n - 1, 3.8 * ways[n - 1], REST, stamp=2) == CODES["OK"]
    assert bits(memory) == memory.count == n - 2
    assert compiled.control(memory, REST, REST, 2)[0] == CODES["OK"]
    assert compiled.links(memory) == [j for j in range(1, n - 1) if j not in {35, 3}]


def test_a_start_breaks_links_that_distances_do_not_give(tmp_path):
    """A second start links by distances alone: nobody stays linked because it was."""
    compiled = CompiledLaw(tmp_path, scenario_of(LAW, 4))
    memory = compiled.begin(0)
    for step, (one, two) in enumerate(((3.0, 3.0), (3.0, 4.5))):
        compiled.receive(memory, 1, [one, 0.0], REST, number=step, stamp=step)
        compiled.receive(memory, 2, [0.0, two], REST, number=step, stamp=step)
        assert compiled.start(memory, REST, step) == CODES["OK"]
        assert compiled.links(memory) == [1, 2][: 2 - step]


class Uneven(fk.Graph):
    """A graph of somebody else whose agents have radii of their own, one of them shared."""

    follows_radii, directed = True, True
    appear_radius = property(lambda self: self.near)
    break_radius = property(lambda self: self.far)

    def __init__(self, near, far):
        self.near, self.far = near, far

    def initial(self, q):
        distance = np.linalg.norm(q[None] - q[:, None], axis=2)
        return (distance < np.broadcast_to(self.break_radius, len(q))[:, None]) & ~np.eye(len(q), dtype=bool)


@pytest.mark.parametrize(
    ("appear", "break_"), [([1.0, 2.0], 3.0), (1.0, [3.0, 4.0]), ([1.0, 2.0], [3.0, 4.0]), (1.0, 3.0)], ids=str
)
def test_each_agent_has_its_own_radii_of_appearance_and_of_breaking(appear, break_, tmp_path):
    """Links appear below the first radius of who senses, and break at its second one."""
    scenario = fk.Scenario(
        fk.Law(Uneven(np.array(appear), np.array(break_)), [fk.Consensus(1.0)]),
        fk.State([[0.0], [9.0]], np.zeros((2, 1))),
        1.0,
    )
    compiled = CompiledLaw(tmp_path, scenario)
    for i in range(2):
        near, far = (float(np.broadcast_to(x, 2)[i]) for x in (appear, break_))
        memory, inside = compiled.begin(i), np.nextafter
        assert compiled.start(memory, [0.0]) == CODES["OK"]
        steps = [(near, 0), (inside(near, 0.0), 1), (inside(far, 0.0), 1), (far, 0), (inside(far, 0.0), 0)]
        for k, (distance, linked) in enumerate(steps):
            assert compiled.receive(memory, 1 - i, [distance], [1.0], number=k, stamp=k) == CODES["OK"]
            code, u = compiled.control(memory, [0.0], [0.0], k)
            assert (code, u.tolist()) == (CODES["OK"], [float(linked)])


def test_links_of_a_graph_that_never_changes_are_those_of_every_byte(tmp_path):
    """Bits of agents stand in bytes of eight: 17 agents need three of them."""
    n, agent, others = 17, 10, [1, 7, 8, 11, 15, 16]
    law = fk.Law(fk.Fixed(n, [(agent, j) for j in others]), [fk.Consensus(1.0)])
    compiled = CompiledLaw(tmp_path, scenario_of(law, n))
    p = np.random.default_rng(0).normal(size=(n, 2))
    there = {j: ([float(j), 0.0], p[j]) for j in range(n) if j != agent}
    code, u, memory = compiled.force(agent, [float(agent), 0.0], REST, there)
    assert (code, compiled.links(memory)) == (CODES["OK"], others)
    assert u == pytest.approx(p[others].sum(axis=0), rel=1e-12)


def test_what_was_scaled_back_or_filtered_is_said_of_the_last_call_alone(tmp_path):
    """A force that was too large, and then one that is not; and a neighbour in the way, and then far away."""
    for name in "limit", "filter":
        (tmp_path / name).mkdir()
    limited = CompiledLaw(tmp_path / "limit", scenario_of(LAW, 2), limit=1.0)
    control = fk.SafetyFilter(0.1, distance=0.5, acceleration=5.0)
    pull = fk.Law(fk.Proximity(9.0), [fk.Gradient(fk.Potential("r**2/2"))])
    filtered = CompiledLaw(tmp_path / "filter", scenario_of(pull, 2, control=control))
    for compiled, flag, fast in ((limited, "saturated", [9.0, 0.0]), (filtered, "filtered", [-3.0, 0.0])):
        memory = compiled.begin(0)
        for k, (near, speed) in enumerate(((1.0, fast), (2.5, REST), (1.0, fast), (None, REST))):
            if near is None:
                assert compiled.control(memory, [float("nan"), 0.0], REST, k)[0] == CODES["NOT_FINITE"]
            else:
                compiled.receive(memory, 1, [near, 0.0], speed, number=k, stamp=k)
                assert compiled.control(memory, REST, REST, k)[0] == CODES["OK"]
            assert getattr(memory, flag) == (k % 2 == 0)


def test_far_senders_starve_no_near_ones(tmp_path):
    """Two slots, seven senders: those near have the slots after one period, whoever was heard first."""
    compiled = CompiledLaw(tmp_path, scenario_of(LAW, 9), neighbours=2)
    places = np.array([[0.0, 0.0], [50.0, 0.0], [40.0, 0.0], [30.0, 0.0], [2.0, 0.0], [0.0, 3.0], [60.0, 0.0]])
    memory, codes = compiled.begin(0), []
    for k in range(3):
        for j in range(1, 7):
            codes.append(compiled.receive(memory, j, places[j], REST, number=k, stamp=k))
        code, u = compiled.control(memory, REST, REST, k)
        assert code == CODES["OK"]
    ok, full, room, = CODES["OK"], CODES["FULL"], CODES["ROOM"]  # fmt: skip
    # Before the first control nobody is nearer than another; then slots go to the nearest.
    assert codes[:6] == [ok, ok, full, full, full, full]
    assert codes[6:12] == [ok, ok, room, room, room, full]
    assert codes[12:] == [full, full, full, ok, ok, full]
    assert known(memory) == compiled.links(memory) == [4, 5]
    expected = fk.control_of(LAW, fk.Agent(REST, REST, 0), [fk.Agent(places[j], REST, j) for j in (4, 5)])
    assert u == pytest.approx(expected, rel=1e-12)
    # What the law would have seen: the four that might have been near before the first control.
    assert memory.lost == 4


def test_what_the_law_would_have_seen_is_counted(tmp_path):
    """Linked senders keep their slots, within their hysteresis too; a third neighbour has none, and is counted."""
    compiled = CompiledLaw(tmp_path, scenario_of(LAW, 9), neighbours=2)
    memory = compiled.begin(0)
    for j, place in ((1, [3.0, 0.0]), (2, [0.0, 3.0])):
        compiled.receive(memory, j, place, REST)
    compiled.control(memory, REST, REST, 0)
    compiled.receive(memory, 1, [3.9, 0.0], REST, number=1, stamp=1)
    assert compiled.receive(memory, 3, [1.0, 0.0], REST, stamp=1) == CODES["FULL"]
    assert (known(memory), memory.lost) == ([1, 2], 1)
    assert compiled.receive(memory, 4, [3.7, 0.0], REST, stamp=1) == CODES["FULL"]
    assert memory.lost == 1
    # A link that broke makes room.
    compiled.receive(memory, 1, [4.1, 0.0], REST, number=2, stamp=2)
    compiled.control(memory, REST, REST, 2)
    assert compiled.receive(memory, 3, [1.0, 0.0], REST, number=1, stamp=3) == CODES["ROOM"]
    assert (known(memory), memory.lost) == ([2, 3], 1)
    compiled.control(memory, REST, REST, 3)
    assert compiled.links(memory) == [2, 3]


def test_slots_of_a_graph_that_never_changes_go_to_its_neighbours(tmp_path):
    """A ring: those who are no neighbours take no slot of one, even before the first call and however near."""
    n = 12
    law = fk.Law(fk.Fixed(n, [(i, (i + 1) % n) for i in range(n)]), [fk.Consensus(1.0)])
    compiled = CompiledLaw(tmp_path, scenario_of(law, n), neighbours=2)
    memory, rng = compiled.begin(5), np.random.default_rng(0)
    q, p = rng.normal(size=(n, 2)), rng.normal(size=(n, 2))
    q[[4, 6]] *= 100.0
    for j in [x for x in range(n) if x != 5]:
        compiled.receive(memory, j, q[j], p[j])
    assert known(memory) == [4, 6]
    assert memory.lost == 0
    code, u = compiled.control(memory, q[5], p[5])
    assert code == CODES["OK"]
    assert u == pytest.approx(p[4] + p[6] - 2 * p[5], rel=1e-12)


def test_steering_and_filters_keep_the_nearest(tmp_path):
    """Terms see all within their radius, filters all: the nearest have the slots, and who is seen is counted."""
    steering = fk.Law(fk.Proximity(1.0), [fk.Cohesion(1.0, 5.0)])
    (tmp_path / "filter").mkdir()
    control = fk.SafetyFilter(0.1, distance=0.5, acceleration=5.0)
    for folder, scenario, lost in (
        (tmp_path, scenario_of(steering, 9, agents=fk.Impulsive(), control=fk.Held(0.1)), 1),
        (tmp_path / "filter", scenario_of(LAW, 9, control=control), 2),
    ):
        compiled = CompiledLaw(folder, scenario, neighbours=2)
        memory = compiled.begin(0)
        assert compiled.start(memory, REST) == CODES["OK"]
        for j, x, said in ((1, 20.0, "OK"), (2, 4.9, "OK"), (3, 4.8, "ROOM"), (4, 4.7, "ROOM")):
            assert compiled.receive(memory, j, [x, 0.0], REST) == CODES[said]
        assert (known(memory), memory.lost) == ([3, 4], lost)


def test_room_is_made_as_a_slow_rule_says(tmp_path):
    """Random messages against a plain dictionary of what is known, in one dimension of time and two of space."""
    compiled = CompiledLaw(tmp_path, scenario_of(LAW, 40), neighbours=5)
    memory, rng, linked, seen, rooms = compiled.begin(7), np.random.default_rng(4), set(), {}, 0
    own = np.zeros(2)
    assert compiled.start(memory, own) == CODES["OK"]

    def rank(i, x):
        distance = np.linalg.norm(x - own)
        return -1.0 if i in linked or distance < 3.5 else distance

    for k in range(1, 3000):
        j, place = int(rng.integers(40)), rng.uniform(-7.0, 7.0, 2)
        if rng.random() < 0.1:
            acts = rng.normal(size=2)
            code, _ = compiled.control(memory, acts, REST, k)
            if code == CODES["OK"]:
                own = acts
                linked = {
                    i for i, x in seen.items()
                    if np.linalg.norm(x - own) < (4.0 if i in linked else 3.5)
                }  # fmt: skip
            assert set(compiled.links(memory)) == linked
        code = compiled.receive(memory, j, place, REST, number=k, stamp=k)

        if j == 7:
            assert code == CODES["NO_AGENT"]
        elif j in seen or len(seen) < 5:
            assert code == CODES["OK"]
            seen[j] = place
        else:
            gone = max(sorted(seen), key=lambda i: rank(i, seen[i]))
            if rank(gone, seen[gone]) > rank(-1, place):
                assert code == CODES["ROOM"]
                del seen[gone]
                seen[j], rooms = place, rooms + 1
            else:
                assert code == CODES["FULL"]
        assert known(memory) == sorted(seen)
        for slot in memory.order[: memory.count]:
            assert (np.array(memory.known[slot].q[:]) == seen[memory.known[slot].sender]).all()
    assert rooms > 100
