"""Machine files: TOML description of one axis for the library, the FMUs and the command line, in SI units.

An invalid file is refused with a message that names the file, the entry, what was expected and what was found.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, ValidationError, model_validator

from ..base.data_files import data_folder
from ..base.errors import MachineError, ParameterError, brief, first_line, listed
from ..base.settings import PARAMETERS, CompensatorSettings, Limits, PredictorSettings, Settings
from ..model.physics import ModalModel, Mode
from ..plants.feed_drive import FeedDrive
from ..plants.plant import Drive
from ..plants.stage_drive import StageDrive
from .sections import (
    CompensatorSection,
    DriveLimitsSection,
    FeedDriveSection,
    IdentifiedSection,
    LimitsSection,
    Line,
    LogSection,
    Number,
    Physics,
    PredictorSection,
    Section,
    StageSection,
)
from .toml import read_toml

if TYPE_CHECKING:  # they load slowly, and whoever builds an FMU needs neither
    from ..compensate.compensator import SepCompensator
    from ..predict.predictor import HybridPredictor

__all__ = ["NAME_PATTERN", "Machine", "load_machine", "machine_from_table", "machine_names", "machine_path"]

NAME_PATTERN = r"^[A-Za-z][A-Za-z0-9_]{0,99}$"
"""Names of machines; they become parts of FMUs' names, of which importers make names of files."""

_PLACE_MAX = 60
"""Largest length of an entry's name in a message; the known ones are shorter."""


class Machine(Section):
    """One axis: identification, physics model, settings, plant if it has one; ``unit`` rad: every m stands for rad."""

    name: str = Field(pattern=NAME_PATTERN)
    title: Line
    sources: tuple[Line, ...] = Field(default=(), min_length=1)
    T_s: Number = PARAMETERS["T_s"].default
    unit: Literal["m", "rad"] = "m"
    physics: Physics
    predictor: PredictorSection = PredictorSection()
    compensator: CompensatorSection = CompensatorSection()
    plant: Annotated[FeedDriveSection | StageSection | IdentifiedSection, Field(discriminator="kind")] | None = None
    limits: LimitsSection | None = None
    drive_limits: DriveLimitsSection | None = None
    log: LogSection = LogSection()

    @model_validator(mode="after")
    def _plant_fits_physics(self) -> Machine:
        if isinstance(self.plant, FeedDriveSection) and self.physics.spring_mass_damper is None:
            raise ValueError("a plant of kind feed_drive needs [physics.spring_mass_damper]")
        if isinstance(self.plant, StageSection) and not self.physics.mode:
            raise ValueError("a plant of kind stage needs [[physics.mode]] entries")
        if isinstance(self.plant, FeedDriveSection | StageSection):
            kind = self.plant.kind
            if self.unit != "m":
                raise ValueError(f"a machine with a plant of kind {kind} must have unit = 'm': it is a linear axis")
            if self.physics.dead_time:
                raise ValueError(f"a machine with a plant of kind {kind} must have physics.dead_time = 0: it has none")
        if self.plant is not None:
            self.new_plant()  # raises if the combination is out of range
        _ = self.model  # raises if the mode of m, c and k is out of range
        return self

    @model_validator(mode="after")
    def _compensator_fits(self) -> Machine:
        if self.drive_limits is None and "compensator" not in self.model_fields_set:
            return self  # no compensator is configured
        problems, Np = [], self._entry("Np")
        for fit in (self._compensator_plans, lambda: self._compensation().for_window(Np)):
            try:
                fit()
            except ParameterError as error:
                problems.append(str(error))
        if problems:
            inherited = [name for name in ("Np", "p", "q") if getattr(self.compensator, name) is None]
            origin = f" ({', '.join(inherited)} of [predictor])" if inherited else ""
            raise ValueError(f"compensator: {'; '.join(problems)}{origin}")
        return self

    def _compensator_plans(self) -> None:
        """Raise ParameterError if the compensator's predictor is out of range, or cannot plan by its own entries.

        A delay of the predictor's is refused where a compensator is made: the file may be for a predictor alone.
        """
        settings = self.compensator_predictor
        if "measurement_delay" in self.compensator.given():
            settings.check_planning()

    @property
    def model(self) -> ModalModel:
        """``G_pb``, eq. (15)."""
        smd = self.physics.spring_mass_damper
        if smd is not None:
            return ModalModel.spring_mass_damper(smd.m, smd.c, smd.k, self.physics.dead_time)
        return ModalModel([Mode(**mode.model_dump()) for mode in self.physics.mode], self.physics.dead_time)

    @property
    def plant_model(self) -> ModalModel:
        """Linear part of the plant: ``G_pb``, or an identified plant's own modes."""
        if isinstance(self.plant, IdentifiedSection) and self.plant.mode:
            return ModalModel([Mode(**mode.model_dump()) for mode in self.plant.mode], self.physics.dead_time)
        return self.model

    @property
    def predictor_settings(self) -> PredictorSettings:
        """Settings of the predictor."""
        return PredictorSettings(**self.predictor.given(), **self._sampling)

    @property
    def compensator_predictor(self) -> PredictorSettings:
        """Settings of the compensator's own predictor: the predictor's where the section has none."""
        own = self._compensator_entries(PredictorSettings)
        return PredictorSettings(**{**self.predictor.given(), **own}, **self._sampling)

    @property
    def compensator_settings(self) -> CompensatorSettings:
        """Settings of the compensator, with the ``[drive_limits]`` if there are any."""
        return self._compensation().for_window(self.compensator_predictor.Np)

    def changed(self, section: Literal["predictor", "compensator"], values: Mapping[str, Any]) -> Machine:
        """Return a copy with other entries of a section, by their names in the file.

        Raises
        ------
        ParameterError
            If they are out of range or inconsistent.
        """
        table = self.model_dump(by_alias=True, exclude_unset=True)
        table[section] = {**table.get(section, {}), **values}
        return machine_from_table(table)

    def new_predictor(self, settings: PredictorSettings | None = None) -> HybridPredictor:
        """Return a predictor for this machine, with its :attr:`predictor_settings` unless others are given."""
        from ..predict.predictor import HybridPredictor

        return HybridPredictor(self.model, self.predictor_settings if settings is None else settings)

    def new_compensator(
        self, settings: CompensatorSettings | None = None, *, predictor: PredictorSettings | None = None
    ) -> SepCompensator:
        """Return a compensator for this machine.

        Parameters
        ----------
        settings : CompensatorSettings, optional
            :attr:`compensator_settings` if left out.
        predictor : PredictorSettings, optional
            :attr:`compensator_predictor` if left out.
        """
        from ..compensate.compensator import SepCompensator

        own = self.new_predictor(self.compensator_predictor if predictor is None else predictor)
        return SepCompensator(own, self._compensation() if settings is None else settings)

    def new_plant(self, **changes: float | str) -> Drive:
        """Return the plant; ``changes`` are values of its own section, such as ``c_nl`` or ``kappa``.

        Raises
        ------
        MachineError
            If the file has no ``[plant]``, as for a recorded axis.
        """
        if self.plant is None:
            raise MachineError(
                f"machine {self.name} has no [plant] section: it cannot be simulated, only its log replayed"
            )
        values = {**self.plant.model_dump(exclude={"kind", "noise_std", "seed", "mode"}), **changes}
        if isinstance(self.plant, FeedDriveSection):
            assert self.physics.spring_mass_damper is not None  # by _plant_fits_physics
            return FeedDrive(**self.physics.spring_mass_damper.model_dump(), **values)
        if isinstance(self.plant, IdentifiedSection):
            values = {"input_hold": self.physics.input_hold, **values}
        return StageDrive(self.plant_model, **values, T_s=self.T_s)

    def fmi_parameters(self) -> dict[str, float | int | bool]:
        """Return the start values of the predictor FMU's scalar parameters, under their FMI names."""
        return {**self.predictor_settings.to_fmi(), "dead_time": self.physics.dead_time}

    def fmi_compensator_parameters(self) -> dict[str, float | int | bool]:
        """Return the start values of the compensator FMU's scalar parameters, under their FMI names.

        Raises
        ------
        MachineError
            If the file has no ``[drive_limits]``, or the measurement is late without trust.
        """
        if self.drive_limits is None:
            raise MachineError(f"machine {self.name} has no [drive_limits] section, which a compensator FMU needs")
        predictor = self.compensator_predictor
        try:
            predictor.check_planning()
        except ParameterError as error:
            raise MachineError(
                f"machine {self.name}: {error}; set trust = true or measurement_delay = 0 in [compensator]"
            ) from error
        return {
            **predictor.to_fmi(),
            **self.compensator_settings.to_fmi(),
            "dead_time": self.physics.dead_time,
        }

    @property
    def _sampling(self) -> dict[str, Any]:
        return {"T_s": self.T_s, "input_hold": self.physics.input_hold}

    def _entry(self, name: str) -> Any:
        """Return an entry of the compensator's section, by default the predictor's."""
        own = getattr(self.compensator, name)
        return getattr(self.predictor, name) if own is None else own

    def _compensation(self) -> CompensatorSettings:
        limits, change_max = self.command_limits()
        own = self._compensator_entries(CompensatorSettings)
        return CompensatorSettings(**own, limits=limits, change_max=change_max)

    def _compensator_entries(self, kind: type[Settings]) -> dict[str, Any]:
        """Return the entries of the compensator's section that are fields of one class of settings."""
        names = kind.parameters()
        return {name: value for name, value in self.compensator.given().items() if name in names}

    def trajectory_limits(self) -> Limits:
        """Return the limits of the reference trajectory.

        Raises
        ------
        MachineError
            If the file has no ``[limits]``.
        """
        if self.limits is None:
            raise MachineError(f"machine {self.name} has no [limits] section")
        return Limits(**self.limits.model_dump())

    def command_limits(self) -> tuple[Limits | None, float | None]:
        """Return the drive's limits and the bound on the change of the command, m; None without ``[drive_limits]``."""
        if self.drive_limits is None:
            return None, None
        return Limits(**self.drive_limits.model_dump(exclude={"change_max", "estimated"})), self.drive_limits.change_max


def machine_names() -> list[str]:
    """Return the names of the bundled machines."""
    return sorted(path.stem for path in data_folder("models").glob("*.toml"))


def machine_path(machine: str | Path) -> Path:
    """Return the machine file of a path or of a bundled machine's name.

    Raises
    ------
    MachineError
        If there is none.
    """
    path = Path(machine)
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


def load_machine(machine: str | Path) -> Machine:
    """Read a machine file.

    Parameters
    ----------
    machine : str or Path
        Path of a ``.toml`` file, or name of a bundled machine.

    Raises
    ------
    MachineError
        If there is no such file, it is not TOML, or an entry is missing, unknown or out of range.
    """
    path = machine_path(machine)
    try:
        content = read_toml(path)
    except (ValueError, RecursionError) as error:  # an integer of 5000 digits is a ValueError, too
        raise MachineError(f"{path.name} is not valid TOML: {first_line(error)}") from error
    try:
        return machine_from_table(content)
    except ParameterError as error:
        raise MachineError(f"{path.name}: {error}") from error


def machine_from_table(content: Mapping[str, Any]) -> Machine:
    """Return the machine of a file's content, its tables as mappings; ParameterError if it is invalid."""
    try:
        return Machine(**content)
    except ValidationError as error:
        raise ParameterError(listed(error.errors(), _describe, "; ")) from error
    except TypeError as error:
        raise ParameterError(first_line(error)) from error


def _describe(problem: Any) -> str:
    """Return the message for one of pydantic's errors: entry, what was expected, what was found."""
    steps = [step for step in problem["loc"] if step not in ("feed_drive", "stage", "identified")]
    where = ""
    for step in steps:
        where += f"[{step + 1}]" if isinstance(step, int) else f".{step}" if where else str(step)
    where = where if len(where) <= _PLACE_MAX and where.isprintable() else brief(where)
    kind = problem["type"]
    if kind == "tuple_type" and where.endswith(".mode"):
        return f"{where} must be a list of modes: write [[{where}]], with double brackets"
    if kind == "union_tag_not_found":
        return f"{where}.kind is missing: feed_drive, stage or identified"
    if kind == "string_pattern_mismatch" and where != "name":
        return f"{where} must be one line of printable text that XML 1.0 allows, got {brief(problem['input'])}"
    if kind == "missing":
        return f"{where} is missing"
    if kind == "extra_forbidden":
        return f"{where} is not an entry of a machine file; check its spelling"
    if kind == "value_error":
        return f"{where}: {problem['ctx']['error']}" if where else str(problem["ctx"]["error"])
    return f"{where}: {problem['msg']}, got {brief(problem.get('input'))}"
