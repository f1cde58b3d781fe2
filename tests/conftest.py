"""Set up what every test shares."""

from __future__ import annotations

import os

# Threads make the small factorisations of these tests slower by two orders of magnitude on a busy machine. The
# variable must be set before NumPy is loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import Run

from hybridsep import build_fmu, fmu_names, load_machine, machine_names


@pytest.fixture(scope="session")
def python_fmu(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Return a function that gives the path of a pythonfmu FMU by name, built once a session."""
    folder = tmp_path_factory.mktemp("fmus")
    machines = {
        name: machine for machine in map(load_machine, machine_names()) for name in fmu_names(machine, "python")
    }

    def path(name: str) -> Path:
        archive = folder / f"{name}.fmu"
        return archive if archive.exists() else build_fmu(machines[name], name, folder, "python")

    return path


@pytest.fixture
def hybridsep(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    return Run(monkeypatch, capsys)
