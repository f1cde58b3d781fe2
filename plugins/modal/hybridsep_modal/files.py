"""Files of frequency responses: CSV, MAT or NPZ with frequency and complex value, or magnitude and phase."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybridsep.base.errors import LogError, brief, listed
from hybridsep.base.signals import Array
from hybridsep.logs.formats import open_source

ROLES: Mapping[str, tuple[str, ...]] = {
    "frequency": ("frequency", "freq", "f", "hz", "omega", "w"),
    "real": ("real", "re"),
    "imag": ("imag", "im", "imaginary"),
    "magnitude": ("magnitude", "mag", "abs", "amplitude", "gain"),
    "phase": ("phase", "arg", "angle"),
    "std": ("std", "sigma"),
}
"""Names of the columns, without unit and brackets; ``h_re``, ``Re(H)`` and ``H.real`` are found by their parts."""

_WORD = re.compile(r"[a-z]+")

_FREQUENCIES = {"hz": 1.0, "khz": 1e3, "rad/s": 0.5 / np.pi, "rad": 0.5 / np.pi, "1/s": 1.0}
"""Units of frequencies, in small letters, in Hz."""


class ResponseFile(NamedTuple):
    """Frequency response of a file."""

    frequency: Array  # (n,), Hz
    response: NDArray[np.complex128]  # (n,)
    std: Array | None  # (n,): standard deviation of each line's complex error


def has_response(path: Path) -> bool:
    """Return whether a file has columns of a frequency response and none of a log."""
    names = open_source(path).names
    found = _found(names)
    return "frequency" in found and "x_d" not in names and ("real" in found or "magnitude" in found)


def read_response(path: Path) -> ResponseFile:
    """Return the frequency response of a file.

    Frequencies are in Hz, or in kHz or rad/s where the column has that unit or is called omega; magnitudes are linear
    unless their column's name has dB; phases are in degrees or radians as theirs says, in degrees where one is
    beyond 2π.

    ``path``: CSV, MAT or NPZ; a complex vector ``H`` of a MAT file counts as ``H.real`` and ``H.imag``. LogError if
    the file or its columns cannot be used.
    """
    source = open_source(path)
    found = _found(source.names)
    pair = ("real", "imag") if "real" in found else ("magnitude", "phase")
    missing = [role for role in ("frequency", *pair) if role not in found]
    if missing:
        there = listed(source.names)
        raise LogError(
            f"{path}: a frequency response needs the columns frequency and real, imag or magnitude, phase; "
            f"{', '.join(missing)} was not found, the file has {there}"
        )
    roles = ["frequency", *pair, *(["std"] if "std" in found else [])]
    values = source.read([found[role] for role in roles]).columns
    if not len(values[0]):
        raise LogError(f"{path}: a frequency response needs lines, got none")
    name = found["frequency"]
    frequency = values[0] * _frequency_unit(path, name, source.units.get(name, ""))
    if pair == ("real", "imag"):
        response = values[1] + 1j * values[2]
    else:
        phase = _phase(path, found["phase"], values[2])
        response = _magnitude(found["magnitude"], values[1]) * np.exp(1j * phase)
    return ResponseFile(frequency, np.asarray(response, np.complex128), values[3] if "std" in found else None)


def _found(names: list[str]) -> dict[str, str]:
    """Return the file's column of each role: by its whole name, else by a word of it."""
    found = {}
    for role, words in ROLES.items():
        whole = [name for name in names if _plain(name) in words]
        part = [name for name in names if set(_WORD.findall(name.lower())) & set(words[:2])]
        if role == "magnitude":
            part += [name for name in names if "db" in _WORD.findall(name.lower())]
        if whole or part:
            found[role] = (whole or part)[0]
    return found


def _plain(name: str) -> str:
    return re.sub(r"[\[(].*", "", name.lower()).strip(" _")


def _frequency_unit(path: Path, name: str, stated: str) -> float:
    """Return the unit of a column of frequencies, Hz; LogError if it states another."""
    in_name = re.search(r"[\[(]\s*([^\])]*?)\s*[\])]", name)
    words = [word for word in _WORD.findall(name.lower()) if word in _FREQUENCIES]
    unit = (stated or (in_name[1] if in_name else "") or (words[-1] if words else "")).lower()
    if unit and unit not in _FREQUENCIES:
        raise LogError(f"{path}: column {brief(name)} must be in Hz, kHz or rad/s, its unit is {brief(unit)}")
    return _FREQUENCIES[unit or ("rad/s" if _plain(name) in ("omega", "w") else "hz")]


def _magnitude(name: str, values: Array) -> Array:
    return np.asarray(10 ** (values / 20)) if "db" in _WORD.findall(name.lower()) else values


def _phase(path: Path, name: str, values: Array) -> Array:
    words = _WORD.findall(name.lower())
    if "rad" in words:
        return values
    if "deg" not in words and "°" not in name and np.nanmax(np.abs(values)) <= 2 * np.pi:
        raise LogError(
            f"{path}: column {brief(name)} may be in degrees or radians; call it 'phase [deg]' or 'phase [rad]'"
        )
    return np.deg2rad(values)
