"""The logo, and the pictures of the README and of the page on clusters, computed: python docs/make_images.py."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import flocking as fk
from flocking.papers.olfati_saber_2003.system import obstacle_scenario, obstacles
from flocking.papers.showcases.shipped import FIELD, SIX, showcase
from flocking.show import plane
from flocking.show.sheet import panel, sheet
from flocking.show.style import save

TIMES = (12.0, 20.0, 26.0, 42.0)
LARGE_TIMES = (48.0, 168.0, 320.0)
IMAGES = Path(__file__).parent / "images"


PERIODS = (0.02, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4)


def main() -> None:
    logo()
    large()
    hundred()
    safety_filter()


def logo() -> None:
    """Seven agents that settled into a hexagon, computed here: their links, and each as an arrow along its velocity."""
    import matplotlib.pyplot as plt
    from matplotlib.patches import FancyBboxPatch, Polygon

    law = fk.Law(fk.Proximity(1.3), [fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=4.0)), fk.Consensus(1.0)])
    angles = np.arange(6) * np.pi / 3 + 0.15
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    rng = np.random.default_rng(7)
    q = np.vstack([[0.0, 0.0], ring]) + rng.normal(scale=0.08, size=(7, 2))
    p = np.array([0.8, 0.45]) + rng.normal(scale=0.3, size=(7, 2))
    run = fk.simulate(fk.Scenario(law, fk.State(q, p), t_end=40.0, frames=2), progress=False)
    q, p = run.q[-1] - run.q[-1].mean(axis=0), run.p[-1]
    figure, axes = plt.subplots(figsize=(2.0, 2.0))
    axes.set_position((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(-1.75, 1.75), ylim=(-1.75, 1.75), aspect="equal")
    axes.axis("off")
    tile = FancyBboxPatch((-1.6, -1.6), 3.2, 3.2, boxstyle="round,pad=0,rounding_size=0.6", color="#0f1720")
    axes.add_patch(tile)
    for i, j in zip(*np.nonzero(np.triu(run.links[-1])), strict=True):
        axes.plot(*q[[i, j]].T, color="#7c93ab", linewidth=1.2, zorder=2)
    dart = 0.36 * np.array([[0.6, 0.0], [-0.5, 0.4], [-0.25, 0.0], [-0.5, -0.4]])
    for place, v in zip(q, p, strict=True):
        c, s = v / np.linalg.norm(v)
        axes.add_patch(Polygon(place + dart @ np.array([[c, s], [-s, c]]), color="#8fd0c8", zorder=3))
    save(figure, IMAGES / "logo", ("svg",))
    plt.close(figure)


def large() -> None:
    """A hundred thousand agents, from what is kept of full runs."""
    FIELD.strip(showcase(FIELD.name).stored("tiles"), LARGE_TIMES).savefig(IMAGES / "obstacle_field.png", dpi=150)
    kept = {"LAMMPS": showcase(SIX.name).stored("lammps"), "tiles": showcase(SIX.name).stored("tiles")}
    SIX.beside(kept).savefig(IMAGES / "cluster.png", dpi=130)


def hundred() -> None:
    """A hundred agents, computed here."""
    run = fk.simulate(obstacle_scenario(seed=0).with_(frames=TIMES))
    panels = []
    for frame, _ in enumerate(TIMES):
        middle = float(run.q[frame, :, 0].mean())
        seen = [o for o in obstacles() if abs(float(o.outline(8)[:, 0].mean()) - middle) < 140.0]
        panels.append(
            panel(
                plane.net, run, frame=frame, arrows=False, obstacles=seen, leader=False, color="flock",
                limits=((middle - 120.0, -28.0), (middle + 120.0, 74.0)),
            )
        )  # fmt: skip
    save(
        sheet(panels, columns=2, width=10.0, ratio=0.5, letters=False),
        IMAGES / "obstacles",
        ("png",),
    )


def safety_filter() -> None:
    """The closest approach of three agents for periods of the safety filter, computed here."""
    import matplotlib.pyplot as plt

    angles = np.array([0.3, 0.3 + 2 * np.pi / 3, 0.35 + 4 * np.pi / 3])
    out = np.column_stack([np.cos(angles), np.sin(angles)])
    law = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("r**2/2"))])
    figure, axes = plt.subplots(figsize=(6.0, 3.2), layout="constrained")
    for form, marker in (("continuous", "o"), ("sampled", "s"), ("stopping", "^")):
        found = []
        for period in PERIODS:
            control = fk.SafetyFilter(period, distance=0.7, acceleration=10.0, form=form)
            made = fk.Scenario(law, fk.State(3.0 * out, -1.9 * out), t_end=8.0, frames=2, control=control)
            found.append(fk.simulate(made, progress=False).closest.distance)
        axes.plot(PERIODS, found, marker=marker, label=form)
    axes.axhline(0.7, color="black", linestyle="--", linewidth=1.0, label="distance of the filter")
    axes.set(xlabel="period", ylabel="closest approach", ylim=(0.0, None))
    axes.legend(frameon=False)
    figure.savefig(IMAGES / "safety_filter.png", dpi=150)


if __name__ == "__main__":
    main()
