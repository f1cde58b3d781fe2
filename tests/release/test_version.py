"""The version with the commit: of a checkout by git, of wheel and sdist by a file, of anything else none."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from places import ROOT

from hybridsep.base.version import COMMIT_FILE, __version__, commit, version_text

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
