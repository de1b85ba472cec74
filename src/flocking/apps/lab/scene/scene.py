"""The scene: agents, links, trails, obstacles and leaders of a frame, drawn on a viser server."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flocking.apps.lab.experiment.clock import Clock, Frame
from flocking.apps.lab.scene import glyphs
from flocking.apps.lab.scene.framing import box_around, centre_of
from flocking.apps.lab.scene.solids import Solid, solids, virtual_agents
from flocking.arrays import Positions
from flocking.model.law import Scenario
from flocking.model.parts.structure import Step
from flocking.model.state import State

if TYPE_CHECKING:
    from viser import (
        BatchedMeshHandle,
        LineSegmentsHandle,
        MeshHandle,
        PointCloudHandle,
        ViserServer,
    )

LINK_BUDGET = 6000
"""Links that are drawn at most: more would delay the page and hide each other."""
MOST_GLYPHS = 20_000
"""Larger groups are drawn as points."""

MOST_TRAILS = 500
"""Agents up to which trails are drawn: more would delay the page and hide each other."""
MOST_LARGE, MOST_EXACTLY_SEEN = 60, 400
"""Groups up to these sizes are drawn with agents that stay large when the view widens."""

TRAIL_POINTS = 30
"""Positions that a trail remembers."""
MOST_ENERGIES = 500
"""Agents up to which colours show energies: their cost grows with the number of pairs."""
FASTEST_PAINT = 1 / 30
"""Least seconds between two pictures that are sent; more often would be lost on the way to most screens."""
AMBIENT = 1.0
"""Brightness of the light that comes from everywhere, in units of the viewer."""
HIGHLIGHT_SCALE = 1.6
"""Size of a chosen agent beside the others, large enough to be found in a group."""
BESIDE = 1.25
"""Distance of two groups that are compared, in extents of the first."""

FIELD_OF_VIEW = 0.9
"""Angle of the camera from the lower to the upper edge of the picture, in radians: about 52 degrees."""
MARGIN = 1.15
"""Room around what a view is fitted to."""
LEADER_SIZE = 0.02
"""Radius of a leader, in sizes of the group."""

GRID = {False: ((225, 225, 225), (190, 190, 190)), True: ((45, 45, 48), (75, 75, 80))}
"""Colours of the grid's lines and of every fifth of them, in light and dark."""

LIGHT, DARK = (70, 70, 80), (200, 200, 210)
"""Colours of lines on a light and on a dark background, red, green and blue."""


@dataclass
class Look:
    """What a scene shows, and how.

    Parameters
    ----------
    color
        The quantity that colours the agents.
    trails, follow, virtual_agents
        Whether paths are drawn, the camera moves with the group, and beta- and gamma-agents are shown.
    dark
        Whether the background is dark.
    highlight
        Numbers of highlighted agents.
    """

    color: str = "speed"
    links: bool = True
    trails: bool = False
    follow: bool = True
    virtual_agents: bool = False
    dark: bool = False
    highlight: tuple[int, ...] = ()


@dataclass(frozen=True)
class Legend:
    """The meaning of the colours of a scene: ``kind`` is one of `flocking.apps.lab.scene.glyphs.COLORINGS`."""

    kind: str = "speed"
    low: float = 0.0
    high: float = 1.0


@dataclass
class _Group:
    """Handles of one experiment's group."""

    agents: BatchedMeshHandle | PointCloudHandle
    links: LineSegmentsHandle
    trails: LineSegmentsHandle
    ghosts: PointCloudHandle
    solids: list[tuple[Solid, MeshHandle]]
    past: deque[Positions] = field(default_factory=lambda: deque(maxlen=TRAIL_POINTS))
    turns: NDArray[np.float32] | None = None
    enlarged: bool = False
    shape: tuple[object, ...] = ()


Dragged = Callable[[tuple[Step, ...], list[float]], None]


class Scene:
    """Draws the frames of a clock.

    Parameters
    ----------
    server
        A viser server.
    clock
        The clock.
    dragged
        Called with the path of a leader and the point it was dragged to.
    """

    def __init__(self, server: ViserServer, clock: Clock, dragged: Dragged) -> None:
        self.server, self.clock, self.look = server, clock, Look()
        self.note = ""
        """Note on what is not drawn completely."""
        self.legend = Legend()
        self.after: Callable[[Frame], None] = lambda _: None
        """Called when a frame was painted."""
        self.painted = 0
        self.rate = 0.0
        self.picked: Callable[[int], None] = lambda _: None
        """Called with the number of an agent that was clicked."""
        self._dragged = dragged
        self._dragged_at: dict[tuple[Step, ...], float] = {}
        self._groups: list[_Group] = []
        self._size = self._fastest = 1.0
        self._shift = np.zeros(3)
        self._drag_offset = np.zeros(3)
        self._dark = False
        self._stored: Frame | None = None
        server.scene.set_up_direction("+z")
        # Ambient light: flat agents keep their colours.
        server.scene.configure_default_lights(False, False)
        server.scene.configure_environment_map(None)
        server.scene.add_light_ambient("/light", intensity=AMBIENT)
        server.scene.add_light_directional("/sun", intensity=0.4, cast_shadow=False, position=(1.0, -1.0, 2.0))
        server.scene.add_frame("/world", show_axes=False)
        self._grid = server.scene.add_grid(
            "/world/grid", width=10.0, height=10.0, plane="xy", infinite_grid=True, position=(0.0, 0.0, -0.01)
        )
        self.aim(clock.frame)
        self._thread = threading.Thread(target=self._run, name="flocking-lab-scene", daemon=True)

    def begin(self) -> None:
        """Start the thread that paints."""
        self._thread.start()

    def join(self) -> None:
        """Wait for the thread; the clock must be closed."""
        if self._thread.is_alive():
            self._thread.join()

    def aim(self, frame: Frame) -> None:
        """Fit every camera to the group, from above in the plane."""
        state = frame.states[0]
        self._spacing = glyphs.spacing(state.q)
        low, high = box_around(state, solids(frame.scenarios[0], state.t), 2 * self._spacing)
        extent, middle = high - low, (low + high) / 2
        self._size = float(extent.max())
        self._count = len(frame.states)
        self._step = np.zeros(3)
        if self._count > 1:
            # Two compared groups are side by side, wide ones one above the other.
            axis = 0 if extent[0] <= extent[1] else 1
            self._step[axis] = (1, -1)[axis] * BESIDE * max(extent[axis], 0.2 * self._size)
            extent = extent + np.abs(self._step) * (self._count - 1)
        self._fastest = max(float(np.linalg.norm(state.p, axis=1).max()), 1e-9)
        self._shift = -centre_of(state.q) if self.look.follow else np.zeros(3)
        look_at = middle + self._shift
        far = MARGIN * float(extent.max()) / 2 / np.tan(FIELD_OF_VIEW / 2)
        # Exactly from above the rotation of the camera about its own axis would be undefined.
        offset = np.array([0.0, -1e-3 * far, far]) if state.dimension < 3 else np.array([0.6, -1.0, 0.6]) * far / 1.2
        cell = 10 ** np.floor(np.log10(self._size / 2))
        self._grid.cell_size, self._grid.section_size = float(cell), float(5 * cell)
        self._grid.fade_distance = float(8 * self._size)
        camera = self.server.initial_camera
        camera.position, camera.look_at, camera.up = look_at + offset, look_at, (0.0, 0.0, 1.0)
        camera.far, camera.fov = float(100 * self._size), FIELD_OF_VIEW
        for client in self.server.get_clients().values():
            client.camera.position, client.camera.look_at = look_at + offset, look_at

    def show_stored(self, states: list[State], scenario: Scenario, *, aim: bool = False) -> None:
        """Show stored states instead of the clock's.

        Parameters
        ----------
        aim
            Whether the camera turns to them.
        """
        live = self.clock.frame
        self._stored = replace(live, time=states[0].t, states=tuple(states), scenarios=(scenario,))
        if aim:
            self.aim(self._stored)
        self.repaint()

    def show_live(self) -> None:
        """Show the states of the clock again."""
        self._stored = None
        self.aim(self.clock.frame)
        self.repaint()

    def repaint(self) -> None:
        """Paint the last frame again."""
        self.clock.post(lambda: None, "repaint")

    def _run(self) -> None:
        number = 0
        while not self.clock.closed:
            frame = self.clock.next_frame(number)
            if frame is None:
                continue
            number = frame.number
            begin = time.perf_counter()
            shown = self._stored or frame
            self.paint(shown)
            self.after(shown)
            took = time.perf_counter() - begin
            # The pause leaves the simulation as much time as painting takes.
            pause = max(FASTEST_PAINT - took, took)
            self.rate = 0.9 * self.rate + 0.1 / (took + pause)
            time.sleep(pause)

    def paint(self, frame: Frame) -> None:
        """Draw a frame."""
        with self.server.atomic():
            while len(self._groups) > len(frame.states):
                self._remove(self._groups.pop())
            notes = []
            if self.look.dark != self._dark:
                self._dark = self.look.dark
                self._grid.cell_color, self._grid.section_color = GRID[self._dark]
            if self.look.follow:
                self._shift = -centre_of(frame.states[0].q)
            # The group stays in place and the grid moves, so that slow clients do not lose the group.
            self._grid.position = (*np.fmod(self._shift[:2], self._grid.section_size), -0.01)
            for k, (state, scenario) in enumerate(zip(frame.states, frame.scenarios, strict=True)):
                notes.append(self._paint_group(k, state, scenario))
        self.note = " ".join(dict.fromkeys(n for n in notes if n))
        self.painted += 1

    def _paint_group(self, k: int, state: State, scenario: Scenario) -> str:
        things = solids(scenario, state.t)
        shape = (
            state.n,
            state.dimension,
            tuple(thing.shape for thing in things),
            self.look.dark,
            self._beside(k),
            self._length(state.n),
        )
        if k == len(self._groups):
            self._groups.append(self._made(k, state, things, shape))
        elif self._groups[k].shape != shape:
            self._remove(self._groups[k])
            self._groups[k] = self._made(k, state, things, shape)
        group = self._groups[k]
        q = glyphs.in_space(state.q, self._shift)
        colors, notes = self._colors(state, scenario)
        chosen = [i for i in self.look.highlight if i < state.n] if k == 0 else []
        if chosen:
            colors[chosen] = glyphs.HIGHLIGHT
        if state.n <= MOST_GLYPHS:
            group.turns = glyphs.turns(state.p, group.turns)
            group.agents.batched_positions, group.agents.batched_wxyzs = q, group.turns
            group.agents.batched_colors = colors
            if chosen or group.enlarged:
                scales = np.ones(state.n, dtype=np.float32)
                scales[chosen] = HIGHLIGHT_SCALE
                group.agents.batched_scales = scales
                group.enlarged = bool(chosen)
        else:
            group.agents.points, group.agents.colors = q, colors
        notes += [self._paint_links(group, state, q), self._paint_trails(group, state.q)]
        for (_, handle), thing in zip(group.solids, things, strict=True):
            if time.monotonic() - self._dragged_at.get(thing.path, -1.0) > 0.3:
                handle.position = tuple(thing.position + self._shift)
        points = virtual_agents(scenario, state) if self.look.virtual_agents else np.zeros((0, 3))
        group.ghosts.visible = len(points) > 0
        if len(points):
            group.ghosts.points = (points + self._shift).astype(np.float32)
        return " ".join(note for note in notes if note)

    def _colors(self, state: State, scenario: Scenario) -> tuple[glyphs.Bytes, list[str]]:
        """Colours of agents, and notes where they differ from the choice."""
        kind, energies, notes = self.look.color, None, []
        if kind == "energy" and state.n <= MOST_ENERGIES:
            from flocking.study.potentials.state_energy import agent_energies

            energies = agent_energies(scenario.law, state, scenario.energy)
        if (kind == "energy" and energies is None) or (kind == "flock" and state.links is None):
            notes = [f"Coloured by speed: {state.n} agents are too many to colour by {kind}."]
            kind = "speed"
        if energies is not None:
            self.legend = Legend(kind, float(np.min(energies)), float(np.max(energies)))
        elif kind == "speed":
            # The scale follows the fastest agent, and falls slowly, so that a decrease of speeds is visible.
            self._fastest = max(0.995 * self._fastest, float(np.linalg.norm(state.p, axis=1).max()), 1e-9)
            self.legend = Legend(kind, 0.0, self._fastest)
        else:
            self.legend = Legend(kind)
        return glyphs.colors(state, kind, self._fastest, energies, self.look.dark), notes

    def _paint_links(self, group: _Group, state: State, q: NDArray[np.float32]) -> str:
        note = ""
        segments = np.zeros((0, 2, 3), dtype=np.float32)
        if self.look.links:
            segments, count = glyphs.link_segments(state, q, LINK_BUDGET)
            if count > len(segments):
                note = f"{len(segments)} of {count} links drawn."
            elif state.links is None:
                note = "Links are not drawn for so many agents."
        group.links.visible = len(segments) > 0
        if len(segments):
            group.links.points = segments
        return note

    def _paint_trails(self, group: _Group, q: Positions) -> str:
        if not (self.look.trails and len(q) <= MOST_TRAILS):
            group.past.clear()
            group.trails.visible = False
            return f"Trails are drawn for up to {MOST_TRAILS} agents." if self.look.trails else ""
        group.past.append(q)
        path = np.array([glyphs.in_space(x, self._shift) for x in group.past])
        group.trails.visible = len(path) > 1
        if len(path) > 1:
            group.trails.points = np.stack([path[:-1], path[1:]], axis=2).reshape(-1, 2, 3)
        return ""

    def _made(self, k: int, state: State, things: list[Solid], shape: tuple[object, ...]) -> _Group:
        scene, root = self.server.scene, f"/world/{k}"
        scene.add_frame(root, show_axes=False, position=self._beside(k))
        q = glyphs.in_space(state.q)
        ink = DARK if self.look.dark else LIGHT
        length = self._length(state.n)
        if state.n <= MOST_GLYPHS:
            vertices, faces = glyphs.dart(state.dimension)
            agents = scene.add_batched_meshes_simple(
                f"{root}/agents", vertices * np.float32(length), faces, glyphs.turns(state.p), q,
                side="double", cast_shadow=False, receive_shadow=False, lod="off", flat_shading=True,
            )  # fmt: skip
            agents.on_click(lambda event: self.picked(int(event.instance_index)))
        else:
            agents = scene.add_point_cloud(
                f"{root}/agents", q, ink, point_size=0.5 * length, point_shape="circle", precision="float32",
                point_shading="flat",
            )  # fmt: skip
        empty = np.zeros((1, 2, 3), dtype=np.float32)
        lines = [
            scene.add_line_segments(
                f"{root}/{name}", empty, color, thickness=width, thickness_units="screen", visible=False
            )
            for name, color, width in (("links", (150, 150, 160), 1.0), ("trails", (90, 160, 220), 1.5))
        ]
        ghosts = scene.add_point_cloud(
            f"{root}/imagined", np.zeros((1, 3), dtype=np.float32), (230, 120, 0), point_size=0.4 * length,
            point_shape="diamond", precision="float32", visible=False,
        )  # fmt: skip
        found = [(thing, self._solid(f"{root}/solid{j}", thing)) for j, thing in enumerate(things)]
        return _Group(agents, lines[0], lines[1], ghosts, found, shape=shape)

    def _length(self, n: int) -> float:
        """Length of an agent: half the spacing of the group, within limits."""
        least = 0.025 if n <= MOST_LARGE else 0.014 if n <= MOST_EXACTLY_SEEN else 0.0
        return min(max(0.5 * self._spacing, least * self._size), 0.06 * self._size)

    def _beside(self, k: int) -> tuple[float, ...]:
        """Where group ``k`` is drawn."""
        return tuple(float(x) for x in (k - (self._count - 1) / 2) * self._step)

    def _solid(self, name: str, thing: Solid) -> MeshHandle:
        scale = 1.0 if thing.kind == "obstacle" else LEADER_SIZE * self._size
        handle = self.server.scene.add_mesh_simple(
            name, (thing.vertices * scale).astype(np.float32), thing.faces,
            color=(190, 80, 60) if thing.kind == "obstacle" else (20, 150, 90), side="double", flat_shading=True,
            opacity=0.75 if thing.kind == "obstacle" else None, cast_shadow=False,
            position=tuple(thing.position + self._shift),
        )  # fmt: skip
        if thing.path:
            handle.on_drag(lambda event: self._drag(event, thing, handle))
        return handle

    def _drag(self, event: Any, thing: Solid, handle: MeshHandle) -> None:
        """Move an object by as much as the pointer moved."""
        if event.phase == "start":
            self._drag_offset = np.asarray(handle.position) - np.asarray(event.start_position)
        self._dragged_at[thing.path] = time.monotonic()
        where = np.asarray(event.end_position) + self._drag_offset
        if thing.dimension < 3:
            where[2] = 0.0
        handle.position = tuple(where)
        self._dragged(thing.path, [float(x) for x in (where - self._shift)[: thing.dimension]])

    def _remove(self, group: _Group) -> None:
        for handle in (group.agents, group.links, group.trails, group.ghosts, *(h for _, h in group.solids)):
            handle.remove()
