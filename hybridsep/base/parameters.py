"""Every parameter's range, unit, default and meaning, declared once.

The library's checks, the FMUs' ``min``/``max``, the command line's help and the machine files' validation all
come from :data:`PARAMETERS`. Section 2 of the paper's method fixes the limits that tie several together:
``0 ≤ q < Np`` and ``1 ≤ p ≤ Np``.

The ranges of physical quantities are a few powers of ten wider than any feed drive needs, and so narrow that no
arithmetic on them overflows: the largest response to a position of 1 km, of the slowest mode with the largest gain and
the least damping, is below 1e30 m, and the least limit, counted in samples, that anything is divided by is 1e-21 m.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .errors import ParameterError, brief

__all__ = [
    "INPUT_HOLDS",
    "PARAMETERS",
    "Parameter",
    "check",
    "check_lags",
    "check_preview",
    "check_together",
    "samples_before",
]

INPUT_HOLDS = ("zoh", "foh")
"""How ``x_d`` runs between samples; the index is the FMU parameter ``input_hold``."""

_INT_MAX = 2**31 - 1
_V_S = "velocity over which friction changes its sign, for features of the reference; 0: none of them"


@dataclass(frozen=True)
class Parameter:
    """One scalar parameter.

    Attributes
    ----------
    name : str
        Name in the FMU and in messages.
    kind : type
        ``int`` or ``float``.
    unit : str
        SI unit in FMI's notation; ``"1"`` for a number.
    minimum, maximum : float
        Closed bounds.
    nonzero : float
        Least value that is not 0, where 0 turns something off and others are divided by; 0 if there is none.
    default : int or float or None
        Value when nothing is said.
    display_unit : str or None
        Unit a tool shows it in.
    description : str
        One line for people.
    """

    name: str
    kind: type
    unit: str
    description: str
    default: float | None
    minimum: float
    maximum: float
    display_unit: str | None = None
    nonzero: float = 0.0

    @property
    def range_text(self) -> str:
        """The allowed range as people write it, for example ``"1 … 10000"``."""
        least = f"0 or {self.nonzero:g}" if self.nonzero else f"{self.minimum:g}"
        return f"{least} … {self.maximum:.10g}"

    def allows(self, number: float) -> bool:
        """Return whether a number is in the range."""
        return self.minimum <= number <= self.maximum and not 0 < abs(number) < self.nonzero

    @property
    def help(self) -> str:
        """Description, unit and range on one line."""
        unit = "" if self.unit == "1" else f" [{self.unit}]"
        return f"{self.description}{unit}, {self.range_text}"


def _table(*parameters: Parameter) -> dict[str, Parameter]:
    return {parameter.name: parameter for parameter in parameters}


PARAMETERS: Mapping[str, Parameter] = _table(
    # The predictor, eqs. (3) to (6).
    Parameter("Np", int, "1", "samples in a look-ahead window (a batch)", 100, 1, 100_000),
    Parameter("p", int, "1", "past residuals e_pb in the features", 50, 1, 5000),
    Parameter("q", int, "1", "past physics-based predictions x_pb in the features", 3, 0, 5000),
    Parameter("lambda", float, "m2", "ridge penalty on the weights", 1e-12, 1e-40, 1e12),
    Parameter("T_s", float, "s", "sampling interval", 1e-3, 1e-5, 1.0, "ms"),
    Parameter("t_init", float, "s", "warm-up: until then x_h = x_pb, while learning goes on", 0.3, 0.0, 1e6),
    Parameter("input_hold", int, "1", "x_d between samples: 0 zero-order, 1 first-order hold", 0, 0, 1),
    Parameter("dead_time", int, "1", "whole samples of dead time in the physics model", 0, 0, 100_000),
    # The compensator.
    Parameter("preview", int, "1", "samples planned ahead, at least Np + 4·spacing + 3", 200, 8, 2000),
    Parameter("spacing", int, "1", "samples between the knots of the change, a divisor of Np", 2, 1, 1000),
    Parameter("jerk_weight", float, "1", "weight of the change's jerk against the tracking error", 1.0, 0.0, 1e12),
    Parameter("v_max", float, "m/s", "largest velocity of the modified command", 0.1, 1e-9, 1e4, "mm/s"),
    Parameter("a_max", float, "m/s2", "largest acceleration of the modified command", 16.0, 1e-6, 1e6),
    Parameter("j_max", float, "m/s3", "largest jerk of the modified command", 5000.0, 1e-6, 1e12),
    Parameter("change_max", float, "m", "largest change of the command", 1e-3, 1e-12, 10.0, "mm"),
    Parameter("v_s", float, "m/s", _V_S, 2e-3, 0.0, 1e4, "mm/s", nonzero=1e-9),
    Parameter("keep_direction", int, "1", "1: x_dm never turns while the commanded position moves", 1, 0, 1),
    Parameter("compensate", int, "1", "best model to compensate with: 0 off, 1 physics, 2 hybrid", 2, 0, 2),
    # One mode of eq. (15).
    Parameter("f_n", float, "Hz", "natural frequency of the mode", None, 1e-3, 1e5),
    Parameter("zeta", float, "1", "damping ratio of the mode", None, 1e-6, 1e4),
    Parameter("alpha", float, "1/s2", "numerator of the mode, constant term", None, -1e15, 1e15),
    Parameter("beta", float, "1/s", "numerator of the mode, factor of s", None, -1e10, 1e10),
    # The nonlinear drive of eq. (13).
    Parameter("m", float, "kg", "moving mass", None, 1e-6, 1e6),
    Parameter("c", float, "N.s/m", "damping", None, 1e-9, 1e12),
    Parameter("k", float, "N/m", "stiffness", None, 1e-6, 1e15),
    Parameter("c_nl", float, "N.s2/m2", "quadratic damping, force c_nl·v·|v|", 0.0, 0.0, 1e12),
    Parameter("k_nl", float, "N/m2", "quadratic stiffness, force k_nl·x·|x|", 0.0, 0.0, 1e15),
    # The stage's disturbance and the encoder.
    Parameter("f", float, "m", "friction of the carriage, as an offset of the command", 0.0, 0.0, 1.0, "um"),
    Parameter("kappa", float, "1/m", "cable stiffness, an offset kappa·x·|x| of the command", 0.0, 0.0, 1e6),
    Parameter("noise_std", float, "m", "standard deviation of the encoder noise", 0.0, 0.0, 1.0, "um"),
    Parameter("seed", int, "1", "seed of the encoder noise", 0, 0, _INT_MAX),
    # The source of commands.
    Parameter("trajectory", int, "1", "0 staircase, 1 spiral X, 2 spiral Y, 3 samples given when built", 0, 0, 3),
)


def check(name: str, value: Any, *, label: str | None = None) -> Any:
    """Return ``value`` as the parameter's own type, or say why it cannot be one.

    Parameters
    ----------
    name : str
        Key of :data:`PARAMETERS`.
    value : Any
        What the user gave.
    label : str, optional
        Name to use in the message, for example ``"mode[2].zeta"``.

    Returns
    -------
    int or float
        The value.

    Raises
    ------
    ParameterError
        If the value is not a number of that kind, not finite, or out of range.
    """
    parameter = PARAMETERS[name]
    shown = label or name
    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
    try:
        if isinstance(value, (bool, str, bytes)):
            raise TypeError
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise ParameterError(f"{shown} must be a number, got {brief(value)}") from None
    if not math.isfinite(number):
        raise ParameterError(f"{shown} must be finite, got {brief(value)}")
    if parameter.kind is int and number != int(number):
        raise ParameterError(f"{shown} must be a whole number, got {brief(value)}")
    if not parameter.allows(number):
        raise ParameterError(f"{shown} must be {parameter.range_text}{unit}, got {brief(value)}")
    return parameter.kind(number)


def check_together(*, Np: Any, p: Any, q: Any, lam: Any, Ts: Any, t_init: Any) -> None:
    """Check the predictor's parameters, alone and together, and report all that is wrong at once.

    Raises
    ------
    ParameterError
        Naming every parameter that is out of range (section 2: ``0 ≤ q < Np``, ``1 ≤ p ≤ Np``).
    """
    given = {"Np": Np, "p": p, "q": q, "lambda": lam, "T_s": Ts, "t_init": t_init}
    problems: list[str] = []
    known = {}
    for name, value in given.items():
        try:
            known[name] = check(name, value)
        except ParameterError as error:
            problems.append(str(error))
    if not problems:
        problems = check_lags(Np=known["Np"], p=known["p"], q=known["q"])
    if problems:
        raise ParameterError("; ".join(problems))


def check_lags(*, Np: int, p: int, q: int) -> list[str]:
    """Say what is wrong between ``Np``, ``p`` and ``q``; an empty list if nothing is."""
    problems = []
    if not 1 <= p <= Np:
        problems.append(f"p must be 1 … Np = {Np}, got {p}; lower p or raise Np")
    if not 0 <= q < Np:
        problems.append(f"q must be 0 … Np − 1 = {Np - 1}, got {q}; lower q or raise Np")
    return problems


def check_preview(*, Np: int, preview: int, spacing: int) -> list[str]:
    """Say what is wrong between ``Np``, ``preview`` and ``spacing``; an empty list if nothing is."""
    problems = []
    if Np % spacing:
        problems.append(f"spacing must be ≥ 1 and divide Np = {Np}, got {spacing}")
    least = Np + 4 * spacing + 3
    if preview < least:
        problems.append(f"preview must be ≥ Np + 4·spacing + 3 = {least}, got {preview}")
    return problems


def samples_before(t: float, Ts: float) -> int:
    """Return how many samples ``0, Ts, …`` come before ``t``, both in s, so that rounding of times cannot tell."""
    return max(0, math.ceil(t / Ts - 1e-6))
