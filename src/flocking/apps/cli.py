"""The command line. Exit codes: 0 fine, 1 verdicts or runs not as expected, 2 bad input, 130 interrupted."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated

from cyclopts import App, CycloptsError, Parameter

from flocking.apps.commands.audit_command import audit
from flocking.apps.commands.cache_command import cache
from flocking.apps.commands.certify_command import certify
from flocking.apps.commands.export_c_command import export_c
from flocking.apps.commands.margin_command import margins
from flocking.apps.commands.nodes_command import nodes
from flocking.apps.commands.picture_commands import animate, plot
from flocking.apps.commands.run_commands import resume, run
from flocking.apps.commands.showcase_commands import showcase
from flocking.apps.commands.storage_commands import diff, export, info
from flocking.apps.commands.sweep_commands import sweep
from flocking.apps.early_signals import INTERRUPTED, SENTENCE
from flocking.apps.integer_arguments import check_integers
from flocking.apps.json_output import print_json
from flocking.apps.lab.command import lab
from flocking.apps.process import discard_output, open_streams, printable, quiet_warnings
from flocking.apps.signal_handlers import ended_by_signals
from flocking.engine import interruption
from flocking.engine.memory_shortage import LEAST_ADDRESS_SPACE, address_space, starved

FINE, DIFFERENT, BAD_INPUT = 0, 1, 2
"""Exit codes of every command: success, an outcome other than expected, and bad input, for which shells use 2 by
convention."""

_WORDS = {True: "holds", False: "fails", None: "open"}

Json = Annotated[bool, Parameter(name="--json")]


def command_line() -> App:
    """The application with all its commands."""
    app = App(
        name="flocking",
        help="Flocking control: run the laws of the papers, reproduce their results, audit runs.",
        help_format="plaintext",
        help_flags=["--help", "-h"],
        version=_version,
        default_parameter=Parameter(negative=()),
    )
    app.command(list_scenarios, name="list")
    for command in (
        run,
        resume,
        info,
        diff,
        export,
        export_c,
        plot,
        animate,
        reproduce,
        sweep,
        margins,
        nodes,
        showcase,
        audit,
        check,
        certify,
        equations,
        lab,
        schema,
        cache,
    ):
        app.command(command)
    return app


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Parameters
    ----------
    arguments
        Words of the command line; those of the process when absent.

    Returns
    -------
    int
        The exit code.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    open_streams()
    alone = arguments is None
    if alone:
        quiet_warnings()
    with ended_by_signals(for_good=alone) as handlers:
        try:
            handlers.begun = True
            code = _run(words)
            handlers.done = True
            return code
        except (KeyboardInterrupt, Exception) as error:
            interruption.answered()
            if not interruption.interrupted(error):
                raise
            with suppress(OSError):
                print(SENTENCE, file=sys.stderr)
            return INTERRUPTED
        finally:
            discard_output()


def _run(words: Sequence[str]) -> int:
    from flocking.errors import FlockingError

    def refused(message: str, fix: str = "") -> int:
        if not interruption.RAISED:
            return _print_error(message, fix)
        interruption.answered()
        # The error of a library that was interrupted is not about files or memory.
        _print_error(f"interrupted; the operation under way ended with: {message}")
        return INTERRUPTED

    app = command_line()
    try:
        if (address_space() or LEAST_ADDRESS_SPACE) < LEAST_ADDRESS_SPACE:
            raise MemoryError
        command, bound, _ = app.parse_args(words, print_error=False, exit_on_error=False)
        check_integers(command, words)
        result = command(*bound.args, **bound.kwargs)
        sys.stdout.flush()
        return result if isinstance(result, int) else FINE
    except CycloptsError as error:
        return _print_error(str(error) or type(error).__name__, "Try 'flocking --help'.")
    except FlockingError as error:
        if interruption.comes_of_interrupt(error):
            raise
        return BAD_INPUT if getattr(error, "reported_elsewhere", False) else refused(_said(error))
    except BrokenPipeError:
        # The reader of the output closed it.
        return FINE
    except Exception as error:
        if interruption.comes_of_interrupt(error):
            raise
        if starved(error):
            return refused(*_memory())
        if not isinstance(error, OSError):
            raise
        return refused(f"{error.filename}: {error.strerror}" if error.filename else str(error.strerror or error))


def _said(error: Exception) -> str:
    """The message of an error, in the words of files and flags."""
    from flocking.apps.hint_words import in_files

    return in_files(str(error))


def _memory() -> tuple[str, str]:
    """Message and fix where memory is short."""
    space = address_space()
    if space is None:
        return "this needs more memory than is available.", "Use fewer agents or frames."
    least = f"flocking itself takes {LEAST_ADDRESS_SPACE >> 20}"
    return (
        f"this needs more memory than this process may take: ulimit -v allows {space >> 20} MiB, and {least}.",
        "Raise it, or use fewer agents or frames.",
    )


def _version() -> str:
    from flocking import __version__

    return __version__


def _print_error(message: str, fix: str = "") -> int:
    text = message.strip() if message.rstrip().endswith((".", "?", "!")) or "\n" in message else f"{message.strip()}."
    with suppress(OSError):
        print(printable(f"flocking: {text} {fix}".rstrip()), file=sys.stderr)
    return BAD_INPUT


def list_scenarios(*, as_json: Json = False) -> int:
    """List the scenarios of the papers, and the large ones of the gallery.

    Parameters
    ----------
    as_json
        Print JSON.
    """
    from flocking.apps.scenario_names import paper_scenarios
    from flocking.apps.tables import print_table
    from flocking.papers import paper
    from flocking.papers.olfati_saber_2003.system import KEY as LARGE_KEY
    from flocking.papers.showcases.files import TITLES

    rows = [
        {"scenario": name, "paper": key, "title": paper(key).title_of(name)}
        for name, (key, _) in paper_scenarios().items()
    ]
    rows += [{"scenario": name, "paper": LARGE_KEY, "title": f"Large: {title}"} for name, title in TITLES.items()]
    if as_json:
        print_json(rows)
    else:
        print_table(("scenario", "paper", "title"), [tuple(row.values()) for row in rows])
    return FINE


def reproduce(
    *papers: str,
    every: Annotated[bool, Parameter(name="--all", negative="")] = False,
    seeds: int = 10,
    first_seed: int = 0,
    out: Path | None = None,
    workers: int | None = None,
    as_json: Json = False,
) -> int:
    """Reproduce papers: run their scenarios, judge their claims, draw their figures.

    Parameters
    ----------
    papers
        Keys of papers; when absent, those of the five that the library began with, and papers of other packages.
    every
        Reproduce the further standard laws of the literature too.
    seeds
        Number of seeds per scenario. A verdict needs five that meet the claim's hypothesis: with five or more, further
        ones are drawn until there are.
    first_seed
        The first seed; the others follow one by one.
    out
        Folder for report.html, claims.json, errata.json, figures and films; nothing is written when absent.
    workers
        Processes; the number of cores when absent.
    as_json
        Print JSON.
    """
    from flocking.apps.reproduction.reproduce import reproduce as reproduce_papers
    from flocking.apps.reproduction.results import rate_of
    from flocking.apps.tables import print_table, short
    from flocking.errors import InvalidInput
    from flocking.papers import default_keys, keys

    if papers and every:
        raise InvalidInput("reproduce", "--all", "must stand alone", " ".join(papers), "Leave out the keys.")
    found = reproduce_papers(
        tuple(dict.fromkeys(papers)) or (keys() if every else default_keys()),
        seeds=seeds,
        first_seed=first_seed,
        out=out,
        workers=workers,
        progress=not as_json and sys.stderr.isatty(),
    )
    if as_json:
        print_json(
            {
                "as_expected": found.as_expected,
                "seconds": found.seconds,
                "claims": found.as_list(),
                "errata": found.errata,
                "figures": [str(path) for path in found.figures],
            }
        )
    else:
        for name, judgements in found.judgements.items():
            rows = [
                (
                    "" if j.as_expected else "!",
                    j.claim.key,
                    str(j.verdict),
                    "" if j.as_expected else j.claim.expectation,
                    f"{j.held}/{j.met}/{j.tried}",
                    rate_of(j),
                    short(j.worst.margin),
                )
                for j in judgements
            ]
            print_table(
                ("", "claim", "verdict", "expected", "held/met/seeds", "rate, 95 %", "worst margin"), rows, title=name
            )
            print()
        where = f", {len(found.figures)} figure files in {out}" if out else ""
        print(
            f"{found.expected - found.unexpected} of {found.expected} claims with an expected verdict have it, in "
            f"{found.seconds:.0f} s{where}."
        )
        if found.observed:
            print(f"{found.observed} further claims are observations: they have rates and no expected verdict.")
        if found.untested:
            print(f"{found.untested} are untested: fewer than five seeds met their hypothesis. Use at least five.")
        if found.waiting:
            print(
                f"{found.waiting} are not yet decided: for some seed the motion has not settled by the end of the run."
            )
        if out is not None:
            print(f"Open {out / 'report.html'}")
    return FINE if found.as_expected else DIFFERENT


def check(
    formula: str,
    *,
    parameter: Annotated[list[str] | None, Parameter(name=["--parameter", "-p"])] = None,
    radius: float | None = None,
    definition: str | None = None,
    as_json: Json = False,
) -> int:
    """Find the properties of a potential psi(r), and the papers' definitions that it meets.

    Parameters
    ----------
    formula
        The formula, for example "1/r + 1/(R - r)".
    parameter
        A value for a name of the formula, as name=value; once for each.
    radius
        Sensing radius.
    definition
        Key of the one paper whose definition must hold; the exit code is 1 where it does not.
    as_json
        Print JSON.
    """
    from flocking.apps.tables import print_table
    from flocking.model.potentials.potential import Potential
    from flocking.papers.potential_definitions import check_potential

    potential = Potential(formula, **_named_values(parameter or []))
    report = check_potential(potential, radius=radius, definition=definition)
    if as_json:
        print_json(report.as_dict())
    else:
        print(report.potential)
        titles = [f"{d.source}: {_WORDS[d.holds]}" for d in report.definitions]
        for title, rows in zip(["", *titles], [report.rows, *(d.rows for d in report.definitions)], strict=True):
            print()
            cells = [(row.name, _WORDS[row.holds], row.explanation) for row in rows]
            print_table(("property", "verdict", "measured"), cells, title=title)
    outcomes = [d.holds for d in report.definitions if definition is not None]
    return DIFFERENT if False in outcomes else FINE


def _named_values(texts: Sequence[str]) -> dict[str, float]:
    from flocking.errors import InvalidInput

    found: dict[str, float] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        try:
            number = float(value)
        except ValueError:
            number = float("nan")
        if not equals or not name.isidentifier() or name == "formula" or number != number:
            raise InvalidInput("check", "-p", "must be name=number, such as -p R=4", text)
        if name in found:
            raise InvalidInput("check", "-p", f"must give {name} once", text)
        found[name] = number
    return found


def equations(*papers: str, as_json: Json = False) -> int:
    """Show how every numbered statement of the papers is read, and which are wrong as printed.

    Parameters
    ----------
    papers
        Keys of papers; all when absent.
    as_json
        Print JSON.
    """
    from flocking.apps.tables import print_table
    from flocking.papers.tables import equation_table

    rows = [row.as_dict() for row in equation_table(_keys(papers))]
    if as_json:
        print_json(rows)
        return FINE
    for key in dict.fromkeys(row["paper"] for row in rows):
        found = [row for row in rows if row["paper"] == key]
        cells = [
            (r["number"], r["verdict"], ": ".join(x for x in (r["title"], r["reason"], r["note"]) if x)) for r in found
        ]
        print_table(("number", "verdict", "statement and reading"), cells, title=key)
        print()
    return FINE


def schema(*, sweep: bool = False) -> int:
    """Print the JSON schema of scenario files, for editors.

    Parameters
    ----------
    sweep
        Print the schema of sweep files instead.
    """
    from flocking.papers.sweep_scenarios import sweep_scenarios
    from flocking.study.scenario_files.scenario_file import scenario_schema
    from flocking.study.sweeps.editor_schema import sweep_schema

    print_json(sweep_schema(sweep_scenarios()) if sweep else scenario_schema())
    return FINE


def _keys(papers: Sequence[str]) -> Sequence[str]:
    from flocking.papers import keys

    return tuple(dict.fromkeys(papers)) or keys()


if __name__ == "__main__":
    sys.exit(main())
