"""The second computation of what agents used: it agrees with right runs, and names the entry that is wrong."""

import dataclasses
import re

import numpy as np
import pytest

import flocking as fk
from flocking.engine.archives.data_checks import MalformedError
from flocking.engine.imperfect.messages.knowledge import Knowledge
from flocking.engine.runs.message_log import MessageLog
from flocking.engine.sampled.law_in_force import SampledLaw
from flocking.engine.sampled.session import SampledSession
from flocking.engine.storage.record_checks import _check_log
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.study.departed_energy.departed import departed_causes
from tests.engine.sampled.test_independent import random_world

LATE = 60_000_000
"""Nanoseconds by which a broken receiver is ahead: more than a period, so that another sample is used."""


def ran(scenario):
    session = fk.start(scenario, "sampled")
    session.advance(scenario.t_end)
    return session.run()


def world(t_end=1.0, masses=1.0, **parts):
    """Five agents that hear from each other late, with losses, noise, rounding and ages."""
    law = fk.Law(fk.Hysteresis(2.0, 0.3), [fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=1.5)), fk.Consensus(0.8)])
    rng = np.random.default_rng(3)
    start = fk.State(rng.uniform(0, 3, (5, 2)), 2.0 * rng.normal(size=(5, 2)))
    given = {
        "control": fk.Held(np.linspace(0.04, 0.06, 5), phase=0.01, latency=0.03),
        "information": fk.Messages(
            0.05, delay=0.03, jitter=0.02, loss=fk.GilbertElliott(0.2, 0.5),
            noise=fk.OrnsteinUhlenbeck(0.02, 0.05, 0.3), resolution=0.01, expires=0.22, self_known="measured", seed=2,
        ),
    }  # fmt: skip
    return fk.Scenario(law, start, t_end=t_end, frames=6, agents=fk.Agents(masses=masses), **{**given, **parts})


@pytest.mark.parametrize("seed", [1, 4])
def test_it_agrees_with_random_worlds(seed):
    run = ran(random_world(seed)[0])
    found = fk.replay(run)
    assert found.agrees, str(found)
    assert found.acts == len(run.log.ticks) >= 20 * run.n / 2
    assert found.undecided <= found.acts / 50


def test_it_knows_damping_leaders_schedules_other_graphs_and_space_that_repeats():
    leader = fk.Velocity([1.0, 0.0])
    track = fk.Track(leader, fk.Schedule([0.5, 0.77], [1.0, 2.0, 0.5]), 0.5)
    pairs = [fk.Gradient(fk.Potential("(1 - r/R)**2", R=1.8)), fk.Consensus(1.0, over=fk.Complete())]
    law = fk.Law(fk.Proximity(1.8), [*pairs, track])
    parts = world()
    for space, information in ((fk.Open(), parts.information), (fk.Open(), fk.Instant())):
        made = fk.Scenario(
            law, parts.start, t_end=1.0, frames=4, agents=fk.Agents(np.linspace(1, 2, 5), 0.7), control=fk.Held(0.05),
            information=information, space=space,
        )  # fmt: skip
        found = fk.replay(ran(made))
        assert found.agrees, str(found)
    near = fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)])
    found = fk.replay(ran(parts.with_(law=near, space=fk.Periodic([3.0, 3.0]))))
    assert found.agrees, str(found)
    flow = fk.Law(fk.Fixed(5, [(0, 1), (1, 2), (2, 3), (3, 4)]), [fk.Gradient(fk.Potential("r**2/2"))])
    moved = fk.State(parts.start.q)
    found = fk.replay(ran(parts.with_(law=flow, start=moved, agents=fk.SingleIntegrator())))
    assert found.agrees, str(found)


def early(patch):
    """A message is used before it arrives."""
    hear = Knowledge.hear
    patch.setattr(Knowledge, "hear", lambda self, time, agents: hear(self, time + LATE, agents))


def lost(patch):
    """A lost message is used."""
    patch.setattr(Knowledge, "_lost", lambda self, messages, sender, receiver, k: np.zeros(len(k), dtype=bool))


def stale(patch):
    """A link is kept that is to break."""
    relink = Knowledge.relink

    def kept(self, known, *rules):
        before = self.links.copy()
        relink(self, known, *rules)
        self.links[:, known.agents] |= before[:, known.agents] & known.there

    patch.setattr(Knowledge, "relink", kept)


def forgotten_late(patch):
    """A sample is used beyond its age."""
    known = Knowledge.known

    def ageless(self, *given):
        found = known(self, *given)
        return dataclasses.replace(found, there=np.ones_like(found.there))

    patch.setattr(Knowledge, "known", ageless)


def noise_twice(patch):
    """Noise is added twice."""
    measure = Knowledge.measure

    def twice(self, agents, *given):
        numbers = self.taken[agents]
        measure(self, agents, *given)
        self.samples.rows[numbers % len(self.samples.rows), agents, 2:] += 0.05 * self.errors[agents, 2:]

    patch.setattr(Knowledge, "measure", twice)


def older(patch):
    """Not the newest message is used."""
    hear = Knowledge.hear
    patch.setattr(Knowledge, "hear", lambda self, time, agents: hear(self, time - LATE, agents))


def own_truth(patch):
    """An agent knows itself better than its own sample tells."""
    known = Knowledge.known

    def true(self, time, agents, q, p):
        return dataclasses.replace(known(self, time, agents, q, p), own=np.concatenate([q, p], axis=1)[agents])

    patch.setattr(Knowledge, "known", true)


def another_law(patch):
    """Forces are not those of the law."""
    forces = SampledLaw.forces
    patch.setattr(SampledLaw, "forces", lambda *given: 1.0001 * forces(*given))


def without_latency(patch):
    """Forces act at once."""
    init = SampledSession.__init__

    def at_once(self, scenario):
        init(self, scenario)
        self._latency = np.zeros_like(self._latency)

    patch.setattr(SampledSession, "__init__", at_once)


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        (early, "arrived only at|not taken yet"), (lost, "which was lost"), (stale, "no neighbour by what it knew"),
        (forgotten_late, "nothing young enough"), (noise_twice, "its force is logged as"),
        (older, "was the newest that had arrived"), (own_truth, "its force is logged as"),
        (another_law, "its force is logged as"), (without_latency, "from where the logged forces lead"),
    ],
)  # fmt: skip
def test_broken_message_layers_are_caught(monkeypatch, broken, words):
    monkeypatch.setattr(SampledSession, "in_blocks", False)
    broken(monkeypatch)
    run = ran(world())
    found = fk.replay(run)
    assert not found.agrees
    assert any(re.search(words, w.what) for w in found.wrong), str(found)
    # The energy ledger does not see any of it but another law.
    assert np.abs(run.residual).max() <= 1e-9 * max(1.0, run.turnover) + run.fidelity.ledger.size


@pytest.fixture(scope="module")
def whole():
    """A run of the declared world."""
    return ran(world())


@pytest.mark.parametrize("row", [0, 40, 111])
def test_an_entry_that_was_changed_is_named(whole, row):
    run = whole
    uses = run.log.uses.copy()
    graph, sender, number = uses[row]
    uses[row, 2] = number + 1
    found = fk.replay(dataclasses.replace(run, log=dataclasses.replace(run.log, uses=uses)))
    act = int(np.searchsorted(run.log.firsts, row, side="right")) - 1
    instant, agent, _ = run.log.ticks[act]
    assert {w.entry for w in found.wrong if w.entry is not None} == {row}
    assert found.wrong[0].agent == agent
    assert found.wrong[0].time == pytest.approx(instant * 1e-9)
    assert graph == -1 or f"of agent {sender}" in found.wrong[0].what


def test_an_entry_or_an_act_that_is_missing_is_named(whole):
    run, log = whole, whole.log
    assert fk.replay(run).agrees
    row = int(np.flatnonzero(log.ticks[:, 2] > 1)[3])
    ticks = log.ticks.copy()
    ticks[row, 2] -= 1
    uses = np.delete(log.uses, log.firsts[row] + log.ticks[row, 2] - 1, axis=0)
    found = fk.replay(dataclasses.replace(run, log=dataclasses.replace(log, ticks=ticks, uses=uses)))
    assert "nothing of it was used" in found.wrong[0].what
    assert found.wrong[0].agent == log.ticks[row, 1]
    keep = np.arange(len(log.ticks)) != row
    entries = np.repeat(keep, log.ticks[:, 2])
    short = dataclasses.replace(log, ticks=log.ticks[keep], forces=log.forces[keep], uses=log.uses[entries])
    found = fk.replay(dataclasses.replace(run, log=short))
    assert any("logged at another time" in w.what and w.agent == log.ticks[row, 1] for w in found.wrong)


def test_stored_and_resumed_runs_have_the_log(tmp_path, whole):
    stored = fk.simulate(world(), save=tmp_path / "run", progress=False, engine="sampled")
    assert fk.first_difference(fk.read_run(tmp_path / "run"), stored) is None
    assert fk.first_difference(whole, stored) is None
    assert fk.replay(fk.read_run(tmp_path / "run")).agrees
    session = fk.start(world(), "sampled")
    session.advance(0.613)
    again = session.moment()()
    again.advance(1.0)
    assert fk.first_difference(again.run(), whole) is None
    early = whole.until(0.6)
    assert fk.replay(early).agrees
    assert 0 < len(early.log.ticks) < len(whole.log.ticks)
    uses = whole.log.uses.copy()
    uses[7, 2] += 1
    other = dataclasses.replace(whole, log=dataclasses.replace(whole.log, uses=uses))
    assert "log of messages, uses" in str(fk.first_difference(whole, other))
    fk.export_run(whole, tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz") as file:
        assert (file["use"] == whole.log.uses).all()
        assert (file["tick_force"] == whole.log.forces).all()


def test_runs_without_a_log_are_refused():
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
    ideal = fk.simulate(fk.Scenario(law, world().start, t_end=0.1, frames=2), progress=False)
    with pytest.raises(InvalidInput, match="log of what agents used"):
        fk.replay(ideal)
    with pytest.raises(InvalidInput, match="must be a Run"):
        fk.replay(3)
    guarded = world(information=fk.Instant(), control=fk.SafetyFilter(0.05, distance=0.1, acceleration=10.0), t_end=0.1)
    with pytest.raises(UnsupportedLaw, match="SafetyFilter"):
        fk.replay(ran(guarded))


@pytest.mark.parametrize(
    ("part", "column", "value", "said"),
    [
        ("ticks", 0, 2**62, r"tick must not hold values above 1e\+09"),
        ("ticks", 2, 2**62, "tick must not hold values above"),
        ("uses", 2, 2**57, "use must not hold values above"),
    ],
)
def test_a_log_that_asks_for_more_than_there_can_be_is_refused_when_it_is_read(whole, part, column, value, said):
    """Read as it is, the first one asked for 687 GiB, and the sum of four of the second one wraps around to zero."""
    tables = {"tick": whole.log.ticks.copy(), "tick_force": whole.log.forces, "use": whole.log.uses.copy()}
    changed = tables[{"ticks": "tick", "uses": "use"}[part]]
    changed[-4:, column] = value
    with pytest.raises(MalformedError, match=said):
        _check_log(whole.scenario, tables, whole.scenario.t_end)
    if column == 2 and part == "ticks":
        with pytest.raises(MalformedError, match="all entries of every act"):
            MessageLog(changed[-4:], whole.log.forces[-4:], whole.log.uses[:0])


def with_acts(run, rows, repeated=None):
    """The run with some acts of its log, and an entry of one of them a second time."""
    log, ticks, uses = run.log, run.log.ticks[rows].copy(), []
    for k, row in enumerate(rows):
        first, count = log.firsts[row], log.ticks[row, 2]
        uses += [*log.uses[first : first + count], *([log.uses[first]] if row == repeated else [])]
        ticks[k, 2] += row == repeated
    return dataclasses.replace(run, log=MessageLog(ticks, log.forces[rows], np.array(uses)))


def test_acts_that_are_missing_are_named(whole):
    """Those at the end of the log too, after which no other act is at a wrong time."""
    mine = np.flatnonzero(whole.log.ticks[:, 1] == 3)
    for gone, said in ((mine[-2:], "it was to act and did not"), (mine[4:5], "its act 4 is logged at another time")):
        found = fk.replay(with_acts(whole, np.setdiff1d(np.arange(len(whole.log.ticks)), gone)))
        named = [w for w in found.wrong if w.agent == 3 and w.what.startswith(said)]
        assert [round(w.time, 9) for w in named] == [round(1e-9 * int(whole.log.ticks[gone[0], 0]), 9)]


def test_two_entries_of_one_sender_are_named(whole):
    row = int(np.flatnonzero(whole.log.ticks[:, 2] > 1)[5])
    found = fk.replay(with_acts(whole, np.arange(len(whole.log.ticks)), row))
    assert [w.what for w in found.wrong] == ["two of its entries are of one sender under one graph"]
    assert found.wrong[0].agent == whole.log.ticks[row, 1]


def test_a_sample_that_nobody_took_is_named_before_it_is_sought(whole):
    uses = whole.log.uses.copy()
    uses[40:, 2] = 10**9
    run = dataclasses.replace(whole, log=dataclasses.replace(whole.log, uses=uses))
    assert not fk.replay(run).agrees
    with pytest.raises(InvalidInput, match=r"log must name samples that agent \d took; got 1000000000"):
        departed_causes(run)


@pytest.mark.parametrize("size", [1e150, 1e308])
def test_forces_that_cannot_be_computed_with_are_refused_or_agree_with_nothing(whole, size):
    forces = whole.log.forces.copy()
    forces[15] = size
    run = dataclasses.replace(whole, log=dataclasses.replace(whole.log, forces=forces))
    try:
        agrees = fk.replay(run).agrees
    except InvalidInput:
        agrees = False
    assert not agrees


@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_refused_by_name(whole, number):
    forces = whole.log.forces.copy()
    forces[15, 0] = number
    with pytest.raises(InvalidInput, match="run must have finite logged forces"):
        fk.replay(dataclasses.replace(whole, log=dataclasses.replace(whole.log, forces=forces)))
    q = whole.q.copy()
    q[3, 2, 1] = number
    with pytest.raises(InvalidInput, match="run must have finite positions"):
        fk.replay(dataclasses.replace(whole, q=q))


@pytest.mark.parametrize("size", [1.0, 1e-9, 1e9])
def test_logs_in_any_unit_of_length_are_judged(size):
    """Forces, frames and neighbours that are wrong by a fifth of themselves are, whatever they are measured in."""
    law = fk.Law(fk.Proximity(2.5 * size), [fk.Gradient(fk.Potential("(r - L)**2/2", L=size)), fk.Consensus(1.0)])
    rng = np.random.default_rng(0)
    start = fk.State(rng.uniform(0, 3, (5, 2)) * size, rng.normal(size=(5, 2)) * size)
    information = fk.Messages(0.1, delay=0.05, loss=0.2)
    made = fk.Scenario(law, start, t_end=1.0, frames=6, control=fk.Held(0.1), information=information)
    run = fk.simulate(made, progress=False)
    log, found = run.log, fk.replay(run)
    assert found.agrees
    assert not found.undecided
    forces, q, ticks = log.forces.copy(), run.q.copy(), log.ticks.copy()
    forces[20] *= 1.2
    q[4, 0] *= 1.2
    row = int(np.flatnonzero(ticks[:, 2] > 1)[10])
    ticks[row, 2] -= 1
    left_out = {"ticks": ticks, "uses": np.delete(log.uses, int(log.firsts[row]), axis=0)}
    changes = {"log": dataclasses.replace(log, forces=forces)}, {"q": q}, {"log": dataclasses.replace(log, **left_out)}
    for changed in changes:
        assert not fk.replay(dataclasses.replace(run, **changed)).agrees


@pytest.mark.parametrize("control", [fk.Held(0.1), fk.Continuous()])
@pytest.mark.parametrize("known", ["true", "measured"])
def test_agents_of_order_1_are_sent_at_rest_at_the_start(control, known):
    """Two that attract each other believe the other one at its first place until 0.3, whatever velocities are given."""
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("r**2/2"))])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 5.0], [0.0, 0.0]])
    information = fk.Messages(0.1, delay=0.3, predict=True, self_known=known)
    made = fk.Scenario(
        law, start, 1.0, frames=11, bodies=fk.SingleIntegrator(), control=control, information=information
    )
    run = fk.simulate(made, progress=False)
    assert not run.q[..., 1].any()
    found = fk.replay(run)
    assert found.agrees, found
    shares = fk.departed_causes(run).causes
    assert sum(x[-1] for x in shares.values()) == pytest.approx(run.trace["departed"][-1], rel=1e-6)


@pytest.mark.parametrize("known", [fk.Delayed(0.1), fk.Messages(0.1)])
def test_a_run_of_no_length_has_nothing_wrong_in_its_log(known):
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
    run = fk.simulate(fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]]), 0.0, frames=2, information=known))
    assert fk.replay(run).agrees


@pytest.mark.parametrize(
    ("part", "column", "value", "said"),
    [("ticks", 1, 99, "agents; got 99"), ("uses", 1, 99, "agents; got 99"), ("uses", 1, -3, "agents; got -3"),
     ("uses", 0, 7, "graphs; got 7"), ("uses", 0, -5, "graphs; got -5")],
)  # fmt: skip
def test_logs_of_agents_and_graphs_that_there_are_not_are_refused(whole, part, column, value, said):
    changed = getattr(whole.log, part).copy()
    changed[len(changed) // 2, column] = value
    run = dataclasses.replace(whole, log=dataclasses.replace(whole.log, **{part: changed}))
    for asked in (fk.replay, fk.departed_causes):
        with pytest.raises(InvalidInput, match=f"must have a log of its own {said}"):
            asked(run)
