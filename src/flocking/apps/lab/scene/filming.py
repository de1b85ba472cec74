"""Films of a run while it goes on, drawn by `flocking.show`."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flocking.apps.lab.experiment.clock import Clock, Frame
from flocking.engine.runs.run import SWITCH_FIELDS, TRACE_FIELDS, Run
from flocking.errors import InvalidInput
from flocking.model.law import Scenario
from flocking.model.leaders_and_obstacles.obstacles import Obstacle
from flocking.model.state import State
from flocking.model.terms.avoidance import ObstacleTerm

if TYPE_CHECKING:
    from flocking.show.plane import NetOptions

MOST_FRAMES = 600
"""States that are recorded for a film, a bound on memory: 30 s at 20 pictures in a second."""
FRAME_SECONDS = 0.05
"""Seconds between two recorded states: 20 pictures in a second look smooth."""
PLAIN = "plain"

_drawing = threading.Lock()


@dataclass(frozen=True)
class Look:
    """What a film shows, and how.

    Parameters
    ----------
    color
        The quantity that colours the agents.
    links
        Whether links are drawn.
    dark
        Whether the background is dark.
    """

    color: str = "speed"
    links: bool = True
    dark: bool = True


def _obstacles(scenario: Scenario) -> list[Obstacle]:
    return [x for term in scenario.law.terms if isinstance(term, ObstacleTerm) for x in term.obstacles]


def _drawn(scenario: Scenario) -> list[int]:
    """What identifies obstacles and leaders of a scenario: all pictures of a film show them as they are at its end."""
    return [id(x) for x in (*_obstacles(scenario), *scenario.law.leaders)]


def _options(scenario: Scenario, look: Look) -> NetOptions:
    color = look.color if look.color in ("speed", "heading", "flock") else PLAIN
    return {"links": look.links, "color": color, "obstacles": _obstacles(scenario)}


def _theme(look: Look) -> str:
    return "dark" if look.dark else "light"


def _run(states: list[State], scenario: Scenario) -> Run:
    linked = all(s.links is not None for s in states)
    return Run(
        scenario, np.array([s.t for s in states]), np.array([s.q for s in states]), np.array([s.p for s in states]),
        np.array([s.links for s in states]) if linked else np.zeros((len(states), 0, 0), dtype=bool),
        np.zeros(0, dtype=SWITCH_FIELDS), np.zeros(0, dtype=TRACE_FIELDS), status="running",
        columns={name: np.array([s.columns[name] for s in states]) for name in states[0].columns},
    )  # fmt: skip


class Film:
    """Collects frames while a clock runs; when there are too many, every second one is dropped.

    Parameters
    ----------
    clock
        The clock.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.scenario = clock.frame.scenarios[0]
        self._states: list[State] = []
        self._every, self._skip = 1, 0
        self.rebuilt = False
        """Whether obstacles or leaders were changed while it was recorded."""
        self.begun_anew = False
        """Whether what was recorded first is of another group or run, and not in it."""
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._collect, name="flocking-lab-film", daemon=True)
        self._take(clock.frame)
        self._thread.start()

    def _collect(self) -> None:
        number = self._clock.frame.number
        while not self._done.is_set() and not self._clock.closed:
            frame = self._clock.next_frame(number, timeout=0.5)
            if frame is not None:
                number = frame.number
                self._take(frame)
                self._done.wait(FRAME_SECONDS)

    def _take(self, frame: Frame) -> None:
        state, scenario = frame.states[0], frame.scenarios[0]
        changed = self._states and _drawn(scenario) != _drawn(self.scenario)
        self.scenario = scenario
        if self._states and (state.q.shape != self._states[-1].q.shape or state.t < self._states[-1].t):
            self._states, self.rebuilt, self.begun_anew = [state], False, True
            return
        self.rebuilt = self.rebuilt or bool(changed)
        if self._states and state.t == self._states[-1].t:
            return
        self._skip += 1
        if self._skip >= self._every:
            self._skip = 0
            self._states.append(state)
        if len(self._states) > MOST_FRAMES:
            self._states, self._every = self._states[::2], 2 * self._every

    def write(self, path: Path, look: Look) -> Path:
        """End the recording and write it, as MP4 where ffmpeg is installed, else as GIF.

        Parameters
        ----------
        look
            What is shown, and how.

        Raises
        ------
        InvalidInput
            When nothing moved while it was recorded.
        """
        self._done.set()
        self._thread.join()
        if len(self._states) < 2:
            raise InvalidInput("lab", "film", "needs a run that plays while it is recorded", "one frame")
        from flocking.show.animate import animate

        with _drawing:
            run = _run(self._states, self.scenario)
            return animate(run, path, fps=20, theme=_theme(look), **_options(self.scenario, look))
