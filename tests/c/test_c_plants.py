"""The C core's plants, encoder and trajectory against the library. Each test states its tolerance."""

from __future__ import annotations

import ctypes
import struct
from pathlib import Path

import c_core
import numpy as np
import pytest
import staircase_data as staircase
from c_core import TS, CModel, write_trajectory

from hybridsep.model.physics import ModalModel, Mode
from hybridsep.plants.encoder import Encoder
from hybridsep.plants.feed_drive import FeedDrive
from hybridsep.plants.plant import Plant
from hybridsep.plants.stage_drive import StageDrive


def plants() -> dict[str, Plant]:
    stage = ModalModel([Mode(**mode) for mode in c_core.STAGE_MODES])
    return {
        "feed_drive": FeedDrive(*(c_core.FEED_DRIVE[name] for name in ("m", "c", "k", "c_nl", "k_nl"))),
        "stage_drive": StageDrive(stage, c_core.STAGE_DRIVE["f"], c_core.STAGE_DRIVE["kappa"], 1e-3),
    }


@pytest.mark.parametrize("h", [1e-3, 0.25e-3, 2.5e-3, 0.7e-4])
@pytest.mark.parametrize("name", ["feed_drive", "stage_drive"])
def test_the_plants_move_as_the_librarys_do(name: str, h: float) -> None:
    # 1e-12 m in position, 1e-10 m/s in velocity, 1e-12 m in the measurement.
    plant = plants()[name]
    parameters = c_core.DESCRIPTIONS[name]["parameters"]
    encoder = Encoder(parameters["noise_std"], parameters["seed"])
    plant.reset(0.1)
    model = CModel(name, {"x_d": 0.1})
    model.start_values()
    before = model.values.copy()
    np.testing.assert_array_equal(model.initialise().values, before)
    assert abs(model["x_meas"] - encoder.measure(plant.x)) <= 1e-12
    for k, command in enumerate((staircase.commanded()[:1200] + 0.1).tolist()):
        model["x_d"] = command
        model.step(k * h, h)
        plant.step(command, h)
        assert abs(model["x"] - plant.x) <= 1e-12
        assert abs(model["v"] - plant.v) <= 1e-10
        assert abs(model["x_meas"] - encoder.measure(plant.x)) <= 1e-12


@pytest.mark.parametrize("seed", [0, 1, 12345, 2**31 - 1])
def test_the_encoder_draws_the_librarys_numbers(seed: int) -> None:
    # 1e-15 relative to the standard deviation's largest multiple, 8.6.
    encoder, measure = Encoder(1.0, seed), c_core.library("feed_drive").hsep_encoder_measure
    core = (ctypes.c_uint64 * 3)(*struct.unpack("<Q", struct.pack("<d", 1.0)), seed, 0)
    for _ in range(2000):
        assert measure(core, ctypes.c_double(0.0)) == pytest.approx(encoder.measure(0.0), rel=1e-15, abs=1e-15)


def test_a_trajectory_is_played_and_held_at_its_end(tmp_path: Path) -> None:
    samples = staircase.commanded()[:300] + 0.02
    write_trajectory(tmp_path, samples)
    model = CModel("trajectory", resources=tmp_path)
    model.start_values()
    assert model["r"] == samples[0]
    model.initialise(1.0)
    assert model["r"] == samples[0]
    for k in range(400):
        model.step(1.0 + k * TS, TS / 2)
        assert model["r"] == samples[min(k, 299)]
        model.step(1.0 + (k + 0.5) * TS, TS / 2)
        assert model["r"] == samples[min(k + 1, 299)]
