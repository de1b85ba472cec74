"""
A study of Shi, Wang, Chu: how many need to know
================================================

Under law (4) an agent either knows the leader's velocity or does not. One that knows is enough for all to follow in the
end, since the graph is connected; how long it takes is what the number decides. With one informed agent in ten, most
groups have not settled within 100 s: the times on the left are of those that have.

A hundred runs. The picture shows results that come with the library. ``flocking sweep shi-informed`` makes them anew.
"""

from flocking.papers.studies.shipped import study

question = study("shi-informed")
table = question.stored()
print(f"{len(table)} runs, {len(table.failures)} failed")
print(table.summary()[["following_time", "following", "following_low"]].to_dataframe().round(2))

picture = question.draw(table)
picture.savefig("plot_study_shi_informed.png", dpi=150)
