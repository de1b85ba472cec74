"""
A study of Zhou, Zhou, Zeng: the certified distance and the measured one
========================================================================

The energy bound (16)-(18) certifies that no linked pair comes closer than the distance at which one pair alone would
hold all of that energy. Every dot is a run: measured against certified, left with the bound of the paper, right with
the energy of the start and of the links that were really made. All lie above the broken line, as they must; the bound
is safe by a factor of ten to four hundred, because no pair ever holds all of the energy.

300 runs of 30 s. The picture shows results that come with the library. ``flocking sweep zhou-bound`` makes them anew.
"""

from flocking.papers.studies.shipped import study

question = study("zhou-bound")
table = question.stored()
ratio = table.values("closest_linked") / table.values("certified_closest")
print(f"{len(table)} runs, {len(table.failures)} failed")
print(f"measured over certified: {ratio.min():.0f} to {ratio.max():.0f}")

picture = question.draw(table)
picture.savefig("plot_study_zhou_bound.png", dpi=150)
