"""Runs that are extended until their claims about limits are decided."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from flocking.engine.driver.stages import in_stages
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.model.checks import number
from flocking.model.law import Law, Scenario
from flocking.study.claims.audit import Report, audit
from flocking.study.claims.claim import Claim, Verdict

FACTOR = 10.0
"""How many times as long as its scenario a run may become."""


def settled_runs(
    scenario: Scenario,
    claims: Sequence[Claim] | None = None,
    *,
    factor: float = FACTOR,
    plant: Law | None = None,
    fine: bool = False,
) -> Iterator[tuple[Run, Report]]:
    """Runs of a scenario to its end, to twice its length, four times and so on, each with its report.

    The last is the first of which no claim is ``not yet``, or the one that is ``factor`` times as long. Each equals
    the run of its own scenario (``run.scenario``) from the start, bit for bit. Under the exact engine.

    Parameters
    ----------
    scenario
        What to simulate.
    claims
        The claims; the general ones when absent.
    factor
        Largest length, in lengths of the scenario; at least 1.
    plant
        The law that is simulated; the scenario's law when absent.
    fine
        Keep several samples of every step of the first of the runs, as `flocking.engine.driver.simulate.simulate` does.

    Raises
    ------
    InvalidInput
        When the factor is less than 1.
    SimulationError
        When the run cannot be continued; its ``run`` holds what was computed until then.
    """
    if not isinstance(scenario, Scenario):
        raise InvalidInput("settled_run", "scenario", "must be a Scenario", scenario)
    most = number("settled_run", "factor", factor, least=1.0)
    begin, length = scenario.start.t, scenario.t_end - scenario.start.t
    if length == 0:
        raise InvalidInput("settled_run", "scenario", "must take time", scenario.t_end, "Give a later t_end.")
    ends = [scenario.t_end]
    times = 2.0
    while times < most:
        ends.append(begin + times * length)
        times *= 2
    if most > 1:
        ends.append(begin + most * length)
    for run in in_stages(scenario, ends, plant=plant, fine=fine):
        report = audit(run, claims)
        yield run, report
        if all(result.verdict != Verdict.NOT_YET for result in report.results):
            return


def settled_run(
    scenario: Scenario, claims: Sequence[Claim] | None = None, *, factor: float = FACTOR, plant: Law | None = None
) -> Run:
    """The run of a scenario, extended until no claim is ``not yet`` or it is ``factor`` times as long.

    Parameters
    ----------
    scenario, claims, factor, plant
        As `settled_runs` takes them; errors as there.
    """
    *_, (run, _) = settled_runs(scenario, claims, factor=factor, plant=plant)
    return run
