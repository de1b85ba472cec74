"""Structure of parts by their descriptions: access to values by paths, replacement, and selection of agents."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import numpy as np

from flocking.arrays import Indices
from flocking.errors import InvalidInput
from flocking.formula.grammar import Formula
from flocking.model.parts import values
from flocking.model.parts.description import GROUPS, Description, Field, Nested
from flocking.model.parts.registration import description_of
from flocking.model.parts.values import Value

Step = str | int
FORMULA = "formula"
NEW_NAME_VALUE = 1.0
"""Default value of a new name in a changed formula."""

T = TypeVar("T")


def children(part: object) -> dict[Step, object]:
    """Children of a part by the step of a path; they include fields and parameters by name."""
    if isinstance(part, tuple | list) or (isinstance(part, np.ndarray) and part.ndim == 1):
        return dict(enumerate(part))
    kind = description_of(part)
    if kind is None:
        return {}
    found: dict[Step, object] = {}
    for field in kind.fields.values():
        found |= _steps(field, getattr(part, field.attribute))
    return found


def _steps(field: Field, value: object) -> dict[Step, object]:
    if isinstance(field.holds, Value) and field.holds.is_formula:
        texts = field.holds.store(value)
        return {f"{FORMULA}_{k}": x for k, x in enumerate(texts)} if isinstance(texts, list) else {FORMULA: texts}
    if field.holds is values.NAMED_NUMBERS and isinstance(value, Mapping):
        return dict(value)
    return {field.name: value}


def field_at(part: object, step: Step) -> Field | None:
    """The field for a step from ``part``; None if there is none."""
    kind = description_of(part)
    fields = {} if kind is None else kind.fields
    if step in fields:
        return fields[str(step)]
    return next((f for f in fields.values() if step in _steps(f, getattr(part, f.attribute))), None)


def value_at(part: object, path: Sequence[Step]) -> object:
    """The value at ``path`` from ``part``.

    Raises
    ------
    InvalidInput
        If the path does not exist.
    """
    for step in path:
        found = children(part)
        if step not in found:
            raise InvalidInput(type(part).__name__, str(step), "must be one of its parts", list(found))
        part = found[step]
    return part


def with_children(part: T, changes: Mapping[Step, object]) -> T:
    """``part`` with some of its children replaced and validated.

    A new formula keeps the parameters that it still contains; new names get the value 1.
    """
    found: object
    if isinstance(part, np.ndarray):
        found = np.array([changes.get(k, x) for k, x in enumerate(part)])
    elif isinstance(part, tuple | list):
        found = type(part)(changes.get(k, x) for k, x in enumerate(part))
    else:
        kind = description_of(part)
        assert kind is not None
        found = kind.make(_arguments(kind, part, changes))
    assert isinstance(found, type(part))
    return found


def _arguments(kind: Description, part: object, changes: Mapping[Step, object]) -> dict[str, object]:
    found: dict[str, object] = {}
    names: set[str] = set()
    for field in kind.fields.values():
        value = getattr(part, field.attribute)
        holds = field.holds
        if isinstance(holds, Value) and holds.is_formula:
            before = value if isinstance(value, tuple) else (value,)
            formulas = [
                Formula(str(changes[step]), type(part).__name__) if step in changes else formula
                for step, formula in zip(_steps(field, value), before, strict=True)
            ]
            found[field.name] = formulas if isinstance(value, tuple) else formulas[0]
            names |= {n for formula in formulas for n in formula.names} - set(holds.variables)
        elif holds is not values.NAMED_NUMBERS:
            found[field.name] = changes.get(field.name, value)
    for field in kind.fields.values():
        if field.holds is values.NAMED_NUMBERS:
            known = {**getattr(part, field.attribute), **changes}
            found[field.name] = {name: known.get(name, NEW_NAME_VALUE) for name in sorted(names)}
    return found


def substituted(part: T, old: object, new: object) -> T:
    """``part`` with every occurrence of the object ``old`` replaced by ``new``; what was shared stays shared."""
    found = _with_each_field(part, {id(old): new}, lambda _, value: value)
    assert isinstance(found, type(part))
    return found


def _with_each_field(part: object, done: dict[int, object], made: Callable[[Field, object], object]) -> object:
    """``part`` with ``made`` applied to the fields of all nested parts; shared objects stay shared."""
    if id(part) in done:
        return done[id(part)]
    if isinstance(part, tuple | list):
        entries = [_with_each_field(x, done, made) for x in part]
        same = all(a is b for a, b in zip(entries, part, strict=True))
        done[id(part)] = part if same else type(part)(entries)
        return done[id(part)]
    changes = {}
    kind = description_of(part)
    for field in kind.fields.values() if kind is not None else ():
        value = getattr(part, field.attribute)
        other = _with_each_field(made(field, value), done, made)
        if other is not value:
            changes[field.name] = other
    done[id(part)] = part if kind is None or not changes else kind.with_fields(part, changes)
    return done[id(part)]


def changed(part: T, path: Sequence[Step], value: object) -> T:
    """``part`` with the value at ``path`` replaced, in every place that refers to its owner.

    Raises
    ------
    InvalidInput
        If the path does not exist or the value is invalid.
    """
    *parents, last = path
    owner = value_at(part, parents)
    value_at(owner, [last])
    return substituted(part, owner, with_children(owner, {last: value}))


def of_agents(part: T, chosen: Indices, n: int) -> T:
    """``part`` restricted to the ``chosen`` of ``n`` agents, with the values of these agents and pairs.

    A part that does not store agents in arrays implements a method ``of_agents(chosen)``.
    """

    def made(field: Field, value: object) -> object:
        own = getattr(value, "of_agents", None)
        return _chosen(_each(field.holds), value, chosen, n) if own is None else own(chosen)

    own = getattr(part, "of_agents", None)
    found = _with_each_field(part, {}, made) if own is None else own(chosen)
    assert isinstance(found, type(part))
    return found


def _each(holds: Value | Nested) -> str:
    """Unit of the entries of arrays in a field: agents or pairs."""
    if isinstance(holds, Value):
        return "agent" if holds is values.ANY else holds.each
    short = GROUPS[holds.group].short
    return "" if short is None else short.value.each


def _chosen(each: str, value: object, chosen: Indices, n: int) -> object:
    if each and isinstance(value, tuple):
        return tuple(_chosen(each, x, chosen, n) for x in value)
    if not (each and isinstance(value, np.ndarray) and value.ndim and len(value) == n):
        return value
    return value[np.ix_(chosen, chosen)] if each == "pair" else value[chosen]
