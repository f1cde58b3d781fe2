"""Programs that tests run in processes of their own."""

import subprocess
from typing import Any


def output_of(*command: object, **how: Any) -> str:
    """Run a program that must succeed, ``how`` as for ``subprocess.run``; return what it prints."""
    done = subprocess.run(list(map(str, command)), capture_output=True, encoding="utf-8", check=False, **how)
    assert done.returncode == 0, done.stdout + done.stderr
    return str(done.stdout)
