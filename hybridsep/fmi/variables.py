"""Variable table of each FMU.

The modelDescription, the value references, the Python slave and the interface tables of the documentation follow from
it. Single variables come first, then the modes, then the windows, so that the places of all before the modes are the
same in all FMUs of a kind. A variable that a kind got later stands after the modes, so that no other one has moved.
This module is packed into the FMUs: it needs nothing but the standard library.
"""

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from ..base.parameters import Parameter, angular_unit
from ..base.settings import PARAMETERS, CompensatorSettings, PredictorSettings, check

Value = float | int | bool  # a start value

MODE = ("f_n", "zeta", "alpha", "beta")  # numbers of a mode of eq. (15)

_PREDICTOR = PredictorSettings.fmi_parameters()

PREDICTOR_SETTINGS: Mapping[str, Parameter] = {
    **{name: parameter for name, parameter in _PREDICTOR.items() if name not in PredictorSettings.AVERAGING},
    "dead_time": PARAMETERS["dead_time"],
}
"""Further parameters of a HybridPredictor and of the predictor that a SepCompensator holds."""

AVERAGING_SETTINGS: Mapping[str, Parameter] = {name: _PREDICTOR[name] for name in PredictorSettings.AVERAGING}
"""Parameters of the residual model with averaging, of both."""

COMPENSATOR_SETTINGS: Mapping[str, Parameter] = CompensatorSettings.fmi_parameters()
"""Parameters of a SepCompensator besides its predictor's."""

_REJECTED = "measurements that were missing or not plausible, with averaging; counted window by window"
_NO_MEASUREMENT = (
    "whether x_meas was missing for measurement_timeout: the change of the command fades until it comes again"
)
_STD = "standard deviation of x_meas - x_h, now; 0: not known"
_ALARM = "it tripped: x_meas - x_d, or its geometric mean with x_meas - x_dm, was over its limit for three samples"
# no input: several masters set all inputs by setReal
_RESET = "a rising edge ends a trip; what was learned before it stays"
_LOAD = (
    "force or torque that pushes the axis forwards, divided by the stiffness of its position loop, preview samples "
    "early; counted from its first value"
)
_COMPENSATE = CompensatorSettings.parameters()["compensate"]
_HEADINGS = {
    "input": "Inputs",
    "output": "Outputs",
    "parameter": "Parameters",
    "local": "Current window",
    "independent": "Time",
}
_KINDS = {int: "Integer", float: "Real", bool: "Boolean", str: "Enumeration"}


@dataclass(frozen=True)
class Variable:
    """One FMI 2.0 scalar variable; its value reference is its place in the table."""

    name: str
    kind: str  # {"Real", "Integer", "Boolean", "Enumeration"}
    # {"input", "output", "parameter", "local"}: FMI 3.0 adds ``structuralParameter``, the length of its arrays, and
    # ``independent``, the time
    causality: str
    variability: str  # {"fixed", "tunable", "continuous", "discrete"}
    description: str
    start: Value | None = None  # start value; None if it is calculated
    # of a Real; ``"1"`` is written without a unit
    unit: str | None = None
    display_unit: str | None = None
    # closed bounds, as ``min``/``max`` show them
    minimum: float | None = None
    maximum: float | None = None
    nonzero: float = 0.0  # least value that is not 0; checked, as ``min`` cannot express it
    automatic: float | None = None  # value beside the range that stands for an automatic choice
    nominal: float | None = None
    # inputs and parameters an output depends on during initialization; none at any later point
    initially_from: tuple[str, ...] = ()
    wired: bool = True  # whether something in a system of the machine's FMUs tells this input
    items: tuple[str, ...] = ()  # names of an Enumeration's values, which count from 0
    item_meanings: tuple[str, ...] = ()  # what each of them means
    learned: bool = False  # whether a warm start needs the value with which the weights were learned
    group: str = ""  # heading of a parameter in the documentation

    @property
    def heading(self) -> str:
        """Heading in the documentation."""
        return self.group or _HEADINGS[self.causality]

    @property
    def type_name(self) -> str:
        """Name of an Enumeration's type: ``SepState`` for ``sep_state``, as none may be called like a variable."""
        return "".join(part.capitalize() for part in self.name.split("_"))


def _position(name: str, causality: str, description: str, *, display_unit: str = "mm", **more: Any) -> Variable:
    """Return a position, m; ``more`` are attributes of :class:`Variable`."""
    more.setdefault("variability", "continuous" if causality == "input" else "discrete")
    more |= {"unit": "m", "display_unit": display_unit, "nominal": 1e-3 if display_unit == "mm" else 1e-6}
    return Variable(name, "Real", causality, description=description, **more)


_RUNNING_ERRORS = [
    _position(name, "output", f"running RMS of {what}", display_unit="um")
    for name, what in (
        ("rms_pb", "x_meas - x_pb since t_init"),
        ("rms_h", "x_meas - x_h since t_init"),
        ("rms_hold", "hold since t_init: x_pb plus the last residual measured before the window"),
    )
]


def _parameter(parameter: Parameter, start: Value, *, group: str, label: str | None = None) -> Variable:
    as_declared = ("display_unit", "minimum", "maximum", "nonzero", "automatic", "learned")
    return Variable(
        label or parameter.name,
        _KINDS[parameter.kind],
        "parameter",
        "tunable" if parameter.tunable else "fixed",
        parameter.description,
        start=start,
        unit=parameter.unit if parameter.kind is float else None,
        items=parameter.choices,
        item_meanings=parameter.meanings,
        group=group,
        **{name: getattr(parameter, name) for name in as_declared},
    )


def _parameters(group: str, table: Mapping[str, Parameter], starts: Mapping[str, Value]) -> list[Variable]:
    return [_parameter(parameter, starts[name], group=group) for name, parameter in table.items()]


def _look_ahead_parameters(starts: Mapping[str, Value]) -> list[Variable]:
    """Return the parameters of a predictor, by itself or within a compensator."""
    return [
        *_parameters("Look-ahead and residual model", PREDICTOR_SETTINGS, starts),
        *_parameters("Residual model with averaging", AVERAGING_SETTINGS, starts),
    ]


def _modes(modes: Sequence[Mapping[str, float]]) -> list[Variable]:
    return [
        _parameter(PARAMETERS[name], mode[name], group="Physics model", label=f"mode[{i}].{name}")
        for i, mode in enumerate(modes, start=1)
        for name in MODE
    ]


def modes_from(values: Mapping[str, Value]) -> list[dict[str, float]]:
    """Return the modes of the variables ``mode[i].*``; ParameterError, with its place, if one is out of its range."""
    n = sum(name.endswith(".f_n") for name in values)
    return [{key: check(key, values[name := f"mode[{i}].{key}"], label=name) for key in MODE} for i in range(1, n + 1)]


def _predictor_variables(parameters: Mapping[str, Value], modes: Sequence[Mapping[str, float]]) -> list[Variable]:
    ahead = ("x_d_ahead",)
    window = range(1, int(parameters["Np"]) + 1)
    table = [
        _position("x_d_ahead", "input", "commanded position entering the look-ahead, Np samples early", start=0.0),
        _position("x_meas", "input", "measured position now", start=0.0),
        _position("x_d", "output", "commanded position now: x_d_ahead, Np samples later", initially_from=ahead),
        _position(
            "x_pb", "output", "physics-based prediction for now, made when the window began", initially_from=ahead
        ),
        _position("x_h", "output", "hybrid prediction for now, made when the window began", initially_from=ahead),
        _position("x_h_std", "output", _STD, display_unit="um"),
        _position("e_servo", "output", "predicted servo error x_d - x_h", display_unit="um"),
        Variable("hybrid_active", "Boolean", "output", "discrete", "whether x_h is the hybrid prediction now"),
        *_RUNNING_ERRORS,
        Variable("batch", "Integer", "output", "discrete", "number of the window, floor(k / Np); 0 is the first fill"),
        Variable("n_rejected", "Integer", "output", "discrete", _REJECTED),
    ]
    table += _look_ahead_parameters(parameters)
    table += _modes(modes)
    shown = {"x_d": "commanded positions", "x_pb": "physics-based predictions", "x_h": "hybrid predictions"}
    for name, what in shown.items():
        meaning = f"{what} of the current window"
        table += [_position(f"{name}_window[{i}]", "local", meaning, initially_from=ahead) for i in window]
    spread = "standard deviations of x_meas - x_h in the current window"
    table += [_position(f"x_h_std_window[{i}]", "local", spread, display_unit="um") for i in window]
    return table


def _compensator_variables(parameters: Mapping[str, Value], modes: Sequence[Mapping[str, float]]) -> list[Variable]:
    ahead = ("x_d_ahead",)
    # With weights from an earlier run and no warm-up, the hybrid model may plan the first window already.
    model = ("t_init", "compensate", "averaging")
    plan = (*ahead, *model)
    prediction = "prediction for now under x_dm, with averaging by its model, else by the model that planned the window"
    error = "predicted servo error x_d - x_h that is left"
    state = "model that planned what x_dm follows now"
    return [
        _position("x_d_ahead", "input", "commanded position entering the look-ahead, preview samples early", start=0.0),
        _position("x_meas", "input", "measured position now", start=0.0),
        _position("x_dm", "output", "modified command now; wire it to the drive", initially_from=ahead),
        _position("x_d", "output", "commanded position now: x_d_ahead, preview samples later", initially_from=ahead),
        _position("x_pb", "output", "physics-based prediction for now under x_dm", initially_from=ahead),
        _position("x_h", "output", prediction, initially_from=plan),
        _position("x_h_std", "output", _STD, display_unit="um", initially_from=(*plan, "lambda", "noise_std")),
        _position("e_servo", "output", error, display_unit="um", initially_from=plan),
        Variable(
            *("sep_state", "Enumeration", "output", "discrete", state),
            initially_from=model,
            items=(*_COMPENSATE.choices, "tripped"),
            item_meanings=(*_COMPENSATE.meanings, "none: the change of the command fades until a reset"),
        ),
        _position("rms_e", "output", "running RMS of x_d - x_meas since t_init", display_unit="um"),
        *_RUNNING_ERRORS,
        Variable("batch", "Integer", "output", "discrete", "number of the window, floor(k / Np)"),
        Variable("n_rejected", "Integer", "output", "discrete", _REJECTED),
        Variable("no_measurement", "Boolean", "output", "discrete", _NO_MEASUREMENT),
        Variable("alarm", "Boolean", "output", "discrete", _ALARM),
        *_look_ahead_parameters(parameters),
        *_parameters("Compensation", COMPENSATOR_SETTINGS, parameters),
        Variable("reset", "Boolean", "parameter", "tunable", _RESET, False, group="Compensation"),
        *_modes(modes),
        _position("x_load", "input", _LOAD, start=0.0, variability="discrete", wired=False),  # constant over a step
    ]


def _plant_variables(parameters: Mapping[str, Value], modes: Sequence[Mapping[str, float]]) -> list[Variable]:
    """Return the table of a FeedDrive: with ``modes`` of the stage, without of eq. (13)."""
    v = Variable("v", "Real", "output", "continuous", "true velocity", unit="m/s", display_unit="mm/s", nominal=1e-2)
    drive: dict[str, tuple[str, ...]] = {"Drive": ("m", "c", "k", "c_nl", "k_nl")}
    stage = {"Disturbance": ("f", "kappa", "friction_on", "v_friction"), "Command": ("T_s", "dead_time", "input_hold")}
    groups = {**(stage if modes else drive), "Encoder": ("noise_std", "seed")}
    return [
        _position("x_d", "input", "commanded position, constant over a step", start=0.0),
        _position("x", "output", "true position", variability="continuous", initially_from=("x_d",)),
        v,
        _position(
            "x_meas", "output", "measured position, with encoder noise", initially_from=("x_d", "noise_std", "seed")
        ),
        *(
            _parameter(PARAMETERS[name], parameters[name], group=group)
            for group, names in groups.items()
            for name in names
        ),
        *_modes(modes),
    ]


def _trajectory_variables(parameters: Mapping[str, Value], _unused: Sequence[Mapping[str, float]]) -> list[Variable]:
    """Return the table of the ReferenceTrajectory, which has no modes."""
    meaning = "commanded position at t; wire it to x_d_ahead"
    return [
        _position("r", "output", meaning, initially_from=("trajectory",)),
        *(_parameter(PARAMETERS[name], parameters[name], group="Trajectory") for name in ("trajectory", "T_s")),
    ]


_MODELS: Mapping[str, Callable[[Mapping[str, Value], Sequence[Mapping[str, float]]], list[Variable]]] = {
    "HybridPredictor": _predictor_variables,
    "SepCompensator": _compensator_variables,
    "FeedDrive": _plant_variables,
    "ReferenceTrajectory": _trajectory_variables,
}
"""The table of each model, from its parameters' start values and its modes (``f_n``, ``zeta``, ``alpha``, ``beta``)."""

INTERPOLATED: dict[str, tuple[str, ...]] = {
    "HybridPredictor": ("x_d_ahead", "x_meas"),
    "SepCompensator": ("x_d_ahead", "x_meas"),
    "FeedDrive": (),
    "ReferenceTrajectory": (),
}
"""The first variables of each model: inputs that a native FMU extrapolates by their time derivative."""


SAMPLES_TRAJECTORY = len(PARAMETERS["trajectory"].choices) - 1
"""The number under which a ReferenceTrajectory plays the samples it was built with: the last one."""


@dataclass(frozen=True)
class FmuTable:
    """What tables, headers and documents of an FMU are made of."""

    model: str  # a key of :data:`hybridsep.fmi.variables._MODELS`
    name: str  # model identifier
    parameters: Mapping[str, Value]  # start values by name
    # ``f_n``, ``zeta``, ``alpha``, ``beta`` of each mode of eq. (15); empty where the model has none
    modes: tuple[Mapping[str, float], ...] = ()
    unit: str = "m"  # {"m", "rad"}: of positions
    windows: bool = True  # whether a HybridPredictor shows the samples of its window
    rest: float = 0.0  # m: start value of the positions that enter: where the axis is at rest

    def as_json(self) -> dict[str, object]:
        """Return plain values; unit, windows and rest where they are not the usual ones."""
        content = {"model": self.model, "name": self.name, "parameters": dict(self.parameters)}
        usual = {"unit": "m", "windows": True, "rest": 0.0}
        more = {name: own for name, one in usual.items() if (own := getattr(self, name)) != one}
        return {**content, "modes": list(self.modes), **more}

    @property
    def kind(self) -> str:
        """Kind of FMU, all of which one library serves: the model, or ``StageDrive`` for a FeedDrive with modes."""
        return "StageDrive" if self.model == "FeedDrive" and self.modes else self.model

    @property
    def is_angular(self) -> bool:
        """Whether positions are angles."""
        return self.unit != "m"

    @cached_property
    def variables(self) -> tuple[Variable, ...]:
        """Variables; the place of each is its value reference."""
        table = _MODELS[self.model](self.parameters, self.modes)
        if not self.windows:
            table = [variable for variable in table if variable.causality != "local"]
        table = [replace(one, start=self.rest) if one.causality == "input" and one.wired else one for one in table]
        if self.is_angular:
            units = [(angular_unit(one.unit), angular_unit(one.display_unit)) for one in table]
            table = [replace(one, unit=u, display_unit=shown) for one, (u, shown) in zip(table, units, strict=True)]
        return tuple(table)

    @cached_property
    def shown(self) -> tuple[Variable, ...]:
        """Variables with the ranges that hold in this FMU, where its kind has wider ones.

        A ReferenceTrajectory plays what lies in its archive: at the interval of its samples, and samples of the user's
        only where it was built with some, which it then starts with.
        """
        if self.model != "ReferenceTrajectory":
            return self.variables
        T_s = float(self.parameters["T_s"])
        played = SAMPLES_TRAJECTORY + (self.parameters["trajectory"] == SAMPLES_TRAJECTORY)
        own: dict[str, Any] = {"T_s": {"minimum": T_s, "maximum": T_s}, "trajectory": {"maximum": played - 1}}
        return tuple(
            replace(one, items=one.items[:played], item_meanings=one.item_meanings[:played], **own.get(one.name, {}))
            for one in self.variables
        )

    def named(self, causality: str) -> dict[str, Variable]:
        """Return the variables of a causality by name, in their order."""
        return {variable.name: variable for variable in self.variables if variable.causality == causality}


@dataclass(frozen=True)
class Layout:
    """Parts of an FMU's table: single variables, the modes' variables, more single ones, then windows."""

    scalars: tuple[Variable, ...]
    modes: tuple[Variable, ...]  # four numbers of each
    last: tuple[Variable, ...]  # what was added since
    windows: tuple[tuple[Variable, ...], ...]  # the samples of each window, all windows of one length

    @property
    def window(self) -> int:
        """Samples in each window, 0 if there are none."""
        return len(self.windows[0]) if self.windows else 0

    @property
    def starts(self) -> list[float]:
        """Start values of all but windows, which have none; 0 for what is calculated."""
        return [float(variable.start or 0.0) for variable in self.started]

    @property
    def started(self) -> tuple[Variable, ...]:
        """Variables before the windows."""
        return *self.scalars, *self.modes, *self.last


def layout_of(table: Sequence[Variable]) -> Layout:
    """Return the parts of a table, which the C core finds by their places."""
    arrays: dict[str, list[Variable]] = defaultdict(list)
    for variable in table:
        array, bracket, _ = variable.name.partition("[")
        arrays[array if bracket else "last" if "mode" in arrays else ""].append(variable)
    scalars, modes, last = (tuple(arrays.pop(name, [])) for name in ("", "mode", "last"))
    windows = tuple(map(tuple, arrays.values()))
    layout = Layout(scalars, modes, last, windows)
    flat = [*layout.started, *(sample for window in windows for sample in window)]
    assert flat == list(table), "single variables come first, then modes, then single ones, then windows"
    assert len({len(window) for window in windows}) <= 1, "windows are of one length"
    return layout
