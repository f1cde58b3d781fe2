"""FMUs that start warm: a trained predictor built into the resources, in both flavours."""

import zipfile
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from c_core import CModel, refusal
from command_line import Run
from library_stream import trained_state
from spoiled_weights import spoiled
from stream import PREDICTOR

from hybridsep.base.errors import FmuError, StateError
from hybridsep.cosim.fmu import FmuInstance
from hybridsep.fmi.archive import build_fmu
from hybridsep.fmi.weights import restore_weights, weights_file
from hybridsep.machines.machine import load_machine, paper_machine
from hybridsep.predict.predictor import HybridPredictor

pytestmark = pytest.mark.usefixtures("short_references")

MACHINE = paper_machine("spring_mass_damper")


def build(out: Path, weights: Path | None = None, model: str = "HybridPredictor") -> Path:
    return build_fmu(MACHINE, model, out, targets=("host",), weights=weights)


@pytest.mark.slow
def test_the_weights_are_in_the_resources_and_in_the_guid(tmp_path: Path) -> None:
    """Of the Python flavour: test_python_fmu.py."""
    trained = trained_state(PREDICTOR)
    paths = [build(tmp_path / str(i), weights) for i, weights in enumerate((trained, trained, None))]
    assert paths[0].read_bytes() == paths[1].read_bytes()
    with zipfile.ZipFile(paths[0]) as archive:
        assert archive.read("resources/weights.bin") == weights_file(HybridPredictor.load(trained))
    guids = [fmpy.read_model_description(str(path)).guid for path in paths]
    assert guids[0] == guids[1] != guids[2]


def test_a_state_of_other_parameters_is_refused_by_name(tmp_path: Path) -> None:
    changed = replace(MACHINE.predictor_settings, q=5, lam=1e-9, T_s=2e-3, input_hold="foh")
    predictor = MACHINE.new_predictor(changed)
    predictor.predict(np.linspace(0, 1e-3, 50))
    predictor.update(np.linspace(0, 1e-3, 50))
    predictor.save(tmp_path / "other.state")
    with pytest.raises(StateError) as caught:
        build(tmp_path, tmp_path / "other.state")
    differing = "q = 5 instead of 3, lambda = 1e-09 instead of 1e-12, T_s = 0.002 instead of 0.001, input_hold = foh"
    assert f"was not trained for machine spring_mass_damper: it has {differing} instead of zoh; " in str(caught.value)


def test_a_state_of_another_machine_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(StateError, match=r"mode\[1\].f_n = .* instead of .*mode\[2\].f_n = none instead of "):
        build_fmu(load_machine("als25010_x"), "HybridPredictor_als25010_x", tmp_path, weights=trained_state(PREDICTOR))


def test_an_empty_state_is_refused(tmp_path: Path) -> None:
    empty = tmp_path / "empty.state"
    MACHINE.new_predictor().save(empty)
    with pytest.raises(StateError, match=r"empty\.state has learned no sample"):
        build(tmp_path, empty)


def test_weights_and_samples_have_one_model_each(tmp_path: Path) -> None:
    with pytest.raises(FmuError, match="weights are for a HybridPredictor or a SepCompensator, FeedDrive is"):
        build(tmp_path, trained_state(PREDICTOR), "FeedDrive")
    with pytest.raises(FmuError, match="samples are for a ReferenceTrajectory, FeedDrive is a FeedDrive"):
        build_fmu(MACHINE, "FeedDrive", tmp_path, samples=[0.0])


SMALL = {"p": 4, "q": 2, "Np": 20, "averaging": 1}


def small_predictor(n_windows: int = 0) -> HybridPredictor:
    """Return a predictor of the default machine with short windows that has learned."""
    settings = replace(MACHINE.predictor_settings, p=4, q=2, Np=20, averaging=True)
    predictor = HybridPredictor(MACHINE.model, settings, start=0.0)
    for k in range(n_windows):
        command = 1e-3 * np.sin(0.01 * np.arange(20 * k, 20 * k + 20))
        predictor.predict(command)
        predictor.update(0.99 * command)
    return predictor


def test_spoiled_files_are_refused_in_both_flavours() -> None:
    content, predictor = weights_file(small_predictor(20)), small_predictor()
    model = CModel(PREDICTOR, SMALL)
    damaged, other = spoiled(content)
    for name, changed in (damaged | other).items():
        with pytest.raises(StateError):
            restore_weights(predictor, changed)
        model.learn(changed)
        said = refusal(model.initialise)
        assert "damaged, truncated or from another version" in said if name in damaged else "weights.bin" in said, name
    assert predictor.regression.n_rows == 0.0
    model.learn(content)
    assert model.initialise().state.tobytes() != CModel(PREDICTOR, SMALL).initialise().state.tobytes()


def test_another_number_of_modes_is_named() -> None:
    learned = HybridPredictor(load_machine("als25010_x").model, MACHINE.predictor_settings)
    said = refusal(CModel(PREDICTOR, weights=weights_file(learned)).initialise)
    assert "the number of modes must be 4, with which this FMU was trained (weights.bin), got 1" in said


# The command line --------------------------------------------------------------------------------------------------


def test_build_takes_a_trajectory(hybridsep: Run, tmp_path: Path) -> None:
    command = 0.02 + 1e-4 * np.arange(20)
    rows = np.column_stack((1e-3 * np.arange(20), 1e3 * command))
    np.savetxt(tmp_path / "path.csv", rows, delimiter=",", header="t,x_d", comments="", fmt="%.12g")
    options = ("--trajectory", tmp_path / "path.csv", "--unit", "mm", "--target", "host", "--out", tmp_path)
    hybridsep.done("build", "ReferenceTrajectory", *options)
    with FmuInstance(tmp_path / "ReferenceTrajectory.fmu") as source:
        source.initialise()
        played = [source.get("r")]
        for k in range(25):
            source.step(k * 1e-3, 1e-3)
            played.append(source.get("r"))
    np.testing.assert_allclose(played, [*command, *[command[-1]] * 6], rtol=1e-12)
