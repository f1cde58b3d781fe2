"""Cluster of processes of this machine: every task once, processes that end, strangers that are refused."""

import gc
import json
import os
import socket
import ssl
import subprocess
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import psutil
import pytest
from command_line import Run, run_page, write_log
from distributed import Security
from fleet_stubs import squared
from places import ROOT

from hybridsep.base.errors import ParameterError
from hybridsep.machines.machine import machine_path
from hybridsep_fleet.engine import Done, Engine, cluster

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="processes are ended by SIGKILL")


@pytest.fixture(scope="module")
def engine() -> Iterator[Engine]:
    with cluster(2) as found:
        yield found


def client_of(engine: Engine) -> Any:
    return engine._client  # type: ignore[attr-defined]


def numbers(done: list[Done]) -> list[int]:
    return sorted(one.result[0] for one in done if not one.failure)


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


def test_processes_that_end(engine: Engine, tmp_path: Path) -> None:
    deadly = {3: str(tmp_path / "once"), 5: str(tmp_path / "always")}
    done = list(engine.run(squared, [(i, deadly.get(i, "")) for i in range(8)]))
    assert numbers(done) == [i**2 for i in range(8) if i != 5]
    failed = [one for one in done if one.failure]
    assert [one.task[0] for one in failed] == [5]
    assert failed[0].failure.startswith("the process that worked on it ended, twice: out of memory, or a ")
    assert "memory limit" in failed[0].failure


def greeting(address: str, context: ssl.SSLContext | None) -> bytes:
    """Return what a process of a cluster says first to who connects; nothing if it refuses."""
    host, port = address.split("://")[1].rsplit(":", 1)
    try:
        with (
            socket.create_connection((host, int(port)), timeout=5.0) as plain,
            nullcontext(plain) if context is None else context.wrap_socket(plain) as connection,
        ):
            if context is None:  # a server of TLS waits for its client to begin
                plain.sendall(b"hello, who is there?" * 10)
            return connection.recv(8)
    except (ssl.SSLError, ConnectionError):
        return b""


def test_a_stranger_is_refused(engine: Engine) -> None:
    """Without TLS, without a certificate, and with one of his own making; at the scheduler and at each worker."""
    client = client_of(engine)
    workers = client.scheduler_info(n_workers=-1)["workers"]
    nobody = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    nobody.check_hostname, nobody.verify_mode = False, ssl.CERT_NONE
    own, another = (one.get_connection_args("client")["ssl_context"] for one in (client.security, Security.temporary()))
    another.verify_mode = ssl.CERT_NONE
    for address in (client.scheduler.address, *workers, *(one["nanny"] for one in workers.values())):
        assert address.startswith("tls://127.0.0.1:")
        assert greeting(address, own)
        assert [greeting(address, stranger) for stranger in (None, nobody, another)] == [b"", b"", b""]


def test_a_cluster_listens_at_this_machine_alone(engine: Engine) -> None:
    assert engine
    processes = [psutil.Process(), *psutil.Process().children(recursive=True)]
    listening = {
        one.laddr.ip for process in processes for one in process.net_connections() if one.status == psutil.CONN_LISTEN
    }
    assert listening == {"127.0.0.1"}


NOT_CLOSING = """
import asyncio, multiprocessing, os, time
import distributed
from hybridsep_fleet import engine

async def waits_in_vain(_):
    await asyncio.sleep(3600)

if __name__ == "__main__":
    engine._CLOSED = 0.5
    with engine.cluster(1):
        workers = multiprocessing.active_children()
        distributed.LocalCluster._close = waits_in_vain
    end = time.monotonic() + 10.0
    while any(one.exitcode is None for one in workers) and time.monotonic() < end:
        time.sleep(0.05)  # a thread of Dask's may take the exit code first, and note it a moment later
    print([one.exitcode for one in workers], flush=True)
    os._exit(0)  # a thread waits in vain
"""


def test_the_workers_of_a_cluster_that_does_not_close_are_killed() -> None:
    done = subprocess.run([sys.executable, "-c", NOT_CLOSING], capture_output=True, text=True)
    assert done.stdout == "[-9]\n", done.stderr


def test_a_cluster_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hybridsep_fleet.engine._REACHED", 0.5)
    with (
        pytest.raises(ParameterError, match=r"--scheduler tcp://127\.0\.0\.1:9 cannot be reached"),
        cluster(scheduler="tcp://127.0.0.1:9"),
    ):
        pass
    gc.collect()  # the client's thread ends when it is collected, which must not be while another one starts
    with pytest.raises(ParameterError, match="--workers and --scheduler exclude each other"), cluster(1, "tls://x:1"):
        pass


def test_a_fleet_on_a_cluster(hybridsep: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The lines of the page, a log that is broken beside."""
    monkeypatch.chdir(tmp_path)
    write_log(tmp_path / "my_axis.csv", n=600)
    (tmp_path / "my_axis.toml").write_bytes(machine_path("spring_mass_damper").read_bytes())
    run_page(ROOT / "plugins" / "fleet" / "README.md", hybridsep)
    assert "Fleet of 1 machines, 1 axes" in (tmp_path / "results" / "report.html").read_text(encoding="utf-8")
    (tmp_path / "broken.csv").write_text("t,x_d,x\n0,0,0\n0.001,a,0\n")
    status, out, err = hybridsep("fleet", "my_axis.csv", "broken.csv", "--machines", ".", "--out", "results", "--json")
    assert (status, err) == (0, "")
    found = json.loads(out)
    assert (found["logs"], found["unchanged"]) == (2, 1)
    assert "column 'x_d' must be a number, got 'a'" in found["rows"][0]["message"]
