"""Plain tables for terminals and pipes: at most as wide as the terminal, 80 columns where there is none."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Sequence

from flocking.apps.standard_streams import printable


def print_table(head: Sequence[str], rows: Iterable[Sequence[str]], *, title: str = "") -> None:
    """Print a table; long cells wrap, nothing is cut off.

    Parameters
    ----------
    head
        Names of the columns.
    rows
        Cells as text.
    title
        A line above the table.
    """
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console(file=sys.stdout, highlight=False, emoji=False, markup=False)
    table = Table(box=SIMPLE_HEAD, pad_edge=False, show_edge=False, header_style="bold")
    last = len(head) - 1
    for k, name in enumerate(head):
        table.add_column(name, overflow="fold", no_wrap=k == 0 and last > 0)
    for row in rows:
        table.add_row(*(Text(printable(cell)) for cell in row))
    if title:
        console.print(Text(printable(title)))
    with console.capture() as captured:
        console.print(table)
    # Rich fills lines with blanks, which pipes and files would keep.
    print("\n".join(line.rstrip() for line in captured.get().splitlines()))


def print_facts(facts: Iterable[tuple[str, str]]) -> None:
    """Print names and values, one pair a line.

    Parameters
    ----------
    facts
        Pairs of a name and a value as text; those with an empty value are left out.
    """
    pairs = [(name, value) for name, value in facts if value]
    width = max((len(name) for name, _ in pairs), default=0)
    for name, value in pairs:
        print(printable(f"{name.ljust(width)}  {value}"))


def short(value: float | None) -> str:
    """A number in few digits; a dash where there is none."""
    return "-" if value is None or not math.isfinite(value) else f"{value:.3g}"
