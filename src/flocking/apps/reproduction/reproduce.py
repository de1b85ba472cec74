"""Reproduce the papers: run every scenario for several seeds, judge every claim, draw every figure."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from flocking.apps.reproduction.claim_pictures import draw_pictures, picture_of
from flocking.apps.reproduction.film import write_film
from flocking.apps.reproduction.report import CLAIMS, figures_of, write_report
from flocking.apps.reproduction.results import Reproduction, claim_rows
from flocking.engine.driver.waits import Wait
from flocking.engine.runs.run import Run
from flocking.engine.storage.atomic_files import write_file
from flocking.errors import InvalidInput, SimulationError
from flocking.model.checks import integer
from flocking.papers import KEYS, paper
from flocking.papers.description import Paper
from flocking.papers.equation_table import Fault, RowData
from flocking.study.claims.claim import Basis, Claim, Result, Verdict
from flocking.study.claims.judgement import FEWEST_SEEDS, Judgement
from flocking.study.claims.settled_run import settled_runs
from flocking.study.sweeps.worker_pool import WorkerPool, pool

MOST_SEEDS = 10_000
"""Largest number of seeds: more is taken for a typing error."""

FURTHER = 10
"""At most this many times the requested seeds are drawn until five meet every hypothesis."""

COUNTEREXAMPLE = -1
"""In place of the seed of a counter-example, which has its own."""

Verdicts = list[tuple[str, str, float, float, str]]


@dataclass(frozen=True)
class Task:
    """One run to examine.

    Parameters
    ----------
    name
        Name of the scenario.
    key
        Key of the paper.
    seed
        Its seed, or `COUNTEREXAMPLE`.
    claim
        Key of the claim that a counter-example refutes; empty for a seed, by whose run all claims are judged.
    keep
        Whether the run is returned.
    judged
        Whether claims are judged; a run that is only drawn ends at the end of its scenario.
    """

    name: str
    key: str
    seed: int
    claim: str = ""
    keep: bool = False
    judged: bool = True


def examine(task: Task) -> tuple[Verdicts, Run | None]:
    """Run a scenario, extended where claims need it, and audit it.

    The run to the end of the scenario is returned where the task asks for it.

    Parameters
    ----------
    task
        What to run.
    """
    article = paper(task.key)
    claims = [c for c in article.claims(task.name) if task.judged and task.claim in ("", c.key)]
    made = claims[0].counterexample if task.claim else None
    scenario = made() if made is not None else article.scenarios()[task.name](task.seed)
    run: Run | None = None
    try:
        for longest, judged in settled_runs(scenario, claims, fine=task.keep):
            run, report = run or longest, judged
    except SimulationError as error:
        lost = [(c.key, str(Verdict.NOT_RESOLVED), float("nan"), float("nan"), str(error)) for c in claims]
        return lost, None
    found = [(r.claim.key, str(r.verdict), r.margin, r.error, r.note) for r in report.results]
    return found, run if task.keep else None


def reproduce(
    keys: Sequence[str] = KEYS,
    *,
    seeds: int = 10,
    first_seed: int = 0,
    out: Path | None = None,
    workers: int | None = None,
    progress: bool = True,
) -> Reproduction:
    """Run the scenarios of some papers, judge their claims, and draw their figures.

    Where fewer than five seeds meet the hypothesis of a claim, further seeds are drawn; runs whose limits cannot be
    judged yet are extended, up to ten times as long. Claims with a counter-example are also judged by it.

    Parameters
    ----------
    keys
        Keys of the papers.
    seeds
        Number of seeds per scenario, at most `MOST_SEEDS`.
    first_seed
        The first of them; the others follow one by one.
    out
        Folder for ``report.html``, ``claims.json``, ``errata.json``, figures and films; nothing is written when absent.
    workers
        Processes; the number of cores when absent.
    progress
        Show how many runs and pictures are done.

    Raises
    ------
    InvalidInput
        When a key is unknown, a number is out of range, or the folder cannot be made.
    """
    import time

    begin = time.monotonic()
    papers = {key: paper(key) for key in keys}
    if integer("reproduce", "seeds", seeds, least=1) > MOST_SEEDS:
        raise InvalidInput("reproduce", "seeds", f"must be at most {MOST_SEEDS}", seeds)
    integer("reproduce", "first_seed", first_seed, least=0)
    if workers is not None:
        integer("reproduce", "workers", workers, least=1)
    if out is not None:
        _make_folders(out, keys)
    count = (workers or min(os.cpu_count() or 1, 8)) if seeds * len(papers) >= 8 else 1
    drawings = 0 if out is None else sum(len(p.figures()) + 1 + len(p.scenarios()) for p in papers.values())
    figures: list[Path] = []
    found = _Found({}, {})
    first = range(first_seed, first_seed + seeds)
    tasks = _seed_tasks(papers, first) + _counterexample_tasks(papers)
    with (
        pool(count, None) as workers_pool,
        Wait("reproduce", len(tasks) + drawings, unit="runs and pictures", shown=progress) as wait,
    ):
        found.examine(workers_pool, tasks, wait)
        while further := _further_seed_tasks(papers, found, first):
            wait.more(len(further))
            found.examine(workers_pool, further, wait)
        again = _runs_to_draw(papers, found)
        wait.more(len(again))
        found.examine(workers_pool, again, wait)
        wait.note = "errata"
        errata = dict(zip(papers, workers_pool.results(_errata, ((key,) for key in papers)), strict=True))
        wait.note = ""
        if out is not None:
            for drawn in workers_pool.results(draw, _drawings(papers, found.runs, out)):
                figures += drawn
                wait.count()
        judgements = {name: found.judgements(p, name) for p in papers.values() for name in p.scenarios()}
        found_all = Reproduction(judgements, errata, figures, time.monotonic() - begin, found.runs, first_seed, seeds)
        if out is not None:
            wait.note = "writing the report"
            write_file(out / "claims.json", _json(claim_rows(judgements)), "write the claims")
            write_file(out / "errata.json", _json(errata), "write the errata")
            write_report(found_all, papers, out)
    return found_all


def _seed_tasks(papers: dict[str, Paper], seeds: range) -> list[Task]:
    # By seed, so that two workers seldom compile the same kernel; the first run of each scenario is kept for drawing.
    names = [(name, key) for key, article in papers.items() for name in article.scenarios()]
    return [Task(name, key, seed, keep=seed == seeds.start) for seed in seeds for name, key in names]


def _runs_to_draw(papers: dict[str, Paper], found: _Found) -> list[Task]:
    """For scenarios whose first run misses a hypothesis: the first seed that meets all, to be drawn."""
    planned = []
    for key, article in papers.items():
        for name in article.scenarios():
            by_seed = {k: v for k, v in found.verdicts[name].items() if isinstance(k, int)}
            meeting = [
                s for s, rows in sorted(by_seed.items()) if all(r[1] != Verdict.HYPOTHESIS_NOT_MET for r in rows)
            ]
            if meeting and meeting[0] != min(by_seed):
                planned.append(Task(name, key, meeting[0], keep=True, judged=False))
    return planned


def _counterexample_tasks(papers: dict[str, Paper]) -> list[Task]:
    return [
        Task(name, key, COUNTEREXAMPLE, claim.key)
        for key, article in papers.items()
        for name in article.scenarios()
        for claim in article.claims(name)
        if claim.counterexample is not None
    ]


@dataclass
class _Found:
    """What was found so far.

    Parameters
    ----------
    verdicts
        By scenario, and by seed or the claim of a counter-example.
    runs
        Of each scenario the run that is drawn: the first that meets every hypothesis, or the first.
    """

    verdicts: dict[str, dict[int | str, Verdicts]]
    runs: dict[str, Run]

    def examine(self, workers_pool: WorkerPool, tasks: Sequence[Task], wait: Wait) -> None:
        """Examine some runs and store the results."""
        for task, (verdicts, run) in zip(tasks, workers_pool.results(examine, ((t,) for t in tasks)), strict=True):
            if task.judged:
                self.verdicts.setdefault(task.name, {})[task.claim or task.seed] = verdicts
            if run is not None:
                self.runs[task.name] = run
            wait.count()

    def judgements(self, article: Paper, name: str) -> list[Judgement]:
        """Judgements over the runs of a scenario, one per claim."""
        found = self.verdicts[name]
        seeds = sorted(k for k in found if isinstance(k, int))
        judged = []
        for number, claim in enumerate(article.claims(name)):
            results = tuple(_result(claim, found[seed][number]) for seed in seeds)
            refuted = _result(claim, found[claim.key][0]) if claim.key in found else None
            judged.append(Judgement(claim, results, refuted))
        return judged


def _result(claim: Claim, row: tuple[str, str, float, float, str]) -> Result:
    _, verdict, margin, error, note = row
    return Result(claim, Verdict(verdict), margin, error, note)


def _further_seed_tasks(papers: dict[str, Paper], found: _Found, first: range) -> list[Task]:
    """Further seeds for scenarios with a claim whose hypothesis too few runs meet, or an observation too few decide."""
    if len(first) < FEWEST_SEEDS:
        return []
    tasks = []
    for key, article in papers.items():
        for name in article.scenarios():
            begin = first.start + len([k for k in found.verdicts[name] if isinstance(k, int)])
            missing = max(map(_missing_seeds, found.judgements(article, name)), default=0)
            end = min(begin + missing, first.start + FURTHER * len(first))
            tasks += [Task(name, key, seed) for seed in range(begin, end)]
    return tasks


def _missing_seeds(judgement: Judgement) -> int:
    """Number of missing seeds whose run meets the hypothesis of a claim, or decides an observation."""
    if judgement.verdict != Verdict.UNTESTED:
        return 0
    enough = judgement.decided if judgement.claim.basis is Basis.OBSERVATION else judgement.met
    return max(FEWEST_SEEDS - enough, 0)


def _make_folders(out: Path, keys: Sequence[str]) -> None:
    """Make the folders before the runs, which take long."""
    try:
        for key in keys:
            (out / key / CLAIMS).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        rule = f"must be a folder that can be written ({error.strerror})"
        raise InvalidInput("reproduce", "out", rule, str(out), "Choose another one.") from None


def errata_rows(article: Paper) -> list[RowData]:
    """Statements of a paper that are not read as printed, with their counter-examples, computed now.

    Parameters
    ----------
    article
        The paper.
    """
    return [row.as_dict() for row in article.equations() if row.fault not in (Fault.NONE, Fault.CITED)]


def _errata(key: str) -> list[RowData]:
    return errata_rows(paper(key))


def _json(data: object) -> bytes:
    return (json.dumps(data, indent=2, allow_nan=False) + "\n").encode()


def _drawings(
    papers: dict[str, Paper], runs: dict[str, Run], out: Path
) -> Iterator[tuple[str, str | None, tuple[Run, ...], Path]]:
    """Arguments of `draw` for all pictures."""
    for key, article in papers.items():
        first = next(iter(article.scenarios()))
        planned: list[tuple[str | None, tuple[str, ...]]] = [(None, (first,))]
        planned += [(str(number), figure.scenarios(first)) for number, figure in article.figures().items()]
        planned += [(CLAIMS, (name,)) for name in article.scenarios()]
        for what, names in planned:
            if all(name in runs for name in names):
                yield key, what, tuple(runs[name] for name in names), out / key


def draw(key: str, what: str | None, runs: tuple[Run, ...], folder: Path) -> list[Path]:
    """Draw a picture of a paper from one or several runs; return the files of figures.

    Parameters
    ----------
    key
        Key of the paper.
    what
        Number of a figure, ``"claims"`` for the pictures beside the claims of the run's scenario, None for the film.
    runs
        The run; runs of all scenarios that a figure shows.
    folder
        Folder of the paper.
    """
    article, run = paper(key), runs[0]
    if what is None:
        if len(run.t) >= 2:
            write_film(run, folder)
        return []
    if what == CLAIMS:
        name = run.scenario.name
        drawn = figures_of(article, name)
        names = dict.fromkeys(picture_of(claim, drawn) for claim in article.claims(name))
        draw_pictures(run, (n for n in names if not n.startswith("figure-")), folder / CLAIMS)
        return []
    from flocking.show.declaration import drawn_figure
    from flocking.show.style import save

    return list(save(drawn_figure(article.figures(), what, run, *runs[1:]), folder / f"figure-{what}"))


__all__ = ["Reproduction", "draw", "errata_rows", "examine", "reproduce"]
