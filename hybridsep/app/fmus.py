"""Commands that write FMUs and sources for controllers: ``build``, ``hal`` and ``header``."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..base.errors import ParameterError
from ..base.files import DEFAULT_MACHINE
from ..fmi.flavours import FLAVOURS, FMI_VERSIONS
from . import options

if TYPE_CHECKING:
    from ..machines.machine import Machine

_CONTROLLERS = ("twincat",)  # controllers that ``--for`` takes


def build(
    fmus: Annotated[list[str] | None, typer.Argument(help="FMUs to build; all of the machine's if left out.")] = None,
    machine: options.MachineOption = DEFAULT_MACHINE,
    entries: options.SetOption = None,
    flavour: Annotated[str, typer.Option(help=f"Flavour of the FMUs: {', '.join(FLAVOURS)}.")] = FLAVOURS[0],
    fmi: Annotated[
        str,
        typer.Option(help=f"Version of FMI: {', '.join(FMI_VERSIONS)}; those of 3.0 are native, named with Fmi3."),
    ] = FMI_VERSIONS[0],
    target: options.TargetOption = None,
    weights: options.WeightsOption = None,
    trajectory: Annotated[
        Path | None,
        typer.Option(help="CSV, .npz or .mat file with the columns t and x_d, for ReferenceTrajectory to play."),
    ] = None,
    unit: options.UnitOption = None,
    no_windows: Annotated[
        bool, typer.Option("--no-windows", help="Without a HybridPredictor's window, 4·Np scalars or four arrays.")
    ] = False,
    embed_weights: Annotated[
        bool,
        typer.Option(
            "--embed-weights",
            help="Compile the weights into the sources of a native FMU too, for targets without files (HSEP_NO_FILES).",
        ),
    ] = False,
    controller: Annotated[
        str | None,
        typer.Option(
            "--for",
            help=f"Controller that compiles the sources: {', '.join(_CONTROLLERS)}. Weights are compiled in, what "
            "plays files is left out, and a file that its tool needs lies beside the FMUs.",
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the archives.")] = Path("dist"),
    force: options.ForceOption = False,
) -> None:
    """Build FMUs from a machine file.

    The same machine gives the same bytes.
    """
    from ..fmi.archive import build_fmu
    from ..fmi.compile import default_targets, expanded, library_paths
    from ..fmi.controllers import CONFIGURATION_FILE, write_configuration
    from ..fmi.spec import table_of
    from ..fmi.weights import saved_weights
    from ..logs.log import check_reading
    from ..machines.machine import load_machine, machine_path
    from ..plants.trajectory import read_trajectory
    from .console import check_outputs, print_built, progress_bar, warn_of_estimates

    native = {"--embed-weights": embed_weights, f"--for {controller}": controller is not None, "--target": bool(target)}
    if wrong := [option for option, given in native.items() if given and flavour != "native"]:
        raise ParameterError(f"{wrong[0]} is for native FMUs; with --flavour {flavour} leave it out")
    if controller is not None and controller not in _CONTROLLERS:
        raise ParameterError(f"--for must be {' or '.join(_CONTROLLERS)}, got {controller}")
    axis = load_machine(machine, entries or ())
    models = _models(axis, fmus or [], flavour, target or [], fmi)
    if controller is not None:  # whose sources open no files
        if fmus and "ReferenceTrajectory" in models.values():
            raise ParameterError(f"--for {controller} is for FMUs that open no files; ReferenceTrajectory plays files")
        models = {name: model for name, model in models.items() if model != "ReferenceTrajectory"}
        embed_weights = embed_weights or weights is not None
    check_reading(unit, None)
    extras: dict[str, dict[str, Any]] = {}  # of some models
    if weights is not None:
        model = _one_of(models, "--weights", "HybridPredictor", "SepCompensator")
        saved_weights(weights, axis, model)  # before any file is written
        extras[model] = {"weights": weights, "embed_weights": embed_weights}
    elif embed_weights:
        raise ParameterError("--embed-weights needs --weights, which are compiled into the sources")
    if trajectory is not None:
        model = _one_of(models, "--trajectory", "ReferenceTrajectory")
        extras[model] = {"samples": read_trajectory(trajectory, unit=unit, T_s=axis.T_s)[0]}
    names = [*(f"{name}.fmu" for name in models), *([CONFIGURATION_FILE] if controller else [])]
    inputs = {"machine file": machine_path(machine), "saved predictor": weights, "trajectory": trajectory}
    check_outputs([("--out", out / name, ()) for name in names], inputs, force=force)
    if "SepCompensator" in models.values():
        warn_of_estimates([axis])
    paths = []
    with progress_bar(False) as advance:
        if flavour == "native":
            kinds = dict.fromkeys(table_of(axis, model, name).kind for name, model in models.items())
            needed = [(kind, one) for one in expanded(target or default_targets()) for kind in kinds]
            library_paths(needed, lambda one, done: advance(f"compiled {one[0]} for {one[1]}", done))
        for i, (name, model) in enumerate(models.items()):
            advance(name, i / len(models))
            given = {"targets": target or None, "fmi": fmi, "windows": not no_windows, **extras.get(model, {})}
            paths.append(build_fmu(axis, name, out, flavour, **given))
        if controller is not None:
            paths.append(write_configuration(out, fmi))
        advance("done", 1.0)
    print_built(paths)


def _models(axis: "Machine", fmus: Sequence[str], flavour: str, targets: Sequence[str], fmi: str) -> dict[str, str]:
    """Return the FMUs to build, all of the machine's if none is named: name → model."""
    from ..fmi.compile import check_available
    from ..fmi.spec import fmu_names

    models = fmu_names(axis, flavour, fmi)
    if unknown := sorted(set(fmus) - set(models)):
        hint = ""
        if axis.drive_limits is None and any(name.startswith("SepCompensator") for name in unknown):
            hint = f"; {axis.name} has no [drive_limits], which a compensator needs"
        if fmi == FMI_VERSIONS[0] and any("Fmi3" in name for name in unknown):
            hint += "; FMUs of FMI 3.0 need --fmi 3"
        raise ParameterError(f"no FMU {', '.join(unknown)} of {axis.name}; there are {', '.join(models)}{hint}")
    if flavour == "native":
        check_available(targets or ("host",))
    return {name: model for name, model in models.items() if not fmus or name in fmus}


def _one_of(models: Mapping[str, str], option: str, *users: str) -> str:
    """Return the one model of those to build that an option is for."""
    found = {name: model for name, model in models.items() if model in users}
    if len(found) != 1:
        built = ", ".join(found) or "none"
        raise ParameterError(f"{option} is for one {' or '.join(users)}, this would build {built}; name one")
    return next(iter(found.values()))


def hal(
    machine: Annotated[list[str], typer.Argument(help="Machine files (.toml) or names, an axis each.")],
    out: Annotated[Path, typer.Option(help="Folder for the component's sources and the folders of the axes.")] = Path(
        "linuxcnc"
    ),
    predictor: Annotated[
        bool, typer.Option("--predictor", help="The component that only predicts; it needs no limits of the drive.")
    ] = False,
    weights: options.WeightsOption = None,
    force: options.ForceOption = False,
) -> None:
    """Write the HAL component for LinuxCNC, and its axes.

    It is compiled there: sudo halcompile --install linuxcnc/hsep.c

    The component (compensator, or predictor) is the same for all machines; each axis has a folder of its name that
    ``loadrt hsep axes=`` takes.
    """
    from ..base.files import write_whole
    from ..fmi.controllers import COMPONENTS, axis_files, check_names, component_files
    from ..fmi.weights import WEIGHTS_FILE, saved_weights
    from ..machines.machine import load_machine
    from .console import check_outputs, warn_of_estimates

    model = "HybridPredictor" if predictor else "SepCompensator"
    axes = [load_machine(source) for source in machine]
    names = [axis.name for axis in axes]
    if weights is not None and len(axes) > 1:
        raise ParameterError(f"--weights belong to one axis, got {len(axes)} machines; write them one by one")
    component = COMPONENTS[model]
    check_names(model, names)
    if re.search(r"""[\s,"'#$(\[\\]""", str(out.resolve())):
        raise ParameterError(
            "--out must be a folder whose path has no blank, comma, quote, #, $, (, [ or backslash, at which loadrt "
            f"takes axes= apart, got {out.resolve()}"
        )
    learned = saved_weights(weights, axes[0], model)
    files = {out / name: content for name, content in component_files(model).items()}
    for axis in axes:
        files |= {out / axis.name / name: content for name, content in axis_files(axis, model, learned).items()}
    # of an earlier call: the axis would start with them
    stale = [path for axis in axes if (path := out / axis.name / WEIGHTS_FILE) not in files and path.is_file()]
    changed = [path for path, content in files.items() if not (path.is_file() and path.read_bytes() == content)]
    check_outputs([("--out", path, ()) for path in (*changed, *stale)], {"saved predictor": weights}, force=force)
    for path, content in files.items():
        write_whole(path, content)
    if not predictor:
        warn_of_estimates(axes)
    for path in stale:
        path.unlink()
        typer.echo(f"{path} removed: without --weights the axis starts cold")
    typer.echo(f"{out / component}.c written, with sources; install it: sudo halcompile --install {out / component}.c")
    typer.echo(f"loadrt {component} axes={','.join(str((out / name).resolve()) for name in names)}")


def header(
    machine: Annotated[str, typer.Argument(help="Machine file (.toml) or name.")],
    out: Annotated[Path | None, typer.Option(help="The header; named after the machine if left out.")] = None,
    predictor: Annotated[
        bool, typer.Option("--predictor", help="Of the predictor only; it needs no limits of the drive.")
    ] = False,
    weights: options.WeightsOption = None,
    force: options.ForceOption = False,
) -> None:
    """Write an axis as a C header for the library in C.

    The library is fmu_src/c: a compensator, or a predictor, for a controller that runs no FMU. The header has the
    axis's modes, settings and, with ``--weights``, what an earlier run has learned.
    """
    from ..base.files import write_whole
    from ..fmi.controllers import axis_header
    from ..fmi.weights import saved_weights
    from ..machines.machine import load_machine, machine_path
    from .console import check_outputs, warn_of_estimates

    axis = load_machine(machine)
    model = "HybridPredictor" if predictor else "SepCompensator"
    text = axis_header(axis, model, saved_weights(weights, axis, model))
    path = Path(f"{axis.name}.h") if out is None else out
    inputs = {f"machine file {machine}": machine_path(machine), "saved predictor": weights}
    check_outputs([("--out", path, (".h",))], inputs, force=force)
    if not predictor:
        warn_of_estimates([axis])
    write_whole(path, text)
    typer.echo(f"{path} written: include it after installing the library, whose README.md says how (fmu_src/c)")
