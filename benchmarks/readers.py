"""Logs of 1e7 samples in every recorder's format: time and memory to read them chunk by chunk.

``python -m benchmarks.readers`` writes each file, reads it in a process of its own and prints the time, the samples a
second and how much the memory grew behind what the format's library takes to be imported. ``--n`` is the number of
samples; Linux only. Workbooks are left out: they hold a million rows at most.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa

from benchmarks import recorders
from hybridsep import open_log
from hybridsep.base.signals import Array

T_S = 1e-3


def position(n: int) -> dict[str, Array]:
    """Return times, a commanded and a measured position, m."""
    t = T_S * np.arange(n)
    x = 0.1 * np.sin(t)
    return {"t": t, "x_d": x, "x": 0.9 * x}


def mdf(path: Path, n: int) -> None:
    recorders.write_mdf(path, [position(n)])


def tdms(path: Path, n: int) -> None:
    rated = {name: (T_S, values) for name, values in position(n).items() if name != "t"}
    recorders.write_tdms(path, rated, pieces=max(2, n // 100_000))


def parquet(path: Path, n: int) -> None:
    recorders.write_parquet(path, position(n), rows=1_000_000)


def arrow(path: Path, n: int) -> None:
    table = pa.table(dict(position(n)))
    with pa.ipc.new_file(path, table.schema) as writer:
        writer.write_table(table, max_chunksize=1_000_000)


def lines(head: str, row: str) -> Callable[[Path, int], None]:
    """Return a writer of lines of text, ``row`` with the fields k, t, x_d and x."""

    def write(path: Path, n: int) -> None:
        with path.open("w") as file:
            file.write(head)
            for k in range(n):
                x = 0.1 * np.sin(T_S * k)
                file.write(row.format(k=k, t=T_S * k, x_d=x, x=0.9 * x))
            if "<rec" in row:
                file.write(" </dataFrame></traceData></traceSession>\n")

    return write


def xml_head(n: int) -> str:
    """Return what stands before a trace's records."""
    signals = "".join(
        f'<dataSignal id="f{i}" interval="{T_S}" datapointCount="{n}" name="/Nck/!SD/{name} [u1, 1]"/>\n'
        for i, name in enumerate(("CmdPos", "ActPos"), 1)
    )
    return f'<?xml version="1.0"?>\n<traceSession>\n<traceData><dataFrame>\n{signals}'


def writers(n: int) -> Mapping[str, Callable[[Path, int], None]]:
    """Return the writers by format."""
    scope = recorders.twincat_csv({name: (T_S, np.zeros(1)) for name in ("x_d", "x")}).partition("\n0,0\t")[0] + "\n"
    pins = "joint.0.motor-pos-cmd", "joint.0.motor-pos-fb"
    return {
        "MDF": mdf,
        "TDMS": tdms,
        "Parquet": parquet,
        "Arrow": arrow,
        "TwinCAT": lines(scope.replace(",", "."), "{k}\t{x_d:.9f}\t{k}\t{x:.9f}\n"),
        "halscope": lines(f"# Sampling period is 1000000 ns\n{pins[0]};{pins[1]}\n", "{x_d:.14f};{x:.14f}\n"),
        "halscope, pairs": lines(
            "Sampling period is 1000000 ns \n", f"{pins[0]} {{x_d:+.14f}} {pins[1]} {{x:+.14f}} \n"
        ),
        "SINUMERIK": lines(xml_head(n), '<rec time="{t:.6f}" f1="{x_d:.9f}" f2="{x:.9f}"/>\n'),
    }


def read(path: Path) -> None:
    """Read a log in chunks; print samples, time, s, and growth of the memory, MB."""
    warm = path.with_name("small")
    sum(len(x) for x, _ in open_log(warm, unit="m").chunks())
    Path("/proc/self/clear_refs").write_text("5")  # the peak begins anew
    before, begin = _peak(), time.perf_counter()
    n = sum(len(x) for x, _ in open_log(path, unit="m").chunks())
    print(n, time.perf_counter() - begin, _peak() - before)


def _peak() -> float:
    """Return the peak of the resident memory, MB; getrusage begins with the parent's, which wrote the log."""
    status = Path("/proc/self/status").read_text()
    return float(next(line.split()[1] for line in status.splitlines() if line.startswith("VmHWM:"))) / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--n", type=int, default=10_000_000)
    parser.add_argument("--formats", nargs="+", help="some of the formats")
    parser.add_argument("--read", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.read:
        read(options.read)
        return
    print(f"{'format':16} {'MB':>6} {'s':>7} {'samples/s':>10} {'memory [MB]':>12}")
    for name, write in writers(options.n).items():
        if options.formats and name not in options.formats:
            continue
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "log"
            write(path, options.n)
            writers(10_000)[name](path.with_name("small"), 10_000)
            command = [sys.executable, "-m", "benchmarks.readers", "--read", str(path)]
            done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
            n, seconds, memory = map(float, done.stdout.split())
            size = path.stat().st_size / 2**20
            print(f"{name:16} {size:6.0f} {seconds:7.1f} {n / seconds:10.2e} {memory:12.1f}", flush=True)


if __name__ == "__main__":
    main()
