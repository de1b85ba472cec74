"""What sessions with adaptive steps state of their steps: how long they are, and how exact."""

from __future__ import annotations

from flocking.engine.adaptive_steps.step_lengths import Shrunk, StepLengths
from flocking.engine.adaptive_steps.stepper import Stepper
from flocking.engine.protocol.session import Session
from flocking.engine.runs.fidelity import Approaches, Fidelity, LedgerRule


class AdaptiveSession(Session):
    """A session whose steps are chosen by the tolerance of its scenario."""

    _lengths: StepLengths
    _stepper: Stepper

    @property
    def shrunk(self) -> Shrunk | None:
        """The length of the last steps and the agents that limit it, if the run hardly advances."""
        step = self._lengths.shrunk_to
        return None if step is None else Shrunk(step, self._stepper.strained)

    @property
    def steady(self) -> bool:
        """Whether the last steps were about as long as those before."""
        return self._lengths.usual and self._lengths.shrunk_to is None

    @property
    def about(self) -> dict[str, object]:
        """Provenance of the records, with the tolerance of the steps, and when the law or the state was replaced."""
        return super().about | {"tolerance": self.scenario.tolerance} | self.records.replacements

    @property
    def fidelity(self) -> Fidelity:
        """Switches are located, and the ledger is held to the tolerance of the steps."""
        rule = LedgerRule("tolerance", self.scenario.tolerance)
        return Fidelity(
            self.engine, switches_located=True, approaches=Approaches("all", None), ledger=rule,
            changed=bool(self.records.replaced_at),
        )  # fmt: skip
