"""Description of a part: its fields, from which files, JSON, schemas, controls, selection and messages are derived."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from flocking.model.parts.values import Value

DRAW_TIME = "t"
"""Field of a drawn start: its time."""

CONNECTED, CONNECTED_UNDER = "connected", "connected_under"
"""Key in files for a start that is connected under the graph of the law, and the argument for it."""

MOST_AGENTS = "most_agents"
"""Argument of a draw that limits the number of agents; the reader of a file gives it."""

BY_READER = frozenset({CONNECTED_UNDER, MOST_AGENTS})
"""Arguments that are not in files."""


@dataclass(frozen=True)
class Nested:
    """Annotation of a field that contains one or several parts of a group.

    Parameters
    ----------
    group
        Name of the group.
    many
        Whether it contains several.
    inline
        Whether the fields of the part are in the table of its owner.
    most
        Largest number of parts; where given, there must be at least one.
    """

    group: str
    many: bool = False
    inline: bool = False
    most: int | None = None


@dataclass(frozen=True)
class Stored:
    """Annotation of a field with another name in files and in the constructor."""

    name: str


@dataclass(frozen=True)
class Unwritten:
    """Annotation of a value of a field that is not written; it is the meaning of files without the field.

    Parameters
    ----------
    value
        The value, which is the field's default.
    """

    value: object


@dataclass(frozen=True)
class Field:
    """One field of a part.

    Parameters
    ----------
    attribute
        Its name as an attribute.
    holds
        Kind of its values.
    required
        Whether it must be given.
    plain
        Types of a plain value, if its annotation is one of ``bool``, ``int``, ``float`` and ``str``, also with None;
        else empty.
    type_name
        Its annotation, for messages.
    unwritten
        Value that is not written to files and JSON, see `Unwritten`.
    """

    name: str
    attribute: str
    holds: Value | Nested
    required: bool
    plain: tuple[type, ...] = ()
    type_name: str = ""
    unwritten: Unwritten | None = None

    def is_written(self, value: object) -> bool:
        """Whether a ``value`` is written to files and JSON."""
        return self.unwritten is None or value != self.unwritten.value


@dataclass(frozen=True)
class Description:
    """A part, or a function that makes one.

    Parameters
    ----------
    name
        Name of the class or function; the name of the part in JSON.
    word
        Name in scenario files; None if it has none.
    builds
        Class of the part.
    call
        Function that makes it from fields by name.
    fields
        Its fields by their names in files.
    own_fields
        Whether the fields are those of the part; false for a function with other arguments.
    arguments
        Names of all arguments of ``call``.
    tried
        Called with a new part, so that errors in its formulas are reported where they were typed.
    taken
        Returns the arguments of a function from the part that it made, if they can be found.
    """

    name: str
    word: str | None
    builds: type
    call: Callable[..., object]
    fields: Mapping[str, Field]
    own_fields: bool = True
    arguments: frozenset[str] = frozenset()
    tried: Callable[[object], object] | None = None
    taken: Callable[[object], Mapping[str, object]] | None = None

    @property
    def shares_identity(self) -> bool:
        """Whether references to the same object are preserved when stored."""
        return bool(getattr(self.builds, "keeps_identity", False))

    @property
    def drawn(self) -> bool:
        """Whether it is a random draw with a seed."""
        return not self.own_fields and "seed" in self.fields

    def values_of(self, part: object) -> Mapping[str, object]:
        """Fields of ``part`` by name, as arguments of its constructor."""
        if self.taken is not None:
            return self.taken(part)
        return {f.name: getattr(part, f.attribute) for f in self.fields.values()}

    def make(self, given: Mapping[str, object]) -> object:
        """The part with the given fields; it validates itself.

        Raises
        ------
        InvalidInput
            If a value is invalid.
        """
        part = self.call(**given)
        if self.tried is not None:
            self.tried(part)
        return part

    def with_fields(self, part: object, changes: Mapping[str, object]) -> object:
        """``part`` with some fields changed."""
        return self.make({**self.values_of(part), **changes})


@dataclass(frozen=True)
class Short:
    """Short form of a part in files, without a table.

    Parameters
    ----------
    value
        Kind of the value in the file.
    make
        Makes the part from the value.
    types
        Types of the parts with this form.
    take
        Returns the value for such a part.
    """

    value: Value
    make: Callable[[object], object]
    types: tuple[type, ...] = ()
    take: Callable[[object], object] = field(default=lambda part: part)


@dataclass(frozen=True)
class Group:
    """Parts that are allowed in the same place.

    Parameters
    ----------
    base
        Class of its parts.
    key
        Key of a table for the name of the part; None if there is only one.
    default
        Default value of the key.
    names
        Name of the group whose named parts are allowed here; None if there are none.
    short
        Short form: a number, string or list instead of a table.
    """

    name: str
    base: type
    key: str | None = "kind"
    default: str | None = None
    names: str | None = None
    short: Short | None = None

    @property
    def kinds(self) -> tuple[Description, ...]:
        """Its parts with a name in files."""
        return tuple(d for d in DESCRIPTIONS if d.word is not None and issubclass(d.builds, self.base))

    def kind_named(self, word: str) -> Description | None:
        """The part with the name ``word`` in files."""
        return next((d for d in self.kinds if d.word == word), None)

    def kind_of(self, part: object) -> Description | None:
        """Description of ``part``; None if it has no name in files."""
        return next((d for d in self.kinds if type(part) is d.builds and (d.own_fields or d.taken is not None)), None)


DESCRIPTIONS: list[Description] = []
"""All registered descriptions, in order."""

GROUPS: dict[str, Group] = {}
"""Groups by name."""

_BY_CLASS: dict[type, Description] = {}


def add_group(group: Group) -> None:
    """Register a group."""
    GROUPS[group.name] = group


def add_description(description: Description) -> None:
    """Register a ``description``."""
    DESCRIPTIONS.append(description)
    if description.own_fields:
        _BY_CLASS[description.builds] = description


def registered(part: object) -> Description | None:
    """Description of a registered part by its exact class; None for all others."""
    return _BY_CLASS.get(type(part))


def registered_names() -> Mapping[str, Description]:
    """Registered classes of parts by name."""
    return MappingProxyType({d.name: d for d in _BY_CLASS.values()})


def group_of(kind: type) -> Group | None:
    """The first group that allows parts of a class."""
    return next((g for g in GROUPS.values() if issubclass(kind, g.base)), None)
