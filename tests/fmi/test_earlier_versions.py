"""States and weights that each version has written: this one goes on from them, or refuses with what to do.

`python tests/fmi/test_earlier_versions.py` writes this version's. Where a format changes, refusal is the outcome.
"""

from pathlib import Path

import numpy as np
import pytest

from hybridsep.base.settings import CompensatorSettings, PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.base.version import __version__
from hybridsep.compensate.compensator import SepCompensator
from hybridsep.fmi.weights import restore_weights, weights_file
from hybridsep.machines.machine import load_machine
from hybridsep.predict.predictor import HybridPredictor

KEPT = Path(__file__).parent / "earlier_versions"
VERSIONS = sorted(folder.name for folder in KEPT.iterdir()) if KEPT.is_dir() else []
STEP = 1e-4  # m
ALIKE = 1e-12  # m: processors differ in the last digits


def path(first: int, n: int) -> Array:
    return np.asarray(STEP * np.sin(0.05 * np.arange(first, first + n)))


def predictor() -> HybridPredictor:
    settings = PredictorSettings(Np=10, p=4, recall=60, t_init=0.0)
    return HybridPredictor(load_machine("spring_mass_damper").model, settings, start=0.0)


def compensator() -> SepCompensator:
    return SepCompensator(predictor(), CompensatorSettings(preview=40, spacing=1, change_max=STEP))


def after(controller: HybridPredictor | SepCompensator, windows: range) -> Array:
    """Return what the last of some windows published, ``(Np,)``, m."""
    published = np.zeros(10)
    for k in windows:
        if isinstance(controller, SepCompensator):
            published = controller.plan(path(10 * k, 40)).x_dm
        else:
            published = controller.predict(path(10 * k, 10)).x_h
        controller.update(0.9 * path(10 * k - 3, 10))
    return published


@pytest.mark.parametrize("version", VERSIONS)
def test_files_of_a_version(version: str) -> None:
    folder = KEPT / version
    expected = {name: np.loadtxt(folder / f"{name}.txt") for name in ("predictor", "compensator", "weights")}
    warm = predictor()
    restore_weights(warm, (folder / "weights.bin").read_bytes())
    found: dict[str, HybridPredictor | SepCompensator] = {
        "predictor": HybridPredictor.from_bytes((folder / "predictor.state").read_bytes()),
        "compensator": SepCompensator.from_bytes((folder / "compensator.state").read_bytes()),
    }
    for name, controller in found.items():
        np.testing.assert_allclose(after(controller, range(12, 14)), expected[name], rtol=0.0, atol=ALIKE)
    np.testing.assert_allclose(after(warm, range(2)), expected["weights"], rtol=0.0, atol=ALIKE)


def test_this_version_is_among_them() -> None:
    assert __version__ in VERSIONS


def write() -> None:
    """Write what this version leaves after twelve windows, and what it publishes two windows later."""
    folder = KEPT / __version__
    folder.mkdir(parents=True, exist_ok=True)
    trained, planned, warm = predictor(), compensator(), predictor()
    after(trained, range(12))
    after(planned, range(12))
    (folder / "predictor.state").write_bytes(trained.to_bytes())
    (folder / "compensator.state").write_bytes(planned.to_bytes())
    (folder / "weights.bin").write_bytes(weights_file(trained))
    restore_weights(warm, weights_file(trained))
    np.savetxt(folder / "weights.txt", after(warm, range(2)))
    np.savetxt(folder / "predictor.txt", after(trained, range(12, 14)))
    np.savetxt(folder / "compensator.txt", after(planned, range(12, 14)))


if __name__ == "__main__":
    write()
