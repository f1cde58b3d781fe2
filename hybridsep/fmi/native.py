"""Native flavour of the FMUs: libraries for every platform, without dependencies.

A library serves all FMUs of a kind; ``resources/variables.bin`` tells it which one it is. The archive holds the sources
as well, with a header that has what the file has: ``sources/all.c`` includes all the others, and compiles without
warnings. As FMI 2.0, section 2.3, has it, the three FMI headers come from whoever compiles. They decide whether the
names of the FMI functions begin with the model identifier: the standard's headers put it there, for several FMUs in one
program; headers for shared libraries (fmpy's) do not. FMI 3.0's put it there unless
``FMI3_OVERRIDE_FUNCTION_PREFIX`` is defined. An FMI 3.0 archive holds the same libraries, and the sources of its own
version.
"""

import re
import struct
from collections.abc import Sequence

from ..base.files import data_folder
from ..base.version import __version__
from ..plants.trajectory import spiral, staircase
from . import description
from .c_header import FMI_HEADERS, TABLE_FILE, c_header, c_sources, fmi_headers, table_file
from .compile import default_targets, libraries, placed
from .flavours import FMI_VERSIONS, filled
from .reference import reference_run
from .spec import FmuSpec, content_guid
from .weights import WEIGHTS_FILE


def files(
    spec: FmuSpec, *, targets: Sequence[str] | None = None, embed_weights: bool = False, reference: bool = True
) -> dict[str, bytes]:
    """Return an FMU's files, name → content; arguments as of ``build_fmu``; FmuError if it cannot be compiled.

    ``reference``: whether it has a run to compare with, which takes a second or two.
    """
    table, fmi = spec.table, spec.fmi
    model, name = table.model, table.name
    content = {f"sources/{file}": text for file, text in c_sources((fmi,)).items()}
    content |= {f"documentation/licenses/{file}": text for file, text in _licenses().items()}
    needs = "The FMU needs nothing but its own binary; on Windows before 10 also the Universal C Runtime (KB2999226)."
    if fmi == "3":
        content[description.TERMINALS_FILE] = description.terminals_and_icons(model)
    content[description.ICON_FILE if fmi == "3" else "model.png"] = description.icon(model)
    if model == "ReferenceTrajectory":
        T_s = spec.machine.T_s
        # NumPy's sine differs by 0.1 fm from one version or processor to another: rounded to 10 pm, archives are alike
        played = [staircase(T_s), *(axis.round(11) for axis in spiral(T_s))]
        for n, x_d in enumerate(played if spec.samples is None else [*played, spec.samples]):
            binary = b"HSEPTRJ1" + struct.pack("<Qd", len(x_d), T_s) + x_d.astype("<f8").tobytes()
            content[f"resources/trajectory_{n}.bin"] = binary
    if spec.weights is not None:
        content[f"resources/{WEIGHTS_FILE}"] = spec.weights
    run = reference_run(spec) if reference else {}
    dependencies, sources = filled("native_dependencies.txt"), description.compile_note(name, fmi)
    content |= description.documentation(spec, needs, dependencies, run, sources=sources)
    guid = content_guid(content, table)
    content[f"resources/{TABLE_FILE}"] = table_file(table, guid)
    content["sources/hsep_fmu.h"] = c_header(table, guid, fmi, spec.weights if embed_weights else None).encode()
    content["sources/buildDescription.xml"] = description.build_description(name, fmi)
    content["modelDescription.xml"] = description.model_description(spec, guid, f"hybridsep {__version__}")
    content |= run
    compiled = libraries(table.kind, targets or default_targets())
    return content | {f"binaries/{path}": library for path, library in placed(compiled, name, fmi).items()}


def _licenses() -> dict[str, bytes]:
    """Return our licence, the FMI headers' licences, which are in their own comments, and the compiler's."""
    folder = data_folder("fmu_src")
    zig, mingw = ((folder / "c" / "licenses" / f"{one}.txt").read_text("utf-8") for one in ("zig", "mingw-w64"))
    lines = []
    for version in FMI_VERSIONS:
        first, second, third = FMI_HEADERS[version]
        comment = fmi_headers((version,))[first].decode()
        notice = re.search(r"^ *Copyright \(C\).*?DAMAGE\.$", comment, re.DOTALL | re.MULTILINE)
        assert notice is not None  # the headers have been the same since 2019 and 2023
        lines += [f"{first}, {second} and {third}, with which the binaries were compiled:", ""]
        lines += [*(line.strip() for line in notice.group().splitlines()), ""]
    return {
        "license.txt": (folder.parent / "LICENSE").read_bytes(),
        "fmi-headers.txt": ("\n".join(lines).rstrip("\n") + "\n").encode(),
        "compiler-runtime.txt": filled("compiler_runtime.txt", zig=zig, mingw=mingw).encode(),
    }
