"""Machine files: TOML description of one axis for the library, the FMUs and the command line, in SI units.

An invalid file is refused with a message that names the file, the entry, what was expected and what was found.
The writer makes TOML with the unit of each entry as a comment.
"""

import json
import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ..base.errors import MachineError, ParameterError, brief, check_kind, first_line, listed
from ..base.files import as_path, data_folder
from ..base.parameters import Parameter, angular_unit
from ..base.settings import PARAMETERS, Cascade, CompensatorSettings, Limits, PredictorSettings, Settings
from ..model.physics import ModalModel, Mode
from ..plants.feed_drive import FeedDrive
from ..plants.stage_drive import StageDrive
from .sections import NAME_PATTERN, FeedDriveSection, FileSection, IdentifiedSection, StageSection, read_section

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

if TYPE_CHECKING:  # they load slowly, and whoever builds an FMU needs none
    from ..compensate.compensator import SepCompensator
    from ..logs.log import Log
    from ..predict.predictor import HybridPredictor

_NEEDED = {
    "plant": "which hybridsep fit writes from a log of the axis",
    "limits": "of its trajectory; add them",
    "drive_limits": "which a compensator must keep; add them",
}
"""Sections that a machine may lack, and what they are for."""


@dataclass(frozen=True, kw_only=True)
class Machine(FileSection):
    """One axis: identification, physics model, settings, plant if it has one; ``unit`` rad: every m stands for rad.

    Fields: the entries of :class:`FileSection`; ``predictor`` and ``compensator`` are those that were given, by name.
    """

    def __repr__(self) -> str:
        own = self.predictor_settings
        return f"Machine({self.name!r}, T_s = {self.T_s!r}, Np = {own.Np}, p = {own.p}, q = {own.q})"

    def check(self) -> None:
        """Raise ParameterError if plant and physics, or the compensator's entries, are inconsistent."""
        if isinstance(self.plant, FeedDriveSection) and self.physics.spring_mass_damper is None:
            raise ParameterError("a plant of kind feed_drive needs [physics.spring_mass_damper]")
        if isinstance(self.plant, StageSection) and not self.physics.mode:
            raise ParameterError("a plant of kind stage needs [[physics.mode]] entries")
        if isinstance(self.plant, FeedDriveSection | StageSection) and (self.unit != "m" or self.physics.dead_time):
            raise ParameterError("a plant of kind feed_drive or stage must have unit = 'm' and physics.dead_time = 0")
        if self.plant is not None:
            self.new_plant()  # raises if the combination is out of range
        _ = self.model  # raises if the mode of m, c and k is out of range
        if self.drive_limits is not None or "compensator" in self.table:
            try:
                settings, _ = self.compensator_predictor, self.compensator_settings
                if "measurement_delay" in self.compensator:  # the predictor's: the file may be only for that one
                    settings.check_planning()
            except ParameterError as error:
                raise ParameterError(f"compensator: {error}") from error

    @property
    def model(self) -> ModalModel:
        """``G_pb``, eq. (15)."""
        smd = self.physics.spring_mass_damper
        if smd is not None:
            return ModalModel.spring_mass_damper(smd.m, smd.c, smd.k, self.physics.dead_time)
        if self.physics.cascade is not None:
            return ModalModel.cascade(Cascade(**self.physics.cascade.values()), self.physics.dead_time)
        return ModalModel([Mode(**mode.values()) for mode in self.physics.mode], self.physics.dead_time)

    @property
    def plant_model(self) -> ModalModel:
        """Linear part of the plant: ``G_pb``, or an identified plant's own modes."""
        if isinstance(self.plant, IdentifiedSection) and self.plant.mode:
            return ModalModel([Mode(**mode.values()) for mode in self.plant.mode], self.physics.dead_time)
        return self.model

    @property
    def predictor_settings(self) -> PredictorSettings:
        """Settings of the predictor."""
        return PredictorSettings(**self.predictor, **self._sampling)

    @property
    def compensator_predictor(self) -> PredictorSettings:
        """Settings of the compensator's own predictor: the predictor's where the section has none.

        Its window is a tenth of the preview, :meth:`~hybridsep.base.settings.CompensatorSettings.window`, with as many
        of the predictor's lags as fit into it.
        """
        own, predictor = self._compensator_entries(PredictorSettings), self.predictor_settings
        Np = own.setdefault("Np", self._compensation().window(self.needed_preview, self.T_s))
        shorter = {"p": min(predictor.p, Np), "q": min(predictor.q, Np - 1)}
        return PredictorSettings(**{**self.predictor, **shorter, **own}, **self._sampling)

    @property
    def compensator_settings(self) -> CompensatorSettings:
        """Settings of the compensator, with the ``[drive_limits]`` if there are any."""
        return self._compensation().for_window(self.compensator_predictor.Np, self.needed_preview, self.T_s)

    def changed(
        self, section: Literal["", "predictor", "compensator", "plant"], values: Mapping[str, Any]
    ) -> "Machine":
        """Return a copy with other entries of a section, by their names in the file; ``""``: of the file itself.

        ParameterError if they are out of range or inconsistent.
        """
        check_kind(Mapping, values=values)
        if section:
            values = {section: {**self.table.get(section, {}), **values}}
        return machine_from_table({**self.table, **values})

    def check_section(self, name: Literal["plant", "limits", "drive_limits"], instead: str = "") -> None:
        """Raise MachineError if the file lacks a section, with what it is for, and a way without it, ``instead``."""
        if getattr(self, name) is None:
            raise MachineError(f"machine {self.name} has no [{name}], {_NEEDED[name]}{instead}")

    def new_predictor(self, settings: PredictorSettings | None = None) -> "HybridPredictor":
        """Return a predictor for this machine, with its :attr:`predictor_settings` unless others are given."""
        from ..predict.predictor import HybridPredictor

        return HybridPredictor(self.model, self.predictor_settings if settings is None else settings)

    def new_compensator(
        self,
        settings: CompensatorSettings | None = None,
        *,
        predictor: PredictorSettings | None = None,
        trained: "HybridPredictor | None" = None,
    ) -> "SepCompensator":
        """Return a compensator, by :attr:`compensator_settings` and :attr:`compensator_predictor` if left out.

        ``trained``: predictor of this machine, such as ``HybridPredictor.load("trained.state")`` that ``fit`` wrote,
        with whose weights it begins, without a warm-up; its windows may be others than the compensator's. StateError
        if it is another machine's, or has learned nothing.
        """
        from ..compensate.compensator import SepCompensator

        own = self.new_predictor(self.compensator_predictor if predictor is None else predictor)
        compensator = SepCompensator(own, self._compensation() if settings is None else settings)
        if trained is not None:
            own.begin_with(trained)
            compensator.restart()  # without a warm-up
        return compensator

    def new_plant(self, **changes: float | str) -> FeedDrive | StageDrive:
        """Return the plant; ``changes`` are values of its own section, such as ``c_nl`` or ``kappa``.

        MachineError if the file has no ``[plant]``, as for a recorded axis.
        """
        self.check_section("plant")
        assert self.plant is not None
        values = self.plant.values("kind", "noise_std", "seed", "mode")
        if unknown := changes.keys() - values:
            raise ParameterError(f"the plant has {', '.join(values)}, got {listed(sorted(unknown))}")
        values |= changes
        if isinstance(self.plant, FeedDriveSection):
            assert self.physics.spring_mass_damper is not None  # by check
            return FeedDrive(**self.physics.spring_mass_damper.values(), **values)
        if isinstance(self.plant, IdentifiedSection):
            values = {"input_hold": self.physics.input_hold, **values}
        return StageDrive(self.plant_model, **values, T_s=self.T_s)

    def fmi_parameters(self) -> dict[str, float | int | bool]:
        """Return the start values of the predictor FMU's scalar parameters, under their FMI names."""
        return {**self.predictor_settings.to_fmi(), "dead_time": self.physics.dead_time}

    def fmi_compensator_parameters(self) -> dict[str, float | int | bool]:
        """Return the start values of the compensator FMU's parameters; MachineError if they allow no planning."""
        self.check_section("drive_limits")
        predictor = self.compensator_predictor
        try:
            predictor.check_planning()
        except ParameterError as error:
            raise MachineError(
                f"machine {self.name}: {error}; set averaging = true or measurement_delay = 0 in [compensator]"
            ) from error
        return {**predictor.to_fmi(), **self.compensator_settings.to_fmi(), "dead_time": self.physics.dead_time}

    @cached_property
    def needed_preview(self) -> int:
        """Samples that the drive needs ahead."""
        return self.model.needed_preview(self.T_s, self.physics.input_hold)

    @property
    def _sampling(self) -> dict[str, Any]:
        return {"T_s": self.T_s, "input_hold": self.physics.input_hold}

    def _compensation(self) -> CompensatorSettings:
        limits, change_max = self.command_limits()
        own = self._compensator_entries(CompensatorSettings)
        if self.drive_limits is not None:
            own["following_error_max"] = self.drive_limits.following_error_max
        return CompensatorSettings(**own, limits=limits, change_max=change_max)

    def _compensator_entries(self, kind: type[Settings]) -> dict[str, Any]:
        """Return the entries of the compensator's section that are fields of one class of settings."""
        return {name: value for name, value in self.compensator.items() if name in kind.parameters()}

    def trajectory_limits(self) -> Limits:
        """Return the limits of the reference trajectory; MachineError if the file has no ``[limits]``."""
        self.check_section("limits")
        assert self.limits is not None
        return Limits(**self.limits.values())

    def command_limits(self) -> tuple[Limits | None, float | None]:
        """Return the drive's limits and the bound on the change of the command, m; None without ``[drive_limits]``."""
        if self.drive_limits is None:
            return None, None
        own = {name: getattr(self.drive_limits, name) for name in Limits.parameters()}
        return Limits(**own), self.drive_limits.change_max


def machine_names() -> list[str]:
    """Return the names of the bundled machines."""
    return sorted(path.stem for path in data_folder("models").glob("*.toml"))


def machine_path(machine: str | Path) -> Path:
    """Return the machine file of a path or of a bundled machine's name; MachineError if there is none."""
    path = as_path(machine, "machine")
    if path.is_file():
        return path
    if path.suffix == ".toml":
        raise MachineError(f"no machine {brief(str(machine))}: there is no such file")
    bundled = data_folder("models") / f"{machine}.toml"
    if not bundled.is_file():
        hint = f"; {path / 'machine.toml'} is there" if (path / "machine.toml").is_file() else ""
        raise MachineError(
            f"no machine {brief(str(machine))}: expected a .toml file or one of {', '.join(machine_names())}{hint}"
        )
    return bundled


def load_machine(machine: str | Path, changes: Iterable[str] = ()) -> Machine:
    """Read a machine file.

    ``machine``: path of a ``.toml`` file, or name of a bundled machine; ``changes``: entries with other values than the
    file's, each as ``predictor.p=20``; a word needs no quotes.

    MachineError if there is no such file, it is not TOML, or an entry is missing, unknown or out of range.
    """
    path = machine_path(machine)
    check_kind(Iterable, changes=changes)
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError) as error:  # an integer of 5000 digits is a ValueError, too
        raise MachineError(f"{path.name} is not valid TOML: {first_line(error)}") from error
    for change in changes:
        content = _with(content, _parsed(change))
    try:
        return machine_from_table(content)
    except ParameterError as error:
        raise MachineError(f"{path.name}: {error}") from error


def _parsed(change: str) -> dict[str, Any]:
    """Return the tables that ``ENTRY=VALUE`` stands for."""
    entry, equals, value = change.partition("=")
    for line in (change, f"{entry}={json.dumps(value.strip())}") if equals else ():
        try:
            return dict(tomllib.loads(line))
        except ValueError:
            continue
    raise MachineError(f"an entry is set as in predictor.p=20, got {brief(change)}")


def _with(table: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return tables with what changes in them."""
    both = [name for name, one in changes.items() if isinstance(one, Mapping) and isinstance(table.get(name), Mapping)]
    return {**table, **changes, **{name: _with(table[name], changes[name]) for name in both}}


def machine_from_table(content: Mapping[str, Any]) -> Machine:
    """Return the machine of a file's content, its tables as mappings; ParameterError if it is invalid."""
    problems: list[str] = []
    machine = read_section(Machine, content, "", problems)
    if machine is None:
        raise ParameterError(listed(problems, str, "; "))
    return machine


def check_unit(name: str, log: "Log", axis: Machine) -> None:
    """Raise ParameterError if a log states lengths for a rotary axis, or angles for a linear one."""
    if log.unit_stated and log.unit != axis.unit:
        raise ParameterError(
            f"{name} is in {log.unit}, but machine {axis.name} has unit = {axis.unit!r}; correct the machine file, or "
            "say the log's unit (--unit)"
        )


def machine_name(path: Path, axis: str | None = None) -> str:
    """Return a machine's name from the names of a log and of the axis that is read from it."""
    stem = path.with_suffix("") if path.suffix.lower() == ".gz" else path
    name = re.sub(r"[^A-Za-z0-9]+", "_", f"{stem.stem} {axis or ''}").strip("_")
    name = name if re.match(r"[A-Za-z]", name) else f"axis_{name}".rstrip("_")
    if not re.fullmatch(NAME_PATTERN, name):
        raise ParameterError(f"an axis's name must have at most 100 letters, the log's is {brief(name)}; give a --name")
    return name


def checked_name(name: str) -> str:
    """Return a machine's name; ParameterError if it cannot be one."""
    if isinstance(name, str) and re.fullmatch(NAME_PATTERN, name):
        return name
    raise ParameterError(f"name (--name) must be a letter, then at most 99 letters, digits and _, got {brief(name)}")


PAPER_SETTINGS: Mapping[str, Mapping[str, bool | float]] = {
    "spring_mass_damper": {"averaging": False, "t_init": 0.3},
    "als25010_x": {"averaging": False, "t_init": 0.297},
    "als25010_y": {"averaging": False, "t_init": 0.297},
    "emps": {"averaging": False, "t_init": 1.242},
}
"""By machine: the residual model of eqs. (5) and (6) as printed, and a warm-up, s, of 5 % of the trajectory."""


def paper_machine(name: str) -> Machine:
    """Return one of :data:`PAPER_SETTINGS`, whose predictor has the paper's settings; MachineError for another."""
    if name not in PAPER_SETTINGS:
        raise MachineError(f"the paper's machines are {', '.join(PAPER_SETTINGS)}, got {name!r}")
    return load_machine(name).changed("predictor", PAPER_SETTINGS[name])


# Writer ---------------------------------------------------------------------------------------------------------------


def machine_text(machine: Machine, comments: Iterable[str] = (), *, annotated: bool = False) -> str:
    """Return a machine file; :func:`load_machine` reads the same machine.

    ``comments`` are lines at its head; if it is ``annotated``, each entry says what it is, besides its unit.
    """
    head = [f"# {line}".rstrip() for comment in comments for line in comment.splitlines()]
    declared = {**PARAMETERS, **Limits.parameters()}
    words = {name: _words(one, machine.unit == "rad", annotated) for name, one in declared.items()}
    lines = _lines("", {**machine.table, "T_s": machine.T_s}, words, "")
    return "\n".join([*head, *lines]).strip("\n") + "\n"


def _lines(place: str, table: Mapping[str, Any], words: Mapping[str, str], heading: str) -> list[str]:
    """Return the lines of a table's own entries below its heading, then of the tables in it."""
    own, tables = [], []
    for name, value in table.items():
        inner = f"{place}.{name}" if place else name
        if isinstance(value, Mapping):
            tables += _lines(inner, value, words, f"[{inner}]")
        elif isinstance(value, list | tuple) and value and isinstance(value[0], Mapping):
            tables += [line for item in value for line in _lines(inner, item, words, f"[[{inner}]]")]
        else:
            line, said = f"{name} = {_value(value)}", words.get(name, "")
            own.append(f"{line:<32}# {said}" if said and "\n" not in line else line)
    return ["", heading, *own, *tables] if own and heading else [*own, *tables]


def _words(parameter: Parameter, rotary: bool, annotated: bool) -> str:
    """Return the unit of a parameter and, if it is annotated, its description."""
    unit = (angular_unit(parameter.unit) or "") if rotary else parameter.unit
    parts = [unit] if parameter.kind is float and unit != "1" else []
    return ", ".join([*parts, *([parameter.description] if annotated else [])])


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, list | tuple):
        return "[\n" + "".join(f"    {_value(item)},\n" for item in value) + "]" if value else "[]"
    return '"' + str(value).replace("\\", "\\\\").replace('"', '\\"') + '"'
