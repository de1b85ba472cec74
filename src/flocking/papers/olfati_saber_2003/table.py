"""Equation table of Olfati-Saber: where each numbered statement lives and how it is read."""

from __future__ import annotations

from flocking.papers.olfati_saber_2003.table_nets import net_rows, structure_rows
from flocking.papers.olfati_saber_2003.table_obstacles import obstacle_rows
from flocking.papers.olfati_saber_2003.table_protocols import (
    dissipation_rows,
    energy_rows,
    protocol_rows,
    separation_rows,
)
from flocking.study.equations import Erratum, Row, errata_of


def equations() -> tuple[Row, ...]:
    """Every numbered statement of the paper, section by section."""
    return (
        *net_rows(), *structure_rows(), *energy_rows(), *protocol_rows(), *dissipation_rows(), *separation_rows(),
        *obstacle_rows(),
    )  # fmt: skip


def errata() -> list[Erratum]:
    """False statements and misprints of the paper."""
    return errata_of(equations())
