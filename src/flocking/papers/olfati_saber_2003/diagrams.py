"""Fig. 1 to 6 of Olfati-Saber, drawn from objects: neighbourhoods, bumps, realizations, potentials, a beta-agent."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Mask
from flocking.engine.runs.run import Run
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links
from flocking.model.graphs.views import FieldOfView
from flocking.model.potentials.bumps import BUMPS
from flocking.model.potentials.structural_potential import structural_potential
from flocking.model.state import State
from flocking.papers.olfati_saber_2003 import examples_energy, examples_nets, examples_obstacles, system
from flocking.show.curves import curve
from flocking.show.plane import net
from flocking.show.sheet import sheet
from flocking.show.style import BLUE, GREEN, ORANGE, PAGE, PURPLE, VERMILION, theme

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Picture

BUMP_RADIUS = 12.0
"""Radius of the bump in the diagram."""
POTENTIAL_RANGE = 10.0
"""Distance from the minimum up to which the potential is drawn."""
HALF_ANGLE = np.pi / 3


def neighbourhoods(_: Run) -> Picture:
    """Fig. 1: (a) the shell of an agent and (b) its field of view, with its neighbours."""
    q, headings = examples_nets.scattered(), examples_nets.directions()

    def shell(axes: Axes) -> None:
        _neighbours(axes, q, np.asarray(examples_nets.neighbourhoods(1.0)["shell"]))
        angle = np.linspace(0, 2 * np.pi, 200)
        axes.plot(*(system.RADIUS * np.array([np.cos(angle), np.sin(angle)])), color=VERMILION, lw=0.9)

    def view(axes: Axes) -> None:
        seen = FieldOfView(system.RADIUS, HALF_ANGLE).start_links(q, headings)[0]
        _neighbours(axes, q, seen)
        angle = headings[0] + np.linspace(-HALF_ANGLE, HALF_ANGLE, 120)
        edge = system.RADIUS * np.array([np.cos(angle), np.sin(angle)])
        axes.plot(*np.hstack([np.zeros((2, 1)), edge, np.zeros((2, 1))]), color=VERMILION, lw=0.9)
        axes.annotate("", (4.0, 0.0), (0.0, 0.0), arrowprops={"arrowstyle": "->", "color": theme().ink})

    return sheet([shell, view], columns=2, width=PAGE, ratio=0.9)


def _neighbours(axes: Axes, q: Array, seen: Mask) -> None:
    links = np.zeros((len(q), len(q)), dtype=bool)
    links[0] = seen
    net(State(q, links=links), axes=axes, arrows=False, title=False, limits=((-10.5, -10.5), (12.5, 10.5)))
    axes.scatter(q[seen, 0], q[seen, 1], s=36, color=GREEN, zorder=4)
    axes.scatter(q[0, 0], q[0, 1], s=44, color=VERMILION, zorder=4)


def bumps(_: Run) -> Picture:
    """Fig. 2: (a) bumps rho(z/r) for k0 = 5/6 and r = 12, and (b) their slopes."""
    looks = {"cosine": (BLUE, "-"), "quintic": (VERMILION, "--"), "infinite": (GREEN, ":")}

    def values(axes: Axes) -> None:
        for name, (color, line) in looks.items():
            curve(_of_distance(BUMPS[name]), 0.0, 15.0, axes=axes, color=color, line=line, label=r"$\rho$")
        axes.set_ylim(-0.05, 1.1)

    def slopes(axes: Axes) -> None:
        low = 0.0
        for name, (color, line) in looks.items():
            curve(_of_distance(BUMPS[name].slope), 0.0, 15.0, axes=axes, color=color, line=line, label=r"$\rho'$")
            axes.lines[-1].set_label(name)
            low = min(low, -BUMPS[name].steepest(5 / 6))
        axes.set_ylim(1.08 * low, -0.06 * low)
        axes.legend(loc="lower left")

    return sheet([values, slopes], columns=2, width=PAGE, ratio=0.7)


def _of_distance(bump: Callable[[Array, float], Array]) -> Callable[[Array], Array]:
    return lambda z: bump(z / BUMP_RADIUS, 5 / 6)


def realizations(_: Run) -> Picture:
    """Fig. 3: six realizations of a structural net of four agents."""

    def one(q: Array, links: Links) -> Callable[[Axes], None]:
        def draw(axes: Axes) -> None:
            middle, half = (q.max(axis=0) + q.min(axis=0)) / 2, 0.5 * float(np.ptp(q, axis=0).max()) + 3.0
            net(
                State(q, links=links),
                axes=axes,
                arrows=False,
                limits=((middle - half).tolist(), (middle + half).tolist()),
                title=f"{int(np.triu(links).sum())} links",
            )
            for number, point in enumerate(q, start=1):
                axes.annotate(str(number), point, xytext=(5, 5), textcoords="offset points")

        return draw

    return sheet([one(q, links) for q, links in examples_nets.figure_3(1.0)], columns=3, width=PAGE, ratio=1.0)


def potentials(_: Run) -> Picture:
    """Fig. 4: (a) psi_alpha and (b) phi_alpha for a = 1, b = 5."""
    psi = structural_potential(POTENTIAL_RANGE, system.ATTRACTION, system.REPULSION)

    def value(axes: Axes) -> None:
        curve(
            lambda z: psi(z + POTENTIAL_RANGE), -POTENTIAL_RANGE, POTENTIAL_RANGE, axes=axes, label=r"$\psi_\alpha(z)$"
        )

    def action(axes: Axes) -> None:
        curve(
            lambda z: psi.slope(z + POTENTIAL_RANGE),
            -POTENTIAL_RANGE,
            POTENTIAL_RANGE,
            axes=axes,
            label=r"$\phi_\alpha(z)$",
            color=VERMILION,
        )
        axes.set_ylim(-system.REPULSION - 0.3, system.ATTRACTION + 0.5)
        axes.axhline(0.0, color=theme().faint, lw=0.5)

    return sheet([value, action], columns=2, width=PAGE, ratio=0.7)


def pair_potentials(_: Run) -> Picture:
    """Fig. 5: potential of two agents over the deviation of their distance, (a) nonsmooth and (b) smooth."""
    from flocking.study.nets.matrices import adjacency

    d = examples_energy.WIDE
    psi = structural_potential(d, system.ATTRACTION, system.REPULSION)

    def one(smooth: bool) -> Callable[[Axes], None]:
        graph = examples_energy.pair_net(smooth)
        end = float(np.max(graph.break_radius)) - d

        def value(eta: Array) -> Array:
            weights = [adjacency(graph, np.array([[0.0, 0.0], [d + x, 0.0]]))[0, 1] for x in eta]
            return np.asarray(np.array(weights) * psi(d + eta))

        def draw(axes: Axes) -> None:
            curve(
                value,
                -4.0,
                4.0,
                axes=axes,
                breaks=() if smooth else (end,),
                variable=r"$\eta$",
                label="$V$",
                marks={r"$r - d_\alpha$": end},
            )
            axes.set_ylim(-0.15, 4.0)

        return draw

    return sheet([one(False), one(True)], columns=2, width=PAGE, ratio=0.7)


def beta_agent(_: Run) -> Picture:
    """Fig. 6: an alpha-agent (1) near an obstacle, its beta-agent (2) and the gamma-agent (3)."""
    places = examples_obstacles.figure_6(1.0)
    obstacle = examples_obstacles.first_obstacle()
    looks = {"alpha": (BLUE, "1"), "beta": (VERMILION, "2"), "gamma": (PURPLE, "3")}

    def draw(axes: Axes) -> None:
        net(
            State(places["alpha"][None]),
            axes=axes,
            arrows=False,
            title=False,
            obstacles=[obstacle],
            limits=((82.0, 8.0), (112.0, 32.0)),
        )
        angle = np.linspace(0, 2 * np.pi, 200)
        shell = places["alpha"] + system.BETA_RANGE * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        axes.plot(*shell.T, color=ORANGE, lw=0.8, ls="--")
        for end in ("beta", "gamma"):
            axes.plot(*np.stack([places["alpha"], places[end]]).T, color=theme().ink, lw=0.7, ls=":")
        for name, (color, number) in looks.items():
            axes.scatter(places[name][0], places[name][1], s=40, color=color, zorder=5)
            axes.annotate(
                number, (places[name][0], places[name][1]), xytext=(5, 6), textcoords="offset points", fontweight="bold"
            )
        direction = np.asarray(system.DESIRED_VELOCITY) / np.linalg.norm(system.DESIRED_VELOCITY)
        start, end_point = places["gamma"] + direction, places["gamma"] + 6 * direction
        tip, foot = (float(end_point[0]), float(end_point[1])), (float(start[0]), float(start[1]))
        axes.annotate("", tip, foot, arrowprops={"arrowstyle": "->", "color": theme().ink})
        axes.annotate(r"$n_d$", tip, xytext=(2, -3), textcoords="offset points")

    return sheet([draw], columns=1, width=0.6 * PAGE, ratio=0.85)
