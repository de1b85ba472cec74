"""
Tanner, Jadbabaie, Pappas, Part I: a fixed net
==============================================

Ten agents on a random connected net. Each descends the potential of its neighbours and takes over their velocity.
The energy of the paper's (6) only ever falls, and what it loses is exactly what the velocity differences dissipate:
the ledger on the right leaves nothing over.
"""

import flocking as fk
from flocking.papers import tanner_2003_fixed
from flocking.show.group_series import energy, spread
from flocking.show.plane import net
from flocking.show.sheet import panel, sheet

run = fk.simulate(tanner_2003_fixed.scenario(seed=1), progress=False)
print(fk.audit(run))

picture = sheet(
    [panel(net, run, frame=0), panel(net, run, trails=True), panel(spread, run), panel(energy, run)], columns=2
)
picture.savefig("plot_tanner_2003_fixed.png", dpi=150)
