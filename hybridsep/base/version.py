"""Version of the library, and the commit that it was made from."""

from pathlib import Path

__version__ = "0.1.0"

VERSION_DATE = "2026-11-24"
"""Day of the version, or while it is unreleased of its last renewal; FMUs name it as the day of their generation."""

COMMIT_FILE = "hybridsep/_data/commit.txt"  # where wheel and sdist keep their commit, written by ``hatch_build.py``

_ROOT = Path(__file__).resolve().parents[2]


def version_text() -> str:
    """Return the version with the commit, as ``0.1.0 (1a2b3c4d5e6f)``; without one only the version."""
    return f"{__version__} ({made_from})" if (made_from := commit()) else __version__


def commit(root: Path = _ROOT) -> str:
    """Return the commit of a wheel, an sdist or a checkout, with ``-dirty`` where files differ; "" without one."""
    file = root / COMMIT_FILE
    if file.is_file():
        return file.read_text(encoding="utf-8").strip()
    if not (root / ".git").exists():  # a folder inside the checkout of something else has no commit of its own
        return ""
    import subprocess  # not needed where the library is only used

    command = ["git", "-C", str(root), "describe", "--always", "--dirty", "--exclude=*", "--abbrev=12"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):  # no git, or it does not trust the folder's owner
        return ""
