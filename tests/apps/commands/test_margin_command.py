"""margins, as a shell sees it, where nothing is computed."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

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


def test_a_stored_table_that_is_computed_otherwise_is_told(tmp_path, monkeypatch, capsys):
    """Exit code 1, and which paper it is."""
    import flocking.papers.stored_margins as stored

    tables = {"tanner-2003-fixed": [("loss", "0.1")], "zhou-2015": [("loss", "0.2")]}
    monkeypatch.setattr(stored, "PLANS", tables)
    monkeypatch.setattr(stored, "is_stored", lambda key: True)
    monkeypatch.setattr(stored, "as_text", lambda found: "table")
    monkeypatch.setattr(stored, "stored_margins", lambda key: SimpleNamespace(cells=tables[key]))
    computed = dict(tables)
    monkeypatch.setattr(
        stored, "computed_margins", lambda key, **_: SimpleNamespace(status="finished", runs=3, cells=computed[key])
    )
    for said, code in (("as stored", 0), ("not as stored", 1)):
        computed["zhou-2015"] = tables["zhou-2015"] if code == 0 else []
        assert main(["margins", "--papers", "--out", str(tmp_path)]) == code
        printed = capsys.readouterr().out
        assert "tanner-2003-fixed: 3 runs, as stored" in printed
        assert f"zhou-2015: 3 runs, {said}" in printed
