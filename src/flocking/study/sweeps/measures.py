"""Measures of the runs of a sweep, by name."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np

from flocking.arrays import Array, Records
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.model import observables
from flocking.model.state import State
from flocking.model.terms.body_terms import Track
from flocking.study.claims.general_claims import SETTLED
from flocking.study.evidence import Evidence, NotMeasurable, NotResolvable
from flocking.study.sweeps.plan import LARGEST_COUNT, RESERVED
from flocking.study.sweeps.recorded_content import code_of

Measured = float | bool
Measuring = Callable[[Evidence], object]

MOST_MEASURES = 1_000
"""Measures a sweep may take of each run."""

ROUNDINGS = 4
"""Roundings of its size by which the last time of a ledger may differ from the end: it is the sum of the start and of
the seconds since then, which are the difference of both. That rounds twice, and twice as often is allowed.
"""

ALMOST = 1e-9
"""Share of a run by which its last frame may miss its end and still be at it."""

SUMMARY_ENDINGS = ("_low", "_high", "_interval", "_count")
"""Endings of the columns of a summary that are about a measure besides its mean."""

VERDICT = "claim_"
"""Prefix of the columns that hold verdicts."""


def _settling(e: Evidence, t: Array, sizes: Array, what: str, *, end: bool) -> float:
    """First time from which sizes stay within `SETTLED` of their largest or of rounding; nan where the end is not.

    Parameters
    ----------
    t, sizes
        Times and sizes of the differences of velocities, shape (F,).
    what
        What they are differences of, for messages.
    end
        Whether it is asked of the end alone if they are within it, so that the time need not be certain.

    Raises
    ------
    NotResolvable
        When the run goes on after the last of them, when the largest of these differences of velocities is more than
        rounding and no more than their error, or when errors leave open which of them are within it.
    """
    e.need_end(float(t[-1]), ALMOST)
    largest, errors = float(sizes.max(initial=0.0)), e.spread_errors
    if e.spread_rounding < largest <= e.spread_error:
        raise NotResolvable(f"{what} differ by {largest:.1e} at most, no more than their error, {e.spread_error:.1e}")
    within = max(SETTLED * largest, e.spread_rounding)
    outside = np.flatnonzero(sizes > within)
    if len(outside) == 0:
        return float(t[0])
    first = int(outside[-1]) + 1
    # Only these decide: all after the time, and the one before it.
    decide = slice(-1, None) if end or first == len(t) else slice(first - 1, None)
    unsure = np.abs(sizes - within)[decide] < (errors + SETTLED * errors[sizes.argmax()])[decide]
    if unsure.any():
        k = int(np.arange(len(t))[decide][unsure][0])
        raise NotResolvable(
            f"{what} differ by {sizes[k]:.2e} at t = {e.when(float(t[k]))}, by an error of {errors[k]:.1e}: "
            f"whether by less than {within:.2e} is open"
        )
    return float(t[first]) if first < len(t) else math.nan


def convergence_time(e: Evidence, *, end: bool = False) -> float:
    """First frame from which on the velocity spread is a hundredth of its largest, or rounding; nan when never.

    Parameters
    ----------
    e
        The evidence of a run.
    end
        Whether it is asked of the end alone if it is, so that the time need not be certain.

    Raises
    ------
    NotResolvable
        When velocities differ by no more than their error, and by more than rounding, or when it leaves this open.
    """
    return _settling(e, e.spread_times, e.velocity_spread, "velocities", end=end)


def following_time(e: Evidence, *, end: bool = False) -> float:
    """First frame from which on every velocity is the leader's, to a hundredth of the largest difference or rounding.

    Parameters
    ----------
    e, end
        As for `convergence_time`.

    Raises
    ------
    InvalidInput
        When the law has no leader.
    NotResolvable
        When they differ by no more than the error of the run, and by more than rounding, or when it leaves this open.
    """
    track = next((term for term in e.law.body_terms if isinstance(term, Track)), None)
    if track is None:
        raise InvalidInput("sweep", "measures", "has 'following_time', which needs a law with a leader", e.law)
    goal = np.array([track.leader.at(float(t))[1] for t in e.t])
    apart = np.linalg.norm(e.p - goal[:, None, :], axis=2).max(axis=1)
    return _settling(e, e.t, apart, "velocities and the leader's", end=end)


def _seen(e: Evidence) -> Evidence:
    """The evidence of a run whose last frame, or observation where it keeps none, is at its end."""
    times = e.run.t if len(e.run.t) or e.run.observables is None else e.run.observables["time"]
    if len(times):
        e.need_end(float(times[-1]), ALMOST)
    return e


def _linked_at_end(e: Evidence) -> Evidence:
    """The same of a run whose links at the end are known from its frames alone."""
    return e if e.switches_known and len(e.run.t) else _seen(e)


def _or_nan(value: float) -> float:
    return value if math.isfinite(value) else math.nan


def _closest(e: Evidence) -> float:
    found = _looked_always(e).closest
    if found.pair[0] < 0:
        few = (
            "there is one agent"
            if e.run.n < 2
            else "no two agents were linked, and the engine records linked ones only"
        )
        raise NotMeasurable(few)
    return found.distance


def _closest_linked(e: Evidence) -> float:
    found = _looked_always(e).closest_linked
    if not math.isfinite(found.distance):
        raise NotMeasurable("no two agents were ever linked")
    return found.distance


def _moving(e: Evidence) -> State:
    """The state at the end of agents with velocities: frames of those of order 1 hold zeros in their place."""
    _seen(e)
    return State(e.q[-1], e.p[-1], float(e.t[-1]))


def _diameter(e: Evidence) -> float:
    """Largest distance at the end, in space that repeats to the nearest image, as all distances there."""
    if _seen(e).run.scenario.space.is_open:
        return float(e.diameter[-1])
    e.need_few()
    apart = e.distances(e.q[-1])
    return float(apart[np.isfinite(apart)].max(initial=0.0))


def _looked_always(e: Evidence) -> Evidence:
    """The evidence of a run whose approaches were followed; of others agents may have come closer in between."""
    if e.fidelity.approaches.looked:
        raise NotMeasurable(f"agents' distances were recorded only {e.fidelity.approaches.looked}")
    return e


def _switches(e: Evidence, kind: str) -> float:
    """Number of links that appeared or broke; of the motion as computed where its errors are not known."""
    if e.run.accuracy is None or not e.law.graph.moves:
        return e.links_created if kind == "appear" else e.links_lost
    fewest, most = e.numbers(kind)
    if fewest < most:
        raise NotResolvable(e.doubt_note(kind) or e.loss_note)
    return fewest


def _last_switch(e: Evidence) -> float:
    if e.run.accuracy is None or not e.law.graph.moves:
        return e.last_switch
    certain, possible = e.quiet_since
    if certain < possible:
        raise NotResolvable(e.doubt_note() or e.loss_note)
    return e.last_switch


def _ledger(e: Evidence) -> Records:
    """The ledger of the whole run: it ends where a link breaks or appears over a barrier, whose energy is infinite."""
    last, end = float(e.trace["time"][-1]), e.run.scenario.t_end
    if last < end - ROUNDINGS * float(np.spacing(max(abs(end), abs(e.run.scenario.start.t)))):
        raise NotMeasurable(f"the ledger ends at t = {e.when(last)}, before the run")
    return e.trace


def _ledger_closes(e: Evidence) -> bool:
    if e.fidelity.ledger.kind != "forces":
        _ledger(e)
    return e.ledger_closes


MEASURES: dict[str, tuple[str, Measuring]] = {
    "flocks": ("flocks at the end: groups that links in either direction connect",
               lambda e: _linked_at_end(e).flocks_at_end),
    "density": ("share of the agents in the largest flock at the end",
                lambda e: _linked_at_end(e).certain_at_end(observables.density)),
    "connected": ("whether links, in either direction, connect all agents throughout",
                  lambda e: e.is_connected_throughout),
    "connected_at_end": ("whether links, in either direction, connect all agents at the end",
                         lambda e: _linked_at_end(e).flocks_at_end == 1),
    "disconnected_at": ("time at which the graph is first apart; a frame where switches are not located",
                        lambda e: _or_nan(e.falls_apart_at)),
    "velocity_spread": ("largest difference from the velocity of the centre of mass at the end",
                        lambda e: float(_seen(e).velocity_spread[-1])),
    "speed_spread": ("largest speed minus the smallest at the end", lambda e: observables.speed_spread(_moving(e))),
    "order": ("length of the mean unit velocity at the end, of the agents that move",
              lambda e: observables.order(_moving(e))),
    "speed": ("largest speed at the end", lambda e: float(_seen(e).speeds[-1])),
    "diameter": ("largest distance of two agents at the end", _diameter),
    "closest": ("smallest distance of two agents in the run", _closest),
    "closest_linked": ("smallest distance of two linked agents in the run",
                       _closest_linked),
    "convergence_time": ("time from which velocities differ by no more than a hundredth of their largest difference",
                         convergence_time),
    "converged": ("whether velocities differ at the end by no more than a hundredth of their largest difference",
                  lambda e: not math.isnan(convergence_time(e, end=True))),
    "following_time": ("time from which velocities are the leader's to a hundredth of the largest difference",
                       following_time),
    "following": ("whether velocities are the leader's at the end, to a hundredth of the largest difference",
                  lambda e: not math.isnan(following_time(e, end=True))),
    "energy_start": ("energy at the start", lambda e: float(e.trace["energy"][0])),
    "energy": ("energy at the end", lambda e: float(_ledger(e)["energy"][-1])),
    "energy_most": ("largest energy at a recorded time", lambda e: float(_ledger(e)["energy"].max())),
    "dissipated": ("energy dissipated", lambda e: float(_ledger(e)["dissipated"][-1])),
    "links_created": ("links that appeared", lambda e: _switches(e, "appear")),
    "links_lost": ("links that broke", lambda e: _switches(e, "break")),
    "last_switch": ("time of the last link switch, the start where there was none", _last_switch),
    "ledger_closes": ("whether the energy ledger closes", _ledger_closes),
}  # fmt: skip
"""What can be measured, by name: a description, and the function of the evidence of a run."""


class OfRun:
    """A measure given as a function of the run.

    Parameters
    ----------
    function
        Takes the run.
    """

    def __init__(self, function: Callable[[Run], object]) -> None:
        self.function = function

    def __call__(self, evidence: Evidence) -> object:
        """Measure the run."""
        return self.function(evidence.run)


def find_measures(
    requested: Sequence[str | Callable[[Run], object]] | Mapping[str, Callable[[Run], object]] | str,
    more: Mapping[str, tuple[str, Measuring]] | None = None,
    parameters: Collection[str] = (),
) -> dict[str, Measuring]:
    """Measures by name.

    Parameters
    ----------
    requested
        Names of `MEASURES` and functions of a run, each under its own name; or a mapping of names to functions.
    more
        Further measures that may be named.
    parameters
        Names of what the sweep varies, which no measure may have.

    Raises
    ------
    InvalidInput
        When a name is unknown or taken, a function has no name, or there are too many.
    """
    from flocking.model.parts.values import nearest

    known = {**MEASURES, **(more or {})}
    entries: list[tuple[str | None, object]]
    if isinstance(requested, Mapping):
        entries = list(requested.items())
    else:
        entries = [(None, entry) for entry in ([requested] if isinstance(requested, str) else requested)]
    found: dict[str, Measuring] = {}
    for given, entry in entries:
        if isinstance(entry, str):
            if entry not in known:
                raise InvalidInput("sweep", "measures", "must be names of measures", entry, nearest(entry, known))
            name, function = str(given or entry), known[entry][1]
        elif callable(entry):
            name = str(given or getattr(entry, "__name__", ""))
            if not name or name == "<lambda>":
                raise InvalidInput(
                    "sweep", "measures", "must have names", entry, 'Pass a mapping such as {"speed": lambda run: ...}.'
                )
            function = OfRun(entry)
        else:
            raise InvalidInput("sweep", "measures", "must be names, or functions of a run", entry)
        if name in found:
            raise InvalidInput("sweep", "measures", "must have different names", name)
        found[name] = function
    check_names(found, parameters)
    return found


def check_names(measures: Collection[str], parameters: Collection[str]) -> None:
    """Refuse names of measures that would stand for two things in the results.

    Parameters
    ----------
    measures, parameters
        Names of what a sweep measures, and of what it varies.

    Raises
    ------
    InvalidInput
        When a name is empty, reserved or that of a parameter or of a column of the results, or there are too many.
    """
    if len(measures) > MOST_MEASURES:
        raise InvalidInput("sweep", "measures", f"must be at most {MOST_MEASURES}", len(measures))
    for name in measures:
        if not name or name in RESERVED:
            raise InvalidInput("sweep", "measures", "must have names that are not reserved", name)
        if name in parameters:
            raise InvalidInput(
                "sweep", "measures", "must not have the name of a parameter of the sweep", name, "Give it another name."
            )
    taken = {name + ending: name for name in measures for ending in SUMMARY_ENDINGS}
    for name in (*measures, *parameters):
        if name in taken:
            raise InvalidInput(
                "sweep", "measures", f"must leave the name {name!r} to the summary of {taken[name]!r}", name,
                "Give it another name.",
            )  # fmt: skip
        if name.startswith(VERDICT):
            raise InvalidInput(
                "sweep", "measures" if name in measures else "grid",
                f"must not have names that begin with {VERDICT!r}, as the columns of verdicts do", name,
            )  # fmt: skip


def plain_measure(name: str, value: object) -> Measured | int:
    """A measured value as a number or a truth value.

    Raises
    ------
    InvalidInput
        When it is neither, or a whole number that no double holds.
    """
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        value = value.item()
    if not isinstance(value, bool | int | float):
        raise InvalidInput("sweep", f"measures[{name!r}]", "must give one number or a truth value", value)
    if isinstance(value, int) and abs(value) > LARGEST_COUNT:
        raise InvalidInput(
            "sweep", f"measures[{name!r}]", f"must give whole numbers of at most {LARGEST_COUNT}", value,
            "Columns hold doubles, which are exact up to there: give a rounded number with a decimal point.",
        )  # fmt: skip
    return value


def recorded_measure(name: str, function: Measuring, more: Mapping[str, tuple[str, Measuring]] | None = None) -> str:
    """What the record of a sweep states of a measure: its name where it is the known one of that name, else its code.

    Parameters
    ----------
    name, function
        The measure and its name in the results.
    more
        Further measures that may be named.
    """
    known = {**MEASURES, **(more or {})}
    if name in known and known[name][1] is function:
        return name
    return code_of(function.function if isinstance(function, OfRun) else function)
