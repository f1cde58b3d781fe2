"""Text, data, block, stack and instructions of the C library on processors of controllers.

    python -m benchmarks.targets [--target m7 ...] [--windows 60] [--recall 8192] [--readme]

Replays a run of the paper's drive, cold and warm, on each processor: x86-64 here, the others in qemu's emulation of
whole machines without an operating system, so that the numbers depend on the compiler, its library of mathematics and
only the core. Instructions: x86-64 by callgrind; the others with qemu's -icount shift=0, by which an instruction takes
1 ns of the emulated clock, from the machine's own counter: the performance monitor's of the Cortex-A53, exactly; a
timer at 25 MHz of the Cortex-M boards, to 40 instructions. An instruction is no cycle.

--readme writes the table into fmu_src/c/README.md.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.targets.cases import KINDS, SIZES, Case
from benchmarks.targets.targets import C_SOURCES, TARGETS, Replay, Target, build, replay, sizes

README = C_SOURCES / "README.md"
BEGIN, END = "<!-- targets -->", "<!-- /targets -->"
_FEW_WINDOWS = 12  # replayed where each operation of a double takes a hundred instructions
_HEAD = (
    "processor",
    "look-ahead",
    "Np, p",
    "text, kB",
    "data, kB",
    "block, kB",
    "stack, kB",
    "median",
    "p99",
    "dearest",
    "dearest, warm",
)


def row(target: Target, kind: str, size: tuple[int, int], windows: int, recall: int, folder: Path) -> list[str]:
    """Return the cells of a row; numbers of instructions are in thousands."""
    replays: dict[bool, Replay] = {}
    for warm in (False, True):
        case = Case(kind, *size, windows, warm, recall)
        replays[warm] = replay(target, build(target, case, folder / f"warm_{int(warm)}"))
        if replays[warm].began != 0:
            raise RuntimeError(f"{target.name}: the weights were refused")
    cold, warm_run = replays[False], replays[True]
    bytes_of = sizes(target, kind, folder / "sizes")
    counts = [*np.percentile(cold.counts[2 * size[0] :], [50, 99, 100]), warm_run.counts.max()]
    kilobytes = [bytes_of.text, bytes_of.data, cold.block, max(cold.stack, warm_run.stack)]
    return [
        target.name,
        kind,
        "{}, {}".format(*size),
        *(f"{number / 1e3:.1f}" for number in kilobytes),
        *(f"{number / 1e3:,.1f}".replace(",", " ") for number in counts),
    ]


def table(rows: list[list[str]]) -> str:
    """Return the rows as Markdown."""
    lines = [_HEAD, ("---", "---", *["---:"] * (len(_HEAD) - 2)), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--target", action="append", choices=TARGETS, help="a processor; all of them if left out")
    parser.add_argument("--windows", type=int, default=60, help="windows of each replay")
    parser.add_argument("--recall", type=int, default=Case.recall, help="samples of the memory; 0: none")
    parser.add_argument("--readme", action="store_true", help="write the table into fmu_src/c/README.md")
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory(prefix="hsep_targets_") as name:
        for key in options.target or TARGETS:
            target = TARGETS[key]
            if missing := target.missing():
                print(f"{target.name}: without {missing} ({target.packages})", file=sys.stderr)
                if options.readme:
                    return 2
                continue
            for kind in KINDS:
                for size in SIZES:
                    windows = min(options.windows, _FEW_WINDOWS) if target.slow else options.windows
                    folder = Path(name) / f"{key}_{kind}_{size[0]}"
                    rows.append(row(target, kind, size, windows, options.recall, folder))
                    print(" | ".join(rows[-1]), flush=True)
    if options.readme:
        text = README.read_text(encoding="utf-8")
        before, after = text[: text.index(BEGIN)], text[text.index(END) :]
        README.write_text(f"{before}{BEGIN}\n{table(rows)}\n{after}", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
