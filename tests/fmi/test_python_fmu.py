"""The pythonfmu FMUs: what they compute, carry and refuse, as fmpy tells it; their reference run: test_reference.py."""

import json
import re
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from built_once import BuiltFmus
from driving import T_S, closed_loop, replay, steps
from library_stream import trained_state
from places import ROOT
from programs import output_of
from streams import FmuStream

from hybridsep import FmuInstance, build_fmu, load_machine, paper_machine
from hybridsep.base.errors import FmuError
from hybridsep.fmi.weights import weights_file
from hybridsep.predict.predictor import HybridPredictor

MACHINE = load_machine("spring_mass_damper")
NAMES = {
    "HybridPredictor": "HybridPredictorPy",
    "FeedDrive": "FeedDrivePy",
    "FeedDrive_als25010_x": "FeedDrivePy_als25010_x",
}


@pytest.fixture
def predictor(fmus: BuiltFmus) -> Iterator[FmuInstance]:
    with FmuInstance(fmus("HybridPredictorPy")) as instance:
        yield instance


@pytest.mark.slow
@pytest.mark.parametrize("model", NAMES)
def test_both_flavours_agree(fmus: BuiltFmus, model: str) -> None:
    """1e-11 m, sample by sample; a state is restored, in another instance too, and goes on alike."""
    rows, blobs = [], []
    for name in (NAMES[model], model):
        machine = paper_machine(MACHINE.name) if model == "HybridPredictor" else None
        stream, other = (FmuStream(fmus(name, machine=machine), model) for _ in range(2))
        stream.initialise({})
        run = steps(stream, 0, 130)
        blobs.append(stream.save())
        run += steps(stream, 130, 260)
        for each in (stream, other):
            each.restore(blobs[-1])
            assert steps(each, 130, 260) == run[130:]
        rows.append(run)
        for each in (stream, other):
            each.close()
    np.testing.assert_allclose(rows[0], rows[1], rtol=0, atol=1e-11)


def test_weights_are_what_a_predictor_starts_with(fmus: BuiltFmus) -> None:
    path = trained_state("HybridPredictor")
    archive = fmus("HybridPredictorPy", machine=paper_machine(MACHINE.name), weights=path)
    with zipfile.ZipFile(archive) as content:
        assert content.read("resources/weights.bin") == weights_file(HybridPredictor.load(path))
    loop, stream = closed_loop("HybridPredictor", 400, weights=path), FmuStream(archive, "HybridPredictor")
    stream.initialise(loop.values)
    np.testing.assert_array_equal(replay(stream, loop), loop.outputs)
    stream.close()


@pytest.mark.slow
def test_different_fmus_of_one_name_in_one_process(fmus: BuiltFmus, tmp_path: Path) -> None:
    smaller = MACHINE.changed("predictor", {"Np": 60, "p": 20})
    paths = [fmus("HybridPredictorPy"), build_fmu(smaller, "HybridPredictorPy", tmp_path, "python")]

    def run(together: list[Path]) -> list[list[list[float]]]:
        streams = [FmuStream(path, "HybridPredictor") for path in together]
        for stream in streams:
            stream.initialise({})
        rows: list[list[list[float]]] = [[] for _ in streams]
        for k in range(250):
            for stream, row in zip(streams, rows, strict=True):
                row += steps(stream, k, k + 1)
        for stream in streams:
            stream.close()
        return rows

    expected = [*run(paths[:1]), *run(paths[1:])]
    assert run([*paths, paths[0]]) == [*expected, expected[0]]
    assert expected[0] != expected[1]


def test_what_is_refused_costs_nothing(predictor: FmuInstance, fmus: BuiltFmus) -> None:
    """pythonfmu gives up references at each exception; a second one would end the process."""
    with pytest.raises(FmuError, match=r"doStep is not allowed before the initialization has ended"):
        predictor.step(0.0, T_S)
    predictor.initialise()
    for _ in range(3):
        with pytest.raises(FmuError, match=r"p is a fixed parameter, which cannot be set after initialization, got 3"):
            predictor.set("p", 3)
        with pytest.raises(FmuError, match=r"x_h is an output variable"):
            predictor.set("x_h", 0.0)
        for h, said in ((-T_S, "the communication step size must be"), (0.4 * T_S, "must be whole samples of T_s")):
            with pytest.raises(FmuError):
                predictor.step(0.0, h)
            assert said in predictor.log[-1][1]
        with pytest.raises(FmuError, match="saved state"):
            predictor.restore(b"garbage")
    predictor.step(0.0, 2 * T_S)
    with pytest.raises(FmuError):
        predictor.step(0.0, T_S)
    assert "where the last step ended" in predictor.log[-1][1]
    predictor.step(2 * T_S, T_S)
    with FmuInstance(fmus("FeedDrivePy")) as drive:
        drive.initialise()
        with pytest.raises(FmuError, match="the state belongs to another FMU than HybridPredictorPy"):
            predictor.restore(drive.save())


@pytest.mark.slow
def test_it_carries_what_it_needs(fmus: BuiltFmus, tmp_path: Path) -> None:
    """And its slave can be imported where NumPy and SciPy are all there is."""
    script = """
import importlib, sys
sys.modules.update(dict.fromkeys(("hybridsep", "ruckig", "matplotlib", "fmpy", "control", "typer", "rich")))
sys.path.insert(0, ".")
slave = importlib.import_module(open("slavemodule.txt").read())
assert any(name.endswith("Py") for name in dir(slave))
"""
    for name in ("HybridPredictorPy", "FeedDrivePy"):
        with zipfile.ZipFile(fmus(name)) as archive:
            archive.extractall(tmp_path / name)
            assert json.loads(archive.read("resources/machine.json"))["name"] == name
            page = archive.read("documentation/index.html").decode()
            found = {re.sub(r"resources/hybridsep_\w+/", "", file) for file in archive.namelist()}
        assert {"slave.py", "predict/predictor.py", "plants/feed_drive.py"} < found
        assert not {"machines/machine.py", "compensate/qp.py", "fmi/archive.py"} & found
        assert "Limits of pythonfmu 0.7" in page
        output_of(sys.executable, "-c", script, cwd=tmp_path / name / "resources")


@pytest.mark.slow
def test_without_scipy_there_is_no_instance_but_a_reason(fmus: BuiltFmus) -> None:
    script = f"""
import sys
from hybridsep import FmuInstance, HybridSepError
sys.modules.update(dict.fromkeys([name for name in sys.modules if name.startswith("scipy")] + ["scipy"]))
for _ in range(3):
    try:
        FmuInstance({str(fmus("FeedDrivePy"))!r})
    except HybridSepError as error:
        print(error)
"""
    printed = output_of(sys.executable, "-c", script, cwd=ROOT)
    assert printed.count("the FMU needs a Python with NumPy and SciPy") == 3


def test_our_importer_leaves_no_removed_folder_in_the_path(fmus: BuiltFmus) -> None:
    before = list(sys.path)
    for _ in range(2):
        with FmuInstance(fmus("FeedDrivePy")) as instance:
            instance.initialise()
            assert sys.path != before
        assert sys.path == before
