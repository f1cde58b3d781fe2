"""Streams of every implementation for tests: a behavioural test that takes one runs on all of them."""

from __future__ import annotations

import shutil
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from built_once import BuiltFmus
from c_core import write_trajectory
from core_stream import CoreStream
from fmu_stream import FmuStream
from library_models import learned_file
from library_stream import LookAheadStream, PlantStream
from stream import (
    CANNOT,
    CORE,
    FMI3,
    IMPLEMENTATIONS,
    LIBRARY,
    NATIVE,
    PYTHON,
    STAGE,
    STAGE_COMPENSATOR,
    STAGE_PREDICTOR,
    TRAJECTORY,
    Stream,
    machine_of,
)

from hybridsep.fmi.weights import WEIGHTS_FILE
from hybridsep.plants.trajectory import staircase

STAGES = (STAGE, STAGE_PREDICTOR, STAGE_COMPENSATOR)
"""Models of the stage's X drive, which differ from the default machine's in modes and settings."""


class StreamMaker:
    """Make streams of one model in one implementation; all that were made are closed together.

    Parameters
    ----------
    implementation, model : str
    fmus : BuiltFmus
        Where archives come from.
    folder : Path
        For the files that the C core reads.
    """

    def __init__(self, implementation: str, model: str, fmus: BuiltFmus, folder: Path) -> None:
        self.implementation, self.model = implementation, model
        self.fmus, self.folder = fmus, folder
        self._made: list[Stream] = []

    def __call__(self, model: str | None = None, *, weights: Path | None = None) -> Stream:
        """Return a new stream, of another model if one is given, that starts warm with a saved predictor."""
        self._made.append(self._new(model or self.model, weights))
        return self._made[-1]

    def planted(self, learned: bytes) -> Stream:
        """Return a new stream whose resources have this ``weights.bin``, which no build would have let in."""
        self._made.append(self._new(self.model, None, learned))
        return self._made[-1]

    def close(self) -> None:
        for stream in self._made:
            stream.close()

    def _new(self, model: str, weights: Path | None, planted: bytes = b"") -> Stream:
        folder = Path(tempfile.mkdtemp(dir=self.folder))
        if self.implementation not in (LIBRARY, CORE):
            archive = self.fmus(fmu_name(model, self.implementation), machine=machine_of(model), weights=weights)
            if planted:
                archive = Path(shutil.copy(archive, folder))
                with zipfile.ZipFile(archive, "a") as content:
                    content.writestr(f"resources/{WEIGHTS_FILE}", planted)
            return FmuStream(archive, model)
        learned = planted or learned_file(weights)
        if self.implementation == LIBRARY:
            return PlantStream(model) if "FeedDrive" in model else LookAheadStream(model, learned)
        if learned:
            (folder / WEIGHTS_FILE).write_bytes(learned)
        if model == TRAJECTORY:
            write_trajectory(folder, staircase())
            (folder / "trajectory_3.bin").rename(folder / "trajectory_0.bin")
        return CoreStream(model, folder, warm=bool(learned))


_SUFFIX = {NATIVE: "", PYTHON: "Py", FMI3: "Fmi3"}


def fmu_name(model: str, implementation: str) -> str:
    """Return the archive's stem, whose flavour follows the model: ``FeedDrivePy_als25010_x``."""
    kind, separator, machine = model.partition("_")
    return f"{kind}{_SUFFIX[implementation]}{separator}{machine}"


def cases(models: Sequence[str], *, needs: str = "", adapters: bool = False, alike: Sequence[str] = ()) -> list[Any]:
    """Return pytest parameters ``(implementation, model)`` for all that there are, and that can do what is needed.

    With ``adapters`` the FMI 3.0 FMU of the first model is among them. What a pythonfmu FMU computes is the library's,
    and what a native FMU computes the C core's: the former runs one set of a test's other parameters, and so does the
    latter but for a test of adapters, and what ``alike`` names (``one_set``); the other sets run at night.
    """
    once = (PYTHON, *alike) if adapters and needs != "agreement" else (PYTHON, NATIVE, *alike)
    pairs = [(implementation, model) for implementation in IMPLEMENTATIONS for model in models]
    if adapters:
        pairs.append((FMI3, models[0]))
    return [
        pytest.param(
            (implementation, model),
            id=f"{implementation}-{model}",
            marks=[
                *([pytest.mark.one_set] if implementation in once else []),
                *([pytest.mark.slow] if implementation == PYTHON or model in STAGES else []),
            ],
        )
        for implementation, model in pairs
        if not {(implementation, model), (implementation, needs)} & CANNOT.keys()
    ]


def on_all(models: Sequence[str], *, needs: str = "", alike: Sequence[str] = ()) -> pytest.MarkDecorator:
    """Return the mark of a test that takes ``new_stream``, on all implementations."""
    return pytest.mark.parametrize("new_stream", cases(models, needs=needs, alike=alike), indirect=True)


def on_adapters(models: Sequence[str], *, needs: str = "") -> pytest.MarkDecorator:
    """Return the same mark for a test of what an adapter does: the FMI 3.0 FMU of the first model takes part."""
    return pytest.mark.parametrize("new_stream", cases(models, needs=needs, adapters=True), indirect=True)
