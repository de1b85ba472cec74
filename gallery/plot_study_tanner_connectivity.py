"""
A study of Tanner II: how often the graph stays connected
=========================================================

The theorem of Tanner II supposes that the graph stays connected. Whether it does is another matter. A thousand runs of
100 s, each from a connected start: ten agents in a ball, linked while closer than 2. Below speed 1 about four groups in
five stay whole, however densely they start; fast agents in a wide ball hardly ever do. Intervals are exact ones
(Clopper and Pearson), at 95 %.

The picture shows results that come with the library. ``flocking sweep tanner-connectivity`` makes them anew.
"""

from flocking.papers.studies.shipped import study

question = study("tanner-connectivity")
table = question.stored()
print(f"{len(table)} runs, {len(table.failures)} failed")
print(table.summary()[["connected", "connected_low", "connected_high"]].to_dataframe().round(2))

picture = question.draw(table)
picture.savefig("plot_study_tanner_connectivity.png", dpi=150)
