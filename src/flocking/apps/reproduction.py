"""Reproduce the papers: run every scenario for several seeds, judge every claim, draw every figure."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from flocking.apps.findings import Reproduction, claim_rows
from flocking.apps.report import write_report
from flocking.engine.run import Run
from flocking.errors import SimulationError
from flocking.papers import KEYS, paper
from flocking.study.audit import Judgement, Report
from flocking.study.audit import audit as audit_claims
from flocking.study.claims import Result, Verdict

Verdicts = list[tuple[str, str, float, float, str]]


def examine_seed(name: str, key: str, seed: int, keep: bool) -> tuple[Verdicts, Run | None]:
    """Run one scenario for one seed and audit it; the run itself comes back only when asked for."""
    from flocking.engine.simulate import simulate

    module = paper(key)
    scenario = module.scenarios()[name](seed)
    try:
        run = simulate(scenario, progress=False)
    except SimulationError as error:
        lost = [(c.key, str(Verdict.NOT_RESOLVED), float("nan"), float("nan"), str(error)) for c in module.claims(name)]
        return lost, None
    report = audit_claims(run, module.claims(name))
    found = [(r.claim.key, str(r.verdict), r.margin, r.error, r.note) for r in report.results]
    return found, run if keep else None


def reproduce(
    keys: Sequence[str] = KEYS,
    *,
    seeds: int = 10,
    out: Path | None = None,
    workers: int | None = None,
    progress: bool = True,
) -> Reproduction:
    """Run the scenarios of some papers, judge their claims, and draw their figures.

    Parameters
    ----------
    keys
        Keys of the papers.
    seeds
        Number of seeds per scenario, 0, 1, 2...
    out
        Folder for ``report.html``, ``claims.json``, ``errata.json``, figures and films; nothing is written when absent.
    workers
        Processes; the number of cores when absent.
    progress
        Show a progress bar.

    Raises
    ------
    InvalidInput
        When a key is unknown.
    """
    import time

    from joblib import Parallel, delayed

    begin = time.monotonic()
    modules = {key: paper(key) for key in keys}
    tasks = [(n, k, s) for k, module in modules.items() for n in module.scenarios() for s in range(seeds)]
    # Seed 0 of each scenario runs here: it compiles the kernels the workers then find, and keeps its run.
    runs: dict[str, Run] = {}
    verdicts: dict[tuple[str, int], Verdicts] = {}
    with _bar(progress, len(tasks)) as step:
        for name, key, seed in tasks:
            if seed == 0:
                verdicts[name, 0], run = examine_seed(name, key, 0, keep=True)
                if run is not None:
                    runs[name] = run
                step()
        rest = [task for task in tasks if task[2] != 0]
        count = workers or min(os.cpu_count() or 1, 8)
        if len(rest) < 8:
            count = 1
        parallel = Parallel(n_jobs=count, return_as="generator")
        jobs = (delayed(examine_seed)(name, key, seed, False) for name, key, seed in rest)
        for (name, _, seed), (found, _) in zip(rest, parallel(jobs), strict=True):
            verdicts[name, seed] = found
            step()
    judgements = {
        name: _judgements(module, name, [verdicts[name, s] for s in range(seeds)])
        for key, module in modules.items()
        for name in module.scenarios()
    }
    errata = {key: errata_rows(module) for key, module in modules.items()}
    figures = _write(out, modules, judgements, errata, runs)
    found = Reproduction(judgements, errata, figures, time.monotonic() - begin, runs)
    if out is not None:
        write_report(found, modules, out)
    return found


def _judgements(module: ModuleType, name: str, per_seed: list[Verdicts]) -> list[Judgement]:
    found = []
    for number, claim in enumerate(module.claims(name)):
        rows = [verdicts[number] for verdicts in per_seed]
        results = tuple(Result(claim, Verdict(v), margin, error, note) for _, v, margin, error, note in rows)
        found.append(Judgement(claim, results))
    return found


def errata_rows(module: ModuleType) -> list[dict[str, Any]]:
    """Statements of a paper that a counter-example refutes, computed now."""
    return [row.as_dict() for row in module.equations() if row.demonstration is not None]


def _write(
    out: Path | None,
    modules: dict[str, ModuleType],
    judgements: dict[str, list[Judgement]],
    errata: dict[str, list[dict[str, Any]]],
    runs: dict[str, Run],
) -> list[Path]:
    if out is None:
        return []
    out.mkdir(parents=True, exist_ok=True)
    rows = claim_rows(judgements)
    (out / "claims.json").write_text(json.dumps(rows, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    (out / "errata.json").write_text(json.dumps(errata, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    drawn: list[Path] = []
    for key, module in modules.items():
        drawn += draw_figures(module, runs, out / key)
    return drawn


def draw_figures(module: ModuleType, runs: dict[str, Run], folder: Path) -> list[Path]:
    """Draw all figures of a paper from runs of its scenarios, as SVG and PNG."""
    from flocking.show.style import save

    drawn: list[Path] = []
    for number, declaration in module.figures().items():
        run = runs.get(declaration.scenario or next(iter(module.scenarios())))
        if run is not None:
            folder.mkdir(parents=True, exist_ok=True)
            drawn += save(declaration.draw(run), folder / f"figure-{number}")
    return drawn


class _Steps:
    """Counts finished runs, with a bar on a terminal."""

    def __init__(self, bar: Any, task: Any) -> None:
        self._bar, self._task = bar, task

    def __call__(self) -> None:
        if self._bar is not None:
            self._bar.advance(self._task)


class _bar:  # noqa: N801
    def __init__(self, wanted: bool, total: int) -> None:
        self._wanted = wanted and sys.stderr.isatty()
        self._total = total
        self._bar: Any = None

    def __enter__(self) -> _Steps:
        if not self._wanted:
            return _Steps(None, None)
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (TextColumn("runs"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
        self._bar.start()
        return _Steps(self._bar, self._bar.add_task("runs", total=self._total))

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()


__all__ = ["Report", "Reproduction", "draw_figures", "errata_rows", "examine_seed", "reproduce"]
