"""The command line. Exit codes: 0 fine, 1 verdicts or runs not as expected, 2 bad input, 130 interrupted."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import suppress

from cyclopts import App, CycloptsError, Parameter

from flocking.apps.commands.audit_command import audit
from flocking.apps.commands.cache_command import cache
from flocking.apps.commands.certify_command import certify
from flocking.apps.commands.check_command import check
from flocking.apps.commands.export_c_command import export_c
from flocking.apps.commands.margin_command import margins
from flocking.apps.commands.nodes_command import nodes
from flocking.apps.commands.paper_commands import equations, list_scenarios, reproduce, schema
from flocking.apps.commands.picture_commands import animate, plot
from flocking.apps.commands.run_commands import resume, run
from flocking.apps.commands.showcase_commands import showcase
from flocking.apps.commands.storage_commands import diff, export, info
from flocking.apps.commands.sweep_commands import sweep
from flocking.apps.early_signals import INTERRUPTED, SENTENCE
from flocking.apps.integer_arguments import check_integers
from flocking.apps.lab.lab_command import lab
from flocking.apps.signal_handlers import ended_by_signals
from flocking.apps.standard_streams import discard_output, open_streams, printable, quiet_warnings
from flocking.engine import interruption
from flocking.engine.memory_shortage import LEAST_ADDRESS_SPACE, address_space, starved

FINE, DIFFERENT, BAD_INPUT = 0, 1, 2
"""Exit codes of every command: success, an outcome other than expected, and bad input, for which shells use 2 by
convention."""


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
    command: Callable[..., object] | None = None
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
        return BAD_INPUT if getattr(error, "reported_elsewhere", False) else refused(_said(error, command))
    except Exception as error:
        if interruption.comes_of_interrupt(error):
            raise
        if starved(error):
            return refused(*_memory())
        if not isinstance(error, OSError):
            raise
        return refused(f"{error.filename}: {error.strerror}" if error.filename else str(error.strerror or error))


def _said(error: Exception, command: Callable[..., object] | None) -> str:
    """The message of an error, in the words of files and flags."""
    from flocking.apps.hint_words import in_files

    return in_files(str(error), getattr(command, "__name__", ""))


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


if __name__ == "__main__":
    sys.exit(main())
