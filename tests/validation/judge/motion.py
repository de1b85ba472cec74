"""Problems for the integrator of judge.c, and the motions that it finds."""

from __future__ import annotations

import ctypes
import math
import shutil
import subprocess
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

import numpy as np

from tests.validation.judge.formulas import ZERO, Node, Tape, force_over_distance, parsed

AGENTS, PAIRS, AXES, GRAPHS, TERMS, PIECES, NODES = 6, 15, 3, 2, 4, 6, 160
EVENTS, GRAZES = 4000, 64

STATUS = ("done", "too many switches", "too many steps", "not finite")
KINDS = ("break", "appear", "piece")


class CompilerMissing(Exception):
    """There is no C compiler; the message says how to get one."""


@dataclass(frozen=True)
class Piece:
    """Formulas of a term up to a distance.

    ``energy`` and ``drag`` are texts in ``r`` or ``s`` = r^2; ``force``, where given, is psi'(r) in the place of the
    slope of the energy, which then is not kept; ``longest`` bounds how far a pair may move in one step.
    """

    energy: str = ""
    border: float = math.inf
    force: str = ""
    drag: str = ""
    longest: float = 0.0


@dataclass(frozen=True)
class PairPart:
    """A pair term: formulas from the smallest distance on, over one of the graphs, and weights of its drag (N, N)."""

    pieces: tuple[Piece, ...]
    values: dict[str, float] = field(default_factory=dict)
    graph: int = 0
    weights: np.ndarray | None = None


@dataclass(frozen=True)
class Links:
    """A rule of links: given ones (``fixed``), or below ``appear`` new ones and none above ``leave``."""

    appear: float = 0.0
    leave: float = math.inf
    fixed: tuple[tuple[int, int], ...] | None = None


@dataclass(frozen=True)
class Follow:
    """A leader's velocity as texts in ``t``, its position at the start, and gains for each agent."""

    velocity: tuple[str, ...]
    values: dict[str, float]
    place: tuple[float, ...]
    position_gain: np.ndarray
    velocity_gain: np.ndarray
    acceleration_gain: np.ndarray


@dataclass(frozen=True)
class Problem:
    """All that fixes a motion; ``frames`` are times, ``shifts`` whether a moving frame of reference changes nothing."""

    q: np.ndarray
    p: np.ndarray
    start: float
    end: float
    frames: np.ndarray
    graphs: tuple[Links, ...]
    parts: tuple[PairPart, ...]
    masses: np.ndarray | None = None
    damping: np.ndarray | None = None
    follow: Follow | None = None
    shifts: bool = True


@dataclass(frozen=True)
class Switch:
    """A link that appears or breaks: when, since the start; the rate of the distance and its second derivative."""

    kind: str
    graph: int
    pair: tuple[int, int]
    time: float
    speed: float
    bend: float


@dataclass(frozen=True)
class Near:
    """A turn of a distance near a radius that is watched: negative gaps are below it."""

    graph: int
    pair: tuple[int, int]
    time: float
    gap: float


@dataclass(frozen=True)
class Approach:
    """Closest approach of a pair."""

    distance: float
    time: float
    pair: tuple[int, int]


@dataclass(frozen=True)
class Motion:
    """What the integrator found. Positions are relative to ``origin`` + ``drift`` (t - start)."""

    status: str
    steps: int
    time: float
    switches: tuple[Switch, ...]
    pieces: int
    grazes: tuple[Near, ...]
    closest_linked: Approach
    closest_unlinked: Approach
    spread: float
    speed: float
    rise: float
    energies: tuple[float, float]
    q: np.ndarray
    p: np.ndarray
    rest: np.ndarray
    origin: np.ndarray
    drift: np.ndarray
    links: tuple[frozenset[tuple[int, int]], ...]


class _Term(ctypes.Structure):
    _fields_ = (
        [("graph", ctypes.c_int), ("pieces", ctypes.c_int)]
        + [(name, ctypes.c_int * PIECES) for name in ("begin", "count", "force", "drag", "energy")]
        + [(name, ctypes.c_double * PIECES) for name in ("border", "longest")]
        + [("weight", ctypes.c_double * (AGENTS * AGENTS))]
    )


class _Problem(ctypes.Structure):
    _fields_ = (
        [(name, ctypes.c_int) for name in ("agents", "axes", "order", "graphs", "terms", "frames", "leader", "pad")]
        + [("shrink", ctypes.c_double), ("span", ctypes.c_double)]
        + [(name, ctypes.c_double * GRAPHS) for name in ("enter", "leave")]
        + [("linked", ctypes.c_int * (GRAPHS * PAIRS))]
        + [
            (name, ctypes.c_double * AGENTS)
            for name in ("mass", "damping", "position_gain", "velocity_gain", "acceleration_gain")
        ]
        + [("leader_row", ctypes.c_int * AXES), ("leader_begin", ctypes.c_int), ("leader_count", ctypes.c_int)]
        + [("term", _Term * TERMS)]
    )


class _Row(ctypes.Structure):
    _fields_ = [(name, ctypes.c_int) for name in ("operation", "first", "second", "pad")] + [("value", ctypes.c_double)]


_WHO = [(name, ctypes.c_double) for name in ("kind", "graph", "i", "j")]


class _Event(ctypes.Structure):
    _fields_ = [*_WHO, *((name, ctypes.c_longdouble) for name in ("time", "speed", "bend"))]


class _Graze(ctypes.Structure):
    _fields_ = [*_WHO, *((name, ctypes.c_longdouble) for name in ("time", "gap"))]


class _Outcome(ctypes.Structure):
    _fields_ = (
        [(name, ctypes.c_int) for name in ("status", "steps", "events", "grazes")]
        + [("event", _Event * EVENTS), ("graze", _Graze * GRAZES), ("closest", ctypes.c_longdouble * 8)]
        + [(name, ctypes.c_longdouble) for name in ("spread", "speed", "rise", "first_energy", "last_energy", "time")]
    )


class Judge:
    """The integrator, compiled into a folder with 80-bit numbers, or with 128-bit ones (33 digits).

    Raises
    ------
    CompilerMissing
        When there is no C compiler.
    """

    def __init__(self, folder: Path, *, digits: int = 18) -> None:
        compiler = shutil.which("cc") or shutil.which("gcc")
        if compiler is None:
            raise CompilerMissing("The judge needs a C compiler: install gcc (Debian: apt-get install gcc libc6-dev).")
        quad = digits > 18
        library = folder / f"judge{digits}.so"
        if not library.exists():
            new = library.with_suffix(f".{id(self)}")
            subprocess.run(
                [compiler, "-O2", "-shared", "-fPIC", *(["-DQUAD"] if quad else []), "-o", str(new),
                 str(Path(__file__).with_name("judge.c")), "-lm"],
                check=True,
            )  # fmt: skip
            new.replace(library)
        self._judge = ctypes.CDLL(str(library)).judge
        self.order, self.finer = (40, 48) if quad else (25, 31)
        self._outcome = _Outcome()

    def motion(self, problem: Problem, *, tighter: bool = False) -> Motion:
        """The motion; ``tighter`` with a higher order and shorter steps, for the error of the other."""
        given, tape, start, frames, origin, drift = _packed(problem)
        given.order, given.shrink = (self.finer, 0.6) if tighter else (self.order, 1.0)
        n, m = problem.q.shape
        states = np.zeros((len(frames) + 1, 2, n, m, 2), dtype=np.longdouble)
        self._judge(
            ctypes.byref(given), tape, *(x.ctypes.data_as(ctypes.c_void_p) for x in (start, frames, states)),
            ctypes.byref(self._outcome),
        )  # fmt: skip
        return _unpacked(self._outcome, states, origin, drift, problem)


def started_links(rule: Links, q: np.ndarray) -> frozenset[tuple[int, int]]:
    """Pairs that are linked at the start: closer than the radius, in exact arithmetic."""
    n = len(q)
    every = [(i, j) for i in range(n) for j in range(i + 1, n)]
    if rule.fixed is not None:
        return frozenset((min(e), max(e)) for e in rule.fixed)
    found = set()
    for i, j in every:
        square = sum((Fraction(float(a)) - Fraction(float(b))) ** 2 for a, b in zip(q[i], q[j], strict=True))
        if square < Fraction(rule.leave) ** 2:
            found.add((i, j))
    return frozenset(found)


def _place(nodes: list[Node], rows: list[tuple[int, int, int, float]]) -> tuple[int, int, list[int]]:
    tape = Tape()
    places = [tape.place(node) if node != ZERO else -1 for node in nodes]
    if len(tape.rows) > NODES:
        raise ValueError(f"{len(tape.rows)} rows are too many")
    begin = len(rows)
    rows += tape.rows
    return begin, len(tape.rows), places


def _packed(problem: Problem) -> tuple[_Problem, ctypes.Array, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    n, m = problem.q.shape
    given = _Problem(agents=n, axes=m, graphs=len(problem.graphs), terms=len(problem.parts))
    given.frames = len(problem.frames)
    given.span = problem.end - problem.start
    if Fraction(given.span) != Fraction(problem.end) - Fraction(problem.start):
        raise ValueError("the length of the run must be a float")
    pairs = [(i, j) for i in range(n) for j in range(i + 1, n)]
    for g, rule in enumerate(problem.graphs):
        given.enter[g] = 0.0 if rule.fixed is not None else rule.appear
        given.leave[g] = math.inf if rule.fixed is not None else rule.leave
        linked = started_links(rule, problem.q)
        for e, pair in enumerate(pairs):
            given.linked[g * PAIRS + e] = pair in linked
    rows: list[tuple[int, int, int, float]] = []
    for number, part in enumerate(problem.parts):
        term = given.term[number]
        term.graph, term.pieces = part.graph, len(part.pieces)
        weights = np.ones((n, n)) if part.weights is None else part.weights
        for i in range(n):
            for j in range(n):
                term.weight[i * AGENTS + j] = weights[i, j]
        for k, piece in enumerate(part.pieces):
            energy = parsed(piece.energy, part.values) if piece.energy else ZERO
            if piece.force:
                force, energy = parsed(f"({piece.force})/r", part.values), ZERO
            else:
                force = force_over_distance(energy)
            drag = parsed(piece.drag, part.values) if piece.drag else ZERO
            term.begin[k], term.count[k], places = _place([force, drag, energy], rows)
            term.force[k], term.drag[k], term.energy[k] = places
            term.border[k], term.longest[k] = piece.border, piece.longest
    for i in range(n):
        given.mass[i] = 1.0 if problem.masses is None else problem.masses[i]
        given.damping[i] = 0.0 if problem.damping is None else problem.damping[i]
    wide = np.longdouble
    origin = np.asarray(problem.q[0], dtype=wide)
    shifts = problem.shifts and problem.follow is None and given.damping[0] == 0.0
    drift = np.asarray(problem.p[0], dtype=wide) if shifts else np.zeros(m, dtype=wide)
    place = np.zeros(m, dtype=wide)
    if (follow := problem.follow) is not None:
        given.leader = 1
        velocity = [parsed(x, follow.values) for x in follow.velocity]
        given.leader_begin, given.leader_count, places = _place(velocity, rows)
        if -1 in places:
            raise ValueError("a leader's velocity must not be the constant 0; write 0*t")
        for k in range(m):
            given.leader_row[k] = places[k]
        for i in range(n):
            given.position_gain[i] = follow.position_gain[i]
            given.velocity_gain[i] = follow.velocity_gain[i]
            given.acceleration_gain[i] = follow.acceleration_gain[i]
        place = np.asarray(follow.place, dtype=wide) - origin
        if problem.start != 0.0:
            raise ValueError("a leader's clock starts at 0")
    start = np.concatenate([(problem.q.astype(wide) - origin).ravel(), (problem.p.astype(wide) - drift).ravel(), place])
    tape = (_Row * max(1, len(rows)))(*(_Row(a, b, c, 0, value) for a, b, c, value in rows))
    frames = np.asarray(problem.frames, dtype=wide) - wide(problem.start)
    return given, tape, start, frames, origin, drift


def _unpacked(found: _Outcome, states: np.ndarray, origin: np.ndarray, drift: np.ndarray, problem: Problem) -> Motion:
    every = [found.event[k] for k in range(min(found.events, EVENTS))]
    switches = tuple(
        Switch(KINDS[int(x.kind)], int(x.graph), (int(x.i), int(x.j)), x.time, x.speed, x.bend)
        for x in every
        if int(x.kind) < 2
    )
    grazes = tuple(
        Near(int(x.graph), (int(x.i), int(x.j)), x.time, x.gap) for x in (found.graze[k] for k in range(found.grazes))
    )
    approaches = [
        Approach(c[0], c[1], (int(c[2]), int(c[3]))) if c[2] >= 0 else Approach(math.inf, math.nan, (-1, -1))
        for c in (found.closest[4 * k : 4 * k + 4] for k in range(2))
    ]
    history = [started_links(problem.graphs[0], problem.q)]
    for x in switches:
        if x.graph == 0:
            history.append(history[-1] ^ {x.pair})
    return Motion(
        STATUS[found.status], found.steps, found.time, switches, len(every) - len(switches), grazes, *approaches,
        found.spread, found.speed, found.rise, (found.first_energy, found.last_energy),
        states[:, 0, :, :, 0], states[:, 1, :, :, 0], states[..., 1], origin, drift, tuple(history),
    )  # fmt: skip
