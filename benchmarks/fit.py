"""``hybridsep fit`` over logs of several machines, judged on their second halves beside what needs no hybrid.

    python -m benchmarks.fit [--emps DATA_EMPS.mat] [--windows 100 20] [LOG ...]      (six minutes)
    python -m benchmarks.fit --method my_module:MyMethod

RMS of the second half, which is held out, in 1e-6 of the log's unit. A first-order lag with dead time, fitted to
the first half by least squares, and its last residual held over the window; the physics model's last residual held;
ARX of 20 and 40 lags, frozen after the first half / refitted before each window; a state-space model (N4SID); the
identified physics model with its offset; the hybrid that the first half trained. The hybrid's RMS and largest error are
relative to the least of the eight others, their geometric means below the table; beside these stands in how many rows
``fit`` recommends the hybrid, and in how many of these another is better by 2 %.

An open benchmark: ``--method`` is one of your own, a class like :class:`Method`, whose RMS and largest error on the
same samples are printed below each row, relative to the best of all others. It may see the first half of a log, and of
the second each window after its prediction. The logs are the recordings beside this file, or yours.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from math import nan
from pathlib import Path
from typing import Protocol

import numpy as np

from benchmarks.averaging import RECORDINGS
from hybridsep.base.errors import HybridSepError
from hybridsep.base.metrics import ErrorSize
from hybridsep.base.signals import Array
from hybridsep.evaluate.verdict import ALIKE
from hybridsep.fitting.fit import fit
from hybridsep.logs.log import Log, read_log
from hybridsep.machines.machine import machine_name

WINDOWS = (100, 20)

COLUMNS = (
    *("lag + hold", "hold", "ARX20", "ARX40", "N4SID", "physics", "hybrid"),
    *("best of the others", "RMS ÷ its", "largest ÷ the least"),
)


class Method(Protocol):
    """Method of your own; positions are in m, or rad."""

    def fit(self, x_d: Array, x: Array, T_s: float, Np: int) -> None:
        """Learn from the first half, ``(n,)`` each, sampled every ``T_s``, s; windows will have ``Np`` samples."""

    def predict(self, x_d: Array) -> Array:
        """Return the positions of the next window, of whose commands, ``(Np,)``, it may know all."""

    def update(self, x: Array) -> None:
        """Learn the positions measured in the window that was predicted, ``(Np,)``, NaN where missing."""


def errors_of(method: Method, x_d: Array, x: Array, T_s: float, Np: int) -> Array:
    """Return the errors of a method over the second half of a log, from its first whole window on, ``(m,)``, m."""
    first, predicted = -(-round(0.5 * len(x)) // Np) * Np, list[Array]()
    method.fit(x_d[:first], x[:first], T_s, Np)
    for k in range(first, len(x), Np):
        predicted.append(np.asarray(method.predict(x_d[k : k + Np])))
        method.update(x[k : k + Np])
    return np.asarray(x[first:] - np.concatenate(predicted))


@dataclass(frozen=True)
class Row:
    """Log judged with one window."""

    name: str
    Np: int
    rms: dict[str, float]  # name of a prediction → RMS, 1e-6 of the unit; infinite where it diverged
    largest: dict[str, float]  # and largest error of those that did not
    advice: str

    @property
    def best(self) -> str:
        """Best prediction but the hybrid."""
        return min((name for name in self.rms if name != "hybrid"), key=lambda name: self.rms[name])

    @property
    def ratio(self) -> float:
        """RMS of the hybrid relative to the best of the others."""
        return self.rms["hybrid"] / self.rms[self.best]

    @property
    def ratio_of_largest(self) -> float:
        """Largest error of the hybrid relative to the least of the others."""
        return self.largest["hybrid"] / min(error for name, error in self.largest.items() if name != "hybrid")

    def __str__(self) -> str:
        def shown(*names: str) -> str:
            return " / ".join(
                f"{self.rms.get(name, nan):.4g}".replace("inf", "diverged").replace("nan", "–") for name in names
            )

        ways = [shown(f"{name} (frozen)", f"{name} (refitted)") for name in ("ARX20", "ARX40")]
        cells = [shown("lag + hold"), shown("hold"), *ways, shown("N4SID"), shown("physics model"), shown("hybrid")]
        ratios = [f"{self.ratio:.3f}", f"{self.ratio_of_largest:.3f}"]
        return f"| {' | '.join([self.name, str(self.Np), *cells, self.best, *ratios])} |"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--emps", type=Path, help="DATA_EMPS.mat")
    parser.add_argument("logs", type=Path, nargs="*", default=RECORDINGS, metavar="LOG", help="logs of yours instead")
    parser.add_argument("--windows", type=int, nargs="+", default=WINDOWS, help="samples in a window, Np")
    parser.add_argument("--method", help="a method of your own: its module, a colon, its class")
    given = parser.parse_args(arguments)
    print(f"| log | Np | {' | '.join(COLUMNS)} |\n|---|{'---|' * (len(COLUMNS) + 1)}")
    rows = []
    for log in logs(given.emps, given.logs):
        for Np in given.windows:
            try:
                rows.append(row(log, Np))
                print(rows[-1], flush=True)
                if given.method is not None:
                    print(own(given.method, log, rows[-1]), flush=True)
            except HybridSepError as error:
                print(f"| {log.path.name} | {Np} | {error} |", flush=True)
    print(f"\n{summary(rows)}")


def own(method: str, log: Log, judged: Row) -> str:
    """Return the line of a method of one's own: errors relative to the best of a row."""
    module, _, name = method.partition(":")
    made: Method = getattr(import_module(module), name)()
    size = ErrorSize.of(errors_of(made, log.x_d, log.x_meas, log.T_s, judged.Np))
    best, least = min(judged.rms.values()), min(judged.largest.values())
    ratios = f"RMS {1e6 * size.rms / best:.3f}, largest {1e6 * size.largest / least:.3f} × the best"
    return f"| {name} | {judged.Np} | {ratios} |"


def logs(emps: Path | None, recordings: Sequence[Path]) -> Iterator[Log]:
    """Yield the logs, as their files are."""
    if emps is not None:
        yield read_log(emps, columns={"x_d": "qg", "x": "qm"})
    yield from map(read_log, recordings)


def row(log: Log, Np: int) -> Row:
    """Return a row of the table."""
    found = fit(log, Np=Np, name=machine_name(log.path))
    scored = found.judged.replay.scored()
    rms, largest = (
        {one.name: 1e6 * one.rms for one in scored},
        {one.name: 1e6 * float(np.nanmax(np.abs(one.errors))) for one in scored if not one.diverged},
    )
    return Row(log.path.stem, Np, rms, largest, found.advice)


def summary(rows: Sequence[Row]) -> str:
    """Return the means, how often the hybrid is recommended, and how often where another is better by 2 %."""
    means = [
        float(np.exp(np.mean(np.log(one)))) for one in zip(*((r.ratio, r.ratio_of_largest) for r in rows), strict=True)
    ]
    used = [one for one in rows if one.advice.startswith("Use the hybrid")]
    wrong = [one for one in used if one.ratio > 1.0 / (1.0 - ALIKE)]
    return (
        f"means {means[0]:.3f} and {means[1]:.3f}; recommended in {len(used)} of {len(rows)} rows, in {len(wrong)} of "
        "which another is better by 2 %"
    )


if __name__ == "__main__":
    main()
