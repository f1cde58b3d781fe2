"""The page `try`: a predictor for a log that is dropped on it, by the C library as WebAssembly, beside the site."""

from __future__ import annotations

import base64
import gzip
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

ROOT = Path(__file__).resolve().parents[1]
HERE, CORE = ROOT / "docs" / "try", ROOT / "fmu_src" / "c" / "core"
FLAGS = ["-target", "wasm32-wasi", "-mexec-model=reactor", "-std=c99", "-O3", "-msimd128", "-ffp-contract=off", "-s"]


def setup(app: Sphinx) -> None:
    """Build the page beside the site's others."""

    def finished(app: Sphinx, error: Exception | None) -> None:
        if error is None:
            build(Path(app.outdir) / "try")

    app.connect("build-finished", finished)


def build(out: Path) -> None:
    """Build the page into a folder. Browsers load no module beside a file, but a script: it has the module as text."""
    out.mkdir(parents=True, exist_ok=True)
    includes = [f"-I{folder}" for folder in sorted({path.parent for path in CORE.parent.rglob("*.h")})]
    sources = [str(path) for path in (HERE / "try.c", *sorted(CORE.rglob("*.c")))]
    with TemporaryDirectory() as folder:
        module = Path(folder) / "hsep.wasm"
        command = [sys.executable, "-m", "ziglang", "cc", *FLAGS, *includes, *sources, "-o", str(module)]
        subprocess.run(command, check=True)
        text = base64.b64encode(module.read_bytes()).decode()
    (out / "hsep.wasm.js").write_text(f'"use strict";\nconst MODULE = "{text}";\n', encoding="utf-8")
    for name in ("index.html", "try.js"):
        shutil.copyfile(HERE / name, out / name)
    example = ROOT / "hybridsep" / "logs" / "example_axis.csv.gz"
    (out / "example.csv").write_bytes(gzip.decompress(example.read_bytes()))
