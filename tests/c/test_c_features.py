"""The rows of φ that the C core learns, by its weights, against the library's."""

from __future__ import annotations

import ctypes

import c_core
import numpy as np
import pytest
from c_library import PredictorPart
from numpy.typing import NDArray

from hybridsep.base.settings import PredictorSettings
from hybridsep.model.physics import ModalModel
from hybridsep.predict.predictor import HybridPredictor

Array = NDArray[np.float64]

NP = 8


class Sample(ctypes.Structure):
    """hsep_residual_sample."""

    _fields_ = (
        ("i", ctypes.c_uint64),
        ("relative", ctypes.c_double),
        ("x", ctypes.c_void_p),
        ("e", ctypes.c_void_p),
        ("settled", ctypes.c_int),
    )


def weights_of_the_core(settings: PredictorSettings, x_pb: Array, e_pb: Array) -> Array:
    """Return the weights, (2 + q + p,), after all samples, before which there was rest."""
    library, given, n = c_core.library("predictor"), PredictorPart(), 2 + settings.q + settings.p
    for name, _ in PredictorPart._fields_:
        setattr(given, name, settings.to_fmi().get(name, 0))
    library.hsep_paper_size.restype = ctypes.c_double
    block = np.zeros(int(library.hsep_paper_size(ctypes.byref(given))) // 8)
    paper = block.ctypes.data_as(ctypes.c_void_p)
    library.hsep_paper_init(paper, ctypes.byref(given))
    newest = [np.concatenate((signal[::-1], np.zeros(n))) for signal in (x_pb, e_pb)]
    for k in range(len(x_pb)):
        x, e = (signal.ctypes.data + 8 * (len(x_pb) - 1 - k) for signal in newest)
        library.hsep_paper_learn(paper, ctypes.byref(Sample(x=x, e=e)))
    library.hsep_paper_begin(paper)
    first = int(block.view(np.uint64)[4])  # offset of the weights
    return block[first : first + n]


@pytest.mark.parametrize(("p", "q"), [(1, 0), (3, 2), (8, 7), (8, 0)])
def test_a_row_of_the_library_has_the_places_of_the_core(p: int, q: int) -> None:
    # 1e-9 relative to the largest weight: λ is large, so that each weight is determined.
    model = ModalModel.spring_mass_damper(1.0, 15.7, 24674.0)
    settings = PredictorSettings(averaging=False, Np=NP, p=p, q=q, lam=1e-8, t_init=0.0)
    predictor, chance = HybridPredictor(model, settings, start=0.0), np.random.default_rng(0)
    x_pb, e_pb = np.zeros(0), np.zeros(0)
    for window in range(5):
        predicted = predictor.predict(1e-3 * np.sin(0.3 * np.arange(NP) + window))
        measured = predicted.x_pb + chance.normal(0.0, 1e-4, NP)
        predictor.update(measured)
        x_pb = np.concatenate((x_pb, predicted.x_pb))
        e_pb = np.concatenate((e_pb, measured - predicted.x_pb))
    found = weights_of_the_core(settings, x_pb, e_pb)
    assert len(set(np.round(np.abs(found), 12))) == len(found)  # each has a place of its own
    np.testing.assert_allclose(found, predictor.weights, rtol=0, atol=1e-9 * np.abs(found).max())
