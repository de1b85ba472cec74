"""The lab's own server, asked by those who are not to be let in: nothing is opened, nothing is obeyed."""

import asyncio
import http.client
import os
import re
import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import flocking as fk
from flocking.apps.lab.access.peer_users import TABLES
from flocking.apps.lab.panels.catalogue import catalogue
from tests.apps.lab.foreign import HOSTS, ORIGINS, OWN, PORT, TOKENS, WAYS_OUT, handshake
from tests.apps.lab.tabs import wait
from tests.counting import count

pytestmark = pytest.mark.server

NOBODY = 65534


def here(text, page):
    """What was written for another port and token, for this page's."""
    text = text.replace(str(PORT + 1), "1").replace(str(PORT), str(page.server.port))
    return text.replace("secret", page.server.access.token)


def answer(page, path, headers):
    connection = http.client.HTTPConnection("127.0.0.1", page.server.port, timeout=30)
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
    assert answer(page, here("/secret/live", page), handshake(here(OWN, page), f"http://{here(OWN, page)}"))[0] == 101


def test_pages_of_other_origins_are_refused(page):
    for origin in ORIGINS:
        origin = here(origin, page)
        status, words, _ = answer(page, here("/secret/live", page), handshake(here(OWN, page), origin))
        assert (status, b"<html" in words) == (403, False), origin
        headers = [("Host", here(OWN, page)), ("Origin", origin)]
        assert answer(page, here("/secret/", page), headers)[0] == 403, origin
        count("lab: requests of foreign origins to its server", 2)


def test_forged_hosts_are_refused(page):
    for host in HOSTS:
        host = here(host, page)
        # A browser trims what stands around a value.
        expected = {101} if host.strip() == here(OWN, page) else {400, 403}
        assert answer(page, here("/secret/live", page), handshake(host, f"http://{host.strip()}"))[0] in expected, host
        count("lab: requests with a forged host to its server", 101 not in expected)


def test_addresses_without_the_token_are_refused(page):
    own = [("Host", here(OWN, page))]
    for path in filter(str.isascii, filter(None, TOKENS)):
        status, words, _ = answer(page, here(path, page), own)
        assert (status, b"<html" in words) == (403, False), path
        count("lab: requests without the token to its server")
    assert answer(page, "/", own)[1].startswith(b"This address lacks the lab's token")


def test_the_page_and_its_files_are_answered_and_nothing_else(page):
    own = [("Host", here(OWN, page))]
    for name, kind in (("style.css", "text/css"), ("main.js", "text/javascript"), ("mathematics.woff", "font/woff")):
        status, _, headers = answer(page, here(f"/secret/{name}", page), own)
        assert status == 200
        assert headers["Content-Type"].startswith(kind)
        assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
        assert answer(page, here(f"/{name}", page), own)[0] == 403
        assert answer(page, here(f"/wrong/{name}", page), own)[0] == 403
    for path in (
        "/secret/absent.js",
        "/secret/../page.py",
        "/secret/%2e%2e/page.py",
        "/secret/live",
        "/secret//main.js",
    ):
        assert answer(page, here(path, page), own)[0] == 404, path
    other = handshake(here(OWN, page), f"http://{here(OWN, page)}")
    for path in ("/secret/", "/secret/main.js", "/secret/live/more"):
        assert answer(page, here(path, page), other)[0] == 404, path
    status, _, headers = answer(page, here("/secret", page), own)
    assert (status, headers["Location"]) == (301, here("/secret/", page))


def test_only_a_lab_that_a_notebook_shows_may_be_shown_inside_one(page):
    own = [("Host", here(OWN, page))]
    shown = page._repr_html_()
    assert f'src="{page.address}"' in shown
    policy = answer(page, here("/secret/", page), own)[2]["Content-Security-Policy"]
    assert policy.endswith("frame-ancestors http://localhost:* http://127.0.0.1:* vscode-webview:")


def order(page, origin, path, *messages):
    """Send a page's orders as a script would; whether the server took them."""
    from websockets.asyncio.client import connect
    from websockets.exceptions import InvalidStatus

    async def send():
        address = f"ws://127.0.0.1:{page.server.port}{path}"
        try:
            async with connect(address, origin=origin) as socket:
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


PLAY = '{"kind": "play"}'


def test_play_is_pressed_by_the_lab_s_own_page_alone(page):
    own, path = f"http://{here(OWN, page)}", here("/secret/live", page)
    for origin, way in (("http://elsewhere.invalid", path), (None, path), (own, "/live"), (own, "/wrong/live")):
        assert order(page, origin, way, PLAY) == 403
        page.clock.do(lambda: None)
        assert not page.clock.playing
    # The same message from the own page is obeyed: it would have been seen.
    assert order(page, own, path, PLAY) == 101
    wait(lambda: page.clock.playing, "it plays")


STRANGE = (
    "", "null", "[]", "{}", '{"kind": 3}', '{"kind": "nothing"}', '{"kind": "set"}', '{"kind": "set", "path": 3}',
    '{"kind": "set", "path": ["law", "terms", 99], "value": 1}', '{"kind": "event", "event": {"kind": "set"}}',
    '{"kind": "event", "event": 5}', '{"kind": "event", "event": {"kind": "kick", "agents": [0], "velocity": [1]}}',
    '{"kind": "event", "event": {"kind": "place", "agent": 77, "to": [0, 0]}}', '{"kind": "look", "t": "now"}',
    '{"kind": "branch", "t": 1e9}', '{"kind": "step", "duration": -1}', '{"kind": "speed", "speed": NaN}',
    '{"kind": "load", "name": "../outside.toml"}', '{"kind": "open run", "name": "/etc"}',
    '{"kind": "agent", "agent": -1}',
    '{"kind": "save picture", "data": "AAAA"}', '{"kind": "small picture", "name": "../x.toml"}',
    '{"kind": "try", "path": ["law"], "text": "r"}', '{"kind": "compare", "path": [], "value": 1}', "[" * 100_000,
)  # fmt: skip
"""Messages that are no orders, or ask for what is not possible."""


def test_strange_messages_change_nothing_and_end_nothing(page):
    before = page.experiment.session
    assert order(page, f"http://{here(OWN, page)}", here("/secret/live", page), *STRANGE) == 101
    page.clock.do(lambda: None)
    assert page.experiment.session is before
    assert page.experiment.untouched
    assert page.experiment.time == 0.0
    assert page.files.saved == []
    assert order(page, f"http://{here(OWN, page)}", here("/secret/live", page), PLAY) == 101
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
    offered = [x["name"] for group in catalogue(page.folder)["groups"] for x in group["scenarios"]]
    assert not {"out.toml", "nothing.toml", "door"} & {*offered, *page.files.stored_runs()}
    before = page.experiment
    page._requests.take = lambda: True  # how often is asked elsewhere
    for name in WAYS_OUT:
        if name in ("below/chunk",):
            continue
        for way in (page.load, page.past.open_run):
            page.last_error = ""
            try:
                way(name.format(out=outside))
            except fk.InvalidInput as error:
                page.last_error = str(error)
            assert "must be that of something in the folder" in page.last_error, (name, page.last_error)
            count("lab: names that lead out of its folder")
    for name in (f"{outside}/run", "door/run", "../" + outside.name + "/run"):
        with pytest.raises(fk.InvalidInput):
            page.past.open_run(name)
    assert page.experiment is before
    assert page.past.stored is None
    fk.write_run(run, tmp_path / "run")
    page.past.open_run("run")
    assert np.array_equal(page.past.stored.q, run.q)
    fk.write_scenario(page.experiment.original, tmp_path / "here.toml")
    page.load("here.toml")
    assert page.experiment is not before


def test_saving_does_not_follow_a_link_out_of_the_folder(page, tmp_path, monkeypatch):
    from flocking.apps.lab.panels import saved_files

    monkeypatch.setattr(saved_files.time, "strftime", lambda *_: "now")
    target = tmp_path.parent / f"{tmp_path.name}-taken"
    (tmp_path / "ten-now.toml").symlink_to(target)
    page.files.save_scenario()
    assert page.files.saved[-1].name == "ten-now-2.toml"
    assert not target.exists()


def test_orders_that_come_too_often_are_refused(page):
    said = []
    for _ in range(40):
        with pytest.raises(fk.InvalidInput) as refused:
            page.load("absent.toml")
        said.append("must be at most" in str(refused.value))
    assert said[0] is False
    assert said[-1] is True


def test_a_lab_ends_by_an_interrupt_that_was_raised_where_a_library_drops_it(monkeypatch, tmp_path):
    from flocking.apps.lab.server import lab

    monkeypatch.setattr("flocking.engine.interruption.RAISED", True)
    found = []
    running = threading.Thread(target=lambda: found.append(lab(folder=tmp_path, browser=False, wait=True)), daemon=True)
    running.start()
    running.join(60.0)
    assert found
    assert found[0].clock.closed


@pytest.mark.parametrize("closed", [False, True])
def test_another_user_who_has_the_token_is_refused(page, closed, monkeypatch):
    """Their sockets are made by this process, which acts for them for a moment: only root may."""
    looked_at = []
    judge = page.server.access.judge
    monkeypatch.setattr(page.server.access, "judge", lambda *x: looked_at.append(x) or judge(*x))
    if os.getuid() != 0 or not TABLES[0].exists():
        count("lab: machines where no other user can be acted for")
        return
    os.seteuid(NOBODY)
    try:
        connection = socket.create_connection(("127.0.0.1", page.server.port))
    finally:
        os.seteuid(0)
    own = here(OWN, page)
    headers = "".join(f"{name}: {value}\r\n" for name, value in handshake(own, f"http://{own}"))
    connection.sendall(f"GET {here('/secret/live', page)} HTTP/1.1\r\n{headers}\r\n".encode())
    if closed:
        connection.close()
        time.sleep(0.3)
    else:
        connection.settimeout(30)
        assert b" 403 " in connection.recv(4096)
        connection.close()
    assert looked_at == []
    assert answer(page, here("/secret/", page), [("Host", own)])[0] == 200
    assert len(looked_at) == 1
    count("lab: requests of another user with the token to its server")
