"""Short run of the benchmark of damaged files: none is an unexpected error, none ends the process."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from random import Random

import pytest

from benchmarks import hostile, mutations

ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="POSIX only: runs are forked")


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, pytest.param(12, marks=pytest.mark.nightly)])
def test_damaged_files_are_read_or_refused(tmp_path: Path, n: int) -> None:
    options = ["--n", str(n), "--fmus", str(n), "--seed", "7", "--keep", str(tmp_path / "findings")]
    command = [sys.executable, "-m", "benchmarks.hostile", *options]  # every kind
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    findings = tmp_path / "findings" / "findings.txt"
    assert done.returncode == 0, done.stdout + done.stderr + (findings.read_text() if findings.exists() else "")
    assert all(kind in done.stdout for kind in mutations.KINDS)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_what_goes_wrong_is_a_finding(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The judge of the runs tells every way to fail from a refusal."""
    for code, outcome in (
        ("pass", "read"),
        ("import os; os.kill(os.getpid(), 9)", "killed"),
        ("raise SystemExit(_said('error: short'))", "refused"),
        ("raise SystemExit(_said('warning: one\\nerror: two'))", "refused"),
        ("raise SystemExit(_said('error: x.fmu: unexpected end of data'))", "refused"),
        ("raise SystemExit(_said('handled: one\\nfixed: two\\nerror: three'))", "refused"),
        ("raise SystemExit(_said('Inconsistency detected by ld.so: one\\nerror: two'))", "refused"),
        ("raise SystemExit(_said('error: one\\ntwo'))", "untidy"),
        ("raise SystemExit(_said('error: ' + 'x' * 2000))", "untidy"),
        ("raise SystemExit(_said('error: unexpected KeyError: 3; this is a fault of hybridsep'))", "unexpected"),
        ("import time; time.sleep(60)", "hung"),
    ):
        monkeypatch.setattr("hybridsep.app.cli.main", lambda code=code: exec(code, {"_said": _said}))
        monkeypatch.setattr(hostile, "TIME_MAX", 2)
        assert hostile.run([], tmp_path)[0] == outcome


def _said(text: str) -> int:
    sys.stderr = sys.__stderr__
    print(text, file=sys.stderr, flush=True)
    return 2


@pytest.mark.parametrize("kind", [kind for kind in mutations.KINDS if kind != "fmu"])
def test_damage_is_reproducible(tmp_path: Path, kind: str) -> None:
    files = mutations.originals(kind, tmp_path)
    changed = [
        [mutations.mutated(kind, content, Random(i)) for i in range(20) for _, content in files] for _ in range(2)
    ]
    assert changed[0] == changed[1]
    originals = {content for _, content in files}
    assert sum(content not in originals for content in changed[0]) > 0.9 * len(changed[0])
