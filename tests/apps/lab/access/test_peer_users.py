"""Which user opened a connection: the tables of Linux, as written down here."""

import os
import socket

import pytest

from flocking.apps.lab.access.peer_users import TABLES, may_come_from_another_user, written

CLIENT, SERVER = ("127.0.0.1", 40001), ("127.0.0.1", 8800)
HEADER = "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode"
ME = os.getuid()
OTHER = ME + 1234


def row(own, other, state, user, inode, before=""):
    return (
        f"   0: {before}{own} {before}{other} {state:02X} 00000000:00000000 00:00000000 00000000 {user:5d}"
        f"        0 {inode} 1 0000000000000000 100 0 0 10 0"
    )


HERE, THERE = written(*SERVER), written(*CLIENT)
LISTENING = row(HERE, "00000000:0000", 10, ME, 11)
ACCEPTED = row(HERE, THERE, 1, ME, 12)


def judged(*lines):
    return may_come_from_another_user(CLIENT, SERVER, [HEADER, LISTENING, ACCEPTED, *lines])


@pytest.mark.parametrize("before", ["", "0000000000000000FFFF0000"])
def test_the_user_of_the_lab_and_root_are_let_in_and_others_are_not(before):
    assert not judged(row(THERE, HERE, 1, ME, 13, before))
    assert not judged(row(THERE, HERE, 1, 0, 13, before))
    assert judged(row(THERE, HERE, 1, OTHER, 13, before))


def test_a_socket_that_its_owner_has_closed_is_nobody_s():
    # Linux shows it as one of root, without an inode: a request may be sent and its socket closed before it is read.
    assert judged(row(THERE, HERE, 1, 0, 0))
    assert judged(row(THERE, HERE, 4, ME, 13))
    assert judged()


def test_other_connections_do_not_speak_for_this_one():
    for other in (("127.0.0.2", 40001), ("127.0.0.1", 40002)):
        assert judged(row(written(*other), HERE, 1, ME, 13))
    assert judged(row(THERE, written("127.0.0.1", 8801), 1, ME, 13))


def test_where_nothing_is_listed_nothing_is_known():
    for lines in ([], [HEADER], [HEADER, row(THERE, HERE, 1, OTHER, 13)], ["nonsense"]):
        assert not may_come_from_another_user(CLIENT, SERVER, lines)
    assert not may_come_from_another_user(CLIENT, SERVER, [row(HERE, "00000000:0000", 10, OTHER, 11)])


def test_a_connection_of_this_process_is_its_own():
    with socket.create_server(("127.0.0.1", 0)) as server, socket.create_connection(server.getsockname()) as client:
        assert not may_come_from_another_user(client.getsockname(), server.getsockname())
        if TABLES[0].exists():
            # Nobody has this one.
            assert may_come_from_another_user(("127.0.0.1", 1), server.getsockname())
