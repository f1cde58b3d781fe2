"""Sections of a machine file: their entries, with the ranges of :mod:`hybridsep.base.settings`, and how one is read."""

import re
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field, fields
from functools import partial
from typing import Any, TypeVar

from ..base.errors import ParameterError, brief
from ..base.parameters import Parameter
from ..base.settings import PARAMETERS, Cascade, CompensatorSettings, Limits, PredictorSettings

NAME_PATTERN = r"[A-Za-z][A-Za-z0-9_]{0,99}"  # of machines; they are parts of FMUs' names, which become names of files

_LINE = re.compile("[^\x00-\x1f\x7f\ufffe\uffff]+")
"""One line of printable text, of characters that XML 1.0 allows, for modelDescription and documentation."""

_LINE_WORDS = "one line of printable text that XML 1.0 allows"

_DECLARED = {**PARAMETERS, **Limits.parameters(), **Cascade.parameters()}
"""Parameters by the names of their entries; a drive's and a trajectory's limits have the range of the compensator's."""

_S = TypeVar("_S", bound="Section")

Read = Callable[[Any, str, list[str]], Any]
"""Reader of an entry: its value, its place in the file and the list of problems → what the section has of it."""


@dataclass(frozen=True, kw_only=True)
class Section:
    """Table of a machine file; unknown entries are refused, ``table`` has the given ones in their types."""

    table: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)

    def values(self, *without: str) -> dict[str, Any]:
        """Return all entries but some, by the names of the fields."""
        return {name: getattr(self, name) for name in entries(type(self)) if name not in without}

    def check(self) -> None:
        """Raise ParameterError if entries that are in their ranges are inconsistent."""


def entries(kind: type[Section]) -> dict[str, Any]:
    """Return the fields of a section that are entries of the file."""
    return {one.name: one for one in fields(kind) if "read" in one.metadata}


def read_section(kind: type[_S], table: Any, place: str, problems: list[str]) -> _S | None:
    """Return a section of a file's table, whose place is empty for the file itself; None if ``problems`` are added."""
    if not isinstance(table, Mapping):
        problems.append(f"{place} must be a table, got {brief(table)}")
        return None
    known, before = entries(kind), len(problems)
    _refuse_unknown(table, known, place, problems)
    values, given = {}, {}
    for name, one in known.items():
        where = f"{place}.{name}" if place else name
        if table.get(name) is not None:
            values[name] = one.metadata["read"](table[name], where, problems)
            given[name] = _plain(values[name], one.metadata.get("settings"))
        elif one.default is MISSING and one.default_factory is MISSING:
            problems.append(f"{where} is missing")
    if len(problems) > before:
        return None
    section = kind(**values, table=given)
    try:
        section.check()
    except ParameterError as error:
        problems.append(f"{place}: {error}" if place else str(error))
        return None
    return section


def _refuse_unknown(table: Mapping[str, Any], known: Mapping[str, Any], place: str, problems: list[str]) -> None:
    for name in table:
        if name not in known:
            where = f"{place}.{name}" if place else str(name)
            where = where if len(where) <= 60 and where.isprintable() else brief(where)
            problems.append(f"{where} is not an entry of a machine file; check its spelling")


def _plain(value: Any, settings: Mapping[str, tuple[str, Parameter]] | None = None) -> Any:
    """Return what a section has as plain values, settings by the names of their entries."""
    if settings is not None:
        return {entry: value[name] for entry, (name, _) in settings.items() if name in value}
    if isinstance(value, Section):
        return dict(value.table)
    return [_plain(one) for one in value] if isinstance(value, tuple) else value


# Entries -----------------------------------------------------------------------------------------------------------


def _entry(read: Read, default: Any = MISSING, **more: Any) -> Any:
    return field(default=default, metadata={"read": read, **more})


def parameter_entry(name: str, default: Any = MISSING) -> Any:
    """Declare an entry that has the range of a parameter."""
    parameter = _DECLARED[name]
    return _entry(partial(_checked, parameter, name), default, parameter=parameter)


def _checked(parameter: Parameter, label: str, value: Any, place: str, problems: list[str]) -> Any:
    try:
        return parameter.checked(value, label)
    except ParameterError as error:
        problems.append(f"{place}: {error}")


def _text_entry(allows: Callable[[Any], bool], what: str, default: Any = MISSING, **more: Any) -> Any:
    def read(value: Any, place: str, problems: list[str]) -> Any:
        if not allows(value):
            problems.append(f"{place} must be {what}, got {brief(value)}")
        return tuple(value) if isinstance(value, list) else value

    return _entry(read, default, **more)


def _is_line(value: Any) -> bool:
    return isinstance(value, str) and _LINE.fullmatch(value) is not None


def line_entry(default: Any = MISSING) -> Any:
    """Declare an entry of one line of text."""
    return _text_entry(_is_line, _LINE_WORDS, default)


def choice_entry(*choices: str, default: Any = MISSING) -> Any:
    """Declare an entry that is one of some words."""
    return _text_entry(lambda value: value in choices, " or ".join(choices), default, choices=choices)


def section_entry(kind: type[Section], default: Any = MISSING) -> Any:
    """Declare an entry that is a section."""
    return _entry(partial(read_section, kind), default, sections=(kind,))


def _modes_entry() -> Any:
    """Declare an entry that is a list of modes, none by default."""

    def read(value: Any, place: str, problems: list[str]) -> Any:
        if not isinstance(value, list | tuple):
            problems.append(f"{place} must be a list of modes: write [[{place}]], with double brackets")
            return ()
        return tuple(read_section(ModeSection, one, f"{place}[{i}]", problems) for i, one in enumerate(value, 1))

    return _entry(read, (), sections=(ModeSection,))


def _settings_entry(known: Mapping[str, Parameter], check: Callable[[dict[str, Any]], object]) -> Any:
    """Declare an entry that is a section of settings: field → value, of those that are given."""
    by_entry = {parameter.name: (name, parameter) for name, parameter in known.items()}

    def read(value: Any, place: str, problems: list[str]) -> Any:
        found: dict[str, Any] = {}
        if not isinstance(value, Mapping):
            problems.append(f"{place} must be a table, got {brief(value)}")
            return found
        before = len(problems)
        _refuse_unknown(value, by_entry, place, problems)
        for entry, (name, parameter) in by_entry.items():
            if value.get(entry) is not None:
                found[name] = _checked(parameter, entry, value[entry], f"{place}.{entry}", problems)
        if len(problems) == before:
            try:
                check(found)
            except ParameterError as error:
                problems.append(f"{place}: {error}")
        return found

    return field(default_factory=dict, metadata={"read": read, "settings": by_entry})


# Sections ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class ModeSection(Section):
    """One mode of eq. (15)."""

    f_n: float = parameter_entry("f_n")
    zeta: float = parameter_entry("zeta")
    alpha: float = parameter_entry("alpha")
    beta: float = parameter_entry("beta", 0.0)


@dataclass(frozen=True, kw_only=True)
class SpringMassDamper(Section):
    """Eq. (11)."""

    m: float = parameter_entry("m")
    c: float = parameter_entry("c")
    k: float = parameter_entry("k")


@dataclass(frozen=True, kw_only=True)
class CascadeSection(Section):
    """Gains of :class:`~hybridsep.base.settings.Cascade`."""

    inertia: float = parameter_entry("inertia")
    Kp: float = parameter_entry("Kp")
    Kv: float = parameter_entry("Kv")
    Tv: float = parameter_entry("Tv", 0.0)
    feed_forward: float = parameter_entry("feed_forward", 0.0)
    viscous: float = parameter_entry("viscous", 0.0)


@dataclass(frozen=True, kw_only=True)
class Physics(Section):
    """``G_pb``: ``[[physics.mode]]`` entries, one ``[physics.spring_mass_damper]`` or one ``[physics.cascade]``."""

    mode: tuple[ModeSection, ...] = _modes_entry()
    spring_mass_damper: SpringMassDamper | None = section_entry(SpringMassDamper, None)
    cascade: CascadeSection | None = section_entry(CascadeSection, None)
    dead_time: int = parameter_entry("dead_time", PARAMETERS["dead_time"].default)
    input_hold: str = parameter_entry("input_hold", "zoh")

    def check(self) -> None:
        """Raise ParameterError unless there is one of them."""
        if sum(map(bool, (self.mode, self.spring_mass_damper, self.cascade))) != 1:
            raise ParameterError("give [[physics.mode]] entries, [physics.spring_mass_damper] or [physics.cascade]")


@dataclass(frozen=True, kw_only=True)
class FeedDriveSection(Section):
    """The drive of eq. (13); its linear part is ``[physics.spring_mass_damper]``."""

    kind: str = choice_entry("feed_drive")
    c_nl: float = parameter_entry("c_nl", PARAMETERS["c_nl"].default)
    k_nl: float = parameter_entry("k_nl", PARAMETERS["k_nl"].default)
    noise_std: float = parameter_entry("noise_std", PARAMETERS["noise_std"].default)
    seed: int = parameter_entry("seed", PARAMETERS["seed"].default)


@dataclass(frozen=True, kw_only=True)
class StageSection(Section):
    """The stage: ``[[physics.mode]]`` with friction and cable stiffness on the command."""

    kind: str = choice_entry("stage")
    f: float = parameter_entry("f", PARAMETERS["f"].default)
    kappa: float = parameter_entry("kappa", PARAMETERS["kappa"].default)
    friction_on: str = parameter_entry("friction_on", "command")
    noise_std: float = parameter_entry("noise_std", PARAMETERS["noise_std"].default)
    seed: int = parameter_entry("seed", PARAMETERS["seed"].default)


@dataclass(frozen=True, kw_only=True)
class IdentifiedSection(Section):
    """A plant to try with, no measurement: modes, by default ``[physics]``'s, and the disturbances of a log."""

    kind: str = choice_entry("identified")
    f: float = parameter_entry("f", PARAMETERS["f"].default)
    kappa: float = parameter_entry("kappa", PARAMETERS["kappa"].default)
    v_friction: float = parameter_entry("v_friction", PARAMETERS["v_friction"].default)
    noise_std: float = parameter_entry("noise_std", PARAMETERS["noise_std"].default)
    seed: int = parameter_entry("seed", PARAMETERS["seed"].default)
    mode: tuple[ModeSection, ...] = _modes_entry()


PlantSection = FeedDriveSection | StageSection | IdentifiedSection

_PLANTS = {"feed_drive": FeedDriveSection, "stage": StageSection, "identified": IdentifiedSection}


def plant_entry() -> Any:
    """Declare the entry of a plant, whose section its ``kind`` names; none by default."""

    def read(value: Any, place: str, problems: list[str]) -> Any:
        kind = value.get("kind") if isinstance(value, Mapping) else None
        if kind is None or kind not in _PLANTS:
            said = "is missing:" if kind is None else f"must not be {brief(kind)}, but"
            problems.append(f"{place}.kind {said} {', '.join(_PLANTS)}")
            return None
        return read_section(_PLANTS[kind], value, place, problems)

    return _entry(read, None, sections=tuple(_PLANTS.values()))


@dataclass(frozen=True, kw_only=True)
class LimitsSection(Section):
    """Velocity, acceleration and jerk of the reference trajectory, m/s, m/s², m/s³."""

    velocity: float = parameter_entry("velocity")
    acceleration: float = parameter_entry("acceleration")
    jerk: float = parameter_entry("jerk")


@dataclass(frozen=True, kw_only=True)
class DriveLimitsSection(LimitsSection):
    """Limits of the drive for the modified command, wider than the trajectory's; ``estimated``: from a log's motion."""

    change_max: float = parameter_entry("change_max", PARAMETERS["change_max"].default)
    following_error_max: float = parameter_entry("following_error_max", 0.0)
    estimated: bool = _text_entry(lambda value: isinstance(value, bool), "true or false", False)


@dataclass(frozen=True, kw_only=True)
class LogSection(Section):
    """How a recorded log is read; as by :func:`hybridsep.logs.log.read_log` where an entry is left out."""

    t: str | None = line_entry(None)
    x_d: str | None = line_entry(None)
    x: str | None = line_entry(None)
    error: str | None = line_entry(None)
    unit: str | None = line_entry(None)
    axis: str | None = line_entry(None)

    @property
    def columns(self) -> dict[str, str]:
        """Names of the columns by role."""
        return {name: value for name, value in self.table.items() if name in ("t", "x_d", "x", "error")}

    def columns_beside(self, given: Mapping[str, str], T_s: float | None) -> dict[str, str]:
        """Return these names and those that are ``given``, which count; with ``T_s`` there may be no times."""
        names = {role: name for role, name in self.columns.items() if role != "t" or T_s is None} | dict(given)
        if {"x_d", "x", "error"} <= names.keys():  # an error is in the place of a position
            names.pop(next((role for role in ("error", "x", "x_d") if role not in given), ""), None)
        return names


def _own(*several: type[PredictorSettings | CompensatorSettings]) -> dict[str, Parameter]:
    return {name: one for its in several for name, one in its.parameters().items() if name not in its.ELSEWHERE}


@dataclass(frozen=True, kw_only=True)
class FileSection(Section):
    """Top level of a machine file: its own entries and its sections; the compensator's default to the predictor's."""

    name: str = _text_entry(
        lambda value: isinstance(value, str) and bool(re.fullmatch(NAME_PATTERN, value)),
        "a letter, then at most 99 letters, digits and _",
    )
    title: str = line_entry()
    sources: tuple[str, ...] = _text_entry(
        lambda value: isinstance(value, list | tuple) and bool(value) and all(map(_is_line, value)),
        *(f"a list, each entry {_LINE_WORDS}", ()),
    )
    T_s: float = parameter_entry("T_s", PARAMETERS["T_s"].default)
    unit: str = choice_entry("m", "rad", default="m")
    physics: Physics = section_entry(Physics)
    predictor: Mapping[str, Any] = _settings_entry(_own(PredictorSettings), lambda given: PredictorSettings(**given))
    compensator: Mapping[str, Any] = _settings_entry(_own(PredictorSettings, CompensatorSettings), lambda _given: None)
    plant: PlantSection | None = plant_entry()
    limits: LimitsSection | None = section_entry(LimitsSection, None)
    drive_limits: DriveLimitsSection | None = section_entry(DriveLimitsSection, None)
    log: LogSection = section_entry(LogSection, LogSection())
