"""``hybridsep tune``: table, JSON, figure, machine file, intake, refusals."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import Run, write_log

from hybridsep import load_machine

PAPER = ("-m", "spring_mass_damper", "--jobs", "1")  # its machine file says trust = false
FEW = ("--Np", "50", "--p", "5,40", "--q", "0:1", "--lambda", "1e-12:1e-8:x100", "--t_init", "0.1")


def test_candidates_are_ranked_with_the_baselines_beside_and_the_best_written(hybridsep: Run, tmp_path: Path) -> None:
    log, out, figure = write_log(tmp_path / "log.csv"), tmp_path / "tuned.toml", tmp_path / "tuned.png"
    before = log.read_bytes()
    status, text, err = hybridsep("tune", log, *PAPER, *FEW, "--out", out, "--figure", figure)
    assert status == 0, err
    assert "RMS in µm against the measured position, Np = 50" in text
    for words in (
        "physics",
        "hold",
        "as it is",
        "× hold",
        "of 13 candidates are within 5% of the best: p ",
        "chosen: ",
    ):
        assert words in text
    assert "no choice: the look-ahead is the controller's, and a shorter one is always predicted better" in text
    assert figure.read_bytes().startswith(b"\x89PNG")
    assert log.read_bytes() == before
    found = json.loads(hybridsep("tune", log, *PAPER, *FEW, "--json")[1])
    tuned, own = load_machine(out).predictor_settings, load_machine("spring_mass_damper").predictor_settings
    assert {"p": tuned.p, "q": tuned.q, "lambda": tuned.lam} == found["chosen"]
    assert (tuned.Np, tuned.t_init, tuned.trust) == (50, 0.1, False)
    assert own.Np == 100
    assert [one["own"] for one in found["candidates"]].count(True) == 1
    ratios = [one["ratio_to_hold"] for one in found["candidates"]]
    assert ratios == sorted(ratios)
    assert len(ratios) == 2 * 2 * 3 + 1
    assert list(found["logs"]) == ["log.csv"]
    assert [one["Np"] for one in found["over_Np"]] == [10, 25, 50, 100]
    assert found["findings"] == {"log.csv": []}
    backtest = ("backtest", log, "-m", out, "--json")
    replayed = json.loads(hybridsep(*backtest)[1])
    assert replayed["ratio_to_hold"] == pytest.approx(found["ratio_to_hold"], rel=1e-9)
    assert replayed["rms_pb_um"] == pytest.approx(1e6 * found["logs"]["log.csv"]["rms_pb"], rel=1e-9)


def test_several_logs_and_trust(hybridsep: Run, tmp_path: Path) -> None:
    logs = [write_log(tmp_path / name, n=n) for name, n in (("a.csv", 400), ("b.csv", 600))]
    (tmp_path / "sub").mkdir()
    logs.append(write_log(tmp_path / "sub" / "a.csv", n=300))
    few = ("--trust", "true", "--p", "10", "--q", "1", "--effect", "0,1e-5", "--forgetting", "0", "--Np", "50")
    status, text, err = hybridsep("tune", *logs, *PAPER, *few, "--json")
    assert status == 0, err
    found = json.loads(text)
    assert list(found["logs"]) == [str(logs[0]), "b.csv", str(logs[2])]
    assert found["trust"] is True
    for one in found["candidates"]:
        rms = [one["rms_h"][name] / figures["rms_hold"] for name, figures in found["logs"].items()]
        assert one["ratio_to_hold"] == pytest.approx(np.prod(rms) ** (1 / 3))
    text = hybridsep("tune", *logs, *PAPER, *few)[1]
    assert "ranked by the geometric mean over the logs of RMS relative to hold" in text


def test_a_log_with_a_gap_is_tuned_on_in_pieces(hybridsep: Run, tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.csv")
    lines = log.read_text().splitlines(keepends=True)
    log.write_text("".join([*lines[:900], *lines[1100:]]))
    status, _, err = hybridsep("tune", log, *PAPER, *FEW)
    assert status == 2
    assert "--fix" in err
    status, text, err = hybridsep("tune", log, *PAPER, *FEW, "--fix", "--json")
    assert status == 0, err
    assert "segments the longest" not in err
    assert "gaps" in [finding["name"] for finding in json.loads(text)["findings"]["log.csv"]]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--p", "5:120:5"), "--p: p must be 1 … Np = 100, got 105; lower p or raise Np"),
        (
            ("--lambda", "1e-12:1e-6"),
            "such as 5,10,50 or 5:100:5 (steps) or 1e-14:1e-6:x10 (factors), got '1e-12:1e-6'",
        ),
        (("--effect", "1e-5"), "--effect has an effect with trust only: give --trust true, too"),
        (("--fix", "--as-is"), "--fix and --as-is exclude each other"),
        (("--out", "x.csv"), "--out must end in .toml, got 'x.csv'"),
        (("--figure", "x.jpg"), "--figure must end in .png or .pdf or .svg, got 'x.jpg'"),
    ],
)
def test_what_cannot_be_is_refused_on_one_line(
    hybridsep: Run, tmp_path: Path, options: tuple[str, ...], words: str
) -> None:
    status, out, err = hybridsep("tune", write_log(tmp_path / "log.csv", n=300), *PAPER, *options)
    assert (status, out) == (2, "")
    assert len(err.strip().splitlines()) == 1
    assert words in err


def test_inputs_are_never_overwritten_nor_other_files(hybridsep: Run, tmp_path: Path) -> None:
    log, notes = write_log(tmp_path / "log.csv", n=300), tmp_path / "notes.toml"
    notes.write_text("title = 'mine'\n")
    machine = tmp_path / "machine.toml"
    assert hybridsep("tune", log, *PAPER, *FEW, "--out", machine)[0] == 0
    again = ("tune", log, "-m", machine, "--jobs", "1", *FEW, "--out")
    assert "is the same file as the machine file" in hybridsep(*again, machine)[2]
    assert "exists and is no machine file" in hybridsep(*again, notes)[2]
    assert hybridsep(*again, notes, "--force")[0] == 0


def test_a_compensator_that_the_lags_do_not_fit_is_told_before_the_replays(hybridsep: Run, tmp_path: Path) -> None:
    machine = tmp_path / "machine.toml"
    assert hybridsep("tune", write_log(tmp_path / "log.csv", n=300), *PAPER, *FEW, "--out", machine)[0] == 0
    text = machine.read_text()
    machine.write_text(text[: text.index("[compensator]")] + "[compensator]\nNp = 20\np = 10\n")
    lags = ("--p", "40", "--q", "30", "--lambda", "1e-9")
    lagged = ("-m", machine, "--jobs", "1", *lags, "--out", tmp_path / "new.toml")
    status, _, err = hybridsep("tune", tmp_path / "log.csv", *lagged)
    assert status == 2
    assert "compensator: q must be 0 … Np − 1 = 19, got 30" in err
