"""Started in a process of its own: what each part of the library says where a package of an extra is missing."""

from __future__ import annotations

import contextlib
import importlib.metadata
import io
import json
import os
import sys
import warnings
from importlib.machinery import PathFinder
from pathlib import Path

HIDDEN: set[str] = set()


def hide_packages():
    """Let the packages in `HIDDEN` be absent for imports, for `importlib.util.find_spec` and as distributions."""
    # The MPI library of the package mpich is looked for in the environment too.
    prefix = sys.prefix
    find, known = PathFinder.find_spec.__func__, importlib.metadata.distribution

    def find_spec(cls, fullname, path=None, target=None):
        return None if fullname.split(".")[0] in HIDDEN else find(cls, fullname, path, target)

    def distribution(name):
        sys.prefix = "/nowhere" if name == "mpich" and name in HIDDEN else prefix
        if name in HIDDEN:
            raise importlib.metadata.PackageNotFoundError(name)
        return known(name)

    PathFinder.find_spec = classmethod(find_spec)
    importlib.metadata.distribution = distribution


def without(names):
    """Hide some packages, also those that were imported."""
    HIDDEN.clear()
    HIDDEN.update(names)
    for name in [x for x in sys.modules if x.split(".")[0] in HIDDEN]:
        del sys.modules[name]


def main():
    folder = Path(sys.argv[1])
    os.chdir(folder)
    hide_packages()
    warnings.simplefilter("ignore")
    import matplotlib
    import numpy as np

    import flocking as fk
    from flocking.__main__ import main as command_line

    # No program of the system stands in for a package.
    matplotlib.rcParams["animation.ffmpeg_path"] = "no program has this name"
    law = fk.Law(fk.Proximity(3.0), [fk.Consensus(0.3)])
    rng = np.random.default_rng(1)
    scenario = fk.Scenario(law, fk.State(rng.normal(size=(4, 2))), t_end=0.2, frames=3)
    held = scenario.with_(control=fk.Held(0.05), information=fk.Messages(0.05))
    fk.write_scenario(scenario, "plain.toml")
    fk.write_scenario(held, "held.toml")
    run = fk.simulate(scenario, save="run", progress=False)
    for name in ("samples.parquet", "samples.gsd", "samples.mcap", "start.gsd"):
        Path(name).write_bytes(b"nothing")
    Path("sweep.toml").write_text('scenario = "tanner-2003-dynamic"\nseeds = 1\nmeasures = ["flocks"]\n')
    table = fk.sweep(lambda seed: scenario, seeds=range(1), measures=["flocks"], workers=1)

    def cli(*words):
        def call():
            said, answer = io.StringIO(), io.StringIO()
            with contextlib.redirect_stderr(said), contextlib.redirect_stdout(answer):
                try:
                    sys.argv = ["flocking", *words]
                    code = command_line()
                except SystemExit as stop:
                    code = stop.code
            return {"code": code, "said": said.getvalue(), "answered": answer.getvalue()}

        return call

    def api(action):
        def call():
            try:
                action()
            except fk.FlockingError as error:
                return {"error": type(error).__name__, "said": str(error)}
            return {"error": None, "said": "nothing"}

        return call

    done = {
        "lammps": (
            "lammps", api(lambda: fk.simulate(scenario, engine="lammps", forces="pair styles", progress=False))
        ),
        "mpi4py": ("mpi4py", api(lambda: fk.simulate(scenario, engine="lammps", progress=False))),
        "mpich": ("mpich", api(lambda: fk.simulate(scenario, engine="lammps", progress=False))),
        "lammps, command": ("lammps", cli("run", "plain.toml", "--engine", "lammps", "--option", "forces=pair styles")),
        "mpi4py, command": ("mpi4py", cli("run", "plain.toml", "--engine", "lammps")),
        "mpich, command": ("mpich", cli("run", "plain.toml", "--engine", "lammps")),
        "zenoh": ("zenoh", api(lambda: fk.simulate_nodes(held, progress=False))),
        "zenoh, command": ("zenoh", cli("nodes", "held.toml")),
        "mcap, recording": (
            "mcap", api(lambda: fk.simulate_nodes(held, record="x.mcap", processes=False, progress=False))
        ),
        "mcap, recording, command": ("mcap", cli("nodes", "held.toml", "--record", "x.mcap")),
        "cffi": ("cffi", api(lambda: fk.simulate_nodes(held, code="c", processes=False, progress=False))),
        "cffi, command": ("cffi", cli("nodes", "held.toml", "--code", "c")),
        "pyarrow, export": ("pyarrow", api(lambda: fk.export_run(run, "x.parquet"))),
        "pyarrow, export, command": ("pyarrow", cli("export", "run", "--to", "parquet")),
        "pyarrow, table": ("pyarrow", api(lambda: table.to_parquet("x.parquet"))),
        "pyarrow, samples": ("pyarrow", cli("audit", "samples.parquet", "--radius", "3")),
        "gsd, export": ("gsd", api(lambda: fk.export_run(run, "x.gsd"))),
        "gsd, export, command": ("gsd", cli("export", "run", "--to", "gsd")),
        "gsd, start": ("gsd", api(lambda: fk.read_start("start.gsd"))),
        "gsd, samples": ("gsd", cli("audit", "samples.gsd", "--radius", "3")),
        "mcap, samples": ("mcap", cli("audit", "samples.mcap", "--radius", "3")),
        "lz4, samples": ("lz4", cli("audit", "samples.mcap", "--radius", "3")),
        "zstandard, samples": ("zstandard", cli("audit", "samples.mcap", "--radius", "3")),
        "websockets": ("websockets", api(lambda: fk.lab(scenario, browser=False, wait=False))),
        "websockets, command": ("websockets", cli("lab", "plain.toml")),
        "ffmpeg": ("imageio_ffmpeg", api(lambda: fk.animate(run, "x.mp4"))),
        "ffmpeg, command": ("imageio_ffmpeg", cli("animate", "run", "--out", "x.mp4")),
        "dask": (
            "distributed",
            api(lambda: fk.sweep(lambda seed: scenario, seeds=range(1), measures=["flocks"], cluster="tcp://x:1")),
        ),
        "dask, command": ("distributed", cli("sweep", "sweep.toml", "--cluster", "tcp://x:1")),
    }  # fmt: skip
    found = {}
    for name, (package, call) in done.items():
        without({package})
        found[name] = {"package": package, **call()}
    Path("found.json").write_text(json.dumps(found))


if __name__ == "__main__":
    main()
