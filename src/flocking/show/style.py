"""The style sheet: colours for colour-blind readers, sizes for print, a light and a dark theme."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import lru_cache, wraps
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, ParamSpec, TypeVar

from flocking.engine.storage.atomic_files import write_through
from flocking.errors import InvalidInput
from flocking.model.checks import number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.path import Path as Outline
    from matplotlib.quiver import Quiver
    from numpy.typing import ArrayLike

BLUE, VERMILION, GREEN, ORANGE = "#0072B2", "#D55E00", "#009E73", "#E69F00"
SKY, PURPLE, GREY = "#56B4E9", "#CC79A7", "#7F7F7F"

RED = "#C8102E"
"""Colour of leaders' lines."""

PALETTE = (BLUE, VERMILION, GREEN, ORANGE, SKY, PURPLE)
"""Hues of Okabe and Ito without yellow and black, which are invisible on one of the two backgrounds."""

COLUMN, PAGE = 3.4, 7.0
"""Widths in inches of one column and of a full page of a journal."""

OUTLINE_POINTS = 181
"""Points of an obstacle's outline, two degrees apart on a circle: at the size of print corners are not seen."""

FORMATS = ("svg", "png", "pdf")


@dataclass(frozen=True)
class Theme:
    """Colours that depend on the background.

    Parameters
    ----------
    ground
        Background colour.
    ink
        Text, axes and outlines.
    faint
        Links, grids and other elements in the background.
    agent
        Default colour of agents.
    """

    ground: str
    ink: str
    faint: str
    agent: str


THEMES = {
    "light": Theme(ground="#FFFFFF", ink="#1A1A1A", faint="#9A9A9A", agent=BLUE),
    "dark": Theme(ground="#15181C", ink="#E8E8E8", faint="#7D858E", agent=SKY),
}

_current: ContextVar[str] = ContextVar("flocking_theme", default="light")
_in_force: ContextVar[str] = ContextVar("flocking_style_in_force", default="")
"""Theme whose settings are in force; empty outside the style sheet."""


def theme() -> Theme:
    """The current theme."""
    return THEMES[_current.get()]


@contextmanager
def themed(name: str) -> Iterator[Theme]:
    """Use another theme within the context.

    Parameters
    ----------
    name
        ``"light"`` or ``"dark"``.

    Raises
    ------
    InvalidInput
        If there is no such theme.
    """
    if name not in THEMES:
        raise InvalidInput("style", "theme", f"must be one of {', '.join(THEMES)}", name)
    token = _current.set(name)
    try:
        yield THEMES[name]
    finally:
        _current.reset(token)


def settings() -> dict[str, object]:
    """The style sheet as matplotlib settings, in the colours of the current theme."""
    from cycler import cycler

    now = theme()
    return {
        "font.family": "sans-serif", "font.sans-serif": ["DejaVu Sans"], "mathtext.fontset": "dejavusans",
        "font.size": 8, "axes.titlesize": 8, "axes.labelsize": 8, "legend.fontsize": 7,
        "xtick.labelsize": 7, "ytick.labelsize": 7, "axes.titlepad": 5,
        "figure.facecolor": now.ground, "savefig.facecolor": now.ground, "axes.facecolor": now.ground,
        "text.color": now.ink, "axes.labelcolor": now.ink, "axes.titlecolor": now.ink, "axes.edgecolor": now.ink,
        "xtick.color": now.ink, "ytick.color": now.ink, "legend.labelcolor": now.ink, "grid.color": now.faint,
        "axes.prop_cycle": cycler(color=PALETTE), "axes.linewidth": 0.7, "lines.linewidth": 1.2,
        "axes.spines.top": False, "axes.spines.right": False, "axes.axisbelow": True, "axes.grid": False,
        "grid.linewidth": 0.4, "grid.alpha": 0.5, "axes.formatter.useoffset": False,
        "xtick.direction": "out", "ytick.direction": "out", "xtick.major.width": 0.7, "ytick.major.width": 0.7,
        "xtick.major.size": 3, "ytick.major.size": 3, "xtick.minor.size": 1.5, "ytick.minor.size": 1.5,
        "legend.frameon": False, "legend.handlelength": 1.8, "legend.borderaxespad": 0.3,
        "figure.dpi": 100, "savefig.dpi": 220, "svg.hashsalt": "flocking", "svg.fonttype": "path",
        "pdf.fonttype": 42, "path.simplify": True, "axes.unicode_minus": True,
    }  # fmt: skip


@contextmanager
def styled() -> Iterator[Theme]:
    """Matplotlib settings of the style sheet, restored on exit."""
    import matplotlib

    if _in_force.get() == _current.get():
        # Setting and restoring all of matplotlib's settings takes milliseconds, for each of a thousand pictures.
        yield theme()
        return
    token = _in_force.set(_current.get())
    try:
        with matplotlib.rc_context(settings()):
            yield theme()
    finally:
        _in_force.reset(token)


P = ParamSpec("P")
T = TypeVar("T")


def in_style(function: Callable[P, T]) -> Callable[P, T]:
    """Decorator that runs a drawing function with the style sheet."""

    @wraps(function)
    def drawing(*args: P.args, **kwargs: P.kwargs) -> T:
        with styled():
            return function(*args, **kwargs)

    return drawing


@lru_cache(maxsize=1)
def figure_type() -> type[Figure]:
    """Figures that a notebook shows as the result of a cell; those of Matplotlib need a backend for it."""
    from matplotlib.figure import Figure

    class NotebookFigure(Figure):
        def _repr_png_(self) -> bytes:
            drawn = io.BytesIO()
            self.savefig(drawn, format="png", dpi=2 * self.dpi, facecolor=self.get_facecolor())
            return drawn.getvalue()

    # Pickles name a class by its module.
    NotebookFigure.__qualname__ = "NotebookFigure"
    return NotebookFigure


@lru_cache(maxsize=1)
def quivers() -> type[Quiver]:
    """Arrows that are drawn as Matplotlib's are, whose polygons take half the time: all of them at once."""
    from matplotlib.quiver import Quiver

    class Arrows(Quiver):
        def set_verts(self, verts: Sequence[ArrayLike | Outline], closed: bool = True) -> None:
            # Open polygons, as Matplotlib's arrows are, are made one by one. Filled, both look the same.
            super().set_verts(verts, closed=True)

    Arrows.__qualname__ = "Arrows"
    return Arrows


def __getattr__(name: str) -> type[Figure] | type[Quiver]:
    if name == "NotebookFigure":
        return figure_type()
    if name == "Arrows":
        return quivers()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


@in_style
def figure(width: float = COLUMN, height: float | None = None) -> Figure:
    """An empty figure in the style, not registered with pyplot.

    Parameters
    ----------
    width, height
        Size in inches; the default height is 0.72 of the width.

    Raises
    ------
    InvalidInput
        If a size is not positive.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    width = number("figure", "width", width, above=0.0)
    height = 0.72 * width if height is None else number("figure", "height", height, above=0.0)
    made = figure_type()(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(made)
    return made


@in_style
def axes_or_new(
    axes: Axes | None, *, width: float = COLUMN, height: float | None = None, projection: str | None = None
) -> Axes:
    """``axes``, or by default those of a new figure with a ``width``, ``height`` and ``projection``."""
    if axes is not None:
        return axes
    return figure(width, height).add_subplot(projection=projection)


def figure_of(axes: Axes) -> Figure:
    """The top-level figure of axes, also if they are in a subfigure."""
    from matplotlib.figure import Figure

    made = axes.figure
    return made if isinstance(made, Figure) else made.figure


def named_file(owner: str, path: object) -> Path:
    """The file of a path that was given.

    Raises
    ------
    InvalidInput
        When it is no path, or names no file.
    """
    if not isinstance(path, str | PathLike) or not Path(path).name:
        raise InvalidInput(owner, "path", "must name a file", path)
    return Path(path)


def check_writable(owner: str, path: Path) -> None:
    """Check that a file can be written, before anything is drawn.

    Parameters
    ----------
    owner
        Name of the caller for the error message.
    path
        The file; a missing folder counts as its parent.

    Raises
    ------
    InvalidInput
        If no file can be written there.
    """
    folder = next(above for above in path.absolute().parents if above.is_dir())
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise _unwritable(owner, path, error) from None


def _unwritable(owner: str, path: str | Path, error: OSError) -> InvalidInput:
    return InvalidInput(owner, "path", f"must be writable ({error.strerror})", str(path), "Choose another folder.")


@in_style
def save(picture: Figure, path: str | Path, formats: Sequence[str] = ("svg", "png")) -> tuple[Path, ...]:
    """Write a figure; the same figure always gives the same bytes.

    Parameters
    ----------
    picture
        Figure to write.
    path
        Path without a suffix, or one that ends in one of the formats, which is then the only one; missing folders are
        created.
    formats
        Any of ``"svg"``, ``"png"`` and ``"pdf"``.

    Returns
    -------
    tuple of Path
        The files written, in the order of ``formats``.

    Raises
    ------
    InvalidInput
        If a format is unknown or the folder cannot be written.
    """
    import matplotlib as mpl

    nothing: dict[str, dict[str, None]] = {
        "svg": {"Date": None, "Creator": None},
        "png": {"Software": None},
        "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    }
    formats = (formats,) if isinstance(formats, str) else tuple(formats)
    base = named_file("save", path)
    if base.suffix.lstrip(".") in FORMATS:
        # Asked for by its name, a file is that one alone.
        formats, base = (base.suffix.lstrip("."),), base.with_suffix("")
    for name in formats:
        if name not in FORMATS:
            raise InvalidInput("save", "formats", f"must be among {', '.join(FORMATS)}", name)
    written = tuple(base.parent / f"{base.name}.{name}" for name in formats)
    layout = picture.get_layout_engine()
    try:
        # Computed once for all formats: Matplotlib would compute the layout for each, which draws everything twice.
        with mpl.rc_context({"figure.autolayout": False, "figure.constrained_layout.use": False}):
            if layout is not None:
                if picture.axes:
                    layout.execute(picture)
                picture.set_layout_engine(None)
            for name, target in zip(formats, written, strict=True):
                drawn = io.BytesIO()
                picture.savefig(drawn, format=name, metadata=nothing[name], facecolor=picture.get_facecolor())
                write_through(target, drawn.getvalue(), lasting=False)
    except OSError as error:
        raise _unwritable("save", path, error) from None
    finally:
        if layout is not None:
            picture.set_layout_engine(layout)
    return written
