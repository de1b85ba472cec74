"""Imports go down only and in no circle, importing is cheap, files stay small, types and style hold."""

from __future__ import annotations

import ast
import io
import json
import re
import subprocess
import sys
import tokenize
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

import flocking
from tests.import_graph import Imports, among_children, circles, imports_of, nodes_of, tree_of

SOURCE = Path(flocking.__file__).resolve().parent
ROOT = Path(__file__).resolve().parents[1]
HEAVY = (
    "numba",
    "llvmlite",
    "scipy",
    "sympy",
    "matplotlib",
    "zarr",
    "networkx",
    "rich",
    "xarray",
    "mpmath",
)
FLOORS = ("moved_names", "arrays", "errors", "formula", "model", "engine", "study", "show", "papers", "apps")
LONGEST = 420
MOST_LINES_OF_ANY_TYPE = 135
MOST_FILES = 20
MOST_ANY = 99
ENGINE = (
    {"memory_shortage"}, {"interruption"}, {"archives"}, {"runs"}, {"protocol"}, {"kernels"}, {"reference"},
    {"fixed_step", "adaptive_steps", "imperfect"},
    {"exact", "sampled", "delayed", "discrete", "tiles", "storage"}, {"c_export", "lammps"}, {"nodes"}, {"driver"},
)  # fmt: skip
"""Parts of the engine, each of which imports those of earlier rows alone: no engine knows storage or another engine,
but `lammps` runs the kernels of `tiles` on many processes, and storage knows no engine."""
FILES = sorted(p for p in SOURCE.rglob("*.py") if "__pycache__" not in p.parts)


def run(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def tool(name: str) -> str:
    path = Path(sys.executable).parent / name
    assert path.exists(), f"{name} is not installed: pip install 'flocking[test]'"
    return str(path)


def test_imports_go_down_only():
    found = run(tool("lint-imports"), "--no-cache")
    assert found.returncode == 0, found.stdout[-4000:] + found.stderr


@cache
def imports_of_source() -> Imports:
    return imports_of(SOURCE)


def test_no_files_import_each_other():
    """In a circle nothing can be read, tested or moved alone; imports for type checks count too."""
    assert circles(imports_of_source()) == []


def test_lammps_knows_of_the_engines_tiles_alone():
    found = among_children(imports_of_source(), "flocking.engine")["lammps"]
    assert found & {"c_export", "exact", "sampled", "delayed", "discrete", "tiles", "storage"} == {"tiles"}


def test_no_folders_import_each_other():
    imports = imports_of_source()
    folders = {name.rpartition(".")[0] for name in imports}
    found = {folder: circles(among_children(imports, folder)) for folder in sorted(folders)}
    assert {folder: circle for folder, circle in found.items() if circle} == {}


def test_the_engine_is_built_in_rows():
    row = {part: k for k, parts in enumerate(ENGINE) for part in parts}
    found = among_children(imports_of_source(), "flocking.engine")
    assert set(found) == set(row)
    assert [(a, b) for a, others in sorted(found.items()) for b in sorted(others) if row[b] >= row[a]] == []


AUTHORS = re.compile(r"olfati|saber|tanner|jadbabaie|pappas|\bshi\b|\bshi_|zhou", re.IGNORECASE)
CITATION = re.compile(r"\((?:[^()]|\((?:[^()]|\([^()]*\))*\))*\)|Source: [^.]*\.")
"""What stands in parentheses, and sentences that name a source."""


def papers_named(text: str) -> list[str]:
    """Where a file names a paper, but for sources in its docstrings."""
    tree = ast.parse(text)
    docs = {
        node.body[0].value
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None
    }
    cited = {id(doc): CITATION.sub("", doc.value) for doc in docs}
    found = []
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        doc = next((d for d in docs if (d.lineno, d.col_offset) == token.start), None)
        if AUTHORS.search(token.string if doc is None else cited[id(doc)]):
            found.append(f"line {token.start[0]}: {token.string.splitlines()[0]}")
    return found


def test_study_names_no_paper():
    """Analysis is general; what is a paper's belongs to the folder of the paper."""
    paths = sorted((SOURCE / "study").rglob("*.py"))
    assert len(paths) > 50
    found = {path.name: papers_named(path.read_text()) for path in paths}
    assert {name: lines for name, lines in found.items() if lines} == {}


def test_names_of_papers_are_found():
    text = '"""Degrees (Saber (9)). Source: Tanner I (4)."""\n# as Zhou does\nKEY = "shi-2009"\ntanner_bound = 1.0\n'
    assert [line.split(":")[0] for line in papers_named(text)] == ["line 2", "line 3", "line 4"]
    assert papers_named('"""As Olfati-Saber shows."""\n') != []
    assert papers_named('"""Shift of a ship (Tanner II, Definition V.2)."""\nshift = 1\n') == []


@pytest.mark.parametrize("root", [SOURCE, ROOT / "tests"], ids=["src", "tests"])
def test_no_folder_holds_more_files_than_a_reader_takes_in(root):
    count: dict[str, int] = {}
    for path in root.rglob("*.py"):
        folder = path.parent.relative_to(root).as_posix()
        count[folder] = count.get(folder, 0) + (path.name != "__init__.py")
    assert {folder: number for folder, number in count.items() if number > MOST_FILES} == {}


HIDDEN_CIRCLE = {
    "low/one.py": "import typing\nif typing.TYPE_CHECKING:\n    from house.low.two import B\nclass A: ...\n",
    "low/two.py": "def b():\n    from house.low import one\n    return one.A\nclass B: ...\n",
    "low/three.py": "import house.high.four\n",
    "high/four.py": "from house.low.one import A\n",
}


def test_circles_are_found_for_type_checks_inside_functions_and_between_folders(tmp_path):
    for name, text in HIDDEN_CIRCLE.items():
        path = tmp_path / "house" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        (path.parent / "__init__.py").touch()
    imports = imports_of(tmp_path / "house")
    assert circles(imports) == [["house.low.one", "house.low.two"]]
    assert circles(among_children(imports, "house")) == [["high", "low"]]


def test_every_module_has_a_floor():
    names = {p.relative_to(SOURCE).parts[0].removesuffix(".py") for p in FILES}
    assert names <= {*FLOORS, "__init__", "__main__"}


def test_importing_pulls_in_nothing_heavy_and_is_quick():
    code = (
        "import sys, time, json; import numpy; begin = time.process_time(); import flocking; "
        "flocking.Law, flocking.Potential, flocking.start; "
        f"print(json.dumps([time.process_time() - begin, [m for m in {HEAVY!r} if m in sys.modules]]))"
    )
    bare = code.replace("import numpy; ", "").replace("flocking.Law, flocking.Potential, flocking.start; ", "")
    # The least processor time of three: a busy machine takes more.
    seconds, pulled = min(json.loads(run(sys.executable, "-c", bare).stdout) for _ in range(3))
    assert pulled == []
    assert seconds < 0.3


def test_building_a_law_needs_nothing_heavy():
    code = (
        "import sys, flocking as fk; psi = fk.Potential('1/r + 1/(R - r)', R=4); "
        "fk.Law(fk.Hysteresis(4, 0.1), [fk.Gradient(psi), fk.Consensus(1.0), fk.Track(fk.Sink([0, 0]), 1.0)]); "
        f"print([m for m in {HEAVY!r} if m in sys.modules])"
    )
    found = run(sys.executable, "-c", code)
    assert found.stdout.strip() == "[]", found.stdout + found.stderr


def imports_up(floor: str, tree: ast.Module) -> list[str]:
    """Modules of higher floors that a file imports, anywhere in it."""
    named = [str(node.module) for node in nodes_of(tree) if isinstance(node, ast.ImportFrom)]
    own = [module for module in named if module.startswith("flocking.")]
    return [module for module in own if FLOORS.index(module.split(".")[1]) > FLOORS.index(floor)]


def test_no_import_inside_a_function_goes_up():
    """The layer contract sees modules; this one names the file, and sees imports inside functions too."""
    floors = {path: path.relative_to(SOURCE).with_suffix("").parts[0] for path in FILES}
    # Errors import the types of what they describe, for type checks alone.
    checked = [path for path in FILES if floors[path] in FLOORS and floors[path] != "errors"]
    assert len(checked) > len(FILES) - 10
    found = {str(path): imports_up(floors[path], tree_of(path)) for path in checked}
    assert {path: modules for path, modules in found.items() if modules} == {}


def test_imports_that_go_up_are_found():
    tree = ast.parse("def f():\n    from flocking.engine.runs import run\nfrom flocking.model.law import Law\n")
    assert imports_up("model", tree) == ["flocking.engine.runs"]
    assert imports_up("engine", tree) == []


def test_files_are_short_and_named_by_their_jobs():
    vague = {"utils", "util", "helpers", "manager", "misc", "common"}
    long = {str(path): count for path in FILES if (count := len(path.read_text().splitlines())) > LONGEST}
    assert long == {}
    assert [str(path) for path in FILES if vague & set(path.stem.split("_"))] == []


def heavy_imports(parts: tuple[str, ...], tree: ast.Module) -> set[str]:
    """Heavy libraries that a file imports at its top, though it may not; ``parts`` are those of its path."""
    allowed = {"llvmlite"} if {"simd", "native"} & set(parts) else set()
    names = [a.name for node in tree.body if isinstance(node, ast.Import) for a in node.names]
    names += [str(node.module) for node in tree.body if isinstance(node, ast.ImportFrom)]
    return {name.split(".")[0] for name in names} & (set(HEAVY) - allowed)


def test_heavy_libraries_are_imported_where_they_are_used():
    """At the top of a module only NumPy is allowed, but llvmlite where LLVM is written."""
    found = {str(path): heavy_imports(path.relative_to(SOURCE).parts, tree_of(path)) for path in FILES}
    assert {path: names for path, names in found.items() if names} == {}


def test_heavy_libraries_at_the_top_are_found():
    tree = ast.parse("import sympy.core\nfrom scipy import linalg\nimport llvmlite\ndef f():\n    import zarr\n")
    assert heavy_imports(("engine", "tiles", "simd", "vectors.py"), tree) == {"sympy", "scipy"}
    assert heavy_imports(("engine", "tiles", "session.py"), tree) == {"sympy", "scipy", "llvmlite"}


def test_public_names_are_there_and_listed_once():
    for name in flocking.__all__:
        assert getattr(flocking, name) is not None
    assert len(set(flocking.__all__)) == len(flocking.__all__)
    assert set(flocking.__all__) <= set(dir(flocking))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        flocking.nothing  # noqa: B018
    stated = {
        alias.asname
        for path in (SOURCE / "__init__.py", SOURCE / "model" / "library.py")
        for node in nodes_of(tree_of(path))
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.asname and not alias.asname.startswith("_")
    }
    assert stated == set(flocking.__all__)


def test_fewer_and_fewer_values_are_of_any_type():
    """Lines of the source that say ``Any``: a type that nothing is checked against. The number only falls."""
    lines = [line for path in FILES for line in path.read_text().splitlines() if re.search(r"\bAny\b", line)]
    assert len(lines) <= MOST_LINES_OF_ANY_TYPE


def test_types_hold():
    # The package that is imported here: of the source tree, or of a wheel that was installed.
    found = run(tool("mypy"), *(() if (ROOT / "src").exists() else ("-p", "flocking")))
    assert found.returncode == 0, found.stdout[-6000:] + found.stderr


def test_style_holds():
    found = run(tool("ruff"), "check", "--no-cache", ".")
    assert found.returncode == 0, found.stdout[-6000:] + found.stderr


def test_nothing_is_left_unfinished():
    """No stub, no skipped test, no note of later work in the source."""
    marks = ["TO" + "DO", "FIX" + "ME", "X" * 3, "pytest.mark." + "skip", "pytest." + "skip("]
    texts = [*FILES, *sorted((ROOT / "tests").rglob("*.py"))]
    found = [(p.name, mark) for p in texts for mark in marks if mark in p.read_text()]
    assert found == []


VAGUE_NAMES = {
    "told", "stray", "tops", "soft", "crowd", "whole", "wanted", "books", "culprits", "crew", "campaign", "families",
    "findings", "durable", "handling", "instruments", "encounters", "grains",
}  # fmt: skip
"""Words that do not state what a value is."""


def is_typed_dict(node: ast.AST) -> bool:
    """Whether a class declares keys of a dictionary: keys of stored files stay as they are."""
    return isinstance(node, ast.ClassDef) and [ast.unparse(base) for base in node.bases] == ["TypedDict"]


def identifiers(tree: ast.Module) -> set[str]:
    """Names that a file gives to variables, arguments, attributes, functions and classes."""
    keys = {x for node in nodes_of(tree) if is_typed_dict(node) for x in ast.walk(node) if isinstance(x, ast.Name)}
    nodes = [node for node in nodes_of(tree) if node not in keys]
    found = {node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    found |= {node.attr for node in nodes if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)}
    found |= {node.arg for node in nodes if isinstance(node, ast.arg)}
    found |= {
        x.asname for node in nodes if isinstance(node, ast.Import | ast.ImportFrom) for x in node.names if x.asname
    }
    return found | {
        node.name for node in nodes if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
    }


def words(names: set[str]) -> set[str]:
    """Words that names are made of, in small letters."""
    parts = {part for name in names for part in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)}
    return {part.lower() for part in parts}


def test_no_name_is_vague():
    names = {path.relative_to(SOURCE).as_posix(): identifiers(tree_of(path)) | {path.stem} for path in FILES}
    found = {path: VAGUE_NAMES & words(here) for path, here in names.items()}
    assert {path: vague for path, vague in found.items() if vague} == {}


def test_vague_names_are_found():
    text = (
        "class Wanted(Base):\n    WHOLE = 1\n    def _told(self, soft):\n        self.stray = tops2 = wantedForce = 1\n"
    )
    assert words(identifiers(ast.parse(text))) >= {"wanted", "whole", "told", "soft", "stray", "tops"}
    text = "import files as books\nasync def whole(): ...\nclass Fields(TypedDict):\n    crowd: int\n"
    assert VAGUE_NAMES & words(identifiers(ast.parse(text))) == {"books", "whole"}


READERS = (*(ROOT / name for name in ("tests", "docs", "gallery", "benchmarks")), SOURCE)


def top_names(tree: ast.Module) -> list[str]:
    """Names of functions, classes and values at the top of a file."""
    found = [node.name for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)]
    targets = [
        x for node in tree.body if isinstance(node, ast.Assign) for target in node.targets for x in ast.walk(target)
    ]
    targets += [node.target for node in tree.body if isinstance(node, ast.AnnAssign)]
    return [name for name in found + [x.id for x in targets if isinstance(x, ast.Name)] if not name.startswith("__")]


def test_no_name_is_dead():
    """Each name at the top of a file is used somewhere: in another line, a test, a table, a page."""
    paths = {p for root in READERS for end in ("py", "md", "toml") for p in root.rglob(f"*.{end}")}
    counts = Counter(word for path in paths for word in re.findall(r"\w+", path.read_text(encoding="utf-8")))
    names = [(path.relative_to(SOURCE).as_posix(), name) for path in FILES for name in top_names(tree_of(path))]
    assert len(names) > 5000
    assert [(path, name) for path, name in names if counts[name] == 1] == []


MOST_ARGUMENTS = 12
MANY_ARGUMENTS = {
    "known_and_linked": "records would make each call of a controller a third slower",
    "__init__": "the fields of a Scenario, all but three given by name",
}
"""Functions with more, and why; functions of commands have an argument for each option of a user."""


def argument_counts(tree: ast.Module) -> dict[str, int]:
    """How many arguments functions have that may be given by position."""
    nodes = [node for node in nodes_of(tree) if isinstance(node, ast.FunctionDef)]
    return {node.name: len(node.args.posonlyargs) + len(node.args.args) for node in nodes}


def test_functions_have_few_arguments():
    found = {
        name
        for path in FILES
        if path.parent.name != "commands"
        for name, count in argument_counts(tree_of(path)).items()
        if count > MOST_ARGUMENTS
    }
    assert found == set(MANY_ARGUMENTS)
    assert argument_counts(ast.parse("def f(a, /, b, *, c):\n    def g(x): ...\n")) == {"f": 2, "g": 1}


def test_few_values_are_of_any_type():
    """`Any` switches the type checker off: it belongs to the edge of untyped libraries, and to their data."""
    found = [
        (path.relative_to(SOURCE).as_posix(), node.lineno)
        for path in FILES
        for node in nodes_of(tree_of(path))
        if isinstance(node, ast.Name) and node.id == "Any"
    ]
    assert len(found) <= MOST_ANY, found
