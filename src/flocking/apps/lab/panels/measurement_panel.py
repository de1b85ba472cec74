"""Live numbers, curves and verdicts, computed on their own thread."""

from __future__ import annotations

import math
import threading
import time
from typing import TYPE_CHECKING

import numpy as np

from flocking.apps.lab.experiment.clock import Clock, Frame
from flocking.apps.lab.experiment.history import History, Series
from flocking.apps.lab.panels.measures import (
    LEDGER,
    MOST_CLAIMS,
    NAMES,
    ShownVerdict,
    claims_of,
    guarantees_of,
    ledger,
    measured,
    verdicts_on,
)
from flocking.apps.lab.scene.scene import Scene
from flocking.engine.runs.run import Run
from flocking.model.law import Law
from flocking.study.certificates.certificate import Certificates

if TYPE_CHECKING:
    from viser import GuiApi, GuiButtonHandle

READ_SECONDS = 0.2
"""Least seconds between two measurements: five in a second can still be read."""
JUDGE_SECONDS = 1.0
"""Least seconds between two judgements of the claims, which take longer than measurements."""
PATIENCE = 5.0
"""The next judgement waits at least this many times the duration of the last."""

MOST_NAMED = 12
"""Agents that the text of a verdict names; more do not fit in a few lines."""

CURVES = ("energy", "velocity spread", "connectivity")
INKS = ("#0072b2", "#d55e00", "#009e73")
SECOND_INK = "#999999"
"""Colour of the second run, when two are compared."""


class MeasurementPanel:
    """The part of a page that measures.

    Parameters
    ----------
    gui
        GUI of a viser server.
    clock
        The clock.
    scene
        The scene, in which agents are highlighted.
    """

    def __init__(self, gui: GuiApi, clock: Clock, scene: Scene) -> None:
        self._gui, self._clock, self._scene = gui, clock, scene
        self.series = Series(NAMES)
        self.history = History()
        self.verdicts: list[ShownVerdict] = []
        self.reads = 0
        self.table = gui.add_html("")
        self._plots = [
            gui.add_uplot(
                (np.array([0.0, 1.0]), np.zeros(2)), _inks(ink, 1), title=name, aspect=3.2, padding=(14, 10, 0, 0),
                scales={"x": {"time": False}}, legend={"show": False},
            )
            for name, ink in zip(CURVES, INKS, strict=True)
        ]  # fmt: skip
        self._certified: tuple[float, Law, Certificates | None] | None = None
        self._buttons: list[GuiButtonHandle] = []
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="flocking-lab-measurements", daemon=True)

    def add_verdicts(self) -> None:
        """Make the elements of the verdicts in the open container."""
        self._about = self._gui.add_markdown("Claims are judged by the motion since the last intervention.")
        self._message = self._gui.add_markdown("")
        self._clear = self._gui.add_button("Clear highlight", visible=False)
        self._rack = self._gui.add_folder("Claims")

        @self._clear.on_click
        def _(_: object) -> None:
            self._highlight((), "")

    def begin(self) -> None:
        """Start reading."""
        self._thread.start()

    def join(self) -> None:
        """Wait for the thread; the clock must be closed."""
        if self._thread.is_alive():
            self._thread.join()

    def reset(self) -> None:
        """Clear the measurements."""
        with self._lock:
            self.series = Series(NAMES)
            self.history.clear()
            self.verdicts = []
        self._highlight((), "")

    def _run(self) -> None:
        number, judged, pause = 0, 0.0, JUDGE_SECONDS
        while not self._clock.closed:
            frame = self._clock.next_frame(number)
            if frame is None:
                continue
            number = frame.number
            begin = time.perf_counter()
            try:
                self._read(frame)
                if begin - judged > pause and frame.states[0].n <= MOST_CLAIMS:
                    self.judge(frame)
                    judged = time.perf_counter()
                    pause = max(JUDGE_SECONDS, PATIENCE * (judged - begin))
            except Exception as error:  # a measure may fail for a changed law
                self.table.content = f"<p>The measurements failed: {type(error).__name__}: {error}</p>"
            time.sleep(max(READ_SECONDS, 2 * (time.perf_counter() - begin)))

    def _read(self, frame: Frame) -> None:
        count = len(frame.states)
        with self._lock:
            self.history.take(frame)
            numbers = [_numbers(frame, k) for k in range(count)]
            if len(self.series.names) != count * len(NAMES):
                self.series = Series(NAMES * count)
            self.series.add(frame.time, tuple(each[name] for each in numbers for name in NAMES))
            columns = self.series.columns()
        self.reads += 1
        self.table.content = self._html(frame, numbers)
        if len(columns[0]) < 2:
            return
        for plot, name, ink in zip(self._plots, CURVES, INKS, strict=True):
            values = columns[1 + NAMES.index(name) :: len(NAMES)]
            if all(np.isfinite(each).any() for each in values):
                with self._scene.server.atomic():
                    if len(plot.series) != 1 + count:
                        plot.series = _inks(ink, count)
                    plot.data = (columns[0], *values)

    def _html(self, frame: Frame, numbers: list[dict[str, float]]) -> str:
        state = frame.states[0]
        clock = self._clock
        experiment = clock.experiments[0]
        pace = f"{clock.reached:.3g} of {clock.speed:.3g}" if clock.playing else "paused"
        rows = {"agents": [f"{state.n} in {state.dimension}-D, {experiment.engine} engine"], "time per second": [pace]}
        for name in (*NAMES, *LEDGER):
            values = [each[name] for each in numbers]
            if not all(math.isnan(value) for value in values):
                rows[f"&nbsp; {name}" if name in LEDGER else name] = [f"{value:.4g}" for value in values]
        if not experiment.complete:
            rows["log"] = ["full: this can no longer be replayed"]
        if len(numbers) > 1:
            rows = {"": ["first", "second (grey curves)"], **rows}
        cells = "".join(
            f"<tr><td>{name}</td>{''.join(_cell(value, len(numbers) // len(values)) for value in values)}</tr>"
            for name, values in rows.items()
        )
        return f"<table style='font-size:0.85em;width:100%;padding:0 0.8em'>{cells}</table>"

    def window(self) -> Run | None:
        """The motion since the last intervention, as a run."""
        session = self._clock.experiments[0].session
        closest, accuracy = session.known
        with self._lock:
            return self.history.run(closest, accuracy, session.fidelity)

    def judge(self, frame: Frame) -> None:
        """Judge the claims and show the verdicts."""
        run = self.window()
        if run is None or not run.links.size:
            return
        law = run.scenario.law
        if self._certified is None or self._certified[:2] != (float(run.t[0]), law):
            self._certified = float(run.t[0]), law, guarantees_of(run)
        self.verdicts = verdicts_on(run, claims_of(frame.scenarios[0].name), self._certified[2])
        first, last = run.t[0], run.t[-1]
        self._about.content = (
            f"Judged on t = {first:.4g} to {last:.4g}, since the last intervention. Click a broken claim."
        )
        self._show_verdicts()

    def _show_verdicts(self) -> None:
        shown = [verdict for verdict in self.verdicts if verdict.word != "not applicable"]
        while len(self._buttons) > len(shown):
            self._buttons.pop().remove()
        with self._rack:
            while len(self._buttons) < len(shown):
                self._buttons.append(self._button(len(self._buttons)))
        for button, verdict in zip(self._buttons, shown, strict=True):
            label = f"{verdict.claim.key}: {verdict.lamp}"
            if verdict.witness is not None:
                label += f" (t = {verdict.witness.time:.3g})"
            if button.label != label:
                button.label, button.color = label, verdict.color

    def _button(self, number: int) -> GuiButtonHandle:
        button = self._gui.add_button("...", color="gray")

        @button.on_click
        def _(_: object) -> None:
            self.show(number)

        return button

    def show(self, number: int) -> None:
        """Describe a verdict, and highlight its agents.

        Parameters
        ----------
        number
            Number of the verdict among those shown.
        """
        shown = [verdict for verdict in self.verdicts if verdict.word != "not applicable"]
        if number >= len(shown):
            return
        verdict = shown[number]
        agents = verdict.witness.agents if verdict.witness else ()
        about = f" At t = {verdict.witness.time:.4g}" if verdict.witness else ""
        if agents:
            about += f", agents {', '.join(map(str, agents[:MOST_NAMED]))}{'...' if len(agents) > MOST_NAMED else ''}."
        elif about:
            about += "."
        hypothesis = " Its hypothesis is not met:" if verdict.word == "hypothesis not met" else ""
        claim = verdict.claim
        text = f"**{claim.key}** ({claim.source}). {claim.statement}{hypothesis} {verdict.note}.{about}"
        if verdict.guarantee is not None:
            text += f" Guaranteed before the run: {verdict.guarantee.statement}"
        self._highlight(agents, text)

    def _highlight(self, agents: tuple[int, ...], text: str) -> None:
        self._scene.look.highlight = agents
        self._message.content = text
        self._clear.visible = bool(text)
        if agents:
            self._scene.aim(self._clock.frame)  # they may be far away
        self._scene.repaint()


def _numbers(frame: Frame, k: int) -> dict[str, float]:
    """Measurements of one of a frame's runs, with its ledger since the last intervention."""
    rows = list(frame.rows[k][0])
    found = dict.fromkeys(LEDGER, float("nan"))
    if rows:
        since = next((row for row in rows if row[0] >= frame.changed_at[k]), rows[-1])
        found = ledger(since, rows[-1])
    return measured(frame.states[k], rows[-1][1] if rows else float("nan")) | found


def _inks(ink: str, count: int) -> tuple[dict[str, object], ...]:
    lines = [{"stroke": color, "width": 2, "points": {"show": False}} for color in (ink, SECOND_INK)[:count]]
    return ({}, *lines)


def _cell(value: str, width: int) -> str:
    return f"<td colspan='{width}'><b>{value}</b></td>"
