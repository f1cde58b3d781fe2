"""Closed systems of native FMUs in other projects' importers, from one file; all but two of them run at night."""

import os
import re
import sys
from pathlib import Path

import importers
import numpy as np
import pytest
from built_once import BuiltFmus, changed
from importers import IMPORTERS, OWN, exists_here, observed
from places import ROOT, SUPPORT
from programs import output_of

from hybridsep import cosimulate, load_machine, staircase
from hybridsep.cosim.run import Run
from hybridsep.fmi.ssp import build_system

GUIDE = (ROOT / "docs" / "evidence" / "importers.md").read_text(encoding="utf-8")
UNCARRIED = ("fmpy SSP", "fmucontainer -sequential")
"""Importers that carry nothing to the drive before the first step, and change the first measurement."""

COMMANDS = {"": staircase(), "moved": staircase()[:800] + 0.1}  # m


@pytest.fixture(scope="module")
def runs(fmus: BuiltFmus) -> dict[tuple[str, str], Run]:
    """What ``cosimulate`` comes to with each system and command."""
    return {
        (system, place): cosimulate(fmus(model), fmus("FeedDrive"), command)
        for system, (model, *_) in OWN.items()
        for place, command in COMMANDS.items()
    }


def written(folder: Path, system: str, place: str = "") -> Path:
    """Write a system as one file."""
    folder.mkdir()
    compensate, machine = "hybrid" if system == "compensator" else None, load_machine("spring_mass_damper")
    return build_system(machine, folder / "staircase.ssp", COMMANDS[place], compensate=compensate, targets=("host",))


def python(folder: Path, *arguments: object) -> str:
    """Return what Python prints with these arguments, run in a folder; the tests' modules can be imported."""
    environment = os.environ | {"PYTHONPATH": str(SUPPORT)}
    return output_of(sys.executable, "-W", "error", *arguments, cwd=folder, env=environment, timeout=600)


@pytest.mark.slow
@pytest.mark.usefixtures("short_references")
@pytest.mark.parametrize("system", OWN)
@pytest.mark.parametrize(
    "importer",
    [pytest.param(name, marks=[pytest.mark.nightly] * (name not in ("fmpy SSP", "libcosim"))) for name in IMPORTERS],
)
def test_importers_come_to_the_same_figures(
    runs: dict[tuple[str, str], Run], tmp_path: Path, importer: str, system: str
) -> None:
    """Where a start goes round in Initialization Mode, anywhere on the axis; the guide has 4 digits of the figures."""
    if not exists_here(importer):
        pytest.skip(f"{importer} has no library for this machine")
    # The first measurement, from which a compensator with averaging judges the sensor, is another there.
    judged, delay = importer in UNCARRIED and system == "compensator", {"predictor": 100, "compensator": 200}[system]
    for place, command in COMMANDS.items():
        if place and importer in UNCARRIED:
            continue
        archive, out = written(tmp_path / f"at {place}", system, place), tmp_path / "rows.npy"
        python(tmp_path, importers.__file__, importer, system, archive, len(command) - 1 + delay, out)
        run, rows = runs[system, place], np.load(out)[delay - 1 :].T
        found = dict(zip((name for _, name in observed(system)), rows, strict=True))
        for name in (name for name in found if not name.startswith("rms")):
            expected, tolerance = getattr(run, name), 1e-7 if judged else 1e-12 if not place else 1e-11
            np.testing.assert_allclose(found[name], expected, rtol=0, atol=tolerance, err_msg=name)
        if not place and not judged:  # else nanometres may change the last digit
            summary = run.summary()
            overall = ("rms_pb_um", "rms_h_um") if system == "predictor" else ("tracking_rms_um",)
            figures = [*(1e6 * found[name][-1] for name in found if name.startswith("rms")), *map(summary.get, overall)]
            row = " | ".join(f"{figure:#.4g}" for figure in figures)
            assert GUIDE.count(f"| {row} |") >= len(IMPORTERS), row


@pytest.mark.slow
@pytest.mark.skipif(not exists_here("ecos"), reason="ecos has no library for this machine")
def test_the_script_of_the_guide(tmp_path: Path) -> None:
    script = GUIDE.partition("```python\n")[2].partition("```")[0]
    place = written(tmp_path / "system", "predictor").parent
    printed = python(place, "-c", f"import importers; importers.load_tbb()\n{script}")
    assert f"| {' | '.join(f'{1e6 * float(number):#.4g}' for number in printed.split())} |" in GUIDE


@pytest.mark.skipif(not exists_here("libcosim"), reason="libcosim has no library for this machine")
def test_a_parameter_set_counts_in_libcosim(tmp_path: Path) -> None:
    """Without the noise that its FMU starts with, what the drive measures is where it is."""
    path, ends = written(tmp_path / "system", "predictor"), []
    noise = rb'(<ssv:Parameter name="noise_std">\s*<ssv:Real value=")5e-06'

    def quiet(name: str, text: bytes) -> bytes:
        return re.sub(noise, rb"\g<1>0.0", text) if name.endswith("_drive.ssv") else text

    for archive in (path, changed(path, tmp_path / "changed.ssp", quiet)):
        python(tmp_path, importers.__file__, "libcosim", "predictor", archive, 300, tmp_path / "rows.npy")
        ends.append(np.load(tmp_path / "rows.npy")[-1, :2])
    assert ends[0][0] != ends[0][1]
    assert ends[1][0] == ends[1][1] == pytest.approx(ends[0][0], abs=1e-12)
    assert np.all(np.asarray(ends) > 1e-3)
