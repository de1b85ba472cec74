"""What parts of the world have in common: whether they are ideal, and what is not, in words."""

from __future__ import annotations

from abc import ABC, abstractmethod

from flocking.model.symmetries import SYMMETRIES


class WorldPart(ABC):
    """What agents know, or when they act."""

    @property
    @abstractmethod
    def ideal(self) -> bool:
        """Whether it is that of the ideal world, in which everybody knows the present and acts at every moment."""

    @property
    @abstractmethod
    def summary(self) -> str:
        """What is not ideal, in a few words; empty where everything is."""

    @property
    def symmetries(self) -> frozenset[str]:
        """Symmetries of `flocking.model.symmetries` that it keeps: all if it is ideal, none where it states nothing."""
        return SYMMETRIES if self.ideal else frozenset()

    def check_count(self, n: int) -> None:
        """Check that it fits ``n`` agents; most fit any number."""
        return None


class IdealPart(WorldPart):
    """A part with nothing that is not ideal."""

    @property
    def ideal(self) -> bool:
        """True."""
        return True

    @property
    def summary(self) -> str:
        """Empty."""
        return ""
