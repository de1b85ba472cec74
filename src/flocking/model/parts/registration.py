"""Registration of parts: the description is read from the annotations."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from dataclasses import Field as DataclassField
from types import NoneType, UnionType
from typing import Annotated, TypeVar, Union, cast, get_args, get_origin

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.parts import values
from flocking.model.parts.construction import check_names, shorten
from flocking.model.parts.description import (
    BY_READER,
    CONNECTED,
    CONNECTED_UNDER,
    DESCRIPTIONS,
    DRAW_TIME,
    Description,
    Field,
    Nested,
    Stored,
    Unwritten,
    add_description,
    group_of,
    registered,
    registered_names,
)
from flocking.model.parts.values import Value

Part = TypeVar("Part", bound=Callable[..., object])

KEPT = ("part", "from", "id")
"""Keys of a part in stored runs besides its fields, see `flocking.model.serial`."""

_PLAIN: dict[object, tuple[Value, tuple[type, ...], str]] = {
    bool: (values.TRUTH, (bool,), "bool"),
    int: (values.INTEGER, (int,), "int"),
    float: (values.NUMBER, (int, float), "float"),
    str: (values.NAME, (str,), "str"),
}


def register_part(
    word: str | None = None,
    *,
    tried: Callable[[object], object] | None = None,
    taken: Callable[[object], Mapping[str, object]] | None = None,
) -> Callable[[Part], Part]:
    """Register a part for scenario files, JSON, the schema for editors, the lab and messages.

    Parameters
    ----------
    word
        Its name in scenario files, such as ``kind = "hysteresis"``; None if it has none.
    tried
        Called with every new part, to find errors in its formulas where they were typed.
    taken
        For a function: returns the arguments that make a given part, so that files can be written with it.

    Returns
    -------
    Callable
        Decorator of a frozen dataclass, which is a part, or of a function that returns one, such as a random start.
        The annotations of fields and arguments determine their kinds: ``float``, ``bool``, ``int``, ``str``,
        ``float | Array`` for one number or one per agent, ``Array`` for one per agent, a class of parts or a tuple of
        them; ``Annotated[..., value]`` with a value of `flocking.model.parts.values` is more specific.

    Raises
    ------
    InvalidInput
        If the annotation of a field is not supported in files, if the name is already in use, or if the object is
        neither a dataclass nor a function with a known return annotation.

    Examples
    --------
    >>> import flocking as fk
    >>> @fk.register_part("row")
    ... def row(n: int, *, spacing: float) -> fk.State:
    ...     return fk.State([[spacing * k, 0.0] for k in range(n)])
    """
    frame = sys._getframe(1)
    names = dict(frame.f_locals)

    def register(part: Part) -> Part:
        found = described(part, word, names)
        if isinstance(part, type):
            check_names(part)
            shorten(part)
        found = Description(
            found.name, found.word, found.builds, found.call, found.fields, found.own_fields, found.arguments,
            tried, taken,
        )  # fmt: skip
        _check_free(found)
        if word is not None:
            _check_described(found)
        add_description(found)
        return part

    return register


def described(
    part: Callable[..., object], word: str | None = None, names: Mapping[str, object] | None = None
) -> Description:
    """Description of a dataclass or function, read from its annotations.

    Parameters
    ----------
    part
        The class or function.
    word
        Its name in scenario files.
    names
        Names its annotations may use besides those of its module.

    Raises
    ------
    InvalidInput
        If an annotation contains an undefined name, or it is neither a dataclass nor a function that returns a part.
    """
    name = getattr(part, "__name__", repr(part))
    try:
        hints = _hints(part, names or {})
    except NameError as error:
        raise InvalidInput(
            "register_part", name, f"must have annotations with names that are defined ({error})", part,
            "Import them at the top of the file, not under TYPE_CHECKING.",
        ) from None  # fmt: skip
    if isinstance(part, type):
        if not is_dataclass(part):
            raise InvalidInput("register_part", name, "must be a dataclass", part, "Write @dataclass(frozen=True).")
        found = [_field(f.name, hints[f.name], _is_required(f)) for f in fields(part) if f.init]
        return Description(name, word, part, part, {f.name: f for f in found})
    return _function(part, name, word, hints)


def _hints(part: Callable[..., object], names: Mapping[str, object]) -> dict[str, object]:
    """Annotations of a class and its bases, or of a function, each evaluated in its module."""
    if not isinstance(part, type):
        return _read(part, names)
    found: dict[str, object] = {}
    for base in reversed(part.__mro__):
        found |= _read(base, names if base is part else {})
    return found


def _read(owner: Callable[..., object], names: Mapping[str, object]) -> dict[str, object]:
    try:
        return inspect.get_annotations(owner, locals={}, eval_str=True)
    except NameError:
        return inspect.get_annotations(owner, locals=names, eval_str=True)


def _function(part: Callable[..., object], name: str, word: str | None, hints: Mapping[str, object]) -> Description:
    builds = hints.get("return")
    if not isinstance(builds, type):
        raise InvalidInput("register_part", name, "must be annotated with the part it returns", builds)
    arguments = inspect.signature(part).parameters
    # Files state seed; what a call may name rng instead is none of their keys, and then the seed has no default.
    seeded = {"seed", "rng"} <= arguments.keys()
    found = {
        a.name: _field(
            a.name, hints.get(a.name, object),
            a.default is inspect.Parameter.empty or (seeded and a.name == "seed" and a.default is None),
        )
        for a in arguments.values()
        if a.name not in BY_READER and not (seeded and a.name == "rng")
    }  # fmt: skip
    found = {f.name: f for f in found.values()}
    group = group_of(builds)
    if group is not None and group.name == "start" and DRAW_TIME not in found:
        found[DRAW_TIME] = Field(DRAW_TIME, DRAW_TIME, values.TIME, required=False)
    if CONNECTED_UNDER in arguments:
        found[CONNECTED] = Field(CONNECTED, CONNECTED, values.TRUTH, required=False)
    return Description(name, word, builds, part, found, own_fields=False, arguments=frozenset(arguments))


def description_of(part: object) -> Description | None:
    """Description of a part: the registered one, or one of any other dataclass; None for other objects.

    A dataclass that was not registered is described by its annotations as far as possible.
    """
    found = registered(part)
    kind = type(part)
    if found is not None or not is_dataclass(kind):
        return found
    if kind not in _unregistered:
        try:
            _unregistered[kind] = described(kind)
        except InvalidInput:
            own = [Field(f.name, f.name, values.ANY, _is_required(f)) for f in fields(kind) if f.init]
            _unregistered[kind] = Description(kind.__name__, None, kind, kind, {f.name: f for f in own})
    return _unregistered[kind]


_unregistered: dict[type, Description] = {}


def _is_required(f: DataclassField[object]) -> bool:
    return f.default is MISSING and f.default_factory is MISSING


def _field(attribute: str, annotation: object, required: bool) -> Field:
    stated: list[object] = []
    while get_origin(annotation) is Annotated:
        inner, *metadata = get_args(annotation)
        annotation, stated = inner, [*stated, *metadata]
    members = _members(annotation)
    optional = NoneType in members
    kinds = [x for x in members if x is not NoneType]
    name = next((x.name for x in stated if isinstance(x, Stored)), attribute)
    holds = next((x for x in stated if isinstance(x, Value | Nested)), None) or _held(kinds)
    unwritten = next((x for x in stated if isinstance(x, Unwritten)), None)
    plain: tuple[type, ...] = ()
    type_name = ""
    if len(kinds) == 1 and kinds[0] in _PLAIN:
        _, plain, type_name = _PLAIN[kinds[0]]
        plain, type_name = (*plain, NoneType) if optional else plain, type_name + " | None" * optional
    return Field(name, attribute, holds, required, plain, type_name, unwritten)


def _members(annotation: object) -> Sequence[object]:
    """The members of a union annotation, without the metadata of `Annotated`."""
    if get_origin(annotation) is Annotated:
        return _members(get_args(annotation)[0])
    if get_origin(annotation) in (Union, UnionType):
        return [x for member in get_args(annotation) for x in _members(member)]
    return [annotation]


def _held(kinds: Sequence[object]) -> Value | Nested:
    """Kind of the values of a field with these types."""
    for kind in kinds:
        group = group_of(kind) if isinstance(kind, type) else None
        if group is not None:
            return Nested(group.name)
    if len(kinds) != 1:
        return values.NUMBER_OR_NUMBERS if kinds and all(k is float or _is_array(k) for k in kinds) else values.ANY
    kind = kinds[0]
    if kind in _PLAIN:
        return _PLAIN[kind][0]
    if _is_array(kind):
        return values.PER_AGENT
    arguments = get_args(kind)
    listed = get_origin(kind) is tuple and len(arguments) == 2 and arguments[1] is Ellipsis
    if listed or get_origin(kind) is Sequence:
        inner = _held(_members(arguments[0]))
        if isinstance(inner, Nested):
            return Nested(inner.group, many=True)
    return values.ANY


def _is_array(kind: object) -> bool:
    alias = getattr(get_origin(kind), "__value__", None)
    if alias is not None:
        # In newer NumPy array types are type aliases with a value.
        kind = alias[get_args(kind)]
    return get_origin(kind) is np.ndarray and np.bool_ not in get_args(get_args(kind)[1])


def _check_free(found: Description) -> None:
    """Check that name and word of a part are free; a reloaded module may register its own parts again."""
    other = registered_names().get(found.name)
    if found.own_fields and other is not None and _home(other) != _home(found):
        raise InvalidInput("register_part", "name", "must not be that of another part", found.name, "Rename the class.")
    if found.own_fields and (odd := [name for name in KEPT if name in found.fields]):
        raise InvalidInput(
            "register_part", f"{found.name}.{odd[0]}", "must not be a name that stored runs use themselves", odd[0],
            f"Rename the field; {', '.join(KEPT)} are taken.",
        )  # fmt: skip
    group = group_of(found.builds)
    for old in [d for d in DESCRIPTIONS if d.own_fields == found.own_fields and _home(d) == _home(found)]:
        DESCRIPTIONS.remove(old)
    if found.word is None:
        return
    if group is None:
        raise InvalidInput(
            "register_part", found.name, "must be a graph, term, leader, obstacle, start or another part of a scenario",
            found.builds, "Derive it from fk.Graph, fk.PairTerm, fk.BodyTerm, fk.Leader or fk.Obstacle.",
        )  # fmt: skip
    if group.key in found.fields and group.kinds:
        raise InvalidInput(
            "register_part", f"{found.name}.{group.key}", "must not be the name that files give to the kind of a part",
            group.key, "Rename the field.",
        )  # fmt: skip
    if group.kind_named(found.word) is not None:
        raise InvalidInput("register_part", "word", f"must not be that of another {group.name}", found.word)


def _home(found: Description) -> tuple[str, str]:
    call = cast(type, found.call)
    return getattr(call, "__module__", ""), getattr(call, "__qualname__", found.name)


def _check_described(found: Description) -> None:
    for f in found.fields.values():
        if f.holds is values.ANY:
            raise InvalidInput(
                "register_part", f"{found.name}.{f.name}", "must have an annotation for its kind of value",
                f.type_name or f.name, "Write float, float | Array, bool, a class of parts, or Annotated[..., value].",
            )  # fmt: skip
