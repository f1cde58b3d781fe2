"""``rms_hold`` of every implementation, against what is recomputed from the ``x_pb`` that it shows and ``x_meas``."""

import numpy as np
import pytest
from driving import T_S, run
from oracle import held
from staircase_data import commanded
from stream import COMPENSATOR, LIBRARY, OUTPUTS, PREDICTOR, Array, Value, machine_of
from streams import StreamMaker, on_all

from hybridsep.plants.plant import Encoder, simulate

N, FIRST = 1400, 1060
"""Samples, and the sample of the staircase where they begin: in the middle of a move, so the start is corrected."""


def disturbed(model: str, delay: int, *, missing: bool) -> tuple[Array, Array]:
    """Return commands and late measurements that stand, change their level, and are missing for a while, (n,), m."""
    machine, x_d = machine_of(model), commanded()[: FIRST + N]
    assert machine.plant is not None
    x = Encoder(1e-7, 5).measure_all(simulate(machine.new_plant(), x_d, T_S))
    x_d, x = x_d[FIRST:].copy(), np.concatenate((np.full(delay, x[FIRST]), x))[FIRST : FIRST + N].copy()
    x[250:590] = x[250]  # the axis stands while the command moves
    x[700:] += 3e-4  # the level changes, which is not believed at first
    x[739::100] += 1e-3  # at the end of windows, of other lengths too
    if missing:
        x[830:955] = np.nan
        x[1099] = np.nan
    return x_d, x


@pytest.mark.slow
@on_all((PREDICTOR, COMPENSATOR), alike=(LIBRARY,))  # the C core agrees with the library in every output
@pytest.mark.parametrize(
    "more",
    [
        {},
        {"t_init": 0.333},
        {"measurement_delay": 45},  # later than a window
        {"averaging": False, "t_init": 0.2},
    ],
    ids=lambda more: ",".join(f"{key}={value}" for key, value in more.items()) or "averaging",
)
def test_hold_is_the_residual_of_the_last_sample_measured(new_stream: StreamMaker, more: dict[str, Value]) -> None:
    values: dict[str, Value] = {"Np": 20, "p": 6, "q": 2, "averaging": True, "t_init": 0.0} | more
    fill, delay = 20, int(values.get("measurement_delay", 0))
    if new_stream.model == COMPENSATOR:
        fill = 50  # which ends within a window
        values |= {"preview": fill, "compensate": 2}
    x_d, x = disturbed(new_stream.model, delay, missing=bool(values["averaging"]))
    shown = run(new_stream(), x_d, x, values, saved_at=437)
    x_pb, rms_hold = (shown.T[OUTPUTS[new_stream.model].index(name)] for name in ("x_pb", "rms_hold"))
    measured, n = x[delay:], N - delay
    error = measured - held(x_pb[:n], measured, 20, delay=delay, first=fill)
    begin = fill + round(float(values["t_init"]) / T_S)
    assert not rms_hold[: begin + delay + 1].any()
    for k in (begin, begin + 1, 400, 600, 745, 900, n - 1):
        known = error[begin : k + 1][~np.isnan(error[begin : k + 1])]
        assert rms_hold[k + delay + 1] == pytest.approx(np.sqrt(np.mean(known**2)), rel=0, abs=1e-12), k
    assert rms_hold[-1] > 1e-5
