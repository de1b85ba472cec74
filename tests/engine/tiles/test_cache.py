"""Compiled laws on disk: the next process finds the code, and needs no SymPy."""

import os
import subprocess
import sys

RUN = """
import sys
import flocking as fk
begin = fk.start.hexagonal(64, spacing=0.9, speed=0.1, seed=0)
law = fk.Law(fk.Proximity(1.0), [fk.Gradient(fk.Potential("k*(r - d)**2", k=1.0, d=0.9)), fk.Consensus(1.0)])
run = fk.simulate(fk.Scenario(law, begin, t_end=0.02, frames=2), engine="tiles", step=0.01, ledger=False)
print(repr(float(run.q.sum())), "sympy" in sys.modules)
"""


def test_second_process_reuses_compiled_code(tmp_path):
    environment = {**os.environ, "FLOCKING_CACHE": str(tmp_path)}
    kept, results = [], []
    for _ in range(2):
        done = subprocess.run([sys.executable, "-c", RUN], capture_output=True, text=True, env=environment, check=True)
        kept.append({path.name: path.stat().st_ino for path in tmp_path.rglob("*.o")})
        results.append(done.stdout.split())
    assert len(kept[0]) > 5
    assert kept[1] == kept[0]
    assert [sympy for _, sympy in results] == ["True", "False"]
    assert results[0][0] == results[1][0]
