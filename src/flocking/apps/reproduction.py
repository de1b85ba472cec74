"""Reproduce the papers: run every scenario for several seeds, judge every claim, draw every figure."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from flocking.apps.claim_pictures import draw_pictures, picture_of
from flocking.apps.film import write_film
from flocking.apps.findings import Reproduction, claim_rows
from flocking.apps.report import CLAIMS, figures_of, write_report
from flocking.engine.run import Run
from flocking.errors import InvalidInput, SimulationError
from flocking.model.checks import integer
from flocking.papers import KEYS, paper
from flocking.study.audit import Judgement, Report
from flocking.study.claims import Result, Verdict
from flocking.study.equations import Fault
from flocking.study.settled_run import settled_runs

MOST_SEEDS = 10_000
"""Largest number of seeds: more is a slip of the hand."""

Verdicts = list[tuple[str, str, float, float, str]]


def examine_seed(name: str, key: str, seed: int, keep: bool) -> tuple[Verdicts, Run | None]:
    """Run one scenario for one seed, longer than it asks where claims need it, and audit it.

    The run to the scenario's own end comes back, and only when asked for.

    Parameters
    ----------
    key
        Key of the paper.
    keep
        Whether the run is handed back.
    """
    module = paper(key)
    scenario = module.scenarios()[name](seed)
    run: Run | None = None
    try:
        for longest, judged in settled_runs(scenario, module.claims(name), fine=keep):
            run, report = run or longest, judged
    except SimulationError as error:
        lost = [(c.key, str(Verdict.NOT_RESOLVED), float("nan"), float("nan"), str(error)) for c in module.claims(name)]
        return lost, None
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
        Number of seeds per scenario, 0, 1, 2..., at most `MOST_SEEDS`.
    out
        Folder for ``report.html``, ``claims.json``, ``errata.json``, figures and films; nothing is written when absent.
    workers
        Processes; the number of cores when absent.
    progress
        Show a progress bar.

    Raises
    ------
    InvalidInput
        When a key is unknown, a number is out of range, or the folder cannot be made.
    """
    import time

    from joblib import Parallel, delayed

    begin = time.monotonic()
    modules = {key: paper(key) for key in keys}
    if integer("reproduce", "seeds", seeds, least=1) > MOST_SEEDS:
        raise InvalidInput("reproduce", "seeds", f"must be at most {MOST_SEEDS}", seeds)
    if workers is not None:
        integer("reproduce", "workers", workers, least=1)
    if out is not None:
        _make_folders(out, keys)
    # By seed, so that two workers seldom compile the same kernel; the first run of each scenario is kept for drawing.
    tasks = [(n, k, s) for s in range(seeds) for k, module in modules.items() for n in module.scenarios()]
    count = (workers or min(os.cpu_count() or 1, 8)) if len(tasks) >= 8 else 1
    drawings = 0 if out is None else sum(len(m.figures()) + 1 + len(m.scenarios()) for m in modules.values())
    runs: dict[str, Run] = {}
    verdicts: dict[tuple[str, int], Verdicts] = {}
    figures: list[Path] = []
    with Parallel(n_jobs=count, return_as="generator") as parallel, _bar(progress, len(tasks) + drawings) as step:
        jobs = (delayed(examine_seed)(name, key, seed, seed == 0) for name, key, seed in tasks)
        for (name, _, seed), (found, run) in zip(tasks, parallel(jobs), strict=True):
            verdicts[name, seed] = found
            if run is not None:
                runs[name] = run
            step()
        if out is not None:
            for drawn in parallel(delayed(draw)(*job) for job in _drawings(modules, runs, out)):
                figures += drawn
                step()
    judgements = {
        name: _judgements(module, name, [verdicts[name, s] for s in range(seeds)])
        for key, module in modules.items()
        for name in module.scenarios()
    }
    errata = {key: errata_rows(module) for key, module in modules.items()}
    found_all = Reproduction(judgements, errata, figures, time.monotonic() - begin, runs)
    if out is not None:
        (out / "claims.json").write_text(_json(claim_rows(judgements)), encoding="utf-8")
        (out / "errata.json").write_text(_json(errata), encoding="utf-8")
        write_report(found_all, modules, out)
    return found_all


def _make_folders(out: Path, keys: Sequence[str]) -> None:
    """Make the folders first: a place that cannot be written should not cost the runs."""
    try:
        for key in keys:
            (out / key / CLAIMS).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        rule = f"must be a folder that can be written ({error.strerror})"
        raise InvalidInput("reproduce", "out", rule, str(out), "Choose another one.") from None


def _judgements(module: ModuleType, name: str, per_seed: list[Verdicts]) -> list[Judgement]:
    found = []
    for number, claim in enumerate(module.claims(name)):
        rows = [verdicts[number] for verdicts in per_seed]
        results = tuple(Result(claim, Verdict(v), margin, error, note) for _, v, margin, error, note in rows)
        found.append(Judgement(claim, results))
    return found


def errata_rows(module: ModuleType) -> list[dict[str, Any]]:
    """Statements of a paper that are not read as printed, with their counter-examples, computed now.

    Parameters
    ----------
    module
        The paper.
    """
    return [row.as_dict() for row in module.equations() if row.fault is not Fault.NONE]


def _json(data: object) -> str:
    return json.dumps(data, indent=2, allow_nan=False) + "\n"


def _drawings(
    modules: dict[str, ModuleType], runs: dict[str, Run], out: Path
) -> Iterator[tuple[str, str | None, Run, Path]]:
    """What is to be drawn: a paper, what of it (see `draw`), the run, the folder."""
    for key, module in modules.items():
        first = next(iter(module.scenarios()))
        wanted: list[tuple[str | None, str]] = [(None, first)]
        wanted += [(number, figure.scenario or first) for number, figure in module.figures().items()]
        wanted += [(CLAIMS, name) for name in module.scenarios()]
        yield from ((key, what, runs[name], out / key) for what, name in wanted if name in runs)


def draw(key: str, what: str | None, run: Run, folder: Path) -> list[Path]:
    """Draw something of a paper from a run; return the files of figures.

    Parameters
    ----------
    key
        Key of the paper.
    what
        Number of a figure, ``"claims"`` for the pictures beside the claims of the run's scenario, None for the film.
    run
        The run.
    folder
        Folder of the paper.
    """
    module = paper(key)
    if what is None:
        if len(run.t) >= 2:
            write_film(run, folder)
        return []
    if what == CLAIMS:
        name = run.scenario.name
        drawn = figures_of(module, name)
        names = dict.fromkeys(picture_of(claim, drawn) for claim in module.claims(name))
        draw_pictures(run, (n for n in names if not n.startswith("figure-")), folder / CLAIMS)
        return []
    from flocking.show.style import save

    return list(save(module.figures()[what].draw(run), folder / f"figure-{what}"))


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


__all__ = ["Report", "Reproduction", "draw", "errata_rows", "examine_seed", "reproduce"]
