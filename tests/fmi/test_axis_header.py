"""An axis as a C header: compiled into the library's example, it predicts what the library in Python predicts."""

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from c_compiler import C_SOURCES, FLAGS, compiler
from c_library import installed
from command_line import Run

from hybridsep import backtest, load_machine
from hybridsep.logs.formats import write_example
from hybridsep.predict.predictor import HybridPredictor

AXIS = "spring_mass_damper"
N = 3000


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, np.ndarray, np.ndarray]:
    """The beginning of the example log."""
    path = tmp_path_factory.mktemp("log") / "log.csv"
    write_example(path)
    lines = path.read_text(encoding="utf-8").splitlines()[: 2 + N]
    path.write_text("\n".join(lines), encoding="utf-8")
    _, x_d, x = 1e-3 * np.array([line.split(",") for line in lines[2:]], dtype=float).T
    return path, x_d, x


def replayed(header: Path, log: Path) -> subprocess.CompletedProcess[str]:
    """Compile the example with an axis and run it."""
    program = header.with_suffix("")
    given = ["-include", str(header), f"-DAXIS={AXIS}", f"-I{installed()}/include"]
    libraries = [f"-L{next(installed().rglob('libhsep.a')).parent}", "-lhsep", "-lm"]
    source = str(C_SOURCES / "examples" / "replay.c")
    include = [f"-I{next((installed() / 'include').rglob('hsep.h')).parent}"]
    subprocess.run([*compiler(), *FLAGS, *given, *include, source, *libraries, "-o", str(program)], check=True)
    return subprocess.run([program, str(log)], capture_output=True, text=True, check=False)


@pytest.mark.slow
@pytest.mark.parametrize("warm", [False, True])
def test_an_axis_is_replayed_as_the_library_replays_it(
    hybridsep: Run, tmp_path: Path, log: tuple[Path, np.ndarray, np.ndarray], warm: bool
) -> None:
    path, x_d, x = log
    machine = load_machine(AXIS)
    predictor, given = machine.new_predictor(), ["header", AXIS, "--predictor", "--out", str(tmp_path / "axis.h")]
    if warm:
        backtest(predictor, x_d, x)
        predictor.save(tmp_path / "trained.state")
        predictor = machine.new_predictor()
        predictor.begin_with(HybridPredictor.load(tmp_path / "trained.state"))  # weights hold no memory of commands
        predictor.restart(start=float(x_d[0]))
        given += ["--weights", str(tmp_path / "trained.state")]
    hybridsep.done(*given)
    done = replayed(tmp_path / "axis.h", path)
    assert (done.returncode, done.stderr) == (0, "")
    found = backtest(predictor, x_d, x).summary()
    printed = [float(number) for number in re.findall(r"\d+\.\d+", done.stdout)]
    assert printed == pytest.approx([found[name] for name in ("rms_pb_um", "rms_hold_um", "rms_h_um")], abs=2e-3)


def test_a_compensators_header_has_its_limits_and_compiles_as_cpp(hybridsep: Run, tmp_path: Path) -> None:
    status, out, _ = hybridsep("header", AXIS, "--out", str(tmp_path / "axis.h"))
    assert (status, "axis.h written" in out) == (0, True)
    text = (tmp_path / "axis.h").read_text(encoding="utf-8")
    numbers = load_machine(AXIS).fmi_compensator_parameters()
    for name in ("v_max", "preview", "compensate"):
        assert f"parameters->compensator.{name} = {numbers[name]!r};" in text
    folders = [f"-I{path}" for path in (C_SOURCES, *(C_SOURCES / "core").iterdir())]
    source = f'#include "{tmp_path}/axis.h"\n'
    for language in ("c", "c++"):
        check = [*compiler(), "-x", language, "-Wall", "-Wextra", "-Werror", "-fsyntax-only", *folders, "-"]
        subprocess.run(check, input=source, text=True, check=True)
