"""Engines of a fleet: every task once, and processes that end."""

from __future__ import annotations

import asyncio
import os
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest
from fleet_stubs import squared

from hybridsep.base.errors import LogError, ParameterError
from hybridsep.parallel.engine import Done, Engine, cluster, joblib_engine

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="processes are ended by SIGKILL")


@pytest.fixture(scope="module", params=["joblib", "dask"])
def engine(request: pytest.FixtureRequest) -> Iterator[Engine]:
    if request.param == "joblib":
        yield joblib_engine(2)
    else:
        with cluster(2) as found:
            yield found


def numbers(done: list[Done]) -> list[int]:
    return sorted(one.result[0] for one in done if not one.failure)


@pytest.mark.slow
def test_every_task_once_elsewhere(engine: Engine) -> None:
    done = list(engine.run(squared, [(i, "") for i in range(20)]))
    assert numbers(done) == [i**2 for i in range(20)]
    assert all(one.result == (one.task[0] ** 2, one.result[1]) for one in done)
    assert os.getpid() not in {one.result[1] for one in done}
    assert "2" in engine.words


def test_what_fails_says_why(engine: Engine) -> None:
    done = {one.task[0]: one for one in engine.run(squared, [(1, "raise"), (2, "unexpected"), (3, "")])}
    assert (done[1].failure, done[2].failure) == ("no log", "unexpected KeyError: 'inside'")
    assert done[3].result[0] == 9


@pytest.mark.slow
def test_processes_that_end(engine: Engine, tmp_path: Path) -> None:
    deadly = {3: str(tmp_path / "once"), 5: str(tmp_path / "always")}
    done = list(engine.run(squared, [(i, deadly.get(i, "")) for i in range(8)]))
    assert numbers(done) == [i**2 for i in range(8) if i != 5]
    failed = [one for one in done if one.failure]
    assert [one.task[0] for one in failed] == [5]
    assert failed[0].failure.startswith("the process that worked on it ended, twice: out of memory, or a ")
    assert ("memory limit" in failed[0].failure) == ("GB" in engine.words)


def test_one_process_is_this_one() -> None:
    done = list(joblib_engine(1).run(squared, [(2, ""), (3, "raise")]))
    assert done[0].result == (4, os.getpid())
    assert done[1].failure == "no log"


@pytest.mark.slow
def test_a_cluster_that_does_not_close(monkeypatch: pytest.MonkeyPatch) -> None:
    async def waits_in_vain(_: object) -> None:
        await asyncio.sleep(3600)

    monkeypatch.setattr("hybridsep.parallel.engine._CLOSED", 0.5)
    with cluster(1) as engine:
        (done,) = engine.run(squared, [(2, "")])
        monkeypatch.setattr("distributed.LocalCluster._close", waits_in_vain)
    until(lambda: not psutil.pid_exists(done.result[1]), 10)


@pytest.mark.slow
def test_engines_that_are_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hybridsep.parallel.engine._REACHED", 0.5)
    with (
        pytest.raises(ParameterError, match=r"--scheduler tcp://127\.0\.0\.1:9 cannot be reached"),
        cluster(scheduler="tcp://127.0.0.1:9"),
    ):
        pass
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(LogError, match=r"needs the extra fleet: pip install 'hybridsep\[fleet\]'"), cluster(1):
        pass


def until(true: Callable[[], object], most: float = 20.0) -> None:
    """Wait until something is true."""
    end = time.monotonic() + most
    while not true():
        assert time.monotonic() < end, "it took too long"
        time.sleep(0.005)
