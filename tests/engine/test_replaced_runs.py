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
