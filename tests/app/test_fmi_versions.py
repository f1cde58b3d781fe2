"""``--fmi`` of ``fit``, ``demo`` and ``init``: FMUs of FMI 3.0 from the same command, with the same outputs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import Run, write_rows
from quick_fits import without_other_settings, without_other_windows
from staircase_data import commanded, measured

from hybridsep.base.errors import ParameterError
from hybridsep.cosim.adapters import FmuController
from hybridsep.cosim.fmu import read_description
from hybridsep.demo import cases
from hybridsep.demo.cases import demo, demo_files
from hybridsep.fitting.fit import fit_files

NP = 20


@pytest.mark.slow
def test_fit_writes_trained_fmus_of_both_versions(
    hybridsep: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    without_other_windows(monkeypatch)
    without_other_settings(monkeypatch)
    x_d, x = commanded()[:800], measured(0)[:800]
    log = write_rows(tmp_path / "axis.csv", x_d, x)
    limits = ("--v_max", "0.2", "--a_max", "20", "--j_max", "5000", "--change_max", "0.001")
    status, out, _ = hybridsep("fit", log, "--Np", NP, "--fmi", "both", "--out", tmp_path / "fit", *limits)
    assert status == 0
    files = fit_files(tmp_path / "fit", "axis", compensator=True, fmi="both")
    assert set((tmp_path / "fit").iterdir()) == set(files.values())
    assert [name for name in files if "FMU" in name] == [
        "native FMU",
        "native FMU, FMI 3.0",
        "python FMU",
        "native compensator FMU",
        "native compensator FMU, FMI 3.0",
        "python compensator FMU",
    ]
    for what, path in files.items():
        assert f"{what}: {path}" in out
    two, three = files["native FMU"], files["native FMU, FMI 3.0"]
    assert [read_description(path).fmiVersion[0] for path in (two, three)] == ["2", "3"]
    assert np.array_equal(played(two, x_d, x), played(three, x_d, x))
    assert np.any(played(three, x_d, x)[: 2 * NP] != 0.0)


def played(fmu: Path, x_d: np.ndarray, x: np.ndarray, n: int = 300) -> np.ndarray:
    """Return an FMU's outputs over the beginning of a log, ``(n, n_outputs)``, m."""
    controller = FmuController(fmu, {}, 0.0)
    with controller:
        controller.initialise(float(x_d[0]))
        rows = []
        for k in range(n):
            rows.append(controller.outputs()[0])
            controller.step(k, float(x_d[k]), float(x[max(k - controller.delay, 0)]))
    return np.array(rows)


@pytest.mark.parametrize("command", [("fit", "axis.csv"), ("demo",)])
def test_another_version_is_refused_before_any_work(
    hybridsep: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    log = write_rows(tmp_path / "axis.csv", commanded()[:800], measured(0)[:800])
    status, _, err = hybridsep(*command, "--fmi", "1")
    assert status == 2
    assert "--fmi must be one of 2, 3, both, got '1'" in err
    assert list(tmp_path.iterdir()) == [log]


@pytest.mark.slow
def test_the_demo_runs_fmus_of_either_version(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cases, "staircase", lambda T_s: commanded()[:500])
    summaries = {}
    for fmi in ("2", "3"):
        out = tmp_path / fmi
        summaries[fmi] = cases.staircase_case(out, 1, "native", lambda _message: None, fmi)
        declared = set(demo_files(out, "native", emps=False, fmi=fmi))
        built = sorted(out.rglob("*.fmu"))
        assert set(built) <= declared
        assert len(built) == 4
        assert all((read_description(path).fmiVersion[0] == fmi) for path in built)
    assert summaries["2"] == summaries["3"]


def test_the_demo_has_one_version_in_python(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="pythonfmu's are of FMI 2 alone"):
        demo(tmp_path / "demo", flavour="python", fmi="both")
    assert not (tmp_path / "demo").exists()
