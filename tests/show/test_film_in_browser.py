"""An MP4 as it is written plays in a browser, from the report as well."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import flocking as fk
from flocking.apps.reproduction.report_page import card, embedded

PLAYED = """async () => {
  const film = document.querySelector("video");
  const moved = new Promise(done => film.ontimeupdate = () => film.currentTime > 0.1 && done());
  await film.play();
  await moved;
  return [film.currentTime, film.duration, film.videoWidth, film.videoHeight];
}"""


@pytest.mark.browser
def test_a_film_plays_in_chromium(run, tmp_path: Path) -> None:
    from playwright.sync_api import sync_playwright

    film = fk.animate(run, tmp_path / "film.mp4", fps=10, seconds=2.0, size=2.01, dpi=101)
    page = tmp_path / "page.html"
    page.write_text(card(embedded(film, "video/mp4"), "A film.", video=True))
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        shown = browser.new_page()
        shown.goto(page.as_uri())
        at, duration, width, height = shown.evaluate(PLAYED)
        browser.close()
    assert duration == pytest.approx(2.0, abs=0.11)
    assert 0.1 < at <= duration
    assert (width, height) == (202, 202)
