"""Agreement with other packages: vector fitting with scikit-rf's, poles with sdypy-EMA's."""

from typing import Any

import numpy as np
import pytest

from hybridsep import ModalModel, load_machine
from hybridsep_modal.frequency_response import identify_frequency_response
from hybridsep_modal.vector_fitting import starting_poles, vector_fit

F = np.linspace(1.0, 100.0, 1000)
OMEGA = 2 * np.pi * F


def table_1(axis: str) -> ModalModel:
    return load_machine(f"als25010_{axis}").model


def noise(seed: int) -> Any:
    rng = np.random.default_rng(seed)
    return 1 + 0.01 * (rng.standard_normal(len(F)) + 1j * rng.standard_normal(len(F))) / np.sqrt(2)


@pytest.mark.filterwarnings("ignore")  # the package's own
@pytest.mark.parametrize("axis", ["x", "y"])
def test_poles_are_those_of_scikit_rf(axis: str) -> None:
    from skrf import Frequency, Network
    from skrf.vectorFitting import VectorFitting

    def theirs(G: Any) -> Any:
        network = Network(frequency=Frequency.from_f(F, unit="hz"), s=G.reshape(-1, 1, 1), z0=50)
        fitting = VectorFitting(network)
        fitting.vector_fit(0, 4, fit_constant=False, fit_proportional=False, enforce_dc=False)
        return np.sort_complex(np.abs(fitting.poles) - 1j * fitting.poles.real)

    G = table_1(axis).frequency_response(OMEGA)
    exact = vector_fit(OMEGA, G, 1 / np.abs(G), starting_poles(OMEGA, 4))
    np.testing.assert_allclose(np.sort_complex(np.abs(exact) - 1j * exact.real), theirs(G), rtol=1e-8)
    # With noise, within what its own poles vary by from one noise to another
    others = np.array([theirs(G * noise(seed)) for seed in range(6)])
    found = identify_frequency_response(F, G * noise(0), n_modes=4)
    ours = np.array([mode.omega + 1j * mode.zeta * mode.omega for mode in found.model.modes])
    spread = others.real.std(axis=0, ddof=1)
    assert (np.abs(np.sort_complex(ours).real - others[0].real) < 4 * spread).all()


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("axis", ["x", "y"])
def test_poles_are_among_those_of_sdypy_ema(axis: str) -> None:
    """Its least-squares complex frequency method: poles of several orders, whose spread is the comparison's."""
    from sdypy.EMA import Model

    truth = table_1(axis)
    frequency = np.linspace(0.25, 1000.0, 4000)  # its discrete-time polynomials want the response to have decayed
    G = truth.frequency_response(2 * np.pi * frequency)
    model = Model(frf=G[None, :], freq=frequency, lower=0.5, upper=1000, pol_order_high=60, frf_form="receptance")
    model.get_poles(show_progress=False)
    for mode in identify_frequency_response(frequency, G).model.modes:
        near = np.concatenate(
            [
                frequencies[(np.abs(frequencies - mode.f_n) < 1.0) & (dampings > 0)]
                for frequencies, dampings in zip(model.pole_freq[20:], model.pole_xi[20:], strict=True)
            ]
        )
        assert len(near) > 20
        assert near.std() < 0.1
        assert abs(near.mean() - mode.f_n) < 3 * near.std()
