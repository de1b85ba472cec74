"""Runs from samples, with velocities estimated where they are missing, and what that adds to the errors of an audit."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flocking.engine.runs.fidelity import Approaches, Fidelity
from flocking.engine.runs.run import SWITCH_FIELDS, TRACE_FIELDS, Run
from flocking.errors import InvalidInput
from flocking.model.checks import Array, number
from flocking.model.graphs.distance_graphs import Proximity
from flocking.model.law import Law, Scenario
from flocking.model.state import State
from flocking.model.terms.pair_terms import Consensus
from flocking.study.claims.audit import Report, audit
from flocking.study.claims.claims_without_law import claims_without_law
from flocking.study.claims.general_claims import GENERAL
from flocking.study.sample_files.jumps import largest_jump
from flocking.study.sample_files.samples import LARGEST_FILE, Samples
from flocking.study.sample_files.velocities import SPREADS, WINDOW, Velocities, smoothed_velocities
from flocking.study.sample_files.velocity_check import doubted_velocities, rounded_velocities
from flocking.study.trajectory import SAMPLES, closest_of, largest_gap, run_from_samples, starts_with

DRAWS = 4
"""Random perturbations whose largest effect on the ledger estimates the error that estimated velocities cause. One of
four normal draws exceeds a standard deviation in 78 % of cases; audits allow three times the estimate."""

GIVEN = "given in the file, taken as exact"
"""How velocities of a file are described."""

FEW = f"; noise of positions is not known from fewer than {WINDOW} samples"
"""What is added where there are too few samples."""


@dataclass(frozen=True, eq=False)
class SampledMotion:
    """A run made of samples.

    Parameters
    ----------
    run
        The run.
    has_law
        Whether a law was declared.
    radius
        Radius within which agents are neighbours, where no law was declared and one was given.
    """

    run: Run
    has_law: bool
    radius: float | None = None

    def audit(self) -> Report:
        """Judge what no law is needed for, where none was declared; else the general claims.

        In a world with held control, delays or messages no ledger of samples can show that the law moved the agents.
        What no law is needed for is judged there too, in place of the general claims of the same name.
        """
        if not self.has_law:
            return audit(self.run, claims_without_law(self.radius))
        scenario = self.run.scenario
        if not scenario.imperfections:
            return audit(self.run)
        farthest = float(np.max(np.asarray(scenario.law.graph.break_radius)))
        beside = claims_without_law(farthest if scenario.law.graph.moves and np.isfinite(farthest) else None)
        named = {claim.key for claim in beside}
        return audit(self.run, [*beside, *(claim for claim in GENERAL if claim.key not in named)])


def motion_of(
    samples: Samples, scenario: Scenario | None = None, *, radius: float | None = None, begins: bool | None = None
) -> SampledMotion:
    """A run of samples under a declared law, or without one.

    Where velocities are missing they are estimated (`smoothed_velocities`); where positions contradict them, the
    difference counts as their error (`doubted_velocities`). The run states their error and that of the positions, which
    claims take into account. The ledger's error is enlarged by the largest change of its residual
    under perturbations of that size.

    Parameters
    ----------
    samples
        The samples.
    scenario
        The declared law, agents and energy; its start and end are replaced by those of the samples.
    radius
        Radius within which agents are neighbours, for samples without a law.
    begins
        Whether the motion begins at the first sample, so that links are there as the graph of the law has them at a
        start. Where absent: if the start of the scenario has the time and the positions of the first sample.

    Raises
    ------
    InvalidInput
        When law and samples do not fit, the scenario is in periodic space, both a law and a radius are given, there are
        too many pairs to hold, or too few samples to estimate velocities.
    """
    if scenario is not None and radius is not None:
        raise InvalidInput("audit", "radius", "must be absent where a law is given", radius, "The law has its own.")
    if radius is not None:
        radius = number("audit", "radius", radius, above=0.0)
    f, n, m = samples.q.shape
    if (scenario is not None) and f * n * n > LARGEST_FILE:
        raise InvalidInput(
            "audit", "samples", f"must have at most {LARGEST_FILE} pairs in all", f * n * n,
            "Keep fewer agents or samples.",
        )  # fmt: skip
    found = _velocities(samples, discrete=scenario is not None and scenario.agents.discrete)
    p = found.p if found is not None else samples.p
    assert p is not None
    if scenario is None:
        run = _with_errors(_run_without_law(samples, p, radius), found, samples)
        return SampledMotion(run, False, radius)
    if not scenario.space.is_open:
        raise InvalidInput("audit", "law", "must be in open space", scenario.space, "Samples are judged as they are.")
    if scenario.start.q.shape[1] != m:
        raise InvalidInput("audit", "law", f"must be in {m} dimensions, as the samples", scenario.start.q.shape[1])
    if begins is None:
        begins = starts_with(scenario, samples.t, samples.q, samples.rounding[0])
    given = scenario.start.links if begins else None
    start = State(samples.q[0], p[0], float(samples.t[0]), given)
    declared = scenario.with_(start=start, t_end=float(samples.t[-1]))
    run = run_from_samples(declared, samples.t, samples.q, p, begins=begins)
    if found is not None:
        run = _widened(run, found, _residual_changes(run, found))
    return SampledMotion(_with_errors(run, found, samples), True)


def _velocities(samples: Samples, *, discrete: bool) -> Velocities | None:
    """Velocities with errors: estimated ones, and given ones that the positions contradict; None for exact ones."""
    t, q, p, rounding = samples.t, samples.q, samples.p, samples.rounding
    if p is None:
        found: Velocities | None = smoothed_velocities(t, q, rounding=rounding[0])
    elif discrete:
        # Between updates, of which few may lie at samples, agents move along straight lines: slopes contradict nothing.
        found = rounded_velocities(p, rounding)
    else:
        found = doubted_velocities(t, q, p, rounding=rounding)
    jump = largest_jump(t, q, p, discrete=discrete)
    if jump is None:
        return found
    if found is None:
        assert p is not None
        found = Velocities(p, p, np.zeros_like(p), 0.0, GIVEN)
    return replace(found, jump=jump.size, method=f"{found.method}; {jump.words}")


def _with_errors(run: Run, found: Velocities | None, samples: Samples) -> Run:
    """The run with what is known of the errors of its samples; ``found`` are the velocities that were estimated."""
    if found is None:
        given = GIVEN + FEW * (len(run.t) < WINDOW)
        return replace(run, provenance={**run.provenance, "velocities": given})
    place = max(SPREADS * found.noise, found.jump)
    errors = {"position_error": place, "velocity_error": float(found.error.max())}
    described = found.method if samples.p is not None else _described(found)
    about = {**run.provenance, "velocities": described, **errors}
    fidelity = replace(run.fidelity, position_error=errors["position_error"], velocity_error=errors["velocity_error"])
    return replace(run, fidelity=fidelity, provenance=about)


def _described(found: Velocities) -> str:
    largest = float(np.linalg.norm(found.p, axis=2).max())
    typical = float(np.sqrt((found.error**2).mean()))
    return (
        f"estimated: {found.method}; error about {typical:.1e}, at most {found.error.max():.1e}, of speeds up to "
        f"{largest:.3g}; noise of positions {found.noise:.1e}"
    )


def _residual_changes(run: Run, found: Velocities) -> float:
    """Largest change of the ledger's residual under perturbations as large as the estimated errors.

    Infinite where positions jump: distances, and energies with them, may be those of other agents or images; 0 of a run
    without a ledger.
    """
    if not len(run.trace):
        return 0.0
    if found.jump:
        return float("inf")
    t, q, p = run.t, run.q, run.p
    motions = [(q, found.other)]
    draw = np.random.default_rng(0)
    for _ in range(DRAWS):
        noise_q = found.noise * draw.standard_normal(q.shape)
        motions.append((q + noise_q, p + found.error / SPREADS * draw.standard_normal(p.shape)))
    # With the links that the run has at its start, where it has some.
    moved = [run_from_samples(run.scenario, t, places, speeds, begins=True) for places, speeds in motions]
    changes = [each.residual - run.residual for each in moved]
    sizes = [float(np.abs(change).max(initial=0.0)) for change in changes]
    return float(np.max(sizes)) if np.isfinite(sizes).all() else float("inf")


def _widened(run: Run, found: Velocities, change: float) -> Run:
    """The run with a ledger and approaches that may be off by what the estimated errors cause."""
    rule, near = run.fidelity.ledger, run.fidelity.approaches
    size = rule.size + change
    moved = float(np.diff(run.t).max()) * 2.0 * float(found.error.max()) + 2.0 * max(SPREADS * found.noise, found.jump)
    error = (near.error or 0.0) + float(np.sqrt(run.q.shape[2])) * moved
    fidelity = replace(run.fidelity, ledger=replace(rule, size=size), approaches=replace(near, error=error))
    return replace(run, fidelity=fidelity, provenance={**run.provenance, "ledger_error": size, "gap": error})


def _run_without_law(samples: Samples, p: Array, radius: float | None) -> Run:
    """A run without ledger and links, whose law stands for none."""
    t, q = samples.t, samples.q
    # A scenario needs a law; no claim that is made of this run reads it, but for the radius.
    law = Law(Proximity(1.0 if radius is None else radius), (Consensus(0.0),))
    times = tuple(float(s) for s in t)
    scenario = Scenario(law, State(q[0], p[0], times[0]), t_end=times[-1], frames=times, name="")
    none = np.zeros((len(t), 0, 0), dtype=bool)
    account = Fidelity(SAMPLES, sampled=True, approaches=Approaches("all", largest_gap(t, p)))
    linked, free = closest_of(t, q, None)
    about: dict[str, object] = {"engine": SAMPLES, "law": "none declared"}
    return Run(
        scenario, t, q, p, none, np.zeros(0, dtype=SWITCH_FIELDS), np.zeros(0, dtype=TRACE_FIELDS), linked, free,
        "finished", about, fidelity=account,
    )  # fmt: skip
