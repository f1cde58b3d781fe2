"""Weights file ``resources/weights.bin`` of an FMU that starts warm: the factors of a trained predictor.

Layout, little-endian: ``HSEPWG13``; the numbers of settings, of modes, of learned samples and of what has been learned
besides the factors, as u64; each setting that shapes the features and the factors (with others the weights mean
something else), its name in 24 bytes and its value as float64; as float64 the numbers of a residual model that can be
trusted and those of the errors' variance; the upper triangle of each factor ``[R z; 0 ρ]`` by rows, of a residual model
that can be trusted that of the physics model's residual and that of the command's; the CRC-32 of all before as u64.
This module is packed into the pythonfmu FMUs; the C model reads the same file.
"""

from __future__ import annotations

import struct
import zlib

import numpy as np

from ..base.errors import SignalError, StateError
from ..base.settings import PredictorSettings
from ..base.signals import Array
from ..predict.predictor import HybridPredictor
from ..predict.uncertainty import Uncertainty

__all__ = ["WEIGHTS_FILE", "learned_settings", "restore_weights", "weights_file"]

WEIGHTS_FILE = "weights.bin"
_MAGIC = b"HSEPWG13"
_HEAD = struct.Struct("<8s4Q")
_SETTING = struct.Struct("<24sd")
_CHECKSUM = struct.Struct("<Q")
_MODE = ("f_n", "zeta", "alpha", "beta")
_DAMAGED = f"{WEIGHTS_FILE} must be a factor of learned rows; it is damaged or truncated"


def learned_settings(predictor: HybridPredictor) -> dict[str, float]:
    """Return all settings on which the weights depend, by their names in the FMU."""
    numbers = predictor.settings.to_fmi()
    learned = [name for name, parameter in PredictorSettings.fmi_parameters().items() if parameter.learned]
    values: dict[str, float] = {name: numbers[name] for name in learned}
    values["dead_time"] = predictor.model.dead_time
    for i, mode in enumerate(predictor.model.modes, start=1):
        values |= {f"mode[{i}].{name}": getattr(mode, name) for name in _MODE}
    return values


def weights_file(predictor: HybridPredictor) -> bytes:
    """Return the file's content for a trained predictor."""
    settings = learned_settings(predictor)
    factors = [regression.factor for regression in predictor.residual.regressions]
    learned = np.concatenate([part.ravel() for part in _learned(predictor).values()])
    content = _HEAD.pack(
        _MAGIC, len(settings), len(predictor.model.modes), predictor.regression.n_samples, len(learned)
    )
    content += b"".join(_SETTING.pack(name.encode(), value) for name, value in settings.items())
    triangles = [factor[np.triu_indices(len(factor))] for factor in factors]
    content += np.concatenate((learned, *triangles)).astype("<f8").tobytes()
    return content + _CHECKSUM.pack(zlib.crc32(content))


def restore_weights(predictor: HybridPredictor, content: bytes) -> None:
    """Restore what a predictor has learned from the file's content.

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
    _, n_settings, n_modes, n_samples, n_learned = _HEAD.unpack_from(body)
    start = _HEAD.size + n_settings * _SETTING.size
    if start > len(body):
        raise StateError(_DAMAGED)
    learned = {
        name.rstrip(b"\0").decode("ascii", "replace"): value
        for name, value in _SETTING.iter_unpack(body[_HEAD.size : start])
    }
    problems = _differences("the number of modes", n_modes, len(predictor.model.modes))
    settings = learned_settings(predictor)
    for name, then in learned.items():
        if name in settings or not name.startswith("mode["):
            problems += _differences(name, then, settings.get(name, 0.0))
    if problems:
        raise StateError("; ".join(problems))
    parts, regressions = _learned(predictor), predictor.residual.regressions
    ends = np.cumsum([0, *(part.size for part in parts.values())])
    corners = np.cumsum([0, *((one.n_features + 1) * (one.n_features + 2) // 2 for one in regressions)])
    n_numbers = int(ends[-1] + corners[-1])
    if learned.keys() != settings.keys() or n_learned != ends[-1] or len(body) - start != 8 * n_numbers:
        raise StateError(_DAMAGED)
    numbers = np.frombuffer(body, "<f8", offset=start)
    found = {
        name: numbers[first:end].reshape(parts[name].shape).copy()
        for name, first, end in zip(parts, ends, ends[1:], strict=False)
    }
    if not (Uncertainty.is_sound(found["errors"]) and predictor.residual.is_sound(found)):
        raise StateError(_DAMAGED)
    try:
        for regression, first, end in zip(regressions, corners, corners[1:], strict=False):
            regression.restore(
                _triangle(numbers[n_learned + first : n_learned + end], regression.n_features), n_samples
            )
    except SignalError:
        raise StateError(_DAMAGED) from None
    predictor.uncertainty.restore(found["errors"])
    predictor.residual.restore_learned(found)


def _triangle(numbers: Array, n_features: int) -> Array:
    """Return the factor of an upper triangle by rows, ``(n_features + 1, n_features + 1)``."""
    factor = np.zeros((n_features + 1, n_features + 1))
    factor[np.triu_indices(n_features + 1)] = numbers
    return factor


def _learned(predictor: HybridPredictor) -> dict[str, Array]:
    """Return what has been learned besides the factors, in the order of the file."""
    return predictor.residual.learned() | {"errors": predictor.uncertainty.learned()}


def _differences(name: str, then: float, now: float) -> list[str]:
    """Return the message, if any, about a setting with another value than in training."""
    if then == now:
        return []
    whole = isinstance(now, int)
    shown = int(then) if whole and then == int(then) else then
    came = int(now) if whole else now
    return [f"{name} must be {shown!r}, with which this FMU was trained ({WEIGHTS_FILE}), got {came!r}"]
