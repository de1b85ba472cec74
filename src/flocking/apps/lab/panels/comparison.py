"""Two runs side by side that differ in one number."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flocking.apps.lab.experiment.events import Event
from flocking.apps.lab.experiment.experiment import Experiment
from flocking.apps.lab.experiment.settings import Setting, sections
from flocking.errors import FlockingError
from flocking.model.parts.structure import Step

if TYPE_CHECKING:
    from viser import GuiApi

NONE = "(nothing)"
FINEST = 1e-4
"""Smallest difference that can be typed."""


class Comparison:
    """The part of a page that starts a second experiment.

    Parameters
    ----------
    gui
        GUI of a viser server.
    page
        The page.
    """

    def __init__(self, gui: GuiApi, page: Any) -> None:
        self._page = page
        self.path: tuple[Step, ...] = ()
        """Path of the number in which the two differ; empty when there is one experiment."""
        with gui.add_folder("Compare"):
            self.setting = gui.add_dropdown("differ in", (NONE,))
            self.value = gui.add_number("value in the second", 1.0, step=FINEST)
            self.button = gui.add_button("Compare", hint="Both restart, the second with this value.")
            self.stop = gui.add_button("Only one", visible=False)
            self.fault = gui.add_markdown("", visible=False)

        @self.button.on_click
        def _(_: object) -> None:
            found = self._settings().get(self.setting.value)
            if found is not None:
                self.begin(found.path, float(self.value.value))

        @self.setting.on_update
        def _(_: object) -> None:
            chosen = self._settings().get(self.setting.value)
            if chosen is not None:
                self.value.value = round(float(chosen.value), 4)

        @self.stop.on_click
        def _(_: object) -> None:
            page.clock.post(self.drop)

    def refresh(self) -> None:
        """Offer the numbers of the present scenario."""
        options = (NONE, *self._settings())
        if tuple(self.setting.options) != options:
            self.setting.options = options

    def _settings(self) -> dict[str, Setting]:
        found = {}
        for number, section in enumerate(sections(self._page.experiment.scenario)):
            for setting in section.settings:
                if setting.kind == "number":
                    found[f"{number} {section.title}: {setting.label}"] = setting
        return found

    def targets(self, event: Event) -> list[Experiment]:
        """The experiments that an event changes: the number in which they differ changes in the first only."""
        both: list[Experiment] = self._page.clock.experiments
        return both[:1] if self.path and tuple(event.get("path", ())) == self.path else both

    def begin(self, path: tuple[Step, ...], value: float) -> None:
        """Restart both, with ``value`` at ``path`` in the second."""

        def act() -> None:
            try:
                left = self._page.restarted(self._page.experiment)
                right = Experiment(left.original, left.engine)
                right.apply({"kind": "set", "path": list(path), "value": value})
            except FlockingError as error:
                self.fault.content, self.fault.visible = str(error), True
                return
            self.fault.visible = False
            self.path = path
            self._page.clock.experiments = [left, right]
            self._page.clock.post(self._fit)
            self._page.measurement_panel.reset()
            self.stop.visible = True

        self._page.clock.post(act)

    def drop(self) -> None:
        """Continue with the first only."""
        self.end()
        self._page.clock.experiments = self._page.clock.experiments[:1]
        self._page.clock.post(self._fit)

    def _fit(self) -> None:
        """Fit the view to both groups; posted, so that a frame with both exists."""
        self._page.scene.aim(self._page.clock.frame)

    def end(self) -> None:
        """End the comparison."""
        self.path = ()
        self.stop.visible = False
