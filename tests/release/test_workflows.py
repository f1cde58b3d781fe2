"""Workflow files of the hosters: valid, the same checks on every system, nothing that can change unseen."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from places import ROOT
from properties import LEFT_OUT
from ruamel.yaml import YAML

from hybridsep.base.version import __version__
from hybridsep.fmi.compile import ALL_TARGETS

GITHUB = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
GITLAB = ROOT / ".gitlab-ci.yml"
WORKFLOWS = [*GITHUB, GITLAB]


def content(path: Path) -> Any:
    return YAML(typ="safe").load(path.read_text(encoding="utf-8"))


@pytest.mark.slow
@pytest.mark.parametrize(("schema", "paths"), [("vendor.gitlab-ci", [GITLAB]), ("vendor.github-workflows", GITHUB)])
def test_workflows_keep_to_their_schema(schema: str, paths: list[Path]) -> None:
    check = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", schema, *map(str, paths)]
    done = subprocess.run(check, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_actions_are_pinned_and_there_are_no_secrets(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert "secrets" not in text
    for action in re.findall(r"uses: (.+)", text):
        assert action.startswith("./") or re.fullmatch(r"actions/[\w-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", action), action


def test_the_checks_run_on_every_system() -> None:
    checks, nightly, release = map(content, GITHUB)
    runners = [each["os"] for each in checks["jobs"]["checks"]["strategy"]["matrix"]["include"]]
    assert {runner.split("-")[0] for runner in runners} == {"ubuntu", "windows", "macos"}
    assert ".ci/run" in [step.get("run") for step in checks["jobs"]["checks"]["steps"]]
    assert release["jobs"]["build"]["needs"] == ["checks", "nightly"]
    assert release["jobs"]["checks"]["uses"] == f"./{GITHUB[0].relative_to(ROOT).as_posix()}"
    assert release["jobs"]["nightly"]["uses"] == f"./{GITHUB[1].relative_to(ROOT).as_posix()}"
    assert ".ci/nightly" in [step.get("run") for step in nightly["jobs"]["nightly"]["steps"]]
    for path in GITHUB:
        assert content(path)["permissions"] == {"contents": "read"}

    gitlab = content(GITLAB)
    for job in ("linux", "windows", "macos"):
        script = gitlab[job].get("script", gitlab[".checks"]["script"])
        assert gitlab[job]["extends"] == ".checks"
        assert any(".ci/run" in line for line in script)
    assert ".ci/nightly" in gitlab["nightly"]["script"]
    assert gitlab["stages"].index(gitlab["release"]["stage"]) > gitlab["stages"].index(gitlab[".checks"]["stage"])


def test_the_oldest_python_is_among_them() -> None:
    oldest = re.findall(r'requires-python = ">=(.+)"', (ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert oldest[0] in [
        each["python"] for each in content(GITHUB[0])["jobs"]["checks"]["strategy"]["matrix"]["include"]
    ]
    assert oldest[0] in content(GITLAB)["linux"]["parallel"]["matrix"][0]["PYTHON"]


def test_what_a_contributors_run_leaves_out_runs_every_night(pytestconfig: pytest.Config) -> None:
    """All marks that tests/conftest.py deselects, and all properties, with all their examples."""
    (chosen,) = re.findall(r'pytest -m "(.+)"', (ROOT / ".ci" / "nightly").read_text(encoding="utf-8"))
    assert {*LEFT_OUT, "hypothesis"} == set(chosen.split(" or "))
    assert set(LEFT_OUT) < {line.partition(":")[0] for line in pytestconfig.getini("markers")}
    assert any("schedule" in str(rule) for rule in content(GITLAB)["nightly"]["rules"])
    for job in ("controllers", "linuxcnc"):
        steps = content(GITHUB[1])["jobs"][job]["steps"]
        assert f".ci/{job}" in [step.get("run") for step in steps]
        assert f".ci/{job}" in content(GITLAB)[job]["script"]
    assert re.search(r"^  schedule:$", GITHUB[1].read_text(encoding="utf-8"), re.MULTILINE)


@pytest.mark.skipif(not shutil.which("bash"), reason="the scripts are bash's")
def test_plug_ins_run_after_the_core_and_all_of_them_at_night() -> None:
    script = ROOT / ".ci" / "plugins"
    subprocess.run(["bash", "-n", script], check=True)
    names = sorted(path.parent.name for path in (ROOT / "plugins").glob("*/pyproject.toml"))
    assert f"for plug_in in {' '.join(names)}; do" in script.read_text(encoding="utf-8")
    assert ".ci/plugins" in (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    assert f".ci/plugins {' '.join(names)}" in (ROOT / ".ci" / "nightly").read_text(encoding="utf-8")


@pytest.mark.skipif(not shutil.which("bash"), reason="the scripts are bash's")
def test_a_release_has_all_platforms_and_what_workflows_keep() -> None:
    path = ROOT / ".ci" / "release"
    subprocess.run(["bash", "-n", path], check=True)
    (targets,) = re.findall(r"^targets=\((.+)\)$", path.read_text(encoding="utf-8"), re.MULTILINE)
    assert targets.split() == list(ALL_TARGETS)
    (kept,) = re.findall(r" out=(\S+)$", path.read_text(encoding="utf-8"), re.MULTILINE)
    assert content(GITLAB)["release"]["artifacts"]["paths"] == [kept]
    assert [
        step["with"]["path"] for step in content(GITHUB[2])["jobs"]["build"]["steps"] if "path" in step.get("with", {})
    ] == [kept]


@pytest.mark.skipif(not shutil.which("bash"), reason="the scripts are bash's")
def test_a_tag_of_another_version_is_refused() -> None:
    done = subprocess.run(["bash", ROOT / ".ci" / "release", "v9.9"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith(f"tag v9.9 is not of {__version__}")
