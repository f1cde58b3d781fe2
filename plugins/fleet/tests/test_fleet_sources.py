"""Logs of a fleet: folders, patterns, object stores; what of them is a machine and a day."""

import os
from pathlib import Path

import fsspec
import pytest

from hybridsep.base.errors import LogError
from hybridsep_fleet.sources import find_logs, local_copy

NAMES = ("mill1/2026-03-05/X.csv", "mill1/2026-03-06/X.csv", "saw/X.mat", "20260307_lathe_X.csv", "notes.md")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in NAMES:
        path = tmp_path / "logs" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name)
        os.utime(path, (1.7e9, 1.7e9))
    (tmp_path / "logs" / ".hidden.csv").write_text("")
    return tmp_path / "logs"


def test_logs_of_a_folder(folder: Path) -> None:
    found = [
        (Path(one.url).relative_to(folder).as_posix(), one.machine, one.recorded) for one in find_logs([str(folder)])
    ]
    assert found == [
        ("20260307_lathe_X.csv", "lathe_X", "2026-03-07"),
        ("mill1/2026-03-05/X.csv", "mill1", "2026-03-05"),
        ("mill1/2026-03-06/X.csv", "mill1", "2026-03-06"),
        ("saw/X.mat", "saw", "2023-11-14"),
    ]


def test_patterns_and_files(folder: Path) -> None:
    found = find_logs([str(folder / "*" / "*" / "X.csv"), str(folder / "mill1")])
    assert [one.machine for one in found] == ["X", "X"]  # as of the source that came last
    assert [one.machine for one in find_logs([str(folder / "*" / "*" / "X.csv")])] == ["mill1", "mill1"]
    assert [one.machine for one in find_logs([str(folder / "**" / "*.md")])] == ["notes"]
    assert [one.size for one in find_logs([str(folder / "saw" / "X.mat")])] == [9]
    with pytest.raises(LogError, match=r"none: there are no logs \(files that end in .*\.csv, .*, or a pattern\)"):
        find_logs([str(folder / "none")])
    with local_copy(str(folder / "saw" / "X.mat")) as path:
        assert path == folder / "saw" / "X.mat"


def store(url: str) -> None:
    """Write the logs, list them, and read one."""
    files, root = fsspec.core.url_to_fs(url)
    for name in NAMES:
        with files.open(f"{root}/{name}", "wb") as file:
            file.write(name.encode())
    found = find_logs([url])
    assert [one.machine for one in found] == ["lathe_X", "mill1", "mill1", "saw"]
    assert [one.recorded for one in found][:3] == ["2026-03-07", "2026-03-05", "2026-03-06"]
    assert all(one.size and one.stamp for one in found)
    stamps = {one.url: one.stamp for one in found}
    with files.open(f"{root}/saw/X.mat", "wb") as file:
        file.write(b"another")
    changed = [one.url for one in find_logs([url]) if one.stamp != stamps[one.url]]
    assert [one.endswith("saw/X.mat") for one in changed] == [True]
    assert [one.machine for one in find_logs([f"{url}/*/2026-*/X.csv"])] == ["mill1", "mill1"]
    with local_copy(changed[0]) as path:
        assert (path.name, path.read_bytes()) == ("X.mat", b"another")
    assert not path.exists()
    with (
        pytest.raises(LogError, match=r"saw/Y\.mat: cannot be read: FileNotFoundError"),
        local_copy(f"{url}/saw/Y.mat"),
    ):
        pass
    with pytest.raises(LogError, match="there are no logs"):
        find_logs([f"{url}/none"])


def test_memory() -> None:
    store("memory://fleet")


def test_an_unknown_store() -> None:
    with pytest.raises(LogError, match="nonsense://x: cannot be listed: ValueError: Protocol not known"):
        find_logs(["nonsense://x"])
