"""Live view over a long replay: samples, step times, agreement, and what headless Chromium sees of the page.

    python -m benchmarks.live [--seconds 600] [--out FOLDER] [--chromium PATH]

A drive is co-simulated with the native predictor FMU, which is the reference; its commands and measured positions are
then replayed as a log at true speed, 1 kHz, while a browser of its own process looks at the page. Chromium is Debian's
package, or any other; it draws without a graphics processor.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import shutil
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.browser import browser
from hybridsep import backtest, cosimulate, load_machine
from hybridsep.base.signals import Array
from hybridsep.cosim.fmus import FmuController
from hybridsep.cosim.run import Run
from hybridsep.fmi.builds import build_pair
from hybridsep.fmi.warm_start import warm_predictor
from hybridsep.live.core import Row
from hybridsep.live.page import Page
from hybridsep.live.recorded import RecordedSource
from hybridsep.live.run import run_live
from hybridsep.live.view import COLUMNS, table
from hybridsep.logs.log import open_log
from hybridsep.logs.units import shown_of
from hybridsep.plants.trajectory import staircase

LOOKS = {"desk": (1200, 900, False), "phone": (390, 844, True)}
"""Width and height, px, and whether it is a phone."""

FRAMES = "live.found.painted"


class Kept:
    """Sink that keeps all rows."""

    def __init__(self) -> None:
        self.tables: list[Array] = []

    def begin(self, experts: tuple[str, ...], T_s: float, delay: int) -> None:
        """Take nothing in."""

    def take(self, rows: Sequence[Row], status: Mapping[str, Any]) -> None:
        """Take rows in."""
        self.tables.append(table(list(rows)))

    def end(self, message: str) -> None:
        """Take nothing in."""

    def columns(self) -> dict[str, Array]:
        """Return all rows by column."""
        rows = np.concatenate(self.tables)[:, : len(COLUMNS)]
        return dict(zip(COLUMNS, rows.T, strict=True))


async def watch(address: str, seconds: float, out: Path, program: str) -> dict[str, Any]:
    """Look at the page for so long; return what was seen."""
    rates: list[float] = []
    async with browser(program) as page:
        await page.look(*LOOKS["desk"][:2], dark=False)
        await page.open(address)
        await page.until("window.live && live.found.ready")
        await asyncio.sleep(3.0)
        begun = time.monotonic()
        while time.monotonic() - begun < seconds:
            before, since = await page.value(FRAMES), time.monotonic()
            await asyncio.sleep(min(10.0, seconds))
            rates.append((await page.value(FRAMES) - before) / (time.monotonic() - since))
        wide = []
        for name, (width, height, phone) in LOOKS.items():
            for dark in (False, True):
                await page.look(width, height, dark=dark, phone=phone)
                await asyncio.sleep(1.0)
                wide.append(await page.value("document.documentElement.scrollWidth - innerWidth"))
                await page.picture(out / f"live_{name}_{'dark' if dark else 'light'}.png")
        await page.key(" ", " ")
        for _ in range(3):
            await page.key("+", "+")
        await asyncio.sleep(1.0)
        await page.picture(out / "live_zoomed.png")
        width = await page.value(
            "(({start, end}) => end - start)(Bokeh.documents[0].get_model_by_name('error').x_range)"
        )
        paused = await page.value("document.getElementById('phase').textContent")
        await page.key("Escape")
        await asyncio.sleep(1.0)
        live = await page.value("document.getElementById('phase').textContent")
        asked = sorted({one.partition("?")[0] for one in page.asked})
        return {
            "frames_per_s": [min(rates), sum(rates) / len(rates)],
            "console": page.console,
            "asked": asked,
            "wide": max(wide),
            "zoomed": width,
            "phases": [paused.split(" ")[0], live.split(" ")[0]],
        }


def refused(address: str) -> bool:
    """Return whether the page is refused without its token."""
    try:
        urllib.request.urlopen(address.partition("?")[0])
    except urllib.error.HTTPError as error:
        return error.code == 403
    return False


def agreement(found: Mapping[str, Array], run: Run) -> tuple[bool, float]:
    """Return whether rows are the co-simulation's bit for bit, and their largest distance to a replay, m."""
    names = ("x_d", "x_meas", "x_pb", "x_h", "x_h_std", "active")
    same = all(np.array_equal(found[name], getattr(run, name), equal_nan=True) for name in names)
    replay = backtest(warm_predictor(load_machine("spring_mass_damper"), None), run.x_d, run.x_meas)
    return same, float(np.abs(found["x_h"] - replay.x_h)[run.Np :].max())


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--out", type=Path, default=Path())
    parser.add_argument("--chromium", default=shutil.which("chromium") or "chromium")
    parser.add_argument("--watch", help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    if given.watch:
        print(json.dumps(asyncio.run(watch(given.watch, given.seconds, given.out, given.chromium))))
        return
    machine = load_machine("spring_mass_damper")
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        predictor, plant = build_pair(machine, folder, "native")
        once = staircase(machine.T_s)[:-1]
        n = round(given.seconds / machine.T_s)
        run = cosimulate(predictor, plant, np.tile(once, -(-n // len(once)))[:n])
        np.savez(folder / "log.npz", t=machine.T_s * np.arange(n), x_d=run.x_d, x_meas=run.x_meas)
        kept, log = Kept(), open_log(folder / "log.npz")
        with Page(machine.title, shown_of("", machine.unit)) as page:
            looked = max(given.seconds - 25.0, 5.0)  # beside the start of the browser and the pictures
            watching = [sys.executable, "-m", "benchmarks.live", "--watch", page.address, "--seconds", str(looked)]
            watching += ["--out", str(given.out), "--chromium", given.chromium]
            with subprocess.Popen(watching, stdout=subprocess.PIPE, text=True) as watcher:
                no_token = refused(page.address)
                done = run_live(RecordedSource(log), FmuController(predictor, {}, 0.0), [kept, page])
                seen = json.loads(watcher.communicate(timeout=120.0)[0])
            missed = page.n_dropped
            root = page.address.partition("?")[0]
    same, distance = agreement(kept.columns(), run)
    elsewhere = [one for one in seen["asked"] if not one.startswith((root, root.replace("http", "ws")))]
    status = done.status
    print(f"{n} samples at 1 kHz: {done.n_rows} rows, {missed} not shown; {status['n_late']} late")
    print(f"bit for bit equal to cosim: {same}; to backtest from the second window on: {distance:.2g} m")
    print("step: " + ", ".join(f"{name} {1e6 * status[f'step_{name}']:.3g} µs" for name in ("p50", "p99", "max")))
    print(f"page: {seen['frames_per_s'][0]:.1f} frames/s at least over 10 s, {seen['frames_per_s'][1]:.1f} in the mean")
    print(f"console {seen['console']}; asked of others {elsewhere}; refused without token: {no_token}")
    print(f"keys: {seen['phases']}, zoomed to {seen['zoomed']:g} s; wider than its window by {seen['wide']} px")
    print(f"pictures in {given.out.resolve()}")
    good = done.n_rows == n and not missed and same and distance < 1e-11 and seen["frames_per_s"][0] >= 10.0
    good = good and seen["phases"] in (["paused", "live"], ["paused", "ended"]) and abs(seen["zoomed"] - 1.25) < 1e-6
    if not (good and not seen["console"] and not elsewhere and no_token and seen["wide"] <= 0):
        sys.exit("not as it should be")


if __name__ == "__main__":
    main()
