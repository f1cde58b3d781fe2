"""libFuzzer on the library's interface, with the address and undefined-behaviour sanitizers (fuzz/library.c)."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
from c_compiler import C_SOURCES, include_flags
from places import ROOT

RUNS = 1500


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("clang"), reason="clang is missing: apt install clang libclang-rt-14-dev")
def test_no_input_breaks_the_library(tmp_path: Path) -> None:
    sources = [
        path
        for path in sorted((C_SOURCES / "core").rglob("*.c"))
        if path.parent.name != "drives" and path.name != "hsep_clock.c"
    ]
    options = ["-std=c99", "-g", "-O1", "-ffp-contract=off", "-fno-sanitize-recover=all"]
    build = ["clang", *options, "-fsanitize=fuzzer,address,undefined", *include_flags()]
    harness = ROOT / "tests" / "c" / "fuzz" / "library.c"
    subprocess.run([*build, *map(str, [harness, *sources]), "-lm", "-o", str(tmp_path / "fuzz")], check=True)
    command = [str(tmp_path / "fuzz"), f"-runs={RUNS}", "-seed=1", "-max_len=4096", "-len_control=0"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stderr[-3000:]
    assert f"Done {RUNS} runs" in done.stderr
