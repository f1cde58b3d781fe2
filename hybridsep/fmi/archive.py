"""FMU archives, reproducible byte for byte from the sources and the machine.

The content follows from the flavour: :mod:`hybridsep.fmi.native` takes libraries of the C sources,
:mod:`hybridsep.fmi.python` wraps this library.
"""

import io
import shlex
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from numpy.typing import ArrayLike

from ..base.errors import FmuError, check_kind
from ..base.files import as_path, atomic_open, write_whole
from ..machines.machine import Machine
from . import native, python
from .compile import ALL_TARGETS, default_targets, expanded
from .flavours import FLAVOURS, FMI_VERSIONS
from .spec import FmuSpec, fmu_name, fmu_names
from .weights import saved_weights


def build_fmu(
    machine: Machine,
    name: str,
    out: str | Path,
    flavour: str = FLAVOURS[0],
    *,
    targets: Sequence[str] | None = None,
    samples: ArrayLike | None = None,
    weights: str | Path | None = None,
    fmi: str = FMI_VERSIONS[0],
    windows: bool = True,
    embed_weights: bool = False,
) -> Path:
    """Build one FMU; return its path, ``out/name.fmu``.

    Parameters
    ----------
    machine : Machine
        The axis; its values become the parameters' start values.
    name : str
        One of :func:`fmu_names`.
    out : str or Path
        Folder for the archive; made if needed.
    flavour : {"native", "python"}
        Flavour of the FMU; predictors and drives have one in Python.
    targets : sequence of str, optional
        Platforms of a native FMU's binaries: of :data:`hybridsep.fmi.compile.TARGET_NAMES`, ``"host"`` being this
        machine. If left out: all platforms where their libraries are there, else this machine.
    samples : (n,) array_like, m, optional
        Trajectory 3 of ReferenceTrajectory, at the machine's ``T_s``; played unless another one is chosen.
    weights : str or Path, optional
        File of :meth:`HybridPredictor.save`, trained with the settings of this FMU, for a SepCompensator best in
        closed loop (``compensator.predictor.save(...)``): the FMU starts with these weights, without a warm-up.
    fmi : {"2", "3"}
        Version of FMI, 2.0 or 3.0; the Python flavour has only 2.0.
    windows : bool
        Whether a HybridPredictor shows the samples of its window, ``4·Np`` scalars or four arrays.
    embed_weights : bool
        Whether a native FMU's sources have the weights compiled in, for targets without files.

    Raises
    ------
    FmuError
        If the machine has no such FMU, its library cannot be had, or it has no use for ``samples`` or ``weights``.
    SignalError
        If ``samples`` is not finite or empty.
    StateError
        If ``weights`` is no saved predictor, or one of another machine or other settings.
    """
    check_kind(str, name=name)
    check_kind(Sequence | None, targets=targets)
    names = fmu_names(machine, flavour, fmi)
    if name not in names:
        raise FmuError(f"machine {machine.name} has no FMU {name!r}; it has {', '.join(names)}")
    model = names[name]
    uses = ((samples, "samples", ("ReferenceTrajectory",)), (weights, "weights", ("HybridPredictor", "SepCompensator")))
    for given, what, models in uses:
        if given is not None and model not in models:
            raise FmuError(f"{what} are for a {' or a '.join(models)}, {name} is a {model}")
    if embed_weights and (weights is None or flavour != "native"):
        raise FmuError("embed_weights is for a native FMU with weights")
    path = as_path(out, "out") / f"{name}.fmu"
    with atomic_open(path) as file:
        learned = saved_weights(weights, machine, model)
        spec = FmuSpec.of(machine, model, flavour=flavour, fmi=fmi, samples=samples, weights=learned, windows=windows)
        if flavour == "native":
            files = native.files(spec, targets=targets, embed_weights=embed_weights)
        else:
            files = python.files(spec)
        file.write(archived(files))
    return path


def archived(files: Mapping[str, bytes]) -> bytes:
    """Return a zip of files, archive name → content, whose bytes depend only on them, and on the zlib of this Python.

    What readers that stream look for comes first.
    """
    file, first = io.BytesIO(), ("modelDescription.xml", "SystemStructure.ssd")
    with zipfile.ZipFile(file, "w") as archive:
        for arcname in sorted(files, key=lambda key: (key not in first, key)):
            entry = zipfile.ZipInfo(arcname)  # of 1980, its default
            entry.external_attr, entry.create_system = 0o644 << 16, 3
            how = zipfile.ZIP_STORED if arcname.endswith(".fmu") else zipfile.ZIP_DEFLATED
            # deflate's level is fixed: another one, like another implementation, gives other bytes
            archive.writestr(entry, files[arcname], how, 6)
    return file.getvalue()


def build_here(machine: Machine, model: str, out: Path, *, weights: Path | None = None, reference: bool = True) -> Path:
    """Build a machine's native FMU of a model (``FeedDrive``, …), without a ``reference`` to be run here alone."""
    path = out / f"{fmu_name(model, machine.name)}.fmu"
    spec = FmuSpec.of(machine, model, weights=saved_weights(weights, machine, model))
    write_whole(path, archived(native.files(spec, reference=reference)))
    return path


def other_platforms(fmu: Path, machine: Path, weights: Path | None = None) -> tuple[str, ...]:
    """Return which platforms a native FMU was built for here, and the line that builds it for all; empty if it was.

    ``fmu`` is the archive, ``machine`` its machine file, ``weights`` what it has learned.
    """
    targets = expanded(default_targets())
    if set(targets) == set(ALL_TARGETS):
        return ()
    line: list[object] = ["hybridsep", "build", fmu.stem, "--target", "all", "-m", machine]
    line += [] if weights is None else ["--weights", weights]
    line += ["--out", fmu.parent]
    return f"native FMUs are for {', '.join(targets)}; for all platforms", shlex.join(map(str, line))
