"""Native flavour of the FMUs: C99 sources compiled for every platform, without dependencies.

The archive holds the sources as well: ``sources/all.c`` includes all the others, and compiles without warnings. As FMI
2.0, section 2.3, has it, the three FMI headers come from whoever compiles. They decide whether the names of the FMI
functions begin with the model identifier: the standard's headers put it there, for several FMUs in one program; headers
for shared libraries (fmpy's) do not.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from numpy.typing import ArrayLike

from ..base.data_files import data_folder
from ..base.signals import as_samples
from ..base.version import __version__
from ..machines.machine import Machine
from ..plants.trajectory import spiral, staircase
from ..predict.predictor import HybridPredictor
from .c_header import c_header
from .compiler import binaries, default_targets
from .content import content_guid
from .model_description import build_description, model_description
from .pages import icon, index_page
from .reference import reference_files
from .weights import WEIGHTS_FILE, weights_file

__all__ = ["all_c", "files", "fmi_headers", "sources"]

_FMI_HEADERS = ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h")
_TRAJECTORY_MAGIC = b"HSEPTRJ1"


def files(
    machine: Machine,
    description: Mapping[str, object],
    *,
    targets: Sequence[str] | None = None,
    samples: ArrayLike | None = None,
    trained: HybridPredictor | None = None,
    on_target: Callable[[str], object] = lambda _target: None,
) -> dict[str, bytes]:
    """Return all files of one FMU: archive name → content.

    Parameters
    ----------
    machine : Machine
    description : mapping
        ``model``, ``name``, ``parameters`` and ``modes``.
    targets, samples, on_target
        As in :func:`hybridsep.fmi.archive.build_fmu`.
    trained : HybridPredictor, optional
        Trained predictor with which a HybridPredictor or SepCompensator starts warm.

    Raises
    ------
    FmuError
        If it cannot be compiled.
    """
    model, name = str(description["model"]), str(description["name"])
    content = {f"sources/{file}": text for file, text in sources(description, guid="").items()}
    del content["sources/hsep_fmu.h"]  # names the GUID
    content |= {f"documentation/licenses/{file}": text for file, text in _licenses().items()}
    reference = reference_files(machine, description, samples=samples, trained=trained)
    needs = "The FMU needs nothing but its own binary; on Windows before 10 also the Universal C Runtime (KB2999226)."
    content["documentation/index.html"] = index_page(machine, description, needs, reference=bool(reference))
    content["model.png"] = icon(model)
    if model == "ReferenceTrajectory":
        content |= {f"resources/{file}": data for file, data in _trajectories(machine.T_s, samples).items()}
    if trained is not None:
        content[f"resources/{WEIGHTS_FILE}"] = weights_file(trained)
    guid = content_guid(content, description)
    content |= reference  # computed by this machine's LAPACK: it stays out of the GUID, as the binaries do
    content["sources/hsep_fmu.h"] = c_header(description, guid).encode()
    content["sources/buildDescription.xml"] = build_description(name)
    tool = f"hybridsep {__version__}"
    content["modelDescription.xml"] = model_description(machine, description, guid, tool, native=True, samples=samples)
    folder = "sources/"
    unit = {file.removeprefix(folder): text for file, text in content.items() if file.startswith(folder)}
    unit |= fmi_headers()
    for path, binary in binaries(unit, name, targets or default_targets(), on_target).items():
        content[f"binaries/{path}"] = binary
    return content


def sources(description: Mapping[str, object], guid: str) -> dict[str, bytes]:
    """Return the C sources with the generated ``hsep_fmu.h``, without :func:`fmi_headers`: file name → content.

    Parameters
    ----------
    description : mapping
        ``model``, ``name``, ``parameters`` and ``modes``.
    guid : str
        The modelDescription's.
    """
    root = data_folder("fmu_src") / "c"
    ours = {path.name: path.read_bytes() for path in sorted(root.rglob("*.[ch]"))}
    unit = all_c([file for file in ours if file.endswith(".c")])
    return {"all.c": unit.encode(), **ours, "hsep_fmu.h": c_header(description, guid).encode()}


def all_c(files: Sequence[str]) -> str:
    """Return the C file that includes all others, in which the FMI functions alone have external linkage."""
    includes = "".join(f'#include "{file}"\n' for file in files)
    return f"""/* The whole FMU as one translation unit: compile this file alone, with your FMI 2.0 headers. */
#define HSEP_API static inline /* see hsep_api.h */

{includes}"""


def fmi_headers() -> dict[str, bytes]:
    """Return the FMI 2.0 headers for shared libraries, as fmpy carries them, with the line ends of a text file."""
    import fmpy

    folder = Path(fmpy.__file__).parent / "c-code"
    return {file: (folder / file).read_bytes().replace(b"\r\n", b"\n") for file in _FMI_HEADERS}


def _licenses() -> dict[str, bytes]:
    """Return our licence and the one of the FMI headers, which they carry in their own comments."""
    root = data_folder("fmu_src").parent
    comment = fmi_headers()["fmi2Functions.h"].decode()
    notice = re.search(r"^ *Copyright \(C\).*?DAMAGE\.$", comment, re.DOTALL | re.MULTILINE)
    assert notice is not None  # the headers have been the same since 2019
    lines = ["fmi2Functions.h, fmi2FunctionTypes.h and fmi2TypesPlatform.h, with which the binaries were compiled:", ""]
    lines += [line.strip() for line in notice.group().splitlines()]
    fmi = "\n".join(lines) + "\n"
    return {"license.txt": (root / "LICENSE").read_bytes(), "fmi-headers.txt": fmi.encode()}


def _trajectories(T_s: float, samples: ArrayLike | None) -> dict[str, bytes]:
    """Return ``trajectory_<n>.bin`` of the staircase, the spiral's axes and, if there are some, the user's samples."""
    played = [staircase(T_s), *spiral(T_s)]
    if samples is not None:
        played.append(as_samples(samples, "samples"))
        as_samples(played[-1][:1], "samples", 1)
    return {
        f"trajectory_{n}.bin": _TRAJECTORY_MAGIC + struct.pack("<Qd", len(x_d), T_s) + x_d.astype("<f8").tobytes()
        for n, x_d in enumerate(played)
    }
