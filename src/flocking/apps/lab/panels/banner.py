"""The banner above all tabs: play and pause, time, meaning of the colours, and why a run stopped."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from flocking.apps.lab.experiment.clock import Clock, Frame
from flocking.apps.lab.scene.glyphs import RAMPS, wheel
from flocking.apps.lab.scene.scene import Legend, Scene

if TYPE_CHECKING:
    from viser import GuiApi

REFRESH_SECONDS = 0.2
"""Seconds between two updates of the text: five in a second can still be read."""
STYLE = "font-size:0.85em;padding:0.2em 0.8em 0.4em"
TURN = ("right", "up", "left", "down")


class Banner:
    """The part of a page above all tabs.

    Parameters
    ----------
    gui
        GUI of a viser server.
    clock
        The clock.
    scene
        The scene whose colours are explained.
    go_back
        Called to return to the saved moment.
    """

    def __init__(self, gui: GuiApi, clock: Clock, scene: Scene, go_back: Callable[[], None]) -> None:
        self._clock, self._scene = clock, scene
        self._shown = 0.0
        self.toggle = gui.add_button("Play", icon="player-play", color="green")
        self.text = gui.add_html("")
        self.go_back = gui.add_button("Go back to the last good moment", icon="history", visible=False, color="orange")

        @self.toggle.on_click
        def _(_: object) -> None:
            (clock.pause if clock.running else clock.play)()
            self.refresh()

        self.go_back.on_click(lambda _: go_back())
        scene.after = self.show

    def refresh(self) -> None:
        """Update the button of play and pause."""
        playing = self._clock.running
        label = "Pause" if playing else "Play"
        if self.toggle.label != label:
            self.toggle.label = label
            self.toggle.icon = "player-pause" if playing else "player-play"
            self.toggle.color = None if playing else "green"

    def show(self, frame: Frame) -> None:
        """Describe a painted frame; while time runs, at most every `REFRESH_SECONDS`."""
        self.refresh()
        now = time.monotonic()
        if self._clock.playing and now - self._shown < REFRESH_SECONDS:
            return
        self._shown = now
        failure, shrunk = self._clock.frame.failure, self._clock.frame.shrunk
        words = [f"<b>t = {frame.time:.4g}</b> &nbsp; {explained(self._scene.legend, self._scene.look.dark)}"]
        words += [f"<br>{_escaped(self._scene.note)}"] if self._scene.note else []
        words += [f"<br><b style='color:#d33'>Stopped: {_escaped(failure)}</b>"] if failure else []
        if shrunk and not failure:
            words += [f"<br><b style='color:#d33'>Stalled: {_escaped(shrunk)}</b>"]
        text = f"<div style='{STYLE}'>{''.join(words)}</div>"
        if self.text.content != text:
            self.text.content = text
        if self.go_back.visible != bool(failure or shrunk):
            self.go_back.visible = bool(failure or shrunk)


def explained(legend: Legend, dark: bool) -> str:
    """A legend as HTML.

    Parameters
    ----------
    dark
        Whether the background is dark.
    """
    if legend.kind == "flock":
        return "one colour for each flock"
    if legend.kind == "heading":
        inks = wheel(np.arange(4) * np.pi / 2)
        return "heading " + " ".join(
            f"<span style='color:{_ink(c)}'>&#9679;</span> {w}" for c, w in zip(inks, TURN, strict=True)
        )
    stops = ",".join(_ink(c) for c in RAMPS[dark])
    bar = (
        "<span style='display:inline-block;width:6em;height:0.7em;margin:0 0.4em;"
        f"background:linear-gradient(to right,{stops})'></span>"
    )
    low, high = (round(value, 8) + 0.0 for value in (legend.low, legend.high))
    return f"{legend.kind} {low:.3g}{bar}{high:.3g}"


def _ink(color: Sequence[int]) -> str:
    return f"rgb({','.join(str(int(x)) for x in color)})"


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
