"""The name of a scenario may be any text, from a file of somebody else too: it stays one line where lines mean much."""

from __future__ import annotations

from pathlib import Path

import flocking as fk
from flocking.engine.driver.lammps_export import export_deck
from flocking.engine.driver.waits import Wait

NAME = "two\nshell echo lines\x1b[31m"


def test_a_name_is_one_comment_in_files_of_lammps(tmp_path: Path) -> None:
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
    made = fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]]), t_end=1.0, frames=2, name=NAME)
    folder = export_deck(made, tmp_path / "deck").parent
    for file in folder.iterdir():
        lines = file.read_text().splitlines()
        assert not any(line.startswith("shell") for line in lines)
    first, second, third = (folder / "data.flocking").read_text().splitlines()[:3]
    assert first == r"two\nshell echo lines\x1b[31m: 2 agents"
    assert (second, third) == ("", "2 atoms")


def test_the_line_of_a_wait_has_no_characters_that_steer_a_terminal() -> None:
    with Wait(NAME, 2, shown=False) as wait:
        assert wait.line(0.0).startswith(r"two\nshell echo lines\x1b[31m: 0 of 2")
