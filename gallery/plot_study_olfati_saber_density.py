"""
A study of Olfati-Saber: what decides the density after the obstacles
=====================================================================

The paper prints a density of 0.97 for a hundred agents that have passed six obstacles, and neither the region they
start in nor the gain that makes them follow. All regions here have one area. A long, narrow region and a large gain
give the printed density; a compact square falls into pieces at the obstacles and does not rejoin.

Three runs at each point, 27 in all: a run takes seconds. Three are too few for an interval of the mean, so the dots
show every run whose density is known. With the smallest gain the motion at the obstacles is so sensitive that in eight
of nine runs the error leaves links open at the end: their densities are not known, and the column ``message`` says
which agents are in doubt. The picture shows results that come with the library. ``flocking sweep
olfati-saber-density`` makes them anew.
"""

from flocking.papers.studies.shipped import study

question = study("olfati-saber-density")
table = question.stored()
print(f"{len(table)} runs, {len(table.failures)} failed")
print(table.summary()[["density", "density_interval"]].to_dataframe().round(3))

picture = question.draw(table)
picture.savefig("plot_study_olfati_saber_density.png", dpi=150)
