"""Tabs of a real browser, with all they asked for. Everything waits for conditions, nothing for a time."""

import contextlib
import os
import re
import socket
import threading
import time
from pathlib import Path

import numpy as np

NAMES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync",
    # A browser asks its maker for this and that: here it finds no other machine.
    "--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1",
)  # fmt: skip
SHOTS = Path(os.environ.get("LAB_SCREENSHOTS", Path(__file__).parents[3] / "out" / "lab"))
PATIENCE = 60.0
"""Seconds anything may take."""

TWO_PICTURES = "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(1))))"


def wait(condition, what):
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, f"did not happen in time: {what}"
        time.sleep(0.05)


class Wire:
    """Stands between a browser and a page, and can be cut; while it is shut nothing passes it."""

    def __init__(self, to):
        self._to, self._ends, self.shut = to, [], False
        self._door = socket.create_server(("127.0.0.1", 0))
        self.port = self._door.getsockname()[1]

    def __enter__(self):
        threading.Thread(target=self._serve, daemon=True).start()
        return self

    def __exit__(self, *_):
        self._door.close()
        self.cut()

    def cut(self):
        ends, self._ends = self._ends, []
        for end in ends:
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()

    def _serve(self):
        with contextlib.suppress(OSError):  # the door is closed
            while True:
                here = self._door.accept()[0]
                if self.shut:
                    here.close()
                    continue
                there = socket.create_connection(("127.0.0.1", self._to))
                self._ends += [here, there]
                for pair in ((here, there), (there, here)):
                    threading.Thread(target=self._carry, args=pair, daemon=True).start()

    @staticmethod
    def _carry(source, target):
        with contextlib.suppress(OSError):  # cut
            while data := source.recv(65536):
                target.sendall(data)
        with contextlib.suppress(OSError):
            target.shutdown(socket.SHUT_WR)


class Tab:
    """One tab, opened at an address."""

    def __init__(self, browser, address):
        self.tab = browser.new_page(viewport={"width": 1200, "height": 800})
        self.tab.set_default_timeout(1000 * PATIENCE)
        self.asked, self.faults = [], []
        self.tab.on("request", lambda r: self.asked.append(r.url))
        self.tab.on("websocket", lambda w: self.asked.append(w.url))
        self.tab.on("pageerror", lambda e: self.faults.append(str(e)))
        self.tab.goto(address)
        self.tab.get_by_role("button", name=re.compile("^(Play|Pause)$")).wait_for()

    def press(self, name):
        self.tab.get_by_role("button", name=name, exact=True).first.click()

    def open(self, name):
        """Open one of the dialogs."""
        self.tab.locator(f"#{name}").click()
        self.tab.locator("#dialog[open]").wait_for()

    def ask(self, words, argument=None):
        """A value that the page computes."""
        return self.tab.evaluate(words, argument)

    def tool(self, name):
        """Take a hand."""
        self.tab.locator(f"[data-tool={name}]").click()

    def control(self, label):
        """The row of a parameter of the law."""
        return self.tab.locator("#law label.row").filter(
            has=self.tab.locator(f"xpath=./span[1][normalize-space()='{label}']")
        )

    def claim(self, key):
        """The button of a claim in the timeline."""
        return self.tab.locator(f"#strips button[data-claim='{key}']")

    def colours(self, x, y, size=1):
        """Colours of a square of pixels of the scene around a place, as rows of red, green and blue."""
        found = self.ask(
            """([x, y, size]) => {
            const c = lab.scene.canvas, k = c.width / c.getBoundingClientRect().width;
            const s = Math.round(size * k), at = [x, y].map((v) => Math.round(v * k - s / 2));
            return [...c.getContext("2d").getImageData(...at, s, s).data];
        }""",
            [x, y, size],
        )
        return np.array(found).reshape(-1, 4)[:, :3]

    def reads(self, text):
        """Wait until a text stands on the page."""
        self.tab.get_by_text(text).first.wait_for()

    def wait(self, condition, what):
        """Wait while the browser's own events are served."""
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end, f"did not happen in time: {what}"
            self.tab.wait_for_timeout(50)

    def drawn(self):
        """Wait until the browser has drawn what it has."""
        self.tab.evaluate(TWO_PICTURES)

    def shot(self, name):
        self.drawn()
        SHOTS.mkdir(parents=True, exist_ok=True)
        self.tab.screenshot(path=str(SHOTS / f"{name}.png"))

    def close(self):
        """Close it; nothing may have been asked of another machine, and nothing may have gone wrong in the page."""
        strays = {url for url in self.asked if not re.match(r"(data|blob|about):", url)}
        hosts = {re.sub(r"^\w+://", "", url).split("/")[0].split(":")[0] for url in strays}
        assert self.asked
        assert hosts <= {"127.0.0.1"}, hosts
        assert not self.faults, self.faults
        self.tab.close()


class LabTab(Tab):
    """A tab of a page that runs in this process."""

    def __init__(self, browser, page):
        self.page = page
        before = len(page.hub.tabs)
        super().__init__(browser, page.address)
        self.wait(lambda: len(page.hub.tabs) > before, "the page connects")
        self.caught_up()

    def caught_up(self):
        """Wait until the page has painted the last frame."""
        page = self.page
        page.clock.do(lambda: None)
        number = page.clock.frame.number
        self.wait(lambda: self.ask("() => lab.scene.frame?.number ?? -1") >= number, "the frame arrives")
        self.drawn()

    def on_screen(self, point):
        """Place in the scene at which a point of the world is painted."""
        return self.ask("(p) => lab.scene.camera.world(p).slice(0, 2)", [float(x) for x in point])

    def agent(self, i):
        """Place in the scene at which an agent is painted."""
        return self.ask("(i) => [lab.scene.sx[i], lab.scene.sy[i]]", i)

    def click(self, x, y):
        """Click a place of the scene."""
        self.tab.locator("#canvas").click(position={"x": x, "y": y})

    def drag(self, place, right, down):
        """Drag from a place of the scene by so many pixels."""
        box = self.tab.locator("#canvas").bounding_box()
        x, y = box["x"] + place[0], box["y"] + place[1]
        mouse = self.tab.mouse
        mouse.move(x, y)
        mouse.down()
        for k in range(1, 6):
            mouse.move(x + right * k / 5, y + down * k / 5)
        mouse.up()
        self.drawn()
