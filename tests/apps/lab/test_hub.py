"""Which frame of several a page gets."""

from __future__ import annotations

from types import SimpleNamespace

from flocking.apps.lab.live import hub as hubs
from flocking.apps.lab.live.hub import Hub


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
