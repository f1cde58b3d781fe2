"""Entry point of the command line, outside the package: handles Ctrl-C before the library is loaded."""

from __future__ import annotations

import os
import signal
import sys

INTERRUPTED = 130
"""Exit status after Ctrl-C."""


def _leave(*_: object) -> None:
    """End the process at once: nothing is open while the library is loaded."""
    os.write(2, b"interrupted\n")
    os._exit(INTERRUPTED)


def main() -> None:
    """Load the library and run the command line."""
    ours = (
        signal.getsignal(signal.SIGINT) is signal.default_int_handler
    )  # otherwise the calling program handles Ctrl-C itself
    if ours:
        signal.signal(signal.SIGINT, _leave)
    from hybridsep.app.cli import main as run

    try:
        if ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        run(_leave if ours else None)
    except KeyboardInterrupt:
        _leave()
    except SystemExit as stop:
        # All is said and cleaned up, and taking the library down would take Python long; joblib has locks to remove.
        if stop.code == INTERRUPTED and "joblib" not in sys.modules:
            sys.stderr.flush()
            os._exit(INTERRUPTED)
        raise
    finally:
        if ours:
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is done; ending takes Python a moment


if __name__ == "__main__":
    main()
