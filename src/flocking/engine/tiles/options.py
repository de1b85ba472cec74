"""Options of the tiled engine."""

from __future__ import annotations

from dataclasses import dataclass, replace

from flocking.engine.fixed_step.certain_pairs import lists_limit
from flocking.engine.fixed_step.supported_bodies import is_point
from flocking.engine.fixed_step.threads import check_threads
from flocking.engine.tiles.kernels.spec import INTEGRATORS, PRECISIONS, integrator_of
from flocking.errors import InvalidInput
from flocking.model.bodies.body import Body
from flocking.model.checks import number

LEDGER_TIMES = ("steps", "ticks")
"""When the ledger is computed under held control."""


@dataclass(frozen=True)
class TilesOptions:
    """Options of the tiled engine.

    Parameters
    ----------
    step
        Time step; chosen from the start by default. Steps are shortened slightly so that they end at frame times.
    scheme
        For agents of order 2 ``"verlet"`` (half-step velocities, as in LAMMPS), ``"damped"`` (the same with exact
        integration of the agents' own damping, for strong damping) or ``"rk4"``. For agents of order 1 ``"rk4"`` or
        ``"euler"``: order 4 and 1 between switches, with four passes per step and one. The default is the first of
        these: at equal cost Runge-Kutta was about as accurate as the Euler method where links switch, far more accurate
        where forces are smooth, and its ledger residual was hundreds of times smaller.
    precision
        ``"float64"`` or ``"float32"``.
    threads
        Number of threads; all processors by default. Results do not depend on it.
    ledger
        Whether the energy ledger is computed at every step and used to check the step.
    log
        Under held control: whether what agents use when they act is logged, with the links that they know, as the
        engine ``sampled`` does: `flocking.replay` computes it again. By default where ``precision`` is ``"float64"``,
        there are at most 2,000 agents, and the log takes no more than 256 MiB by the neighbours at the start; the
        provenance of other runs states why they keep none. True asks for a log of any size that fits into memory,
        8 GiB, or is written to disk while the run goes on.
    ledger_at
        Under held control: ``"steps"``, or ``"ticks"``, where the ledger is computed only when somebody acts. Then it
        costs little, and its residual states how much the rate of the energy changes between two ticks; an error of
        what is dissipated or supplied cancels that of what departs.
    observe
        Whether order, flocks, density and closest pair are recorded at the frame times.
    keep_frames
        Whether positions and velocities are stored at the frame times.
    skin
        Skin of the neighbour lists; chosen automatically by default.
    memory_limit
        Largest size of the neighbour lists in bytes; half the machine's memory by default.

    Raises
    ------
    InvalidInput
        If a value is out of range or unknown.
    """

    step: float | None = None
    scheme: str | None = None
    precision: str = "float64"
    threads: int | None = None
    ledger: bool = True
    observe: bool = False
    keep_frames: bool = True
    skin: float | None = None
    memory_limit: float | None = None
    ledger_at: str = "steps"
    log: bool | None = None

    def __post_init__(self) -> None:
        names = tuple(dict.fromkeys(name for some in INTEGRATORS.values() for name in some))
        if self.scheme is not None and self.scheme not in names:
            raise InvalidInput("TilesOptions", "scheme", f"must be one of {', '.join(names)}", self.scheme)
        if self.precision not in PRECISIONS:
            raise InvalidInput("TilesOptions", "precision", f"must be one of {', '.join(PRECISIONS)}", self.precision)
        for name in ("step", "skin", "memory_limit"):
            if getattr(self, name) is not None:
                number("TilesOptions", name, getattr(self, name), above=0.0)
        if self.threads is not None:
            check_threads("TilesOptions", self.threads)
        if self.ledger_at not in LEDGER_TIMES:
            raise InvalidInput("TilesOptions", "ledger_at", f"must be one of {', '.join(LEDGER_TIMES)}", self.ledger_at)
        if self.log is not None and not isinstance(self.log, bool):
            raise InvalidInput("TilesOptions", "log", "must be True or False, or left out", self.log)
        for name in ("ledger", "observe", "keep_frames"):
            if not isinstance(getattr(self, name), bool):
                raise InvalidInput("TilesOptions", name, "must be True or False", getattr(self, name))

    def of_order(self, order: int) -> TilesOptions:
        """These options with the integrator for agents of an order.

        Parameters
        ----------
        order
            Order of the agents.

        Raises
        ------
        InvalidInput
            If the integrator does not apply to such agents.
        """
        return replace(self, scheme=integrator_of(self.scheme, order))

    def of_body(self, body: Body) -> TilesOptions:
        """These options with the integrator for some agents under continuous control.

        Agents that are more than points are integrated by Runge-Kutta steps; those of order 1 then have no ledger:
        what their velocities depart from has no sum among those of the kernels.

        Parameters
        ----------
        body
            The agents.

        Raises
        ------
        InvalidInput
            If the integrator does not apply to such agents.
        """
        if is_point(body):
            return self.of_order(body.order)
        if self.scheme not in (None, "rk4"):
            raise InvalidInput(
                "TilesOptions", "scheme", f"must be 'rk4' for {type(body).__name__} agents", self.scheme,
                "Leave it out.",
            )  # fmt: skip
        return replace(self, scheme="rk4", ledger=self.ledger and body.order == 2)

    @property
    def lists_limit(self) -> float:
        """Memory limit of the neighbour lists in bytes."""
        if self.memory_limit is not None:
            return self.memory_limit
        return lists_limit()
