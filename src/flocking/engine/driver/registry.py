"""All engines by name: those of this library, of other packages, and those registered at run time.

An engine is imported when it is used. A package provides one by an entry point of the group ``flocking.engines``, whose
name is that of the engine and whose object is an instance of `flocking.engine.protocol.engine.Engine`.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, is_dataclass
from functools import lru_cache
from importlib import import_module

from flocking.engine.interruption import interrupted
from flocking.engine.protocol.engine import Engine
from flocking.engine.protocol.options import UnknownOption, nearest, unknown_option
from flocking.engine.protocol.world import left_out
from flocking.errors import EngineMissing, FlockingError, InvalidInput, SuspectInput
from flocking.model.law import Law, Scenario

GROUP = "flocking.engines"
"""Group of the entry points of engines."""

AUTO = "auto"
NAME = re.compile(r"[a-z][a-z0-9_-]*")
OWN_PACKAGE = "flocking"


@dataclass(frozen=True)
class Entry:
    """The location of an engine.

    Parameters
    ----------
    target
        The engine, or ``"module:attribute"``.
    package
        The package that provides it.
    automatic_from, interactive_from
        Smallest group for which ``"auto"`` selects it, in a run and in an interactive page; None for never. Only used
        for the engines of this library.
    """

    name: str
    target: Engine | str
    package: str
    automatic_from: int | None = None
    interactive_from: int | None = None

    def load(self) -> Engine:
        """The engine.

        Raises
        ------
        EngineMissing
            If it cannot be imported, or is not an engine.
        """
        if isinstance(self.target, Engine):
            return self.target
        module, _, attribute = self.target.partition(":")
        try:
            found = vars(import_module(module)).get(attribute)
        except FlockingError:
            raise
        except Exception as error:
            if interrupted(error) or self.package == OWN_PACKAGE:
                raise
            raise EngineMissing(
                f"engine={self.name!r} of the package {self.package} cannot be imported: "
                f"{type(error).__name__}: {error}. Reinstall it, or report it to its authors."
            ) from error
        try:
            check_engine(found)
        except InvalidInput as error:
            raise EngineMissing(f"engine={self.name!r}: {self.target} of the package {self.package}: {error}") from None
        assert isinstance(found, Engine)
        if found.name != self.name:
            raise EngineMissing(
                f"engine={self.name!r} of the package {self.package} has the name {found.name!r}. "
                "Its entry point must have the engine's name."
            )
        return found


BUILT_IN = {
    entry.name: entry
    for entry in (
        Entry("exact", "flocking.engine.exact.engine:ENGINE", OWN_PACKAGE, 0, 0),
        Entry("tiles", "flocking.engine.tiles.engine:ENGINE", OWN_PACKAGE, 2001, 301),
        Entry("sampled", "flocking.engine.sampled.engine:ENGINE", OWN_PACKAGE, 0, 0),
        Entry("delayed", "flocking.engine.delayed.engine:ENGINE", OWN_PACKAGE, 0, 0),
        Entry("discrete", "flocking.engine.discrete.engine:ENGINE", OWN_PACKAGE, 0, 0),
        Entry("lammps", "flocking.engine.lammps.engine:ENGINE", OWN_PACKAGE),
    )
}
"""Engines of this library. Above 2,000 agents (300 on a page) ``"auto"`` selects the tiled one if it can run them, and
under held control the sampled one, with delays or messages under continuous control the delayed one, and for bodies in
discrete time the discrete one."""

GENERAL = "exact"
"""The engine whose words state why none runs a scenario, where several might."""

_registered: dict[str, Entry] = {}


def check_engine(engine: object) -> None:
    """Refuse an object that is not a valid engine.

    Raises
    ------
    InvalidInput
        If it is not an `Engine`, or its name or its options are invalid.
    """
    if not isinstance(engine, Engine):
        raise InvalidInput(
            "register_engine", "engine", "must be an instance of flocking.engine.protocol.engine.Engine", engine,
            "Derive a class from it, and register an instance.",
        )  # fmt: skip
    try:
        name: object = engine.name
        options: object = engine.options
    except AttributeError as error:
        raise InvalidInput(
            "register_engine", str(error.name), "must be stated by the class of an engine", engine
        ) from None
    if not isinstance(name, str) or not NAME.fullmatch(name) or name == AUTO:
        raise InvalidInput(
            "register_engine", "name", f"must be lower-case letters, digits, - and _, and not {AUTO!r}", name
        )
    if not (isinstance(options, type) and is_dataclass(options)):
        raise InvalidInput("register_engine", "options", f"of engine {name!r} must be a dataclass", options)


def register_engine(engine: Engine) -> None:
    """Make an engine available to ``engine=`` and ``--engine``, in this process and in the workers of its sweeps.

    To make it available in every process, declare an entry point of the group ``flocking.engines`` in its package.

    Parameters
    ----------
    engine
        The engine.

    Raises
    ------
    InvalidInput
        If it is not an engine, or another one has its name.
    """
    check_engine(engine)
    register_entry(Entry(engine.name, engine, type(engine).__module__.partition(".")[0]))


def register_entry(entry: Entry) -> None:
    """Register an engine; the same entry may be registered again.

    Raises
    ------
    InvalidInput
        If another engine has its name.
    """
    other = BUILT_IN.get(entry.name) or _registered.get(entry.name) or _installed().get(entry.name)
    if other is not None and other != entry and other.target is not entry.target:
        raise InvalidInput(
            "register_engine", "name", f"must not be that of another engine, which the package {other.package} brings",
            entry.name, "Give it another name, or take the other one out with unregister_engine.",
        )  # fmt: skip
    _registered[entry.name] = entry


def unregister_engine(name: str) -> None:
    """Remove an engine that was registered with `register_engine`.

    Raises
    ------
    InvalidInput
        If there is no engine of that name.
    """
    if name not in _registered:
        raise InvalidInput("unregister_engine", "name", "must be that of a registered engine", name)
    del _registered[name]


def adopt_entries(entries: Iterable[Entry]) -> None:
    """Register the ``entries`` that `registered` gave in the parent process."""
    _registered.update({entry.name: entry for entry in entries if entry.name not in BUILT_IN})


def registered() -> tuple[Entry, ...]:
    """Engines registered in this process only, for its worker processes."""
    return tuple(_registered.values())


@lru_cache(maxsize=1)
def _installed() -> Mapping[str, Entry]:
    """Engines of installed packages, without importing them."""
    from importlib.metadata import entry_points

    found: dict[str, Entry] = {}
    for point in sorted(entry_points(group=GROUP), key=lambda p: (p.name, p.value)):
        package = point.dist.name if point.dist is not None else point.module
        other = BUILT_IN.get(point.name) or found.get(point.name)
        entry = Entry(point.name, f"{point.module}:{point.attr}", package)
        if other is not None and other != entry:
            warnings.warn(
                f"The engine {point.name!r} of the package {package} is not used: the package {other.package} brings "
                "one of that name.",
                SuspectInput, stacklevel=2,
            )  # fmt: skip
        elif NAME.fullmatch(point.name) and point.name != AUTO:
            found[point.name] = entry
        else:
            warnings.warn(
                f"The engine {point.name!r} of the package {package} is not used: its name must be lower-case "
                "letters, digits, - and _.",
                SuspectInput, stacklevel=2,
            )  # fmt: skip
    return found


def entry_named(name: str) -> Entry | None:
    """Entry of the engine with this name; None if there is none."""
    return BUILT_IN.get(name) or _registered.get(name) or _installed().get(name)


def engine_names() -> tuple[str, ...]:
    """Names of all engines."""
    return tuple({**BUILT_IN, **_registered, **_installed()})


def check_name(owner: str, name: object) -> str:
    """The name of an engine, or ``"auto"``.

    Raises
    ------
    InvalidInput
        If there is no such engine.
    """
    if isinstance(name, str) and (name == AUTO or entry_named(name) is not None):
        return name
    names = (AUTO, *engine_names())
    fix = nearest(name, names) if isinstance(name, str) else ""
    raise InvalidInput(owner, "engine", f"must be one of {', '.join(names)}", name, fix)


def engine_named(name: str) -> Engine:
    """The engine of a name.

    Raises
    ------
    InvalidInput
        If there is none.
    EngineMissing
        If it cannot be imported.
    """
    check_name("start", name)
    entry = entry_named(name)
    if entry is None:
        raise InvalidInput("start", "engine", f"must be one of {', '.join(engine_names())} here", name)
    return entry.load()


def chosen_engine(scenario: Scenario, engine: str, plant: Law | None = None, *, interactive: bool = False) -> str:
    """The engine of this library that ``"auto"`` selects for a scenario; any other name is returned unchanged.

    Parameters
    ----------
    engine
        Name of an engine, or ``"auto"``.
    plant
        The law that agents follow, if it differs from the scenario's; then the engine for the smallest groups is
        selected.
    interactive
        Whether a user waits for each step.
    """
    if not isinstance(engine, str) or engine != AUTO:
        return engine
    n = scenario.start.n if plant is None else 0
    # Where only one engine runs the world of the scenario, its own words state what else it refuses.

    def smallest(entry: Entry) -> int | None:
        return entry.interactive_from if interactive else entry.automatic_from

    ranked = sorted(
        ((least, name) for name, entry in BUILT_IN.items() if (least := smallest(entry)) is not None and least <= n),
        reverse=True,
    )
    engines = {name: BUILT_IN[name].load() for _, name in ranked}
    moving = [name for name, each in engines.items() if each.moves(scenario.agents)]
    acting = [name for name in moving if isinstance(scenario.control, engines[name].controls)]
    found = [name for name in acting if not left_out(scenario, engines[name].worlds)]
    found = found or (moving if scenario.agents.discrete else [GENERAL])
    able = (name for name in found if len(found) == 1 or not engines[name].why_not(scenario, plant))
    # The engine for groups of this size states what it refuses; others only that the group is too large.
    return next(able, GENERAL if GENERAL in found else found[0])


ARGUMENTS = ("engine", "fine", "plant", "progress", "save")
"""Arguments of `flocking.simulate` besides the options of an engine."""


def options_of(engine: Engine, given: Mapping[str, object]) -> object:
    """Options of an engine; the error for an unknown one names the engines that have it.

    Raises
    ------
    InvalidInput
        If there is no such option, or a value is invalid.
    """
    try:
        return engine.options_from(given)
    except UnknownOption as error:
        owners = _options_and_owners()
        if error.parameter not in owners:
            own = {*engine.option_names, *ARGUMENTS}
            raise unknown_option(error.parameter, error.value, own, engine.name, owners) from None
        rule = f"is only an option of {owners[error.parameter]}"
        raise InvalidInput("start", error.parameter, rule, error.value) from None


def _options_and_owners() -> dict[str, str]:
    """Options of all engines, each with words for the engines that have it."""
    having: dict[str, list[str]] = {}
    for engine in engine_names():
        for option in _option_names(engine):
            having.setdefault(option, []).append(f"engine={engine!r}")
    return {option: " and ".join(engines) for option, engines in having.items()}


def _option_names(name: str) -> tuple[str, ...]:
    entry = entry_named(name)
    try:
        return () if entry is None else entry.load().option_names
    except EngineMissing:
        return ()


def missing_engine(folder: object, name: str, package: str) -> EngineMissing:
    """The error for a stored run whose engine is missing.

    Parameters
    ----------
    folder
        The folder of the run.
    name, package
        The engine, and its package; empty if the run does not state it.
    """
    fix = f"Install the package {package!r}" if package else "Install the package that provides it"
    return EngineMissing(
        f"{folder}: this run was made by engine={name!r}, which is not registered. {fix}, or pass the engine to "
        "flocking.register_engine before resuming. The stored data can be read without it."
    )
