"""The lab's own server, asked by those who are not to be let in: nothing is opened, nothing is obeyed."""

import asyncio
import http.client
import re
import signal
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import flocking as fk
from tests.apps.lab.foreign import HOSTS, ORIGINS, OWN, PORT, TOKENS, WAYS_OUT, handshake
from tests.apps.lab.tabs import wait
from tests.counting import count

pytestmark = pytest.mark.server


def here(text, page):
    """What was written for another port and token, for this page's."""
    text = text.replace(str(PORT + 1), "1").replace(str(PORT), str(page.server.get_port()))
    return text.replace("secret", page._guarded.access.token)


def answer(page, path, headers):
    connection = http.client.HTTPConnection("127.0.0.1", page.server.get_port(), timeout=30)
    connection.putrequest("GET", path, skip_host=True)
    for name, value in headers:
        connection.putheader(name, value)
    connection.endheaders()
    found = connection.getresponse()
    status, words = found.status, found.read()
    headers = dict(found.getheaders())
    connection.close()
    return status, words, headers


def test_the_lab_s_own_page_is_answered(page):
    status, words, headers = answer(page, here("/secret/", page), [("Host", here(OWN, page))])
    assert status == 200
    assert b"<html" in words
    assert headers["Referrer-Policy"] == "no-referrer"
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[\w-]{32}/", page.address)
    assert answer(page, here("/secret", page), handshake(here(OWN, page), f"http://{here(OWN, page)}"))[0] == 101


def test_pages_of_other_origins_are_refused(page):
    for origin in ORIGINS:
        origin = here(origin, page)
        status, words, _ = answer(page, here("/secret", page), handshake(here(OWN, page), origin))
        assert (status, b"<html" in words) == (403, False), origin
        headers = [("Host", here(OWN, page)), ("Origin", origin)]
        assert answer(page, here("/secret/", page), headers)[0] == 403, origin
        count("lab: requests of foreign origins to its server", 2)


def test_forged_hosts_are_refused(page):
    for host in HOSTS:
        host = here(host, page)
        # A browser trims what stands around a value.
        expected = {101} if host.strip() == here(OWN, page) else {400, 403}
        assert answer(page, here("/secret", page), handshake(host, f"http://{host.strip()}"))[0] in expected, host
        count("lab: requests with a forged host to its server", 101 not in expected)


def test_addresses_without_the_token_are_refused(page):
    own = [("Host", here(OWN, page))]
    for path in filter(str.isascii, filter(None, TOKENS)):
        status, words, _ = answer(page, here(path, page), own)
        assert (status, b"<html" in words) == (403, False), path
        count("lab: requests without the token to its server")
    assert answer(page, "/", own)[1].startswith(b"This address lacks the lab's token")


def order(page, origin, path, *messages):
    """Send a page's orders as a script would; whether the server took them."""
    import viser
    from websockets.asyncio.client import connect
    from websockets.exceptions import InvalidStatus

    async def send():
        address = f"ws://127.0.0.1:{page.server.get_port()}{path}"
        try:
            async with connect(address, origin=origin, subprotocols=[f"viser-v{viser.__version__}"]) as socket:
                await socket.recv()
                for message in messages:
                    await socket.send(message)
                    await asyncio.sleep(0.5)
        except InvalidStatus as error:
            return error.response.status_code
        return 101

    # The browser of other tests may hold an event loop in this thread.
    with ThreadPoolExecutor(1) as another:
        return another.submit(asyncio.run, send()).result()


def pressed(handle):
    """The messages that a browser sends when it has opened a page, and a button is pressed."""
    import msgspec

    camera = {
        "type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [0.0, 0.0, 9.0], "fov": 1.0,
        "near": 0.1, "far": 99.0, "image_height": 9, "image_width": 9, "look_at": [0.0, 0.0, 0.0],
        "up_direction": [0.0, 1.0, 0.0],
    }  # fmt: skip
    button = {"type": "GuiUpdateMessage", "uuid": handle._impl.uuid, "updates": {"value": True}}
    return [msgspec.msgpack.encode(message) for message in (camera, button)]


def test_play_is_pressed_by_the_lab_s_own_page_alone(page):
    own, path = f"http://{here(OWN, page)}", here("/secret", page)
    for origin, way in (("http://elsewhere.invalid", path), (None, path), (own, "/"), (own, "/wrong")):
        assert order(page, origin, way, *pressed(page.banner.toggle)) == 403
        page.clock.do(lambda: None)
        assert not page.clock.playing
    # The same message from the own page is obeyed: it would have been seen.
    assert order(page, own, path, *pressed(page.banner.toggle)) == 101
    wait(lambda: page.clock.playing, "it plays")


def test_no_file_outside_the_folder_is_opened(page, tmp_path):
    outside = tmp_path.parent / f"{tmp_path.name}-outside"
    outside.mkdir()
    fk.write_scenario(page.experiment.original, outside / "there.toml")
    run = fk.simulate(page.experiment.original.with_(t_end=0.2, frames=3), progress=False)
    fk.write_run(run, outside / "run")
    (tmp_path / "out.toml").symlink_to(outside / "there.toml")
    (tmp_path / "nothing.toml").symlink_to(outside / "absent.toml")
    (tmp_path / "door").symlink_to(outside)
    page.offer()
    assert not {"out.toml", "nothing.toml", "door"} & {
        *page.transport.scenario.options,
        *page.file_panel.folder.options,
    }
    before = page.experiment
    page._requests.take = lambda: True  # how often is asked elsewhere
    for name in WAYS_OUT:
        if name in ("below/chunk",):
            continue
        for way in (page.load, page.file_panel.open_run):
            page.last_error = ""
            try:
                way(name.format(out=outside))
            except fk.InvalidInput as error:
                page.last_error = str(error)
            assert "must be that of something in the folder" in page.last_error, (name, page.last_error)
            count("lab: names that lead out of its folder")
    for name in (f"{outside}/run", "door/run", "../" + outside.name + "/run"):
        with pytest.raises(fk.InvalidInput):
            page.file_panel.open_run(name)
    assert page.experiment is before
    assert page.file_panel.stored is None
    fk.write_run(run, tmp_path / "run")
    page.file_panel.open_run("run")
    assert np.array_equal(page.file_panel.stored.q, run.q)
    fk.write_scenario(page.experiment.original, tmp_path / "here.toml")
    page.load("here.toml")
    assert page.experiment is not before


def test_saving_does_not_follow_a_link_out_of_the_folder(page, tmp_path, monkeypatch):
    from flocking.apps.lab.panels import file_panel

    monkeypatch.setattr(file_panel.time, "strftime", lambda *_: "now")
    target = tmp_path.parent / f"{tmp_path.name}-taken"
    (tmp_path / "ten-now.toml").symlink_to(target)
    page.file_panel.save_scenario()
    assert page.file_panel.saved[-1].name == "ten-now-2.toml"
    assert not target.exists()


def test_orders_that_come_too_often_are_refused(page):
    for _ in range(40):
        page.load("absent.toml")
    assert "must be at most" in page.last_error


def test_a_server_that_asks_nobody_is_not_trusted(monkeypatch):
    """As when another version of viser served in another way."""
    from contextlib import nullcontext

    from flocking.apps.lab import server

    monkeypatch.setattr(server, "guarding", lambda access: nullcontext())
    with pytest.raises(fk.InvalidInput, match="connections can be checked"):
        server.opened(None)


def test_a_lab_ends_by_an_interrupt_that_was_raised_where_a_library_drops_it(monkeypatch, tmp_path):
    from flocking.apps.lab.server import lab

    monkeypatch.setattr("flocking.engine.interruption.RAISED", True)
    found = []
    running = threading.Thread(target=lambda: found.append(lab(folder=tmp_path, browser=False, wait=True)), daemon=True)
    running.start()
    running.join(60.0)
    assert found
    assert found[0].clock.closed


STRUCK = """
import http.client, os, signal, sys, time

close = http.client.HTTPResponse.close

def struck(self):
    http.client.HTTPResponse.close = close
    os.kill(os.getpid(), signal.{number})
    time.sleep(0)
    close(self)

http.client.HTTPResponse.close = struck
sys.argv = ["flocking", "lab", "--folder", {folder!r}, "--no-browser"]
from flocking.__main__ import main
sys.exit(main())
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_lab_ends_by_a_signal_while_an_answer_of_its_server_is_closed(tmp_path, number):
    """Python itself closes what nobody holds, and drops what is raised there."""
    program = STRUCK.format(number=number.name, folder=str(tmp_path))
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)
    assert (found.returncode, found.stderr) == (130, "flocking: interrupted; no file was left incomplete.\n")
    assert "The lab is open" not in found.stdout
