"""Playback: scenario, steps, restart, seed and speed."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from flocking.apps.lab.experiment.clock import Clock

if TYPE_CHECKING:
    from viser import GuiApi, GuiEvent

STEPS = {"0.01": 0.01, "0.1": 0.1, "1": 1.0}
SLOWEST, FASTEST = 0.01, 100.0
"""Bounds of the speed of playback, in units of time per second: a hundredth and a hundred times real time."""
PACES = {"slower": 0.5, "faster": 2.0}
RESTART, RESET, LIFT = "Restart", "Reset", "In 3-D"


class Transport:
    """The part of a page that selects what runs, and how fast.

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
        Called to restart with the present settings.
    lift
        Called to put the scenario in space.
    """

    def __init__(
        self, gui: GuiApi, clock: Clock, names: tuple[str, ...], *,
        load: Callable[[str, int | None], None], restart: Callable[[], None], lift: Callable[[], None],
    ) -> None:  # fmt: skip
        self._clock = clock
        self.scenario = gui.add_dropdown("scenario", names, initial_value=names[0])
        self.seed = gui.add_number("seed", 0, min=0, step=1)
        self.steps = gui.add_button_group("step by", tuple(STEPS))
        self.restart_buttons = gui.add_button_group(
            "from the start", (RESTART, RESET, LIFT),
            hint="Restart uses the present settings; Reset the original ones.",
        )  # fmt: skip
        self.speed = gui.add_number("time per second", 1.0, min=SLOWEST, max=FASTEST, step=0.01)
        self.pace = gui.add_button_group("", tuple(PACES))

        @self.scenario.on_update
        def _(event: GuiEvent) -> None:
            if event.client is not None:
                load(self.scenario.value, None)

        @self.seed.on_update
        def _(event: GuiEvent) -> None:
            if event.client is not None:
                load(self.scenario.value, int(self.seed.value))

        @self.steps.on_click
        def _(_: object) -> None:
            clock.step(STEPS[self.steps.value])

        @self.speed.on_update
        def _(_: object) -> None:
            clock.speed = float(self.speed.value)

        @self.pace.on_click
        def _(_: object) -> None:
            self.run_at(clock.speed * PACES[self.pace.value])

        actions = {RESTART: restart, RESET: lambda: load(self.scenario.value, int(self.seed.value)), LIFT: lift}
        self.restart_buttons.on_click(lambda _: actions[self.restart_buttons.value]())

    def run_at(self, speed: float) -> None:
        """Set the simulated time per second.

        Parameters
        ----------
        speed
            Time units per second.
        """
        self._clock.speed = self.speed.value = min(max(float(f"{speed:.3g}"), SLOWEST), FASTEST)

    def offer(self, names: tuple[str, ...]) -> None:
        """List other scenarios; the open one stays in the list.

        Parameters
        ----------
        names
            Their names.
        """
        chosen = self.scenario.value
        names = tuple(dict.fromkeys((*names, chosen)))
        if tuple(self.scenario.options) != names:
            self.scenario.options = names
            self.scenario.value = chosen
