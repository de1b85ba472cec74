"""Bounds of the errors of an exported law in single precision, computed from the state and the source before it is run.

The source is evaluated in intervals, see `source_evaluation`: they hold the exact force and that of single precision,
so that their width bounds the difference.
"""

from __future__ import annotations

from dataclasses import dataclass

from tests.engine.c_export import exact_numbers, single_intervals
from tests.engine.c_export.building import CODES
from tests.engine.c_export.single_intervals import Single, hull
from tests.engine.c_export.source_evaluation import Law


@dataclass(frozen=True)
class Enclosure:
    """What a call may give: its codes, and intervals of the numbers, shape (m,), which are None without a force.

    `undecided` says whether a branch was gone both ways.
    """

    codes: frozenset[int]
    numbers: list[Single] | None
    undecided: bool

    @property
    def widths(self):
        """Bounds of the errors, shape (m,)."""
        return [x.hi - x.lo for x in self.numbers]


def _joined(found):
    """The hull of what several ways give."""
    numbers = None
    for code, u in found:
        if code == CODES["OK"]:
            numbers = u if numbers is None else [hull(a, b) for a, b in zip(numbers, u, strict=True)]
    return Enclosure(frozenset(code for code, _ in found), numbers, len(found) > 1)


def point(x):
    """A number of single precision."""
    return Single(x, x)


class _Evaluated:
    """Calls of an exported law, evaluated with numbers of a kind."""

    def __init__(self, files, numbers, number):
        self.law, self.number = Law(files, numbers), number

    def _vector(self, vector):
        return [self.number(float(x)) for x in vector]

    def _force(self, agent, q, p, others, now):
        """Code and force at a start, from what is known of others."""
        memory, u = self.law.make("memory"), self._vector([0.0] * len(q))
        memory.agent, memory.count = agent, len(others)
        for k, (j, (x, v)) in enumerate(sorted(others.items())):
            known, memory.order[k] = memory.known[k], k
            known.stamp, known.sender, known.q, known.p = now, j, self._vector(x), self._vector(v)
            memory.used[k // 32] |= 1 << k % 32
        return self.law.call("control", memory, now, self._vector(q), self._vector(p), u), u

    def _velocity(self, agent, p, u):
        """Code and velocity that is set."""
        memory, v = self.law.make("memory"), self._vector([0.0] * len(p))
        memory.agent = agent
        return self.law.call("velocity", memory, p, u, v), v


class Bounds(_Evaluated):
    """Enclosures of the calls of an exported law of single precision, from its files.

    Its methods raise `Unbounded` where a number may be infinite by the intervals, or they decide too little.
    """

    def __init__(self, files):
        super().__init__(files, single_intervals, point)

    def force(self, agent, q, p, others, now=0):
        """Force at a start; all numbers are of single precision."""
        return _joined(self.law.outcomes(lambda: self._force(agent, q, p, others, now)))

    def velocity(self, agent, p, u):
        """Velocity that is set from numbers of the agent's own and of a force, all of single precision."""
        return _joined(self.law.outcomes(lambda: self._velocity(agent, self._vector(p), self._vector(u))))


class Exact(_Evaluated):
    """Calls of an exported law of double precision, from its files, as if its numbers were exact: 50 digits."""

    def __init__(self, files):
        super().__init__(files, exact_numbers, exact_numbers.literal)

    def force(self, agent, q, p, others, now=0):
        """Code and force at a start, shape (m,)."""
        (found,) = self.law.outcomes(lambda: self._force(agent, q, p, others, now))
        return found

    def velocity(self, agent, p, u):
        """Code and velocity that is set, shape (m,)."""
        (found,) = self.law.outcomes(lambda: self._velocity(agent, self._vector(p), self._vector(u)))
        return found
