"""Parts taken apart and put together again: look a value up by its path, change it, and keep shared parts shared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from flocking.errors import InvalidInput
from flocking.formula.grammar import Formula
from flocking.model.law import Scenario
from flocking.model.leaders_and_obstacles.leaders import Leader, Path, Sink, Velocity
from flocking.model.potentials.potential import Potential
from flocking.model.terms.schedules import Schedule

Step = str | int
FORMULA = "formula"
NEW_NAME_VALUE = 1.0
"""Value of a name that a newly typed formula uses for the first time."""


def children(part: object) -> dict[Step, object]:
    """What a part consists of, by the step of a path that leads there."""
    if isinstance(part, Potential):
        found: dict[Step, object] = {FORMULA: part.formula.text}
        return found | dict(part.parameters)
    if isinstance(part, Path):
        texts: dict[Step, object] = {f"{FORMULA}_{k}": f.text for k, f in enumerate(part.formulas)}
        return texts | dict(part.values) | {"start": part.start, "start_time": part.start_time}
    if isinstance(part, tuple | list) or (isinstance(part, np.ndarray) and part.ndim == 1):
        return dict(enumerate(part))
    if isinstance(part, Schedule) or not is_dataclass(part):
        return {}
    return {f.name: getattr(part, f.name) for f in fields(part) if f.init}


def value_at(part: Any, path: Sequence[Step]) -> Any:
    """The value that ``path`` leads to from ``part``.

    Raises
    ------
    InvalidInput
        When it leads nowhere.
    """
    for step in path:
        found = children(part)
        if step not in found:
            raise InvalidInput(type(part).__name__, str(step), "must be one of its parts", list(found))
        part = found[step]
    return part


def with_children(part: Any, changes: dict[Step, Any]) -> Any:
    """``part`` with some of its children replaced; it validates itself anew.

    A new formula keeps the parameters it still uses; a name it uses for the first time gets the value 1.
    """
    if isinstance(part, Potential):
        formula = Formula(str(changes.get(FORMULA, part.formula.text)), "Potential")
        values = {**part.parameters, **{str(k): v for k, v in changes.items() if k != FORMULA}}
        names = sorted(formula.names - {"r"})
        found = Potential(formula, **{name: values.get(name, NEW_NAME_VALUE) for name in names})
        # Deriving the slope here shows a formula that cannot be differentiated where it was typed.
        found(1.0)
        return found
    if isinstance(part, Path):
        texts = [str(changes.get(f"{FORMULA}_{k}", f.text)) for k, f in enumerate(part.formulas)]
        needed = {name for text in texts for name in Formula(text, "Path").names} - {"t"}
        values = {name: changes.get(name, part.values.get(name, NEW_NAME_VALUE)) for name in sorted(needed)}
        start, since = changes.get("start", part.start), changes.get("start_time", part.start_time)
        return Path(texts, start, since, **values)
    if isinstance(part, np.ndarray):
        return np.array([changes.get(k, x) for k, x in enumerate(part)])
    if isinstance(part, tuple | list):
        return type(part)(changes.get(k, x) for k, x in enumerate(part))
    return replace(part, **{str(k): v for k, v in changes.items()})


def substituted(part: Any, old: Any, new: Any) -> Any:
    """``part`` with every occurrence of the object ``old`` replaced by ``new``; what was shared stays shared."""
    return _substituted(part, old, new, {})


def _substituted(part: object, old: object, new: object, done: dict[int, object]) -> object:
    if part is old:
        return new
    if id(part) in done:
        return done[id(part)]
    if isinstance(part, Potential | np.ndarray | str):
        return part
    changes = {}
    for step, child in children(part).items():
        other = _substituted(child, old, new, done)
        if other is not child:
            changes[step] = other
    done[id(part)] = found = with_children(part, changes) if changes else part
    return found


def changed(scenario: Scenario, path: Sequence[Step], value: object) -> Scenario:
    """The scenario with the value at ``path`` replaced, in every place where the part that owns it stands.

    Raises
    ------
    InvalidInput
        When the path leads nowhere or the owner of the value refuses it.
    """
    *parents, last = path
    owner = value_at(scenario, parents)
    value_at(owner, [last])
    found = substituted(scenario, owner, with_children(owner, {last: value}))
    assert isinstance(found, Scenario)
    return found


def leader_at_point(leader: Leader, point: Sequence[float], t: float) -> Leader:
    """A leader with the same velocity that is at ``point`` at time ``t``.

    Raises
    ------
    InvalidInput
        When it is a leader of another kind, or the point is none.
    """
    where = [float(x) for x in point]
    if isinstance(leader, Sink):
        return Sink(where)
    if isinstance(leader, Velocity):
        return Velocity(leader.value, start=where, start_time=t)
    if isinstance(leader, Path):
        return Path([f.text for f in leader.formulas], where, t, **leader.values)
    raise InvalidInput("lab", "leader", "must be a Sink, Velocity or Path to be moved", leader)
