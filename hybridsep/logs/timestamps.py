"""Clock timestamps of a text: their time of day counts, dates and zones are passed over."""

import re

SECOND = 1_000_000_000  # in nanoseconds, which doubles count exactly over a day

_ONE_DATE = r"""
    \d{4} [-/.] \d{1,2} [-/.] \d{1,2}                       # 2026-03-05
    | \d{8}                                                 # 20260305, before a time of day
    | \d{1,2} [-/.] \d{1,2} [-/.] (?: \d{4} | \d{2} )       # 05.03.2026, 3/5/26
    | \d{1,2} [-\ ] [A-Za-z]{3} [-\ ] \d{4}                 # 05-Mar-2026
"""

_DATE = re.compile(rf"[\s'\"]* (?: {_ONE_DATE} ) [\s'\"]*", re.VERBOSE)

_STAMP = re.compile(
    rf"""[\s'"]*
    (?P<date> (?: {_ONE_DATE} ) (?: [Tt_-] | [.,]?\s+ ) )?
    (?P<hour>[01]?\d|2[0-3]) : (?P<minute>[0-5]\d) : (?P<second>[0-5]\d) (?: [.,] (?P<fraction>\d{{1,9}}) )?
    (?: \s* (?P<half>[AaPp]) \.? [Mm] \.? )?
    (?: \s* (?: [Zz] | UTC | GMT | (?:UTC|GMT)? [+-] \d\d (?: :? \d\d )? ) )?
    [\s'"]*""",
    re.VERBOSE,
)
"""A time of day, with a date before it and a zone after it or without."""


def stamp_kind(text: str) -> str:
    """Return whether a text is a ``"date"``, a ``"time"`` of day or a ``"date and time"``; empty if it is neither."""
    match = _STAMP.fullmatch(text)
    if match:
        return "date and time" if match["date"] else "time"
    return "date" if _DATE.fullmatch(text) else ""


def nanoseconds(text: str) -> float:
    """Return the time of day of a timestamp, ns; ValueError if it is none."""
    match = _STAMP.fullmatch(text)
    if match is None:
        raise ValueError(text)
    _, hour, minute, second, fraction, half = match.groups()
    hours = int(hour) if half is None else int(hour) % 12 + 12 * (half in "Pp")
    return float((3600 * hours + 60 * int(minute) + int(second)) * SECOND + int((fraction or "").ljust(9, "0")))
