"""The layout of φ in the C core against the rows that the library learns."""

from __future__ import annotations

import ctypes

import c_core
import numpy as np
import pytest
from numpy.typing import NDArray

from hybridsep.base.settings import PredictorSettings
from hybridsep.model.physics import ModalModel
from hybridsep.predict.paper.features import FeatureLayout
from hybridsep.predict.predictor import HybridPredictor

Array = NDArray[np.float64]

NP = 8


class Features(ctypes.Structure):
    """hsep_features."""

    _fields_ = tuple((name, ctypes.c_uint64) for name in ("p", "q", "x", "e", "n"))


def layout(p: int, q: int) -> Features:
    features = Features()
    c_core.library("predictor").hsep_features_lay_out(ctypes.byref(features), ctypes.c_uint64(p), ctypes.c_uint64(q))
    return features


@pytest.mark.parametrize(("p", "q"), [(1, 0), (3, 2), (8, 7), (8, 0)])
def test_a_row_of_the_library_has_the_slices_of_the_core(p: int, q: int, monkeypatch: pytest.MonkeyPatch) -> None:
    model = ModalModel.spring_mass_damper(1.0, 15.7, 24674.0)
    predictor = HybridPredictor(model, PredictorSettings(trust=False, Np=NP, p=p, q=q, lam=1e-8, t_init=0.0), start=0.0)
    learned: list[Array] = []
    monkeypatch.setattr(predictor.regression, "update_stacked", lambda rows: learned.append(rows.copy()))
    features = layout(p, q)
    chance = np.random.default_rng(0)
    x_pb, e_pb = np.zeros(0), np.zeros(0)
    for window in range(3):
        predicted = predictor.predict(1e-3 * np.sin(0.3 * np.arange(NP) + window))
        measured = predicted.x_pb + chance.normal(0.0, 1e-6, NP)
        predictor.update(measured)
        x_pb = np.concatenate((x_pb, predicted.x_pb))
        e_pb = np.concatenate((e_pb, measured - predicted.x_pb))
    assert (features.p, features.q, features.n) == (p, q, predictor.n_features)
    assert learned[-1].shape == (NP, features.n + 1)
    for k, row in enumerate(learned[-1], start=2 * NP):
        assert row[0] == 1.0
        assert row[features.x : features.e] == pytest.approx(x_pb[k - q : k + 1][::-1], abs=1e-15)
        assert row[features.e : features.n] == pytest.approx(e_pb[k - p : k][::-1], abs=1e-15)
        assert row[features.n] == pytest.approx(e_pb[k], abs=1e-15)


@pytest.mark.parametrize(("p", "q"), [(1, 0), (50, 3), (50, 40)])
def test_both_layouts_are_the_same(p: int, q: int) -> None:
    core, library = layout(p, q), FeatureLayout(p, q)
    assert (core.p, core.q, core.n) == (library.p, library.q, library.n)
    assert (slice(core.x, core.e), slice(core.e, core.n)) == (library.x_pb, library.e_pb)
