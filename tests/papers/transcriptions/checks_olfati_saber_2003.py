"""Independent transcriptions of Olfati-Saber 2003, subject by subject."""

from __future__ import annotations

from tests.papers.transcriptions import (
    olfati_saber_energies,
    olfati_saber_figures,
    olfati_saber_nets,
    olfati_saber_obstacles,
    olfati_saber_protocols,
    olfati_saber_separation,
)

CHECKS = {
    **olfati_saber_nets.CHECKS,
    **olfati_saber_energies.CHECKS,
    **olfati_saber_protocols.CHECKS,
    **olfati_saber_separation.CHECKS,
    **olfati_saber_obstacles.CHECKS,
    **olfati_saber_figures.CHECKS,
}
