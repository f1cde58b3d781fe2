"""Declarations of all parameters: settings of predictor and compensator, and quantities of machines.

The library's checks, the machine files' entries, the FMUs' variables, the saved states, the check of a warm start, the
command line's help and the C core's settings are derived from here. Joint constraints are from section 2 of the
paper: ``0 ≤ q < Np`` and ``1 ≤ p ≤ Np``.

The ranges of physical quantities are a few powers of ten wider than any feed drive needs, and narrow enough that no
arithmetic on them overflows: the largest response to a position of 1 km, by the slowest mode with the largest gain and
the least damping, is below 1e30 m, and the smallest divisor, a limit as a difference of samples, is 1e-21 m.
"""

import math
from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, fields, replace
from functools import cache
from typing import Any, ClassVar, TypeVar

from .errors import ParameterError, brief
from .parameters import Parameter, choice, flag, real, whole

_SPLINES = 120  # largest length of a plan that goes on after the preview, in spacings: its solver's work is their cube
_PLAN_MAX = 2000  # longest plan, samples

PLAN_END = 3  # samples without change at the end of a compensator's plan, so that the third difference is zero after it

_SettingsType = TypeVar("_SettingsType", bound="Settings")


@dataclass(frozen=True)
class Settings:
    """Group of parameters, validated on construction; what is declared of each ends the docstring of its class.

    ParameterError naming every parameter that is out of range, or the joint constraints that are violated.
    """

    OPTIONAL: ClassVar[tuple[str, ...]] = ()  # fields that may be None
    LABEL: ClassVar[str] = ""  # name of a field in messages; its parameter's if it is empty

    ELSEWHERE: ClassVar[tuple[str, ...]] = ()  # fields that are no entries of its own section of a machine file
    PARTS: ClassVar[Mapping[str, type["Settings"]]] = {}  # fields that are settings themselves, or None

    def __init_subclass__(cls) -> None:
        declared = {name: one.metadata["parameter"] for name, one in vars(cls).items() if isinstance(one, Field)}
        lines = [f"{name} : {one.kind.__name__}\n        {one.help}." for name, one in declared.items()]
        cls.__doc__ = "\n    ".join([f"{(cls.__doc__ or '').rstrip()}\n\n    Attributes", "----------", *lines])

    def __post_init__(self) -> None:
        problems = []
        for name, parameter in self.parameters().items():
            value = getattr(self, name)
            if value is None and name in self.OPTIONAL:
                continue
            try:
                object.__setattr__(self, name, parameter.checked(value, self.LABEL.format(name) or None))
            except ParameterError as error:
                problems.append(str(error))
        problems = problems or self._misfits()
        if problems:
            raise ParameterError("; ".join(problems))

    @classmethod
    @cache  # every settings object asks for them when it is checked
    def parameters(cls) -> dict[str, Parameter]:
        """Return the parameters by the names of their fields."""
        declared = {one.name: one.metadata["parameter"] for one in fields(cls) if "parameter" in one.metadata}
        return {name: replace(one, name=one.name or name) for name, one in declared.items()}

    @classmethod
    def fmi_parameters(cls) -> dict[str, Parameter]:
        """Return the parameters, nested settings included, by their names in FMUs."""
        found = {name: {one.name: one} for name, one in cls.parameters().items()}
        found |= {name: part.fmi_parameters() for name, part in cls.PARTS.items()}
        return {name: one for field in fields(cls) for name, one in found[field.name].items()}

    @classmethod
    def from_fmi(cls: type[_SettingsType], values: Mapping[str, Any]) -> _SettingsType:
        """Return the settings from the values of an FMU's variables by name; missing ones have their defaults.

        ParameterError naming every value that is out of range.
        """
        given, problems = {}, []
        for name, parameter in cls.fmi_parameters().items():
            if name in values:
                try:
                    given[name] = parameter.checked(parameter.from_fmi(values[name]))
                except ParameterError as error:
                    problems.append(str(error))
        if problems:
            raise ParameterError("; ".join(problems))
        return cls._from_checked(given)

    @classmethod
    def _from_checked(cls: type[_SettingsType], values: Mapping[str, Any]) -> _SettingsType:
        own = {name: values[one.name] for name, one in cls.parameters().items() if one.name in values}
        return cls(**own, **{name: part._from_checked(values) for name, part in cls.PARTS.items()})

    def to_fmi(self) -> dict[str, float | int | bool]:
        """Return the values of an FMU's variables, without fields that are None."""
        found = {parameter.name: (parameter, getattr(self, name)) for name, parameter in self.parameters().items()}
        own = {name: parameter.to_fmi(value) for name, (parameter, value) in found.items() if value is not None}
        parts = filter(None, (getattr(self, name) for name in self.PARTS))
        return own | {name: value for part in parts for name, value in part.to_fmi().items()}

    @classmethod
    def from_table(cls: type[_SettingsType], table: Mapping[str, Any]) -> _SettingsType:
        """Return the settings of plain values, as of ``asdict``; ParameterError if one is missing or out of range."""
        names = [field.name for field in fields(cls)]
        if not isinstance(table, Mapping) or sorted(table) != sorted(names):
            raise ParameterError(f"settings must be {', '.join(names)}, got {brief(table)}")
        parts = {name: part.from_table(table[name]) for name, part in cls.PARTS.items() if table[name] is not None}
        return cls(**{**table, **parts})

    def _misfits(self) -> list[str]:
        """Return a message for each joint constraint that is violated."""
        return []


@dataclass(frozen=True, kw_only=True)
class PredictorSettings(Settings):
    """Parameters of the hybrid predictor, eqs. (3) to (6).

    ``1 ≤ p ≤ Np`` and ``0 ≤ q < Np``; ``lam`` is λ of eq. (6), ``lambda`` in FMUs and machine files. With ``averaging``
    the residual model is :class:`~hybridsep.predict.averaging.model.AveragedModel`, else the paper's. What arrives
    at ``k`` is ``x(k − measurement_delay)``: a compensator's predictor needs averaging for it, and a position that
    comes early, −1, is held for one sample.
    """

    AVERAGING: ClassVar[tuple[str, ...]] = ("averaging", "effect", "noise_std", "forgetting", "period", "recall")
    """Fields of the residual model with averaging."""

    KNOWN: ClassVar[tuple[str, ...]] = ("period", "measurement_delay")  # known of an axis, and not fitted to a log

    ELSEWHERE: ClassVar[tuple[str, ...]] = ("T_s", "input_hold")

    Np: int = whole(100, 1, 100_000, "samples in a look-ahead window")
    p: int = whole(
        *(50, 1, 5000, "number of past residuals e_pb (measured minus physics-based position) among the features"),
        learned=True,
    )
    q: int = whole(3, 0, 5000, "number of past physics-based predictions x_pb among the features", learned=True)
    lam: float = real(
        1e-12, 1e-40, 1e12, "m2", "ridge penalty on the weights of the residual model", name="lambda", learned=True
    )
    T_s: float = real(
        1e-3, 1e-5, 1.0, "s", "sampling interval of command and measurement", display_unit="ms", learned=True
    )
    t_init: float = real(
        *(-1.0, 0.0, 1e6, "s"),
        "warm-up: until then the prediction x_h is the physics-based x_pb, while learning goes on",
        automatic=-1.0,
    )
    input_hold: str = choice(
        "zoh",
        {"zoh": "zero-order hold: constant until the next sample", "foh": "first-order hold: a straight line to it"},
        "how the command x_d runs between samples, zero-order or first-order hold",
        learned=True,
    )
    averaging: bool = flag(
        True, "whether the residual is predicted by online model averaging; false: by the paper's model", learned=True
    )
    effect: float = real(
        *(0.0, 0.0, 10.0, "m", "prior standard deviation of a feature's effect, with averaging; 0: from the residuals"),
        display_unit="um",
        nonzero=1e-15,
    )
    noise_std: float = real(
        *(0.0, 0.0, 1.0, "m", "standard deviation of the measurement noise, with averaging; 0: estimated"),
        display_unit="um",
        nonzero=1e-15,
    )
    forgetting: float = real(
        *(0.0, 0.0, 1e9, "s", "time after which samples have lost 63 % of their weight, with averaging; 0: never"),
        nonzero=1e-3,
    )
    period: float = real(
        *(0.0, 0.0, 100.0, "m"),
        "period of a disturbance that repeats with the position (cogging, screw pitch), with averaging; 0: none",
        display_unit="mm",
        nonzero=1e-9,
        learned=True,
    )
    recall: int = whole(
        *(8192, 0, 1_000_000),
        "samples that are remembered, to predict a repeated motion by what was measured then, with averaging; 0: none",
    )
    measurement_delay: int = whole(
        0, -1, 10_000, "whole samples by which the measured position is late; −1: early, under a sequential master"
    )

    @property
    def warm_up(self) -> float:
        """Warm-up, s: ``t_init``, or where that is automatic none with averaging and 0.3 s without."""
        automatic = 0.0 if self.averaging else 0.3
        return automatic if self.t_init < 0.0 else self.t_init

    @property
    def n_late(self) -> int:
        """Samples that are not measured yet when a window begins: the ``measurement_delay`` where it is positive."""
        return max(0, self.measurement_delay)

    def check_planning(self) -> None:
        """Raise ParameterError if no compensator can plan with these settings: a late measurement needs averaging."""
        if self.n_late and not self.averaging:
            raise ParameterError(
                f"measurement_delay of a compensator must be 0 with averaging = false, got {self.measurement_delay}: "
                "only the model with averaging plans from a late measurement"
            )

    def check_replay(self) -> None:
        """Raise ParameterError if no log can be replayed with these settings: a log's measurements are never early."""
        if self.measurement_delay < 0:
            raise ParameterError(
                f"measurement_delay must be 0 or more to replay a log, got {self.measurement_delay}, which is for FMUs "
                "under a sequential co-simulation master; give --measurement_delay 0"
            )

    def _misfits(self) -> list[str]:
        problems = []
        if not self.p <= self.Np:
            problems.append(f"p must be 1 … Np = {self.Np}, got {self.p}; lower p or raise Np")
        if not self.q < self.Np:
            problems.append(f"q must be 0 … Np − 1 = {self.Np - 1}, got {self.q}; lower q or raise Np")
        return problems


@dataclass(frozen=True)
class Limits(Settings):
    """Kinematic limits; ``v_max``, ``a_max`` and ``j_max`` in FMUs."""

    LABEL = "the {} limit"

    velocity: float = real(
        *(0.1, 1e-9, 1e4, "m/s", "largest velocity of the modified command"),
        name="v_max",
        display_unit="mm/s",
        unless_given=MISSING,
    )
    acceleration: float = real(
        *(16.0, 1e-6, 1e6, "m/s2", "largest acceleration of the modified command"), name="a_max", unless_given=MISSING
    )
    jerk: float = real(
        *(5000.0, 1e-6, 1e12, "m/s3", "largest jerk of the modified command"), name="j_max", unless_given=MISSING
    )


@dataclass(frozen=True, kw_only=True)
class Cascade(Settings):
    """Gains of a proportional position loop around a (proportional-integral) velocity loop, with velocity feed-forward.

    Of a linear axis in N and m, of a rotary one in N·m and rad; a torque constant is part of ``Kv``. ``inertia``,
    ``Kp`` and ``Kv`` have to be given.
    """

    inertia: float = real(None, 1e-9, 1e9, "1", "moving mass, kg, or inertia, kg·m²")
    Kp: float = real(None, 1e-3, 1e6, "1/s", "gain of the position loop")
    Kv: float = real(None, 1e-9, 1e12, "1", "force of a velocity error, N·s/m, or torque, N·m·s/rad")
    Tv: float = real(0.0, 0.0, 1e3, "s", "integral time of the velocity loop; 0: it has no integrator")
    feed_forward: float = real(0.0, 0.0, 2.0, "1", "share of the commanded velocity that is fed forward")
    viscous: float = real(0.0, 0.0, 1e9, "1", "viscous friction, N·s/m or N·m·s/rad")


@dataclass(frozen=True, kw_only=True)
class CompensatorSettings(Settings):
    """Parameters of the compensator, besides its predictor's.

    What is left out is in the drive's time: ``preview`` is what its model needs to follow
    (:meth:`~hybridsep.model.physics.ModalModel.needed_preview`), ``spacing`` a hundredth of a plan, or a smaller
    divisor of ``Np``. The differences of ``x_dm`` keep the drive's ``limits``, if there are any; where those of ``x_d``
    do not, by what these take more. ``no_reversal`` has no effect without them; with ``averaging`` it bounds the
    physics model's plan only in the hybrid's stead. ``change_max``, None for no bound, is about twice the servo error
    without compensation; ``following_error_max`` about 1.3 times the largest one
    (:class:`~hybridsep.online.monitor.Monitor`). With ``averaging`` a hybrid plan of motion more than 1.25 times as
    fast as what was learned changes the command by at most half of ``change_max``, and so does the physics model's,
    unless weights of earlier runs judge it.
    """

    OPTIONAL: ClassVar[tuple[str, ...]] = ("preview", "spacing", "change_max", "horizon")
    ELSEWHERE: ClassVar[tuple[str, ...]] = ("limits", "change_max", "following_error_max")
    PARTS: ClassVar[Mapping[str, type[Settings]]] = {"limits": Limits}

    preview: int | None = whole(
        *(200, 8, _PLAN_MAX, "samples of the command that are planned ahead, at least Np + 4·spacing + 3"),
        unless_given=None,
    )
    spacing: int | None = whole(
        *(2, 1, 1000, "samples between the knots of the spline that changes the command, a divisor of Np"),
        unless_given=None,
    )
    jerk_weight: float = real(
        1.0, 0.0, 1e12, "1", "weight of the jerk of the command's change against the tracking error"
    )
    limits: Limits | None = None
    change_max: float | None = real(
        1e-3, 1e-12, 10.0, "m", "largest change of the command", display_unit="mm", tunable=True
    )
    following_error_max: float = real(
        *(0.0, 0.0, 10.0, "m"),
        "following error, or its geometric mean with that from x_dm, at which compensation ends; 0: none",
        display_unit="mm",
        nonzero=1e-12,
        tunable=True,
    )
    no_reversal: bool = flag(True, "whether plans of a linear model keep x_dm from turning while x_d moves")
    compensate: str = choice(
        "hybrid",
        {
            "off": "none: the command is not modified",
            "physics": "the physics-based model",
            "hybrid": "the hybrid model",
        },
        "best model to compensate with",
        tunable=True,
    )
    measurement_timeout: float = real(
        *(1.0, 0.0, 1e4, "s", "time without a measurement after which the command's change fades; 0: never"),
        nonzero=1e-5,
    )
    horizon: int | None = whole(
        *(0, 0, _PLAN_MAX, "samples of a plan: after the preview the command is taken to go on at its last velocity"),
        unless_given=None,
    )

    def plan(self, needed: int, T_s: float) -> int:
        """Return the samples of a plan for a drive that needs ``needed``, of ``T_s``, s.

        A plan is back at the command at its end. Where the limits need more than half of it to take back the error of
        an axis that lags, half of ``change_max``, it is longer by what they need, and twice as long at most.
        """
        if self.limits is None or self.change_max is None:
            return needed
        change, own = 0.5 * self.change_max, self.limits
        fastest = change / own.velocity, 2 * math.sqrt(change / own.acceleration), (32 * change / own.jerk) ** (1 / 3)
        back = math.ceil(min(max(fastest) / T_s, needed))
        return min(needed + back, _PLAN_MAX) if 2 * back > needed else needed

    def window(self, needed: int, T_s: float) -> int:
        """Return the samples of a window: a tenth of the preview, which is ``needed`` samples if left out.

        It is a multiple of ``spacing``, and at least 20, a tenth of what the drive needs or a third of a short preview,
        whichever is least: a controller plans in half of it, and its lags serve a predictor with longer windows, too.
        """
        preview, spacing = self.preview or needed, self.spacing or self._spacing(needed, T_s)
        most = max(1, (preview - 4 * spacing - PLAN_END) // spacing)
        return spacing * min(most, math.ceil(max(min(20, needed / 10, preview / 3), preview / 10) / spacing))

    def _spacing(self, needed: int, T_s: float) -> int:
        """Return a hundredth of a plan, or a twentieth of a preview that is much shorter."""
        preview = self.preview or needed
        return max(1, min(round(max(preview, self.plan(needed, T_s)) / 100), preview // 20))

    def for_window(self, Np: int, needed: int, T_s: float) -> "CompensatorSettings":
        """Return these settings for windows of ``Np`` samples, defaults filled in.

        A ``preview`` that is left out follows from ``needed``, the samples that the drive needs.

        ParameterError if ``preview`` or ``spacing`` does not fit ``Np``.
        """
        spacing, preview = self.spacing, self.preview
        if spacing is None:
            most = self._spacing(needed, T_s)
            if preview is not None:
                most = max(1, min(most, (preview - Np - PLAN_END) // 4))
            spacing = max(one for one in range(1, most + 1) if Np % one == 0)
        if preview is None:  # enough after a window that is longer than a tenth of it, too
            preview = min(max(needed, Np + needed * 3 // 4, Np + 4 * spacing + PLAN_END), _PLAN_MAX)
        problems = []
        if Np % spacing:
            problems.append(f"spacing must be ≥ 1 and divide Np = {Np}, got {spacing}")
        least = Np + 4 * spacing + PLAN_END
        if preview < least:
            problems.append(f"preview must be ≥ Np + 4·spacing + {PLAN_END} = {least}, got {preview}")
        if problems:
            raise ParameterError("; ".join(problems))
        # After the window, and what the next one leaves as it is, a stop has to fit into the preview
        fits = preview >= Np + Np // 2 + 5 * spacing + PLAN_END
        horizon = min(self.plan(needed, T_s), _SPLINES * spacing) if self.horizon is None else self.horizon
        return replace(self, spacing=spacing, preview=preview, horizon=max(preview, horizon if fits else 0))


_OTHERS = (
    whole(0, 0, 100_000, "whole samples of dead time in the physics model", name="dead_time", learned=True),
    # One mode of eq. (15).
    real(None, 1e-3, 1e5, "Hz", "natural frequency of the mode", name="f_n", learned=True),
    real(None, 1e-6, 1e4, "1", "damping ratio of the mode", name="zeta", learned=True),
    real(
        *(None, -1e15, 1e15, "1/s2", "numerator of the mode's transfer function, constant term"),
        name="alpha",
        learned=True,
    ),
    real(None, -1e10, 1e10, "1/s", "numerator of the mode's transfer function, factor of s", name="beta", learned=True),
    # The nonlinear drive of eq. (13).
    real(None, 1e-6, 1e6, "kg", "moving mass of the drive", name="m"),
    real(None, 1e-9, 1e12, "N.s/m", "damping of the drive, force per velocity relative to the command", name="c"),
    real(None, 1e-6, 1e15, "N/m", "stiffness of the drive, force per distance from the command", name="k"),
    real(0.0, 0.0, 1e12, "N.s2/m2", "quadratic damping of the drive, force c_nl·v·|v|", name="c_nl"),
    real(0.0, 0.0, 1e15, "N/m2", "quadratic stiffness of the drive, force k_nl·x·|x|", name="k_nl"),
    # The stage's disturbance and the encoder.
    real(0.0, 0.0, 1.0, "m", "friction of the carriage, as an offset of the command", name="f", display_unit="um"),
    real(0.0, 0.0, 1e6, "1/m", "cable stiffness, an offset kappa·x·|x| of the command", name="kappa"),
    choice(
        "command",
        {"command": "the commanded velocity", "motion": "the actual velocity"},
        "velocity that the friction opposes: commanded or actual",
        name="friction_on",
    ),
    real(
        *(2e-3, 1e-12, 1e4, "m/s", "velocity over which the friction changes sign"),
        name="v_friction",
        display_unit="mm/s",
    ),
    real(0.0, 0.0, 1.0, "m", "standard deviation of the encoder noise", name="noise_std", display_unit="um"),
    whole(0, 0, 2**31 - 1, "seed of the encoder noise", name="seed"),
    # The source of commands.
    choice(
        "staircase",
        {
            "staircase": "moves of 10 mm, three up and three down",
            "spiral_x": "X axis of an Archimedean spiral",
            "spiral_y": "Y axis of an Archimedean spiral",
            "samples": "the samples with which the FMU was built",
        },
        "trajectory that is played",
        name="trajectory",
    ),
)
"""Parameters of models, plants and trajectories."""

PARAMETERS: Mapping[str, Parameter] = {
    **PredictorSettings.fmi_parameters(),
    **CompensatorSettings.fmi_parameters(),
    **{parameter.name: parameter for parameter in (field.metadata["parameter"] for field in _OTHERS)},
}
"""All parameters by their names in FMUs."""

DRIVE_LIMIT_ENTRIES = Limits.parameters() | {one: PARAMETERS[one] for one in ("change_max", "following_error_max")}
"""Parameters of the section ``[drive_limits]`` of a machine file, by their entries."""


def check(name: str, value: Any, *, label: str | None = None) -> Any:
    """Return ``value`` in the type of a parameter, by its name in FMUs; ``label`` is its name in messages.

    ParameterError if the value is of another kind, not finite, or out of range.
    """
    return PARAMETERS[name].checked(value, label)


def samples_before(t: float, T_s: float) -> int:
    """Return the number of samples ``0, T_s, …`` before ``t``, s, insensitive to rounding of times."""
    return max(0, math.ceil(t / T_s - 1e-6))
