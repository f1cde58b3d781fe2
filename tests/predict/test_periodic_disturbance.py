"""A drive whose force repeats with the position, as of cogging or a screw's pitch, predicted with its period known."""

import pytest

from benchmarks.periodic import errors

COGGING = 20e-6, 0.005  # amplitude and pitch, m; the noise is 1 µm


@pytest.mark.parametrize("second_start", [0.0, 0.0313])
def test_what_repeats_is_predicted_to_the_noise_wherever_a_run_starts(second_start: float) -> None:
    cold, warm = errors(*COGGING, COGGING[1], (0.0, second_start))
    without = errors(*COGGING, 0.0, (0.0, second_start))
    assert cold < 0.7 * without[0]
    assert warm < 1.2 < 10.0 < without[1]


def test_another_period_does_no_harm() -> None:
    for wrong, without in zip(errors(*COGGING, 0.83 * COGGING[1]), errors(*COGGING, 0.0), strict=True):
        assert wrong < 1.05 * without
