"""Runs whose law or state was replaced while they went on: they state it, also when they are stored."""

from __future__ import annotations

import pytest

import flocking as fk
from flocking.apps.cli import main
from flocking.engine.protocol.session import Stored
from flocking.engine.storage.stored_runs import read_run, write_run

WEAK, STRONG = (fk.Law(fk.Complete(), [fk.Consensus(gain)]) for gain in (1e-9, 1.0))
START = fk.State([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[1.0, 0.0], [0.0, 0.0], [0.0, -1.0]])
ENGINES = {
    "exact": {},
    "tiles": {},
    "sampled": {"control": fk.Held(0.05)},
    "delayed": {"information": fk.Delayed(0.02)},
}


def replaced(engine: str, *, law: bool = False, state: bool = False) -> fk.Run:
    """Until 3.9 of 4 under a weak law; then under a strong one, or from another state."""
    session = fk.start(fk.Scenario(WEAK, START, t_end=4.0, frames=41, **ENGINES[engine]), engine)
    session.advance(3.9)
    if law or state:
        session.replace(law=STRONG if law else None, state=session.state if state else None)
    session.advance(4.0)
    return session.run()


@pytest.mark.parametrize("engine", ENGINES)
def test_a_run_states_that_it_was_changed(engine, tmp_path):
    assert not replaced(engine).fidelity.changed
    for what in ("law",) if engine == "sampled" else ("law", "state"):
        run = replaced(engine, **{what: True})
        assert run.fidelity.changed
        # An engine of fixed steps stops just beyond the time.
        assert run.provenance["changed at"] == [pytest.approx(3.9, abs=0.1)]
        assert read_run(write_run(run, tmp_path / what)).fidelity.changed


@pytest.mark.parametrize("engine", ["exact", "sampled"])
def test_nothing_is_guaranteed_of_a_run_of_two_laws(engine, tmp_path, capsys):
    """The certificates of the law of the last tenth of a second are none of the motion before."""
    for name, changed in (("one", False), ("two", True)):
        write_run(replaced(engine, law=changed), tmp_path / name)
        main(["audit", str(tmp_path / name), "--html", str(tmp_path / f"{name}.html")])
        printed = " ".join(capsys.readouterr().out.split())
        page = (tmp_path / f"{name}.html").read_text()
        for text in (printed, page):
            assert ("Nothing is guaranteed of this run" in text) is changed
        assert not changed or ", guaranteed" not in printed


@pytest.mark.parametrize("engine", ["exact", "tiles"])
def test_a_session_that_goes_on_from_a_snapshot_knows_what_was_replaced(engine):
    session = fk.start(fk.Scenario(WEAK, START, t_end=4.0, frames=41), engine)
    session.advance(1.0)
    before = session.snapshot()
    session.replace(law=STRONG)
    after = session.snapshot()
    assert not type(session).resume(before).run().fidelity.changed
    assert type(session).resume(after).run().fidelity.changed


@pytest.mark.parametrize("law", [None, STRONG])
def test_a_tiled_session_that_is_stored_knows_what_was_replaced(law):
    """Its records are on disk, so that the run in memory does not say it."""
    session = fk.start(fk.Scenario(WEAK, START, t_end=4.0, frames=41), "tiles")
    session.advance(1.0)
    if law is not None:
        session.replace(law=law)
    run = session.run()
    counts = {"time": len(run.t), "step": len(run.trace), "switch": 0, "observation": 0, "tick": 0, "use": 0}
    again = type(session).unpack(session.pack(), Stored(session.scenario, None, counts, lambda: run), {})
    assert again.records.replaced_at == session.records.replaced_at
    assert again.fidelity.changed is (law is not None)


APART = fk.State([[0.0, 0.0], [2.1, 0.0], [0.0, 50.0]], [[0.0, 0.0], [-1.0, 0.0], [0.0, 0.0]])
"""The first two come near, from where they are not linked to where a link would stay but none appears, and back."""

LATE = {
    "exact": {},
    "delayed": {"information": fk.Delayed(0.05)},
    "delayed messages": {"information": fk.Messages(0.02, delay=0.01)},
}


def remembering(beside: fk.Graph, gain: float = 0.0, *, first: bool = False) -> fk.Law:
    """Links with a memory, and other ones beside them."""
    memory = fk.Hysteresis(2.0, 0.5)
    own, other = (beside, memory) if first else (memory, beside)
    return fk.Law(own, [fk.Consensus(gain), fk.Consensus(0.0, over=other)])


CHANGES = {
    "a radius": (remembering(fk.Proximity(0.4)), remembering(fk.Proximity(0.5))),
    "a cone of the same numbers": (remembering(fk.Cone(0.4, 1.0)), remembering(fk.Cone(0.4, 1.0), 1e-9)),
    "the law's own graph": (
        remembering(fk.Proximity(0.4), first=True), remembering(fk.Proximity(0.5), first=True),
    ),
    "the order": (remembering(fk.Proximity(0.4)), remembering(fk.Proximity(0.4), first=True)),
}  # fmt: skip


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("engine", LATE)
def test_graphs_that_stay_keep_their_links_where_another_graph_of_the_law_is_replaced(engine, change):
    """A start would link the two, which are nearer than links break; the memory of the first law says they are not."""
    before, after = CHANGES[change]
    agents = fk.PointMass(headings=[0.0, 0.0, 0.0])
    session = fk.start(fk.Scenario(before, APART, t_end=1.0, frames=2, agents=agents, **LATE[engine]))
    session.advance(0.41)
    session.replace(law=after)
    session.advance(1.0)
    # They are linked from the distance of 1.5 on, not from the replacement on.
    appeared = [row["time"] for row in session.run().switches if row["kind"] == "appear"]
    assert appeared == [pytest.approx(0.6, abs=1e-6)]
