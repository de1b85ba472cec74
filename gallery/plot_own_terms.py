"""
Own terms and several graphs
============================

Separation, alignment and cohesion as formulas: each rule is a pair term over its own graph. The library lets a law
have several, and locates the switches of all of them. A fourth part, written here, keeps a cruising speed. The boids
of Reynolds (1987), with cones of perception in discrete time, are a paper of their own: ``fk.papers.reynolds_1987``.
"""

from dataclasses import dataclass

import flocking as fk
from flocking.model.observables import order
from flocking.show.plane import net
from flocking.show.sheet import panel, sheet

near, middle, far = fk.Proximity(1.0), fk.Proximity(2.0), fk.Proximity(3.5)
separation = fk.Gradient(fk.Potential("k*(1 - r)**2/r", k=3.0), over=near)
alignment = fk.Consensus(0.3, over=middle)
cohesion = fk.Gradient(fk.Potential("k*(r - R)*where(r < R, 1, 0)", k=0.12, R=3.5), over=far)


@dataclass(frozen=True)
class Cruise(fk.BodyTerm):
    """Drives the speed to v and leaves the direction free: k (1 - |p|^2/v^2) p."""

    k: float
    v: float

    @property
    def parameters(self):
        return {"k": self.k, "v": self.v}

    @property
    def structure(self):
        return ("Cruise",)

    def force(self, x):
        excess = 1 - sum(s**2 for s in x.p) / x.parameter("v") ** 2
        return [x.parameter("k") * excess * s for s in x.p]


begin = fk.start.box(36, side=7.0, speed=1.0, seed=9)
everything = {"separation": separation, "alignment": alignment, "cohesion": cohesion}
law = fk.Law(near, (*everything.values(), Cruise(0.5, 1.0)))
run = fk.simulate(fk.Scenario(law, begin, t_end=15.0, frames=76, tolerance=1e-5), progress=False)
print(f"polarisation: {order(run.state(0)):.2f} at the start, {order(run.state(-1)):.2f} at the end")
print(f"{len(run.switches)} switches of three graphs located; closest pair ever {run.closest.distance:.2f}")

panels = [panel(net, run, time=t, color="heading", links=False, title=f"$t = {t:g}$") for t in (0.0, 5.0, 15.0)]
picture = sheet(panels, columns=3, ratio=1.0)
picture.savefig("plot_own_terms.png", dpi=150)
