"""Command ``hybridsep hal``."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from .estimates import warn_of_estimates
from .options import ForceOption, WeightsOption

__all__ = ["hal"]


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
    from ..base.errors import ParameterError
    from ..base.output import written_whole
    from ..fmi.controllers import COMPONENTS, axis_files, check_names, component_files
    from ..fmi.weights import WEIGHTS_FILE, load_trained
    from ..machines.machine import load_machine
    from .outputs import check_outputs

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
