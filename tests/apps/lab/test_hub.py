"""Which frame of several a page gets, and which record."""

from __future__ import annotations

import asyncio
import threading
import time
from types import SimpleNamespace

import pytest

from flocking.apps.lab.experiment.clock import Clock
from flocking.apps.lab.experiment.experiment import Experiment
from flocking.apps.lab.live import hub as hubs
from flocking.apps.lab.live.hub import Hub, Tab
from flocking.apps.lab.live.lab import Lab
from flocking.apps.lab.live.past import Past
from flocking.errors import InvalidInput
from tests.apps.lab.conftest import ten


def test_a_page_that_connects_while_a_frame_comes_gets_that_frame(monkeypatch):
    """The new frame is shown while the former one is packed, which must not be the last that the page is shown."""
    clock = SimpleNamespace(frame="former")
    shown: list[bytes] = []

    def packed(frame, requested):
        if frame == "former":
            clock.frame = "new"
            shown.append(b"new")
        return frame.encode()

    monkeypatch.setattr(hubs, "packed", packed)
    Hub(SimpleNamespace(), clock, lambda tab: None).repaint(SimpleNamespace(show=shown.append))
    assert shown == [b"new", b"former", b"new"]


def test_a_frame_of_the_present_does_not_replace_the_record_that_a_page_looks_at_by_then():
    """It was packed while the page still looked at the present."""
    tab = Tab(SimpleNamespace(call_soon_threadsafe=lambda act: act()))
    tab.looking = 1.0
    tab.show(b"record", present=False)
    tab.show(b"present")
    assert tab.frame == b"record"
    tab.looking = None
    tab.show(b"present")
    assert tab.frame == b"present"


def test_a_slow_page_is_sent_the_last_record_alone_and_in_its_place_among_other_messages():
    """It got all of them late, until its connection counted as dead: a record holds all that those before it did."""

    class Slow:
        """A page that reads, and has not drawn its frame."""

        def __init__(self) -> None:
            self.got: list[str] = []

        async def send(self, message: str) -> None:
            self.got.append(message)

    async def told() -> tuple[list[str], list[str]]:
        page, tab = Slow(), Tab(asyncio.get_running_loop())
        sender = asyncio.create_task(Hub._send(SimpleNamespace(sent=0), page, tab))  # type: ignore[arg-type]
        tab.show(b"frame")
        await asyncio.sleep(0.01)
        for number in range(500):
            tab.tell({"kind": "record", "number": number})
            await asyncio.sleep(0)
        tab.tell({"kind": "scenario"})
        tab.tell({"kind": "record", "number": 500})
        await asyncio.sleep(0.01)
        before = list(page.got)
        tab.acknowledge()
        await asyncio.sleep(0.01)
        sender.cancel()
        return before, page.got

    before, after = asyncio.run(told())
    assert before == [b"frame", '{"kind":"record","number":499}', '{"kind":"scenario"}']
    assert after == [*before, '{"kind":"record","number":500}']


def test_a_page_that_leaves_the_record_is_shown_the_present():
    """Its frame may have come while the page looked at the record, and a run that stands still has no other."""
    shown: list[object] = []
    tabs = [SimpleNamespace(looking=1.0), SimpleNamespace(looking=None)]
    Past(SimpleNamespace(tabs=tabs, repaint=shown.append), None, None, None).leave()
    assert shown == tabs[:1]
    assert tabs[0].looking is None


def test_the_record_that_was_looked_up_last_is_told_last():
    """Else a page would say for ever that a run goes on that was paused meanwhile."""
    looked: list[int] = []
    told: list[int] = []
    first, second = threading.Event(), threading.Event()

    def content() -> int:
        looked.append(len(looked))
        if len(looked) == 1:
            first.set()
            second.wait(0.5)
            return 0
        second.set()
        return 1

    def tell(number: int) -> None:
        if number == 0 and second.is_set():
            pausing.join(0.5)
        told.append(number)

    lab = SimpleNamespace(
        _telling=threading.Lock(), past=SimpleNamespace(stored=None), hub=SimpleNamespace(tell=tell),
        measuring=SimpleNamespace(content=content),
    )  # fmt: skip
    measuring, pausing = (threading.Thread(target=Lab.tell_record, args=(lab,)) for _ in range(2))
    measuring.start()
    first.wait()
    pausing.start()
    measuring.join()
    pausing.join()
    assert told == [0, 1]


def test_an_order_that_waits_for_the_clock_is_refused_as_soon_as_the_lab_has_ended():
    """The end of the lab waits for it: a minute, while it waited for a clock that had stopped."""
    clock = Clock([Experiment(ten())])
    clock.begin()
    clock.close()
    begin = time.monotonic()
    with pytest.raises(InvalidInput, match="open"):
        clock.do(lambda: None)
    assert time.monotonic() - begin < 10


def test_what_is_not_reached_in_time_does_not_count_as_done():
    clock = Clock([Experiment(ten())])  # its thread has not begun
    with pytest.raises(InvalidInput, match="later"):
        clock.do(lambda: None, timeout=0.3)
