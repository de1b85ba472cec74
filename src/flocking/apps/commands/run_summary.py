"""Summary of a run."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from typing import Any, TypedDict

import numpy as np

from flocking.arrays import Array
from flocking.engine.runs.provenance import EARLIER, MADE_BY, earlier_parts, last_time
from flocking.engine.runs.run import FRAMES, OF_VELOCITIES, Run
from flocking.formula.safe_digits import rounded_down, rounded_up, time_text
from flocking.model import observables
from flocking.model.graphs.connectivity import Links, components
from flocking.model.space import Space
from flocking.study.nets.winding import winding

CERTAIN = 1e-6
"""Share of a distance that is not shown: distances have six digits."""
SAME_TIME = 1e-9
"""Share of a run by which its last frame may miss its end and still be at it."""
LINKS = ("appear", "break")
"""Kinds of switches that are links; others are borders of formulas and ranges of obstacles."""


def summary(run: Run) -> dict[str, Any]:
    """Plain data for JSON: how the run ended, its last state, its closest pair and its ledger.

    A run may have gone on after its last frame, where it was stopped or the times of frames were given: ``time`` is
    that which it reached, ``state_time`` that of the last frame or observation.
    """
    kinds, counts = np.unique(run.switches["kind"], return_counts=True)
    last = len(run.t) - 1
    found: dict[str, Any] = {
        "scenario": run.scenario.name,
        "status": run.status,
        "agents": run.n,
        "dimension": int(run.q.shape[2]),
        "begin": run.scenario.start.t,
        "time": None,
        "state_time": float(run.t[last]) if last >= 0 else None,
        "frames": len(run.t),
        "switches": {str(kind): int(count) for kind, count in zip(kinds, counts, strict=True)},
    }
    # Frames and observations of agents of order 1 hold zeros in the place of velocities.
    has_velocities, masses = run.scenario.agents.order != 1, run.scenario.agents.masses
    if last >= 0:
        state = run.state(last)
        if has_velocities:
            found["velocity_spread"] = observables.velocity_spread(state, masses)
            found["order"] = observables.order(state)
        if state.links is not None:
            found["flocks"] = observables.flocks(state.links)
            if not run.scenario.space.is_open:
                found["winding"] = _winding(state.links, run.q[last], run.scenario.space)
    seen = run.observables
    if seen is not None and len(seen):
        # Runs of earlier versions hold zeros in the place of those of velocities.
        known = {name: has_velocities or name not in OF_VELOCITIES for name in seen.dtype.names or ()}
        found["observed"] = {name: _number(seen[name][-1]) if is_known else None for name, is_known in known.items()}
        found.setdefault("flocks", int(seen["flocks"][-1]))
        if has_velocities:
            found.setdefault("order", float(seen["order"][-1]))
            # Engines observe differences from the mean over agents, which is the centre's of equal masses alone.
            if not np.ptp(masses):
                found.setdefault("velocity_spread", float(seen["spread"][-1]))
        if found["state_time"] is None:
            found["state_time"] = float(seen["time"][-1])
    found["time"] = _reached(run, found["state_time"])
    closest = run.closest
    if math.isfinite(closest.distance):
        found["closest"] = {
            "distance": closest.distance, "time": closest.time, "pair": list(closest.pair),
            "of": run.fidelity.approaches.pairs, **_error(run),
        }  # fmt: skip
    if len(run.trace):
        energy = run.trace["energy"]
        found["energy"] = {"start": float(energy[0]), "end": float(energy[-1])}
        if "ledger ends" in run.provenance:
            # A link broke or appeared over a barrier, whose energy is infinite.
            found["energy"]["ledger_ends"] = float(run.trace["time"][-1])
        # Rows of one time balance whatever moved afterwards.
        spans = run.trace["time"][-1] > run.trace["time"][0]
        found["ledger_residual"] = float(np.abs(run.residual).max()) if spans else None
        found["turnover"] = run.turnover
    found["provenance"] = run.provenance
    return found


def _reached(run: Run, shown: float | None) -> float | None:
    """The time that a run reached: the end of one that is finished, else the latest of which it has a record."""
    if run.finished:
        begin, end = run.scenario.start.t, last_time(run.scenario, run.provenance)
        # The last frame is at the end up to rounding, unless the times of frames were given.
        return shown if shown is not None and end - shown <= SAME_TIME * (end - begin) else end
    ends = [float(run.trace["time"][-1])] if len(run.trace) else []
    return max([*ends, *([] if shown is None else [shown])], default=None)


def _error(run: Run) -> dict[str, object]:
    """What a run states of the error of its closest approach, as plain data; numbers that are not known are None."""
    near = run.fidelity.approaches
    size = run.closest.error if near.error is None else near.error
    return {"error": size if math.isfinite(size) else None, "between_looks": near.error is not None,
            "looked": near.looked}  # fmt: skip


def _doubt(distance: float, error: float | None, looked: str, *, between_looks: bool) -> str:
    """What is not known of the closest pair, in words; empty where the digits shown are certain."""
    if looked:
        return f"; distances were looked at {looked} only"
    if error is None:
        return "; its error is not known"
    if error < CERTAIN * distance:
        return ""
    size = rounded_up(error, 2)
    return f"; up to {size} closer between steps" if between_looks else f"; known to within {size}"


def _number(value: np.generic) -> float | int | None:
    number = value.item()
    return number if math.isfinite(number) else None


def _engine(about: Mapping[str, object]) -> str:
    """The engine and how it stepped, in words."""
    words = [str(about.get("engine", ""))]
    if "step" in about:
        words.append(f"step {about['step']:.4g} ({about['scheme']})")
    words += [str(about[name]) for name in ("precision",) if name in about]
    if "steps" in about:
        words.append(f"{about['steps']} steps")
    if "rebuilds" in about:
        words.append(f"{about['rebuilds']} list rebuilds")
    return ", ".join(words)


def _earlier(about: Mapping[str, object]) -> str:
    """What computed the first parts of a run that went on with something else, in words: the entries that differ."""
    parts = earlier_parts(about)
    names = [name for name in MADE_BY if any(name in part and part[name] != about.get(name) for part in parts)]
    texts = [", ".join(f"{name} {part[name]}" for name in names if name in part) for part in (*parts, about)]
    return "; ".join(texts[:-1]) + (f"; the last by {texts[-1] or 'another'}" if names else "")


def _motion(about: Mapping[str, object]) -> str:
    """How bodies moved between ticks where they have no closed form, in words."""
    if "motion" not in about:
        return ""
    return f"{about['motion']}, {about.get('integration steps', '?')} steps"


def _residual(found: dict[str, Any]) -> str:
    """The ledger's residual, also as a share of the energy moved."""
    if "ledger_residual" not in found:
        return ""
    residual, moved = found["ledger_residual"], found["turnover"]
    if residual is None:
        return "not known, the ledger ends where it begins"
    until = ", until the ledger ends" if "ledger_ends" in found.get("energy", {}) else ""
    return f"{residual:.2e}" + (f", of {moved:.4g} moved" if moved > 0 else "") + until


class _Wound(TypedDict):
    """A flock that winds around space: its number of agents, and along which axes."""

    agents: int
    axes: list[int]


def _winding(links: Links, q: Array, space: Space) -> list[_Wound]:
    """The flocks that wind around space, the largest first."""
    winds, sizes = winding(links, q, space), np.bincount(components(links))
    # Equal sizes stay in the order of the flocks.
    order = [k for k in np.argsort(-sizes, kind="stable") if winds[k].any()]
    return [{"agents": int(sizes[k]), "axes": np.flatnonzero(winds[k]).tolist()} for k in order]


MOST_NAMED = 3
"""Flocks that wind around space which the table names one by one; the others are counted."""


def _wound(winds: list[_Wound]) -> str:
    """Which flocks wind around space, in words."""
    named = [f"{x['agents']} agents around axis {' and '.join(map(str, x['axes']))}" for x in winds[:MOST_NAMED]]
    more = f", and {len(winds) - MOST_NAMED} more" if len(winds) > MOST_NAMED else ""
    return (", ".join(named) + more) or "none"


def _flocks(found: dict[str, Any]) -> str:
    """How many flocks, and where it was observed the share of the largest."""
    share = (found.get("observed") or {}).get("density")
    return str(found.get("flocks", "")) + (
        # Rounded down: 100 % is all of them.
        "" if share is None else f", the largest with {rounded_down(100 * share, 6)} % of the agents"
    )


def facts(found: dict[str, Any]) -> list[tuple[str, str]]:
    """The summary as names and values for reading.

    Parameters
    ----------
    found
        The result of `summary`.
    """
    counts = found["switches"]
    switches = ", ".join(f"{count} {kind}" for kind, count in counts.items() if kind in LINKS)
    others = ", ".join(f"{count} {kind}" for kind, count in counts.items() if kind not in LINKS)
    closest, energy = found.get("closest"), found.get("energy")
    pair = " and ".join(map(str, closest["pair"])) if closest else ""
    linked = closest is not None and closest["of"] == "linked"
    names = ("distance", "error", "looked", "between_looks")
    doubt = _doubt(**{name: closest[name] for name in names}) if closest else ""

    def when(time: float, digits: int = 6) -> str:
        return time_text(time, found["begin"], time if found["time"] is None else found["time"], digits)

    shown = found["state_time"]
    earlier = "" if shown is None or shown == found["time"] else f", at t = {when(shown)}, of the last frame"
    last = "at the end" if not earlier else "in the last frame"
    known = (energy or {}).get("ledger_ends")
    ended = "at the end" if known is None else f"at t = {when(known)}, where the ledger ends"
    return [
        ("scenario", found["scenario"]),
        ("status", found["status"]),
        ("agents", f"{found['agents']} in {found['dimension']} dimension{'s' * (found['dimension'] > 1)}"),
        ("engine", _engine(found["provenance"])),
        ("motion", _motion(found["provenance"])),
        (EARLIER, _earlier(found["provenance"])),
        ("time reached", when(found["time"]) if found["time"] is not None else ""),
        ("frames", str(found["provenance"].get(FRAMES, found["frames"]))),
        ("link switches", switches or found["provenance"].get("switches", "none")),
        ("other switches", others),
        (f"flocks {last}", _flocks(found) + earlier if "flocks" in found else ""),
        *([("of them wind around space", _wound(found["winding"]))] if "winding" in found else []),
        ("velocity spread", f"{found['velocity_spread']:.3e}{earlier}" if "velocity_spread" in found else ""),
        ("order", f"{found['order']:.6f}{earlier}" if "order" in found else ""),
        (
            "closest linked pair" if linked else "closest pair",
            f"{closest['distance']:.6g}, agents {pair}, t = {when(closest['time'])}{doubt}" if closest else "",
        ),
        ("energy", f"{energy['start']:.6g} at the start, {energy['end']:.6g} {ended}" if energy else ""),
        ("ledger residual", _residual(found)),
    ]


def tell_unfinished(run: Run, done: str) -> None:
    """Print on the error output how far a run is used that did not reach its end.

    Parameters
    ----------
    run
        The run.
    done
        What is done with it, as "drawn".
    """
    if run.finished:
        return
    start, end = run.scenario.start.t, run.scenario.t_end
    reached = (
        f"up to t = {time_text(run.t[-1], start, end, 6)} of {time_text(end, start, end, 6)}" if len(run.t) else ""
    )
    print(
        f"flocking: the run did not reach its end ({run.status}); {done} {reached or 'without frames'}.",
        file=sys.stderr,
    )
