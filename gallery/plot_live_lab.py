"""
The live lab, with a page and without
=====================================

``flocking lab`` opens a page in which a scenario runs live and is changed while it does:

.. image:: ../images/lab_fragmented.png
   :alt: A flock that fell apart among obstacles, with the agent that left first painted and the claim it broke

The page is one user of a session; this script is another. The consensus is switched off before the obstacles, the
flock falls apart, and the record of what was done gives the same bits again.
"""

import numpy as np

import flocking as fk
from flocking.apps.lab.experiment.experiment import Experiment, replay
from flocking.model.observables import flocks

experiment = Experiment(fk.papers.olfati_saber_2003.scenario(seed=0))
experiment.advance(2.0)
experiment.apply({"kind": "set", "path": ["law", "terms", 1, "gain"], "value": 0.0})
experiment.advance(21.0)
count = flocks(experiment.state.links)
print(f"{count} flocks at t = {experiment.time:g}")

# %%
# What was done is a list of times and plain data; doing it again leads to the same state, bit for bit.

for time, event in experiment.log.entries:
    print(time, event)
again = replay(experiment.log)
again.advance(experiment.time)
same = np.array_equal(again.state.q, experiment.state.q) and np.array_equal(again.state.p, experiment.state.p)
print("the same bits:", same)

# %%
# The law as it is now runs on like any other.

obstacles = experiment.scenario.law.terms[3].obstacles
run = fk.simulate(experiment.scenario.with_(start=experiment.state, t_end=21.2, frames=2), progress=False)
picture = fk.plot(run, "net", color="flock", obstacles=obstacles)
picture.savefig("plot_live_lab.png", dpi=150)
