"""A tile of the tiled engine: sixteen agents of a crowd and the table of their neighbours, as the engine holds them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import flocking as fk
from flocking.engine.tiles.neighbours.neighbour_lists import NUMBER, WIDTH
from flocking.show.sheet import sheet

RADIUS, SKIN, SHOWN = 1.2, 0.3, 5
BLUE, ORANGE, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "#9A9A9A"


def particles() -> Any:
    """A few agents in the order, the cells and the lists of the engine."""
    law = fk.Law(fk.Proximity(RADIUS), [fk.Consensus(1.0)])
    begin = fk.start.hexagonal(150, spacing=0.9, noise=0.08, speed=0.1, seed=3)
    session = fk.start(fk.Scenario(law, begin, t_end=1.0), "tiles", step=0.01, skin=SKIN, ledger=False)
    return session._particles


def draw_tile(path: Path) -> None:
    """Draw the picture."""
    found = particles()
    q, lists, grid = found.X[:2, : found.n], found.lists[0], found.search.sorter.grid
    mine = np.arange(SHOWN * WIDTH, (SHOWN + 1) * WIDTH)
    looked_at = mine[7]
    table = lists.rows[lists.first[SHOWN] : lists.first[SHOWN] + lists.count[SHOWN]] & NUMBER
    apart = np.hypot(*(q - q[:, looked_at, None]))
    print(f"tile {SHOWN}: agents {mine[0]} to {mine[-1]}, {len(table)} rows of {WIDTH}")

    def place(axes: Any) -> None:
        lines: dict[str, Any] = {"color": GREY, "lw": 0.5, "zorder": 0}
        edges = [np.array(grid.origin[k]) + np.arange(grid.shape[k] + 1) / grid.inverse[k] for k in range(2)]
        axes.vlines(edges[0], edges[1][0], edges[1][-1], **lines)
        axes.hlines(edges[1], edges[0][0], edges[0][-1], **lines)
        axes.plot(*q, "-", color=GREY, lw=0.4, alpha=0.6, label="order in memory")
        axes.plot(*q, "o", color=GREY, ms=2.5)
        near = (apart < RADIUS + SKIN) & (apart > 0)
        axes.plot(*q[:, near], "o", color=GREEN, ms=4, label="in its list")
        axes.plot(*q[:, mine], "s", mfc="none", color=BLUE, ms=5.5, label="one tile")
        axes.plot(*q[:, looked_at], "o", color=ORANGE, ms=4)
        turn = np.linspace(0, 2 * np.pi, 200)
        for radius, style in ((RADIUS, "-"), (RADIUS + SKIN, "--")):
            axes.plot(q[0, looked_at] + radius * np.cos(turn), q[1, looked_at] + radius * np.sin(turn), style,
                      color=ORANGE, lw=1.0, label="radius" if style == "-" else "radius and skin")  # fmt: skip
        axes.set_aspect("equal")
        axes.set_axis_off()
        axes.set_title("agents sorted by cells")
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=3, fontsize=6)

    def lanes(axes: Any) -> None:
        for row, entries in enumerate(table):
            for lane, entry in enumerate(entries):
                own = entry == mine[lane]
                color = GREY if own else ORANGE if mine[lane] == looked_at else "k"
                axes.text(lane, row, str(entry), ha="center", va="center", fontsize=4.8, color=color,
                          alpha=0.5 if own else 1.0)  # fmt: skip
        axes.axvspan(6.5, 7.5, color=ORANGE, alpha=0.12, lw=0)
        axes.set_xlim(-0.6, WIDTH - 0.4)
        axes.set_ylim(len(table) - 0.4, -0.6)
        axes.set_xticks(range(WIDTH), [str(i) for i in mine], fontsize=4.8, color=BLUE)
        axes.xaxis.tick_top()
        axes.set_yticks(range(0, len(table), 2))
        axes.set_xlabel("one lane for each agent of the tile")
        axes.set_ylabel("row: one load, sixteen neighbours")
        axes.set_title("its list of neighbours")

    sheet([place, lanes], columns=2).savefig(path, dpi=150)


if __name__ == "__main__":
    draw_tile(Path("tile.png"))
