"""margins, as a shell sees it, where nothing is computed."""

from __future__ import annotations

from pathlib import Path

import pytest

from flocking.apps.cli import main
from flocking.apps.commands.margin_command import _drawn


@pytest.mark.parametrize(
    "words",
    [
        ["zhou-2015"],
        ["--vary", "loss"],
        ["--levels", "loss=0,0.1"],
        ["--seeds", "2"],
        ["--period", "0.1"],
        ["--t-end", "3"],
        ["--width", "0.2"],
        ["--share", "1"],
        ["--most-runs", "9"],
        ["--cluster", "tcp://127.0.0.1:1"],
        ["--json"],
    ],
)
def test_an_option_that_would_do_nothing_is_refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["margins", *words, "--papers"]) == 2
    assert "must be absent with --papers" in capsys.readouterr().err


def test_a_scenario_of_a_paper_is_drawn_whatever_lies_in_the_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "zhou-2015").mkdir()
    (tmp_path / "shi-2009").write_text("t_end = 1")
    assert _drawn("zhou-2015")
    assert _drawn("shi-2009")
