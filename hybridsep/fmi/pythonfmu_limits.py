"""What pythonfmu's binary does not check before it calls Python: told on the FMU's page, checked where we import.

The binary is pythonfmu's and travels as it is; ``slave.py`` sees only what it passes on.
"""

from __future__ import annotations

from importlib import metadata
from pathlib import Path
from urllib.parse import quote

from ..base.errors import FmuError

__all__ = ["check_unpacked", "checked_version", "limits_section"]

SERIES = "0.7."
"""Whose reference counting ``slave.py`` balances, and of which the limits below were measured."""

_KILLS = (
    "an instance name that is NULL or not UTF-8",
    "a resource location that is NULL, no <code>file:///</code> path, has other percent codes than <code>%20</code>, or"
    " where <code>slavemodule.txt</code> or the slave that it names is missing",
    "a message while logging is on and the callbacks or the logger are NULL",
    "a NULL component, a NULL array of more than 0 values, a NULL place for a state, NULL log categories",
    "at times, an exit while the library is loaded: it releases memory twice, which corrupts the heap (Linux)",
)
_IGNORED = (
    "the GUID and the type, co-simulation or model exchange, that <code>fmi2Instantiate</code> gets",
    "whether a state has been freed already; its pointer is not set to NULL",
)


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


def limits_section(version: str) -> str:
    """Return the limits as a section of the FMU's page."""
    kills, ignored = ("\n".join(f"<li>{limit}</li>" for limit in limits) for limits in (_KILLS, _IGNORED))
    return f"""<h2>Limits of pythonfmu {version}</h2>
<p>The binary of this FMU is pythonfmu's. These end the importer's process, and no Python code of this FMU can prevent
it:</p>
<ul>
{kills}
</ul>
<p>These are not looked at:</p>
<ul>
{ignored}
</ul>
<p>It has no <code>fmi2Error</code>: a step that is refused is <code>fmi2Discard</code>, any other refusal is
<code>fmi2Fatal</code>, after which this FMU can be used all the same. The native flavour has none of these limits.
</p>"""


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
