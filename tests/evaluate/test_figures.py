"""Figures of runs: nothing is cut off or hidden."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn import cut_off, figures_drawn, hiding_legends

from hybridsep.app.console import print_run
from hybridsep.cosim.contour import Contour
from hybridsep.cosim.run import COMPENSATOR, PREDICTOR, ControllerType, Run
from hybridsep.evaluate.figures import contour_figure, prediction_figure, tracking_figure
from hybridsep.logs.units import shown_in
from hybridsep.online.look_ahead import SepState
from hybridsep.plants.path import PlanarPath


def made_run(kind: ControllerType, n: int) -> Run:
    """Return a run of ``n`` samples whose hybrid is worse in some windows."""
    rng = np.random.default_rng(0)
    t = np.linspace(0.0, 1e-3 * (n - 1), n)
    x_d = 0.02 * np.sin(3.0 * t)
    x = x_d + 3e-5 * np.sin(200.0 * t)
    x_h = x + 2e-5 * rng.standard_normal(n) * (np.sin(0.5 * t) > 0.9)
    state = np.where(t < 0.3, SepState.PHYSICS, SepState.HYBRID)
    return Run(kind, t, x_d, x_d + 1e-5, x, x, x_d, x_h, np.full(n, 1e-6), state, T_s=1e-3, Np=100)


@pytest.mark.slow
def test_a_prediction_hides_and_cuts_nothing(tmp_path: Path) -> None:
    with figures_drawn() as drawn:
        words = "A drive of a long name, on a log of a long name.csv"
        prediction_figure(made_run(PREDICTOR, 6000), words, tmp_path / "a.png")
    (figure,) = drawn
    assert cut_off(figure) == []
    assert hiding_legends(figure) == 0
    labels = [text.get_text() for axes in figure.axes if (legend := axes.get_legend()) for text in legend.get_texts()]
    assert labels[-1] == "hybrid worse than physics"


@pytest.mark.slow
def test_tracking_and_paths_hide_and_cut_nothing(tmp_path: Path) -> None:
    run = made_run(COMPENSATOR, 1000)
    several = {"off": run, "physics": run, "hybrid_cold": run, "hybrid_warm": run}
    with figures_drawn() as drawn:
        tracking_figure(several, "Staircase, compensated", tmp_path / "a.png")
        tracking_figure({"hybrid": run}, "Staircase, compensated", tmp_path / "a.png")
        turn = 0.02 * np.exp(2j * np.pi * np.arange(1000) / 999)
        for centre in (np.nan, 0.0):  # over time, and as a ballbar draws it
            path = replace(PlanarPath.of(turn), centre=np.full(1000, complex(centre)))
            contour = Contour.of(path, turn * (1.0 + 1e-3 * turn), 1e-3)
            contour_figure(dict.fromkeys(several, contour), "a", tmp_path / "a.png")
    assert len(drawn) == 4
    for figure in drawn:
        assert cut_off(figure) == []
        assert hiding_legends(figure) == 0


def test_a_rotary_axis_is_shown_in_angles(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = made_run(COMPENSATOR, 300)
    print_run(run, False, "Table", "rad", shown_in("rad"))
    print_run(made_run(PREDICTOR, 300), False, "Table", "rad", shown_in("rad"))
    said = capsys.readouterr().out
    assert "RMS [µrad]" in said
    assert re.search(r"at most 60 mrad/s, \S+ mrad/s², \S+ mrad/s³", said)
    assert "prediction error in µrad" in said
    with figures_drawn() as drawn:
        tracking_figure({"hybrid": run}, "Table", tmp_path / "a.png", shown_in("deg"))
    assert [axes.get_ylabel().partition("[")[2] for axes in drawn[0].axes] == ["deg]", "mdeg]", "mdeg]"]
