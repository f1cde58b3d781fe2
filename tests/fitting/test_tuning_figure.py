"""Figure of a tuning: every label is within the figure."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawn import cut_off, figures_drawn, hiding_legends

from hybridsep.base.settings import PredictorSettings
from hybridsep.fitting.tuning import Tuning, tuning_figure


@pytest.mark.slow
@pytest.mark.parametrize("Np", [50, 100, 400])
@pytest.mark.parametrize("names", [("p",), ("p", "q"), ("p", "q", "lam")])
def test_no_label_is_cut_off(Np: int, names: tuple[str, ...], tmp_path: Path) -> None:
    own = PredictorSettings(averaging=False, Np=Np)
    values: dict[str, tuple[Any, ...]] = {
        "p": tuple(range(5, 55, 5)),
        "q": (1, 3, 10),
        "lam": tuple(10.0**e for e in range(-14, -2)),
    }
    tried = {name: values[name] for name in names}
    settings = [own, *(replace(own, **dict(zip(names, one, strict=True))) for one in product(*tried.values()))]
    errors = np.random.default_rng(0).uniform(3e-7, 9e-7, (len(settings), 1))
    found = Tuning(("a.csv",), tuple(settings), np.array([2e-6]), np.array([1e-6]), errors)
    windows = {
        size: Tuning(("a.csv",), (replace(own, Np=size),), np.array([2e-6]), np.array([1e-6]), errors[:1])
        for size in (50, 100, 200, 400)
    }
    with figures_drawn() as drawn:
        tuning_figure(
            found, windows, tried, "A drive whose name is as long as names of drives are", tmp_path / "tune.png"
        )
    (figure,) = drawn
    assert cut_off(figure) == []
    for axes, name in zip(figure.axes, [*names, "Np"], strict=True):
        label, panel = axes.xaxis.label.get_window_extent(), axes.bbox
        assert label.x0 > panel.x0 + 0.02 * panel.width, axes.get_xlabel()
        assert label.x1 < panel.x1 - 0.02 * panel.width, axes.get_xlabel()
        if name in tried:
            ticks = [text.get_text() for text in axes.get_xticklabels()]
            assert [ticks[0], ticks[-1]] == [f"{tried[name][0]:g}", f"{tried[name][-1]:g}"]
            assert len(ticks) <= 10
    assert hiding_legends(figure) == 0
