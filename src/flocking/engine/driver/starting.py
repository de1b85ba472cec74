"""The object ``start``: a call opens a session; its methods draw random initial states."""

from __future__ import annotations

from flocking.engine.driver import simulate
from flocking.engine.protocol.session import Session
from flocking.model import starts
from flocking.model.law import Law, Scenario


class _Start:
    """Opens sessions (``start(scenario)``) and draws starts (``start.box``, ``start.ball``, ``start.hexagonal``)."""

    box = staticmethod(starts.box)
    ball = staticmethod(starts.ball)
    hexagonal = staticmethod(starts.hexagonal)

    def __call__(
        self, scenario: Scenario, engine: str = "auto", *, plant: Law | None = None, **options: object
    ) -> Session:
        """Open a session; see `flocking.engine.driver.simulate.start`."""
        return simulate.start(scenario, engine, plant=plant, **options)


start = _Start()
"""The object ``fk.start``."""
