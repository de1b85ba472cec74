"""Numbers that pages state of stored results and of the code beside them are those of the library."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.papers.stored_rates import stored_rates

ROOT = Path(__file__).resolve().parents[3]
README = (ROOT / "README.md").read_text(encoding="utf-8")
LARGE = " ".join((ROOT / "docs" / "large_groups.md").read_text(encoding="utf-8").split())
TWO = (ROOT / "docs" / "two_papers.md").read_text(encoding="utf-8")
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def words(row: str) -> str:
    return " ".join(NUMBER.sub("", row).split())


def test_the_readme_prints_what_its_code_prints(tmp_path, monkeypatch, capsys):
    """Words are the same; estimated errors and residuals may differ from machine to machine, by less than half."""
    monkeypatch.chdir(tmp_path)
    code, printed = re.findall(r"```(?:python)?\n(.*?)```", README, re.DOTALL)[:2]
    exec(code.replace("fk.plot(", "(lambda *a, **k: None)("), {})
    shown = {line.split()[0]: line for line in capsys.readouterr().out.splitlines()}
    for line in printed.splitlines():
        found = shown[line.split()[0]]
        stated, measured = (list(map(float, NUMBER.findall(row))) for row in (line, found))
        np.testing.assert_allclose(measured[: len(stated)], stated, rtol=0.5, err_msg=line)
        # Rows are shortened on the page.
        assert words(found).startswith(words(line))


def test_what_the_page_on_large_groups_says_of_stored_runs_is_so():
    study = fk.papers.vicsek_1995.stored_study()
    runs = {(p.side, p.noise): p for p in study.points if p.noise_kind == "vectorial"}
    # Histograms have 40 equal intervals from 0 to 1.
    share = {key: np.cumsum(p.histogram) for key, p in runs.items()}
    said = re.search(r"These runs have ([\d,]+) updates at L = 32 and ([\d,]+) at L = 64", LARGE)
    assert said
    lengths = [int(text.replace(",", "")) for text in said.groups()]
    assert lengths == [runs[32.0, 0.6154].updates, runs[64.0, 0.61].updates]
    assert lengths == [runs[32.0, 0.6158].updates, runs[64.0, 0.615].updates]
    low, high = re.search(
        r"below 0\.2\) for (\d+) % of its updates and ordered \(above 0\.4\) for (\d+) %", LARGE
    ).groups()
    two = share[32.0, 0.6157]
    assert [int(low), int(high)] == [round(100 * two[7]), round(100 * (1 - two[15]))]
    assert runs[32.0, 0.6157].passages == 1
    said = re.search(
        r"one run of ([\d,]+) updates at 0\.6178 is ordered throughout, one at 0\.617 for (\d+) % with (\d+) "
        r"passages, one of ([\d,]+) at 0\.6185 for ([\d.]+) % with (\d+)", LARGE,
    )  # fmt: skip
    assert said
    ordered = {noise: round(100 * (1 - share[24.0, noise][15]), 1) for noise in (0.6178, 0.617, 0.6185)}
    assert ordered[0.6178] == 100.0
    assert [round(ordered[0.617]), ordered[0.6185]] == [int(said[2]), float(said[5])]
    assert [runs[24.0, noise].passages for noise in (0.617, 0.6185)] == [int(said[3]), int(said[6])]
    passing = {p.noise: p.passages for p in study.points if p.side == 32.0}
    assert passing.pop(0.6168) == 4
    assert max(passing.values()) == 2
    assert {p.passages for p in study.points if p.side == 64.0 and p.noise_kind == "vectorial"} == {0}
    waves = {(w.side, w.noise): w.strength for w in study.waves}
    said = re.search(
        r"strongest wave has ([\d,]+) at the noise 2\.5 and (\d+) at 2\.8.*?still (\d+) and (\d+) at 3 and 3\.2", LARGE
    )
    stated = [int(text.replace(",", "")) for text in said.groups()]
    np.testing.assert_allclose(stated, [waves[64.0, noise] for noise in (2.5, 2.8, 3.0, 3.2)], rtol=0.005)


@pytest.mark.parametrize("column", ["split", "squeeze", "firm", "network", "network-held"])
def test_the_rates_beside_each_other_are_the_stored_ones(column):
    place = ["split", "squeeze", "firm", "network", "network-held"].index(column)
    rows = re.findall(r"^\| [^|]*\(`([a-z-]+)`\) \|(.*)\|$", TWO, re.MULTILINE)
    assert len(rows) == 6
    rates = stored_rates(f"olfati-saber-2006-{column}")
    for claim, cells in rows:
        stated = cells.split("|")[place].strip()
        assert stated == (f"{rates[claim].held} of {rates[claim].decided}" if claim in rates and stated else "")
        assert bool(stated) == (claim in rates)
