"""``hybridsep fit``: from a log to files that work, on held-out samples; what is refused, and going on."""

import json
import re
import shutil
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import Run, write_rows
from quick_fits import without_larger_structures
from staircase_data import commanded, measured

from hybridsep import HybridPredictor, load_machine, read_log
from hybridsep.app.fit import _next_steps
from hybridsep.base.errors import ParameterError
from hybridsep.cosim.loop import FmuController
from hybridsep.fitting.fit import fit
from hybridsep.fitting.identified_plant import IdentifiedPlant
from hybridsep.fitting.replay import replay, split_log
from hybridsep.fitting.result import Fit, fit_files
from hybridsep.fmi.weights import restore_weights, weights_file
from hybridsep.logs.checks import Finding
from hybridsep.machines.machine import machine_name

N = 3000
NP = 50


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_rows(tmp_path_factory.mktemp("log") / "axis.csv", commanded()[:N], measured(0)[:N])


@pytest.fixture(scope="module")
def short(log: Path) -> Path:
    part = np.r_[:400, 999:1399]  # a move in each half, between them at rest
    return write_rows(log.with_name("my axis.csv"), commanded()[part], measured(0)[part])


@pytest.fixture(scope="module")
def fitted(log: Path) -> Fit:
    with pytest.MonkeyPatch.context() as patch:
        without_larger_structures(patch)
        return fit(read_log(log), Np=NP)


@pytest.fixture(scope="module")
def built(fitted: Fit, log: Path) -> dict[str, Path]:
    return fitted.build(log.parent / "out")


@pytest.mark.slow
def test_figures_are_of_a_causal_replay_with_the_machine_file(fitted: Fit, built: dict[str, Path], log: Path) -> None:
    machine = load_machine(built["machine file"])
    assert machine == fitted.machine
    found = read_log(log)
    by_hand = replay(machine.new_predictor(), split_log([(found.x_d, found.x_meas)], 0.5))
    assert fitted.judged.replay.rms()[1:] == by_hand.rms()[1:]
    assert replace(by_hand, offset=fitted.identification.offset).rms() == fitted.judged.replay.rms()
    rms_pb, rms_hold, rms_h = by_hand.rms()
    assert rms_h < 0.6 * min(rms_pb, rms_hold)
    assert rms_h < 12e-6  # noise is 5 µm


def test_the_fmus_begin_with_what_was_learned_from_the_log(built: dict[str, Path], log: Path) -> None:
    found, saved = read_log(log), HybridPredictor.load(built["trained predictor"])
    trained = HybridPredictor(saved.model, saved.settings)
    restore_weights(trained, weights_file(saved))  # without the memory of the run
    trained.restart()
    x_d, x = found.x_d[: 6 * NP], found.x_meas[: 6 * NP]
    expected = []
    for i in range(0, len(x_d), NP):
        expected.append(trained.predict(x_d[i : i + NP]).x_h)
        trained.update(x[i : i + NP])
    (path,) = (path for path in built.values() if path.suffix == ".fmu")
    controller = FmuController(path, {})
    x_h = []
    with controller:
        controller.initialise(float(x_d[0]))
        outputs = list(controller.kind.outputs)
        for k in range(len(x_d) + NP):
            x_h.append(controller.outputs()[0][outputs.index("x_h")])
            ahead = float(x_d[min(k, len(x_d) - 1)])
            controller.step(k, ahead, float(x[k - NP]) if k >= NP else float(x_d[0]))
    np.testing.assert_allclose(x_h[NP:], np.concatenate(expected), rtol=0, atol=1e-9)


@pytest.mark.slow
def test_the_report_says_what_to_do_and_shows_the_figures(fitted: Fit, built: dict[str, Path]) -> None:
    advice = fitted.advice
    page = built["report"].read_text(encoding="utf-8")
    others = "ARX40 (refitted), the best of the others"
    assert advice == f"Use the hybrid: its error is 0.59 × the error of {others}, judged by 30 windows."
    assert advice in page
    assert all(f"{1e6 * value:.4g}" in page for value in fitted.judged.replay.rms())
    assert all(one in page for one in ("HybridPredictor_axis.fmu", ">Settings</h2>", ">Spectra of the errors</h2>"))
    assert page.count('<div id="chart') == 5
    estimated = {one.name: one.std > 0 for one in fitted.identification.parameters}
    assert not estimated["mode[1].beta"]
    for name, free in estimated.items():
        row = page.partition(f"<td>{name}</td>")[2].partition("</tr>")[0]
        assert ("± " in row) == free
        assert ("<td>fixed</td>" in row) != free


def test_the_report_says_how_long_moves_take_to_settle(fitted: Fit, tmp_path: Path) -> None:
    fitted.report(tmp_path / "with.html", in_position=50e-6)
    fitted.report(tmp_path / "without.html")
    page, other = ((tmp_path / name).read_text(encoding="utf-8") for name in ("with.html", "without.html"))
    assert re.search(r"Of \d+ moves \d+ settled within 50 µm before the next: [\d.]+ ms in the median", page)
    assert "Moves as recorded" not in other


def test_the_reports_script_replays_the_log(
    fitted: Fit, built: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By its name and columns, where it lies beside the report."""
    [log] = fitted.logs
    for path in (log.path, *(path for path in built.values() if path.suffix == ".fmu")):
        shutil.copy(path, tmp_path)
    page = built["report"].read_text(encoding="utf-8")
    script = unescape(page.partition("<pre>")[2].partition("</pre>")[0])
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(script, names)  # what a user copies
    result = names["result"][NP:]
    assert len(result) == len(log.x_d)
    np.testing.assert_allclose(result["x_d"], log.x_d, rtol=0, atol=1e-15)
    error = log.x_meas - result["x_h"]
    assert np.sqrt(np.mean(error**2)) < 1.2 * fitted.judged.replay.rms()[2]


@pytest.mark.slow
def test_the_command_line(hybridsep: Run, short: Path, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    out = hybridsep.done("fit", short, "--out", tmp_path / "fit", "--Np", 40, "--json")
    result = json.loads(out)
    assert result["findings"] == {"my axis.csv": []}
    assert set(result["files"].values()) == {str(path) for path in (tmp_path / "fit").iterdir()}
    assert load_machine(tmp_path / "fit" / "machine.toml").name == "my_axis"
    request.getfixturevalue("quick_fit")
    out = hybridsep.done("fit", short, "--out", tmp_path / "fit", "--Np", 40)
    assert "Np = 40" in out
    out = " ".join(out.split())
    assert "my axis.csv: 800 samples, 0.8 s at 1000 Hz, travel 20 mm, as the file states no unit" in out
    assert "report: " in out
    assert result["judged"]["n_windows"] == 10
    assert "Judged by 10 windows only." in out
    assert "So far the hybrid is " in out
    assert "judged by 10 windows only: record at least 1.7 s." in out
    assert "RMS [µm]" in out


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
def test_a_half_that_rests_is_named(tmp_path: Path) -> None:
    """It was the log whose commanded position does not move, where only the training half rests."""
    rest = np.full(300, commanded()[0])
    noise = np.random.default_rng(0).normal(0, 1e-6, 300)
    x_d, x = np.concatenate((rest, commanded()[:300])), np.concatenate((rest + noise, measured(0)[:300]))
    used = [read_log(write_rows(tmp_path / "axis.csv", x_d, x))]
    for logs, name in ((used, "this log"), (2 * used, "these logs")):
        found = fit(logs, Np=NP)
        [reason] = found.identification.findings
        why = "cannot determine a model, because the commanded position does not move"
        assert reason.startswith(f"the first half of {name} {why}")
        assert found.advice.endswith("record moves in both halves.")


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
def test_too_short_a_log_judges_nothing(tmp_path: Path) -> None:
    log = write_rows(tmp_path / "short.csv", commanded()[1000:1150], measured(0)[1000:1150])
    found = fit(read_log(log), Np=NP)
    words = "because it has 75 samples, at least 100 are needed; a gain of 1"
    assert words in found.identification.findings[0]
    told = "Nothing could be judged: the log's second half has 1 window of 50 samples; record at least 2.1 s."
    assert found.advice == told
    assert found.results()["judged"]["verdict"].startswith("Nothing is judged: ")


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
def test_missing_measurements(hybridsep: Run, tmp_path: Path) -> None:
    x_d, x = commanded()[:N], measured(0)[:N]
    x[np.random.default_rng(3).integers(0, N, 25)] = np.nan
    x[2050:2070] = np.nan  # in motion, in the test half
    n = int(np.isnan(x).sum())
    rows = "\n".join(f"{k * 1e-3:.3f},{x_d[k]:.9f},{'' if np.isnan(x[k]) else f'{x[k]:.9f}'}" for k in range(N))
    path = tmp_path / "axis.csv"
    path.write_text(f"t,x_d,x\n{rows}\n")
    status, said, err = hybridsep("fit", path, "--out", tmp_path / "out", "--Np", NP, "--json")
    assert (status, err) == (0, "")
    found = json.loads(said)
    [finding] = found["findings"]["axis.csv"]
    assert finding["name"] == "missing samples"
    assert finding["words"].startswith(f"{n} of {N} measured positions are missing")
    rms_pb, rms_hold, rms_h = (found["judged"][name] for name in ("rms_pb", "rms_hold", "rms_h"))
    assert rms_h < 0.7 * min(rms_pb, rms_hold)
    assert rms_h < 14e-6  # noise is 5 µm


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
def test_a_gap_separates_segments(hybridsep: Run, tmp_path: Path) -> None:
    log = write_rows(tmp_path / "axis.csv", commanded()[:1200], measured(0)[:1200])
    lines = log.read_text().splitlines(keepends=True)
    log.write_text("".join(lines[:400] + lines[800:]))
    status, out, err = hybridsep("fit", log, "--out", tmp_path / "fit", "--Np", 40)
    assert status == 0, err
    assert "note: axis.csv: 400 samples are missing in 1 gap" in err
    words = " ".join(out.split())
    assert "axis.csv: 800 samples, 0.8 s at 1000 Hz in 2 segments of a record of 1.2 s, travel" in words
    page = unescape((tmp_path / "fit" / "report.html").read_text(encoding="utf-8"))
    assert "800 samples, 0.8 s at 1000 Hz in 2 segments of a record of 1.2 s · look-ahead" in page
    assert "The window after a gap is no test window" in page


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
def test_a_rotary_axis_modulo_one_turn_is_unwrapped(hybridsep: Run, tmp_path: Path) -> None:
    """A part of the staircase as four turns."""
    scale = 8 * np.pi / np.ptp(commanded()[:1500])
    rows = [np.mod(np.degrees(scale * x[:1500]), 360.0) for x in (commanded(), measured(0))]
    log = write_rows(tmp_path / "axis.csv", *rows, header="t,x_d [deg],x_meas [deg]")
    status, out, err = hybridsep("fit", log, "--out", tmp_path / "fit", "--Np", 40)
    assert status == 0, err
    assert "jumps of a whole turn, the first at sample " in err
    assert "put in your drive's, in rad/s, rad/s² and rad/s³" in out
    shown, limit = re.search(r"these are (\S+) deg/s, \S+ deg/s², \S+ deg/s³.*?--v_max (\S+)", out, re.DOTALL).groups()  # type: ignore[union-attr]
    assert float(shown) == pytest.approx(np.degrees(float(limit)), rel=1e-3)
    assert json.loads((tmp_path / "fit" / "fit.json").read_text())["judged"]["rms_h"] < 12e-6 * scale


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
def test_a_rotary_axis_stays_one_under_the_default_machines_name(short: Path, tmp_path: Path) -> None:
    found = fit(replace(read_log(short), unit="rad"), Np=20, name="spring_mass_damper").build(tmp_path, report=False)
    assert load_machine(tmp_path / "machine.toml").unit == "rad"
    assert all(path.exists() for path in found.values())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("disturbed", "noted", "said"),
    [
        (True, [], ""),
        (True, ["late", "offset"], ", without the log's offset and so without --weights"),
        (False, ["offset"], ", without the log's friction and stiffness and so without --weights"),
    ],
)
def test_weights_are_advised_on_a_plant_that_has_what_they_learned(
    fitted: Fit, disturbed: bool, noted: list[str], said: str
) -> None:
    notes = {"axis.csv": [Finding(name, "", {}) for name in noted]}
    found = replace(fitted, findings=notes, plant=IdentifiedPlant({"mode": []} if disturbed else {}))
    lines = _next_steps(found, {"machine file": Path("a.toml"), "trained predictor": Path("a.state")})
    assert f"  # the compensated axis, on the identified model{said}: to try with, results are optimistic" in lines
    weights = "" if said else " --weights a.state"
    assert f"  hybridsep cosim -m a.toml --compensate hybrid{weights}" in lines


@pytest.mark.parametrize(
    ("file", "axis", "name"),
    [
        ("axis.csv", None, "axis"),
        ("X axis-2.tar.gz", None, "X_axis_2"),
        ("2026 run.csv", None, "axis_2026_run"),
        ("logs/spindle.2026-11-26.csv", None, "spindle_2026_11_26"),
        ("µ.csv", None, "axis"),
        ("capture.json", "Y1", "capture_Y1"),
        ("my_axis.csv.gz", "X", "my_axis_X"),
    ],
)
def test_the_machine_is_named_after_log_and_axis(file: str, axis: str | None, name: str) -> None:
    assert machine_name(Path(file), axis) == name


def test_what_cannot_be_is_refused(log: Path) -> None:
    found = read_log(log)
    with pytest.raises(ParameterError, match=r"axis\.csv is sampled every 0\.002 s, but axis\.csv has T_s = 0\.001 s"):
        fit([found, replace(found, T_s=2e-3)])
    with pytest.raises(ParameterError, match=r"axis\.csv is in rad, axis\.csv in m"):
        fit([found, replace(found, unit="rad")])
    with pytest.raises(ParameterError, match="Np must be at most 1500, got 1501: the first half of each log trains"):
        fit(found, Np=1501)
    with pytest.raises(ParameterError, match=r"must be of period, measurement_delay, v_max, .*, got 'pitch'"):
        fit(found, pitch=0.01)


def test_all_files_are_declared(built: dict[str, Path], log: Path) -> None:
    assert built == fit_files(log.parent / "out", "axis")
    assert set(built.values()) == set((log.parent / "out").iterdir())
