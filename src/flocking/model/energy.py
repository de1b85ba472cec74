"""Energies: the function of a theorem and its frame, independent of the control."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from flocking.errors import InvalidInput
from flocking.model.checks import number, one_of, text
from flocking.model.leaders_and_obstacles.leaders import Leader
from flocking.model.parts import values
from flocking.model.parts.description import Group, add_group
from flocking.model.parts.registration import register_part

FRAMES = ("lab", "centre of mass", "leader")


@dataclass(frozen=True)
class Energy:
    """Kinetic energy relative to a frame, plus the energies stored by the terms of the law.

    Parameters
    ----------
    frame
        ``"lab"``, ``"centre of mass"`` (Olfati-Saber (27), Shi (11)) or ``"leader"`` (Zhou (25), Shi's J).
    leader
        The leader of the frame, for ``"leader"``.
    unlinked
        Energy of a pair that is not linked: V_R makes Tanner II (6) continuous where a link breaks.
    name
        Its symbol in the paper.

    Raises
    ------
    InvalidInput
        If the frame is unknown or the leader is missing.
    """

    frame: Annotated[str, values.choice(*FRAMES)] = "lab"
    leader: Leader | None = None
    unlinked: float = 0.0
    name: str = "H"

    def __post_init__(self) -> None:
        one_of("Energy", "frame", self.frame, FRAMES)
        if self.leader is not None and not isinstance(self.leader, Leader):
            raise InvalidInput("Energy", "leader", "must be a leader", self.leader)
        if (self.frame == "leader") != (self.leader is not None):
            raise InvalidInput("Energy", "leader", "must be given exactly when the frame is 'leader'", self.leader)
        text("Energy", "name", self.name)
        object.__setattr__(self, "unlinked", number("Energy", "unlinked", self.unlinked))

    @property
    def structure(self) -> tuple[object, ...]:
        """Everything that determines its formulas."""
        return (self.frame, self.leader.structure if self.leader is not None else None)


add_group(Group("energy", Energy, key=None))
register_part("energy")(Energy)
