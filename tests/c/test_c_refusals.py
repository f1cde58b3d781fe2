"""What the C models refuse, in the library's words, and that a refusal changes nothing."""

import math
from pathlib import Path

import c_core
import numpy as np
import pytest
from c_core import CModel, refusal, write_trajectory


def test_a_number_that_is_not_whole_is_refused() -> None:
    assert refusal(CModel("predictor", {"p": 2.5}).size) == "p must be a whole number, got 2.5"


def test_many_problems_are_cut_off_within_the_message() -> None:
    wrong = {key: math.nan for key in CModel("predictor_2").place if key.startswith("mode[") or key in c_core.PREDICTOR}
    message = refusal(CModel("predictor_2", wrong).size)
    assert message.startswith("Np must be finite, got nan; p must be finite, got nan; ")
    message = refusal(CModel("predictor_2", dict.fromkeys(wrong, -1.2345678901234567e-5)).size)
    assert 450 < len(message.encode()) < c_core.MESSAGE_SIZE


def test_resources_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "trajectory_3.bin"
    assert refusal(CModel("trajectory").size) == "trajectory_3.bin must be in the resources (none) and readable"
    assert "must be in the resources" in refusal(CModel("trajectory", resources=tmp_path).size)
    write_trajectory(tmp_path, np.arange(5.0), 2e-3)
    model = CModel("trajectory", resources=tmp_path)
    assert refusal(model.size) == "T_s must be 0.002 s, the interval of trajectory_3.bin, got 0.001"
    model.start_values()
    assert model["r"] == 0.0
    write_trajectory(tmp_path, np.array([1.0, math.nan]))
    assert refusal(model.initialise) == "trajectory_3.bin must be finite, got nan at sample 1"
    write_trajectory(tmp_path, np.arange(5.0))
    good = file.read_bytes()
    for bad in (b"", good[:20], good[:-1], good[:24], b"X" + good[1:], good + b"\0" * 8):
        file.write_bytes(bad)
        assert "it is damaged or truncated" in refusal(model.size)


@pytest.mark.parametrize("name", ["predictor", "compensator", "feed_drive", "stage_drive", "trajectory"])
def test_memory_of_another_size_is_refused(name: str, tmp_path: Path) -> None:
    write_trajectory(tmp_path, np.arange(5.0))
    model = CModel(name, resources=tmp_path)
    size = model.size()
    for other in (size - 8, size + 8):
        assert refusal(lambda other=other: model.initialise(size=other)) == (  # type: ignore[misc]
            f"the state must have {size} bytes, got memory for {other}; its file in the resources has changed "
            "meanwhile: initialise again"
        )
