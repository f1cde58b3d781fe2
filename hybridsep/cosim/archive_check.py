"""Checks of an FMU's archive before anything of it is unpacked: names, kinds and sizes of its members."""

from __future__ import annotations

import stat
import zipfile
from collections.abc import Sequence
from pathlib import Path, PurePosixPath

from ..base.errors import FmuError, brief, first_line
from ..base.zip_files import ZIP_DAMAGE

__all__ = ["DESCRIPTION", "read_description_text"]

DESCRIPTION = "modelDescription.xml"

_MEMBERS_MAX = 20_000
"""Most files of an archive; an archive with the sources of a large model has thousands."""

_SIZE_ANY = 100 * 2**20
"""Size of the unpacked files up to which any compression is taken, bytes: FMUs of large tools have as much."""

_RATIO_MAX = 50
"""Largest ratio of unpacked to packed size beyond that: libraries and tables have up to 20, a bomb has 1000."""

_SIZE_MAX = 4 * 2**30
"""Largest size of the unpacked files, bytes."""

_DESCRIPTION_MAX = 100 * 2**20
"""Largest size of a modelDescription.xml, bytes; one with 100 000 variables has 30 MB."""

_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Ways to pack that FMI 2.0 allows."""


def read_description_text(path: Path) -> bytes:
    """Check an archive's members; return its modelDescription.xml.

    Raises
    ------
    FmuError
        If it is no zip archive, or one that must not be unpacked.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            _check_sizes(path, members)
            _check_names(path, members)
            if DESCRIPTION not in archive.namelist():
                raise FmuError(f"{path.name} is not a readable FMU: it has no {DESCRIPTION}")
            return archive.read(DESCRIPTION)
    except ZIP_DAMAGE as error:
        if isinstance(error, FmuError) or (isinstance(error, OSError) and error.filename is not None):
            raise
        raise FmuError(f"{path.name} is not a readable FMU: {first_line(error)}") from error


def _check_sizes(path: Path, members: Sequence[zipfile.ZipInfo]) -> None:
    """Raise FmuError for an archive that would fill the disk."""
    if len(members) > _MEMBERS_MAX:
        raise FmuError(f"{path.name} must have at most {_MEMBERS_MAX} files, got {len(members)}")
    packed, unpacked = path.stat().st_size, sum(member.file_size for member in members)
    if unpacked > _SIZE_MAX or (unpacked > _SIZE_ANY and unpacked > _RATIO_MAX * packed):
        raise FmuError(
            f"{path.name} must not be unpacked: its {packed / 2**20:.1f} MB become {unpacked / 2**20:.0f} MB, more "
            f"than any FMU's"
        )
    description = max((member.file_size for member in members if member.filename == DESCRIPTION), default=0)
    if description > _DESCRIPTION_MAX:
        raise FmuError(f"{path.name} must not be unpacked: its {DESCRIPTION} has {description / 2**20:.0f} MB")


def _check_names(path: Path, members: Sequence[zipfile.ZipInfo]) -> None:
    """Raise FmuError for a member that would be written elsewhere or over another, or that is no plain file."""
    files: set[str] = set()
    for member in members:
        problem = _problem(member)
        name = member.filename.rstrip("/")
        if problem is None and name in files:
            problem = "occurs twice"
        if problem is not None:
            raise FmuError(f"{path.name} must not be unpacked: its member {brief(member.filename)} {problem}")
        if not member.is_dir():
            files.add(name)
    for member in members:
        for folder in PurePosixPath(member.filename).parents:
            if str(folder) in files:
                raise FmuError(f"{path.name} must not be unpacked: its member {brief(str(folder))} is file and folder")


def _problem(member: zipfile.ZipInfo) -> str | None:
    """Return what is wrong with a member, None if nothing is."""
    name, kind = member.orig_filename, stat.S_IFMT(member.external_attr >> 16)
    if not name or name.startswith("/") or ".." in PurePosixPath(name).parts or not name.isprintable():
        return "has a path out of the archive" if name.isprintable() else "has a name that cannot be printed"
    if "\\" in name or ":" in name:
        return "has a path with a drive or a backslash"
    if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        return "is a link or a device"
    if member.flag_bits & 1:
        return "is encrypted"
    if member.compress_type not in _METHODS:
        return f"is packed by method {member.compress_type}; FMI allows 0 (stored) and 8 (deflated)"
    return None
