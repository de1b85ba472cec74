"""Controls generated from the settings of a scenario: sliders, fields, choices, with errors shown in place."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from flocking.apps.lab.experiment.events import Event
from flocking.apps.lab.experiment.settings import Section, Setting, sections
from flocking.errors import FlockingError
from flocking.formula.grammar import Formula
from flocking.model.law import Scenario
from flocking.model.parts.structure import Step

if TYPE_CHECKING:
    from viser import GuiApi, GuiEvent, GuiFolderHandle, GuiInputHandle, GuiMarkdownHandle

Send = Callable[[Event, object, Callable[[str], None]], None]
"""Sends an event; of those with the same key only the last counts; the function shows an error, or clears it."""


class Controls:
    """The part of a page that changes the law.

    Parameters
    ----------
    gui
        GUI of a viser server.
    container
        Tab or folder that holds them.
    send
        Sends an event.
    """

    def __init__(self, gui: GuiApi, container: GuiFolderHandle, send: Send) -> None:
        self._gui, self._container, self._send = gui, container, send
        self._folders: list[GuiFolderHandle] = []
        self.handles: dict[tuple[Step, ...], GuiInputHandle] = {}
        """Handle of every setting by its path."""
        self.errors: dict[str, GuiMarkdownHandle] = {}
        """Error message of each section, by its number and title."""

    def build(self, scenario: Scenario) -> None:
        """Make the controls of a scenario and remove the previous ones."""
        for folder in self._folders:
            folder.remove()
        self._folders, self.handles, self.errors = [], {}, {}
        with self._container:
            for number, section in enumerate(sections(scenario)):
                self._section(number, section)

    def show(self, scenario: Scenario) -> None:
        """Put the values of a scenario with the same settings into the controls, without events."""
        for section in sections(scenario):
            for setting in section.settings:
                handle = self.handles.get(setting.path)
                if handle is not None and setting.kind in ("number", "flag", "choice", "formula"):
                    if setting.kind == "number":
                        handle.min, handle.max = min(handle.min, setting.value), max(handle.max, setting.value)
                    if handle.value != setting.value:
                        handle.value = setting.value

    def _section(self, number: int, section: Section) -> None:
        folder = self._gui.add_folder(section.title, expand_by_default=len(section.settings) <= 8)
        self._folders.append(folder)
        with folder:
            fault = self._gui.add_markdown("", visible=False)
            self.errors[f"{number} {section.title}"] = fault
            for setting in section.settings:
                self.handles[setting.path] = self._control(setting, _message_writer(fault))
            if section.removal is not None:
                self._remover(section, _message_writer(fault))

    def _remover(self, section: Section, show_message: Callable[[str], None]) -> None:
        button = self._gui.add_button(f"Remove {section.title.split(': ')[0].lower()}", color="gray")
        button.on_click(lambda _: self._send(dict(section.removal or {}), None, show_message))

    def _control(self, setting: Setting, show_message: Callable[[str], None]) -> GuiInputHandle:
        if setting.kind == "formula":
            return self._formula(setting, show_message)
        kind = "scale" if setting.kind == "factor" else "set"
        handle = self._widget(setting)

        @handle.on_update
        def _(event: GuiEvent) -> None:
            if event.client is not None:  # set by a person, not by `show`
                value = handle.value
                change = {"kind": kind, "path": list(setting.path), "value": value}
                self._send(change, (kind, setting.path), show_message)

        return handle

    def _widget(self, setting: Setting) -> GuiInputHandle:
        gui, label = self._gui, setting.label
        if setting.kind == "flag":
            return gui.add_checkbox(label, setting.value)
        if setting.kind == "choice":
            return gui.add_dropdown(label, setting.choices, initial_value=setting.value)
        if setting.kind == "count":
            return gui.add_number(label, setting.value, min=0, step=1)
        step = 10.0 ** math.floor(math.log10((setting.high - setting.low) / 200))
        return gui.add_slider(label, setting.low, setting.high, step, float(setting.value))

    def _formula(self, setting: Setting, show_message: Callable[[str], None]) -> GuiInputHandle:
        """A field whose errors show while typing; the law changes when the button is pressed."""
        field = self._gui.add_text(setting.label, setting.value, multiline=len(setting.value) > 40)
        button = self._gui.add_button("Use formula", hint="New names get the value 1 and a slider of their own.")

        @field.on_update
        def _(_: object) -> None:
            try:
                Formula(field.value, "formula")
                show_message("")
            except FlockingError as error:
                show_message(str(error))

        @button.on_click
        def _(_: object) -> None:
            change = {"kind": "set", "path": list(setting.path), "value": field.value}
            self._send(change, ("set", setting.path), show_message)

        return field


def _message_writer(fault: GuiMarkdownHandle) -> Callable[[str], None]:
    def show_message(message: str) -> None:
        fault.content = f"**{_plain(message)}**" if message else ""
        fault.visible = bool(message)

    return show_message


def _plain(text: str) -> str:
    """Text that Markdown shows as it is."""
    return "".join(f"\\{c}" if c in "*_`#<>[]{}$\\|" else c for c in text)
