"""Sections of a machine file; their entries' ranges come from :mod:`hybridsep.base.settings`."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo, create_model, model_validator

from ..base.parameters import Parameter
from ..base.settings import PARAMETERS, CompensatorSettings, Limits, PredictorSettings, Settings

__all__ = [
    "CompensatorSection",
    "DriveLimitsSection",
    "Entries",
    "FeedDriveSection",
    "IdentifiedSection",
    "LimitsSection",
    "Line",
    "LogSection",
    "Number",
    "Physics",
    "PredictorSection",
    "Section",
    "SpringMassDamper",
    "StageSection",
]


_DECLARED = {**PARAMETERS, **Limits.parameters()}
"""Parameters by the names of their entries; a drive's and a trajectory's limits have the range of the compensator's."""


def _checked(value: Any, info: ValidationInfo) -> Any:
    """Check an entry against the parameter of its name."""
    name = str(info.field_name)
    return _DECLARED[name].checked(value, name)


Number = Annotated[float, BeforeValidator(_checked)]
Whole = Annotated[int, BeforeValidator(_checked)]

Line = Annotated[str, Field(pattern=r"^[^\x00-\x1f\x7f\x{FFFE}\x{FFFF}]+$")]
"""One line of printable text, of characters that XML 1.0 allows, for modelDescription and documentation."""


class Section(BaseModel):
    """Table of a machine file; unknown entries are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class ModeSection(Section):
    """One mode of eq. (15)."""

    f_n: Number
    zeta: Number
    alpha: Number
    beta: Number = 0.0


class SpringMassDamper(Section):
    """Eq. (11)."""

    m: Number
    c: Number
    k: Number


class Physics(Section):
    """``G_pb``: either ``[[physics.mode]]`` entries or one ``[physics.spring_mass_damper]``."""

    mode: tuple[ModeSection, ...] = ()
    spring_mass_damper: SpringMassDamper | None = None
    dead_time: Whole = PARAMETERS["dead_time"].default
    input_hold: Literal["zoh", "foh"] = "zoh"

    @model_validator(mode="after")
    def _one_of_both(self) -> Physics:
        if bool(self.mode) == (self.spring_mass_damper is not None):
            raise ValueError("give either [[physics.mode]] entries or one [physics.spring_mass_damper]")
        return self


def _validator(parameter: Parameter) -> BeforeValidator:
    def checked(value: Any) -> Any:
        return parameter.checked(value)

    return BeforeValidator(checked)


def _settings_section(settings: type[Settings], *, inherits: bool = False) -> dict[str, Any]:
    """Return pydantic fields for a section, by the names of the settings' fields.

    Parameters
    ----------
    settings : type of Settings
    inherits : bool
        Whether a missing entry is taken from another section.
    """
    entries: dict[str, Any] = {}
    for field, parameter in ((field, settings.parameters().get(field.name)) for field in fields(settings)):
        if parameter is not None and field.name not in settings.ELSEWHERE:
            default = None if inherits else field.default
            kind: Any = parameter.kind if default is not None else parameter.kind | None
            kind = Annotated[kind, _validator(parameter)]
            alias = None if parameter.name == field.name else parameter.name
            entries[field.name] = (kind, Field(default=default, alias=alias))
    return entries


class Entries(Section):
    """A section whose entries may be left out."""

    def given(self) -> dict[str, Any]:
        """Return the entries that the file has or that have a default, by the names of their fields."""
        return self.model_dump(exclude_none=True)


class _PredictorEntries(Entries):
    @model_validator(mode="after")
    def _lags_fit(self) -> _PredictorEntries:
        PredictorSettings(**self.given())
        return self


if TYPE_CHECKING:  # no checker of types follows create_model

    class PredictorSection(Entries):  # noqa: D101
        ...

    class CompensatorSection(Entries):  # noqa: D101
        ...

else:
    PredictorSection = create_model(
        "PredictorSection",
        __base__=_PredictorEntries,
        __doc__="Parameters of the hybrid predictor.",
        **_settings_section(PredictorSettings),
    )
    CompensatorSection = create_model(
        "CompensatorSection",
        __base__=Entries,
        __doc__="Parameters of the compensator; the predictor's count where they are left out.",
        **{**_settings_section(PredictorSettings, inherits=True), **_settings_section(CompensatorSettings)},
    )


class FeedDriveSection(Section):
    """The drive of eq. (13); its linear part is ``[physics.spring_mass_damper]``."""

    kind: Literal["feed_drive"]
    c_nl: Number = PARAMETERS["c_nl"].default
    k_nl: Number = PARAMETERS["k_nl"].default
    noise_std: Number = PARAMETERS["noise_std"].default
    seed: Whole = PARAMETERS["seed"].default


class StageSection(Section):
    """The stage: ``[[physics.mode]]`` with friction and cable stiffness on the command."""

    kind: Literal["stage"]
    f: Number = PARAMETERS["f"].default
    kappa: Number = PARAMETERS["kappa"].default
    friction_on: Literal["command", "motion"] = "command"
    noise_std: Number = PARAMETERS["noise_std"].default
    seed: Whole = PARAMETERS["seed"].default


class IdentifiedSection(Section):
    """A plant to try with, no measurement: modes, by default ``[physics]``'s, and the disturbances of a log."""

    kind: Literal["identified"]
    f: Number = PARAMETERS["f"].default
    kappa: Number = PARAMETERS["kappa"].default
    v_friction: Number = PARAMETERS["v_friction"].default
    noise_std: Number = PARAMETERS["noise_std"].default
    seed: Whole = PARAMETERS["seed"].default
    mode: tuple[ModeSection, ...] = ()


class LimitsSection(Section):
    """Velocity, acceleration and jerk of the reference trajectory, m/s, m/s², m/s³."""

    velocity: Number
    acceleration: Number
    jerk: Number


class DriveLimitsSection(LimitsSection):
    """Limits of the drive for the modified command, wider than the trajectory's; ``estimated``: from a log's motion."""

    change_max: Number = PARAMETERS["change_max"].default
    estimated: bool = False


class LogSection(Entries):
    """How a recorded log is read; as by :func:`hybridsep.logs.log.open_log` where an entry is left out."""

    t: str | None = None
    x_d: str | None = None
    x: str | None = None
    unit: str | None = None
    axis: str | None = None

    @property
    def columns(self) -> dict[str, str]:
        """Names of the columns by role."""
        return {name: value for name, value in self.given().items() if name in ("t", "x_d", "x")}
