"""Recognition of columns by their names: time, commanded and measured position, of one axis or of several."""

import re
from collections.abc import Mapping, Sequence

from .units import stated_unit

ROLES = ("t", "x_d", "x")  # time, commanded and measured position

SIGNALS: Mapping[str, str] = {
    "planned_position": "DES_POS",
    "loop_command": "CTRL_POS",
    "following_error": "CTRL_DIFF",
    "contour_deviation": "CONT_DEV",
}
"""What a SINUMERIK says of an axis beside its measured position, and its names: the position that its interpolator
planned, that which enters the position loop, later and interpolated, the measured one's distance from the latter, and
its deviation from the contour."""

_NAMES: Mapping[str, tuple[str, ...]] = {
    "t": ("t", "time", "timestamp", "time_stamp", "sec", "seconds", "epoch", "zeit", "millis", "micros", "tout"),
    "x_d": (
        "x_d", "xd", "x_ref", "xref", "x_cmd", "x_set", "x_des", "reference", "setpoint", "set_point", "command",
        "commanded", "position_commanded", "commanded_position", "pos_cmd", "cmd_pos", "pos_ref", "pos_set", "ctrl_pos",
        "des_pos", "q_d", "sollposition", "solllage", "lagesollwert",
    ),
    "x": (
        "x_meas", "x", "x_m", "x_act", "measured", "measurement", "actual", "position_measured", "measured_position",
        "actual_position", "position_actual", "pos_meas", "pos_act", "act_pos", "enc_pos", "feedback", "q_meas",
        "process_value", "istposition", "istlage", "lageistwert",
    ),
}  # fmt: skip
"""Names of each role's column, by precedence, in small letters; where the true position is x, x_meas is meant."""

_SOLL, _IST = {"sollposition", "solllage", "lagesollwert"}, {"istposition", "istlage", "lageistwert"}
_COMMANDED = {"cmd", "command", "commanded", "ref", "reference", "set", "setpoint", "sp", "des", "desired", "target"}
_COMMANDED |= {"goal", "action", "commands", "demand", "nominal", "noml", "planned", "consigne", "soll", "sollwert"}
_COMMANDED |= _SOLL
_MEASURED = {"act", "actual", "meas", "measured", "measurement", "fb", "feedback", "enc", "encoder", "pv", "ist"} | _IST
_MEASURED |= {"mesure", "istwert", "present"}
_ESTIMATED = {"estimate", "estimated", "observation"}  # measured where nothing else is
_POSITION = {"pos", "position", "positions", "lage", "weg", "angle", "pl", "pctrl", "pulses"} | _SOLL | _IST
_FILLING = {"axis", "value", "values", "data", "state", "states", "current"}
_SENT = {"control", "input"}  # commanded beside a word for the position, else a controller's output
_VELOCITY = {"vel", "velo", "velocity", "velocities", "speed", "speeds", "geschwindigkeit"}
_ERROR = {"error", "err", "errors", "diff", "posdiff", "deviation", "droop", "schleppfehler", "schleppabstand"}
_ERROR |= {"fe", "ferr", "ferror", "poserr"}
# of a whole move or of another instant; ACS has DPOS beside RPOS
_LATER = re.compile("target|goal|planned|nominal|(?<![a-z])([dmt]pos|action)(?![a-z])", re.IGNORECASE)
_NO_POSITION = _VELOCITY | _ERROR | {"acc", "acceleration", "accelerations", "jerk", "torque", "frequency"}
_TIME = {"time", "timestamp", "zeit", "zeitstempel", "temps"}
"""Words within names, in small letters; what is left of a name beside those of positions and what fills is the axis."""

_SHORT = {"rpos": "ref pos", "fpos": "fb pos", "dpos": "ref pos", "mpos": "fb pos", "tpos": "ref pos"}
_SHORT |= {"apos": "estimate pos", "pcmd": "pos cmd", "posf": "pos fb", "s": "pos", "_rp": "ref pos ", "_tp": "fb pos "}
_WORDS = r"(?<![a-z])([rfdmta]pos|pcmd|posf|^s(?=[ _](?:noml|act)))(?![a-z])|^_[rt]p(?=[a-hw-z]$)"
_WHOLE = re.compile(rf"{_WORDS}|\(?0x[\da-f]+\)?", re.IGNORECASE)
"""Whole words of ACS, Trio, Technosoft (``APOS``, in ACS a command, is measured where nothing else is), Fanuc,
Heidenhain and Galil that stand for two; and numbers of CANopen's objects, which say nothing."""

_TOKEN = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+|\W")
_POS = re.compile(r"(?<=[a-z\d])(pos)(?![a-z])", re.IGNORECASE)
_AXIS = re.compile(r"([xyzabcqj]|joint|theta|phi|psi)?_?\d*", re.IGNORECASE)
_ACTUAL = re.compile(r"(?<=\.)Actual(?=Position)")
_COLUMN = re.compile(r"[\[(](\d+)[\])]$")
"""Names of axes that need no word for the position: x_cmd is one, v_cmd a velocity; ``q[0]`` is a matrix's column."""


def known_names(role: str, names: Sequence[str]) -> list[str]:
    """Return the columns of the role's best known name, as it is, or without unit and in any spelling."""
    for spelled in ({name: name for name in names}, {name: _spelling(stated_unit(name)[0]) for name in names}):
        for key in _NAMES[role]:
            if known := [name for name in names if spelled[name] == key]:
                return known
    return []


def n_known(names: Sequence[str]) -> int:
    """Return how many roles names have."""
    return sum(bool(known_names(role, names)) for role in ROLES) + 2 * len(axes_of(names))


def _by_words(names: Sequence[str]) -> tuple[dict[str, str], dict[str, str], tuple[list[str], list[str]]]:
    """Return commanded and measured positions by axis, and those of either kind that have a word for the position."""
    commanded: dict[str, str] = {}
    measured: dict[str, str] = {}
    estimated: dict[str, str] = {}
    positions: dict[str, str] = {}  # of columns that say nothing else, joint_pos_1 beside joint_pos_target_1
    whole: dict[str, list[str]] = {"x_d": [], "x": []}
    for name in sorted(names, key=lambda one: bool(_LATER.search(one))):
        if column := _COLUMN.search(stated_unit(name)[0]):  # of a matrix that is called x_d
            known = [_spelling(name[: column.start()]) in _NAMES[role] for role in ("x_d", "x")]
            if any(known):
                (commanded if known[0] else measured).setdefault(column[1], name)
                if known[0] and (own := name.replace("_d", "", 1)) != name and own in names:  # a robot's q beside q_d
                    measured.setdefault(column[1], own)
                continue
        words, axis = {token.lower() for token in _tokens(name)}, _axis(name)
        is_position = not words.isdisjoint(_POSITION)
        # A motor's current, and what a controller of the position sends, are none
        if words & _NO_POSITION or words >= {"control", "output"} or ("current" in words and not is_position):
            continue
        sent = _COMMANDED | _SENT if is_position else _COMMANDED
        kinds = [bool(words & known) for known in (sent, _MEASURED | _ESTIMATED)]
        if not any(kinds) and is_position:
            positions.setdefault(axis, name)
        elif sum(kinds) == 1 and (is_position or _AXIS.fullmatch(axis)):
            kind = estimated if words & _ESTIMATED else measured
            (commanded if kinds[0] else kind).setdefault(axis, name)
            if is_position:
                whole["x_d" if kinds[0] else "x"].append(name)
    for axis, name in measured.items():  # a PLC's Axis.Position and Axis.ActualPosition
        if (own := _ACTUAL.sub("", name)) != name and own in names:
            commanded.setdefault(axis, own)
    plain = {name: _COLUMN.sub(r"_\1", stated_unit(name)[0]) for name in names[::-1]}
    bare = {axis: name for name, axis in plain.items() if axis and axis in commanded}  # q and q_des
    measured = {**estimated, **bare, **positions, **measured}
    return commanded, measured, (whole["x_d"], whole["x"] or list(positions.values()))


def axes_of(names: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Return commanded and measured position by axis: ``X1_CommandPosition``, ``X1_ActualPosition`` of ``X1``."""
    commanded, measured, only = _by_words(names)
    found = {axis: (x_d, measured[axis]) for axis, x_d in commanded.items() if axis in measured}
    # A compensation is added to what enters the position loop; what was planned is another instant's
    found = {axis: (signals_of(names, x).get("loop_command", x_d), x) for axis, (x_d, x) in found.items()}
    if not found and [len(names) for names in only] == [1, 1]:  # whatever their axis
        return {"": (only[0][0], only[1][0])}
    return found


def beside_error(names: Sequence[str], error: str = "") -> dict[str, str]:
    """Return the positions by role of the axis whose words an error's name has; without a name, of the only axis."""
    commanded, measured, _ = _by_words(names)
    words, both = _words(error), {axis: {"x_d": x_d, "x": x} for axis, (x_d, x) in axes_of(names).items()}
    alone = {axis: {"x": x} for axis, x in measured.items() if words or not commanded}
    alone |= {axis: {"x_d": x_d} for axis, x_d in commanded.items()}
    of_axes = {*commanded.values(), *measured.values()}
    if words and not {*known_names("x_d", names), *known_names("x", names)} <= of_axes:
        return {}  # names of no axis come first
    for known in (both, {} if words and "" in commanded else alone):
        own = {axis: _words(axis) for axis in known}
        n = {axis: len(own[axis] & words) for axis in own if not words or (own[axis] and own[axis] <= words)}
        best = [axis for axis in n if n[axis] == max(n.values())]
        if len(best) == 1:
            return known[best[0]]
    return {}


def signals_of(names: Sequence[str], measured: str) -> dict[str, str]:
    """Return the columns of :data:`SIGNALS` of the axis of a measured position: ``CTRL_DIFF|1`` of ``ENC_POS|1``."""
    _, mark, axis = stated_unit(measured)[0].partition("|")
    plain = {stated_unit(name)[0].upper(): name for name in names}
    return {what: plain[own] for what, word in SIGNALS.items() if (own := f"{word}{mark}{axis}".upper()) in plain}


def _axis(name: str) -> str:
    """Return what is left of a name without unit and words of positions: ``joint_1`` of ``joint_pos_target_1``."""
    left, gap = "", ""
    for token in _tokens(name):
        if not token.isalnum():
            gap = gap or ("_" if token == " " else token)
        elif token.lower() not in _COMMANDED | _SENT | _MEASURED | _ESTIMATED | _POSITION | _FILLING:
            left, gap = f"{left}{gap if left else ''}{token}", ""
    return left


def _tokens(name: str) -> list[str]:
    """Return words, numbers and signs of a name without its unit; ``_`` is a blank, ``XPOS`` two words."""
    plain = _WHOLE.sub(lambda one: _SHORT.get(one[0].lower(), ""), stated_unit(name)[0])
    return _TOKEN.findall(_POS.sub(r" \1", _COLUMN.sub(r" \1", plain).replace("_", " ")))


def _words(name: str) -> set[str]:
    return {token.lower() for token in _tokens(name) if token.isalnum()}


def has_word(kind: str, name: str) -> bool:
    """Return whether a name has a word of a time, a velocity or an error."""
    return not {"t": _TIME, "velocity": _VELOCITY, "error": _ERROR}[kind].isdisjoint(_words(name))


def _spelling(name: str) -> str:
    return name.strip(" _").lower().replace(" ", "_").replace("-", "_").replace(".", "_")
