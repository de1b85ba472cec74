"""Dependence of the density after the obstacles (0.97) on tracking law, gain, start box and gamma-agents."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from flocking.engine.driver.simulate import simulate
from flocking.model.observables import density, flocks
from flocking.papers import obstacle_passages
from flocking.papers.olfati_saber_2003 import system
from flocking.show.style import BLUE, COLUMN, VERMILION, axes_or_new, in_style, theme

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Box = tuple[tuple[float, float], tuple[float, float]]

PRINTED = 0.97
"""Density reported in the paper."""


@dataclass(frozen=True)
class Variant:
    """A variant of the first task.

    Parameters
    ----------
    name
        Its name.
    tracking, gain, gamma_agents, box
        As in `flocking.papers.olfati_saber_2003.system.obstacle_scenario`.
    """

    name: str
    tracking: str = "agent"
    gain: float = system.TRACKING_GAIN
    gamma_agents: bool = True
    box: Box = field(default=system.START_BOX)


STRIP = Variant("as in Fig. 7, 8")
VARIANTS = (
    STRIP,
    Variant("gain 2", gain=2.0),
    Variant("gain 1", gain=1.0),
    Variant("shared (66)", tracking="shared"),
    Variant("no gamma-agents", gamma_agents=False),
    Variant("wide strip 107 x 30", box=((-87.0, 7.5), (107.0, 30.0))),
    Variant("square 57 x 57", box=((-37.0, -6.0), (57.0, 57.0))),
)
"""The variants; all boxes have nearly the same area, the same centre line and the same front."""


@dataclass(frozen=True)
class Outcome:
    """Result of one run.

    Parameters
    ----------
    variant
        The variant.
    seed
        Seed of the start.
    density
        Density at the end of the run.
    flocks
        Number of flocks at the end.
    behind
        Fraction of the agents that have passed the last obstacle at the end.
    slowest
        Largest |p_i - p_d|/|p_d| at the end.
    """

    variant: Variant
    seed: int
    density: float
    flocks: int
    behind: float
    slowest: float


def outcome(
    variant: Variant, seed: int, *, agents: int = system.AGENTS, t_end: float = system.OBSTACLE_DURATION
) -> Outcome:
    """Run one variant for one seed.

    Parameters
    ----------
    variant
        The variant.
    seed
        Seed of the start.
    agents
        Number of agents; boxes are scaled to the same density.
    t_end
        Duration.
    """
    corner, sides = variant.box
    shrink = agents / system.AGENTS
    box = ((corner[0] + (1 - shrink) * sides[0], corner[1]), (sides[0] * shrink, sides[1]))
    scenario = system.obstacle_scenario(
        seed,
        tracking=variant.tracking,
        tracking_gain=variant.gain,
        gamma_agents=variant.gamma_agents,
        box=box,
        agents=agents,
    )
    run = simulate(scenario.with_(t_end=t_end, frames=(0.0, t_end), name=""), progress=False)
    desired = np.asarray(system.DESIRED_VELOCITY)
    last = max(float(o.outline(64)[:, 0].max()) for o in obstacle_passages.obstacles_of(run))
    off = np.linalg.norm(run.p[-1] - desired, axis=1).max() / np.linalg.norm(desired)
    links = run.links_at(-1)
    return Outcome(variant, seed, density(links), flocks(links), float((run.q[-1][:, 0] > last).mean()), float(off))


def density_table(
    variants: Iterable[Variant] = VARIANTS,
    seeds: Sequence[int] = (0, 1, 2),
    *,
    agents: int = system.AGENTS,
    t_end: float = system.OBSTACLE_DURATION,
) -> list[Outcome]:
    """Outcomes of all variants for all seeds.

    Parameters
    ----------
    variants
        The variants.
    seeds
        Seeds of the starts.
    agents, t_end
        As for `outcome`.
    """
    return [outcome(variant, seed, agents=agents, t_end=t_end) for variant in variants for seed in seeds]


@in_style
def density_chart(table: Sequence[Outcome], axes: Axes | None = None) -> Axes:
    """Draw densities by variant, one dot per seed, with the paper's value.

    Parameters
    ----------
    table
        Outcomes.
    axes
        The axes; a new figure by default.
    """
    names = list(dict.fromkeys(x.variant.name for x in table))
    axes = axes_or_new(axes, width=1.5 * COLUMN, height=0.3 * COLUMN + 0.22 * len(names))
    for row, name in enumerate(names):
        found = [x.density for x in table if x.variant.name == name]
        axes.plot(found, [row] * len(found), "o", color=BLUE, ms=4, alpha=0.8, gid="densities")
        axes.plot([np.mean(found)], [row], "|", color=theme().ink, ms=11, gid="mean")
    axes.axvline(PRINTED, color=VERMILION, lw=0.8, ls="--", gid="printed")
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.02)
    axes.set_xlabel("density at the end")
    return axes
