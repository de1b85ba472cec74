"""Scenarios as TOML files: all faults are reported at once, and a run repeats bit for bit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from flocking.engine.storage.atomic_files import write_through
from flocking.errors import InvalidInput
from flocking.model.law import Law, Scenario
from flocking.model.parts.seeds import SeedNumber, given_seed
from flocking.model.state import State
from flocking.study.scenario_files.problems import one_line, problem_of
from flocking.study.scenario_files.scenario_misfits import misfits
from flocking.study.scenario_files.text_files import read_text_file

MOST_AGENTS = 1_000_000
"""Agents of a scenario in a file unless the caller allows more: a bound on memory for a file of unknown origin."""
LARGEST_FILE = 32 * 2**20
"""Bytes of the largest file that is read or written: positions and velocities of 200,000 agents in a plane take about
28 million as text."""
DEEPEST_NESTING = 20
"""Nested brackets of a file: far below the recursion limit of the parser."""

MOST_DIGITS = 100
"""Digits of an integer in another base than ten: one of 64 bits has 64 at most, and TOML asks for no more."""

MOST_SHOWN = 200
"""Faults that a message lists; the error holds them all."""


class ScenarioFileError(InvalidInput):
    """A scenario file with faults.

    Parameters
    ----------
    source
        Name of the file.
    problems
        Every fault, as one line of text each.
    """

    content = "scenario"

    def __init__(self, source: str, problems: list[str]) -> None:
        head = f"{source}: {len(problems)} fault{'s' * (len(problems) > 1)} in the {self.content}"
        super().__init__(self.content, source, f"must be a {self.content} file", problems)
        self.problems = tuple(problems)
        more = [f"  ... and {len(problems) - MOST_SHOWN} more"] if len(problems) > MOST_SHOWN else []
        self.args = ("\n".join([head, *(f"  {one_line(line)}" for line in problems[:MOST_SHOWN]), *more]),)

    def __str__(self) -> str:
        return str(self.args[0])


def read_scenario(
    path: str | Path,
    *,
    seed: int | None = None,
    most_agents: int = MOST_AGENTS,
    largest_file: int = LARGEST_FILE,
    start: State | None = None,
    rng: SeedNumber | None = None,
) -> Scenario:
    """Read a scenario from a TOML file.

    Parameters
    ----------
    path
        The file.
    seed
        Takes the place of the seed of every draw in the file, of the start and of a random graph.
    most_agents
        Largest number of agents the file may ask for.
    largest_file
        Largest size of the file in bytes.
    start
        The start of a file that has none, for laws that are held against samples; its ``t_end`` may then be missing
        too.
    rng
        The same as ``seed`` by the name of SPEC 7: an integer, or a `numpy.random.SeedSequence`.

    Raises
    ------
    ScenarioFileError
        When the file has faults; the message lists every one with its place.
    InvalidInput
        When the file cannot be read, or ``rng`` is given beside ``seed`` or is a generator.
    """
    seed = given_seed("read_scenario", seed, rng)
    fix = "Describe large starts by a draw, or pass largest_file."
    try:
        text = read_text_file("read_scenario", path, largest_file, fix)
    except UnicodeDecodeError as error:
        raise ScenarioFileError(str(path), [f"file: must be UTF-8 text; byte {error.start} is not"]) from None
    return parse_scenario(text, source=str(path), seed=seed, most_agents=most_agents, start=start)


def parse_scenario(
    text: str,
    *,
    source: str = "scenario",
    seed: int | None = None,
    most_agents: int = MOST_AGENTS,
    start: State | None = None,
) -> Scenario:
    """Read a scenario from TOML text.

    Parameters
    ----------
    text
        The text.
    source
        Its name in error messages.
    seed
        Takes the place of the seed of every draw, of the start and of a random graph.
    most_agents
        Largest number of agents the text may ask for.
    start
        The start of a text that has none, as `read_scenario` takes it.

    Raises
    ------
    ScenarioFileError
        When the text has faults; the message lists every one with its place.
    """
    from flocking.study.scenario_files.scenario_reader import Reader

    data = _toml(text, source)
    if seed is not None:
        _reseed(data, seed, source)
    if start is not None and "start" not in data:
        data["start"] = {"t": start.t, "q": start.q.tolist(), "p": start.p.tolist()}
        data.setdefault("t_end", start.t + 1.0)
    reader = Reader(most_agents)
    parts = reader.read(data)
    lines = list(dict.fromkeys(map(str, [*reader.problems, *misfits(parts, data)])))
    if lines:
        raise ScenarioFileError(source, lines)
    try:
        return _scenario(parts)
    except InvalidInput as error:
        place, rule = "terms", error
        owners = [name for name in ("control", "information", "space") if type(parts.get(name)).__name__ == error.owner]
        if error.owner == Scenario.__name__ or owners:
            place = ".".join([*owners, error.parameter])
        else:
            said = f"{error.owner}: {error.parameter} {error.rule}"
            rule = InvalidInput(error.owner, place, said, error.value, error.fix)
        raise ScenarioFileError(source, [str(problem_of(rule, place))]) from None
    except (ArithmeticError, MemoryError) as error:
        raise ScenarioFileError(source, [f"file: cannot be used ({type(error).__name__}: {error})"]) from None


def _scenario(parts: Mapping[str, object]) -> Scenario:
    """The scenario of fields without fault."""
    from flocking.model.parts.description import registered_names

    kinds = registered_names()
    law = kinds[Law.__name__].make({name: parts[name] for name in kinds[Law.__name__].fields})
    kind = kinds[Scenario.__name__]
    found = kind.make({"law": law, **{name: value for name, value in parts.items() if name in kind.fields}})
    assert isinstance(found, Scenario)
    return found


def _reseed(data: dict[str, object], seed: int, source: str) -> None:
    from flocking.study.scenario_files.scenario_reader import drawn_tables

    drawn = list(drawn_tables(data))
    if not drawn:
        raise InvalidInput(
            source, "seed", "needs a scenario with a random draw", seed, "This file gives its start number by number."
        )
    for table in [data, *drawn]:
        table["seed"] = seed


def _toml(text: str, source: str) -> dict[str, object]:
    import tomllib

    bare = _TEXTS.sub("s", text)
    if _nests_deeply(bare):
        raise ScenarioFileError(source, [f"file: must not nest deeper than {DEEPEST_NESTING} brackets or dots"])
    if _LONG_NUMBER.search(bare):
        # Python reads them, and prints none of more than 4,300 decimal digits.
        raise ScenarioFileError(source, [f"file: must not hold an integer of more than {MOST_DIGITS} digits"])
    try:
        return tomllib.loads(text, parse_float=_decimal)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioFileError(source, [f"file: is not TOML: {error}"]) from None
    except (ValueError, RecursionError, OverflowError) as error:
        raise ScenarioFileError(source, [f"file: is not TOML that can be read ({error})"]) from None


def _decimal(text: str) -> float:
    """The number that a text states, unless it is so small that floating point has 0 for it."""
    number = float(text)
    if number == 0.0 and re.search("[1-9]", text.lower().partition("e")[0]):
        raise ValueError(f"{text} is too small for a floating-point number: write 0 instead")
    return number


_TEXTS = re.compile(
    r'"""(?:[^\\]|\\.)*?""""{0,2}|' + r"'''.*?''''{0,2}|" + r'"(?:[^"\\\n]|\\.)*"|' + r"'[^'\n]*'|#[^\n]*", re.DOTALL
)
_LONG_KEY = re.compile(rf"(?:^|[\n=,{{}}\[\]])(?:[^\n=,{{}}\[\].]*\.){{{DEEPEST_NESTING + 1}}}")


_LONG_NUMBER = re.compile(rf"\b0[xob][0-9a-fA-F_]{{{MOST_DIGITS + 1}}}")


def _nests_deeply(bare: str) -> bool:
    """Whether brackets, or the dots of a key, nest deeper than `DEEPEST_NESTING`, texts and comments left out."""
    depth = 0
    for found in re.finditer(r"[\[\]{}]", bare):
        depth = max(0, depth + (1 if found[0] in "[{" else -1))
        if depth > DEEPEST_NESTING:
            return True
    # The parser takes the square of the number of dots.
    return _LONG_KEY.search(bare) is not None


def scenario_to_text(scenario: Scenario) -> str:
    """A scenario as TOML text. Floats are written so that reading them back gives the same bits.

    Parameters
    ----------
    scenario
        The scenario.

    Raises
    ------
    InvalidInput
        When it has a part without a name in files, or is too large for a file.
    """
    import tomli_w

    from flocking.model.parts.description import Nested, registered_names
    from flocking.model.parts.values import NAME, RefusedError
    from flocking.study.scenario_files.scenario_reader import inline_kind
    from flocking.study.scenario_files.scenario_writer import PartWriter

    if not isinstance(scenario, Scenario):
        raise InvalidInput("write_scenario", "scenario", "must be a Scenario", scenario)
    try:
        NAME.check(scenario.name)
    except RefusedError as refused:
        raise InvalidInput("write_scenario", "name", refused.rule, scenario.name) from None
    writer = PartWriter()
    kind = registered_names()[Scenario.__name__]
    writer.count_all(kind, scenario)
    tables = writer.fields(kind, scenario)
    parts = {name for name, f in kind.fields.items() if isinstance(f.holds, Nested) and inline_kind(f) is None}
    parts |= set(registered_names()[Law.__name__].fields)
    head = {name: value for name, value in tables.items() if name not in parts}
    sections = {name: section for name, section in writer.sections.items() if section}
    body = {name: value for name, value in tables.items() if name in parts}
    text = tomli_w.dumps({"format": 1, **head, **body, **sections})
    if len(text) > LARGEST_FILE:
        raise InvalidInput(
            "write_scenario", "start", f"must fit in {LARGEST_FILE} bytes of text", f"{len(text)} bytes",
            "Store a run of it, which has the scenario, or write a file with a draw as its start.",
        )  # fmt: skip
    return text


def write_scenario(scenario: Scenario, path: str | Path) -> Path:
    """Write a scenario to a TOML file.

    Parameters
    ----------
    scenario
        The scenario.
    path
        The file; replaced when it exists.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InvalidInput
        When the scenario cannot be written as text, or the file cannot be written.
    """
    if not isinstance(path, str | Path):
        raise InvalidInput("write_scenario", "path", "must be a path", path)
    file = Path(path)
    text = scenario_to_text(scenario)
    try:
        write_through(file, text.encode(), parents=False)
    except (OSError, ValueError, TypeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InvalidInput("write_scenario", "path", f"cannot be written ({reason})", str(path)) from None
    return file


def scenario_schema() -> dict[str, object]:
    """JSON schema of scenario files, for editors that complete and check TOML."""
    from flocking.study.scenario_files.scenario_schema import json_schema

    return json_schema()
