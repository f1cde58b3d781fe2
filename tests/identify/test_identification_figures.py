"""Figure of an identification: nothing is cut off or hidden."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from drawn import cut_off, figures_drawn, hiding_legends

from hybridsep import ModalModel, Mode
from hybridsep.identify.figures import operation_figure
from hybridsep.identify.operation import identify_operation


@pytest.mark.slow
def test_nothing_is_cut_off_or_hidden(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    x_d = np.cumsum(np.repeat(rng.choice([-1e-5, 0.0, 1e-5], 20), 150))
    discrete = ModalModel([Mode(45.0, 0.08, (2 * np.pi * 45.0) ** 2)]).discretise(1e-3)
    x = discrete.forced_response(discrete.rest(), x_d)[0] + 1e-6 * rng.standard_normal(len(x_d))
    with figures_drawn() as drawn:
        operation_figure(
            identify_operation([(x_d, x)], 1e-3), [(x_d, x)], "a log of a long name.csv", tmp_path / "a.png"
        )
    assert cut_off(drawn[0]) == []
    assert hiding_legends(drawn[0]) == 0
