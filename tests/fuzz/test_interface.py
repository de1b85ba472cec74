"""The public interface under values no caller should give."""

from __future__ import annotations

import functools
import inspect
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

import flocking as fk
from tests.fuzz.formulas import FORMULAS
from tests.fuzz.guard import files_below, fuzz, guarded, interrupted_after
from tests.fuzz.values import HOSTILE

PSI = fk.Potential("1/r + 1/(R - r)", R=4)
LAW = fk.Law(fk.Hysteresis(radius=4, gap=0.1), [fk.Gradient(PSI), fk.Consensus(1.0)])
START = fk.State([[0.0, 0.0], [1.0, 0.2], [0.1, 1.4]], [[0.1, 0.0], [0.0, 0.3], [0.2, 0.2]])

GOOD: dict[str, list[Any]] = {
    "graph": [LAW.graph, fk.Fixed(3, [[0, 1]])],
    "over": [None, LAW.graph],
    "terms": [LAW.terms, [fk.Consensus(1.0)]],
    "law": [LAW],
    "start": [START, [0.0, 1.0]],
    "leader": [fk.Sink([0.0, 0.0]), [1.0, 0.0]],
    "potential": [PSI],
    "t_end": [0.1, 0.0],
    "agents": [fk.Agents()],
    "state": [START],
    "energy": [fk.Energy()],
    "seed": [1],
    "n": [3],
    "radius": [1.0],
    "gap": [0.1],
    "gain": [1.0],
    "side": [3.0],
    "q": [START.q],
    "p": [START.p],
    "t": [0.0],
    "obstacles": [[fk.Ball([9.0, 9.0], 1.0)]],
    "range": [1.0],
    "masses": [1.0],
    "formula": ["1/r"],
    "point": [[0.0, 0.0]],
    "centre": [[0.0, 0.0]],
    "normal": [[0.0, 1.0]],
    "vertices": [[[0, 0], [1, 0], [0, 1]]],
    "velocity": [["t", "1"]],
    "value": [[1.0, 0.0]],
    "edges": [[[0, 1]]],
    "radii": [[1.0, 2.0, 3.0]],
    "onset": [0.5],
    "agent": [fk.Agent([0, 0], [0, 0])],
    "neighbours": [[]],
    "dimension": [2],
    "speed": [1.0],
    "spacing": [1.0],
    "times": [[1.0]],
    "values": [[1.0, 2.0]],
}

PARTS = {
    name: kind
    for name in fk.__all__
    if inspect.isclass(kind := getattr(fk, name))
    and not inspect.isabstract(kind)
    and not issubclass(kind, Exception)
    and name not in ("Run", "ExactSession", "PairTerm", "BodyTerm", "Leader", "Graph", "Obstacle")
}
DRAWS = {"box": fk.start.box, "ball": fk.start.ball, "hexagonal": fk.start.hexagonal}


def _arguments(data: Any, function: Any, hostile: int) -> dict[str, Any]:
    """A value for each parameter: a good one where one is known, and up to ``hostile`` that no caller should give."""
    parameters = [
        p for p in inspect.signature(function).parameters.values() if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)
    ]
    names = [p.name for p in parameters if p.name != "self"]
    bad = set(data.draw(st.lists(st.sampled_from(names), min_size=1, max_size=hostile))) if names else set()
    given = {}
    for parameter in parameters:
        name = parameter.name
        if name in bad:
            given[name] = data.draw(HOSTILE | (FORMULAS if name in ("formula", "velocity") else HOSTILE))
        elif parameter.default is parameter.empty:
            given[name] = data.draw(st.sampled_from(GOOD[name])) if name in GOOD else data.draw(HOSTILE)
    return given


@fuzz("constructors")
def test_constructors(data: Any, folder: Path) -> None:
    makers = {**PARTS, **DRAWS}
    name = data.draw(st.sampled_from(sorted(makers)))
    given = _arguments(data, makers[name], 3)
    with guarded("constructors"):
        part = makers[name](**given)
        assert repr(part)


TINY = st.sampled_from([0.0, 1e-300, 1e-6, 0.3, 1.0, 50.0, 1e9, 1e300, -1.0, float("nan"), float("inf")])
PLACES = st.lists(st.lists(TINY, min_size=2, max_size=2), min_size=3, max_size=3)


@functools.cache
def _compiled() -> None:
    """Compile the law's kernels: an interrupt amid that is another matter."""
    fk.simulate(fk.Scenario(LAW, START, t_end=0.1), progress=False)


@fuzz("calls")
def test_calls(data: Any, folder: Path) -> None:
    """control, evaluate and simulate on hostile numbers; a long simulation ends at Ctrl-C and keeps what it has."""
    before = files_below(folder)
    choice = data.draw(st.sampled_from(["control", "evaluate", "simulate", "simulate", "control_of", "wrong"]))
    q, p, gain = data.draw(PLACES), data.draw(PLACES), data.draw(TINY)
    tolerance = data.draw(st.sampled_from([1e-9, 1e-3, 1e-15, 0.0]))
    t_end = data.draw(st.sampled_from([0.0, 1e-9, 0.01, 0.1, 1e12]))
    if choice == "wrong":
        function = data.draw(
            st.sampled_from(
                [
                    fk.control,
                    fk.evaluate,
                    fk.control_of,
                    fk.simulate,
                    fk.plot,
                    fk.animate,
                    fk.audit,
                    fk.read_run,
                    fk.read_scenario,
                    fk.read_start,
                    fk.check_potential,
                    fk.structural_potential,
                    fk.first_difference,
                    fk.write_scenario,
                ]
            )
        )
        given = _arguments(data, function, 2)
        for name in ("path", "save", "folder", "file"):
            if isinstance(given.get(name), str):
                given[name] = "absent/" + given[name]
        with guarded("calls"):
            function(**given)
        return
    with guarded("calls"), np.errstate(all="ignore"):
        law = fk.Law(LAW.graph, [fk.Gradient(PSI), fk.Consensus(gain)])
        state = fk.State(q, p)
        if choice in ("control", "evaluate"):
            getattr(fk, choice)(law, state)
        elif choice == "control_of":
            fk.control_of(law, fk.Agent(q[0], p[0]), [fk.Agent(q[1], p[1], 1)], t_end)
        else:
            scenario = fk.Scenario(law, state, t_end=t_end, tolerance=tolerance, frames=3)
            _compiled()
            run = interrupted_after(0.5, lambda: fk.simulate(scenario, progress=False))
            if run is not None:
                assert np.isfinite(run.q).all()
                assert run.status == "finished" or run.status.startswith("interrupted")
    assert files_below(folder) == before
