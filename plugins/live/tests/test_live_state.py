"""What the page keeps and draws of a run."""

import json

import numpy as np
import pytest

from hybridsep.logs.units import shown_of
from hybridsep_live.core import Row
from hybridsep_live.state import COLUMNS, DRAWN, History, State, drawn, signals, table


def numbered(first: int, n: int) -> np.ndarray:
    k = np.arange(first, first + n, dtype=np.float64)
    return np.column_stack((1e-3 * k, k))


@pytest.mark.parametrize("sizes", [[1] * 37, [7] * 9, [40, 3, 25], [10], [9, 1, 10, 11, 100]])
def test_the_last_rows_are_kept(sizes: list[int]) -> None:
    history, n = History(2, capacity=10), 0
    for size in sizes:
        history.append(numbered(n, size))
        n += size
        for wanted in (1, 5, 10):
            rows, first = history.last(wanted)
            assert first == n - len(rows)
            assert len(rows) == min(wanted, n)
            assert rows[:, 1].tolist() == list(range(first, n))
    assert history.n == n
    rows, first = history.between((n - 4.5) * 1e-3, (n - 2.5) * 1e-3)
    assert first == rows[0, 1] == n - 5
    assert rows[-1, 1] == n - 2
    assert len(history.between(1e3, 2e3)[0]) == 1


def test_extremes_are_drawn_in_their_order() -> None:
    rng = np.random.default_rng(5)
    rows = np.column_stack((np.arange(1000) * 1e-3, rng.normal(size=(1000, 2))))
    rows[100:130, 2] = np.nan
    found = drawn(rows, first=3, columns=50)
    assert found.shape == (2 * 49, 3)
    assert np.all(np.diff(found[:, 0]) > 0)
    whole = rows[17 : 17 + 980].reshape(49, 20, 3)
    for stretch, pair in zip(whole, found.reshape(49, 2, 3), strict=True):
        assert (pair[:, 0] == stretch[[0, 10], 0]).all()
        for column in (1, 2):
            known = stretch[~np.isnan(stretch[:, column]), column]
            places = sorted({int(known.argmin()), int(known.argmax())}) if len(known) else []
            assert pair[:, column].tolist() == known[places].tolist() or np.isnan(pair[:, column]).all() == (not places)
    assert drawn(rows[:100], 0, 50) is not None
    assert len(drawn(rows[:100], 0, 50)) == 100


def test_a_line_that_moves_keeps_its_stretches() -> None:
    rows = np.column_stack((np.arange(3000) * 1e-3, np.random.default_rng(6).normal(size=3000)))
    before, after = drawn(rows[0:2000], 0, 100), drawn(rows[13:2013], 13, 100)
    same = np.isin(after[:, 1], before[:, 1])
    assert same[:190].all()


def test_what_is_drawn_of_a_row() -> None:
    rows = table([Row(5, 0.005, 0.1, 0.1002, 0.1001, 0.10015, 1e-5, 1, 2e-5)])
    assert rows.shape == (1, len(COLUMNS))
    shown = shown_of("", "m")
    found = dict(zip(DRAWN, signals(rows, shown)[0].tolist(), strict=True))
    assert found == pytest.approx(
        {
            "t": 0.005, "x_d": 100.0, "x_meas": 100.2, "e_meas": 200.0, "e_pb": 100.0, "e_h": 150.0, "e_low": 130.0,
            "e_high": 170.0, "r_pb": 100.0, "r_h": 50.0, "r_low": -20.0, "r_high": 20.0, "step": 20.0,
        }
    )  # fmt: skip
    unknown = table([Row(0, 0.0, 0.0, np.nan, 0.0, 0.0, 0.0, 0, 1e-5)])
    state = State("an axis", shown)
    state.begin(1e-3, 0)
    state.take(unknown, {})
    data = state.latest(1.0)[0]
    assert np.isnan(data["e_low"]).all()  # no band where the deviation is not known
    assert np.isnan(data["r_h"]).all()
    assert data["t"].dtype == np.float64
    assert data["e_h"].dtype == np.float32


def test_a_state_goes_through_its_phases() -> None:
    state = State("an axis", shown_of("", "m"))
    assert json.loads(state.words())["phase"] == "waiting"
    empty, start, end = state.latest(10.0)
    assert (empty["t"].tolist(), empty["e_h"].tolist(), start, end) == ([0.0], [0.0], 0.0, 10.0)
    assert state.between(0.0, 1.0)["t"].tolist() == [0.0]
    state.begin(1e-3, 100)
    rows = table([Row(k, 1e-3 * k, 0.0, 1e-6 * k, 0.0, 0.0, 1e-6, 1, 1e-5) for k in range(5000)])
    state.take(rows, {"n_samples": 5100})
    words = json.loads(state.words())
    assert words["phase"] == "running"
    assert (words["delay"], words["rows"], words["t"], words["n_samples"]) == (0.1, 5000, 4.999, 5100)
    latest, start, end = state.latest(2.0)
    assert (start, end) == pytest.approx((2.999, 4.999))
    assert len(latest["t"]) < 1000
    assert len(state.between(2.0, 4.0)["t"]) == 2003  # all there is, and one on either side
    state.end("")
    assert json.loads(state.words())["phase"] == "ended"
    state.end("sample 3 is refused")
    assert (state.is_over, json.loads(state.words())["message"]) == (True, "sample 3 is refused")
