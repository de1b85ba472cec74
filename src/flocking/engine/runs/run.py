"""Runs: the results of simulations."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Array, Reals, Records
from flocking.engine.runs.fidelity import UNSTATED, Fidelity
from flocking.engine.runs.message_log import GRAPHS_CHANGED, MessageLog, keeping_logs, nanosecond_of
from flocking.errors import InvalidInput
from flocking.formula.safe_digits import given_text, time_text
from flocking.model.graphs.connectivity import Links
from flocking.model.law import Scenario
from flocking.model.state import State
from flocking.model.world.information import Delayed
from flocking.model.world.times import PER_SECOND

SWITCH_FIELDS = np.dtype(
    [
        ("time", "f8"), ("i", "i8"), ("j", "i8"), ("kind", "U10"), ("graph", "i8"), ("speed", "f8"),
        ("tangential", "?"), ("time_error", "f8"), ("speed_error", "f8"),
    ]
)  # fmt: skip
"""Fields of a recorded switch: ``kind`` is ``appear``, ``break`` or ``kink`` of a pair of agents, or ``obstacle``,
where agent ``i`` comes within range of obstacle ``j`` or leaves it and ``graph`` is the group of obstacles; ``speed``
is the rate of change of the distance as it crosses, negative when closing, or where an agent crosses a side of a field
of view how fast it leaves across that, negative when it comes in; ``tangential`` marks a crossing at which it vanishes;
the errors of its time and of its speed are NaN where they are not known."""

SwitchRow = tuple[float, int, int, str, int, float, bool, float, float]
"""A recorded switch, fields `SWITCH_FIELDS`."""

TANGENTIAL = 1e-6
"""A crossing slower than this fraction of the relative speed is flagged as tangential."""


def is_tangential(speed: float, relative: float) -> bool:
    """Whether a crossing with this ``speed`` is tangential, ``relative`` being the whole relative speed, or 0."""
    return abs(speed) <= TANGENTIAL * relative


FRAMES = "frames"
"""Name in the provenance of a run of which frames it holds, in words, where most are left out."""

DOUBT_FIELDS = np.dtype(
    [
        ("begin", "f8"), ("end", "f8"), ("time", "f8"), ("i", "i8"), ("j", "i8"), ("kind", "U10"), ("graph", "i8"),
        ("what", "U10"), ("margin", "f8"), ("error", "f8"),
    ]
)  # fmt: skip
"""Fields of a switch that the integration error leaves open. ``kind`` is ``near miss``: a pair came within ``error`` of
the distance at which it would have switched, ``margin`` short of it at ``time``, some time between ``begin`` and
``end``; or ``switch``: it switched at ``time`` but went no further than ``error`` beyond. ``what`` is the kind of the
switch as in `SWITCH_FIELDS`, and so are ``j`` and ``graph`` where it is ``obstacle``, or where it is ``kink`` of the
force of an obstacle."""

DoubtRow = tuple[float, float, float, int, int, str, int, str, float, float]
"""A switch that the integration error leaves open, fields `DOUBT_FIELDS`."""


class LedgerRow(NamedTuple):
    """A row of the ledger: energies at a time, and work, dissipation, supply, jumps and departure until then.

    ``departed`` is the work of what acted beyond the law on the true present state.
    """

    time: float
    energy: float
    kinetic: float
    work: float
    dissipated: float
    supplied: float
    jumped: float
    departed: float = 0.0


TRACE_FIELDS = np.dtype([(name, "f8") for name in LedgerRow._fields])
"""Fields of the ledger, one `LedgerRow` per step."""

FIRST_QUANTITIES = len(LedgerRow._fields) - len(LedgerRow._field_defaults)
"""Fields of a row of the ledger before `LedgerRow.departed` was added; rows may still leave out those that follow."""


def ledger_of(rows: Iterable[tuple[float, ...]]) -> Records:
    """Rows as a ledger, fields `TRACE_FIELDS`.

    Parameters
    ----------
    rows
        Rows as `LedgerRow`, or tuples that leave out fields with a default.
    """
    given = list(rows)
    if set(map(len, given)) - {len(LedgerRow._fields)}:
        given = [LedgerRow(*row) for row in given]
    return np.array(given, dtype=TRACE_FIELDS)


OBSERVED_FIELDS = np.dtype(
    [
        ("time", "f8"), ("order", "f8"), ("speed", "f8"), ("spread", "f8"), ("flocks", "i8"), ("density", "f8"),
        ("neighbours", "f8"), ("length", "f8"), ("defect", "f8"), ("closest", "f8"),
    ]
)  # fmt: skip
"""Fields of an observation: polarisation, mean speed, largest deviation from the mean velocity, number of flocks,
share of the agents in the largest one, mean number of neighbours, mean length of a link, standard deviation of the
lengths over their mean (0 in a perfect lattice), and the smallest distance of linked agents. Lengths are those of all
ordered pairs: a link counts twice where it is mutual, once where it is one-way."""

OF_VELOCITIES = ("order", "speed", "spread")
"""Those that are made of velocities: NaN for agents of order 1, which have none of their own."""


@dataclass(frozen=True)
class Closest:
    """Closest approach of two agents over an entire run, certified on the engine's own solution.

    Parameters
    ----------
    distance
        The smallest distance; infinite when there was no such pair.
    pair
        The two agents.
    error
        Bound on the error of the distance, from the error of the integration; NaN where it is not known.
    """

    distance: float = np.inf
    time: float = np.nan
    pair: tuple[int, int] = (-1, -1)
    error: float = np.nan

    def __eq__(self, other: object) -> bool:
        """Equal in all fields; two NaN, as where there was no such pair, count as equal."""
        if not isinstance(other, Closest):
            return NotImplemented
        values = ((self.distance, other.distance), (self.time, other.time), (self.error, other.error))
        return self.pair == other.pair and all(a == b or (a != a and b != b) for a, b in values)

    def __hash__(self) -> int:
        return hash((self.distance, self.pair))


@dataclass(frozen=True)
class Largest:
    """Largest value of a quantity over an entire run, certified on the engine's own solution.

    Parameters
    ----------
    agents
        The agent, or the two agents, that had it.
    error
        Bound on the error of the value, from the error of the integration.
    """

    value: float = -np.inf
    time: float = np.nan
    agents: tuple[int, ...] = ()
    error: float = 0.0


@dataclass(frozen=True, eq=False)
class Accuracy:
    """What is known of the errors of a run.

    Parameters
    ----------
    frames
        Estimated error of any position and of any velocity at each frame, shape (F, 2). At a frame before a switch, by
        less than the error of its time, the true motion may have switched already: that is not in it.
    doubts
        Switches that the error leaves open, fields `DOUBT_FIELDS`.
    largest
        Largest values over the whole run: ``speed``, ``spread`` (distance of a velocity from the mean one),
        ``diameter`` (distance of two agents), ``ledger`` (the part of the residual of the energy ledger that the
        integration error explains, added up over the steps) and, with a leader of constant velocity,
        ``relative speed``.
    known_until
        When the error became so large, or a switch in doubt decided so much, that nothing that comes later is known.
    """

    frames: Array
    doubts: Records
    largest: dict[str, Largest]
    known_until: float = np.inf


@dataclass(frozen=True, eq=False)
class FineSamples:
    """The computed solution at several times in every step of the integrator, for curves that miss no extremum.

    Parameters
    ----------
    t
        Times, ascending, shape (K,).
    q, p
        Positions and velocities, shape (K, N, m).
    """

    t: Array
    q: Reals
    p: Reals

    def until(self, end: float) -> FineSamples:
        """Those not later than ``end``."""
        count = int(np.searchsorted(self.t, end, side="right"))
        return FineSamples(self.t[:count], self.q[:count], self.p[:count])


@dataclass(frozen=True, eq=False)
class Run:
    """Frames, switches and ledger of a simulation, with its scenario and provenance.

    Parameters
    ----------
    scenario
        What was simulated.
    t
        Frame times, shape (F,).
    q, p
        Frame positions and velocities, shape (F, N, m).
    links
        Link matrices of the law's graph at the frames, shape (F, N, N); (F, 0, 0) where a large run leaves them out.
    switches
        Switches in time order, fields `SWITCH_FIELDS`.
    trace
        The energy ledger at every step, fields `TRACE_FIELDS`.
    closest_linked, closest_unlinked
        Closest pair ever, among linked and among unlinked pairs.
    status
        ``"finished"``, or why the run stopped early.
    provenance
        Versions, engine, tolerances, seed, counts and times.
    observables
        What an engine for large groups observed at the frame times, fields `OBSERVED_FIELDS`; None where it was not
        asked to.
    fine
        The solution between frames, where ``fine=True`` made the exact engine record it; it is not stored on disk.
    accuracy
        What is known of its errors; None where nothing is.
    fidelity
        The account that it gives of itself: audits read it, and leave open what it does not know.
    rank
        Number of the process that holds it; of several that compute a run together the others than 0 hold no frames.
    columns
        Further columns of the agents at the frames by name, shape (F, N, width) each, see
        `flocking.model.bodies.body.Body.columns`.
    log
        What agents used when they acted, or from when on; None where agents know the present at every moment.
    """

    scenario: Scenario
    t: Array
    q: Reals
    p: Reals
    links: NDArray[np.bool_]
    switches: Records
    trace: Records
    closest_linked: Closest = field(default_factory=Closest)
    closest_unlinked: Closest = field(default_factory=Closest)
    status: str = "finished"
    provenance: dict[str, object] = field(default_factory=dict)
    observables: Records | None = None
    fine: FineSamples | None = None
    accuracy: Accuracy | None = None
    fidelity: Fidelity = UNSTATED
    columns: Mapping[str, Array] = field(default_factory=dict)
    rank: int = 0
    log: MessageLog | None = None

    @property
    def certain(self) -> NDArray[np.bool_]:
        """Which of the switches are beyond doubt: the pair went further than the error, shape (K,)."""
        known = np.isfinite(self.switches["time_error"])
        if self.accuracy is None:
            return np.zeros(len(self.switches), dtype=bool)
        doubts = self.accuracy.doubts[self.accuracy.doubts["kind"] == "switch"]
        names = ("time", "i", "j", "graph")
        doubtful = {(*(row[name] for name in names), str(row["what"])) for row in doubts}
        certain = [(*(row[name] for name in names), str(row["kind"])) not in doubtful for row in self.switches]
        return np.asarray(known & np.array(certain, dtype=bool))

    @property
    def n(self) -> int:
        """Number of agents."""
        return int(self.q.shape[1])

    def __repr__(self) -> str:
        """In one line, without the arrays."""
        name = f"{self.scenario.name!r}, " if self.scenario.name else ""
        first, last = (time_text(self.t[k], self.t[0], self.t[-1], 6) for k in (0, -1)) if len(self.t) else ("", "")
        span = f"t = {first} to {last}" if first else "none stored"
        size = f"{self.n} agents, {len(self.t)} frames ({span}), {len(self.switches)} switches"
        return f"<Run {name}{size}, {self.status}>"

    def _repr_html_(self) -> str:
        """In a notebook: one line, and folded the scenario and where the run comes from."""
        from html import escape

        from flocking.formula.markup.cells import folded, rows_table

        origin = rows_table(("what", "value"), [(escape(k), escape(str(v))) for k, v in self.provenance.items()])
        return folded(repr(self).strip("<>"), self.scenario._repr_html_() + origin)

    @property
    def finished(self) -> bool:
        """Whether the run reached its end."""
        return self.status == "finished"

    def until(self, end: float) -> Run:
        """The same run with its frames, fine samples, switches, observations and ledger up to time ``end`` only.

        Its closest approaches and largest values remain those of the entire run. Of a finished run its status is that
        it was cut, so that audits conclude nothing of later times from it.
        """
        if not len(self.t) or self.t[-1] <= end:
            return self
        return self.cut(int(np.searchsorted(self.t, end, side="right")), end)

    def cut(self, count: int, end: float | None = None) -> Run:
        """The same run with its first ``count`` frames only, all else up to ``end``: the last of these by default."""
        if end is None:
            end = float(self.t[count - 1]) if count else self.scenario.start.t
        known, seen = self.accuracy, self.observables
        return replace(
            self,
            status=f"cut at t = {given_text(end)}" if self.finished else self.status,
            t=self.t[:count],
            q=self.q[:count],
            p=self.p[:count],
            links=self.links[:count],
            columns={name: values[:count] for name, values in self.columns.items()},
            switches=self.switches[self.switches["time"] <= end],
            trace=self.trace[self.trace["time"] <= end],
            fine=self.fine.until(end) if self.fine is not None else None,
            log=None if self.log is None else self.log.until(nanosecond_of(end - self.scenario.start.t)),
            accuracy=known if known is None else replace(known, frames=known.frames[:count]),
            observables=seen if seen is None else seen[seen["time"] <= end],
        )

    def state(self, frame: int) -> State:
        """State at a stored frame, with its links."""
        links = self.links[frame] if self.links.shape[1:] == (self.n, self.n) else None
        columns = {name: values[frame] for name, values in self.columns.items()}
        return State(self.q[frame], self.p[frame], float(self.t[frame]), links, columns)

    def links_at(self, frame: int) -> Links:
        """Link matrix at a stored frame, shape (N, N)."""
        return np.asarray(self.links[frame])

    def known_links_at(self, frame: int) -> Links:
        """Links by what agents knew at a stored frame: whose samples each used when it last acted.

        They are directed, and of the time before the controls of that instant, as the frame is. `links_at` has the true
        links.

        Parameters
        ----------
        frame
            Number of the frame.

        Returns
        -------
        array
            Shape (graphs, N, N); entry (g, i, j) is whether i used a sample of j under graph g of the law.

        Raises
        ------
        InvalidInput
            When the run has no log of what agents used, or its graphs were replaced later.
        """
        if self.log is None:
            raise InvalidInput(
                "Run", "known_links_at", "needs a log of what agents used",
                f"a run of the engine {self.fidelity.engine!r}",
                keeping_logs(self.provenance),
            )  # fmt: skip
        scenario, start = self.scenario, self.scenario.start
        later = self.provenance.get(GRAPHS_CHANGED)
        if isinstance(later, float) and self.t[frame] <= later:
            raise InvalidInput(
                "Run", "known_links_at",
                f"needs a frame after {given_text(later)}, when graphs of the law were replaced",
                float(self.t[frame]), "The run states its last law alone.",
            )  # fmt: skip
        # Half a nanosecond off a whole one, where acts are: the time of a frame is rounded.
        instant = (float(self.t[frame]) - start.t) * PER_SECOND - 0.5
        # What is delayed is known at the start, too: nobody acts at instants.
        instant = max(instant, 0.5) if isinstance(scenario.information, Delayed) else instant
        return self.log.known_links(instant, scenario.links_at_start)

    @property
    def residual(self) -> Array:
        """What the ledger leaves unexplained at every step: H - H(0) + dissipated - supplied - jumped - departed.

        Empty where the run has no ledger.
        """
        trace = self.trace
        if not len(trace):
            return np.zeros(0)
        moved = trace["energy"] - trace["energy"][0] + trace["dissipated"] - trace["supplied"] - trace["jumped"]
        return np.asarray(moved - trace["departed"])

    @property
    def turnover(self) -> float:
        """Total energy moved: the sum over steps of absolute work, dissipation, supply and departure."""
        moved: list[Array] = [self.trace[name] for name in ("work", "dissipated", "supplied", "departed")]
        return float(sum(np.abs(np.diff(each)).sum() for each in moved))

    @property
    def closest(self) -> Closest:
        """Closest pair ever, linked or not."""
        return min(self.closest_linked, self.closest_unlinked, key=lambda c: c.distance)
