"""``--fmi`` of ``demo``: FMUs of FMI 3.0 from the same command, with the same outputs."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_line import Run
from staircase_data import commanded

from hybridsep.base.errors import ParameterError
from hybridsep.cosim.fmu import read_description
from hybridsep.demo import cases
from hybridsep.demo.cases import demo, demo_files


def test_another_version_is_refused_before_any_work(
    hybridsep: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    status, _, err = hybridsep("demo", "--fmi", "1")
    assert status == 2
    assert "--fmi must be one of 2, 3, both, got '1'" in err
    assert list(tmp_path.iterdir()) == []


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
