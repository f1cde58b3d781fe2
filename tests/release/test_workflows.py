"""Workflow files of the hosters: pinned actions, no secrets, all that a contributor's run leaves out at night."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from places import ROOT
from properties import LEFT_OUT

from hybridsep.base.version import __version__
from hybridsep.fmi.compile import ALL_TARGETS

GITHUB = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
GITLAB = ROOT / ".gitlab-ci.yml"
WORKFLOWS = [*GITHUB, GITLAB]


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_actions_are_pinned_and_there_are_no_secrets(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert "secrets" not in text
    for action in re.findall(r"uses: (.+)", text):
        assert action.startswith("./") or re.fullmatch(r"actions/[\w-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", action), action


def test_what_a_contributors_run_leaves_out_runs_every_night(pytestconfig: pytest.Config) -> None:
    """All marks that tests/conftest.py deselects, and all properties, with all their examples."""
    (chosen,) = re.findall(r'pytest -m "(.+)"', (ROOT / ".ci" / "nightly").read_text(encoding="utf-8"))
    assert {*LEFT_OUT, "hypothesis"} == set(chosen.split(" or "))
    assert set(LEFT_OUT) < {line.partition(":")[0] for line in pytestconfig.getini("markers")}
    for job in ("controllers", "linuxcnc"):
        assert all(f".ci/{job}" in path.read_text(encoding="utf-8") for path in (GITHUB[1], GITLAB))
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
    assert all(kept in path.read_text(encoding="utf-8") for path in (GITLAB, GITHUB[2]))


@pytest.mark.skipif(not shutil.which("bash"), reason="the scripts are bash's")
def test_a_tag_of_another_version_is_refused() -> None:
    done = subprocess.run(["bash", ROOT / ".ci" / "release", "v9.9"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith(f"tag v9.9 is not of {__version__}")
