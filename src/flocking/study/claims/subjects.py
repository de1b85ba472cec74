"""Subject, witness and finality of a measured statement, declared beside the function that measures it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeVar

from flocking.study.evidence import Evidence

ATTRIBUTE = "statement_about"


class Subject(StrEnum):
    """What a statement is about; reports draw a picture of it beside the claim."""

    LEDGER = "ledger"
    SPREAD = "spread"
    LEADER = "leader"
    VELOCITIES = "velocities"
    CONNECTIVITY = "connectivity"
    LINKS = "links"
    CLOSEST = "closest"
    NET = "net"


@dataclass(frozen=True)
class Witness:
    """A time of a run and agents.

    Parameters
    ----------
    time
        The time.
    agents
        The agents; empty when none in particular are concerned.
    """

    time: float
    agents: tuple[int, ...] = ()

    @classmethod
    def pair(cls, time: float, i: int, j: int) -> Witness:
        """Two agents ``i`` and ``j`` at a ``time``."""
        return cls(float(time), (int(i), int(j)))


Finder = Callable[[Evidence], Witness]
"""Finds the time and the agents at which a statement fails; called only where one fails."""


@dataclass(frozen=True)
class About:
    """Properties of a statement besides its measure.

    Parameters
    ----------
    subject
        What it is about.
    witness
        Finds time and agents of a failure; None where there are none in particular.
    lasting
        Whether a failure is final; else it is pending until the end.
    while_connected
        Whether theorems conclude it only for graphs that stay connected.
    with_errors
        Whether its measure has the errors of the motion, or needs none: else they are added where a run states none.
    at_end
        Whether it is about the end of the scenario: before it what is true of one moment is not decided.
    """

    subject: Subject = Subject.NET
    witness: Finder | None = None
    lasting: bool = False
    while_connected: bool = False
    with_errors: bool = False
    at_end: bool = False


Measuring = TypeVar("Measuring", bound=Callable[..., object])


def about(
    subject: Subject, witness: Finder | None = None, *, lasting: bool = False, while_connected: bool = False,
    with_errors: bool = False, at_end: bool = False,
) -> Callable[[Measuring], Measuring]:  # fmt: skip
    """Decorator that declares what the statement measured by a function is about; see `About`.

    Parameters
    ----------
    subject, witness, lasting, while_connected, with_errors, at_end
        As in `About`.
    """
    properties = About(subject, witness, lasting, while_connected, with_errors, at_end)

    def declare(measure: Measuring) -> Measuring:
        setattr(measure, ATTRIBUTE, properties)
        return measure

    return declare


def about_of(measure: Callable[..., object]) -> About:
    """What the statement that ``measure`` measures is about; the net where nothing is declared."""
    found = getattr(measure, ATTRIBUTE, None)
    return found if isinstance(found, About) else About()
