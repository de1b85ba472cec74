"""Running of sweep files; runs of the papers' scenarios are audited with the papers' claims."""

from __future__ import annotations

from pathlib import Path

from flocking.study.sweeps.sweep_file import SweepFile
from flocking.study.sweeps.table import SweepTable


def run_file(
    file: SweepFile, out: str | Path | None = None, *, workers: int | None = None, cluster: str | None = None,
    progress: bool = True,
) -> SweepTable:  # fmt: skip
    """Run a sweep file; runs that are already stored in ``out`` are skipped.

    Parameters
    ----------
    file
        The sweep.
    out
        Folder of the results.
    workers, cluster, progress
        As for `flocking.study.sweeps.sweep.sweep`.
    """
    from flocking.papers.auditing import audit
    from flocking.study.sweeps.sweep import sweep

    seeds = file.plan.seeds
    return sweep(
        file.make, grid=file.plan.grid, sample=file.plan.sample, seeds=seeds, seed=file.plan.root,
        measures=file.measures, more_measures=file.more_measures, audit=audit if file.audit else False, out=out,
        engine=file.engine, record=file.record, most_runs=file.plan.most_runs, workers=workers,
        cluster=cluster, progress=progress,
    )  # fmt: skip
