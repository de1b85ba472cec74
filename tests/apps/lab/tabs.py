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
    """Stands between a browser and a page, and can be cut."""

    def __init__(self, to):
        self._to, self._ends = to, []
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

    def go(self, name):
        self.tab.get_by_role("tab", name=name, exact=True).click()

    def press(self, name):
        self.tab.get_by_role("button", name=name, exact=True).click()

    def buttons(self, name):
        """How many buttons of a name the page has."""
        return self.tab.get_by_role("button", name=name, exact=True).count()

    def choose(self, label, option):
        self.tab.get_by_role("combobox", name=label).click()
        self.tab.get_by_role("option", name=option, exact=True).click()

    def field(self, label):
        """The field for text or numbers that stands beside a label."""
        words = f"//*[normalize-space(text())='{label}']/ancestor::div[.//input or .//textarea][1]"
        return self.tab.locator(f"xpath={words}").locator("input:visible, textarea:visible").first

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
        # A browser without a graphics card says so in front of the picture.
        self.tab.screenshot(path=str(SHOTS / f"{name}.png"), style=".mantine-Notification-root { display: none }")

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
        before = len(page.server.get_clients())
        super().__init__(browser, page.address)
        wait(lambda: len(page.server.get_clients()) > before, "the page connects")

    def caught_up(self):
        """Wait until the page shows the last frame and the view it was told."""
        page = self.page
        page.clock.do(lambda: None)
        painted = page.scene.painted
        page.scene.repaint()
        wait(lambda: page.scene.painted > painted, "the frame is painted")
        self.reads(f"t = {page.clock.frame.time:.4g}")
        self.drawn()

    def on_screen(self, point):
        """Pixel at which a point of the scene is seen."""
        camera = next(iter(self.page.server.get_clients().values())).camera
        box = self.tab.locator("canvas").first.bounding_box()
        forward = camera.look_at - camera.position
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, camera.up_direction)
        right /= np.linalg.norm(right)
        up = np.cross(right, forward)
        offset = np.asarray(point) - camera.position
        depth = offset @ forward
        scale = box["height"] / 2 / np.tan(camera.fov / 2) / depth
        return (
            box["x"] + box["width"] / 2 + scale * (offset @ right),
            box["y"] + box["height"] / 2 - scale * (offset @ up),
        )

    def drag(self, point, right, down, arrived):
        """Drag what is at a point of the scene by so many pixels; try again where a busy browser took no notice."""
        end = time.monotonic() + PATIENCE
        mouse = self.tab.mouse
        while True:
            self.drawn()
            x, y = self.on_screen(point)
            mouse.move(x, y)
            self.drawn()
            mouse.down()
            for k in range(1, 11):
                mouse.move(x + right * k / 10, y + down * k / 10)
                self.drawn()
            mouse.up()
            self.drawn()
            self.page.clock.do(lambda: None)
            if arrived():
                return x, y
            assert time.monotonic() < end, "the drag did not arrive"
