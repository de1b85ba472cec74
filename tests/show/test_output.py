import os
import subprocess
import sys

import matplotlib
import matplotlib.figure
import numpy as np
import pytest

import flocking as fk
from flocking.show import declaration, plane, series, style
from flocking.show.plot import KINDS
from flocking.show.sheet import Panel, panel, sheet


def luminance(color):
    from matplotlib.colors import to_rgb

    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in to_rgb(color)]
    return float(np.dot(linear, [0.2126, 0.7152, 0.0722]))


def contrast(one, other):
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def test_saved_figures_have_the_same_bytes_each_time(run, tmp_path):
    def write(name):
        made = fk.plot(run, "net", time=1.0, trails=True, color="flock")
        return [f.read_bytes() for f in style.save(made, tmp_path / name / "figure.one", ("svg", "png", "pdf"))]

    first, second = write("a"), write("b")
    assert first == second
    assert b"<dc:date>" not in first[0]
    assert (tmp_path / "a" / "figure.one.svg").exists()


@pytest.mark.parametrize("engine", ["figure.autolayout", "figure.constrained_layout.use"])
def test_a_figure_of_one_s_own_keeps_its_layout(tmp_path, engine):
    with matplotlib.rc_context({engine: True}):
        own = matplotlib.figure.Figure()
        axes = own.add_subplot()
        own.colorbar(axes.scatter([0.0, 1.0], [0.0, 1.0], c=[0.0, 1.0]))
        before = own.get_layout_engine()
        places = []
        for formats in (("svg", "png"), ("png",)):
            style.save(own, tmp_path / "own", formats)
            assert own.get_layout_engine() is before
            places.append(axes.get_position().bounds)
    assert places[0] == pytest.approx(places[1], abs=0.01)
    assert places[0] != matplotlib.figure.Figure().add_subplot().get_position().bounds


def test_another_process_writes_the_same_svg(tmp_path):
    code = (
        "import sys; from flocking.show import curves, style; import flocking as fk\n"
        "axes = curves.potential(fk.Potential('1/r + 1/(R - r)', R=4), radius=4)\n"
        "style.save(axes.figure, sys.argv[1], 'svg')"
    )
    for name in "ab":
        subprocess.run([sys.executable, "-c", code, str(tmp_path / name)], check=True)
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


def test_unknown_formats_and_unwritable_folders_are_refused(tmp_path):
    with pytest.raises(fk.InvalidInput, match="formats"):
        style.save(style.figure(), tmp_path / "x", ["bmp"])
    (tmp_path / "file").write_text("")
    with pytest.raises(fk.InvalidInput, match="writable"):
        style.save(style.figure(), tmp_path / "file" / "x")


def test_drawing_leaves_global_settings_and_pyplot_alone():
    code = (
        "import sys, matplotlib\n"
        # Reading the backend would make matplotlib choose one.
        "now = lambda: {k: matplotlib.rcParams[k] for k in matplotlib.rcParams if k != 'backend'}\n"
        "before = now()\n"
        "import flocking as fk; from flocking.show.plane import net\n"
        "net(fk.State([[0.0, 0.0], [1.0, 1.0]], [[1.0, 0.0], [0.0, 1.0]]))\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
        "assert now() == before"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_floor_is_imported_without_matplotlib():
    names = "animate curves declaration group_series phase plane plot series sheet style"
    code = f"import sys, importlib\nfor n in {names!r}.split(): importlib.import_module('flocking.show.' + n)\n"
    subprocess.run([sys.executable, "-c", code + "assert 'matplotlib' not in sys.modules"], check=True)


@pytest.mark.parametrize("name", ["light", "dark"])
def test_themes_can_be_read(name):
    with style.themed(name) as now:
        assert style.theme() is now
        assert contrast(now.ink, now.ground) > 12
        assert contrast(now.faint, now.ground) > 2.4
        assert contrast(now.agent, now.ground) > 4.5
        for color in style.PALETTE:
            assert contrast(color, now.ground) > 2.2
        assert style.figure().get_facecolor() == matplotlib.colors.to_rgba(now.ground)
    assert style.theme() is style.THEMES["light"]


def test_sheet_places_and_letters_its_panels(run, synthetic):
    made = sheet([panel(plane.net, run, time=t) for t in (0, 1, 2)], columns=2)
    assert [a.get_title() for a in made.axes] == ["$t = 0$", "$t = 1$", "$t = 2$"]
    assert [a.get_title(loc="left") for a in made.axes] == ["(a)", "(b)", "(c)"]
    boxes = [a.get_subplotspec() for a in made.axes]
    assert [(b.rowspan.start, b.colspan.start) for b in boxes] == [(0, 0), (0, 1), (1, 0)]
    mixed = sheet([panel(plane.net, synthetic(5, m=3)), Panel(lambda axes: axes.plot([0, 1]))])
    assert [a.name for a in mixed.axes] == ["3d", "rectilinear"]
    with pytest.raises(fk.InvalidInput):
        sheet([])


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_drawn(run, kind, tmp_path):
    made = fk.plot(run, kind, save_as=tmp_path / kind)
    assert len(made.axes) >= 1
    assert (tmp_path / f"{kind}.png").stat().st_size > 5000
    assert all(np.isfinite([*a.get_xlim(), *a.get_ylim()]).all() for a in made.axes)


def test_plot_of_space_and_of_one_agent(synthetic):
    assert len(fk.plot(synthetic(6, m=3), "velocities").axes) == 3
    assert len(fk.plot(synthetic(1), "series").axes) == 5


@pytest.mark.parametrize(
    ("kind", "options", "parameter"),
    [
        ("pie", {}, "kind"), ("net", {"axis": 1}, "axis"), ("series", {"time": 1}, "time"),
        ("net", {"theme": "pink"}, "theme"),
    ],
)  # fmt: skip
def test_bad_requests_name_themselves(run, kind, options, parameter):
    with pytest.raises(fk.InvalidInput) as error:
        fk.plot(run, kind, **options)
    assert error.value.parameter == parameter


def test_gif_has_the_frames_asked_for(run, synthetic, tmp_path):
    from PIL import Image

    path = fk.animate(run, tmp_path / "deep" / "film.gif", fps=5, seconds=0.8, size=2, dpi=50, trails=True)
    with Image.open(path) as film:
        assert film.n_frames == 4
        assert film.size == (100, 100)
        first = np.asarray(film.convert("RGB")).copy()
        film.seek(3)
        assert (np.asarray(film.convert("RGB")) != first).any()
    for m in (1, 3):
        path = fk.animate(synthetic(4, m=m), tmp_path / f"{m}.gif", size=2, dpi=50, follow=True)
        with Image.open(path) as film:
            assert film.n_frames == 3


def test_films_need_a_known_suffix_and_ffmpeg_for_mp4(run, tmp_path, monkeypatch):
    with pytest.raises(fk.InvalidInput, match="must end in"):
        fk.animate(run, tmp_path / "film.avi")
    monkeypatch.setenv("PATH", "")
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(fk.InvalidInput, match=r"Install ffmpeg .*, or write a \.gif"):
        fk.animate(run, tmp_path / "film.mp4")
    assert list(tmp_path.iterdir()) == []
    assert fk.animate(run, tmp_path / "film", fps=1, seconds=1, size=1, dpi=40).suffix == ".gif"


def test_mp4_is_written_by_the_ffmpeg_at_hand(run, tmp_path, monkeypatch):
    """A stand-in keeps what it is told and fed: MP4 is chosen, at the rate and of the pictures asked for."""
    from matplotlib import rcParams

    fake = tmp_path / "ffmpeg"
    fake.write_text(f'#!/bin/sh\necho "$@" > {tmp_path}/told\nfor last; do :; done\ncat > "$last"\n')
    fake.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    before = rcParams["animation.ffmpeg_path"]
    path = fk.animate(run, tmp_path / "film", fps=5, seconds=0.8, size=2, dpi=51)
    assert path == tmp_path / "film.mp4"
    told = (tmp_path / "told").read_text()
    assert "-s 102x102" in told
    assert "-framerate 5" in told
    assert "yuv420p" in told  # what browsers play
    assert path.stat().st_size == 4 * 102 * 102 * 4
    assert rcParams["animation.ffmpeg_path"] == before


def test_an_ffmpeg_that_fails_is_told_and_leaves_nothing(run, tmp_path, monkeypatch):
    place = tmp_path / "bin"
    place.mkdir()
    (place / "ffmpeg").write_text('#!/bin/sh\nfor last; do :; done\necho half > "$last"\nexit 1\n')
    (place / "ffmpeg").chmod(0o755)
    monkeypatch.setenv("PATH", str(place), prepend=os.pathsep)
    with pytest.raises(fk.InvalidInput, match="ffmpeg failed"):
        fk.animate(run, tmp_path / "film.mp4", size=1, dpi=40)
    assert list(tmp_path.iterdir()) == [place]


def test_declared_figures_draw_from_a_run(run, led, psi, part):
    builders = {
        "initial": declaration.initial(), "final": declaration.final(), "one": declaration.snapshot(1.0),
        "many": declaration.snapshots([0, 1, 2, 3]), "paths": declaration.paths_and_final(),
        "velocities": declaration.velocities(), "positions": declaration.positions(1),
        "errors": declaration.velocity_errors(0), "potential": declaration.potential(psi, radius=4),
    }  # fmt: skip
    made = {name: declaration.Figure("1", "A figure", draw).draw(led) for name, draw in builders.items()}
    panels = {name: len(picture.axes) for name, picture in made.items()}
    assert panels == {"initial": 1, "final": 1, "one": 1, "many": 4, "paths": 1, "velocities": 2, "positions": 1,
                      "errors": 1, "potential": 2}  # fmt: skip
    titles = [made[name].axes[0].get_title() for name in ("initial", "one", "final", "paths")]
    assert titles == ["$t = 0$", "$t = 1$", "$t = 3$", "$t = 3$"]
    assert len(part(made["paths"].axes[0], "trails").get_segments()) == run.n
    assert made["positions"].axes[0].get_ylabel() == "$q_{y}$"


@pytest.mark.parametrize("fields", [(4, "A", print), ("4", " ", print), ("4", "A", "draw")])
def test_bad_declarations_are_refused(fields):
    with pytest.raises(fk.InvalidInput):
        declaration.Figure(*fields)


def test_series_share_one_style(run):
    axes = series.velocities(run)
    assert not axes.spines["top"].get_visible()
    assert axes.xaxis.label.get_size() == 8


@pytest.mark.parametrize(
    "options", [{}, {"trails": True, "arrows": False}, {"color": "speed"}, {"color": "heading"}]
)  # fmt: skip
def test_a_film_over_a_still_picture_of_the_axes_is_the_one_drawn_whole(run, tmp_path, monkeypatch, options):
    from flocking.show import animate as module

    fk.animate(run, tmp_path / "over.gif", seconds=0.2, **options)
    drawn = []
    monkeypatch.setattr(module, "_draw_over", lambda canvas, still: (drawn.append(1), canvas.draw()))
    fk.animate(run, tmp_path / "whole.gif", seconds=0.2, **options)
    assert drawn
    assert (tmp_path / "over.gif").read_bytes() == (tmp_path / "whole.gif").read_bytes()
    monkeypatch.setattr(module, "_draw_over", lambda canvas, still: canvas.restore_region(still))
    fk.animate(run, tmp_path / "empty.gif", seconds=0.2, **options)
    assert (tmp_path / "empty.gif").read_bytes() != (tmp_path / "whole.gif").read_bytes()


def test_a_film_coloured_by_speed_has_one_scale(run, part, tmp_path, monkeypatch):
    from flocking.show import animate as module

    seen = []
    before = module.net

    def net(*given, axes, **options):
        made = before(*given, axes=axes, **options)
        seen.append((len(axes.figure.axes), part(axes, "agents").norm.vmax))
        return made

    monkeypatch.setattr(module, "net", net)
    fk.animate(run, tmp_path / "film.gif", color="speed", seconds=0.2)
    frames = np.rint(np.linspace(0, len(run.t) - 1, 4)).astype(int)
    fastest = np.linalg.norm(run.p[frames], axis=2).max()
    assert len(seen) == 1 + len(frames)
    assert {count for count, _ in seen} == {2}, "one bar beside the axes"
    assert {most for _, most in seen} == {float(fastest)}
    # Alone, a picture shows the fastest of its frame.
    assert part(before(run, frame=0, color="speed"), "agents").norm.vmax == np.linalg.norm(run.p[0], axis=1).max()


@pytest.mark.parametrize(("fps", "seconds"), [(30, 0.5), (7, 1.0), (50, 0.2), (3, 0.34)])
def test_a_gif_lasts_as_long_as_was_asked_for(run, tmp_path, fps, seconds):
    from PIL import Image

    path = fk.animate(run, tmp_path / "film.gif", fps=fps, seconds=seconds, size=0.6, dpi=30, progress=False)
    lasting = []
    with Image.open(path) as film:
        for k in range(film.n_frames):
            film.seek(k)
            lasting.append(film.info["duration"])
    pictures = max(1, round(seconds * fps))
    assert sum(lasting) == pytest.approx(1000 * pictures / fps, abs=5.0)
    assert min(lasting) >= 20


def test_a_gif_has_no_more_pictures_a_second_than_programs_show(run, tmp_path):
    with pytest.raises(fk.InvalidInput, match=r"fps must be at most 50 for a \.gif"):
        fk.animate(run, tmp_path / "film.gif", fps=51)
    assert not list(tmp_path.iterdir())


def test_a_film_replaces_what_a_link_leads_to_and_no_pipe(run, tmp_path):
    (tmp_path / "old.gif").write_bytes(b"old")
    (tmp_path / "link.gif").symlink_to(tmp_path / "old.gif")
    fk.animate(run, tmp_path / "link.gif", seconds=0.1, size=1.0, dpi=30, progress=False)
    assert (tmp_path / "link.gif").is_symlink()
    assert (tmp_path / "old.gif").read_bytes()[:3] == b"GIF"
    os.mkfifo(tmp_path / "pipe.gif")
    with pytest.raises(fk.InvalidInput, match="must be a file"):
        fk.animate(run, tmp_path / "pipe.gif", progress=False)
    assert (tmp_path / "pipe.gif").is_fifo()
