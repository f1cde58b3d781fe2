"""Run that gives an FMU's reference results: the FMU's own where this machine can run it, else the library's."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from ..machines.machine import Machine
from .c_header import kind_of
from .description import fmu_description
from .host_fmu import host_fmu
from .libraries import is_kept_here
from .reference import reference_files

if TYPE_CHECKING:
    from ..predict.predictor import HybridPredictor

__all__ = ["reference_run"]

_FOLDER = "resources/"


def reference_run(
    machine: Machine,
    description: Mapping[str, object],
    guid: str,
    content: Mapping[str, bytes],
    *,
    native: bool,
    samples: ArrayLike | None = None,
    trained: HybridPredictor | None = None,
) -> dict[str, bytes]:
    """Return the files of :func:`~hybridsep.fmi.reference.reference_files`.

    Platforms differ in the last digits, so they stay out of the GUID, as the binaries do. A Python FMU's are its native
    twin's, which agrees with it, where that library is there: the Python one takes seconds.

    Parameters
    ----------
    machine : Machine
    description : mapping
        ``model``, ``name``, ``parameters`` and ``modes``.
    guid : str
        The modelDescription's.
    content : mapping
        Archive name → content; a native model reads ``resources/``.
    native : bool
        Whether the FMU is native, so that its library is compiled where it is not there.
    samples, trained
        As in :func:`hybridsep.fmi.native_flavour.files`.
    """
    resources = {
        file.removeprefix(_FOLDER): data
        for file, data in content.items()
        if file.startswith(_FOLDER) and file.endswith(".bin")
    }
    plant = None if machine.plant is None else fmu_description(machine, "FeedDrive", "drive")
    kinds = [kind_of(each) for each in (description, plant) if each is not None]
    if native or all(map(is_kept_here, kinds)):
        with ExitStack() as running:
            fmu = running.enter_context(host_fmu(description, guid, resources, machine.T_s))
            if fmu is not None:
                drive = None if plant is None else running.enter_context(host_fmu(plant, "{drive}", {}, machine.T_s))
                return reference_files(machine, description, fmu, drive)
    # what the library's models need loads slowly
    from .reference_models import library_models

    return reference_files(
        machine, description, *library_models(machine, description, samples=samples, trained=trained)
    )
