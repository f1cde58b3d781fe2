"""Weights file ``resources/weights.bin`` of an FMU that starts warm: the factor of a trained predictor.

Layout, little-endian: ``HSEPWGT4``; the numbers of settings, of modes, of learned samples and of what a residual model
that can be trusted has learned besides the factor, as u64; each setting that shapes the features and the factor (with
others the weights mean something else), its name in 24 bytes and its value as float64; that model's numbers as float64;
the upper triangle of the factor ``[R z; 0 ρ]`` by rows; the CRC-32 of all before as u64. This module is packed into the
pythonfmu FMUs; the C model reads the same file.
"""

from __future__ import annotations

import struct
import zlib

import numpy as np

from ..base.errors import SignalError, StateError
from ..base.settings import PredictorSettings
from ..base.signals import Array
from ..predict.candidates import ResidualScale
from ..predict.predictor import HybridPredictor
from ..predict.trusted import TrustedModel

__all__ = ["WEIGHTS_FILE", "learned_settings", "restore_weights", "weights_file"]

WEIGHTS_FILE = "weights.bin"
_MAGIC = b"HSEPWGT4"
_HEAD = struct.Struct("<8s4Q")
_SETTING = struct.Struct("<24sd")
_CHECKSUM = struct.Struct("<Q")
_N_BLENDED = 3
_CORRELATIONS = slice(7, 9)
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
    factor, trusted = predictor.regression.factor, _trusted_numbers(predictor.trusted)
    content = _HEAD.pack(
        _MAGIC, len(settings), len(predictor.model.modes), predictor.regression.n_samples, len(trusted)
    )
    content += b"".join(_SETTING.pack(name.encode(), value) for name, value in settings.items())
    content += np.concatenate((trusted, factor[np.triu_indices(len(factor))])).astype("<f8").tobytes()
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
    _, n_settings, n_modes, n_samples, n_trusted = _HEAD.unpack_from(body)
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
    size, trusted = predictor.regression.n_features + 1, _trusted_numbers(predictor.trusted)
    upper = np.triu_indices(size)
    n_numbers = len(trusted) + len(upper[0])
    if learned.keys() != settings.keys() or n_trusted != len(trusted) or len(body) - start != 8 * n_numbers:
        raise StateError(_DAMAGED)
    numbers = np.frombuffer(body, "<f8", offset=start)
    factor = np.zeros((size, size))
    factor[upper] = numbers[n_trusted:]
    if not _are_sound(numbers[:n_trusted]):
        raise StateError(_DAMAGED)
    try:
        predictor.regression.restore(factor, n_samples)
    except SignalError:
        raise StateError(_DAMAGED) from None
    if predictor.trusted is not None:
        _restore_trusted(predictor.trusted, numbers[:n_trusted])


def _trusted_numbers(trusted: TrustedModel | None) -> Array:
    """Return what the model has learned besides the factor: first what is never negative, then gram and cross."""
    if trusted is None:
        return np.zeros(0)
    blend, candidates = trusted.blend, trusted.candidates
    return np.concatenate(
        (
            [trusted.n_rows, trusted.velocity_scale, *trusted.scale],
            [candidate.noise_variance for candidate in candidates],
            [candidate.correlation for candidate in candidates],
            blend.weights,
            trusted.largest,
            blend.gram.ravel(),
            blend.cross,
        )
    )


def _are_sound(numbers: Array) -> bool:
    """Return whether :func:`_trusted_numbers` are finite and in range; none are."""
    n_signed = _N_BLENDED * (_N_BLENDED + 1)
    return bool(
        np.isfinite(numbers).all() and (numbers[:-n_signed] >= 0.0).all() and (numbers[_CORRELATIONS] >= 1.0).all()
    )


def _restore_trusted(trusted: TrustedModel, numbers: Array) -> None:
    """Take over :func:`_trusted_numbers`, which are sound."""
    n, blend = _N_BLENDED, trusted.blend
    trusted.n_rows, trusted.velocity_scale = numbers[:2].tolist()
    trusted.scale = ResidualScale(*numbers[2:5].tolist())
    for candidate, noise_variance, correlation in zip(
        trusted.candidates, numbers[5:7].tolist(), numbers[_CORRELATIONS].tolist(), strict=True
    ):
        candidate.noise_variance, candidate.correlation = noise_variance, correlation
    blend.weights = numbers[9 : 9 + n].copy()
    trusted.largest = numbers[9 + n : -n * (n + 1)].copy()
    blend.gram, blend.cross = numbers[-n * (n + 1) : -n].reshape(n, n).copy(), numbers[-n:].copy()


def _differences(name: str, then: float, now: float) -> list[str]:
    """Return the message, if any, about a setting with another value than in training."""
    if then == now:
        return []
    whole = isinstance(now, int)
    shown = int(then) if whole and then == int(then) else then
    return [f"{name} must be {shown!r}, with which {WEIGHTS_FILE} was learned, got {int(now) if whole else now!r}"]
