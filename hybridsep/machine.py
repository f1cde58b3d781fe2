"""Machine files: everything the library, the FMUs and the command line need to know of one axis, as TOML.

Values are SI. Ranges come from :data:`hybridsep.parameters.PARAMETERS`; a file that does not hold together is
refused with a message that names the file, the entry, what was expected and what came.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, ValidationInfo, model_validator

from .base.data_files import data_folder
from .base.errors import MachineError, ParameterError, brief
from .base.limits import Limits
from .base.parameters import INPUT_HOLDS, PARAMETERS, check, check_lags, check_preview
from .compensate.compensator import SepCompensator, SepState
from .model.physics import ModalModel, Mode
from .plants.plant import FeedDrive, Plant, StageDrive
from .predict.predictor import HybridPredictor

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = ["Machine", "load_machine", "machine_names", "machine_path"]


def _checked(value: Any, info: ValidationInfo) -> Any:
    """Check a field against the parameter of the same (FMI) name."""
    names = {"lam": "lambda", "Ts": "T_s"}
    name = str(info.field_name)
    return check(names.get(name, name), value)


def _checked_limit(value: Any, info: ValidationInfo) -> Any:
    """Check one of a drive's or a trajectory's limits against the range of the compensator's."""
    name = str(info.field_name)
    return check({"velocity": "v_max", "acceleration": "a_max", "jerk": "j_max"}[name], value, label=name)


Number = Annotated[float, BeforeValidator(_checked)]
Whole = Annotated[int, BeforeValidator(_checked)]
Limit = Annotated[float, BeforeValidator(_checked_limit)]
OptionalNumber = Annotated[float | None, BeforeValidator(_checked)]
OptionalWhole = Annotated[int | None, BeforeValidator(_checked)]
"""Given, or left out; there is no null in TOML."""


Line = Annotated[str, Field(pattern=r"^[^\x00-\x1f\x7f\x{FFFE}\x{FFFF}]+$")]
"""One line of printable text, of characters that XML 1.0 allows: the modelDescription and the FMU's page have it."""


def _default(name: str) -> Any:
    return PARAMETERS[name].default


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ModeSection(_Section):
    """One mode of eq. (15)."""

    f_n: Number
    zeta: Number
    alpha: Number
    beta: Number = 0.0


class SpringMassDamper(_Section):
    """Eq. (11)."""

    m: Number
    c: Number
    k: Number


class Physics(_Section):
    """``G_pb``: either ``[[physics.mode]]`` entries or one ``[physics.spring_mass_damper]``."""

    mode: tuple[ModeSection, ...] = ()
    spring_mass_damper: SpringMassDamper | None = None
    dead_time: Whole = _default("dead_time")
    input_hold: Literal["zoh", "foh"] = "zoh"

    @model_validator(mode="after")
    def _one_of_both(self) -> Physics:
        if bool(self.mode) == (self.spring_mass_damper is not None):
            raise ValueError("give either [[physics.mode]] entries or one [physics.spring_mass_damper]")
        return self


class PredictorSection(_Section):
    """Parameters of the hybrid predictor."""

    Np: Whole = _default("Np")
    p: Whole = _default("p")
    q: Whole = _default("q")
    lam: Number = Field(default=_default("lambda"), alias="lambda")
    t_init: Number = _default("t_init")

    @model_validator(mode="after")
    def _lags_fit(self) -> PredictorSection:
        if problems := check_lags(Np=self.Np, p=self.p, q=self.q):
            raise ValueError("; ".join(problems))
        return self


class CompensatorSection(_Section):
    """Parameters of the compensator; the predictor's count where ``Np``, ``p``, ``q``, λ or ``t_init`` is left out."""

    Np: OptionalWhole = None
    p: OptionalWhole = None
    q: OptionalWhole = None
    lam: OptionalNumber = Field(default=None, alias="lambda")
    t_init: OptionalNumber = None
    preview: OptionalWhole = None
    spacing: OptionalWhole = None
    jerk_weight: Number = _default("jerk_weight")
    v_s: Number = _default("v_s")
    keep_direction: Whole = _default("keep_direction")


class FeedDriveSection(_Section):
    """The drive of eq. (13); its linear part is ``[physics.spring_mass_damper]``."""

    kind: Literal["feed_drive"]
    c_nl: Number = _default("c_nl")
    k_nl: Number = _default("k_nl")
    noise_std: Number = _default("noise_std")
    seed: Whole = _default("seed")


class StageSection(_Section):
    """The stage: ``[[physics.mode]]`` with friction and cable stiffness on the command."""

    kind: Literal["stage"]
    f: Number = _default("f")
    kappa: Number = _default("kappa")
    noise_std: Number = _default("noise_std")
    seed: Whole = _default("seed")


class LimitsSection(_Section):
    """Velocity, acceleration and jerk of the reference trajectory, m/s, m/s², m/s³."""

    velocity: Limit
    acceleration: Limit
    jerk: Limit


class DriveLimitsSection(LimitsSection):
    """What the drive itself allows of a modified command, wider than the trajectory's limits."""

    change_max: Number = _default("change_max")


class LogSection(_Section):
    """Names of a recorded log's columns."""

    t: str = "t"
    x_d: str = "x_d"
    x: str = "x"


class Machine(_Section):
    """One axis: what it is, its physics model, the predictor's parameters and, where there is one, its plant."""

    name: str = Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")
    title: Line
    sources: tuple[Line, ...] = Field(min_length=1)
    T_s: Number = _default("T_s")
    physics: Physics
    predictor: PredictorSection = PredictorSection()
    compensator: CompensatorSection = CompensatorSection()
    plant: Annotated[FeedDriveSection | StageSection, Field(discriminator="kind")] | None = None
    limits: LimitsSection | None = None
    drive_limits: DriveLimitsSection | None = None
    log: LogSection = LogSection()

    @model_validator(mode="after")
    def _plant_fits_physics(self) -> Machine:
        if isinstance(self.plant, FeedDriveSection) and self.physics.spring_mass_damper is None:
            raise ValueError("a plant of kind feed_drive needs [physics.spring_mass_damper]")
        if isinstance(self.plant, StageSection) and not self.physics.mode:
            raise ValueError("a plant of kind stage needs [[physics.mode]] entries")
        if self.plant is not None and self.physics.dead_time:
            raise ValueError("a machine with a plant must have physics.dead_time = 0: the plants have none")
        if self.plant is not None:
            self.new_plant()  # says what is out of range together
        return self

    @model_validator(mode="after")
    def _physics_makes_modes(self) -> Machine:
        _ = self.model  # says which mode of m, c and k is out of range
        return self

    @model_validator(mode="after")
    def _compensator_fits(self) -> Machine:
        if self.drive_limits is None and "compensator" not in self.model_fields_set:
            return self  # no compensator is meant
        values = self._compensation()
        problems = check_lags(**{name: values[name] for name in ("Np", "p", "q")})
        problems += check_preview(**{name: values[name] for name in ("Np", "preview", "spacing")})
        if problems:
            inherited = [name for name in ("Np", "p", "q") if getattr(self.compensator, name) is None]
            origin = f" ({', '.join(inherited)} of [predictor])" if inherited else ""
            raise ValueError(f"compensator: {'; '.join(problems)}{origin}")
        return self

    @property
    def model(self) -> ModalModel:
        """``G_pb``, eq. (15)."""
        smd = self.physics.spring_mass_damper
        if smd is not None:
            return ModalModel.spring_mass_damper(smd.m, smd.c, smd.k, self.physics.dead_time)
        return ModalModel([Mode(**mode.model_dump()) for mode in self.physics.mode], self.physics.dead_time)

    def new_predictor(self, **changes: Any) -> HybridPredictor:
        """Return a predictor for this machine; ``changes`` are arguments of :class:`HybridPredictor`."""
        return HybridPredictor(
            self.model,
            **{"Ts": self.T_s, "input_hold": self.physics.input_hold, **self.predictor.model_dump(), **changes},
        )

    def new_compensator(self, best: SepState = SepState.HYBRID, **changes: Any) -> SepCompensator:
        """Return a compensator for this machine, within its ``[drive_limits]`` if it has some.

        Parameters
        ----------
        best : SepState
            Best model to use.
        **changes
            Arguments of :class:`SepCompensator`, or of :class:`HybridPredictor` for its predictor.
        """
        limits, change_max = self.command_limits()
        own = ("preview", "spacing", "jerk_weight", "limits", "change_max", "keep_direction")
        values = {"limits": limits, "change_max": change_max, **self._compensation(**changes)}
        predictor = self.new_predictor(**{name: value for name, value in values.items() if name not in own})
        return SepCompensator(predictor, best=best, **{name: values[name] for name in own})

    def new_plant(self, **changes: float) -> Plant:
        """Return the nonlinear plant; ``changes`` are values of its own section, such as ``c_nl`` or ``kappa``.

        Raises
        ------
        MachineError
            If the file describes none: a recorded axis has only its log.
        """
        if self.plant is None:
            raise MachineError(
                f"machine {self.name} has no [plant] section; only a recorded log can show its nonlinearity"
            )
        values = {**self.plant.model_dump(exclude={"kind", "noise_std", "seed"}), **changes}
        if isinstance(self.plant, FeedDriveSection):
            assert self.physics.spring_mass_damper is not None  # by _plant_fits_physics
            return FeedDrive(**self.physics.spring_mass_damper.model_dump(), **values)
        return StageDrive(self.model, **values, Ts=self.T_s)

    def fmi_parameters(self) -> dict[str, float | int]:
        """Return the start values of the predictor FMU's scalar parameters, under their FMI names."""
        return {**self.predictor.model_dump(by_alias=True), **self._fmi_physics()}

    def fmi_compensator_parameters(self) -> dict[str, float | int]:
        """Return the start values of the compensator FMU's scalar parameters, under their FMI names.

        Raises
        ------
        MachineError
            If the file has no ``[drive_limits]``: without them there is no such FMU.
        """
        limits, change_max = self.command_limits()
        if limits is None or change_max is None:
            raise MachineError(f"machine {self.name} has no [drive_limits] section, which a compensator FMU needs")
        values = self._compensation()
        values["lambda"] = values.pop("lam")
        bounds = {"v_max": limits.velocity, "a_max": limits.acceleration, "j_max": limits.jerk}
        more = {"change_max": change_max, "compensate": _default("compensate")}
        return {**values, **self._fmi_physics(), **bounds, **more}

    def _fmi_physics(self) -> dict[str, float | int]:
        hold = INPUT_HOLDS.index(self.physics.input_hold)
        return {"T_s": self.T_s, "input_hold": hold, "dead_time": self.physics.dead_time}

    def _compensation(self, **changes: Any) -> dict[str, Any]:
        """Return the predictor's and the compensator's parameters, by the library's names.

        Where they are left out, ``spacing`` and ``preview`` fit ``Np``, if a preview in its range does.
        """
        section = self.compensator.model_dump(exclude_none=True)
        values = {**self.predictor.model_dump(), **section, **changes}
        values.setdefault("spacing", 1 if values["Np"] % _default("spacing") else _default("spacing"))
        values.setdefault("preview", min(max(2 * values["Np"], _default("preview")), PARAMETERS["preview"].maximum))
        return values

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
        """Return the drive's own limits and the bound on a command's change, m; None without ``[drive_limits]``."""
        if self.drive_limits is None:
            return None, None
        return Limits(**self.drive_limits.model_dump(exclude={"change_max"})), self.drive_limits.change_max


def machine_names() -> list[str]:
    """Return the names of the machines that come with the library."""
    return sorted(path.stem for path in data_folder("models").glob("*.toml"))


def machine_path(machine: str | Path) -> Path:
    """Return the machine file of a path or of a name that comes with the library.

    Raises
    ------
    MachineError
        If there is none.
    """
    path = Path(machine)
    if path.suffix != ".toml" and not path.is_file():
        path = data_folder("models") / f"{machine}.toml"
    if not path.is_file():
        raise MachineError(f"no machine {str(machine)!r}: expected a .toml file or one of {', '.join(machine_names())}")
    return path


def load_machine(machine: str | Path) -> Machine:
    """Read a machine file.

    Parameters
    ----------
    machine : str or Path
        Path of a ``.toml`` file, or the name of one that comes with the library.

    Raises
    ------
    MachineError
        If there is no such file, it is not TOML, or an entry is missing, unknown or out of range.
    """
    path = machine_path(machine)
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:  # an integer of 5000 digits is a ValueError, too
        raise MachineError(f"{path.name} is not valid TOML: {error}") from error
    try:
        return Machine(**content)
    except ValidationError as error:
        problems = "; ".join(_describe(problem) for problem in error.errors())
        raise MachineError(f"{path.name}: {problems}") from error
    except (ParameterError, TypeError) as error:
        raise MachineError(f"{path.name}: {error}") from error


def _describe(problem: Any) -> str:
    """Say one of pydantic's findings in our words: where, what was expected, what came."""
    steps = [step for step in problem["loc"] if step not in ("feed_drive", "stage")]
    where = ""
    for step in steps:
        where += f"[{step + 1}]" if isinstance(step, int) else f".{step}" if where else str(step)
    kind = problem["type"]
    if kind == "tuple_type" and where.endswith(".mode"):
        return f"{where} must be a list of modes: write [[{where}]], with double brackets"
    if kind == "union_tag_not_found":
        return f"{where}.kind is missing: feed_drive or stage"
    if kind == "string_pattern_mismatch" and where != "name":
        return f"{where} must be one line of printable text that XML 1.0 allows, got {brief(problem['input'])}"
    if kind == "missing":
        return f"{where} is missing"
    if kind == "extra_forbidden":
        return f"{where} is not an entry of a machine file; check its spelling"
    if kind == "value_error":
        return f"{where}: {problem['ctx']['error']}" if where else str(problem["ctx"]["error"])
    return f"{where}: {problem['msg']}, got {brief(problem.get('input'))}"
