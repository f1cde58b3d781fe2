"""Limits of pythonfmu's binary: arguments that it does not check; listed on the FMU's page, checked by our importer.

The binary is packed unchanged; ``slave.py`` sees only the calls that it passes on.
"""

from __future__ import annotations

from importlib import metadata
from pathlib import Path
from urllib.parse import quote

from ..base.errors import FmuError

__all__ = ["check_unpacked", "checked_version", "pythonfmu_license"]

SERIES = "0.7."
"""Series whose reference counting ``slave.py`` balances and whose limits are listed in ``templates``."""


def checked_version() -> str:
    """Return the version of the pythonfmu that is installed.

    Raises
    ------
    FmuError
        If ``slave.py`` was not made for it.
    """
    version = metadata.version("pythonfmu")
    if not version.startswith(SERIES):
        raise FmuError(
            f"pythonfmu must be {SERIES}x, whose reference counting hybridsep/fmi/slave.py balances, got {version}; "
            f"pip install 'pythonfmu~={SERIES}0'"
        )
    return version


def pythonfmu_license() -> bytes:
    """Return the licence of the pythonfmu that is installed, which goes with copies of it.

    Raises
    ------
    FmuError
        If the installation has none.
    """
    found = [file for file in metadata.files("pythonfmu") or () if file.name == "LICENSE"]
    if not found:
        raise FmuError("pythonfmu's LICENSE, which an FMU with a copy of it must carry, is not installed: reinstall it")
    return found[0].read_binary()


def check_unpacked(folder: Path, generation_tool: str) -> None:
    """Refuse an unpacked pythonfmu FMU whose resources would end the process.

    Parameters
    ----------
    folder : Path
        Of the unpacked archive.
    generation_tool : str
        As the modelDescription names it; other tools' FMUs pass.

    Raises
    ------
    FmuError
        If a file that the binary reads unchecked is missing, or it cannot read the folder's name.
    """
    if "pythonfmu" not in generation_tool.lower():
        return
    resources = folder / "resources"
    named = resources / "slavemodule.txt"
    slave = resources / f"{named.read_text(encoding='utf-8').strip()}.py" if named.is_file() else named
    if not slave.is_file():
        raise FmuError(f"resources/{slave.name} is missing, without which pythonfmu's binary ends the process")
    if quote(path := resources.as_posix(), safe="/: ~") != path:
        raise FmuError(
            f"pythonfmu's binary reads no folder with other characters than letters, digits and _.-~ in its name, "
            f"got {path}; set TMPDIR to another one"
        )
