"""No kernel ever stands for other formulas than those of the parts it is asked for."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import textwrap
import types
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.engine.kernels.codegen import array_kernels, compiled_kernels
from flocking.engine.kernels.layout import Layout
from flocking.errors import InvalidInput
from flocking.formula import compiled, origins

PACKAGE = Path(fk.__file__).parent
STATE = fk.State([[0.0, 0], [1, 0.5]], [[1.0, 0], [0, -1]], 0.5)


@pytest.fixture
def cache(tmp_path, monkeypatch):
    folder = tmp_path / "cache"
    monkeypatch.setenv("FLOCKING_CACHE", str(folder))
    monkeypatch.setattr(compiled, "_modules", {})
    return folder


def everything_of_the_library():
    """One law with every kind of part, and all functions that are printed of parts and laws."""
    from flocking.engine.lammps.pairs import _evaluated
    from flocking.engine.tiles.kernels.spec import KernelSpec, graph_kinds
    from flocking.engine.tiles.kernels.step_kernel import tile_kernels
    from flocking.model.graphs.graph_weights import weight_function

    leader = fk.Path(["sin(t)", "cos(2*t)"])
    ball, wall = fk.Ball([5.0, 0], 1.0), fk.Wall([0.0, -3], [0, 1])
    corner = fk.ConvexPolygon([[0.0, 5], [1, 5], [1, 6]], 0.1)
    psi = fk.Potential("where(r < a, 1/r + 5*exp(-r), abs(r - 1) - abs(a - 1) + 1/a + 5*exp(-a))", a=0.31)
    smooth = fk.Smooth(2.0, 0.31)
    terms = [fk.Gradient(psi), fk.Consensus(1.0, weights=fk.HashedWeights(0.5, 1.0, 3)), fk.Track(leader, 1.0, 1.0)]
    law = fk.Law(smooth, [*terms, fk.Avoid([ball, wall], leader, range=0.9)])
    layout = Layout(law, fk.Energy("leader", leader))
    scenario = fk.Scenario(law, STATE, 1.0, energy=layout.energy)
    spec = KernelSpec(layout, 2, "float64", graph_kinds(scenario, True), ("hash",), False, False, False, True)
    compiled_kernels(layout, 2)
    array_kernels(layout, 2)
    tile_kernels(spec)
    psi(1.0), psi.kinks(), leader.at(0.3), smooth.shape(0.5, 0.2), weight_function(smooth), _evaluated("r**7", 1.0)
    for obstacle in (ball, wall, corner):
        obstacle.distance(STATE.q)


@pytest.fixture(scope="module")
def printing(tmp_path_factory):
    """Files of the package whose code runs while formulas are stated and printed."""
    found, patch = set(), pytest.MonkeyPatch()
    patch.setenv("FLOCKING_CACHE", str(tmp_path_factory.mktemp("cache")))
    patch.setattr(compiled, "_modules", {})
    make = compiled._of_structure

    def watched(text, make_source):
        def source():
            before = sys.gettrace()
            sys.settrace(lambda frame, *_: found.add(frame.f_code.co_filename))
            try:
                return make_source()
            finally:
                sys.settrace(before)

        return make(text, source)

    patch.setattr(compiled, "_of_structure", watched)
    everything_of_the_library()
    patch.undo()
    return sorted(Path(f).relative_to(PACKAGE) for f in found if Path(f).is_relative_to(PACKAGE))


def test_every_module_that_prints_changes_the_key(printing, tmp_path):
    names = {path.as_posix() for path in printing}
    known = {
        "engine/kernels/obstacle_formulas.py",
        "engine/kernels/codegen.py",
        "engine/kernels/expressions.py",
        "engine/tiles/kernels/step_kernel.py",
    }
    known |= {
        "engine/tiles/kernels/printing.py",
        "formula/printing.py",
        "model/leaders_and_obstacles/obstacles.py",
        "model/leaders_and_obstacles/polygons.py",
    }
    known |= {
        "model/leaders_and_obstacles/leaders.py",
        "model/potentials/bumps.py",
        "engine/lammps/pairs.py",
        "model/graphs/graph_weights.py",
    }
    assert known <= names
    copy = tmp_path / "flocking"
    for floor in origins.FLOORS:
        shutil.copytree(PACKAGE / floor, copy / floor)
    keys = {origins.generation(copy)}
    for path in printing:
        with (copy / path).open("a") as file:
            file.write("\n# edited\n")
        origins.generation.cache_clear()
        keys.add(origins.generation(copy))
    assert len(keys) == len(printing) + 1


def test_functions_that_kernels_call_are_in_their_name():
    source = "from flocking.engine.tiles.simd.inverse_square_root import inverse_root\n"
    called = origins.runtime_digest(source)
    assert called
    assert called != origins.runtime_digest("from flocking.engine.tiles.simd.reductions import total\n")
    assert origins.runtime_digest("import numpy\n") == ""


def run(script, cache, path, **env):
    """Standard output of a script in a new process, as JSON."""
    words = {**os.environ, "FLOCKING_CACHE": str(cache), "PYTHONPATH": os.pathsep.join(map(str, path)), **env}
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)], env=words, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_an_edited_printer_is_not_served_old_code(tmp_path):
    shutil.copytree(PACKAGE, tmp_path / "copy" / "flocking", ignore=shutil.ignore_patterns("__pycache__", "papers"))
    script = """
        import json, sys
        import flocking as fk
        law = fk.Law(fk.Proximity(2.0), [fk.Avoid([fk.Ball([1.0, 0.0], 0.5)], range=2.0, gamma_agents=False)])
        u = fk.control(law, fk.State([[0.0, 0.0]]))
        print(json.dumps([u.ravel().tolist(), "sympy" in sys.modules]))
    """
    path = [tmp_path / "copy"]
    first, cold = run(script, tmp_path / "cache", path)
    again, warm = run(script, tmp_path / "cache", path)
    assert cold
    assert not warm
    assert first == again
    assert abs(first[0]) > 1e-3
    printer = tmp_path / "copy" / "flocking" / "engine" / "kernels" / "obstacle_formulas.py"
    text = printer.read_text()
    assert text.count("tuple(term.obstacle_force(x))") == 1
    printer.write_text(text.replace("tuple(term.obstacle_force(x))", "tuple(3 * f for f in term.obstacle_force(x))"))
    changed, cold = run(script, tmp_path / "cache", path)
    assert cold
    assert changed == pytest.approx([3 * f for f in first])


PARTS = '''
import flocking as fk
import sympy
from flocking.model.leaders_and_obstacles.obstacles import Piece

GAIN = {gain}

def helper(r):
    return {gain} * r

def enclosing(gain):
    def inner(x):
        return gain * x.r
    return inner

closure = enclosing({gain})

class Plain(fk.PairTerm):
    parameters = {{}}
    structure = ("Plain",)

class Base(Plain):
    def drag(self, x):
        return {gain} * x.r

class Inherited(Base):
    pass

class Constant(Plain):
    def drag(self, x):
        return GAIN * x.r

class Helped(Plain):
    def drag(self, x):
        return helper(x.r)

class Closed(Plain):
    def drag(self, x):
        return closure(x)

class Generated(Plain):
    def drag(self, x):
        power = lambda k: x.r**k
        return sum(GAIN * power(k) for k in (1,))

class Stored(Plain):
    def storage(self, x):
        return GAIN * x.r**2 / 2
    def along(self, x):
        return sympy.diff(self.storage(x), x.r)

class Pull(fk.BodyTerm):
    parameters = {{}}
    structure = ("Pull",)
    def force(self, x):
        return [GAIN * q for q in x.q]

class Runner(fk.Path):
    def velocity(self, t, parameter):
        return [GAIN * v for v in super().velocity(t, parameter)]

class Swelling(fk.Ball):
    def signed_distance(self, q, t, parameter):
        return [Piece(p.distance - (GAIN - 1) * 0.1) for p in super().signed_distance(q, t, parameter)]

class Fading(fk.Smooth):
    def weight(self, r, parameter):
        return GAIN * super().weight(r, parameter)

class Deep(fk.Potential):
    def expression(self, r, values=None):
        return GAIN * super().expression(r, values)

class Broad(type(fk.Smooth(1.0, 0.5).shape)):
    def expression(self, z, k0):
        return GAIN * super().expression(z, k0)

ALONE = Inherited, Constant, Helped, Closed, Generated, Stored, Pull
near = fk.Proximity(2.0)
psi = fk.Potential("k*r^2/2", k=1.0)

def laws():
    smooth = fk.Smooth(2.0, 0.9)
    path = Runner(["t", "2"])
    broad = Broad("broad", smooth.shape.formula)
    return {{
        **{{kind.__name__: fk.Law(near, [kind()]) for kind in ALONE}},
        "Runner": fk.Law(near, [fk.Track(path, 0.0, 1.0)]),
        "Swelling": fk.Law(near, [fk.Avoid([Swelling([1.0, 0.0], 0.5)], range=1.9, gamma_agents=False)]),
        "Mover": fk.Law(near, [fk.Avoid([fk.Ball(path, 0.5)], range=1.9, gamma_agents=False)]),
        "Fading": fk.Law(Fading(2.0, 0.9), [fk.Consensus(1.0, weighted=True)]),
        "Broad": fk.Law(fk.Smooth(2.0, 0.9, broad), [fk.Consensus(1.0, weighted=True)]),
        "Deep": fk.Law(near, [fk.Gradient(Deep("k*r^2/2", k=1.0))]),
    }}

def own(law):
    """The values that parts compute by themselves."""
    return {{
        "Runner": Runner(["t", "2"]).at(0.5)[0].tolist(),
        "Swelling": Swelling([1.0, 0.0], 0.5).distance([[0.0, 0.0]]).tolist(),
        "Deep": float(Deep("k*r^2/2", k=1.0)(1.0)),
        "Broad": float(Broad("broad", fk.Smooth(1.0, 0.5).shape.formula)(0.5, 0.9)),
    }}
'''
LINEAR = ("Inherited", "Constant", "Helped", "Closed", "Generated", "Stored", "Pull", "Fading", "Broad", "Deep")
"""Laws whose control is proportional to the gain."""


def parts_with(gain):
    """The module of user's parts, as if it had been edited and imported again."""
    module = types.ModuleType("users_parts")
    exec(PARTS.format(gain=gain), module.__dict__)
    return module


def names_of(law):
    layout = Layout(law, fk.Energy())
    return compiled_kernels(layout, 2).__name__, array_kernels(layout, 2).__name__


def test_parts_of_users_are_read_anew_in_one_process(cache):
    small, large = parts_with(1.0), parts_with(10.0)
    for name, law in small.laws().items():
        other = large.laws()[name]
        assert all(a != b for a, b in zip(names_of(law), names_of(other), strict=True)), name
        assert names_of(law) == names_of(small.laws()[name])
        one, ten = fk.control(law, STATE), fk.control(other, STATE)
        assert np.abs(ten - one).max() > 1e-3, name
        if name in LINEAR:
            assert ten == pytest.approx(10 * one), name
    for name, value in small.own(None).items():
        assert np.ravel(large.own(None)[name]) != pytest.approx(np.ravel(value)), name
    assert large.own(None)["Runner"] == pytest.approx([1.25, 10.0])
    assert large.own(None)["Swelling"] == pytest.approx([-0.4])


def test_the_very_same_objects_are_read_anew(cache):
    module = parts_with(1.0)
    laws = module.laws()
    before = {name: fk.control(law, STATE) for name, law in laws.items()}
    module.GAIN = 10.0
    for name in ("Constant", "Generated", "Stored", "Pull", "Fading", "Broad", "Deep"):
        assert fk.control(laws[name], STATE) == pytest.approx(10 * before[name]), name
    for name in ("Runner", "Swelling", "Mover"):
        assert np.abs(fk.control(laws[name], STATE) - before[name]).max() > 1e-3, name


@pytest.mark.slow
def test_the_exact_engine_runs_the_edited_term(cache):
    for gain in (0.1, 1.0):
        law = parts_with(gain).laws()["Pull"]
        run = fk.simulate(fk.Scenario(law, fk.State([[1.0, 0]]), 1.0, frames=2), progress=False)
        assert run.q[-1, 0, 0] == pytest.approx(np.cosh(np.sqrt(gain)), rel=1e-7)


@pytest.mark.slow
def test_parts_of_users_are_read_anew_in_a_new_process_and_print_once(tmp_path):
    script = """
        import json, users_parts as u, flocking as fk
        from flocking.engine.kernels.codegen import compiled_kernels
        from flocking.engine.kernels.layout import Layout
        state = fk.State([[0.0, 0], [1, 0.5]], [[1.0, 0], [0, -1]], 0.5)
        laws = {name: u.laws()[name] for name in ("Helped", "Stored", "Runner", "Swelling", "Fading", "Deep")}
        found = {name: fk.control(law, state).ravel().tolist() for name, law in laws.items()}
        names = [compiled_kernels(Layout(law, fk.Energy()), 2).__name__ for law in laws.values()]
        print(json.dumps([found, names]))
    """
    path, cache = [tmp_path, PACKAGE.parent], tmp_path / "cache"
    (tmp_path / "users_parts.py").write_text(PARTS.format(gain=1.0))
    one, names = run(script, cache, path, PYTHONHASHSEED="1")
    written = sorted(p.name for p in cache.glob("*.py"))
    assert run(script, cache, path, PYTHONHASHSEED="2") == [one, names]
    assert sorted(p.name for p in cache.glob("*.py")) == written
    (tmp_path / "users_parts.py").write_text(PARTS.format(gain=10.0))
    ten, others = run(script, cache, path)
    assert not set(names) & set(others)
    for name in set(LINEAR) & set(one):
        assert ten[name] == pytest.approx([10 * u for u in one[name]]), name


def test_the_leader_of_the_energy_is_part_of_the_key(cache):
    first, second = fk.Velocity([1.0, 0.0]), fk.Velocity([0.0, 5.0])
    law = fk.Law(fk.Proximity(2.0), [fk.Track(first, 0.0, 1.0), fk.Track(second, 0.0, 2.0)])
    for leader in (first, second):
        found = fk.evaluate(law, STATE, energy=fk.Energy("leader", leader))
        relative = STATE.p - leader.value
        assert found.dissipation == pytest.approx(3 * (relative**2).sum())


def test_balls_of_users_and_of_the_library_keep_their_own_formulas(cache):
    small = parts_with(1.0)
    module = parts_with(4.0)
    alone = [fk.Ball([1.0, 0.0], 0.5), module.Swelling([0.0, 1.0], 0.5)]
    state = fk.State([[0.1, 0.2]])

    def pushed(obstacles):
        return fk.control(fk.Law(fk.Proximity(2.0), [fk.Avoid(obstacles, range=1.9, gamma_agents=False)]), state)

    both = pushed(alone)
    assert both == pytest.approx(pushed(alone[:1]) + pushed(alone[1:]))
    assert both == pytest.approx(pushed([alone[0], fk.Ball([0.0, 1.0], 0.8)]))
    assert np.abs(both - pushed([alone[0], small.Swelling([0.0, 1.0], 0.5)])).max() > 1e-3


def test_obstacles_that_hide_what_their_formulas_depend_on_are_refused(cache):
    from flocking.model.leaders_and_obstacles.obstacles import Piece

    class Odd(fk.Ball):
        def __init__(self, centre, radius, power):
            super().__init__(centre, radius)
            object.__setattr__(self, "power", power)

        def signed_distance(self, q, t, parameter):
            (piece,) = super().signed_distance(q, t, parameter)
            return [Piece(piece.distance * self.power)]

    odd = [Odd([1.0, 0.0], 0.5, 1), Odd([0.0, 1.0], 0.5, 2)]
    law = fk.Law(fk.Proximity(2.0), [fk.Avoid(odd, range=1.9, gamma_agents=False)])
    with pytest.raises(InvalidInput, match="Odd: structure must differ"):
        fk.control(law, STATE)


def test_a_session_reads_formulas_once(cache):
    module = parts_with(1.0)
    calls = []

    class Counted(module.Runner):
        def velocity(self, t, parameter):
            calls.append(1)
            return super().velocity(t, parameter)

    leader = Counted(["exp(-t^2)", "0"])
    law = fk.Law(fk.Proximity(2.0), [fk.Track(leader, 0.0, 1.0)])
    session = fk.ExactSession(fk.Scenario(law, STATE, 10.0))
    session.advance(1.0)
    first = len(calls)
    session.advance(5.0)
    assert len(calls) == first


def test_an_edit_under_a_running_process_leaves_no_note(cache, monkeypatch):
    monkeypatch.setattr(origins, "_BEGAN", 0.0)
    assert not origins.as_loaded()
    fk.Potential("1/r + 19*r")(1.0)
    assert not list(cache.glob("*.txt"))
    assert list(cache.glob("*.py"))
