"""``resources/weights.bin``: what a trained predictor has learned, for an FMU that starts warm.

Layout, little-endian, 8 bytes each: ``HSEPWGT2``; ``p``, ``q``, ``input_hold``, ``dead_time``, the number of modes and
that of the learned samples as u64; ``lambda``, ``T_s``, ``v_friction``, then the four numbers of each mode as float64;
the upper triangle of the factor ``[R z; 0 ρ]`` by rows; the CRC-32 of all
before as u64. The settings are all that shape the features and the factor: with others the weights mean something else.
This module travels inside the pythonfmu FMUs; the C model reads the same file.
"""

from __future__ import annotations

import struct
import zlib

import numpy as np

from ..base.errors import SignalError, StateError
from ..base.settings import PredictorSettings
from ..predict.predictor import HybridPredictor

__all__ = ["WEIGHTS_FILE", "learned_settings", "restore_weights", "weights_file"]

WEIGHTS_FILE = "weights.bin"
_MAGIC = b"HSEPWGT2"
_HEAD = struct.Struct("<8s6Q3d")
_CHECKSUM = struct.Struct("<Q")
_MODE = ("f_n", "zeta", "alpha", "beta")
_DAMAGED = f"{WEIGHTS_FILE} must be a factor of learned rows; it is damaged or truncated"


def learned_settings(predictor: HybridPredictor) -> dict[str, float]:
    """Return all settings that what is learned depends on, by their names in the FMU."""
    numbers = predictor.settings.to_fmi()
    learned = [name for name, parameter in PredictorSettings.fmi_parameters().items() if parameter.learned]
    values: dict[str, float] = {name: numbers[name] for name in learned}
    values["dead_time"] = predictor.model.dead_time
    for i, mode in enumerate(predictor.model.modes, start=1):
        values |= {f"mode[{i}].{name}": getattr(mode, name) for name in _MODE}
    return values


def weights_file(predictor: HybridPredictor) -> bytes:
    """Return the file's content for what a predictor has learned."""
    regression, n_modes = predictor.regression, len(predictor.model.modes)
    p, q, lam, T_s, input_hold, v_friction, dead_time, *modes = learned_settings(predictor).values()
    triangle = regression.factor[np.triu_indices(predictor.n_features + 1)]
    content = _HEAD.pack(_MAGIC, p, q, input_hold, dead_time, n_modes, regression.n_samples, lam, T_s, v_friction)
    content += np.array([*modes, *triangle], dtype="<f8").tobytes()
    return content + _CHECKSUM.pack(zlib.crc32(content))


def restore_weights(predictor: HybridPredictor, content: bytes) -> None:
    """Give a predictor what the file's content says.

    Raises
    ------
    StateError
        If it is damaged, truncated or of another version, or was learned with other settings, naming all that differ;
        the predictor is unchanged then.
    """
    body = content[: -_CHECKSUM.size]
    if (
        len(content) < _HEAD.size + _CHECKSUM.size
        or not content.startswith(_MAGIC)
        or _CHECKSUM.pack(zlib.crc32(body)) != content[-_CHECKSUM.size :]
    ):
        raise StateError(_DAMAGED)
    _, p, q, input_hold, dead_time, n_modes, n_samples, lam, T_s, v_friction = _HEAD.unpack_from(body)
    numbers = np.frombuffer(body, "<f8", offset=_HEAD.size)
    settings = learned_settings(predictor)
    learned = [p, q, lam, T_s, input_hold, v_friction, dead_time, *numbers[: 4 * n_modes].tolist()]
    problems = [
        f"{name} must be {then!r}, with which {WEIGHTS_FILE} was learned, got {now!r}"
        for (name, now), then in zip(settings.items(), learned, strict=False)
        if now != then
    ]
    if n_modes != len(predictor.model.modes):
        problems.append(
            f"the number of modes must be {n_modes}, with which {WEIGHTS_FILE} was learned, "
            f"got {len(predictor.model.modes)}"
        )
    if problems:
        raise StateError("; ".join(problems))
    size = predictor.n_features + 1
    upper = np.triu_indices(size)
    if len(numbers) != 4 * n_modes + len(upper[0]):
        raise StateError(_DAMAGED)
    factor = np.zeros((size, size))
    factor[upper] = numbers[4 * n_modes :]
    try:
        predictor.regression.restore(factor, n_samples)
    except SignalError:
        raise StateError(_DAMAGED) from None
