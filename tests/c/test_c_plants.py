"""The C core's encoder against the library's, and the trajectory that it reads from a file."""

from __future__ import annotations

import ctypes
import struct

import c_core
import pytest

from hybridsep.plants.plant import Encoder


@pytest.mark.parametrize("seed", [0, 1, 12345, 2**31 - 1])
def test_the_encoder_draws_the_librarys_numbers(seed: int) -> None:
    # 1e-15 relative to the standard deviation's largest multiple, 8.6.
    encoder, measure = Encoder(1.0, seed), c_core.library("feed_drive").hsep_encoder_measure
    core = (ctypes.c_uint64 * 3)(*struct.unpack("<Q", struct.pack("<d", 1.0)), seed, 0)
    for _ in range(2000):
        assert measure(core, ctypes.c_double(0.0)) == pytest.approx(encoder.measure(0.0), rel=1e-15, abs=1e-15)
