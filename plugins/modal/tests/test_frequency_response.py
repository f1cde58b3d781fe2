"""Identification from a frequency response: the paper's Table 1 is found again."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import io
from scipy.signal import chirp

from hybridsep import ModalModel, Mode, load_machine
from hybridsep.base.errors import IdentificationError, LogError, ParameterError
from hybridsep.base.signals import Array
from hybridsep_modal.files import has_response, read_response
from hybridsep_modal.frequency_response import IdentifiedResponse, identify_frequency_response
from hybridsep_modal.swept_sine import h1
from hybridsep_modal.vector_fitting import starting_poles, vector_fit

Complex = NDArray[np.complex128]

F = np.linspace(1.0, 100.0, 1000)
OMEGA = 2 * np.pi * F


def noisy(G: Complex, part: float, seed: int) -> Complex:
    """Return a response with complex noise whose standard deviation is a part of each line's magnitude."""
    rng = np.random.default_rng(seed)
    errors = rng.standard_normal(len(G)) + 1j * rng.standard_normal(len(G))
    return np.asarray(G * (1 + part * errors / np.sqrt(2)), dtype=np.complex128)


def table_1(axis: str) -> ModalModel:
    return load_machine(f"als25010_{axis}").model


def relative_error(found: IdentifiedResponse, truth: ModalModel) -> Array:
    G = truth.frequency_response(OMEGA)
    return np.abs(found.model.frequency_response(OMEGA) / G - 1)


@pytest.mark.parametrize("axis", ["x", "y"])
def test_table_1_is_found_without_noise(axis: str) -> None:
    truth = table_1(axis)
    found = identify_frequency_response(F, truth.frequency_response(OMEGA))
    assert len(found.model.modes) == 4
    assert relative_error(found, truth).max() < 1e-10
    for ours, other in zip(found.model.modes, truth.modes, strict=True):
        assert (ours.f_n, ours.zeta, ours.alpha, ours.beta) == pytest.approx(
            (other.f_n, other.zeta, other.alpha, other.beta), rel=1e-9
        )


@pytest.mark.parametrize(("axis", "seed"), [("x", 0), ("y", 1)])
def test_table_1_is_found_within_its_deviations(axis: str, seed: int) -> None:
    """X has modes at 42.53 and 42.60 Hz; 1 % noise."""
    truth = table_1(axis)
    found = identify_frequency_response(F, noisy(truth.frequency_response(OMEGA), 0.01, seed))
    assert len(found.model.modes) == 4
    assert found.noise == pytest.approx(0.01, rel=0.05)
    assert np.sqrt(np.mean(relative_error(found, truth) ** 2)) < 0.003
    estimates = {estimate.name: estimate for estimate in found.parameters}
    for i, mode in enumerate(truth.modes):
        for name in ("f_n", "zeta", "alpha", "beta"):
            estimate = estimates[f"mode[{i + 1}].{name}"]
            assert estimate.std > 0
            assert abs(estimate.value - getattr(mode, name)) < 3.5 * estimate.std


def test_deviations_are_those_of_repetitions() -> None:
    truth = ModalModel([Mode(30.0, 0.05, (60 * np.pi) ** 2, 10.0)])
    G = truth.frequency_response(OMEGA[::5])
    runs = [identify_frequency_response(F[::5], noisy(G, 0.02, seed), n_modes=1) for seed in range(60)]
    for i in range(4):
        values = [run.parameters[i].value for run in runs]
        stated = np.median([run.parameters[i].std for run in runs])
        assert 0.7 < stated / np.std(values) < 1.4


def test_the_static_gain_can_be_one() -> None:
    truth = ModalModel([Mode(20.0, 0.1, (40 * np.pi) ** 2, 5.0)])
    found = identify_frequency_response(F, noisy(truth.frequency_response(OMEGA), 0.01, 0), unit_gain=True)
    assert found.model.dc_gain == pytest.approx(1.0, abs=1e-12)
    gain = found.parameters[-1]
    assert gain.name == "gain"
    assert gain.value == pytest.approx(1.0, abs=1e-12)
    assert gain.std < 1e-9


def two_modes() -> ModalModel:
    return ModalModel([Mode(35.0, 0.3, 0.9 * (70 * np.pi) ** 2), Mode(80.0, 0.05, 0.1 * (160 * np.pi) ** 2)])


@pytest.mark.parametrize("seed", [0, 20])
def test_errors_of_single_lines_are_no_modes(seed: int) -> None:
    """Noise alike at all lines, where the response is small: once eight undamped modes, each on one line."""
    f = np.linspace(1.0, 150.0, 600)
    rng = np.random.default_rng(seed)
    noise = 0.003 * (rng.standard_normal(len(f)) + 1j * rng.standard_normal(len(f)))
    found = identify_frequency_response(f, two_modes().frequency_response(2 * np.pi * f) + noise)
    assert [mode.f_n for mode in found.model.modes] == pytest.approx([35.0, 80.0], rel=0.01)
    given = identify_frequency_response(f, two_modes().frequency_response(2 * np.pi * f) + noise, n_modes=4)
    assert "is not significantly above 0: the mode may be one line's error" in " ".join(given.findings)


def test_friction_in_a_swept_sine_is_no_mode() -> None:
    truth, T_s = ModalModel([Mode(35.0, 0.3, (70 * np.pi) ** 2)]), 1e-3
    t = np.arange(10_000) * T_s
    x_d = 1e-3 * chirp(t, 1.0, t[-1], 150.0, phi=-90) * np.minimum(1.0, np.minimum(t, t[-1] - t) / 0.5)
    x_d /= 1.0 + 8.0 * t / t[-1]
    discrete = truth.discretise(T_s)
    x = discrete.forced_response(discrete.rest(), x_d - 3e-6 * np.tanh(np.gradient(x_d, T_s) / 2e-3))[0]
    lines = h1(x_d, x + 2e-7 * np.random.default_rng(0).standard_normal(len(x)), T_s)
    found = identify_frequency_response(lines.frequency, lines.response, std=lines.std, T_s=T_s, sampled=True)
    assert [mode.f_n for mode in found.model.modes] == pytest.approx([35.0], rel=0.01)


def test_given_deviations_weigh_the_lines() -> None:
    truth = ModalModel([Mode(20.0, 0.1, (40 * np.pi) ** 2, 5.0)])
    G = truth.frequency_response(OMEGA)
    std = np.where(F < 50, 1e-3, 1.0)
    rng = np.random.default_rng(0)
    G = G + std * (rng.standard_normal(len(F)) + 1j * rng.standard_normal(len(F))) / np.sqrt(2)
    found = identify_frequency_response(F, G, std=std)
    assert len(found.model.modes) == 1
    assert abs(found.model.modes[0].f_n - 20.0) < 4 * found.parameters[0].std < 0.01


def test_dead_time_and_over_damped_modes() -> None:
    truth = ModalModel([Mode(15.0, 2.0, (30 * np.pi) ** 2, 0.0)], dead_time=4)
    G = truth.frequency_response(OMEGA, 1e-3)
    found = identify_frequency_response(F, G, dead_time=4)
    assert found.model.dead_time == 4
    np.testing.assert_allclose(found.model.frequency_response(OMEGA, 1e-3), G, rtol=1e-9)


def test_a_single_real_pole_is_fitted() -> None:
    lag = 1 / (1 + 0.01j * OMEGA)
    found = identify_frequency_response(F, lag, n_modes=1)
    np.testing.assert_allclose(found.model.frequency_response(OMEGA), lag, rtol=1e-6)


def test_vector_fitting_reflects_unstable_poles() -> None:
    s = 1j * OMEGA
    G = np.asarray(100.0**2 / (s**2 - 2 * 0.1 * 100.0 * s + 100.0**2), dtype=np.complex128)
    poles = vector_fit(OMEGA, G, np.ones(len(F)), starting_poles(OMEGA, 1))
    assert poles.real.max() < 0


@pytest.mark.parametrize("axis", ["x", "y"])
def test_table_1_from_a_swept_sine(axis: str) -> None:
    """60 s, 1 % noise: the response within 1.2 %, every mode within 0.2 Hz."""
    truth, T_s = table_1(axis), 1e-3
    t = np.arange(60_000) * T_s
    x_d = 1e-3 * chirp(t, 1, 60, 100) * np.minimum(1, np.minimum(t, 60 - t) / 0.5)
    discrete = truth.discretise(T_s)
    x = discrete.forced_response(discrete.rest(), x_d)[0]
    x = x + 0.01 * np.std(x) * np.random.default_rng(0).standard_normal(len(x))
    lines = h1(x_d, x, T_s)
    assert 0.8 < lines.coherence.min() <= lines.coherence.max() <= 1.0
    found = identify_frequency_response(
        lines.frequency, lines.response, std=lines.std, T_s=T_s, sampled=True, n_modes=4
    )
    assert relative_error(found, truth).max() < 0.012
    for ours, other in zip(found.model.modes, truth.modes, strict=True):
        assert abs(ours.f_n - other.f_n) < 0.2
    assert 0.7 < found.noise < 1.3  # the deviations from the coherence are true of the lines


def test_acceleration_over_acceleration_is_the_same_ratio() -> None:
    truth, T_s = ModalModel([Mode(20.0, 0.1, (40 * np.pi) ** 2, 5.0)]), 1e-3
    t = np.arange(12_000) * T_s
    x_d = 1e-3 * chirp(t, 2, 12, 60) * np.minimum(1, np.minimum(t, 12 - t) / 0.5)
    discrete = truth.discretise(T_s)
    x = discrete.forced_response(discrete.rest(), x_d)[0]
    found = []
    for u, y in ((x_d, x), (np.gradient(np.gradient(x_d, T_s), T_s), np.gradient(np.gradient(x, T_s), T_s))):
        lines = h1(u, y, T_s, f_min=2.0)
        response = identify_frequency_response(lines.frequency, lines.response, T_s=T_s, sampled=True, n_modes=1)
        found.append(response.model.modes[0].f_n)
    assert found == pytest.approx([20.0, 20.0], abs=0.02)


def test_what_trains_nothing_is_refused() -> None:
    rng = np.random.default_rng(0)
    u, y = rng.standard_normal((2, 5000)) * 1e-3
    with pytest.raises(IdentificationError, match="not coherent"):
        h1(u, y, 1e-3)
    with pytest.raises(IdentificationError, match="it has 50 samples"):
        h1(u[:50], y[:50], 1e-3)
    with pytest.raises(IdentificationError, match="no line lies between 400 and 300 Hz"):
        h1(u, u, 1e-3, 400.0, 300.0)
    with pytest.raises(IdentificationError, match="it has 3 usable lines"):
        identify_frequency_response([1.0, 2.0, 3.0], [1.0, 1.0, 1.0])
    with pytest.raises(IdentificationError, match="as many frequencies as values"):
        identify_frequency_response(F, OMEGA[:10])
    with pytest.raises(ParameterError, match="n_modes must be 1 … 250"):
        identify_frequency_response(F, 1 / (1 + 0.01j * OMEGA), n_modes=0)


def test_findings_tell_of_gain_and_modes_outside() -> None:
    truth = ModalModel([Mode(20.0, 0.1, 0.5 * (40 * np.pi) ** 2), Mode(300.0, 0.1, 0.2 * (600 * np.pi) ** 2)])
    found = identify_frequency_response(F, noisy(truth.frequency_response(OMEGA), 0.001, 0))
    text = " ".join(found.findings)
    assert "static gain is 0.7" in text
    assert "outside of the lines" in text
    assert json.loads(json.dumps(found.summary()))["n_lines"] == 1000
    assert found.machine("axis", "An axis").model == found.model


G_FILE = table_1("x").frequency_response(OMEGA[:50])


@pytest.mark.parametrize(
    ("header", "columns"),
    [
        ("frequency,real,imag", (F[:50], G_FILE.real, G_FILE.imag)),
        ("f [Hz];Re(H);Im(H)", (F[:50], G_FILE.real, G_FILE.imag)),
        ("frequency [kHz],real,imag", (1e-3 * F[:50], G_FILE.real, G_FILE.imag)),
        ("freq_khz,real,imag", (1e-3 * F[:50], G_FILE.real, G_FILE.imag)),
        ("frequency (rad/s),real,imag", (OMEGA[:50], G_FILE.real, G_FILE.imag)),
        ("omega,h_re,h_im", (OMEGA[:50], G_FILE.real, G_FILE.imag)),
        ("Freq [Hz],Mag [dB],Phase [deg]", (F[:50], 20 * np.log10(np.abs(G_FILE)), np.rad2deg(np.angle(G_FILE)))),
        ("f,magnitude,phase [rad],std", (F[:50], np.abs(G_FILE), np.angle(G_FILE), np.abs(G_FILE))),
        ("f,gain,phase", (F[:50], np.abs(G_FILE), 360 + np.rad2deg(np.angle(G_FILE)))),
    ],
)
def test_text_files_of_responses(tmp_path: Path, header: str, columns: tuple[Array, ...]) -> None:
    path = tmp_path / "frf.csv"
    separator = ";" if ";" in header else ","
    np.savetxt(path, np.column_stack(columns), delimiter=separator, header=header, comments="", fmt="%.17g")
    assert has_response(path)
    frequency, response, std = read_response(path)
    np.testing.assert_allclose(frequency, F[:50], rtol=1e-14)
    np.testing.assert_allclose(response, G_FILE, rtol=1e-12)
    assert (std is not None) == ("std" in header)


def test_complex_vectors_of_a_matlab_file(tmp_path: Path) -> None:
    path = tmp_path / "frf.mat"
    io.savemat(path, {"f": F[:50], "H": G_FILE})
    assert has_response(path)
    np.testing.assert_array_equal(read_response(path).response, G_FILE)


def test_files_without_a_response(tmp_path: Path) -> None:
    path = tmp_path / "frf.csv"
    path.write_text("f,x\n1,2\n2,3\n", encoding="utf-8")
    assert not has_response(path)
    other = tmp_path / "phase.csv"
    other.write_text("f,mag,phase\n1,2,0.1\n2,3,0.2\n", encoding="utf-8")
    (tmp_path / "log.csv").write_text("frequency [rpm],real,imag\n1,1,0\n")
    with pytest.raises(LogError, match=r"column 'frequency \[rpm\]' must be in Hz, kHz or rad/s, its unit is 'rpm'"):
        read_response(tmp_path / "log.csv")
    with pytest.raises(LogError, match="may be in degrees or radians"):
        read_response(other)
    with pytest.raises(LogError, match=r"magnitude, phase was not found, the file has 'f', 'x'"):
        read_response(path)
