"""Fleet of logs on a Dask cluster: every log once, a worker killed in mid-run, cost, memory of the scheduler.

``python -m benchmarks.fleet`` replays ``--logs`` logs of simulated drives, some of them broken, on a cluster of two
workers of which one is killed, then again; compares each row with a single replay, and the processor time, imports
aside, with the same replays in one process; and runs 300 and 3000 tasks without work for the memory. ``--fit`` fits,
which takes twenty times as long.
"""

from __future__ import annotations

import argparse
import importlib
import os
import resource
import shutil
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import psutil

from benchmarks.mutations import broken, log_text
from hybridsep.fleet.results import Results
from hybridsep.fleet.run import FleetRun, run_fleet
from hybridsep.fleet.settings import AxisTask, FleetSettings
from hybridsep.fleet.sources import find_logs
from hybridsep.fleet.task import look, work
from hybridsep.machines.machine import machine_path
from hybridsep.parallel.engine import Engine, cluster
from hybridsep.plants.trajectory import staircase

MACHINES, BROKEN = 10, 20
DRIVES = ("spring_mass_damper",)
FIGURES = ("rms_pb", "rms_hold", "rms_h", "ratio", "best", "peers", "friction", "n_windows", "findings", "verdict")


def write_logs(folder: Path, n: int, n_samples: int) -> None:
    """Write logs of simulated drives, of which the last ones are broken, and the machine files."""
    chance, whole = Random(1), staircase()
    (folder / "machines").mkdir(parents=True)
    for m in range(MACHINES):
        shutil.copy(machine_path(DRIVES[0]), folder / "machines" / f"mill{m}.toml")
    for i in range(n):
        begin = chance.randrange(len(whole) - n_samples)
        x_d = whole[begin : begin + n_samples]
        lag = chance.uniform(2.0, 6.0)
        x = np.interp(np.arange(n_samples) - lag, np.arange(n_samples), x_d)
        x += np.random.default_rng(i).normal(0.0, 2e-6, n_samples)
        content = log_text({"t": 1e-3 * np.arange(n_samples), "x_d": x_d, "x": x})
        if i >= n - BROKEN:
            content = content[: len(content) // 2].replace(b"0.0", b"0,,", 3) + b"\nend"
            content = broken(content, chance)
        path = (
            folder
            / "logs"
            / f"mill{i % MACHINES}"
            / f"2026-{1 + i // MACHINES // 28:02}-{1 + i // MACHINES % 28:02}"
            / "X.csv"
        )
        path.parent.mkdir(parents=True)
        path.write_bytes(content)


@contextmanager
def killing(after: float) -> Iterator[Engine]:
    """Start a cluster of two workers, of which one is killed after some time."""
    with cluster(2) as engine:

        def kill() -> None:
            pids = [one for one in psutil.Process().children(recursive=True) if "spawn_main" in " ".join(one.cmdline())]
            workers = [one for one in pids if not one.children()]
            os.kill(max(workers, key=lambda one: one.cpu_times().user).pid, signal.SIGKILL)
            print("  a worker was killed", flush=True)

        timer = threading.Timer(after, kill)
        timer.start()
        yield engine
        timer.cancel()


@contextmanager
def no_engine() -> Iterator[Engine]:
    raise SystemExit("an engine was started where nothing was to do")
    yield


def cpu() -> float:
    """Return the processor time of this process and its ended children, s."""
    return sum(
        one.ru_utime + one.ru_stime for one in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )


def single(settings: FleetSettings, out: Path, logs: Sequence[Any]) -> tuple[dict[str, dict[str, Any]], float]:
    """Return the rows of single fits or replays in this process, by address, and the processor time."""
    rows, begin = {}, time.process_time()
    for log in logs:
        try:
            looked = look((log, settings))
            rows[log.url] = work(AxisTask(looked, looked.axes[0], settings, "", str(out), ""))
        except ValueError as error:
            rows[log.url] = {"status": "failed", "message": str(error)}
    return rows, time.process_time() - begin


def compare(found: FleetRun, rows: dict[str, dict[str, Any]]) -> int:
    """Return how many rows differ from single ones."""
    return sum(
        any(row.get(name) != rows[row["url"]].get(name) for name in (*FIGURES, "message"))
        if rows[row["url"]]["status"] == "failed"
        else any(row[name] != rows[row["url"]][name] for name in FIGURES)
        for row in found.rows
    )


def nothing(task: int) -> int:
    """Return the task."""
    return task


def scheduler_memory(n: int) -> float:
    """Return by how many MB this process, in which the scheduler is, grows with a number of tasks without work."""
    with cluster(2) as engine:
        for _ in engine.run(nothing, range(50)):
            pass
        before = psutil.Process().memory_info().rss
        done = sum(1 for _ in engine.run(nothing, range(n)))
        assert done == n
        return float(psutil.Process().memory_info().rss - before) / 2**20


def imported(names: Sequence[str]) -> None:
    """Import what a task needs."""
    for name in ("hybridsep.fleet.task", *names):
        with suppress(ImportError):  # made by another module that is imported
            importlib.import_module(name)


def start_cost(names: Sequence[str]) -> float:
    """Return the processor time of a cluster whose workers import what they need, s.

    Parameters
    ----------
    names : sequence of str
        Modules that a first fit or replay has loaded.
    """
    begin = cpu()
    with cluster(2) as engine:
        for _ in engine.run(imported, [names] * 20):
            pass
    return cpu() - begin


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--logs", type=int, default=300)
    parser.add_argument("--samples", type=int, default=600, help="of each log")
    parser.add_argument("--kill", type=float, default=15.0, help="time after which a worker is killed, s")
    parser.add_argument("--fit", action="store_true", help="fit, without FMUs, instead of replaying")
    parser.add_argument("--tasks", type=int, nargs="*", default=[300, 3000])
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        write_logs(folder, options.logs, options.samples)
        source, machines = str(folder / "logs"), "" if options.fit else str(folder / "machines")
        settings = FleetSettings(machines=machines, fmus=False, reports=False, Np=20 if options.fit else None)
        logs = find_logs([source])
        loaded = set(sys.modules)
        single(settings, folder / "warm", logs[:1])
        late = [name for name in sys.modules if name not in loaded]
        rows, seconds = single(settings, folder / "single", logs)
        print(f"{len(logs)} logs in one process: {seconds:.1f} s of processor time", flush=True)
        found = run_fleet([source], folder / "out", settings, lambda: killing(options.kill))
        stored = [row["url"] for row in Results(folder / "out").rows()]
        print(f"rows {len(stored)}, of different logs {len(set(stored))}, failed {len(found.failed)}")
        print(f"rows that differ from single ones: {compare(found, rows)}")
        begin = time.perf_counter(), time.process_time()
        again = run_fleet([source], folder / "out", settings, no_engine)
        print(
            f"again: {len(again.rows)} rows in {time.perf_counter() - begin[0]:.2f} s, "
            f"{time.process_time() - begin[1]:.2f} s of processor time",
            flush=True,
        )
        begun = cpu()
        run_fleet([source], folder / "cost", settings, lambda: cluster(2))
        used, start = cpu() - begun, start_cost(late)
        print(
            f"processor time of a run without a kill: {used:.1f} s, {start:.1f} s of it start and imports; without "
            f"these {(used - start) / seconds:.2f} × that of one process",
            flush=True,
        )
    for n in options.tasks:
        print(f"{n} tasks without work: the scheduler's process grows by {scheduler_memory(n):.1f} MB", flush=True)


if __name__ == "__main__":
    main()
