"""``flocking`` and ``python -m flocking``: the command line, which a signal ends quietly while it is still imported."""

from __future__ import annotations

import signal
import sys
import threading

from flocking.apps.early_signals import end_now


def main() -> int:
    """Run the command that the process was started with.

    Returns
    -------
    int
        The exit code.
    """
    first = threading.current_thread() is threading.main_thread()
    if first and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, end_now)
        if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
            signal.signal(signal.SIGTERM, end_now)
    from flocking.apps import cli

    return cli.main()


if __name__ == "__main__":
    sys.exit(main())
