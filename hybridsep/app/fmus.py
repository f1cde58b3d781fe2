"""Commands that write FMUs and sources for controllers: ``build``, ``hal`` and ``header``."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..base.errors import ParameterError
from ..fmi.flavours import FLAVOURS, FMI_VERSIONS, check_version
from .options import ForceOption, TargetOption, UnitOption, WeightsOption

if TYPE_CHECKING:
    from ..fmi.compile import Library
    from ..machines.machine import Machine

    Job = tuple[Machine, str, str]
    """An FMU to build: its machine, name and model."""

__all__ = ["build", "hal", "header"]

CONTROLLERS = ("twincat",)
"""Controllers that ``--for`` takes."""


def build(
    fmus: Annotated[
        list[str] | None, typer.Argument(help="FMUs to build, by name; all of the machines' if left out.")
    ] = None,
    machine: Annotated[
        list[str] | None,
        typer.Option("--machine", "-m", help="Machine file (.toml) or name; may be repeated; all if left out."),
    ] = None,
    flavour: Annotated[str, typer.Option(help=f"Flavour of the FMUs: {', '.join(FLAVOURS)}.")] = FLAVOURS[0],
    fmi: Annotated[
        str,
        typer.Option(
            help=f"Version of FMI: {', '.join(FMI_VERSIONS)}; FMUs of FMI 3.0 are native, their names have Fmi3."
        ),
    ] = FMI_VERSIONS[0],
    target: TargetOption = None,
    weights: WeightsOption = None,
    trajectory: Annotated[
        Path | None,
        typer.Option(help="CSV, .npz or .mat file with the columns t and x_d, for ReferenceTrajectory to play."),
    ] = None,
    unit: UnitOption = None,
    windows: Annotated[
        bool,
        typer.Option(
            "--windows/--no-windows",
            help="Whether a HybridPredictor shows its whole window, 4·Np scalars or four arrays.",
        ),
    ] = True,
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
            help=f"Controller that compiles the sources: {', '.join(CONTROLLERS)}. Weights are compiled in, what "
            "plays files is left out, and a file that its tool needs lies beside the FMUs.",
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the archives.")] = Path("dist"),
    force: ForceOption = False,
) -> None:
    """Build FMUs from machine files.

    The same machine gives the same bytes.
    """
    from ..fmi.archive import build_fmu
    from ..fmi.compile import library_paths, missing
    from ..fmi.controllers import CONFIGURATION_FILE, write_configuration
    from ..machines.machine import machine_path
    from .console import check_outputs, print_built, progress_bar, warn_of_estimates

    if embed_weights and flavour != "native":
        raise ParameterError(f"--embed-weights is for native FMUs; with --flavour {flavour} leave it out")
    if controller is not None and controller not in CONTROLLERS:
        raise ParameterError(f"--for must be {' or '.join(CONTROLLERS)}, got {controller}")
    if controller is not None and flavour != "native":
        raise ParameterError(f"--for {controller} is for native FMUs; with --flavour {flavour} leave it out")
    jobs = _jobs_of(fmus or [], machine or [], flavour, target or [], fmi)
    if controller is not None:
        jobs = _without_files(jobs, f"--for {controller}", named=bool(fmus))
        embed_weights = embed_weights or weights is not None
    extras = _extras_of(jobs, weights, trajectory, unit, windows=windows, embed_weights=embed_weights)
    inputs = {f"machine file {source}": machine_path(source) for source in machine or []}
    check_outputs(
        [
            *(("--out", out / f"{name}.fmu", ()) for _, name, _ in jobs),
            *([("--out", out / CONFIGURATION_FILE, ())] if controller else []),
        ],
        {**inputs, "saved predictor": weights, "trajectory": trajectory},
        force=force,
    )
    warn_of_estimates({axis.name: axis for axis, _, model in jobs if model == "SepCompensator"}.values())
    paths = []
    with progress_bar(False) as advance:
        if flavour == "native":
            needed = _libraries_of(jobs, target or [])
            made = iter(range(1, (n := len(missing(needed))) + 1))
            advance(f"compile {n} libraries", 0.0)
            library_paths(needed, lambda one: advance(f"compiled {one[0]} for {one[1]}", next(made) / n))
        for i, (axis, name, model) in enumerate(jobs):
            advance(name, i / len(jobs))
            given = {"targets": target or None, "fmi": fmi, **extras.get(model, {})}
            paths.append(build_fmu(axis, name, out, flavour, **given))
        if controller is not None:
            paths.append(write_configuration(out, paths))
        advance("done", 1.0)
    print_built(paths)


def _jobs_of(fmus: Sequence[str], machines: Sequence[str], flavour: str, targets: Sequence[str], fmi: str) -> list[Job]:
    """Return the FMUs to build, all of the machines' if none is named."""
    from ..fmi.compile import check_available
    from ..fmi.spec import fmu_names
    from ..machines.machine import load_machine, machine_names

    check_version(flavour, fmi)
    jobs = [
        (axis, name, model)
        for axis in map(load_machine, machines or machine_names())
        for name, model in fmu_names(axis, flavour, fmi).items()
    ]
    if unknown := sorted(set(fmus) - {name for _, name, _ in jobs}):
        without = dict.fromkeys(axis.name for axis, _, _ in jobs if axis.drive_limits is None)
        hint = ""
        if without and any(name.startswith("SepCompensator") for name in unknown):
            hint = f"; {', '.join(without)} has no [drive_limits], which a compensator needs"
        if fmi == FMI_VERSIONS[0] and any("Fmi3" in name for name in unknown):
            hint += "; FMUs of FMI 3.0 need --fmi 3"
        raise ParameterError(f"no FMU {', '.join(unknown)}; there are {', '.join(name for _, name, _ in jobs)}{hint}")
    if targets and flavour != "native":
        raise ParameterError(f"--target is for native FMUs; with --flavour {flavour} leave it out")
    if flavour == "native":
        check_available(targets or ("host",))
    return [job for job in jobs if not fmus or job[1] in fmus]


def _libraries_of(jobs: Sequence[Job], targets: Sequence[str]) -> list[Library]:
    """Return the libraries of native FMUs for some platforms, the default ones if none is named."""
    from ..fmi.compile import default_targets, expanded
    from ..fmi.spec import table_of

    kinds = dict.fromkeys(table_of(axis, model, name).kind for axis, name, model in jobs)
    return [(kind, target) for target in expanded(targets or default_targets()) for kind in kinds]


def _extras_of(
    jobs: Sequence[Job],
    weights: Path | None,
    trajectory: Path | None,
    unit: str | None,
    *,
    windows: bool = True,
    embed_weights: bool = False,
) -> dict[str, dict[str, Any]]:
    """Return what is special about some of the FMUs: model → keywords of ``build_fmu``.

    Weights, which ``embed_weights`` compiles into the sources, and the samples of a trajectory are for one of them;
    ``windows=False`` for all that have windows.
    """
    from ..fmi.weights import load_trained
    from ..logs.log import check_reading
    from ..plants.trajectory import read_trajectory

    extras: dict[str, dict[str, Any]] = {}
    check_reading(unit, None)
    if weights is not None:
        axis, model = _one_of(jobs, ("HybridPredictor", "SepCompensator"), "--weights")
        load_trained(weights, axis, model)
        extras[model] = {"weights": weights, **({"embed_weights": True} if embed_weights else {})}
    elif embed_weights:
        raise ParameterError("--embed-weights needs --weights, which are compiled into the sources")
    if trajectory is not None:
        axis, model = _one_of(jobs, ("ReferenceTrajectory",), "--trajectory")
        extras[model] = {"samples": read_trajectory(trajectory, unit=unit, T_s=axis.T_s)[0]}
    if not windows:
        if not any(model == "HybridPredictor" for _, _, model in jobs):
            names = ", ".join(name for _, name, _ in jobs)
            raise ParameterError(f"--no-windows is for a HybridPredictor, this would build {names}; leave it out")
        extras["HybridPredictor"] = {**extras.get("HybridPredictor", {}), "windows": False}
    return extras


def _without_files(jobs: Sequence[Job], option: str, *, named: bool) -> list[Job]:
    """Return the FMUs whose sources open no file; ReferenceTrajectory plays files.

    Raises
    ------
    ParameterError
        If there is none, or a ReferenceTrajectory was asked for by name.
    """
    kept = [job for job in jobs if job[2] != "ReferenceTrajectory"]
    if not kept or (named and len(kept) < len(jobs)):
        raise ParameterError(f"{option} is for FMUs that open no files; ReferenceTrajectory plays files, leave it out")
    return kept


def _one_of(jobs: Sequence[Job], models: Sequence[str], option: str) -> tuple[Machine, str]:
    """Return machine and model of the one FMU of these models to which an option applies."""
    found = [job for job in jobs if job[2] in models]
    if len({(axis.name, model) for axis, _, model in found}) != 1:
        names = ", ".join(name for _, name, _ in found) or "none"
        raise ParameterError(
            f"{option} is for one {' or '.join(models)}, this would build {names}; name one, or its --machine"
        )
    return found[0][0], found[0][2]


def hal(
    machine: Annotated[list[str], typer.Argument(help="Machine files (.toml) or names, an axis each.")],
    out: Annotated[Path, typer.Option(help="Folder for the component's sources and the folders of the axes.")] = Path(
        "linuxcnc"
    ),
    predictor: Annotated[
        bool, typer.Option("--predictor", help="The component that predicts alone; it needs no limits of the drive.")
    ] = False,
    weights: WeightsOption = None,
    force: ForceOption = False,
) -> None:
    """Write the HAL component for LinuxCNC, and its axes.

    It is compiled there: sudo halcompile --install linuxcnc/hsep.c

    The component (compensator, or predictor) is the same for all machines; each axis has a folder of its name that
    ``loadrt hsep axes=`` takes.
    """
    from ..base.files import written_whole
    from ..fmi.controllers import COMPONENTS, axis_files, check_names, component_files
    from ..fmi.weights import WEIGHTS_FILE, load_trained
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
    trained = None if weights is None else load_trained(weights, axes[0], model)
    files = {out / name: content for name, content in component_files(model).items()}
    for axis in axes:
        files |= {out / axis.name / name: content for name, content in axis_files(axis, model, trained).items()}
    # of an earlier call: the axis would start with them
    stale = [path for axis in axes if (path := out / axis.name / WEIGHTS_FILE) not in files and path.is_file()]
    changed = [path for path, content in files.items() if not (path.is_file() and path.read_bytes() == content)]
    check_outputs(
        [("--out", path, ()) for path in (*changed, *stale)],
        {"saved predictor": weights},
        force=force,
    )
    for path, content in files.items():
        with written_whole(path) as file:
            file.write(content)
    if not predictor:
        warn_of_estimates(axes)
    for path in stale:
        path.unlink()
        typer.echo(f"{path} removed: without --weights the axis starts cold")
    typer.echo(
        f"{out / component}.c written, with its sources; install it: sudo halcompile --install {out / component}.c"
    )
    typer.echo(f"loadrt {component} axes={','.join(str((out / name).resolve()) for name in names)}")


def header(
    machine: Annotated[str, typer.Argument(help="Machine file (.toml) or name.")],
    out: Annotated[Path | None, typer.Option(help="The header; named after the machine if left out.")] = None,
    predictor: Annotated[
        bool, typer.Option("--predictor", help="Of the predictor alone; it needs no limits of the drive.")
    ] = False,
    weights: WeightsOption = None,
    force: ForceOption = False,
) -> None:
    """Write an axis as a C header for the library in C.

    The library is fmu_src/c: a compensator, or a predictor, for a controller that runs no FMU. The header has the
    axis's modes, settings and, with ``--weights``, what an earlier run has learned.
    """
    from ..base.files import written_text
    from ..fmi.controllers import axis_header
    from ..fmi.weights import load_trained
    from ..machines.machine import load_machine, machine_path
    from .console import check_outputs, warn_of_estimates

    axis = load_machine(machine)
    model = "HybridPredictor" if predictor else "SepCompensator"
    trained = None if weights is None else load_trained(weights, axis, model)
    text = axis_header(axis, model, trained)
    path = Path(f"{axis.name}.h") if out is None else out
    inputs = {f"machine file {machine}": machine_path(machine), "saved predictor": weights}
    check_outputs([("--out", path, (".h",))], inputs, force=force)
    if not predictor:
        warn_of_estimates([axis])
    with written_text(path) as file:
        file.write(text)
    typer.echo(f"{path} written: include it after installing the library, whose README.md says how (fmu_src/c)")
