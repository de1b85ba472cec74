"""Reading of the equation tables, one ``equations.toml`` in the folder of each paper.

A table is a list of ``[[statement]]``. Where the text of the paper was not at hand, ``text_at_hand = false`` before
them marks them as commonly cited. Each has these keys:

``number``, ``kind``, ``title``, ``home``, ``also``
    As in `flocking.papers.equation_table.Row`.
``example``
    The function for `Row.build`, as ``"module.function"`` of the paper's package. With ``example_arguments`` it is
    first called with them and returns the builder.
``reading``, ``note``, ``fault``
    As in `Row`; a fault is a value of `flocking.papers.equation_table.Fault`.
``same_reading_as``, ``same_note_as``
    Number of an earlier statement with the same reading or note.
``counterexample``
    The function for `Row.demonstration`, with ``counterexample_arguments`` as above.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from importlib import import_module
from importlib.resources import files
from typing import Any, Literal, NotRequired, TypedDict, cast

from flocking.papers.equation_table import Fault, Row

FILE = "equations.toml"
TEXTS = ("number", "kind", "title", "home", "example", "reading", "note", "fault", "same_reading_as", "same_note_as",
         "counterexample")  # fmt: skip
REQUIRED = ("number", "kind", "title", "home", "example")
ARGUMENTS = ("example_arguments", "counterexample_arguments")
KEYS = {*TEXTS, *ARGUMENTS, "also"}


class Statement(TypedDict):
    """One statement of the file, validated by `checked`."""

    number: str
    kind: str
    title: str
    home: str
    example: str
    example_arguments: NotRequired[dict[str, object]]
    counterexample: NotRequired[str]
    counterexample_arguments: NotRequired[dict[str, object]]
    reading: NotRequired[str]
    note: NotRequired[str]
    fault: NotRequired[str]
    same_reading_as: NotRequired[str]
    same_note_as: NotRequired[str]
    also: NotRequired[list[str]]


def has_table(package: str) -> bool:
    """Whether the package of a paper is a folder with an equation table; a single module has none."""
    return hasattr(import_module(package), "__path__") and files(package).joinpath(FILE).is_file()


def read_statements(package: str, key: str) -> tuple[Row, ...]:
    """Rows of the equation table in the folder of a paper.

    Parameters
    ----------
    package
        Dotted name of the paper's package.
    key
        Key of the paper.

    Raises
    ------
    ValueError
        If a statement has an unknown key or lacks one, refers to a function or a statement that does not exist, or
        its fault, reading and counter-example are inconsistent.
    """
    table = tomllib.loads(files(package).joinpath(FILE).read_text(encoding="utf-8"))
    seen = table.get("text_at_hand", True)
    if not isinstance(seen, bool):
        raise ValueError(f"{key}/{FILE}: text_at_hand must be true or false")
    return rows_of(table["statement"], package, key, Fault.NONE if seen else Fault.CITED)


def rows_of(
    statements: list[dict[str, object]], package: str, key: str, faultless: Fault = Fault.NONE
) -> tuple[Row, ...]:
    """Rows of the statements of one file.

    Parameters
    ----------
    statements
        The statements, in the order of the file.
    package
        Dotted name of the paper's package.
    key
        Key of the paper.
    faultless
        The verdict of statements without a fault: as printed, or as commonly cited.

    Raises
    ------
    ValueError
        As `read_statements`.
    """
    known: dict[str, Statement] = {}
    rows = []
    for read in statements:
        statement = checked(read, key)
        known[statement["number"]] = statement
        rows.append(_row(statement, known, package, key, faultless))
    return tuple(rows)


def checked(statement: Mapping[str, object], key: str) -> Statement:
    """Check the keys of a statement and the types of their values.

    Parameters
    ----------
    statement
        The statement.
    key
        Key of the paper.

    Raises
    ------
    ValueError
        If a key is unknown, missing, or has a value of another type.
    """
    where = f"{key}/{FILE}, statement {statement.get('number', 'without a number')}"
    unknown = ", ".join(sorted(set(statement) - KEYS))
    if unknown:
        raise ValueError(f"{where}: unknown key {unknown}; the keys are {', '.join(sorted(KEYS))}")
    missing = ", ".join(name for name in REQUIRED if name not in statement)
    if missing:
        raise ValueError(f"{where}: lacks {missing}")
    wrong = [name for name in TEXTS if not isinstance(statement.get(name, ""), str)]
    wrong += [name for name in ARGUMENTS if not isinstance(statement.get(name, {}), dict)]
    if not isinstance(also := statement.get("also", []), list) or any(not isinstance(number, str) for number in also):
        wrong.append("also")
    if wrong:
        raise ValueError(f"{where}: {', '.join(wrong)} must be text, arguments a table, also a list of texts")
    # Every key has been checked.
    return cast(Statement, statement)


def _row(statement: Statement, known: Mapping[str, Statement], package: str, key: str, faultless: Fault) -> Row:
    return Row(
        key, statement["number"], statement["kind"], statement["title"], statement["home"],
        _function(statement, "example", package, key),
        reading=_words(statement, "reading", known, key),
        demonstration=_function(statement, "counterexample", package, key) if "counterexample" in statement else None,
        fault=Fault(statement["fault"]) if "fault" in statement else faultless,
        note=_words(statement, "note", known, key),
        also=tuple(statement.get("also", ())),
    )  # fmt: skip


def _function(
    statement: Statement, role: Literal["example", "counterexample"], package: str, key: str
) -> Callable[..., Any]:
    module, _, name = statement[role].partition(".")
    found = getattr(import_module(f"{package}.{module}"), name, None)
    if not callable(found):
        raise ValueError(f"{key}/{FILE}, statement {statement['number']}: no function {statement[role]} for {role}")
    arguments = statement.get("example_arguments") if role == "example" else statement.get("counterexample_arguments")
    made: Callable[[float], object] = found if arguments is None else found(**arguments)
    return made


def _words(statement: Statement, name: Literal["reading", "note"], known: Mapping[str, Statement], key: str) -> str:
    other = statement.get("same_reading_as") if name == "reading" else statement.get("same_note_as")
    if other is None:
        return statement.get(name, "")
    if name in statement or name not in known.get(other, ()):
        raise ValueError(
            f"{key}/{FILE}, statement {statement['number']}: same_{name}_as is {other}, which must be an earlier "
            f"statement with a {name}, and the statement must not have one"
        )
    return known[other][name]
