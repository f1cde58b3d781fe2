"""Units of a log's columns: names, factors to SI, and where a column's name states one (``x [mm]``, ``x_mm``)."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from ..base.errors import SignalError, brief


@dataclass(frozen=True)
class Unit:
    """Unit of a column."""

    name: str  # its spelling in options
    si: str  # SI unit that the library computes with: metres for linear axes, radians for rotary ones, seconds
    factor: float  # one unit in SI


def _units(si: str, factors: Mapping[str, float]) -> dict[str, Unit]:
    return {name: Unit(name, si, factor) for name, factor in factors.items()}


POSITION_UNITS: Mapping[str, Unit] = {
    **_units("m", {"m": 1.0, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "in": 0.0254}),
    **_units("rad", {"rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "deg": math.pi / 180, "rev": 2 * math.pi}),
}
"""Units of positions by name; a log's positions are read in metres, or in radians where their unit is an angle."""

TIME_UNITS: Mapping[str, Unit] = _units("s", {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0})
"""Units of times by name."""


@dataclass(frozen=True)
class DisplayUnits:
    """Units in which a log's positions and their errors are printed and drawn, each a factor from SI and a name."""

    position: tuple[float, str]
    small: tuple[float, str]  # of errors below ``limit``; larger ones are in that of positions
    limit: float = 1e4  # error in the small unit

    def error(self, size: float) -> tuple[float, str]:
        """Return factor and name of the unit of errors of about ``size``, m or rad."""
        return self.position if self.small[0] * abs(size) >= self.limit else self.small

    def words(self, size: float, form: str = ".3g") -> str:
        """Return an error, m or rad, with its unit."""
        factor, name = self.error(size)
        return f"{factor * size:{form}} {name}"


_METRIC = DisplayUnits((1e3, "mm"), (1e6, "µm"))
_ANGULAR = DisplayUnits((1e3, "mrad"), (1e6, "µrad"))
_INCH, _DEGREE, _TURN = (1.0 / POSITION_UNITS[name].factor for name in ("in", "deg", "rev"))
_SHOWN = {
    "in": DisplayUnits((_INCH, "in"), (1e6 * _INCH, "µin")),
    "deg": DisplayUnits((_DEGREE, "deg"), (1e3 * _DEGREE, "mdeg"), 1e3),
    "rev": DisplayUnits((_TURN, "rev"), (1e3 * _TURN, "mrev"), 1e3),
}


def shown_of(file_unit: str, si: str) -> DisplayUnits:
    """Return the units in which positions in ``si``, m or rad, of a file in ``file_unit`` are shown.

    They are the file's, or SI where the file's unit is empty or of the other kind.
    """
    unit = position_unit(file_unit)
    return shown_in(unit.name if unit is not None and unit.si == si else si)


def shown_in(unit: str) -> DisplayUnits:
    """Return the units in which the positions of a log in ``unit``, as of :func:`position_unit`, are shown."""
    name = unit.split()[-1]  # of a multiple, "0.1 um"
    return _SHOWN.get(name, _METRIC if POSITION_UNITS[name].si == "m" else _ANGULAR)


_SPELLINGS = {
    spelling: name
    for name, spellings in {
        "m": "meter metre meters metres",
        "um": "micron microns",
        "in": 'inch inches "',
        "10 mm": "cm centimeter centimeters centimetre centimetres",
        "12 in": "ft foot feet",
        "0.001 in": "mil mils thou",
        "0.001 nm": "pm",
        "0.001 deg": "mdeg",
        f"{1 / 60} deg": "arcmin",
        f"{1 / 3600} deg": "arcsec",
        "deg": "° degree degrees",
        "rad": "radian radians",
        "rev": "turn turns revolution revolutions rot",
        "s": "sec second seconds",
        "ms": "msec millis",
        "us": "usec micros",
    }.items()
    for spelling in spellings.split()
}
_SPELLINGS |= {
    f"{prefix}{word}": f"{short}{unit}"
    for prefix, short in (("milli", "m"), ("micro", "u"), ("nano", "n"))
    for word, unit in _SPELLINGS.items()
    if unit in ("m", "s", "rad") and len(word) > 3
}
"""Other spellings, in small letters, of the units' names, or of multiples; µ is u."""

COUNTS = {"count", "ct", "cnt", "qc", "inc", "incr", "inkr", "increment", "pulse", "tick", "lu", "puu", "step"}
"""Spellings of an encoder's count where a unit is stated, without a plural's s; its length must be given."""

_SUFFIXES = {"mm", "cm", "um", "nm", "inch", "inches", "meter", "rad", "mrad", "urad", "deg", "mdeg", "arcmin"}
_SUFFIXES |= {"arcsec", "s", "ms", "us", "ns", "counts", "ticks"}
"""Units that end a name after an underscore or a comma; m is none, as ``x_m`` is rather the measured position."""

_BRACKETS = re.compile(r"^(?P<name>.*?)\s*(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\))\s*$")
_INSIDE = re.compile(r"\s*[\[(](?P<unit>[^()\[\]]+)[\])]\s+")
_SLASH = re.compile(r"^(?P<name>.*?\S)\s*(?:/|\bin\b)\s*(?P<unit>\S+)\s*$")
_MULTIPLE = re.compile(r"^\s*(?P<times>\d*\.?\d+(?:[eE][+-]?\d+)?)\s*(?P<unit>\S+)\s*$")
_SUFFIX = re.compile(r"^(?P<name>.*?[^_\s,])(?:_|\s*,\s*|\s+(?=[a-zµμ]{2,}$))(?P<unit>[^_\s,]+)$")


def plain_name(text: str) -> str:
    """Return a unit's name in the spelling of the tables, in small letters."""
    text = text.strip().lower().replace("µ", "u").replace("μ", "u")
    return _SPELLINGS.get(text, text)


def position_unit(text: str, known_units: Mapping[str, Unit] = POSITION_UNITS) -> Unit | None:
    """Return the unit of a position of that spelling, or a multiple of one, ``0.1 um``; None if there is none."""
    unit, multiple = known_units.get(plain_name(text)), _MULTIPLE.match(plain_name(text))
    if unit is not None or multiple is None:
        return unit
    unit, times = known_units.get(plain_name(multiple["unit"])), float(multiple["times"])
    known = unit is not None and 0.0 < times * unit.factor < math.inf
    return (
        Unit(f"{times!r} {unit.name}".replace(".0 ", " "), unit.si, times * unit.factor)
        if unit is not None and known
        else None
    )


def si_factor(own: str, stated: str) -> float:
    """Return the factor to SI of a unit, of ``own`` where it is empty; SignalError if it is not of its kind."""
    unit, usual = position_unit(stated or own), position_unit(own)
    if unit is None or usual is None or unit.si != usual.si:
        raise SignalError(f"positions must be in {own} or a unit of its kind, got {brief(stated)}")
    return unit.factor


def time_unit(text: str) -> Unit | None:
    """Return the unit of a time of that spelling, or a multiple of one, ``100 ns``; None if there is none."""
    return position_unit(text, TIME_UNITS)


def stated_unit(name: str) -> tuple[str, str]:
    """Return a column's name without its unit, and the unit as it is written, empty if it states none.

    ``x [mm]``, ``x (mm)``, ``x / mm``, ``x in mm``, ``x, mm`` and ``x_mm`` are ``("x", "mm")``. In square brackets any
    text is a unit, but for the number of a matrix's column, ``q[0]`` or ``q(0)``, and anywhere a known one divided by
    another, as in ``v (mm/s)``; otherwise only a known one, within the name too, ``x (mm) set``.
    """
    brackets = _BRACKETS.match(name)
    if brackets:
        square, text = brackets["square"], brackets["square"] or brackets["round"] or ""
        if text.isdigit() and name[len(brackets["name"])] in "[(":
            return name, ""
        if text.strip() in ("", "-", "1"):
            return brackets["name"], ""
        if square is not None or _is_unit(text.split("/")[0]):
            return brackets["name"], text.strip()
        return name, ""
    slash = _SLASH.match(name)
    if slash and _is_unit(slash["unit"]):
        return slash["name"], slash["unit"]
    suffix = _SUFFIX.match(name)
    if suffix and ({plain_name(suffix["unit"]), suffix["unit"].lower()} & _SUFFIXES):
        return suffix["name"], suffix["unit"]
    inside = _INSIDE.search(name)
    is_position = inside is not None and time_unit(inside["unit"]) is None and _is_unit(inside["unit"])
    return (_INSIDE.sub(" ", name, 1), inside["unit"]) if inside and is_position else (name, "")


def _is_unit(text: str) -> bool:
    return position_unit(text) is not None or time_unit(text) is not None or plain_name(text).rstrip("s") in COUNTS
