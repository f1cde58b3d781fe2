"""``resources/weights.bin``: what a trained predictor has learned, for an FMU that starts warm.

Layout, little-endian: ``HSEPWGT1``, ``p``, ``q`` and the number of learned samples as u64, then the upper triangle of
the factor ``[R z; 0 ρ]`` of :class:`~hybridsep.regression.RidgeRegression` by rows, float64: of ``2 + q + p`` features,
and 13 more if it was learned with ``v_s > 0``. This module travels inside
the pythonfmu FMUs; the C model reads the same file.
"""

from __future__ import annotations

import struct

import numpy as np

from .._schedule import N_SCHEDULED
from ..errors import StateError
from ..predictor import HybridPredictor

__all__ = ["WEIGHTS_FILE", "restore_weights", "weights_file"]

WEIGHTS_FILE = "weights.bin"
_MAGIC = b"HSEPWGT1"
_HEAD = struct.Struct("<8s3Q")


def weights_file(predictor: HybridPredictor) -> bytes:
    """Return the file's content for what a predictor has learned."""
    regression = predictor.regression
    triangle = regression.factor[np.triu_indices(predictor.n_features + 1)]
    head = _HEAD.pack(_MAGIC, predictor.p, predictor.q, regression.n_samples)
    return head + triangle.astype("<f8").tobytes()


def restore_weights(predictor: HybridPredictor, content: bytes) -> None:
    """Give a predictor what the file's content says.

    Raises
    ------
    StateError
        If it was learned with another ``p`` or ``q``, with ``v_s > 0`` where it is 0 now or the other way round, or is
        damaged or truncated; the predictor is unchanged then.
    """
    size = predictor.n_features + 1
    known = len(content) >= _HEAD.size and content.startswith(_MAGIC)
    _, p, q, n_samples = _HEAD.unpack_from(content) if known else (b"", predictor.p, predictor.q, 0)
    if (p, q) != (predictor.p, predictor.q):
        raise StateError(
            f"{WEIGHTS_FILE} was learned with p = {p}, q = {q}, got p = {predictor.p}, q = {predictor.q}; "
            "set p and q as they were learned"
        )
    more = predictor.n_features > 2 + p + q
    other = size - N_SCHEDULED if more else size + N_SCHEDULED
    if known and len(content) == _HEAD.size + 4 * other * (other + 1):
        learned, got = ("= 0", "> 0") if more else ("> 0", "= 0")
        raise StateError(f"{WEIGHTS_FILE} was learned with v_s {learned}, got v_s {got}; set v_s as it was learned")
    factor = np.zeros((size, size))
    upper = np.triu_indices(size)
    if known and len(content) == _HEAD.size + 8 * len(upper[0]):
        factor[upper] = np.frombuffer(content, "<f8", offset=_HEAD.size)
    if not (np.isfinite(factor).all() and np.diag(factor)[:-1].all()):
        raise StateError(f"{WEIGHTS_FILE} must be a factor of learned rows; it is damaged or truncated")
    predictor.regression.restore(factor, n_samples)
