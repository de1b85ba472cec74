"""Independent transcriptions of Olfati-Saber 2003, section by section."""

from __future__ import annotations

from tests.papers import olfati_saber_figures, olfati_saber_nets, olfati_saber_obstacles, olfati_saber_protocols

CHECKS = {
    **olfati_saber_nets.CHECKS,
    **olfati_saber_protocols.CHECKS,
    **olfati_saber_obstacles.CHECKS,
    **olfati_saber_figures.CHECKS,
}
