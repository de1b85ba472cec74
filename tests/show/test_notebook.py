"""Objects in a notebook: pages that fold, figures and films that show themselves, representations of a line."""

from __future__ import annotations

from html.parser import HTMLParser

import numpy as np
import pytest

import flocking as fk
from flocking.show.film import Film, Pictures

SHORTEST = 10
"""Lines that a representation may have at most."""


class Nesting(HTMLParser):
    def __init__(self):
        super().__init__()
        self.open = []
        self.folded = 0

    def handle_starttag(self, tag, attrs):
        if tag not in ("br", "img", "meta"):
            self.open.append(tag)
        self.folded += tag == "details"

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def objects(run):
    law = run.scenario.law
    many = np.arange(400.0).reshape(-1, 2)
    return [
        law, run.scenario, run, fk.audit(run), fk.certify(run.scenario), run.state(0), fk.State(many),
        fk.PointMass(np.arange(1.0, 200.0)), fk.Fixed(81, [(k, k + 1) for k in range(80)]), law.graph, *law.terms,
        fk.Potential("1/r"), fk.check_potential("1/r**2 + log(r**2)"), fk.papers.paper("shi-2009"),
        fk.audit(run).results[0],
    ]  # fmt: skip


def test_every_object_is_represented_in_few_lines(run):
    for each in objects(run):
        text = repr(each)
        assert len(text.splitlines()) < SHORTEST, type(each)
        # One line of thousands of characters fills a terminal, too.
        assert len(text) < 80 * SHORTEST, type(each)


def test_objects_of_a_notebook_fold(run):
    for each in objects(run)[:5]:
        page = Nesting()
        page.feed(each._repr_html_())
        assert page.open == []
        assert page.folded >= 1, type(each)


def test_an_audit_in_a_notebook_has_every_verdict_and_typeset_statements(run):
    report = fk.audit(run)
    text = report._repr_html_()
    for result in report.results:
        assert f">{result.claim.key}<" in text
    assert text.count("<tr>") == len(report.results) + 1


def test_figures_show_themselves(run):
    picture = fk.plot(run, "net")
    assert picture._repr_png_().startswith(b"\x89PNG")


@pytest.mark.parametrize("ending", ["svg", "png", "pdf"])
def test_a_path_with_an_ending_gives_that_file_alone(run, tmp_path, ending):
    fk.plot(run, "net", save_as=tmp_path / f"x.{ending}")
    assert [path.name for path in tmp_path.iterdir()] == [f"x.{ending}"]


def test_a_path_with_another_point_keeps_its_name(run, tmp_path):
    fk.plot(run, "net", save_as=tmp_path / "gain-0.5")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["gain-0.5.png", "gain-0.5.svg"]


def test_a_film_shows_itself_and_is_named_where_it_is_gone(run, tmp_path):
    film = fk.animate(run, tmp_path / "film.gif", seconds=0.2, size=1.0, dpi=40)
    assert film == tmp_path / "film.gif"
    assert isinstance(film, Film)
    assert film._repr_html_().startswith('<img src="data:image/gif;base64,')
    film.unlink()
    assert film._repr_html_() == f"<code>{tmp_path / 'film.gif'}</code>"


def test_progress_of_a_film_is_told_after_two_seconds_and_not_before(monkeypatch, capsys):
    now = [0.0]
    monkeypatch.setattr("flocking.engine.driver.waits.time.monotonic", lambda: now[0])
    monkeypatch.setattr("flocking.engine.driver.waits.TICK_SECONDS", 1e6)
    with Pictures(True, 4) as drawn:
        for second in (1.0, 6.0, 12.0):
            now[0] = second
            drawn.count()
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["film: 2 of 4 pictures, about 6 s left"]
    with Pictures(False, 4) as silent:
        now[0] = 100.0
        silent.count()
    assert capsys.readouterr().err == ""


def test_connectivity_of_frames_is_that_of_the_spectrum():
    from flocking.model.graphs.connectivity import components
    from flocking.show.group_series import _fiedler_values

    rng = np.random.default_rng(0)
    matrices = []
    for share in (0.02, 0.3, 0.3, 0.6):
        upper = np.triu(rng.random((30, 30)) < share, 1)
        matrices.append(upper | upper.T)
    matrices.append(matrices[-1])
    flocks = np.array([int(components(links).max()) + 1 for links in matrices])
    assert flocks[0] > 1
    for links, found in zip(matrices, _fiedler_values(matrices, flocks), strict=True):
        laplacian = np.diag(links.sum(axis=1)) - links.astype(float)
        assert found == pytest.approx(max(np.sort(np.linalg.eigvals(laplacian).real)[1], 0.0), abs=1e-9)


def test_figures_can_be_pickled(run):
    import pickle

    picture = fk.plot(run, "net")
    assert pickle.loads(pickle.dumps(picture))._repr_png_() == picture._repr_png_()
