"""Appearance of the scene: colours, links, trails, light or dark."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flocking.apps.lab.scene.glyphs import COLORINGS
from flocking.apps.lab.scene.scene import Scene

if TYPE_CHECKING:
    from viser import GuiApi


class Display:
    """The part of a page that changes the scene's look.

    Parameters
    ----------
    gui
        GUI of a viser server.
    scene
        The scene.
    """

    def __init__(self, gui: GuiApi, scene: Scene) -> None:
        self._gui, self._scene = gui, scene
        look = scene.look
        self.color = gui.add_dropdown("colour by", COLORINGS, initial_value=look.color)
        self.links = gui.add_checkbox("links", look.links)
        self.trails = gui.add_checkbox("trails", look.trails)
        self.follow = gui.add_checkbox("follow the group", look.follow)
        self.virtual_agents = gui.add_checkbox("beta- and gamma-agents", look.virtual_agents)
        self.dark = gui.add_checkbox("dark", look.dark)
        self.aim = gui.add_button("Fit the view", icon="focus-centered")
        for name in ("color", "links", "trails", "follow", "virtual_agents"):
            self._bind(name)

        @self.dark.on_update
        def _(_: object) -> None:
            scene.look.dark = self.dark.value
            gui.configure_theme(
                show_share_button=False, show_logo=False, control_width="large", dark_mode=self.dark.value
            )
            scene.repaint()

        @self.aim.on_click
        def _(_: object) -> None:
            scene.aim(scene.clock.frame)
            scene.repaint()

    def _bind(self, name: str) -> None:
        handle = getattr(self, name)

        @handle.on_update
        def _(_: object) -> None:
            setattr(self._scene.look, name, handle.value)
            self._scene.repaint()
