"""``flocking`` and ``python -m flocking``: the command line, which a signal ends quietly while it is still imported."""

from __future__ import annotations

import atexit
import signal
import sys
import threading

from flocking.apps.early_signals import end_now, ignore_from_now_on


def main() -> int:
    """Run the command that the process was started with.

    Returns
    -------
    int
        The exit code.
    """
    if threading.current_thread() is threading.main_thread():
        # What is registered first is called last.
        atexit.register(ignore_from_now_on)
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, end_now)
        # A shell starts jobs in the background with SIGINT ignored; SIGTERM is meant.
        if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
            signal.signal(signal.SIGTERM, end_now)
    from flocking.apps import cli

    return cli.main()


if __name__ == "__main__":
    sys.exit(main())
