"""Who is let in, which files a page may name, and how often it may ask: without any server."""

import os

import pytest

import flocking as fk
from flocking.apps.lab.access.confinement import Folder
from flocking.apps.lab.access.request_checks import (
    FOREIGN,
    HANDSHAKES_A_SECOND,
    MOST_HANDSHAKES,
    MOST_TABS,
    NO_TOKEN,
    TOO_MANY,
    AccessCheck,
    RateLimit,
)
from tests.apps.lab.foreign import HOSTS, ORIGINS, OWN, PORT, TOKENS, WAYS_OUT, handshake
from tests.counting import count


@pytest.fixture
def access():
    found = AccessCheck("secret")
    found.ports.add(PORT)
    return found


def test_the_lab_s_own_page_is_let_in(access):
    for host in (f"127.0.0.1:{PORT}", f"localhost:{PORT}"):
        assert access.judge("/secret/", [("Host", host)]) == "/"
        assert access.judge("/secret", [("host", host)]) == "/"
        assert access.judge("/secret/a/b?websocket=x", [("Host", host)]) == "/a/b"
        assert access.judge("/secret", handshake(host, f"http://{host}")) == "/"


@pytest.mark.parametrize("origin", ORIGINS)
def test_pages_of_other_origins_are_refused(access, origin):
    assert access.judge("/secret", handshake(OWN, origin)) is FOREIGN
    assert access.judge("/secret/", [("Host", OWN), ("Origin", origin)]) is FOREIGN
    assert access.judge("/secret", [*handshake(OWN, f"http://{OWN}"), ("Origin", origin)]) is FOREIGN
    count("lab: requests of foreign origins", 3)


def test_a_handshake_without_an_origin_is_refused(access):
    for mark in ("Upgrade", "upgrade", "Sec-WebSocket-Key"):
        assert access.judge("/secret", [("Host", OWN), (mark, "WebSocket")]) is FOREIGN


@pytest.mark.parametrize("host", HOSTS)
def test_forged_hosts_are_refused(access, host):
    """As when a name of somebody else is made to lead to this machine."""
    assert access.judge("/secret/", [("Host", host)]) is FOREIGN
    assert access.judge("/secret", handshake(host, f"http://{host}")) is FOREIGN
    assert access.judge("/secret/", [("Host", OWN), ("Host", host)]) is FOREIGN
    count("lab: requests with a forged host", 3)


def test_a_request_that_names_no_host_is_refused(access):
    assert access.judge("/secret/", []) is FOREIGN


@pytest.mark.parametrize("path", TOKENS)
def test_addresses_without_the_token_are_refused(access, path):
    assert access.judge(path, [("Host", OWN)]) is NO_TOKEN
    assert access.judge(path, handshake(OWN, f"http://{OWN}")) is NO_TOKEN
    count("lab: requests without the token", 2)


def test_before_the_port_is_known_nobody_is_let_in():
    assert AccessCheck("secret").judge("/secret/", [("Host", OWN)]) is FOREIGN


def test_tokens_are_drawn_anew():
    drawn = {AccessCheck().token for _ in range(100)}
    assert len(drawn) == 100
    assert min(map(len, drawn)) >= 32
    assert all(token.replace("-", "").replace("_", "").isalnum() for token in drawn)


def test_tabs_and_handshakes_are_counted(access):
    own = handshake(OWN, f"http://{OWN}")
    access.tabs = MOST_TABS
    assert access.judge("/secret", own) is TOO_MANY
    access.tabs = 0
    found = [access.judge("/secret", own) for _ in range(2 * MOST_HANDSHAKES)]
    assert found.count("/") >= MOST_HANDSHAKES
    assert found[-1] is TOO_MANY
    # What others ask takes nothing from the lab's own page.
    other = AccessCheck("secret")
    other.ports.add(PORT)
    for _ in range(10 * MOST_HANDSHAKES):
        other.judge("/secret", handshake(OWN, "http://elsewhere.invalid"))
        other.judge("/wrong", own)
    assert other.judge("/secret", own) == "/"


def test_an_allowance_fills_again():
    now = [0.0]
    found = RateLimit(2.0, 3, lambda: now[0])
    assert [found.take() for _ in range(4)] == [True, True, True, False]
    now[0] = 0.5
    assert [found.take(), found.take()] == [True, False]
    now[0] = 1000.0
    assert [found.take() for _ in range(4)] == [True, True, True, False]
    assert found.wait() == pytest.approx(1 / HANDSHAKES_A_SECOND)
    assert found.wait() == pytest.approx(2 / HANDSHAKES_A_SECOND)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "there.toml").write_text("x")
    inside = tmp_path / "inside"
    (inside / "below").mkdir(parents=True)
    (inside / "mine.toml").write_text("x")
    (inside / "near.toml").symlink_to(inside / "mine.toml")
    (inside / "out.toml").symlink_to(tmp_path / "outside" / "there.toml")
    (inside / "nothing.toml").symlink_to(tmp_path / "outside" / "absent.toml")
    (inside / "door").symlink_to(tmp_path / "outside")
    (inside / "below" / "chunk").symlink_to(tmp_path / "outside" / "there.toml")
    return Folder(inside)


def test_names_inside_a_folder_lead_there(folder):
    assert folder.inside("mine.toml") == folder.path / "mine.toml"
    assert folder.inside("near.toml") == folder.path / "mine.toml"
    assert folder.inside("below/absent.toml") == folder.path / "below" / "absent.toml"
    assert folder.inside("..mine") == folder.path / "..mine"


@pytest.mark.parametrize("name", WAYS_OUT)
def test_no_name_leads_out(folder, name):
    with pytest.raises(fk.InvalidInput):
        folder.inside(name.format(out=folder.path.parent / "outside"))
    count("lab: names that lead out of its folder")


def test_the_answer_is_the_same_whether_something_is_there(folder):
    out = folder.path.parent / "outside"
    for here, absent in (
        (f"{out}/there.toml", f"{out}/absent.toml"),
        ("../outside/there.toml", "../outside/absent.toml"),
        ("out.toml", "nothing.toml"),
        ("door/there.toml", "door/absent.toml"),
    ):
        said = []
        for name in (here, absent):
            with pytest.raises(fk.InvalidInput) as found:
                folder.inside(name)
            said.append(str(found.value).replace(name, "NAME"))
        assert said[0] == said[1]


def test_outside_a_folder_nothing_is_looked_at(folder, monkeypatch):
    looked = []

    def watched(before):
        def call(path, *given, **options):
            looked.append(str(path))
            return before(path, *given, **options)

        return call

    for name in ("stat", "lstat", "readlink", "open", "listdir", "scandir"):
        monkeypatch.setattr(os, name, watched(getattr(os, name)))
    for name in (f"{folder.path.parent}/outside/there.toml", "../outside/there.toml", "/etc/passwd"):
        assert not folder.holds(name)
    assert looked == []
    assert folder.holds("mine.toml")
    assert looked  # otherwise nothing would have been seen


def test_a_link_within_a_stored_run_does_not_lead_out(folder):
    with pytest.raises(fk.InvalidInput):
        folder.path_of("below")
    (folder.path / "below" / "chunk").unlink()
    (folder.path / "below" / "chunk").symlink_to(folder.path / "mine.toml")
    assert folder.path_of("below") == folder.path / "below"
