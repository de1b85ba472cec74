"""A notebook in a Jupyter kernel: figures without magic, pages of objects, films, progress and the lab in a cell."""

from __future__ import annotations

import functools
import http.server
import re
import shutil
import threading

import pytest

from tests.apps.lab.tabs import FLAGS, NAMES, SHOTS

CELLS = {
    "law": "import flocking as fk\n"
    "law = fk.Law(fk.Proximity(4.0), [fk.Gradient(fk.Potential('(r - 1)**2/2')), fk.Consensus()])\nlaw",
    "scenario": "start = fk.start.box(5, side=2, speed=1, seed=0)\n"
    "scenario = fk.Scenario(law, start, t_end=2, frames=21)\nscenario",
    "run": "run = fk.simulate(scenario)\nrun",
    "audit": "fk.audit(run)",
    "figure": "fk.plot(run, 'net', trails=True)",
    "film": "fk.animate(run, 'film.gif', seconds=0.3, size=1.5, dpi=50)",
    "certificates": "fk.certify(run.scenario)",
    "sweep": "table = fk.sweep(lambda gain, seed: scenario.with_(law=fk.Law(law.graph, [fk.Consensus(gain)])),\n"
    "    grid={'gain': [0.5, 1.0]}, seeds=2, workers=1)\ntable",
    "sweep figure": "table.plot('gain', 'velocity_spread')",
    "progress": "from flocking.engine.driver import waits\n"
    "waits.QUIET_SECONDS = 0.0\ndone = fk.simulate(scenario.with_(t_end=40.0))",
    "progress of runs": "done = fk.simulate_many([scenario] * 60)",
    "lab": "page = fk.lab(scenario)\npage",
}


@pytest.mark.browser
def test_a_notebook_in_a_kernel_shows_everything_and_the_lab_runs_in_its_cell(tmp_path):
    import nbclient
    import nbconvert
    import nbformat
    from playwright.sync_api import sync_playwright

    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(text) for text in CELLS.values()])
    client = nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}})
    chromium = next(filter(None, map(shutil.which, NAMES)))
    with client.setup_kernel():
        for number, cell in enumerate(notebook.cells):
            client.execute_cell(cell, number)
        outputs = dict(zip(CELLS, (cell.outputs for cell in notebook.cells), strict=True))
        shown = {name: found[-1].get("data", {}) if found else {} for name, found in outputs.items()}
        assert "<math" in shown["law"]["text/html"]
        for name in ("law", "scenario", "run", "audit", "certificates", "sweep"):
            assert "<details" in shown[name]["text/html"], name
            assert len(shown[name]["text/plain"].splitlines()) < 10, name
        assert shown["figure"]["image/png"]
        assert shown["sweep figure"]["image/png"]
        assert shown["film"]["text/html"].startswith("<img src")
        told = [shown[name]["text/plain"] for name in ("progress", "progress of runs")]
        assert re.match(r"simulation: t = .* of 40 \(\d+ %\), .*agent-steps/s", told[0])
        assert re.match(r"runs: \d+ of 60", told[1])
        # The opening of a run has a line of its own where it is long enough to be shown.
        assert len(outputs["progress"]) <= 2, "a line is written over"
        assert len(outputs["progress of runs"]) == 1, "it is written over"
        (tmp_path / "page.html").write_text(nbconvert.HTMLExporter().from_notebook_node(notebook)[0])
        handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=str(tmp_path))
        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with sync_playwright() as play:
            browser = play.chromium.launch(executable_path=chromium, args=list(FLAGS))
            tab = browser.new_page(viewport={"width": 1100, "height": 900})
            tab.goto(f"http://127.0.0.1:{server.server_port}/page.html", wait_until="domcontentloaded")
            frame = tab.frame_locator("iframe[title='flocking lab']")
            # Orders are refused until the page is connected, which the number of agents shows.
            frame.locator("#size", has_text=re.compile("[0-9]")).wait_for(timeout=60_000)
            frame.get_by_role("button", name="Play", exact=True).click()
            frame.locator("#strips button[data-claim]").first.wait_for(timeout=60_000)
            assert not re.fullmatch("t = 0", frame.locator("#clock").text_content())
            for image in tab.locator("img").all():
                assert image.evaluate("(x) => x.naturalWidth") > 50
            SHOTS.mkdir(parents=True, exist_ok=True)
            tab.screenshot(path=str(SHOTS / "notebook.png"), full_page=True)
            browser.close()
        server.shutdown()
        server.server_close()
