"""Run that gives an FMU's reference results: the FMU's own where this machine can run it, else the library's."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack

from .fmu import Fmu, table_of
from .host_fmu import host_fmu
from .libraries import is_kept_here
from .reference import reference_files

__all__ = ["reference_run"]

_FOLDER = "resources/"


def reference_run(fmu: Fmu, guid: str, content: Mapping[str, bytes], *, native: bool) -> dict[str, bytes]:
    """Return the files of :func:`~hybridsep.fmi.reference.reference_files`.

    Platforms differ in the last digits, so they stay out of the GUID, as the binaries do. A Python FMU's are its native
    twin's, which agrees with it, where that library is there: the Python one takes seconds.

    Parameters
    ----------
    fmu : Fmu
    guid : str
        The modelDescription's.
    content : mapping
        Archive name → content; a native model reads ``resources/``.
    native : bool
        Whether the FMU is native, so that its library is compiled where it is not there.
    """
    resources = {
        file.removeprefix(_FOLDER): data
        for file, data in content.items()
        if file.startswith(_FOLDER) and file.endswith(".bin")
    }
    machine, table = fmu.machine, fmu.table
    plant = None if machine.plant is None else table_of(machine, "FeedDrive", "drive")
    if native or all(is_kept_here(each.kind) for each in (table, plant) if each is not None):
        with ExitStack() as running:
            model = running.enter_context(host_fmu(table, guid, resources, machine.T_s))
            if model is not None:
                drive = None if plant is None else running.enter_context(host_fmu(plant, "{drive}", {}, machine.T_s))
                return reference_files(machine, table, model, drive)
    # what the library's models need loads slowly
    from .reference_models import library_models

    return reference_files(machine, table, *library_models(fmu))
