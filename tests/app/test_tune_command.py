"""``hybridsep tune``: table, JSON, machine file, refusals."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import Run, predictor, write_log

from hybridsep import load_machine
from hybridsep.app.fit import print_tuning
from hybridsep.base.settings import PredictorSettings
from hybridsep.fitting.tuning import Tuning

MACHINE = ("-m", "spring_mass_damper")
PAPER = (*MACHINE, *predictor(averaging="false"))
FEW = (*predictor(Np=50, t_init=0.1), "--try", "p=5,40", "--try", "q=0,1", "--try", "lambda=1e-12,1e-10,1e-8")


@pytest.fixture(autouse=True)
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.cpu_count", lambda: 1)


@pytest.mark.slow
def test_candidates_are_ranked_with_the_baselines_beside_and_the_best_written(hybridsep: Run, tmp_path: Path) -> None:
    log, out = write_log(tmp_path / "log.csv"), tmp_path / "tuned.toml"
    before = log.read_bytes()
    status, text, err = hybridsep("tune", log, *PAPER, *FEW, "--out", out)
    assert status == 0, err
    assert text.splitlines()[-1] == f"wrote {out}"
    text = " ".join(text.split())
    assert "RMS in µm against the measured position, Np = 50" in text
    within = "of 13 candidates are within 5 % of the best: p "
    assert all(words in text for words in ("physics", "hold", "as it is", "× hold", within, "chosen: "))
    assert log.read_bytes() == before
    found = json.loads(hybridsep("tune", log, *PAPER, *FEW, "--json")[1])
    tuned, own = load_machine(out).predictor_settings, load_machine("spring_mass_damper").predictor_settings
    assert {"p": tuned.p, "q": tuned.q, "lambda": tuned.lam} == found["chosen"]
    assert (tuned.Np, tuned.t_init, tuned.averaging) == (50, 0.1, False)
    assert own.Np == 100
    assert [one["own"] for one in found["candidates"]].count(True) == 1
    ratios = [one["ratio_to_hold"] for one in found["candidates"]]
    assert ratios == sorted(ratios)
    assert len(ratios) == 2 * 2 * 3 + 1
    assert list(found["logs"]) == ["log.csv"]
    assert found["findings"] == {"log.csv": []}
    backtest = ("backtest", log, "-m", out, "--json")
    replayed = json.loads(hybridsep(*backtest)[1])
    assert replayed["ratio_to_hold"] == pytest.approx(found["ratio_to_hold"], rel=1e-9)
    assert replayed["rms_pb_um"] == pytest.approx(1e6 * found["logs"]["log.csv"]["rms_pb"], rel=1e-9)


@pytest.mark.slow
def test_several_logs_and_averaging(hybridsep: Run, tmp_path: Path) -> None:
    logs = [write_log(tmp_path / name, n=n) for name, n in (("a.csv", 400), ("b.csv", 600))]
    (tmp_path / "sub").mkdir()
    logs.append(write_log(tmp_path / "sub" / "a.csv", n=300))
    few = [*predictor(Np=50), "--try", "p=10", "--try", "q=1", "--try", "effect=0,1e-5", "--try", "forgetting=0"]
    status, text, err = hybridsep("tune", *logs, *MACHINE, *few, "--json")
    assert status == 0, err
    found = json.loads(text)
    assert list(found["logs"]) == [str(logs[0]), "b.csv", str(logs[2])]
    assert found["averaging"] is True
    for one in found["candidates"]:
        rms = [one["rms_h"][name] / figures["rms_hold"] for name, figures in found["logs"].items()]
        assert one["ratio_to_hold"] == pytest.approx(np.prod(rms) ** (1 / 3))
    text = " ".join(hybridsep("tune", *logs, *MACHINE, *few)[1].split())
    assert "ranked by the geometric mean over the logs of RMS relative to hold" in text


def test_a_compensator_that_the_lags_do_not_fit_is_told_before_the_replays(hybridsep: Run, tmp_path: Path) -> None:
    machine = tmp_path / "machine.toml"
    assert hybridsep("tune", write_log(tmp_path / "log.csv", n=300), *PAPER, *FEW, "--out", machine)[0] == 0
    text = machine.read_text()
    machine.write_text(text[: text.index("[compensator]")] + "[compensator]\nNp = 20\np = 10\n")
    lags = ("--try", "p=40", "--try", "q=30", "--try", "lambda=1e-9")
    lagged = ("-m", machine, *lags, "--out", tmp_path / "new.toml")
    status, _, err = hybridsep("tune", tmp_path / "log.csv", *lagged)
    assert status == 2
    assert "compensator: q must be 0 … Np − 1 = 19, got 30" in err


@pytest.mark.slow
def test_what_diverges_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    own = PredictorSettings(averaging=False)
    settings = (own, replace(own, p=20), replace(own, p=30))
    hold = np.array([1e-6])
    for losses, words in (
        ((np.inf, 5e-7, np.inf), ("2 of 3 diverge", "chosen: p = 20", "diverges")),
        ((5e-7, np.inf, 4.9e-7), ("1 of 3 diverge", "the best is 2.0 % better, less than 5 % may be chance")),
        ((2e-6, 3e-6, 2e-6), ("no candidate is better than holding the last residual",)),
        ((np.inf, np.inf, np.inf), ("all 3 candidates diverge; try larger lambda or smaller p",)),
    ):
        found = Tuning(("a.csv",), settings, 2 * hold, hold, np.array(losses)[:, None])
        print_tuning(found, "Axis", 1e6, "µrad")
        text = " ".join(capsys.readouterr().out.split())
        assert "RMS in µrad" in text
        assert all(part in text for part in words)
