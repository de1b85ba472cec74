"""
A million agents become one flock
=================================

Agents anywhere in a disc, in any direction, under protocol (34) of Olfati-Saber and Murray and a weak pull towards one
velocity. Within a few seconds neighbours agree on a lattice, but not on its direction: grains grow, and the lines
between them stay. The hue is the direction of the rows of the lattice, which repeats every 60 degrees; it is dark where
there is no lattice. Panels (a) to (d) show one window as it ages; (e) all of the flock, with that window; (f) single
agents in the small square of (d), with rings about those who have not six neighbours (yellow: more).

The picture shows what was kept of a run at full size, which comes with the library. This makes it anew, with a progress
bar; ``flocking run flock-from-noise --engine tiles`` runs the same scenario without pictures:

.. code-block:: text

    flocking showcase flock-from-noise --out out/flock-from-noise
"""

from flocking.papers.showcases.shipped import showcase

case = showcase("flock-from-noise")
kept = case.stored("tiles")
facts = kept.facts
made = facts["provenance"]
print(f"{facts['agents']:,} agents, {made['steps']:,} steps of {made['step']:.3g} by the engine {made['engine']}")
for k, t in enumerate(facts["times"]):
    print(
        f"t = {t:3g}, order of velocities {facts['order'][k]:.3f}, of the lattice {facts['hexatic'][k]:.3f}; "
        f"six neighbours {100 * facts['six'][k]:.0f} %"
    )
print(f"in the largest flock at the end: {100 * facts['largest'][-1]:.2f} %, of {facts['flocks'][-1]} flocks")
print(f"the ledger misses {100 * facts['ledger_share']:.2g} % of the energy moved")
for claim, (verdict, note) in facts["audit"].items():
    if verdict != "not applicable":
        print(f"audit, {claim}: {verdict}; {note}")

picture = case.draw(kept)
picture.savefig("plot_flock_from_noise.png", dpi=150)
