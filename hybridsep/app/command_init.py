"""``hybridsep init``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..base.errors import ParameterError
from ..base.output import written_text
from ..fmi.flavours import FLAVOURS, FMI_CHOICES, versions_of
from .options import ForceOption

if TYPE_CHECKING:
    from ..model.physics import ModalModel

__all__ = ["init"]

MODELS = {
    "lag": ("tau",),
    "second-order": ("f_n", "zeta"),
    "mass": ("m", "c", "k"),
    "transfer-function": ("num", "den"),
}
"""Physics models that can be asked for, and their numbers."""

QUESTIONS = {
    "tau": "time constant of the lag: servo error over velocity, without the dead time [s]",
    "f_n": "natural frequency of the position loop [Hz]",
    "zeta": "damping ratio (1 is critical)",
    "m": "moving mass [kg]",
    "c": "damping [N.s/m]",
    "k": "stiffness [N/m]",
    "num": "numerator in s, highest power first, for example 54.3 15797.5",
    "den": "denominator in s, highest power first, for example 1 23.7 16624",
}


def init(
    out: Annotated[Path, typer.Argument(help="Machine file to write.")] = Path("my_axis.toml"),
    name: Annotated[str | None, typer.Option(help="Name of the machine: letters, digits, underscores.")] = None,
    T_s: Annotated[float | None, typer.Option("--T_s", "--Ts", help="Sampling interval [s].")] = None,
    model: Annotated[str | None, typer.Option(help=f"Physics model: {', '.join(MODELS)}.")] = None,
    tau: Annotated[float | None, typer.Option(help=f"lag: {QUESTIONS['tau']}.")] = None,
    f_n: Annotated[float | None, typer.Option("--f_n", help=f"second-order: {QUESTIONS['f_n']}.")] = None,
    zeta: Annotated[float | None, typer.Option(help=f"second-order: {QUESTIONS['zeta']}.")] = None,
    m: Annotated[float | None, typer.Option("--m", help=f"mass: {QUESTIONS['m']}.")] = None,
    c: Annotated[float | None, typer.Option("--c", help=f"mass: {QUESTIONS['c']}.")] = None,
    k: Annotated[float | None, typer.Option("--k", help=f"mass: {QUESTIONS['k']}.")] = None,
    from_tf: Annotated[
        tuple[str, str] | None,
        typer.Option(metavar="NUM DEN", help="transfer-function: coefficients in s, highest power first, in quotes."),
    ] = None,
    dead_time: Annotated[int | None, typer.Option(help="Whole samples of dead time.")] = None,
    hold: Annotated[str | None, typer.Option(help="Command between samples: zoh (held) or foh (interpolated).")] = None,
    Np: Annotated[int | None, typer.Option("--Np", help="Samples in a look-ahead window.")] = None,
    fmi: Annotated[
        str | None,
        typer.Option(
            help=f"Build the native FMUs too, beside the machine file: version of FMI, {', '.join(FMI_CHOICES)}."
        ),
    ] = None,
    force: ForceOption = False,
) -> None:
    """Write an annotated machine file, by options or questions.

    What no option says is asked.
    """
    from ..fmi.archive import build_here, fmu_name, other_platforms
    from ..fmi.compile import check_available
    from ..identify.model import machine_of
    from ..machines.machine import load_machine
    from ..machines.text import machine_text
    from ..model.physics import ModalModel
    from .outputs import check_outputs

    versions = () if fmi is None else versions_of(fmi, FLAVOURS[0])
    if versions:
        check_available(("host",))
    check_outputs([("OUT", out, (".toml",))], {}, force=force)
    name = str(_asked("--name", name, "name of the machine", out.stem))
    T_s = float(_asked("--T_s", T_s, "sampling interval [s]", 1e-3))
    if from_tf is not None:
        model = "transfer-function"
    model = str(_asked("--model", model, f"physics model ({', '.join(MODELS)})", "lag"))
    if model not in MODELS:
        raise ParameterError(f"--model must be one of {', '.join(MODELS)}, got {model!r}")
    numbers: dict[str, Any] = {"tau": tau, "f_n": f_n, "zeta": zeta, "m": m, "c": c, "k": k}
    numbers |= dict(zip(("num", "den"), from_tf or (None, None), strict=True))
    given = {
        key: _asked("--from-tf" if key in ("num", "den") else f"--{key}", numbers[key], QUESTIONS[key], None)
        for key in MODELS[model]
    }
    delay = int(_asked("--dead-time", dead_time, "whole samples of dead time", 0))
    hold = str(_asked("--hold", hold, "command between samples, zoh (held) or foh (interpolated)", "zoh"))
    window = int(_asked("--Np", Np, "samples in a look-ahead window", 100))
    machine = machine_of(
        ModalModel(_modal(model, given).modes, delay),
        *(hold, T_s, name, f"{name}, by hybridsep init"),
        predictor={"Np": window, "p": min(50, window)},
    )
    names = [fmu_name("HybridPredictor", machine.name, FLAVOURS[0], version) for version in versions]
    fmus = [out.with_name(f"{fmu}.fmu") for fmu in names]
    check_outputs([("--fmi", path, ()) for path in fmus], {}, force=force)
    said = ", ".join(f"{key} = {value}" for key, value in given.items())
    comments = [
        f"Physics model: {model}, {said}. hybridsep identify finds it from a log of the axis.",
        f"Next: hybridsep backtest LOG --machine {out}",
    ]
    with written_text(out) as file:
        file.write(machine_text(machine, comments, annotated=True))
    typer.echo(f"{out} written: {model}, {said}")
    if fmi is not None:
        build_here(load_machine(out), "HybridPredictor", out.parent, FLAVOURS[0], fmi=fmi)
    for path in fmus:
        typer.echo(f"{path} written")
    if fmi is not None and (note := other_platforms(fmus[0], out, fmi=fmi)):
        typer.echo(note)


def _asked(option: str, value: Any, question: str, default: Any) -> Any:
    """Return an option's value, or the answer where it is missing; its default where nobody can answer."""
    if value is not None:
        return value
    if sys.stdin is not None and sys.stdin.isatty():
        return typer.prompt(question, default=default, type=str if default is None else type(default))
    if default is None:
        raise ParameterError(f"{option} is missing: {question}")
    return default


def _modal(model: str, given: dict[str, Any]) -> ModalModel:
    """Return the model that the numbers make."""
    import numpy as np

    from ..identify.structure import lag_mode
    from ..model.physics import ModalModel, Mode

    if model == "transfer-function":
        import control

        return ModalModel.from_control(control.tf(*(_coefficients(given[key]) for key in ("num", "den"))))
    values = {key: _number(key, value) for key, value in given.items()}
    if model == "lag":
        if not values["tau"] > 0:
            raise ParameterError(f"tau must be above 0 s, got {values['tau']:g}")
        return ModalModel([lag_mode(values["tau"])])
    if model == "second-order":
        return ModalModel([Mode(values["f_n"], values["zeta"], (2 * np.pi * values["f_n"]) ** 2)])
    return ModalModel.spring_mass_damper(values["m"], values["c"], values["k"])


def _number(name: str, value: Any) -> float:
    try:
        return float(value)
    except ValueError:
        raise ParameterError(f"{name} must be a number, got {value!r}") from None


def _coefficients(text: str) -> list[float]:
    parts = text.replace(",", " ").replace("[", " ").replace("]", " ").split()
    if not parts:
        raise ParameterError(f"a polynomial needs coefficients, highest power first, got {text!r}")
    return [_number("a coefficient", part) for part in parts]
