"""The exceptions of this library: each names the parameter, its owner, the rule, the value and the usual fix."""

from __future__ import annotations

import tokenize
from collections.abc import Mapping
from typing import Any

LONGEST_VALUE = 120
"""Characters of a value in a message."""

HEADER_ERRORS = (ValueError, SyntaxError, RecursionError, tokenize.TokenError)
"""What NumPy raises for headers of arrays that somebody crafted: it reads them as tokens, then as a literal."""


def said(value: object) -> str:
    """A value as text for a message: a NumPy number as a number, an array as a list."""
    try:
        text = repr(_plain(value))
    except ValueError:  # Python prints no number of thousands of digits
        text = "a number with thousands of digits"
    except Exception:  # what somebody else's objects raise, or a list that contains itself
        text = f"an object of type {type(value).__name__} that cannot be printed"
    return text if len(text) <= LONGEST_VALUE else text[: LONGEST_VALUE - 3] + "..."


def escaped(text: str, kept: str = "") -> str:
    """A text in which what cannot be printed is written as Python does, but for the characters ``kept``."""
    return "".join(x if x.isprintable() or x in kept else x.encode("unicode_escape").decode() for x in text)


def _plain(value: object) -> object:
    if isinstance(value, dict):
        return {_plain(name): _plain(entry) for name, entry in value.items()}
    for kind in (list, tuple, set, frozenset):
        if type(value) is kind:
            return kind(map(_plain, value))
    to_list = getattr(value, "tolist", None)
    if callable(to_list) and type(value).__module__ == "numpy":
        return to_list()
    return value


class FlockingError(Exception):
    """Base of every error raised on purpose by this library; it passes from a worker process as it is."""

    def __reduce__(self) -> tuple[object, ...]:
        return _restored, (type(self), self.args, self._state())

    def _state(self) -> dict[str, object]:
        return dict(vars(self))


def _restored(kind: type[FlockingError], args: tuple[object, ...], state: dict[str, object]) -> FlockingError:
    """An error with its message, without the arguments of its constructor."""
    error = kind.__new__(kind)
    error.args = args
    vars(error).update(state)
    return error


class InvalidInput(FlockingError, ValueError):
    """A value given by the user breaks a rule of the part that owns it.

    Parameters
    ----------
    owner
        The part or function that owns the parameter, for example ``"Hysteresis"``.
    parameter
        Name of the offending parameter.
    rule
        What must hold, in words.
    value
        The value that was given.
    fix
        The usual way out.
    """

    def __init__(self, owner: str, parameter: str, rule: str, value: object, fix: str = "") -> None:
        self.owner = owner
        self.parameter = parameter
        self.rule = rule
        self.value = value
        self.fix = fix
        given = said(value)
        message = f"{owner}: {parameter} {rule}; got {given}."
        super().__init__(f"{message} {fix}" if fix else message)

    def _state(self) -> dict[str, object]:
        # Any object may have been given, also one that cannot be sent.
        value = self.value if isinstance(self.value, str | int | float | bool | None) else said(self.value)
        return {**vars(self), "value": value}


class SuspectInput(UserWarning):
    """A value given by the user is allowed and probably not intended."""


class HardlyAdvances(UserWarning):
    """A run goes on with steps so short that it may never come to its end."""


class FormulaError(InvalidInput):
    """A text formula that the grammar does not admit."""


class SimulationError(FlockingError):
    """A run that could not go on; ``run`` holds what was computed until then, a `flocking.engine.runs.run.Run`.

    Parameters
    ----------
    message
        What happened and the usual fix.
    time
        Simulation time at which the run stopped.
    agents
        Indices of the agents involved, where known.
    """

    def __init__(self, message: str, *, time: float, agents: tuple[int, ...] = ()) -> None:
        self.time = time
        self.agents = agents
        self.run: Any = None
        where = f" (t = {time:.9g}" + (f", agents {said(list(agents))}" if agents else "") + ")"
        super().__init__(message + where)


class StepTooSmall(SimulationError):
    """The adaptive step shrank to rounding: a singularity or a stiff formula was met."""


class NotFinite(SimulationError):
    """A position, velocity or force became NaN or infinite."""


class OutOfPrecision(SimulationError):
    """Positions or times whose floating-point spacing is too coarse for the links or the tolerance."""


class Chattering(SimulationError):
    """A link switches on and off without time passing: a sliding mode in Filippov's sense."""


class LinkLost(SimulationError):
    """A link whose potential is infinite at the break radius was lost, or comes nearer to it than positions resolve.

    The step was too large, a limit acted, or bodies follow late.
    """


class StepTooLarge(SimulationError):
    """A fixed time step that is too large for the motion; ``would_do`` is a step that is small enough."""

    would_do: float = 0.0


class LawNotObeyed(SimulationError):
    """Forces or powers of an engine that differ from those of the declared law by more than rounding."""


class TooCrowded(SimulationError):
    """So many agents within one radius that the neighbour lists would exceed their memory limit."""


class EngineFailed(SimulationError):
    """An engine failed with an error of its own, which is its cause; a saved run can go on from its last commit."""


class RunsFailed(FlockingError):
    """Some of many runs could not go on; the others are complete.

    Parameters
    ----------
    runs
        All runs in the order of their scenarios; of a failed one what was computed until then, None if that is nothing.
    failures
        The error of each failed run, by its number.
    """

    def __init__(self, runs: tuple[Any, ...], failures: Mapping[int, SimulationError]) -> None:
        self.runs, self.failures = runs, dict(failures)
        first = min(self.failures)
        super().__init__(
            f"{len(self.failures)} of {len(runs)} runs could not go on; the first is scenarios[{first}]: "
            f"{self.failures[first]} All runs, complete or not, are in `runs` of this error."
        )


class CacheError(FlockingError):
    """The folder for compiled formulas cannot be used."""


class StorageError(FlockingError):
    """A run on disk cannot be read or written; ``run`` holds what a simulation had computed until then."""

    run: Any = None


class UnsupportedLaw(FlockingError):
    """The chosen engine cannot run a part of this law; the message names the one that can."""


class EngineMissing(FlockingError):
    """The chosen engine needs a package that is missing, or another version of it; the message states how to get it."""


class SweepError(FlockingError):
    """A sweep that cannot go on; finished runs are kept if it has a folder."""
