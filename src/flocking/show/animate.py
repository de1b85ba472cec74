"""Animations of runs, as MP4 where ffmpeg is installed, else as GIF."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from subprocess import CalledProcessError
from typing import TYPE_CHECKING, BinaryIO, Unpack

import numpy as np

from flocking.arrays import Indices
from flocking.engine.interruption import interrupted
from flocking.engine.runs.run import Run
from flocking.engine.storage.left_overs import partial_file, remove_files_left_over
from flocking.errors import InvalidInput
from flocking.model.checks import Array, integer, number
from flocking.model.leaders_and_obstacles.leaders import Leader
from flocking.show.film import Film, Pictures
from flocking.show.frames import leader_track, time_of
from flocking.show.plane import NetOptions, net
from flocking.show.style import figure, in_style, named_file, themed

if TYPE_CHECKING:
    from matplotlib.animation import PillowWriter
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL.Image import Image

SUFFIXES = (".mp4", ".gif")

FASTEST = 240
"""Largest number of pictures per second."""

MILLISECONDS = 10
"""Milliseconds, in which Pillow takes durations, of a hundredth of a second, in which GIF stores them."""

HUNDREDTHS, SHORTEST = 100, 2
"""Units of a second in which GIF counts how long a picture is shown, and the fewest that programs do not lengthen:
browsers show pictures of one unit for ten."""

GAP, ABOVE = 1.5, 5.0
"""Points between the middle of the axes and the symbol or number of the time, half a space of the text, and points from
the axes up to them, those of a title."""

MOST_PICTURES = 100_000
"""Default limit on the number of pictures of a film."""


def animate(
    run: Run,
    path: str | Path,
    *,
    fps: int = 20,
    seconds: float | None = None,
    follow: bool = False,
    size: float = 4.0,
    dpi: int = 120,
    theme: str = "light",
    most_pictures: int = MOST_PICTURES,
    progress: bool = True,
    **options: Unpack[NetOptions],
) -> Path:
    """Write the stored frames of a run as a film.

    Parameters
    ----------
    run
        The run.
    path
        The file: ``.mp4`` needs ffmpeg (see `ffmpeg`), ``.gif`` does not; without a suffix MP4 is chosen if ffmpeg is
        available.
    fps
        Pictures per second of the film, at most `FASTEST`, and 50 of a GIF, which counts in hundredths of a second: its
        pictures are shown a hundredth longer or shorter where that is needed for its length.
    seconds
        Length of the film: frames are omitted or repeated to fit; every frame once by default.
    follow
        Whether the picture moves with the centre of the group.
    size
        Width and height in inches.
    dpi
        Dots per inch.
    theme
        ``"light"`` or ``"dark"``.
    most_pictures
        Largest number of pictures, which guards against mistakes.
    progress
        Show how many pictures are drawn once it takes longer than two seconds.
    options
        Further options of `flocking.show.plane.net`, such as ``trails=True``.

    Returns
    -------
    Path
        The file written; in a notebook it is shown as a film.

    Raises
    ------
    InvalidInput
        If the suffix is unknown, ffmpeg is needed and missing or fails, or a number is out of range.
    """
    fps = integer("animate", "fps", fps, least=1)
    if fps > FASTEST:
        raise InvalidInput("animate", "fps", f"must be at most {FASTEST}", fps)
    dpi = integer("animate", "dpi", dpi, least=10)
    size = number("animate", "size", size, above=0.0)
    if not isinstance(run, Run) or len(run.t) == 0:
        raise InvalidInput("animate", "run", "must be a Run with at least one frame", run)
    pictures = len(run.t) if seconds is None else number("animate", "seconds", seconds, above=0.0) * fps
    if pictures > integer("animate", "most_pictures", most_pictures, least=1):
        raise InvalidInput(
            "animate", "seconds", f"must not take more than {most_pictures} pictures", seconds,
            "Make the film shorter, or give a larger most_pictures.",
        )  # fmt: skip
    if seconds is None:
        frames = np.arange(len(run.t))
    else:
        count = max(1, round(pictures))
        frames = np.rint(np.linspace(0, len(run.t) - 1, count)).astype(np.intp)
    known = set(NetOptions.__annotations__)
    for name in sorted(set(options) - known):
        rule = f"must be an option of films or nets ({', '.join(sorted(known))})"
        raise InvalidInput("animate", name, rule, dict(options)[name])
    target = film_path(path)
    if target.suffix == ".gif" and fps * SHORTEST > HUNDREDTHS:
        raise InvalidInput(
            "animate", "fps", f"must be at most {HUNDREDTHS // SHORTEST} for a .gif, which counts in hundredths of a "
            "second", fps, "Ask for fewer, or write an .mp4.",
        )  # fmt: skip
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidInput("animate", "path", f"must be writable ({error.strerror})", str(path)) from None
    if target.exists() and not target.is_file() and not target.is_dir():
        raise InvalidInput("animate", "path", "must be a file, which films are written to", str(path))
    # What a link leads to is replaced, not the link. Writers determine the format by the suffix.
    linked = target.resolve() if target.is_symlink() else target
    remove_files_left_over(target)
    partial = partial_file(linked, target.suffix)
    import matplotlib

    try:
        with themed(theme), matplotlib.rc_context():
            _film(run, partial, frames, fps, follow, size, dpi, progress, options)
        os.replace(partial, linked)
    except Exception as error:
        if interrupted(error):
            # The writer fails on a film without pictures.
            raise KeyboardInterrupt from None
        if not isinstance(error, CalledProcessError | OSError):
            raise
        why = getattr(error, "strerror", None) or "ffmpeg failed: is the disk full, or ffmpeg without H.264?"
        fix = "Choose another folder." if target.suffix == ".gif" else "Choose another folder, or try a .gif."
        raise InvalidInput("animate", "path", f"cannot be written ({why})", str(path), fix) from None
    finally:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
    return Film(target)


def ffmpeg() -> str | None:
    """Path of ffmpeg: the installed one, else that of the extra ``film``, else None."""
    import shutil
    from importlib.util import find_spec

    import matplotlib

    if found := shutil.which(str(matplotlib.rcParams["animation.ffmpeg_path"])):
        return found
    if find_spec("imageio_ffmpeg") is None:
        return None
    from imageio_ffmpeg import get_ffmpeg_exe

    try:
        return str(get_ffmpeg_exe())
    except RuntimeError:  # The package has none for this machine.
        return None


def film_path(path: str | Path) -> Path:
    """Path of a film, with a suffix.

    Raises
    ------
    InvalidInput
        If the suffix is unknown, or ffmpeg is needed and missing.
    """
    path = named_file("animate", path)
    if path.suffix == "":
        path = path.with_suffix(".mp4" if ffmpeg() else ".gif")
    if path.suffix not in SUFFIXES:
        raise InvalidInput("animate", "path", f"must end in {' or '.join(SUFFIXES)}", str(path))
    if path.suffix == ".mp4" and not ffmpeg():
        raise InvalidInput(
            "animate", "path", "can end in .mp4 only where ffmpeg is installed", str(path),
            "Install ffmpeg (Debian: apt-get install ffmpeg; anywhere: pip install 'flocking[film]'), or write a .gif.",
        )  # fmt: skip
    return path


@in_style
def _film(
    run: Run, path: Path, frames: Indices, fps: int, follow: bool, size: float, dpi: int, progress: bool,
    options: NetOptions,
) -> None:  # fmt: skip
    import matplotlib
    from matplotlib.animation import FFMpegWriter
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    made = figure(size, size)
    if path.suffix == ".mp4":
        matplotlib.rcParams["animation.ffmpeg_path"] = ffmpeg()  # Restored by the caller.
        # The index is written first, so that a browser can start before the file is complete.
        writer: FFMpegWriter | PillowWriter = FFMpegWriter(fps=fps, extra_args=["-movflags", "+faststart"])
    else:
        writer = _gif_writer(fps)
    # Nothing stands above the axes that the title must avoid, so it is not looked for.
    matplotlib.rcParams["axes.titley"] = 1.0
    made.set_dpi(dpi)
    canvas = FigureCanvasAgg(made)

    still: object = None

    def save(target: BinaryIO, **_: object) -> None:
        if still is None:
            canvas.draw()
        else:
            _draw_over(canvas, still)
        target.write(canvas.buffer_rgba())

    # Saving a figure draws it twice, once to measure its extent; the extent of a film is known.
    setattr(made, "savefig", save)  # noqa: B010  the type checker refuses to replace a method
    space = run.q.shape[2] == 3
    limits = None if "limits" in options else _limits(run, follow, leader=options.get("leader", True))

    # One scale of colours for the whole film.
    scale: NetOptions = {} if options.get("color") != "speed" else {"fastest": float(_speeds(run, frames).max())}

    def draw(k: int) -> None:
        if made.axes and not space:
            # Beside it there may be a scale of colours, which stays.
            axes = made.axes[0]
            # Clearing the axes would create all ticks again.
            for artist in [*axes.lines, *axes.collections, *axes.patches, *axes.texts, *axes.images]:
                artist.remove()
            axes.set_prop_cycle(None)
        else:
            made.clear()
            axes = made.add_subplot(projection="3d" if space else None)
        # Limits that change with every frame hide the motion, so the window is fixed before the first.
        window: NetOptions = {} if limits is None else {"limits": (limits[0, k].tolist(), limits[1, k].tolist())}
        look: NetOptions = {**window, **scale, **options}
        timed = not space and look.get("title", True) is True
        if timed:
            look["title"] = False
        net(run, frame=k, axes=axes, **look)
        if timed:
            _write_time(axes, time_of(run, float(run.t[k])))

    # The layout is computed once, for the frame with the longest tick labels: for each frame it would take half the
    # time of a film and make the axes jitter.
    draw(int(frames[0] if limits is None else frames[np.abs(limits[:, frames]).max(axis=(0, 2)).argmax()]))
    made.draw_without_rendering()
    places = [axes.get_position() for axes in made.axes]
    made.set_layout_engine("none")
    if not space:
        _keep_labels(made.axes[0])
    if not space and not follow:
        still = _without_moving(canvas)
    with writer.saving(made, str(path), dpi), Pictures(progress, len(frames)) as drawn:
        for k in frames:
            draw(int(k))
            for axes, place in zip(made.axes, places, strict=True):
                axes.set_position(place)
            writer.grab_frame()
            drawn.count()


def _gif_writer(fps: int) -> PillowWriter:
    """A writer of GIF whose pictures last, together, as long as was asked for."""
    from matplotlib.animation import PillowWriter

    class ExactWriter(PillowWriter):
        _frames: list[Image]

        def finish(self) -> None:
            """Write the pictures; Matplotlib gives all the same time, cut to a hundredth of a second."""
            first, *others = self._frames
            # Moments at which pictures end, in hundredths, rounded each, so that errors do not add up.
            ends = np.rint(HUNDREDTHS * np.arange(len(self._frames) + 1) / self.fps)
            lasting = (MILLISECONDS * np.diff(ends)).astype(int).tolist()
            duration = lasting if others else lasting[0]
            first.save(self.outfile, save_all=True, append_images=others, duration=duration, loop=0)

    return ExactWriter(fps=fps)


def _write_time(axes: Axes, time: str) -> None:
    """The time above the axes: the symbol is typeset once, which takes long, and the number is plain."""
    for text, side, shift in (("$t =$", "right", -GAP), (time, "left", GAP)):
        axes.annotate(text, (0.5, 1.0), (shift, ABOVE), "axes fraction", "offset points", ha=side, va="baseline")


def _keep_labels(axes: Axes) -> None:
    """Leave the names of both axes where they are: else the extent of all ticks is looked for in each picture."""
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_label_coords(*axis.label.get_position(), transform=axis.label.get_transform())


def _moving(axes: Axes) -> list[Artist]:
    """What a film draws anew for each picture, in the order of drawing."""
    legend = axes.get_legend()
    every = [*axes.lines, *axes.collections, *axes.patches, *axes.texts, *axes.images, *axes.artists, axes.title]
    return sorted([*every, *([] if legend is None else [legend])], key=lambda artist: artist.get_zorder())


def _without_moving(canvas: FigureCanvasAgg) -> object:
    """The picture of axes alone: drawing ticks and their labels takes half the time of a film in which they stay."""
    moving = _moving(canvas.figure.axes[0])
    canvas.draw()
    for artist in moving:
        artist.set_visible(False)
    canvas.draw()
    for artist in moving:
        artist.set_visible(True)
    return canvas.copy_from_bbox(canvas.figure.bbox)


def _draw_over(canvas: FigureCanvasAgg, still: object) -> None:
    """Draw what moves over the picture of the axes."""
    axes = canvas.figure.axes[0]
    canvas.restore_region(still)
    for artist in _moving(axes):
        axes.draw_artist(artist)


def _speeds(run: Run, frames: Indices) -> Array:
    """Speeds of all agents at frames."""
    return np.asarray(np.linalg.norm(np.asarray(run.p, dtype=np.float64)[frames], axis=2))


def _limits(run: Run, follow: bool, *, leader: bool | Leader = True) -> Array:
    """Lowest and highest corner of the picture at every frame, shape (2, F, m): of a still one with the leaders."""
    space = run.scenario.space
    where = run.q if space.is_open else space.wrapped(np.asarray(run.q, dtype=np.float64))
    q = where if run.q.shape[2] > 1 else np.concatenate([where, np.zeros_like(where)], axis=2)
    centre = (q.min(axis=1) + q.max(axis=1)) / 2
    half = np.ptp(q, axis=1).max(axis=0) / 2
    if not follow:
        places = [q.reshape(-1, q.shape[2]), *_leader_places(run, leader)]
        low, high = (end([end(each, axis=0) for each in places], axis=0) for end in (np.min, np.max))
        centre, half = np.broadcast_to((low + high) / 2, centre.shape), (high - low) / 2
    half = half + (0.1 * float(half.max()) or 1.0)
    return np.stack([centre - half, centre + half])


def _leader_places(run: Run, leader: bool | Leader) -> list[Array]:
    """Where the leaders that are drawn are at the frames, shape (F, m) each; on a line as agents are drawn there."""
    chosen = (leader,) if isinstance(leader, Leader) else run.scenario.law.leaders if leader else ()
    tracks = [leader_track(one, run.t)[0] for one in chosen if one.dimension == run.q.shape[2]]
    known = [run.scenario.space.wrapped(q[np.isfinite(q).all(axis=1)]) for q in tracks]
    return [q if q.shape[1] > 1 else np.hstack([q, np.zeros_like(q)]) for q in known if len(q)]
