"""Workflow files of the hosters: pinned actions, no secrets, all that a contributor's run leaves out at night.

The version with the commit: of a checkout by git, of wheel and sdist by a file, of anything else none.
"""

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from places import ROOT
from properties import LEFT_OUT

from hybridsep.base.version import COMMIT_FILE, __version__, commit, version_text
from hybridsep.fmi.compile import ALL_TARGETS

GITHUB = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
GITLAB = ROOT / ".gitlab-ci.yml"


@pytest.mark.parametrize("path", [*GITHUB, GITLAB], ids=lambda path: path.name)
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


# The version ---------------------------------------------------------------------------------------------------------


needs_git = pytest.mark.skipif(not shutil.which("git"), reason="needs git")


def git(folder: Path, *arguments: str) -> str:
    identity = ["-c", "user.name=A", "-c", "user.email=a@example.com", "-c", "commit.gpgsign=false"]
    return subprocess.run(
        ["git", "-C", str(folder), *identity, *arguments], check=True, capture_output=True, text=True
    ).stdout.strip()


@needs_git
def test_the_commit_of_a_checkout(tmp_path: Path) -> None:
    git(tmp_path, "init", "-q")
    assert commit(tmp_path) == ""  # nothing has been committed
    (tmp_path / "file").write_text("1")
    git(tmp_path, "add", "file")
    git(tmp_path, "commit", "-q", "-m", "first")
    git(tmp_path, "tag", "v9")  # the commit is asked for, not its name
    assert commit(tmp_path) == git(tmp_path, "rev-parse", "HEAD")[:12]
    (tmp_path / "file").write_text("2")
    assert commit(tmp_path) == git(tmp_path, "rev-parse", "HEAD")[:12] + "-dirty"
    (tmp_path / "inside").mkdir()
    assert commit(tmp_path / "inside") == ""


def test_without_git_the_commit_is_that_of_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a wheel; git refuses the folder, or is not there."""
    (tmp_path / ".git").mkdir()
    assert commit(tmp_path) == ""
    monkeypatch.setenv("PATH", str(tmp_path))
    assert commit(tmp_path) == ""
    (tmp_path / COMMIT_FILE).parent.mkdir(parents=True)
    (tmp_path / COMMIT_FILE).write_text("0123456789ab\n")
    (tmp_path / ".git").rmdir()
    assert commit(tmp_path) == "0123456789ab"
    for found, text in (("0123456789ab", f"{__version__} (0123456789ab)"), ("", __version__)):
        monkeypatch.setattr("hybridsep.base.version.commit", lambda found=found: found)
        assert version_text() == text


def test_every_file_that_states_the_version_states_the_same() -> None:
    for file, form in (
        ("pyproject.toml", r'^version = "(.+)"$'),
        ("CITATION.cff", r"^version: (.+)$"),
        ("fmu_src/c/CMakeLists.txt", r"^  VERSION (.+)$"),
        ("conda/recipe.yaml", r'^  version: "(.+)"$'),
    ):
        assert re.findall(form, (ROOT / file).read_text(encoding="utf-8"), re.MULTILINE) == [__version__]


def test_condas_recipe_asks_for_what_the_wheel_asks_for() -> None:
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    needed = re.search(r"^dependencies = \[(.+?)^\]", project, re.MULTILINE | re.DOTALL)
    recipe = re.search(
        r"^  run:\n(.+?)^tests:", (ROOT / "conda/recipe.yaml").read_text("utf-8"), re.MULTILINE | re.DOTALL
    )
    assert needed
    assert recipe
    wheel = re.findall(r'^    "([\w-]+)([^";]+)', needed[1], re.MULTILINE)
    conda = re.findall(r"^ +(?:- |then: )([\w-]+) ([^\n(]+)$", recipe[1], re.MULTILINE)
    names = {"matplotlib-base": "matplotlib"}
    assert sorted(wheel) == sorted((names.get(name, name), bounds) for name, bounds in conda if name != "python")
