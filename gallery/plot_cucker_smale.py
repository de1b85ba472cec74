"""
Cucker and Smale: influence that decays with distance
=====================================================

Every agent listens to every other, with weight K/(1 + r^2)^beta (IEEE TAC 52, 2007). For beta below 1/2 the velocities
agree whatever the start. Above, a start that spreads too fast stays spread. The weight is a new pair term of ten lines;
stating what it dissipates puts it into the energy ledger.
"""

from dataclasses import dataclass

import flocking as fk
from flocking.show.plane import net
from flocking.show.sheet import panel, sheet


@dataclass(frozen=True)
class CuckerSmale(fk.PairTerm):
    """Velocity consensus of weight K/(1 + r^2)^beta."""

    K: float
    beta: float

    @property
    def parameters(self):
        return {"K": self.K, "beta": self.beta}

    @property
    def structure(self):
        return ("CuckerSmale",)

    def drag(self, x):
        return x.parameter("K") / (1 + x.r**2) ** x.parameter("beta")

    def dissipation(self, x):
        return self.drag(x) * x.speed2


n = 20
begin = fk.start.ball(n, radius=3.0, speed=3.0, seed=8)


def simulate(beta):
    law = fk.Law(fk.Fixed.complete(n), [CuckerSmale(8.0 / n, beta)])
    return fk.simulate(fk.Scenario(law, begin, t_end=40.0, tolerance=1e-8), progress=False)


runs = {beta: simulate(beta) for beta in (0.2, 0.45, 0.8, 1.5)}


def spreads(axes):
    for beta, run in runs.items():
        gaps = ((run.p - run.p.mean(axis=1, keepdims=True)) ** 2).sum(axis=-1).max(axis=1) ** 0.5
        axes.semilogy(run.t, gaps, label=rf"$\beta = {beta:g}$")
        print(f"beta = {beta:g}: largest velocity difference at the end {gaps[-1]:.1e}")
    axes.set_xlabel("$t$")
    axes.set_ylabel(r"largest $|p_i - \bar p|$")
    axes.set_ylim(1e-4, 10)
    axes.legend()


nets = [panel(net, runs[b], links=False, trails=True, title=rf"$\beta = {b:g}$") for b in (0.2, 1.5)]
picture = sheet([*nets, spreads], columns=3)
picture.savefig("plot_cucker_smale.png", dpi=150)
