"""plot and animate, as a shell sees them."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

import flocking as fk
from flocking.apps.cli import main
from flocking.engine.exact.session import ExactSession
from flocking.engine.storage.stored_runs import write_run
from flocking.show.plot import KINDS
from tests.engine.storage.stored_runs import finished, scenario

FALL = """
t_end = 100
graph = {kind = "hysteresis", radius = 4, gap = 0.1}
terms = [{kind = "gradient", formula = "1/r + 1/(R - r)", parameters = {R = 4}}, {kind = "consensus"}]
start = {q = [[0, 0], [0, 0]]}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(finished(), tmp_path_factory.mktemp("runs") / "some.run")


def names(place: Path) -> list[str]:
    return sorted(p.name for p in place.iterdir())


def test_a_picture_lies_beside_its_run(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = {p: p.stat().st_mtime_ns for p in folder.rglob("*")}
    assert main(["plot", str(folder)]) == 0
    assert [Path(line).name for line in capsys.readouterr().out.split()] == ["some.run-net.svg", "some.run-net.png"]
    assert names(folder.parent) == ["some.run", "some.run-net.png", "some.run-net.svg"]
    assert {p: p.stat().st_mtime_ns for p in folder.rglob("*")} == before
    assert (folder.parent / "some.run-net.svg").read_text().startswith("<?xml")


@pytest.mark.parametrize(
    ("words", "files"),
    [
        (["--out", "a.png"], ["a.png"]),
        (["--out", "a.b"], ["a.b.png", "a.b.svg"]),
        (["--out", "a.pdf", "--kind", "energy"], ["a.pdf"]),
        (["--out", "a.svg", "-k", "closest", "-k", "links"], ["a-closest.svg", "a-links.svg"]),
    ],
)
def test_the_ending_chooses_the_format(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], files: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["plot", str(folder), *words]) == 0
    assert names(tmp_path) == files


def test_the_time_of_a_net_is_heard(folder: Path, tmp_path: Path) -> None:
    for time in (0, 1):
        assert main(["plot", str(folder), "--time", str(time), "--out", str(tmp_path / f"{time}.svg")]) == 0
    assert (tmp_path / "0.svg").read_bytes() != (tmp_path / "1.svg").read_bytes()


def test_kinds_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plot", "--kind", "list"]) == 0
    assert tuple(capsys.readouterr().out.split()) == KINDS
    main(["plot", "--help"])
    shown = capsys.readouterr().out
    assert all(kind in shown for kind in KINDS)


def test_a_scenario_is_run_and_drawn_in_the_current_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "two.toml").write_text(
        't_end = 1\nframes = 3\ngraph = {kind = "hysteresis", radius = 4, gap = 0.1}\n'
        'terms = [{kind = "gradient", formula = "1/r + 1/(R - r)", parameters = {R = 4}}, {kind = "consensus"}]\n'
        "start = {q = [[0, 0], [1, 0]]}\n"
    )
    assert main(["plot", "two.toml", "--kind", "spread"]) == 0
    assert main(["animate", "two.toml", "--out", "film.gif", "--fps", "5"]) == 0
    assert names(tmp_path) == ["film.gif", "two-spread.png", "two-spread.svg", "two.toml"]
    from PIL import Image

    with Image.open(tmp_path / "film.gif") as film:
        assert getattr(film, "n_frames", 1) == 3


def test_a_film_lies_beside_its_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write_run(finished(), tmp_path / "run")
    assert main(["animate", str(folder), "--seconds", "0.2", "--fps", "10", "--follow", "--trails"]) == 0
    made = Path(capsys.readouterr().out.strip())
    assert made.parent == tmp_path
    assert made.stem == "run"
    assert made.stat().st_size > 1000


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["plot"], "source must be given"),
        (["plot", "nowhere"], "must be a name that 'flocking list' shows"),
        (["plot", "RUN", "--kind", "ner"], "kind must be one of net, "),
        (["plot", "RUN", "--time", "7"], "must be in the run, from 0 to 2"),
        (["plot", "RUN", "--time", "nan"], "time must be finite"),
        (["plot", "RUN", "--time", "1", "--kind", "energy"], "time can be given for --kind net only"),
        (["plot", "RUN", "--seed", "1"], "seed can be given for a scenario only"),
        (["plot", "RUN", "--theme", "loud"], "theme"),
        (["plot", "RUN", "--out", "file/x"], "must be writable"),
        (["plot", "."], "not a run"),
        (["plot", "same.toml"], "must not place agents 0 and 1 at the same point"),
        (["animate", "RUN", "--out", "film.avi"], "must end in .mp4 or .gif"),
        (["animate", "RUN", "--out", "film.gif", "--fps", "0"], "fps must be at least 1"),
        (["animate", "RUN", "--out", "film.gif", "--fps", "9" * 30], "fps must be at most 240"),
        (["animate", "RUN", "--out", "film.gif", "--fps", "2.5"], "--fps must be an integer"),
        (["animate", "RUN", "--out", "film.gif", "--seconds", "1e300"], "must not take more than 100000 pictures"),
        (["animate", "RUN", "--out", "taken.gif"], "cannot be written"),
        (["animate", "RUN", "--out", "film.gif", "--seconds", "-1"], "seconds must be greater than 0"),
        (["animate", "RUN", "--out", "file/x.gif"], "must be writable"),
    ],
)
def test_bad_input_is_told_in_a_line(
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    (tmp_path / "same.toml").write_text(FALL)
    (tmp_path / "taken.gif").mkdir()
    assert main([str(folder) if word == "RUN" else word for word in words]) == 2
    shown = capsys.readouterr()
    assert message in shown.err
    assert shown.out == ""
    assert names(tmp_path) == ["file", "same.toml", "taken.gif"]


def test_a_picture_of_a_run_that_could_not_go_on_is_no_success(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "fall.toml").write_text(FALL.replace("[[0, 0], [0, 0]]", "[[0, 0], [1, 0]], p = [[0, 0], [-90, 0]]"))
    monkeypatch.setattr(ExactSession, "advance", _stops)
    assert main(["plot", "fall.toml", "--out", "a.svg"]) == 1
    assert "drawn up to that time" in capsys.readouterr().err


def _stops(session: ExactSession, *given: float) -> None:
    raise fk.StepTooSmall("The step shrank to rounding.", time=0.0)


@pytest.mark.parametrize("words", [("plot", "ten.toml"), ("animate", "ten.toml"), ("equations", "tanner-2003-fixed")])
def test_nothing_is_made_of_a_run_that_was_interrupted(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(session: ExactSession, *given: float) -> None:
        signal.raise_signal(signal.SIGINT)
        return advance(session, *given)

    monkeypatch.chdir(tmp_path)
    fk.write_scenario(scenario(), tmp_path / "ten.toml")
    advance = ExactSession.advance
    monkeypatch.setattr(ExactSession, "advance", interrupted)
    assert main([*words]) == 130
    shown = capsys.readouterr()
    assert shown.out == ""
    assert "interrupted" in shown.err
    assert [path.name for path in tmp_path.iterdir()] == ["ten.toml"]


def test_a_film_of_a_run_whose_name_has_a_point_has_that_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = write_run(finished(), tmp_path / "gain-0.5")
    assert main(["animate", str(folder), "--seconds", "0.1", "--fps", "10"]) == 0
    made = Path(capsys.readouterr().out.strip())
    assert made.name in ("gain-0.5.mp4", "gain-0.5.gif")
    assert made.is_file()
