"""What may happen to agents during a run: processes that are killed or begin anew, and radio links that are cut."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from flocking.errors import InvalidInput
from flocking.model.checks import integer, number


@dataclass(frozen=True)
class Kill:
    """The process of an agent is killed.

    Parameters
    ----------
    agent
        The agent.
    time
        When, from the start.
    """

    agent: int
    time: float


@dataclass(frozen=True)
class Restart:
    """The process of an agent begins anew and has no samples; one that still runs is ended first.

    Parameters
    ----------
    agent
        The agent.
    time
        When, from the start.
    """

    agent: int
    time: float


@dataclass(frozen=True)
class Cut:
    """The radio of an agent is cut: samples that it or others take meanwhile do not pass.

    Parameters
    ----------
    agent
        The agent.
    time, until
        From when until when, from the start; the end does not belong to it.
    """

    agent: int
    time: float
    until: float


Fault = Kill | Restart | Cut


def in_order(faults: Sequence[Fault]) -> list[Kill | Restart]:
    """What happens to processes in the order of its times; of one time, in the order given.

    Parameters
    ----------
    faults
        The faults, of any kind.
    """
    return sorted((fault for fault in faults if not isinstance(fault, Cut)), key=lambda fault: fault.time)


def check_faults(faults: tuple[Fault, ...], n: int, duration: float) -> None:
    """Check that faults are of agents that there are, and happen during the run.

    Parameters
    ----------
    faults
        The faults.
    n
        Number of agents.
    duration
        Seconds from the start to the end of the run.

    Raises
    ------
    InvalidInput
        When one is not or does not, or kills an agent whose process has ended.
    """
    for fault in faults:
        name = type(fault).__name__
        if integer(name, "agent", fault.agent, least=0) >= n:
            raise InvalidInput(name, "agent", f"must be below the number of agents, {n}", fault.agent)
        if number(name, "time", fault.time, least=0.0) >= duration:
            raise InvalidInput(
                name, "time", f"must be before the end of the run, {duration:.9g} s after its start", fault.time
            )
        if isinstance(fault, Cut):
            number(name, "until", fault.until, above=fault.time)
    ended: set[int] = set()
    for fault in in_order(faults):
        if isinstance(fault, Kill) and fault.agent in ended:
            raise InvalidInput(
                "Kill", "agent", f"must not have ended before, at {fault.time:.9g} s", fault.agent,
                "Let it begin anew in between, by Restart.",
            )  # fmt: skip
        (ended.add if isinstance(fault, Kill) else ended.discard)(fault.agent)


def fault_of(kind: type[Fault], text: str) -> Fault:
    """A fault from text: ``3@1.5``, for a cut ``3@1.5-2.5``.

    Parameters
    ----------
    kind
        Which fault.
    text
        The text.

    Raises
    ------
    InvalidInput
        When the text is not of this form.
    """
    found = re.fullmatch(r"(\d{1,9})@(\d+(?:\.\d+)?)(?:-(\d+(?:\.\d+)?))?", text)
    if found is None or (found[3] is not None) != (kind is Cut):
        form = "AGENT@TIME-UNTIL, as 3@1.5-2.5" if kind is Cut else "AGENT@TIME, as 3@1.5"
        raise InvalidInput("nodes", kind.__name__.lower(), f"must be {form}", text)
    if kind is Cut:
        return Cut(int(found[1]), float(found[2]), float(found[3]))
    return kind(int(found[1]), float(found[2]))  # type: ignore[call-arg]
