"""One page for every module of the library, and a table of the names that ``import flocking`` gives."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import shutil
from pathlib import Path
from typing import Any

import flocking

FLOORS = {
    "apps": "what people start",
    "papers": "numbers, claims, figures and equation tables of the papers",
    "show": "pictures of runs",
    "study": "what a run means",
    "engine": "how a scenario is computed",
    "model": "what is simulated",
    "formula": "text formulas and the functions made from them",
}


def modules() -> list[str]:
    """Dotted names of all modules."""
    found = [m.name for m in pkgutil.walk_packages(flocking.__path__, "flocking.") if not m.name.endswith("__main__")]
    return sorted(found)


def title(text: str, line: str = "=") -> str:
    """A heading in reStructuredText."""
    return f"{text}\n{line * len(text)}\n\n"


def first_sentence(obj: Any) -> str:
    """The first line of a docstring, as markup."""
    from plain_docstrings import escaped

    return escaped((inspect.getdoc(obj) or "").split("\n")[0])


def public_names() -> str:
    """A table of everything in ``flocking.__all__``."""
    rows = []
    for name in flocking.__all__:
        value = getattr(flocking, name)
        if inspect.ismodule(value):
            rows.append((f":py:mod:`{name} <{value.__name__}>`", first_sentence(value)))
            continue
        home = getattr(value, "__module__", "")
        label = getattr(value, "__qualname__", name)
        target = f"{home}.{label}" if hasattr(value, "__qualname__") else f"flocking.engine.driver.starting.{name}"
        rows.append((f":py:obj:`{name} <{target}>`", first_sentence(value)))
    lines = [".. list-table::", "   :widths: 25 75", ""]
    for name, text in rows:
        lines += [f"   * - {name}", f"     - {text}"]
    return "\n".join(lines) + "\n\n"


def paper_names() -> str:
    """A table of what the package of each paper gives."""
    from flocking.papers import ALL_KEYS, paper

    text = ""
    for key in ALL_KEYS:
        module = importlib.import_module(paper(key).package)
        given = [(n, getattr(module, n)) for n in module.__all__ if callable(getattr(module, n))]
        text += title(f"fk.papers.{module.__name__.rpartition('.')[2]}", "~")
        text += "\n".join([".. list-table::", "   :widths: 25 75", ""]) + "\n"
        for name, value in given:
            target = f"{value.__module__}.{value.__qualname__}"
            text += f"   * - :py:obj:`{name} <{target}>`\n     - {first_sentence(value)}\n"
        text += "\n"
    return text


def write_pages(app: Any) -> None:
    """Write all pages anew."""
    folder = Path(app.srcdir) / "api"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    names = modules()
    for name in names:
        body = f".. automodule:: {name}\n   :members:\n   :ignore-module-all:\n   :show-inheritance:\n"
        (folder / f"{name}.rst").write_text(title(name) + body)
    text = title("The library by name") + "Everything ``import flocking as fk`` gives:\n\n" + public_names()
    text += title("The papers by name", "-") + "What the package of each paper gives:\n\n" + paper_names()
    text += title("The library by floor", "-") + "Imports go down only.\n\n"
    for floor, purpose in FLOORS.items():
        mine = [n for n in names if n.split(".")[1] == floor]
        text += f".. toctree::\n   :caption: {floor}: {purpose}\n   :maxdepth: 1\n\n"
        text += "".join(f"   {n}\n" for n in mine) + "\n"
    single = [n for n in names if n.count(".") == 1 and n.split(".")[1] not in FLOORS]
    text += ".. toctree::\n   :caption: on no floor\n   :maxdepth: 1\n\n" + "".join(f"   {n}\n" for n in single)
    (folder / "index.rst").write_text(text)


def setup(app: Any) -> dict[str, Any]:
    """Write the pages before they are looked for."""
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
