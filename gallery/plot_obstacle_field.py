"""
A hundred thousand agents pass sixty obstacles
==============================================

Protocol (58) of Olfati-Saber and Murray, whose alpha-, beta- and gamma-agents carry a hundred agents past six
obstacles, with 100,000 of them before a field of sixty. What is bright is crowded: agents pile up before the obstacles,
squeeze through the gaps and leave wakes behind. The pressure of the crowd closes the wakes within, so that 96 of 100
agents are one flock at the end; the edges, where nothing pushes, stay frayed, and pieces of them apart.

The picture shows what was kept of a run at full size, which comes with the library. This makes it anew, with a progress
bar; ``flocking run obstacle-field --engine tiles`` runs the same scenario without pictures:

.. code-block:: text

    flocking showcase obstacle-field --out out/obstacle-field

All numbers of the law are the paper's but the gain of the pursuit: its c2 = 10 pushes so wide a crowd into the
obstacles, and 0.3 lets it flow around them.
"""

from flocking.papers.showcases.shipped import showcase

case = showcase("obstacle-field")
kept = case.stored("tiles")
facts = kept.facts
made = facts["provenance"]
print(f"{facts['agents']:,} agents, {made['steps']:,} steps of {made['step']:.3g} by the engine {made['engine']}")
nearest, inside = min(facts["clearance"]), max(facts["inside"])
print(f"nearest to an obstacle at {len(facts['times'])} frames: {nearest:.2f}; inside one: {inside}")
print(f"densest spot: {max(facts['densest']):.1f} times the lattice")
print(f"slowest mean speed on the way: {min(facts['mean_speed'][5:]):.2f}; at the end {facts['mean_speed'][-1]:.3f}")
print(f"in the largest flock at the end: {100 * facts['largest'][-1]:.1f} %, of {facts['flocks'][-1]} flocks")
print(f"still rounding an obstacle at the end: {facts['late']} agents")
print(f"the ledger misses {100 * facts['ledger_share']:.2g} % of the energy moved")
for claim, (verdict, note) in facts["audit"].items():
    if verdict != "not applicable":
        print(f"audit, {claim}: {verdict}; {note}")

picture = case.draw(kept)
picture.savefig("plot_obstacle_field.png", dpi=150)
