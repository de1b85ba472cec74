"""Any text as a formula: refused, or evaluated without a hang."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

import flocking as fk
from flocking.formula.grammar import Formula
from tests.fuzz.formulas import FORMULAS
from tests.fuzz.guard import fuzz, guarded

R = np.array([0.0, 1e-3, 0.5, 1.0, 3.0, 50.0])


@fuzz("formulas")
def test_formulas(data: Any, folder: Path) -> None:
    text = data.draw(FORMULAS)
    use = data.draw(st.sampled_from(["slope", "slope", "curvature", "latex", "kinks", "path"]))
    value = data.draw(st.sampled_from([1.0, 0.0, -2.0, 4.0, 1e9]))
    with guarded("formulas"):
        names = Formula(text).names
        if use == "path":
            leader = fk.Path(
                [text.replace("r", "t")], **dict.fromkeys(Formula(text.replace("r", "t")).names - {"t"}, value)
            )
            for t in (0.0, 0.7):
                q, p, a = leader.at(t)
                assert q.shape == p.shape == a.shape == (1,)
            return
        psi = fk.Potential(text, **dict.fromkeys(names - {"r"}, value))
        if use == "latex":
            assert psi.latex
        elif use == "kinks":
            assert len(psi.kinks()) <= 64
        else:
            assert np.shape(getattr(psi, use)(R)) == R.shape
        assert np.shape(psi(R)) == R.shape
