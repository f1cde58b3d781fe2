"""Command line: results, JSON, help and errors."""

import json
import re
from pathlib import Path

import fmpy
import numpy as np
import pytest
from command_line import Run, predictor, write_log, write_rows
from library_stream import trained_state
from machine_files import changed_machine
from staircase_data import commanded
from stream import COMPENSATOR

from hybridsep import Encoder, cosimulate, load_machine
from hybridsep.base.files import data_folder
from hybridsep.base.version import version_text
from hybridsep.evaluate.backtest import backtest


def test_backtest_of_a_log_with_missing_measurements(hybridsep: Run, tmp_path: Path) -> None:
    rows = write_log(tmp_path / "whole.csv", n=2000).read_text().splitlines()
    rows[1500] = rows[1500].rpartition(",")[0] + ","
    log = tmp_path / "log.csv"
    log.write_text("\n".join(rows))
    out = hybridsep.done("backtest", log, "-m", "spring_mass_damper", "--json")
    assert json.loads(out)["n_samples"] == 1999
    assert "1 of 2000 measurements were not learned: 1 missing" in json.loads(out)["verdict"]
    said = hybridsep.refused("backtest", log, "-m", "spring_mass_damper", *predictor(averaging="false"))
    assert "1500 is missing; it is replayed with averaging only (--set predictor.averaging=true)" in said


def test_backtest_takes_units_columns_and_parameters(hybridsep: Run, tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.csv", header="time,command,position", scale=1e3)
    names = ("--t", "time", "--x_d", "command", "--x", "position", "--unit", "mm")
    sizes = predictor(Np=50, p=20, q=1, lambda_=1e-11, t_init=0.2)
    out = hybridsep.done("backtest", log, "-m", "spring_mass_damper", "--json", *names, *sizes)
    assert json.loads(out)["n_batches"] == 50


@pytest.mark.slow
def test_backtest_of_what_cosim_writes(hybridsep: Run, tmp_path: Path) -> None:
    """The measured position counts, not the true one beside it, unless it is asked for."""
    machine = load_machine("spring_mass_damper")
    run = cosimulate(machine.new_predictor(), machine.new_plant(), commanded()[:800], encoder=Encoder(5e-6, 0))
    for suffix, options, x in ((".npz", ("--x", "x"), run.x), (".csv", (), run.x_meas)):
        run.save(tmp_path / f"run{suffix}")
        out = hybridsep.done("backtest", tmp_path / f"run{suffix}", "-m", machine.name, "--json", *options)
        expected = backtest(machine.new_predictor(), run.x_d, x).summary()
        assert json.loads(out)["rms_h_um"] == pytest.approx(expected["rms_h_um"], rel=1e-6)
    named = changed_machine(tmp_path / "machine.toml", machine.name, more='\n[log]\nx = "x"\n')
    out = hybridsep.done("backtest", tmp_path / f"run{suffix}", "-m", named, "--json")
    true = backtest(machine.new_predictor(), run.x_d, run.x).summary()
    assert json.loads(out)["rms_h_um"] == pytest.approx(true["rms_h_um"], rel=1e-6)
    assert true["rms_h_um"] != pytest.approx(expected["rms_h_um"], rel=1e-3)


def test_json_has_null_where_there_is_no_figure(hybridsep: Run, tmp_path: Path) -> None:
    log = write_log(tmp_path / "short.csv", n=150)
    out = hybridsep.done("backtest", log, "-m", "spring_mass_damper", *predictor(averaging="false"), "--json")
    assert json.loads(out)["rms_h_um_after_warm_up"] is None


def test_build(hybridsep: Run, tmp_path: Path) -> None:
    hybridsep.done("build", "FeedDriveFmi3", "--fmi", "3", "--target", "host", "--out", tmp_path / "3")
    assert fmpy.read_model_description(str(tmp_path / "3" / "FeedDriveFmi3.fmu")).fmiVersion == "3.0"
    out = hybridsep.done("build", "FeedDrivePy", "--flavour", "python", "--out", tmp_path)
    assert out.startswith(f"{tmp_path / 'FeedDrivePy.fmu'}  ")
    out = hybridsep.done("build", "-m", "emps", "--flavour", "python", "--out", tmp_path)
    assert "HybridPredictorPy_emps.fmu" in out
    assert sorted(path.name for path in tmp_path.glob("*.fmu")) == ["FeedDrivePy.fmu", "HybridPredictorPy_emps.fmu"]
    given = ("--set", "predictor.p=7", "--flavour", "python", "--out", tmp_path / "set")
    hybridsep.done("build", "HybridPredictorPy_emps", "-m", "emps", *given)
    description = fmpy.read_model_description(str(tmp_path / "set" / "HybridPredictorPy_emps.fmu"))
    assert {one.name: one.start for one in description.modelVariables}["p"] == "7"


@pytest.mark.slow
def test_cosim_over_a_file(hybridsep: Run, tmp_path: Path) -> None:
    path = tmp_path / "command.csv"
    rows = np.column_stack((np.arange(1500) * 1e-3, commanded()[:1500]))
    np.savetxt(path, rows, delimiter=",", header="t,Sollposition", comments="")  # by a known name, as fit has it
    options = ("--set", "plant.seed=2", "--out", tmp_path / "run.npz", "--figure", tmp_path / "made" / "run.png")
    out = hybridsep.done("cosim", "--trajectory", path, *options, "--json")
    assert (tmp_path / "made" / "run.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads(out)["n_samples"] == 1500
    with np.load(tmp_path / "run.npz") as arrays:
        assert len(arrays["x_h"]) == 1500
    again = hybridsep.done("cosim", "--trajectory", path, *options, *predictor(p=30), "--force", "--json")
    assert json.loads(again)["rms_h_um"] != json.loads(out)["rms_h_um"]


@pytest.mark.slow
def test_cosim_with_compensation(hybridsep: Run, tmp_path: Path) -> None:
    """Over the first moves of the staircase; the figures of all of it are the demo's."""
    command = write_rows(tmp_path / "command.csv", commanded()[:1300], commanded()[:1300])
    figures = {}
    for kind in ("off", "physics", "hybrid"):
        files = ("--out", tmp_path / "run.csv", "--figure", tmp_path / "run.png") if kind == "hybrid" else ()
        out = hybridsep.done("cosim", "--compensate", kind, "--trajectory", command, *files, "--json")
        summary = json.loads(out)
        assert summary[f"share_{kind}"] + (kind == "physics") * summary["share_off"] > 0.9  # or what the last plan left
        figures[kind] = summary["tracking_rms_um"]
    assert figures["hybrid"] < 0.6 * figures["physics"] < 0.24 * figures["off"]
    assert (tmp_path / "run.csv").read_text().startswith("t,x_d,x_dm,x,")
    assert (tmp_path / "run.png").read_bytes().startswith(b"\x89PNG")
    fmus = ("--predictor", tmp_path / "SepCompensator.fmu", "--plant", tmp_path / "FeedDrive.fmu")
    hybridsep.done("build", "SepCompensator", "FeedDrive", "--target", "host", "--out", tmp_path)
    out = hybridsep.done("cosim", "--compensate", "hybrid", "--trajectory", command, *fmus)
    assert f"{figures['hybrid']:.2f}" in out
    assert "planned by the hybrid 9" in out


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["stage", "identified"])
def test_cosim_says_that_an_identified_plant_is_no_measurement(hybridsep: Run, tmp_path: Path, kind: str) -> None:
    command = write_rows(tmp_path / "command.csv", commanded()[:400], commanded()[:400])
    how = ("--set", f"plant.kind='{kind}'", "--compensate", "off", "--trajectory", command)
    out = hybridsep.done("cosim", "-m", "als25010_x", *how)
    assert ("no measurement: results on it are optimistic." in " ".join(out.split())) == (kind == "identified")


@pytest.mark.slow
def test_cosim_of_two_axes_along_a_path(hybridsep: Run, tmp_path: Path) -> None:
    """A machine without [limits] moves within 1/1.25, 1/2 and 1/5 of the drive's."""
    text = (data_folder("models") / "als25010_y.toml").read_text(encoding="utf-8")
    y, path, out = (tmp_path / name for name in ("y.toml", "part.ngc", "run.npz"))
    y.write_text(re.sub(r"\[limits\](.|\n)*(?=\[drive_limits\])", "", text), encoding="utf-8")
    path.write_text("F9000 G1 X20\nF600 G3 X20 I-0.5", encoding="utf-8")
    printed = hybridsep.done("cosim", "als25010_x", y, "--path", path, "--out", out, "--json")
    figures = json.loads(printed)
    rms = [figures[key]["contour_rms_um"] for key in ("off", "physics", "hybrid_cold", "hybrid_warm")]
    assert rms == sorted(rms, reverse=True)
    with np.load(out) as run:
        assert np.max(np.abs(run["contour_off"])) * 1e6 == pytest.approx(figures["off"]["contour_max_um"])
        assert np.max(np.diff(run["x_d"])) / 1e-3 == pytest.approx(0.08, rel=1e-3)


def test_two_axes_are_delayed_alike(hybridsep: Run, tmp_path: Path) -> None:
    y = changed_machine(tmp_path / "y.toml", "als25010_y", ("preview = 200", "preview = 150"))
    err = hybridsep.refused("cosim", "als25010_x", y, "--path", "part.ngc")
    assert "one preview, got 0.001 s and 200 samples and 0.001 s and 150 samples" in err


@pytest.mark.slow
def test_weights_for_a_compensator(hybridsep: Run, tmp_path: Path) -> None:
    weights = trained_state(COMPENSATOR)
    command = write_rows(tmp_path / "command.csv", commanded()[:1000], commanded()[:1000])
    out = hybridsep.done("cosim", "--compensate", "hybrid", "--trajectory", command, "--weights", weights, "--json")
    assert json.loads(out)["tracking_rms_um"] < 2.5
    assert json.loads(out)["share_hybrid"] == 1.0
    tight = ("--set", "drive_limits.jerk=300", "--json")
    out = hybridsep.done("cosim", "--compensate", "physics", "--trajectory", command, "--weights", weights, *tight)
    assert json.loads(out)["limit_costs"] is not None


def test_help_lists_the_commands_in_whole_sentences(hybridsep: Run) -> None:
    out = hybridsep.done("--help")
    assert all(command in out for command in ("demo", "build", "cosim", "backtest", "init", "fit"))
    listed = out.partition("Commands:")[2].partition("An error is")[0]
    assert "From the log of an axis to its model, FMUs and a report." in listed
    assert "..." not in listed
    assert hybridsep("--version")[1].strip() == f"hybridsep {version_text()}"


def test_a_value_that_is_no_number_is_named(hybridsep: Run) -> None:
    err = hybridsep.refused("fit", "log.csv", "--Np", "10.5")
    assert "Invalid value for '--Np': must be a whole number, got '10.5'" in " ".join(err.split())
