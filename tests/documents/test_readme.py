"""Executed README: CI's commands, code blocks, machine file."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from places import ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def test_the_two_commands_come_first_and_ci_runs_the_second() -> None:
    first, second = (block.strip() for block in blocks("sh")[:2])
    assert "\n" not in first + second
    assert first.endswith(".venv/bin/hybridsep demo --out demo")
    assert second in (ROOT / ".ci" / "run").read_text().splitlines()


@pytest.mark.skipif(not shutil.which("bash"), reason="CI's script needs bash")
def test_ci_prints_and_keeps_the_stacks_of_a_crash(tmp_path: Path) -> None:
    script = (ROOT / ".ci" / "run").read_text()
    command = blocks("sh")[1].strip()
    crash = f"{shlex.quote(sys.executable)} -c 'import os; print(1); os.abort()'"
    (tmp_path / ".ci").mkdir()
    (tmp_path / ".ci" / "run").write_text(script.replace(command, crash))
    done = subprocess.run(["bash", tmp_path / ".ci" / "run"], capture_output=True, text=True)
    assert done.returncode != 0
    assert "Fatal Python error: Aborted" in done.stdout
    assert (tmp_path / ".ci" / "run.log").read_text() == done.stdout


def test_processes_of_tests_tell_where_they_crash() -> None:
    done = subprocess.run([sys.executable, "-c", "import os; os.abort()"], capture_output=True, text=True)
    assert "Fatal Python error: Aborted" in done.stderr


def test_python_blocks_run(tmp_path: Path) -> None:
    intake, block, disturbances, closed_loop = blocks("python")
    assert len(block.strip().splitlines()) <= 12
    done = subprocess.run([sys.executable, "-W", "error", "-c", intake], cwd=tmp_path, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("1 True\n", "")
    done = subprocess.run([sys.executable, "-W", "error", "-c", block], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    rms_pb, rms_h = map(float, done.stdout.splitlines()[0].split())
    assert rms_h < 0.5 * rms_pb
    command = [sys.executable, "-W", "error", "-c", disturbances]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", closed_loop], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert float(done.stdout.split()[0]) < 8.0


def test_the_machine_file_in_the_readme_is_valid(tmp_path: Path) -> None:
    from hybridsep import load_machine

    (block,) = blocks("toml")
    path = tmp_path / "my_axis.toml"
    path.write_text(block, encoding="utf-8")
    assert load_machine(path).model.dc_gain == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(
    "example", sorted(path.name for path in (ROOT / "examples").glob("*.py") if "__main__" in path.read_text("utf-8"))
)
def test_examples_run(example: str, tmp_path: Path) -> None:
    command = [sys.executable, "-W", "error", str(ROOT / "examples" / example)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout
