"""Forces, energies and powers of some agents by the declared law, for comparison with those of an engine.

The formulas are those that `flocking.engine.kernels.codegen` prints for NumPy, evaluated in double precision from the
scenario's parameters, independently of the kernels of an engine and of their arguments.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import AnyArray, Indices, Mask
from flocking.engine.kernels.codegen import array_kernels
from flocking.engine.kernels.layout import Layout
from flocking.engine.reference.control import obstacles_met
from flocking.model.checks import Array
from flocking.model.graph_functional import averages
from flocking.model.graphs.weights import PairWeights
from flocking.model.law import Scenario

LinkedPairs = tuple[NDArray[np.integer], NDArray[np.integer], Mask]
"""Sensing and sensed agents of pairs, and whether it is certain that they are linked."""

SAFETY = 64.0
"""Largest accepted error in units of the rounding error of the formulas, which is measured in single precision."""

NEAR_OBSTACLES = 4096.0
"""The same for forces of obstacles: their formulas have several stages, of which the geometry is not measured."""

BLUR = 2.0
"""Roundings of a difference of positions, and of the lengths of space in it, in a displacement to an image."""

LENGTH_ROUNDING = 8.0
"""Roundings of the length of a displacement in an engine, whose roots are iterated. At a distance at which a formula
vanishes its terms may vanish in any precision, and this alone is left."""

POWERS = ("pairs", "bodies", "work", "dissipated", "supplied")
"""Energies and powers that are compared, by the names of the kernels' sums."""


@dataclass(frozen=True, eq=False)
class Group:
    """A group at one time, of which some agents are checked.

    Parameters
    ----------
    q, p
        Positions and velocities of all agents that the pairs name, shape (N, m). For agents of order 1 the velocities
        are their controls as computed by the engine; only the supply depends on them.
    ids
        Number of each agent, shape (N,).
    t
        The time.
    since
        Time from which the current values of scheduled gains apply.
    frame
        Velocity of the frame of the energy, shape (m,).
    mean_q, mean_p
        Centre of mass and its velocity (of agents of order 1 the mean control), shape (m,); NaN if the law does not
        use them.
    mean_errors
        Bounds on what rounding may lead an engine from both, shape (2, m); see `means_of`.
    """

    q: AnyArray
    p: AnyArray
    ids: NDArray[np.integer]
    t: float
    since: float
    frame: Array
    mean_q: Array
    mean_p: Array
    mean_errors: Array


@dataclass(frozen=True, eq=False)
class Statement:
    """Values of the checked agents by the law, with bounds on the rounding error of an engine.

    Parameters
    ----------
    force, force_error
        Control less damping, shape (S, m), and bound on its rounding, shape (S,).
    size
        Sum of the absolute values of the terms of the force, shape (S,).
    powers, power_errors
        Values of `POWERS` per agent, shape (S, 5), and their bounds.
    """

    force: Array
    force_error: Array
    size: Array
    powers: Array
    power_errors: Array


class Declared:
    """The declared law of a scenario, for evaluation on parts of a group.

    Parameters
    ----------
    scenario
        The scenario.
    rounding
        Machine epsilon of the engine's state.

    Attributes
    ----------
    uses_means
        Whether the law or its energy uses means of the group.
    """

    def __init__(self, scenario: Scenario, rounding: float) -> None:
        self.scenario, self.rounding = scenario, rounding
        self.uses_means = bool(scenario.law.beyond_neighbours) or scenario.energy.frame == "centre of mass"
        # Forces of steering terms are added by whoever compares: they have no formulas.
        self._layout = Layout(scenario.law, scenario.energy, scenario.agents, scenario.space, True)
        self._module = array_kernels(self._layout, scenario.start.dimension)

    def _numbers(self, since: float) -> tuple[Array, list[float | Array], list[PairWeights]]:
        found = self._layout.numbers(self.scenario.agents, since)
        return self._layout.packed(found.single), found.each, found.pairs

    def _pair_weights(
        self, weights: list[PairWeights], i: NDArray[np.integer], j: NDArray[np.integer]
    ) -> dict[str, Array]:
        """Weights of pairs of agents, by slot."""
        scenario = self.scenario
        found = (
            w.of_pairs(i.astype(np.intp), j.astype(np.intp), scenario.agents.headings, scenario.start.n)
            for w in weights
        )
        return {f"W{x}": each for x, each in enumerate(found)}

    def state(self, group: Group, judged: Indices, pairs: Sequence[LinkedPairs]) -> Statement:
        """Evaluate the law for the agents at the indices ``judged``, shape (S,).

        Parameters
        ----------
        group
            The group that contains them.
        pairs
            For each graph the linked pairs: the sensing agent as an index into ``judged``, the index of the other, and
            whether the link is certain.
        """
        if not self.uses_means:
            group = replace(group, mean_errors=np.zeros_like(group.mean_errors))
        if self.scenario.agents.order == 2:
            return self._seen(group, judged, pairs)
        still = replace(group, p=np.zeros_like(group.p), mean_p=np.zeros_like(group.mean_p))
        return self._flow(group, judged, pairs, self._seen(still, judged, pairs))

    def _flow(self, group: Group, judged: Indices, pairs: Sequence[LinkedPairs], seen: Statement) -> Statement:
        """The same with the powers of agents of order 1; see `flocking.engine.kernels.flow_formulas`."""
        P, rows, weights = self._numbers(group.since)
        m, count, n = group.q.shape[1], len(judged), self.scenario.start.n
        q, u = (np.asarray(x[judged], dtype=np.float64) for x in (group.q, group.p))
        who = group.ids[judged]
        A = [np.broadcast_to(row, n)[who].astype(np.float64) for row in rows]
        speed = np.sqrt((seen.force**2).sum(axis=1))
        square = speed**2
        off_square = (2.0 * speed + seen.force_error) * (seen.force_error + SAFETY * self.rounding * seen.size)
        supply, off_supply = np.zeros(count), np.zeros(count)
        for number, (k, j, certain) in enumerate(pairs):
            if not len(k):
                continue
            d, blur = self._displacement(group.q[j], q[k])
            # In the formulas of the flow, controls take the place of velocities.
            given = _pair_values(d, np.asarray(group.p[j], dtype=np.float64) - u[k], u[k])
            given |= {f"A{x}": row[k] for x, row in enumerate(A)}
            given |= self._pair_weights(weights, who[k], group.ids[j])
            found, off = self._both(f"pair_flow{number}", P, given, len(k))
            self._blurred((f"pair_flow{number}", P, given, len(k)), found, off, blur)
            still = {**given, "radial": 0.0 * given["radial"], "push": 0.0 * given["push"]}
            parts = self._sizes(f"pair_sizes{number}", P, still, len(k))["along"]
            parts = 2.0 * parts * (2.0 * np.abs(given["push"]) + np.abs(given["radial"])) + np.abs(found["supply"])
            value = 0.5 * found["supply"]
            doubt = 0.5 * (off["supply"] + SAFETY * self.rounding * parts) + np.where(certain, 0.0, np.abs(value))
            supply += np.bincount(k, value, minlength=count)
            off_supply += np.bincount(k, doubt, minlength=count)
        own_values: dict[str, object] = {"t": group.t, **{f"A{k}": row for k, row in enumerate(A)}}
        for x in range(m):
            own_values |= {f"q{x}": q[:, x], f"p{x}": 0.0 * u[:, x], f"u{x}": u[:, x], f"mean_u{x}": group.mean_p[x]}
            own_values |= {f"mean_q{x}": group.mean_q[x], f"mean_p{x}": 0.0}
        own, off = self._both("body_flow", P, own_values, count)
        self._off_means(("body_flow", P, own_values, count), own, off, group)
        supply += own["supply"]
        size = np.abs(own["supply"])
        for met, values in obstacles_met(self.scenario.law, self._layout, self._module, q, P, own_values):
            push = np.stack([values[f"force{x}"] for x in range(m)], axis=1)
            np.add.at(supply, met, (push * u[met]).sum(axis=1))
            strength = np.sqrt((push**2).sum(axis=1) * (u[met] ** 2).sum(axis=1))
            np.add.at(off_supply, met, NEAR_OBSTACLES * self.rounding * strength)
        # What a term leaves beside the descent of its storage may be a difference of two that are equal.
        size += 2.0 * seen.size * np.sqrt((u**2).sum(axis=1))
        off_supply += off["supply"] + SAFETY * self.rounding * (size + np.abs(supply))
        powers = np.column_stack([seen.powers[:, :2], square, square, supply])
        errors = np.column_stack([seen.power_errors[:, :2], off_square, off_square, off_supply])
        return replace(seen, powers=powers, power_errors=errors)

    def _seen(self, group: Group, judged: Indices, pairs: Sequence[LinkedPairs]) -> Statement:
        """Evaluate the law with the velocities of the group."""
        P, rows, weights = self._numbers(group.since)
        m, count = group.q.shape[1], len(judged)
        force, size, error = np.zeros((count, m)), np.zeros(count), np.zeros(count)
        powers, errors = np.zeros((count, len(POWERS))), np.zeros((count, len(POWERS)))
        q, p = (np.asarray(x[judged], dtype=np.float64) for x in (group.q, group.p))
        who = group.ids[judged]
        A = [np.broadcast_to(row, self.scenario.start.n)[who].astype(np.float64) for row in rows]
        speeds = _speeds(group, p)
        for number, (k, j, certain) in enumerate(pairs):
            if not len(k):
                continue
            d, blur = self._displacement(group.q[j], q[k])
            v = np.asarray(group.p[j], dtype=np.float64) - p[k]
            given = _pair_values(d, v, p[k] - group.frame)
            given |= {f"A{x}": row[k] for x, row in enumerate(A)}
            given |= self._pair_weights(weights, who[k], group.ids[j])
            if averages(self.scenario.law, number):
                given["functional"] = np.asarray(1.0 / (1.0 + np.bincount(k, minlength=count)), dtype=np.float64)[k]
            found, off = self._both(f"pair{number}", P, given, len(k))
            sizes = self._sizes(f"pair_sizes{number}", P, given, len(k))
            r = given["r"]
            along, direction = np.where(r > 0, found["along"], 0.0), d / np.where(r > 0, r, 1.0)[:, None]
            one = along[:, None] * direction + found["drag"][:, None] * v
            v_size = np.sqrt((v**2).sum(axis=1))
            magnitude = np.where(r > 0, sizes["along"], 0.0) + sizes["drag"] * v_size
            self._blurred((f"pair{number}", P, given, len(k)), found, off, blur)
            off["along"] += np.abs(found["along"]) * blur / np.where(r > 0, r, 1.0)
            doubt = np.where(r > 0, off["along"], 0.0) + off["drag"] * v_size + np.where(certain, 0.0, magnitude)
            # Differences of rounded numbers; the velocities themselves are exact, like the positions.
            for axis in range(m):
                force[:, axis] += np.bincount(k, one[:, axis], minlength=count)
            size += np.bincount(k, magnitude, minlength=count)
            error += np.bincount(k, doubt, minlength=count)
            # Powers of forces that are not opposite are products with differences of velocities, which may cancel.
            sizes["supply"] += magnitude * (2.0 * speeds[k] + v_size)
            off["supply"] += magnitude * group.mean_errors[1].sum()
            for column, name in ((0, "storage"), (3, "dissipation"), (4, "supply")):
                value = 0.5 * found[name]
                powers[:, column] += np.bincount(k, value, minlength=count)
                extra = off[name] + SAFETY * self.rounding * sizes[name]
                doubt = 0.5 * extra + np.where(certain, 0.0, np.abs(value))
                errors[:, column] += np.bincount(k, doubt, minlength=count)
        self._bodies(group, (P, A), q, p, (force, size, error, powers, errors))
        force -= A[1][:, None] * p
        speed = np.sqrt((p**2).sum(axis=1))
        size += A[1] * speed
        error += SAFETY * self.rounding * size
        powers[:, 2] = (force * p).sum(axis=1) + A[1] * speed**2
        errors[:, 2] += (error + SAFETY * self.rounding * size) * speed
        errors += SAFETY * self.rounding * np.abs(powers)
        return Statement(force, error, size, powers, errors)

    def _bodies(
        self, group: Group, slots: tuple[Array, list[float | Array]], q: Array, p: Array, sums: tuple[Array, ...]
    ) -> None:
        """Add the contributions of body terms and obstacles."""
        P, A = slots
        force, size, error, powers, errors = sums
        count, m = q.shape
        given: dict[str, object] = {"t": group.t, **{f"A{k}": row for k, row in enumerate(A)}}
        for k in range(m):
            given |= {f"q{k}": q[:, k], f"p{k}": p[:, k], f"mean_q{k}": group.mean_q[k], f"mean_p{k}": group.mean_p[k]}
        body, off = self._both("body", P, given, count)
        self._off_means(("body", P, given, count), body, off, group)
        sizes = self._sizes("body_sizes", P, given, count)
        own = np.stack([body[f"force{k}"] for k in range(m)], axis=1)
        force += own
        size += sum(sizes[f"force{k}"] for k in range(m))
        error += sum(off[f"force{k}"] for k in range(m))
        strengths = sum(sizes[f"force{k}"] for k in range(m)) + A[1] * np.sqrt((p**2).sum(axis=1))
        for column, name in ((1, "storage"), (3, "dissipation"), (4, "supply")):
            powers[:, column] += body[name]
            errors[:, column] += off[name] + SAFETY * self.rounding * sizes[name]
        # Velocities relative to the frame may cancel.
        errors[:, 3:] += (SAFETY * self.rounding * strengths * _speeds(group, p))[:, None]
        for i, values in obstacles_met(self.scenario.law, self._layout, self._module, q, P, given):
            push = np.stack([values[f"force{k}"] for k in range(m)], axis=1)
            np.add.at(force, i, push)
            strength = np.sqrt((push**2).sum(axis=1))
            np.add.at(size, i, strength)
            np.add.at(error, i, NEAR_OBSTACLES * self.rounding * strength)
            for column, name in ((3, "dissipation"), (4, "supply")):
                np.add.at(powers[:, column], i, values[name])
                doubt = NEAR_OBSTACLES * self.rounding * np.abs(values[name]) + strength * group.mean_errors[1].sum()
                np.add.at(errors[:, column], i, doubt)

    def _displacement(self, there: AnyArray, here: Array) -> tuple[Array, Array]:
        """Displacements of pairs, shape (K, m), and how far rounding may lead an engine from their lengths.

        Differences of neighbouring numbers are exact, those of numbers a length of space apart are not.
        """
        space, difference = self.scenario.space, np.asarray(there, dtype=np.float64) - here
        d = difference if space.is_open else space.displacement(difference)
        blur = LENGTH_ROUNDING * np.sqrt((d**2).sum(axis=1))
        if not space.is_open:
            blur += BLUR * (np.abs(difference) + np.abs(d - difference)).sum(axis=1)
        return d, self.rounding * blur

    def _blurred(
        self, call: tuple[str, Array, dict[str, Array], int], found: Mapping[str, Array], off: dict[str, Array],
        blur: Array,
    ) -> None:  # fmt: skip
        """Add to bounds on rounding what a blurred distance does to the values of a function."""
        r = call[2]["r"]
        for sign in (-1.0, 1.0):
            self._add_change(call, {"r": np.maximum(r + sign * blur, 0.0)}, found, off)

    def _off_means(
        self, call: tuple[str, Array, dict[str, object], int], found: Mapping[str, Array], off: dict[str, Array],
        group: Group,
    ) -> None:  # fmt: skip
        """Add to bounds on rounding what the errors of means do to the values of a function."""
        given = call[2]
        for axis, (of_place, of_velocity) in enumerate(group.mean_errors.T.tolist()):
            # In the formulas of the flow controls take the place of velocities.
            velocity = f"mean_u{axis}" if f"mean_u{axis}" in given else f"mean_p{axis}"
            for each, error in ((f"mean_q{axis}", of_place), (velocity, of_velocity)):
                for sign in (-1.0, 1.0) if error > 0.0 else ():
                    moved = np.asarray(given[each], dtype=np.float64) + sign * error
                    self._add_change(call, {each: moved}, found, off)

    def _add_change(
        self, call: tuple[str, Array, Mapping[str, object], int], moved: Mapping[str, object],
        found: Mapping[str, Array], off: dict[str, Array],
    ) -> None:  # fmt: skip
        """Add to bounds how far the values of a function change where some of its arguments are others."""
        name, P, given, count = call
        with np.errstate(all="ignore"):
            changed = getattr(self._module, name)(P, {**given, **moved}).items()
            other = {key: v * np.ones(count) for key, v in changed}
        for key, value in found.items():
            gap = np.abs(other[key] - value)
            off[key] = off[key] + np.where(np.isfinite(gap), gap, np.abs(value))

    def _sizes(self, name: str, P: Array, given: Mapping[str, object], count: int) -> dict[str, Array]:
        """Sums of the absolute values of the terms of each formula; 0 if there are none."""
        with np.errstate(all="ignore"):
            found = {key: v * np.ones(count) for key, v in getattr(self._module, name)(P, given).items()}
        return {key: np.where(np.isnan(v), 0.0, v) for key, v in found.items()}

    def _both(
        self, name: str, P: Array, given: Mapping[str, object], count: int
    ) -> tuple[dict[str, Array], dict[str, Array]]:
        """Values of a function and bounds on their rounding errors, from an evaluation in single precision."""
        function = getattr(self._module, name)
        narrow = {key: np.asarray(value, dtype=np.float32) for key, value in given.items()}
        with np.errstate(all="ignore"):
            found = {key: v * np.ones(count) for key, v in function(P, given).items()}
            rough = {key: np.asarray(v, np.float64) for key, v in function(P.astype(np.float32), narrow).items()}
        unit = self.rounding / float(np.finfo(np.float32).eps)
        off = {}
        for key, value in found.items():
            gap = np.abs(rough[key] - value)
            gap = np.where(np.isfinite(gap), gap, np.abs(value))
            off[key] = SAFETY * unit * (gap + float(gap.mean() if len(gap) else 0.0))
        return found, off


def _speeds(group: Group, p: Array) -> Array:
    """Sizes of what the velocities of agents relative to the frame are a difference of, shape (S,)."""
    return np.asarray(np.sqrt((p**2).sum(axis=1)) + np.sqrt((group.frame**2).sum()))


def _pair_values(d: Array, v: Array, own: Array) -> dict[str, Array]:
    r = np.sqrt((d**2).sum(axis=1))
    length = np.where(r > 0, r, 1.0)
    return {
        "r": r, "speed2": (v**2).sum(axis=1), "radial": (d * v).sum(axis=1) / length,
        "push": (d * own).sum(axis=1) / length, "pull": (v * own).sum(axis=1),
    }  # fmt: skip


def means_of(q: AnyArray, p: AnyArray, masses: Array, sums: Callable[[Array], Array], count: int) -> Array:
    """Mean positions and velocities weighted by masses, and bounds on the rounding errors of an engine's.

    The bounds are those of numbers that are added one after the other in double precision.

    Parameters
    ----------
    q, p
        Positions and velocities of agents, shape (n, m).
    masses
        Their masses, shape (n,).
    sums
        Adds an array to those of other processes, which have other agents.
    count
        Number of agents of all processes.

    Returns
    -------
    array
        The two means and the two bounds, shape (4, m).
    """
    exact = [x.astype(np.float64) for x in (q, p)]
    moments = sums(np.array([masses @ x for x in (*exact, *map(np.abs, exact))]))
    found: Array = moments / sums(masses.sum(keepdims=True))
    found[2:] *= count * float(np.finfo(np.float64).eps)
    return found


__all__ = ["POWERS", "SAFETY", "Declared", "Group", "Statement"]
