"""Bodies of a user's own, declared outside the library."""

from dataclasses import dataclass

import numpy as np

import flocking as fk


@dataclass(frozen=True, eq=False)
class Actuated(fk.Body):
    """A point mass whose force follows the desired one with a time constant."""

    masses: object = 1.0
    damping: object = 0.0
    time_constant: object = 0.5

    def __post_init__(self):
        self.check_fields()

    @property
    def order(self):
        return 2

    @property
    def columns(self):
        return (fk.Column("force"),)

    @property
    def parameters(self):
        return {"time_constant": self.time_constant}

    def lets(self, x):
        return {"rate": 1 / x.parameter("time_constant")}

    def rates(self, x):
        force = x.columns["force"]
        return {
            "p": [(f - x.damping * v) / x.mass for f, v in zip(force, x.p, strict=True)],
            "force": [x.let("rate") * (u - f) for u, f in zip(x.u, force, strict=True)],
        }

    def start(self, column, q, p):
        return np.zeros_like(q)


@dataclass(frozen=True, eq=False)
class Heavy(Actuated):
    """One with another kinetic energy than that of a point mass."""

    def kinetic(self, x, relative):
        return 2 * super().kinetic(x, relative)
