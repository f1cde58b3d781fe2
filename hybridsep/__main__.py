"""Entry point of the command line: ``hybridsep`` and ``python -m hybridsep``."""

from __future__ import annotations

import sys


def main() -> None:
    """Load the command line and run it; Ctrl-C meanwhile is exit status 130 and no traceback."""
    try:
        from .app.cli import main as run
    except KeyboardInterrupt:
        sys.exit(130)
    run()


if __name__ == "__main__":
    main()
