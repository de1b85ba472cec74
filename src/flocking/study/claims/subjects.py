"""What a measured statement speaks of, who witnesses it, whether it lasts: said beside the function that measures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeVar

from flocking.study.evidence import Evidence

ATTRIBUTE = "statement_about"


class Subject(StrEnum):
    """What a statement speaks of: a picture of it stands beside the claim."""

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
    """A moment of a run and the agents it is about.

    Parameters
    ----------
    time
        When.
    agents
        Who; empty when it is about no one in particular.
    """

    time: float
    agents: tuple[int, ...] = ()

    @classmethod
    def pair(cls, time: float, i: int, j: int) -> Witness:
        """Two agents ``i`` and ``j``, numbers of any kind."""
        return cls(float(time), (int(i), int(j)))


Finder = Callable[[Evidence], Witness]
"""Finds the moment and the agents that broke a statement; it is asked only where one is broken."""


@dataclass(frozen=True)
class About:
    """What is known of a statement besides its measure.

    Parameters
    ----------
    subject
        What it speaks of.
    witness
        Finds who broke it; None where nothing points at anyone.
    lasting
        Whether it speaks of every moment: once it fails nothing mends it. Else it is pending until the end.
    while_connected
        Whether theorems conclude it of graphs that stay connected alone.
    """

    subject: Subject = Subject.NET
    witness: Finder | None = None
    lasting: bool = False
    while_connected: bool = False


Measuring = TypeVar("Measuring", bound=Callable[..., object])


def about(
    subject: Subject, witness: Finder | None = None, *, lasting: bool = False, while_connected: bool = False
) -> Callable[[Measuring], Measuring]:
    """Decorator of a function that measures a statement, which says what the statement is about; see `About`.

    Parameters
    ----------
    subject, witness, lasting, while_connected
        As in `About`.
    """
    told = About(subject, witness, lasting, while_connected)

    def tell(measure: Measuring) -> Measuring:
        setattr(measure, ATTRIBUTE, told)
        return measure

    return tell


def about_of(measure: Callable[..., object]) -> About:
    """What a statement is about, by the function that measures it; the net where nothing is said.

    Parameters
    ----------
    measure
        The function.
    """
    found = getattr(measure, ATTRIBUTE, None)
    return found if isinstance(found, About) else About()
