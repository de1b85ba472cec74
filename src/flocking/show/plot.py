"""Common function for all pictures of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.show import density, departed, group_series, phase, plane, series
from flocking.show.sheet import panel, sheet
from flocking.show.style import COLUMN, PAGE, figure_of, save, themed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SINGLE: dict[str, Callable[..., Axes]] = {
    "net": plane.net,
    "density": density.density,
    "energy": group_series.energy,
    "phase": phase.phase,
    "spread": group_series.spread,
    "connectivity": group_series.connectivity,
    "lattice": group_series.lattice,
    "closest": group_series.closest,
    "links": group_series.links,
    "departed": departed.departed,
}

_PER_AXIS: dict[str, Callable[..., Axes]] = {
    "velocities": series.velocities,
    "positions": series.positions,
    "errors": series.velocity_errors,
}

KINDS = (*_SINGLE, *_PER_AXIS, "series")
"""Kinds of pictures that `plot` can draw."""


def plot(
    run: Run, kind: str = "net", *, save_as: str | Path | None = None, theme: str = "light", **options: object
) -> Figure:
    """Draw a run.

    Parameters
    ----------
    run
        The run.
    kind
        ``"net"`` at one time, ``"density"`` of a large flock, ``"energy"`` (the ledger), ``"velocities"``,
        ``"positions"`` or ``"errors"`` (one panel per axis, or ``axis=``), ``"phase"`` of a pair, ``"spread"`` of
        velocities, ``"connectivity"``, ``"lattice"`` (deviation of link lengths), ``"closest"`` pair, ``"links"``
        created and lost, ``"departed"`` energy by its causes, or ``"series"``: a sheet of velocities, their spread,
        connectivity, closest pair and links, of agents of order 1 of positions instead of velocities.
    save_as
        Path without suffix for SVG and PNG files, or a path that ends in .svg, .png or .pdf; nothing is written by
        default.
    theme
        ``"light"`` or ``"dark"``.
    options
        Options of the function that draws this kind, for example ``time=3.0, trails=True`` for a net.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.

    Raises
    ------
    InvalidInput
        If the kind is unknown, or an option does not fit it.

    Examples
    --------
    >>> import flocking as fk
    >>> law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
    >>> run = fk.simulate(fk.Scenario(law, fk.start.box(3, side=1, seed=0), t_end=0))
    >>> fk.plot(run).axes[0].get_title()
    '$t = 0$'
    """
    if not isinstance(run, Run):
        raise InvalidInput("plot", "run", "must be a Run", run, "Use fk.simulate(scenario).")
    if kind not in KINDS:
        raise InvalidInput("plot", "kind", f"must be one of {', '.join(KINDS)}", kind)
    _check_options(kind, options)
    with themed(theme):
        made = _draw(run, kind, options)
        if save_as is not None:
            save(made, save_as)
    return made


def _check_options(kind: str, options: Mapping[str, object]) -> None:
    from inspect import signature

    function = _SINGLE.get(kind) or _PER_AXIS.get(kind)
    known = set(signature(function).parameters) - {"run", "what", "axes"} if function is not None else set()
    for name in sorted(set(options) - known):
        allowed = ", ".join(sorted(known)) or "none"
        raise InvalidInput("plot", name, f"must be an option of kind {kind!r} ({allowed})", options[name])


def _draw(run: Run, kind: str, options: Mapping[str, object]) -> Figure:
    if kind in _SINGLE:
        return figure_of(_SINGLE[kind](run, **options))
    if kind in _PER_AXIS:
        function = _PER_AXIS[kind]
        if "axis" in options:
            return figure_of(function(run, **options))
        count = run.q.shape[2]
        return sheet(
            [panel(function, run, axis, **options) for axis in range(count)], columns=count,
            width=PAGE if count > 1 else COLUMN, ratio=0.75,
        )  # fmt: skip
    pair = [panel(group_series.closest, run)] if run.n > 1 else []
    moving = run.scenario.agents.order > 1
    components = series.velocities if moving else series.positions
    panels = [
        panel(components, run, 0), *([panel(components, run, 1)] if run.q.shape[2] > 1 else []),
        *([panel(group_series.spread, run)] if moving else []), panel(group_series.connectivity, run), *pair,
        panel(group_series.links, run),
    ]  # fmt: skip
    return sheet(panels, columns=2, ratio=0.62)
