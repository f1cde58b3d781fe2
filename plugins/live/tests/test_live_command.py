"""Command ``hybridsep live``."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import urllib.request
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from built_once import BuiltFmus
from command_line import Run, run_page, write_log, write_rows
from places import ROOT
from staircase_data import commanded

from hybridsep.cosim.loop import cosimulate
from hybridsep.cosim.run import Run as Cosimulation
from hybridsep.machines.machine import machine_path

LIVE = ("--machine", "spring_mass_damper", "--no-page")


@pytest.fixture(scope="module")
def run(fmus: BuiltFmus) -> Cosimulation:
    return cosimulate(fmus("HybridPredictor"), fmus("FeedDrive"), commanded()[:1500])


def read(receiver: socket.socket, n: int, found: list[dict[str, Any]]) -> None:
    while len(found) < n:
        found.append(json.loads(receiver.recv(65536)))


def test_what_plotjuggler_gets_is_the_cosimulation_bit_for_bit(
    run: Cosimulation, fmus: BuiltFmus, tmp_path: Path, hybridsep: Run
) -> None:
    log = write_rows(tmp_path / "log.csv", run.x_d, run.x_meas)
    rows: list[dict[str, Any]] = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(20.0)
        thread = threading.Thread(target=read, args=(receiver, len(run.t), rows))
        thread.start()
        address = f"127.0.0.1:{receiver.getsockname()[1]}"
        built = ("--speed", "2", "--plotjuggler", address, "--json")
        status, out, err = hybridsep("live", log, *LIVE, *built)
        thread.join()
    assert (status, err) == (0, "")
    for name in ("x_d", "x_meas", "x_pb", "x_h", "x_h_std"):
        assert [row["spring_mass_damper"][name] for row in rows] == getattr(run, name).tolist()
    assert [row["timestamp"] for row in rows] == pytest.approx([1e-3 * k for k in range(1500)])
    counts = json.loads(out)
    assert counts["n_samples"] == 1500
    assert (counts["n_missing"], counts["n_repeated"], counts["n_late"]) == (0, 0, 0)
    assert counts["step_p99"] >= counts["step_p50"] > 0.0
    given = hybridsep("live", log, *LIVE, "--speed", "0", "--predictor", fmus("HybridPredictor"), "--json")
    assert json.loads(given[1])["rms_h"] == counts["rms_h"]


def test_what_is_printed(tmp_path: Path, hybridsep: Run) -> None:
    log = write_log(tmp_path / "log.csv", n=600)
    status, out, err = hybridsep("live", log, *LIVE, "--speed", "0")
    assert (status, err) == (0, "")
    assert "600 samples, 0 missing, 0 rejected, 0 repeated, 0 late, 0 malformed" in out
    assert re.search(r"RMS error since the warm-up: physics [\d.]+ µm, hold [\d.]+ µm, hybrid [\d.]+ µm", out)
    assert re.search(r"step: median [\d.]+ µs, 99 % [\d.]+ µs, longest [\d.]+ µs", out)


def test_lines_on_standard_input(tmp_path: Path, hybridsep: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    lines = "k,x_d [mm],x_meas [mm]\n" + "".join(f"{k},{k * 1e-3},{k * 1e-3}\n" for k in (*range(150), 149))
    (tmp_path / "lines").write_text(lines)
    with (tmp_path / "lines").open() as file:
        monkeypatch.setattr(sys, "stdin", file)
        status, out, _ = hybridsep("live", "-", *LIVE, "--json")
    assert status == 0
    assert (json.loads(out)["n_samples"], json.loads(out)["n_repeated"]) == (150, 1)
    (tmp_path / "lines").write_text(lines + "155,0,0\n")
    with (tmp_path / "lines").open() as file:
        monkeypatch.setattr(sys, "stdin", file)
        status, out, err = hybridsep("live", "-", *LIVE)
    assert (status, out) == (2, "")
    assert "error: samples 150 … 154 are missing, and with them commands" in err
    (tmp_path / "lines").write_text("")
    with (tmp_path / "lines").open() as file:
        monkeypatch.setattr(sys, "stdin", file)
        assert hybridsep("live", "-", *LIVE)[:2] == (0, "no sample came\n")


def test_what_is_refused(tmp_path: Path, fmus: BuiltFmus, hybridsep: Run) -> None:
    log = write_log(tmp_path / "log.csv", n=600)
    for arguments, words in (
        ((log, "--predictor", fmus("FeedDrive")), "is no predictor"),
        ((log, "--predictor", fmus("HybridPredictor"), "--weights", log), "leave out --predictor"),
        ((log, "--weights", log), "a saved state of kind 'predictor' was expected"),
        ((log, "--plotjuggler", "nowhere"), "--plotjuggler must be HOST:PORT"),
        (("udp:9870", "--speed", "2"), "--speed is for a log"),
        (("udp:9870", "--T_s", "-1"), "T_s must be"),
    ):
        status, out, err = hybridsep("live", *arguments, *LIVE)
        assert (status, out) == (2, "")
        assert words in err


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is a signal")
def test_the_page_stays_until_ctrl_c(tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.csv", n=400)
    command = [sys.executable, "-m", "hybridsep", "live", log, "-m", "spring_mass_damper", "--speed", "4"]
    with subprocess.Popen(
        [*map(str, command)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        address = process.stderr.readline().removeprefix("page: ").strip()
        with urllib.request.urlopen(address) as page:
            assert b"not a controller" in page.read()
        assert process.stderr.readline() == "the source has ended; Ctrl-C ends the page\n"
        assert process.poll() is None
        os.kill(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=30)
    assert (process.returncode, err) == (0, "")
    assert "400 samples, 0 missing" in out


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is a signal")
def test_ctrl_c_ends_a_stream() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(5e-3)
        shown = ("--plotjuggler", f"127.0.0.1:{listener.getsockname()[1]}", "--json")
        command = [sys.executable, "-m", "hybridsep", "live", f"udp:{port}", *LIVE, *shown]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
            for _ in range(6000):
                for _ in range(5):
                    sender.sendto(json.dumps({"x_d": 0.0, "x_meas": 0.0}).encode(), ("127.0.0.1", port))
                with suppress(TimeoutError):
                    assert json.loads(listener.recv(65536))["timestamp"] == 0.0
                    break
            os.kill(process.pid, signal.SIGINT)
            out, _ = process.communicate(timeout=30)
    assert process.returncode == 0
    assert json.loads(out)["n_samples"] > 100


def test_the_lines_of_the_page_run(hybridsep: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_log(tmp_path / "my_axis.csv", n=600)
    (tmp_path / "my_axis").mkdir()
    (tmp_path / "my_axis" / "machine.toml").write_bytes(machine_path("spring_mass_damper").read_bytes())
    run_page(ROOT / "plugins" / "live" / "README.md", hybridsep)
