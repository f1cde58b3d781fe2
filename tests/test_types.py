"""Types of the whole repository, as pyproject.toml has mypy check them: strictly."""

import subprocess
import sys

import pytest
from places import ROOT


@pytest.mark.slow
def test_mypy_finds_nothing() -> None:
    """Beside the other tests, as mypy keeps one core busy for most of a minute."""
    done = subprocess.run([sys.executable, "-m", "mypy"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
