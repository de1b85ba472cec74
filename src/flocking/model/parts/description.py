"""One description of a part: its fields, from which files, JSON, schemas, controls, selection and messages derive."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from flocking.model.parts.values import Value

DRAW_TIME = "t"
"""Field of a drawn start: its time."""

CONNECTED, CONNECTED_UNDER = "connected", "connected_under"
"""What files say of a start that is connected under the graph of the law, and the argument that it becomes."""

MOST_AGENTS = "most_agents"
"""Argument of a draw that limits the number of agents; the reader of a file gives it."""

BY_READER = frozenset({CONNECTED_UNDER, MOST_AGENTS})
"""Arguments that no file gives."""


@dataclass(frozen=True)
class Nested:
    """Says that a field holds a part, or parts, of a group.

    Parameters
    ----------
    group
        Name of the group.
    many
        Whether it holds several.
    inline
        Whether the fields of the part stand in the table of its owner.
    most
        Largest number of parts; where given, there must be at least one.
    """

    group: str
    many: bool = False
    inline: bool = False
    most: int | None = None


@dataclass(frozen=True)
class Stored:
    """Says under which name a field is stored and given to the constructor, where it is not its own."""

    name: str


@dataclass(frozen=True)
class Unwritten:
    """Says which value of a field is not written: what files meant that did not know the field.

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
        What it holds.
    required
        Whether it must be given.
    plain
        Types of a plain value, where its annotation is one of ``bool``, ``int``, ``float`` and ``str``, or None beside
        it; empty for all others.
    type_name
        Its annotation, for messages.
    unwritten
        Value that files and JSON do not name, see `Unwritten`.
    """

    name: str
    attribute: str
    holds: Value | Nested
    required: bool
    plain: tuple[type, ...] = ()
    type_name: str = ""
    unwritten: Unwritten | None = None

    def is_written(self, value: object) -> bool:
        """Whether files and JSON name such a ``value``."""
        return self.unwritten is None or value != self.unwritten.value


@dataclass(frozen=True)
class Description:
    """A part, or a function that makes one.

    Parameters
    ----------
    name
        Name of the class or function; JSON names a part by it.
    word
        Name in scenario files; None where they have no word for it.
    builds
        Class of the part.
    call
        Makes it from fields by name.
    fields
        Its fields by their names in files.
    own_fields
        Whether the fields are those of the part: false for a function that makes it from something else.
    arguments
        Every name that ``call`` takes.
    tried
        Called with a new part, so that its formulas are derived where they were typed.
    taken
        Gives the arguments of a function from the part that it made, where they can be found.
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
        """Whether two places that hold the same object still do after it was stored."""
        return bool(getattr(self.builds, "keeps_identity", False))

    @property
    def drawn(self) -> bool:
        """Whether it is a random draw, with a seed of its own."""
        return not self.own_fields and "seed" in self.fields

    def values_of(self, part: object) -> Mapping[str, object]:
        """Fields of ``part`` by name, as its constructor takes them."""
        if self.taken is not None:
            return self.taken(part)
        return {f.name: getattr(part, f.attribute) for f in self.fields.values()}

    def make(self, given: Mapping[str, object]) -> object:
        """The part with the given fields; it validates itself.

        Raises
        ------
        InvalidInput
            When a value breaks a rule of the part.
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
    """A way to write a part without a table.

    Parameters
    ----------
    value
        What stands in the file.
    make
        The part it means.
    types
        Types of the parts that are written so.
    take
        What is written of such a part.
    """

    value: Value
    make: Callable[[object], object]
    types: tuple[type, ...] = ()
    take: Callable[[object], object] = field(default=lambda part: part)


@dataclass(frozen=True)
class Group:
    """Parts that may stand in the same place.

    Parameters
    ----------
    base
        Class of its parts.
    key
        Key of a table that names the part; None where there is only one.
    default
        The word meant when the key is absent.
    names
        Name of the group whose parts with names may stand here; None where there are none.
    short
        A number, text or list that may stand in place of a table.
    """

    name: str
    base: type
    key: str | None = "kind"
    default: str | None = None
    names: str | None = None
    short: Short | None = None

    @property
    def kinds(self) -> tuple[Description, ...]:
        """Its parts that files have a word for."""
        return tuple(d for d in DESCRIPTIONS if d.word is not None and issubclass(d.builds, self.base))

    def kind_named(self, word: str) -> Description | None:
        """The part with such a word."""
        return next((d for d in self.kinds if d.word == word), None)

    def kind_of(self, part: object) -> Description | None:
        """The kind that writes ``part``; None where files have no word for it."""
        return next((d for d in self.kinds if type(part) is d.builds and (d.own_fields or d.taken is not None)), None)


DESCRIPTIONS: list[Description] = []
"""Everything registered, in order."""

GROUPS: dict[str, Group] = {}
"""Groups by name."""

_BY_CLASS: dict[type, Description] = {}


def add_group(group: Group) -> None:
    """Make a group known."""
    GROUPS[group.name] = group


def add_description(description: Description) -> None:
    """Make a part with such a ``description`` known."""
    DESCRIPTIONS.append(description)
    if description.own_fields:
        _BY_CLASS[description.builds] = description


def registered(part: object) -> Description | None:
    """Description of a registered part by its very class; None for all others."""
    return _BY_CLASS.get(type(part))


def registered_names() -> Mapping[str, Description]:
    """Registered classes of parts by name."""
    return MappingProxyType({d.name: d for d in _BY_CLASS.values()})


def group_of(kind: type) -> Group | None:
    """The first group that parts of a class may stand in."""
    return next((g for g in GROUPS.values() if issubclass(kind, g.base)), None)
