"""
Zhou, Zhou, Zeng: a potential that holds every link
===================================================

The potential is infinite at distance 0 and at the sensing radius, so that a link, once made, can neither collapse nor
break. New links are made a little inside the radius, which is what keeps the energy from jumping without bound. The
closest pair below is certified over the whole motion, not read off stored frames.
"""

import flocking as fk
from flocking.papers import zhou_2015
from flocking.show.group_series import closest, links
from flocking.show.plane import net
from flocking.show.series import velocities
from flocking.show.sheet import panel, sheet

run = fk.simulate(zhou_2015.scenario(figure=2, seed=0), progress=False)
print(fk.audit(run))

# The links are made within the first seconds: the series show those.
early = fk.simulate(run.scenario.with_(t_end=3.0, frames=601), progress=False)

picture = sheet(
    [
        panel(net, early, frame=0), panel(net, early, trails=True),
        panel(velocities, early, 0), panel(velocities, early, 1),
        panel(closest, early), panel(links, early),
    ],
    columns=2, ratio=0.7,
)  # fmt: skip
picture.savefig("plot_zhou_2015.png", dpi=150)
