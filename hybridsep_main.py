"""Entry point of the command line, outside the package: Ctrl-C while the library is loaded is no traceback."""

from __future__ import annotations

import os
import signal


def _end(*_: object) -> None:
    os.write(2, b"interrupted\n")
    os._exit(130)


def main() -> None:
    """Load the library and run the command line; exit status 130 after Ctrl-C."""
    ours = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    try:
        if ours:  # an exception could be lost in the import system
            signal.signal(signal.SIGINT, _end)
        from hybridsep.app.cli import main as run

        if ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        run()
    except KeyboardInterrupt:
        _end()
    finally:
        if ours:  # otherwise the calling program handles Ctrl-C itself
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is done; ending takes Python a moment


if __name__ == "__main__":
    main()
