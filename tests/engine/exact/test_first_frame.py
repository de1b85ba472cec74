"""What is compiled before the first frame of a law that was never seen: its own formulas, and nothing else."""

from __future__ import annotations

import subprocess
import sys
import time

import pytest

FIRST_FRAME = """
import flocking as fk
from flocking.formula.native import objects

made, real = [], objects.object_code
objects.object_code = lambda text: (made.append(text), real(text))[1]
psi = fk.Potential({formula!r})
law = fk.Law(fk.Proximity(4.0), [fk.Gradient(psi), fk.Consensus(1.0)])
start = fk.start.box(5, side=4.0, speed=1.0, seed=1, dimension={dimension})
session = fk.start(fk.Scenario(law, start, t_end=1.0, frames=11), engine="exact")
session.advance(0.1)
assert len(session.run().t) == 2
print(*(text.split("define i32 @")[1].split("(")[0].strip('"') for text in made))
"""


def compiled_for(formula: str, dimension: int = 2) -> list[str]:
    """Names of the functions that a fresh process compiles until the first frame of a law."""
    text = FIRST_FRAME.format(formula=formula, dimension=dimension)
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    return done.stdout.split()


def never_seen(formula: str) -> str:
    """A formula with a number that no formula has had on this machine, so that no cache has its functions."""
    return formula.replace("k", f"{time.time_ns()}")


def test_the_loop_is_not_compiled_for_each_law():
    """With the loop in the ordinary cache, where most tests put it."""
    compiled_for("0.3*(r - 1)**2/2 + exp(-r)/7")
    smooth = never_seen("0.3*(r - 1)**2/2 + exp(-2*r)/7 + r/k")
    assert sorted(compiled_for(smooth)) == ["energies", "slope"]
    assert sorted(compiled_for(never_seen("where(r < 1.5, (r - 1)**2, r - 1.25) + r/k"))) == ["energies", "slope"]
    assert compiled_for(smooth) == []


@pytest.mark.slow
def test_the_loop_is_compiled_once_in_a_new_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("FLOCKING_CACHE", str(tmp_path / "cache"))
    first = compiled_for("0.3*(r - 1)**2/2 + exp(-r)/7")
    assert {"slope", "energies", "stages", "step_block"} <= set(first)
    again = compiled_for("0.3*(r - 1)**2/2 + exp(-2*r)/7")
    assert sorted(again) == ["energies", "slope"]
    assert sorted(compiled_for("0.3*(r - 1)**2/2 + exp(-2*r)/7", dimension=3)) == ["energies", "slope"]
