"""What runs, saves, resumes, judges and shows knows no engine by its name: it asks the protocol."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import flocking
from flocking.engine.driver.registry import BUILT_IN
from tests.import_graph import nodes_of, tree_of

SOURCE = Path(flocking.__file__).resolve().parent
FOLDERS = tuple(f"flocking.engine.{name}" for name in BUILT_IN)
MAY_IMPORT = {
    "__init__.py",  # gives ExactSession its public name
    "engine/c_export/exported_law.py",  # what the sampled engine asks of a safety filter
    "engine/c_export/safety_source.py",  # numbers of the sampled engine's safety filter, which exported C repeats
    "engine/driver/lammps_export.py",  # writes an input deck and runs nothing
    "engine/nodes/nodes.py",  # agents that filter their forces themselves, as that engine does
    "engine/nodes/session.py",  # the sampled engine's world, with agents in processes of their own
    "papers/vicsek_1995/large_groups.py",  # the update of headings itself, whose groups are too large for frames
    "papers/vicsek_1995/order_curves.py",  # asks whether that update computes a scenario
    "study/departed_energy/departed.py",  # computes runs of late knowledge again, with what each imperfection does
    "study/departed_energy/knowledge_differences.py",  # forces of late knowledge with fewer imperfections
    "study/certificates/safety_certificates.py",  # the braking paths of which the certificate speaks
}
FORMATS = {("apps/commands/storage_commands.py", "to.lower() == 'lammps'")}
"""Comparisons with a format of files that has the name of an engine."""
HELD = {"session", "engine", "run", "records", "recorder", "options"}
"""Names of variables that hold what the protocol describes."""
EXPORT = "apps/commands/storage_commands.py"
"""Compares the format of an export, which is called as an engine is."""

ALLOWED = ("getattr(stored, name)", "getattr(recent, name)")
"""Arrays of runs, which have them all."""
PROBES = {"getattr", "hasattr", "cast", "isinstance"}
"""Functions that ask what a variable is."""


def faults(tree: ast.Module) -> Iterator[str]:
    """Comparisons with an engine's name, probing for attributes, and casts to the classes of one engine."""
    for node in nodes_of(tree):
        if isinstance(node, ast.Compare | ast.match_case):
            inner = ast.walk(node if isinstance(node, ast.Compare) else node.pattern)
            if any(isinstance(part, ast.Constant) and part.value in BUILT_IN for part in inner):
                yield ast.unparse(node).split("\n")[0]
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in PROBES and node.args:
            first, last = ast.unparse(node.args[0]), ast.unparse(node.args[-1])
            holds = first.rpartition(".")[2].lstrip("_") in HELD
            kind = {"cast": first, "isinstance": last}.get(node.func.id, "")
            own = any(word in kind for word in ("Session", "Options", "Engine")) and kind not in ("Session", "Engine")
            if (node.func.id in ("getattr", "hasattr") and holds) or own:
                yield ast.unparse(node)


def imported(tree: ast.Module) -> set[str]:
    """Modules of engines that a file imports, anywhere in it."""
    names = {str(node.module) for node in nodes_of(tree) if isinstance(node, ast.ImportFrom)}
    names |= {alias.name for node in nodes_of(tree) if isinstance(node, ast.Import) for alias in node.names}
    return {name for name in names if f"{name}.".startswith(tuple(f"{folder}." for folder in FOLDERS))}


def test_no_engine_is_known_by_name_outside_its_folder() -> None:
    trees = {path.relative_to(SOURCE).as_posix(): tree_of(path) for path in SOURCE.rglob("*.py")}
    own = [["engine", name] for name in BUILT_IN]
    outside = {name: tree for name, tree in trees.items() if name.split("/")[:2] not in own}
    assert len(trees) - len(outside) > 80
    assert [(name, x) for name, tree in outside.items() for x in faults(tree) if (name, x) not in FORMATS] == []
    assert {name for name, tree in outside.items() if imported(tree)} == MAY_IMPORT


@pytest.mark.parametrize(
    "line",
    [
        "if engine == 'tiles': pass",
        "if name in ('exact', 'auto'): pass",
        "match name:\n    case 'sampled': pass",
        "x = getattr(self.session, 'records', None)",
        "if hasattr(engine, 'fine'): pass",
        "x = cast(TilesSession, session)",
        "if isinstance(options, TilesOptions): pass",
    ],
)
def test_such_lines_are_found(line: str) -> None:
    assert list(faults(ast.parse(line)))


@pytest.mark.parametrize(
    "line", ["if isinstance(x, Session): pass", "x = getattr(term, 'weights', None)", "y = 'exact'"]
)
def test_other_lines_are_not(line: str) -> None:
    assert not list(faults(ast.parse(line)))


def test_imports_of_engines_are_found() -> None:
    text = "def f():\n    from flocking.engine.exact.session import ExactSession\nimport flocking.engine.tiles\n"
    assert imported(ast.parse(text)) == {"flocking.engine.exact.session", "flocking.engine.tiles"}
    assert not imported(ast.parse("from flocking.engine.driver.simulate import start"))


def test_nobody_but_an_engine_compares_its_name() -> None:
    """Nor asks a session for what may or may not be there: all that others use is in the protocol."""
    found = []
    for path in sorted(SOURCE.rglob("*.py")):
        place = path.relative_to(SOURCE).as_posix()
        for node in nodes_of(tree_of(path)):
            if isinstance(node, ast.Compare):
                values = [x.value for x in [node.left, *node.comparators] if isinstance(x, ast.Constant)]
                if set(values) & set(BUILT_IN) and place != EXPORT:
                    found.append(f"{place}:{node.lineno}")
            called = node.func.id if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) else ""
            about = place.startswith(("engine/driver", "engine/protocol", "apps/lab/experiment/experiment"))
            if called in ("getattr", "hasattr", "cast") and about and ast.unparse(node) not in ALLOWED:
                found.append(f"{place}:{node.lineno} {called}")
    assert found == []
