"""Sheets: several panels in one figure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

from flocking.errors import InvalidInput
from flocking.model.checks import integer
from flocking.show.style import PAGE, figure, in_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d import Axes3D

    from flocking.engine.runs.run import Run


@dataclass(frozen=True)
class Panel:
    """One part of a sheet.

    Parameters
    ----------
    draw
        Function that draws on axes.
    space
        Whether it needs axes in three dimensions.
    """

    draw: Callable[[Axes], object]
    space: bool = False


def panel(function: Callable[..., object], run: Run, *args: object, **options: object) -> Panel:
    """Panel that calls a drawing function of this package on a run.

    Parameters
    ----------
    function
        For example ``plane.net`` or ``series.velocities``.
    run
        The run.
    args, options
        Further arguments of the function.
    """
    from flocking.show.plane import net

    space = function is net and run.q.shape[2] == 3
    return Panel(lambda axes: function(run, *args, axes=axes, **options), space=space)


@in_style
def sheet(
    panels: Sequence[Panel | Callable[[Axes], object]],
    columns: int = 2,
    *,
    width: float = PAGE,
    ratio: float = 0.85,
    letters: bool = True,
) -> Figure:
    """Compose panels, row by row, into one figure.

    Parameters
    ----------
    panels
        Panels, or functions of the axes.
    columns
        Number of columns.
    width
        Width of the figure in inches.
    ratio
        Height of a panel over its width.
    letters
        Whether to label the panels (a), (b), ...

    Raises
    ------
    InvalidInput
        If there is no panel or no column.
    """
    columns = integer("sheet", "columns", columns, least=1)
    if len(panels) == 0:
        raise InvalidInput("sheet", "panels", "must contain at least one panel", panels)
    columns = min(columns, len(panels))
    rows = -(-len(panels) // columns)
    made = figure(width, rows * ratio * width / columns)
    grid = made.add_gridspec(rows, columns)
    for k, one in enumerate(panels):
        one = one if isinstance(one, Panel) else Panel(one)
        axes: Axes = made.add_subplot(grid[k // columns, k % columns], projection="3d" if one.space else None)
        one.draw(axes)
        if letters and len(panels) > 1:
            mark = f"({chr(ord('a') + k)})" if k < 26 else f"({k + 1})"
            if one.space:
                cast("Axes3D", axes).text2D(0.0, 1.02, mark, fontweight="bold", transform=axes.transAxes)
            else:
                axes.set_title(mark, loc="left", fontweight="bold")
    return made
