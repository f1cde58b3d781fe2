"""Figure of a response: what was not measured is not drawn, nothing is cut off or hidden."""

from pathlib import Path

import numpy as np
import pytest
from drawn import cut_off, figures_drawn, hiding_legends
from matplotlib.figure import Figure
from scipy.signal import chirp

from hybridsep import ModalModel, Mode
from hybridsep_modal.figure import response_figure
from hybridsep_modal.frequency_response import identify_frequency_response
from hybridsep_modal.klipper import Acceleration, identify_resonance

MODEL = ModalModel([Mode(45.0, 0.08, (2 * np.pi * 45.0) ** 2)])


@pytest.fixture(scope="module")
def klipper(tmp_path_factory: pytest.TempPathFactory) -> Figure:
    """Return the figure of a resonance test from 5 to 133.33 Hz, Klipper's default, by a drive of one mode."""
    T = 1 / 3200
    t = np.arange(0, 128.33, T)
    discrete = MODEL.discretise(T)
    a = discrete.forced_response(discrete.rest(), 0.075 * (5 + t) * chirp(t, 5, t[-1], 133.33))[0]
    found = identify_resonance(Acceleration(t, {"x": a, "y": a, "z": a}, T), "x")
    assert found.model.modes[0].f_n == pytest.approx(45.0, abs=0.3)
    with figures_drawn() as drawn:
        response_figure(found, "raw_data_x.csv", tmp_path_factory.mktemp("figure") / "a.png")
    return drawn[0]


def test_no_phase_is_drawn_where_none_was_measured(klipper: Figure) -> None:
    labels = [axes.get_ylabel() for axes in klipper.axes]
    assert not any("phase" in label for label in labels)
    assert labels == ["magnitude [dB]", "error of the\nmagnitude [%]"]


def test_the_error_of_a_perfect_fit_is_small(klipper: Figure) -> None:
    (points,) = [line for line in klipper.axes[-1].get_lines() if line.get_marker() == "."]
    assert np.asarray(points.get_ydata(), dtype=np.float64).max() < 10.0  # of the spectrum, not of the fit
    assert klipper.axes[-1].get_ylim()[1] < 20.0


def test_a_measured_phase_is_drawn_beside_the_model(tmp_path: Path) -> None:
    f = np.linspace(1.0, 100.0, 200)
    with figures_drawn() as drawn:
        response_figure(
            identify_frequency_response(f, MODEL.frequency_response(2 * np.pi * f)), "frf.csv", tmp_path / "a.png"
        )
    (figure,) = drawn
    assert [axes.get_ylabel() for axes in figure.axes] == ["magnitude [dB]", "phase [°]", "error [%]"]
    assert sum(len(np.asarray(line.get_xdata())) == 200 for line in figure.axes[1].get_lines()) == 2


def test_nothing_is_cut_off_or_hidden(klipper: Figure) -> None:
    assert cut_off(klipper) == []
    assert hiding_legends(klipper) == 0
