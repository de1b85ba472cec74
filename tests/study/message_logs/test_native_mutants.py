"""Broken copies of the native loop over events: the second computation of what agents used catches each."""

import re

import numpy as np
import pytest

import flocking as fk
from flocking.engine.sampled.blocks import block
from tests.engine.sampled.mutated_blocks import mutated_loop
from tests.study.message_logs.test_replay import ran, world

LIMITED = {"agents": fk.Limited(fk.PointMass(), force=1.0)}
"""Bodies whose limit acts at times."""

MUTANTS = {
    "unchanged": ((), {}, ""),
    "late_message_used_early": (
        [
            ("hearing.py", "    if when > instant:", "    if when > instant + 60_000_000:"),
            ("hearing.py", "when + sending.jitter > instant:", "when + sending.jitter > instant + 60_000_000:"),
            ("hearing.py", "round_half_even(late)) > instant:", "round_half_even(late)) > instant + 60_000_000:"),
            ("hearing.py", "since = instant - sending.delay", "since = instant + 60_000_000 - sending.delay"),
        ],
        {}, "arrived only at",
    ),
    "lost_message_used": (
        [("hearing.py", "return NO if drawn(sending.seed, OF_LOSS, one, two, k) < chance else YES", "return YES")],
        {}, "which was lost",
    ),
    "stale_link_kept": (
        [("knowing.py", "= distance < level and there", "= (distance < level or memory.links[g, i, j]) and there")],
        {}, "no neighbour by what it knew",
    ),
    "noise_added_twice": (
        [("hearing.py", "value += sending.deviations", "value += 2.0 * sending.deviations")],
        {}, "its force is logged as",
    ),
    "saturation_before_hold": (
        [(
            "knowing.py", "            finite = finite and (not work.acting[i] or np.isfinite(work.u[i, k]))",
            "            finite = finite and (not work.acting[i] or np.isfinite(work.u[i, k]))\n"
            "            work.u[i, k] = min(max(work.u[i, k], -0.7), 0.7)",
        )],
        LIMITED, "its force is logged as",
    ),
}  # fmt: skip
"""Changes of the loop, of the world, and words by which an entry is named; nothing where all is as declared."""


QUICK = ("late_message_used_early",)
"""Those of the default tests: each is a loop that is compiled anew."""


@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in MUTANTS]
)
def test_a_broken_native_loop_is_caught(monkeypatch, tmp_path, name):
    changes, parts, words = MUTANTS[name]
    loop, taken = mutated_loop(tmp_path, f"blocks_{name}", changes), []
    monkeypatch.setattr(block, "event_block", lambda *given: taken.append(loop(*given)) or taken[-1])
    made = world().with_(**parts)
    run = ran(made)
    assert sum(events for events, _, _ in taken) > 50
    if parts:
        assert (np.linalg.norm(run.log.forces, axis=1) > 0.5).any()
    found = fk.replay(run)
    assert found.agrees == (not words), str(found)
    assert not words or any(re.search(words, w.what) for w in found.wrong), str(found)
    # The energy ledger sees none of them.
    assert np.abs(run.residual).max() <= 1e-9 * max(1.0, run.turnover) + run.fidelity.ledger.size
