"""Running: which scenario, play, pause, step, restart, seed and speed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flocking.apps.lab.clock import Clock

STEPS = {"0.01": 0.01, "0.1": 0.1, "1": 1.0}
SLOWEST, FASTEST = -2.0, 2.0
"""Powers of ten between which the speed is set."""


class Transport:
    """The part of a page that starts and stops.

    Parameters
    ----------
    gui
        GUI of a viser server.
    clock
        The clock.
    names
        Scenarios to choose from.
    load
        Called with a scenario's name and a seed.
    restart
        Called to start anew with the present settings.
    go_back
        Called to return to the last good moment.
    lift
        Called to put the scenario in space.
    """

    def __init__(
        self, gui: Any, clock: Clock, names: tuple[str, ...], *,
        load: Callable[[str, int | None], None], restart: Callable[[], None], go_back: Callable[[], None],
        lift: Callable[[], None],
    ) -> None:  # fmt: skip
        self.clock = clock
        self.scenario = gui.add_dropdown("scenario", names, initial_value=names[0])
        self.seed = gui.add_number("seed", 0, min=0, step=1)
        self.toggle = gui.add_button("Play", icon="player-play", color="green")
        self.steps = gui.add_button_group("step by", tuple(STEPS))
        self.restart = gui.add_button(
            "Restart", icon="rotate", hint="From the start, with the settings as they are now."
        )
        self.reset = gui.add_button(
            "Reset", icon="arrow-back-up", hint="From the start, with the scenario's own settings."
        )
        self.lift = gui.add_button("Put in space", icon="cube", hint="Anew in 3-D, where the law allows it.")
        self.go_back = gui.add_button("Go back to the last good moment", icon="history", visible=False, color="orange")
        self.speed = gui.add_slider("speed, 10^", SLOWEST, FASTEST, 0.05, 0.0)
        self.status = gui.add_markdown("")

        @self.scenario.on_update
        def _(event: Any) -> None:
            if event.client is not None:
                load(self.scenario.value, None)

        @self.seed.on_update
        def _(event: Any) -> None:
            if event.client is not None:
                load(self.scenario.value, int(self.seed.value))

        @self.toggle.on_click
        def _(_: Any) -> None:
            (clock.pause if clock.playing else clock.play)()
            self.refresh()

        @self.steps.on_click
        def _(_: Any) -> None:
            clock.step(STEPS[self.steps.value])
            self.refresh()

        @self.speed.on_update
        def _(_: Any) -> None:
            clock.speed = 10.0**self.speed.value

        self.restart.on_click(lambda _: restart())
        self.reset.on_click(lambda _: load(self.scenario.value, int(self.seed.value)))
        self.lift.on_click(lambda _: lift())
        self.go_back.on_click(lambda _: go_back())

    def refresh(self) -> None:
        """Show whether time runs."""
        playing = self.clock.playing
        label = "Pause" if playing else "Play"
        if self.toggle.label != label:
            self.toggle.label = label
            self.toggle.icon = "player-pause" if playing else "player-play"
            self.toggle.color = None if playing else "green"
        failed = bool(self.clock.frame.failure)
        if self.go_back.visible != failed:
            self.go_back.visible = failed
