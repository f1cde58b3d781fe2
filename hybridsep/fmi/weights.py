"""Weights file ``resources/weights.bin`` of an FMU that starts warm: the factors of a trained predictor.

Layout, little-endian: ``HSEPWG16``; the numbers of settings, of modes and of what has been learned besides the factors,
as u64; each setting that shapes the features and the factors (with others the weights mean something else), its name in
24 bytes and its value as float64; as float64 the numbers of a residual model with averaging, in the order of
:class:`~hybridsep.predict.averaging.model.Learned`, and of :class:`~hybridsep.predict.uncertainty.Uncertainty`; for
each factor ``[R z; 0 ρ]`` its weighted number of rows and its upper triangle by rows, with averaging one of the physics
model's residual and one of the command's; the CRC-32 of all before as u64.
This module is packed into the pythonfmu FMUs; the C model reads the same file.
"""

import struct
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.errors import StateError
from ..base.files import as_path
from ..base.state import numbers_of, with_numbers
from ..predict.predictor import HybridPredictor
from ..predict.regression import RidgeRegression
from ..predict.uncertainty import Uncertainty

if TYPE_CHECKING:  # as this module is packed, and machines are not
    from ..machines.machine import Machine

WEIGHTS_FILE = "weights.bin"
_MAGIC = b"HSEPWG16"
_HEAD = struct.Struct("<8s3Q")
_SETTING = struct.Struct("<24sd")
_CHECKSUM = struct.Struct("<Q")
_DAMAGED = f"{WEIGHTS_FILE} is damaged, truncated or from another version; train again"


def weights_file(predictor: HybridPredictor) -> bytes:
    """Return the file's content for a trained predictor."""
    settings = predictor.learned_with
    learned = numbers_of(_learned(predictor))
    content = _HEAD.pack(_MAGIC, len(settings), len(predictor.model.modes), len(learned))
    content += b"".join(_SETTING.pack(name.encode(), value) for name, value in settings.items())
    factors = [(one.n_rows, one.factor[np.triu_indices(len(one.factor))]) for one in predictor.residual.regressions]
    numbers = [learned, *(np.append(n_rows, triangle) for n_rows, triangle in factors)]
    content += np.concatenate(numbers).astype("<f8").tobytes()
    return content + _CHECKSUM.pack(zlib.crc32(content))


def restore_weights(predictor: HybridPredictor, content: bytes) -> None:
    """Restore what a predictor has learned from the file's content.

    StateError if it is damaged, truncated or of another version, or was learned with other settings, naming all that
    differ; the predictor is unchanged then.
    """
    body = content[: -_CHECKSUM.size]
    if (
        len(content) < _HEAD.size + _CHECKSUM.size
        or not content.startswith(_MAGIC)
        or _CHECKSUM.pack(zlib.crc32(body)) != content[-_CHECKSUM.size :]
    ):
        raise StateError(_DAMAGED)
    _, n_settings, n_modes, n_learned = _HEAD.unpack_from(body)
    start = _HEAD.size + n_settings * _SETTING.size
    if start > len(body):
        raise StateError(_DAMAGED)
    learned = {
        name.rstrip(b"\0").decode("ascii", "replace"): value
        for name, value in _SETTING.iter_unpack(body[_HEAD.size : start])
    }
    problems = _differences("the number of modes", n_modes, len(predictor.model.modes))
    settings = predictor.learned_with
    for name, then in learned.items():
        if name in settings or not name.startswith("mode["):
            problems += _differences(name, then, settings.get(name, 0.0))
    if problems:
        raise StateError("; ".join(problems))
    like, sizes = _learned(predictor), [one.n_features + 1 for one in predictor.residual.regressions]
    ends = np.cumsum([len(numbers_of(like)), *(1 + size * (size + 1) // 2 for size in sizes)])
    if learned.keys() != settings.keys() or n_learned != ends[0] or len(body) - start != 8 * ends[-1]:
        raise StateError(_DAMAGED)
    numbers, *factors = np.split(np.frombuffer(body, "<f8", offset=start), ends[:-1])
    if not all(np.isfinite(one).all() for one in (numbers, *factors)):
        raise StateError(_DAMAGED)
    regressions = []
    for one, size in zip(factors, sizes, strict=True):
        factor = np.zeros((size, size), order="F")
        factor[np.triu_indices(size)] = one[1:]
        regressions.append(RidgeRegression(factor, float(one[0])))
    predictor.take_over(*with_numbers(like, numbers), tuple(regressions))


def _learned(predictor: HybridPredictor) -> tuple[Any, Uncertainty]:
    """Return what has been learned besides the factors."""
    return predictor.residual.learned, predictor.state.uncertainty


def _differences(name: str, then: float, now: float) -> list[str]:
    """Return the message, if any, about a setting with another value than in training."""
    if then == now:
        return []
    shown, came = (int(one) if isinstance(now, int) and one == int(one) else one for one in (then, now))
    return [f"{name} must be {shown!r}, with which this FMU was trained ({WEIGHTS_FILE}), got {came!r}"]


def warm_predictor(machine: "Machine", weights: str | Path | None) -> HybridPredictor:
    """Return a machine's predictor, with what a saved one has learned; StateError as :func:`saved_weights`."""
    if weights is None:
        return machine.new_predictor()
    predictor = _load_trained(weights, machine, "HybridPredictor")
    predictor.restart()
    return predictor


def saved_weights(path: str | Path | None, machine: "Machine", kind: str) -> bytes | None:
    """Return weights.bin for a predictor saved by :meth:`HybridPredictor.save`; None where ``path`` is None.

    It must have been trained for the machine: with its ``input_hold`` and
    :attr:`~hybridsep.predict.predictor.HybridPredictor.learned_with`, its predictor's or compensator's as ``kind``
    says. Its window may be another one: weights that a predictor learned serve a compensator.

    StateError if the file is not a saved predictor, one of another machine, naming all that differs, or has learned
    nothing.
    """
    return None if path is None else weights_file(_load_trained(path, machine, kind))


def _load_trained(path: str | Path, machine: "Machine", kind: str) -> HybridPredictor:
    path = as_path(path, "weights")
    try:
        trained = HybridPredictor.load(path)
    except StateError as error:
        raise StateError(f"{path.name}: {error}") from error
    compensates = kind == "SepCompensator"
    settings = machine.compensator_predictor if compensates else machine.predictor_settings
    if differing := machine.new_predictor(settings).differences(trained):
        subject = "'s compensator" if compensates else ""
        raise StateError(
            f"{path.name} was not trained for machine {machine.name}{subject}: it has {', '.join(differing)}; "
            "train it with that machine, or correct the machine file"
        )
    if trained.regression.n_rows == 0:
        raise StateError(f"{path.name} has learned no sample; save the predictor after a run")
    return trained
