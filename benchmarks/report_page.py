"""Report of ``hybridsep fit`` in headless Chromium: drawn, zoomed, without errors on the console and without network.

    python benchmarks/report_page.py REPORT.html [--chromium PATH] [--out FOLDER]

Screenshots at the widths of a desk and of a phone are written to the folder. What the page asks of the network is what
the browser's own record of its resources says. Chromium is Debian's package, or any other.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

WIDTHS = {"desk": 1100, "phone": 500}
"""Widths, px; Chromium's windows are no narrower than 500."""

PROBE = """
<script>
window.addEventListener("load", async () => {
  const charts = [...document.querySelectorAll(".js-plotly-plot")];
  const found = {charts: charts.length, drawn: 0, zoomed: 0, wide: document.documentElement.scrollWidth - innerWidth};
  for (const chart of charts) {
    found.drawn += chart.querySelectorAll(".trace").length > 0;
    const [low, high] = chart.layout.xaxis.range;
    await Plotly.relayout(chart, {"xaxis.range": [low, (low + high) / 2]});
    found.zoomed += Math.abs(chart._fullLayout.xaxis.range[1] - (low + high) / 2) < 1e-9 * Math.abs(high - low);
    await Plotly.relayout(chart, {"xaxis.range": [low, high]});
  }
  const asked = performance.getEntriesByType("resource").map((entry) => entry.name);
  found.network = asked.filter((name) => !/^(data|blob|file):/.test(name)).length;
  document.body.dataset.found = JSON.stringify(found);
});
</script>
"""


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("report", type=Path)
    parser.add_argument("--chromium", default=shutil.which("chromium") or "chromium")
    parser.add_argument("--out", type=Path, default=Path())
    given = parser.parse_args(arguments)
    problems = []
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "report.html"
        page.write_text(
            given.report.read_text(encoding="utf-8").replace("</body>", PROBE + "</body>"), encoding="utf-8"
        )
        for name, width in WIDTHS.items():
            picture = given.out / f"report_{name}.png"
            size = f"--window-size={width},4000"
            dom, messages = chromium(given.chromium, folder, [size, "--dump-dom"], page)
            chromium(given.chromium, folder, [size, f"--screenshot={picture.resolve()}"], page)
            found = json.loads(re.search(r"data-found='?\"?(\{.*?\})", dom.replace("&quot;", '"'))[1])  # type: ignore[index]
            console = [line for line in messages.splitlines() if "CONSOLE" in line]
            print(f"{name}: {found}; console {console}; {picture}")
            whole = found["charts"] > 0 and found["drawn"] == found["zoomed"] == found["charts"]
            problems += [name] if console or found["network"] or found["wide"] > 0 or not whole else []
    if problems:
        sys.exit(f"not as it should be at the width of a {' and a '.join(problems)}")


def chromium(program: str, folder: str, options: Sequence[str], page: Path) -> tuple[str, str]:
    """Run Chromium on a page; return its standard output and standard error."""
    common = ["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--hide-scrollbars"]
    common += ["--disable-background-networking", "--disable-component-update", "--disable-sync"]
    common += ["--virtual-time-budget=20000", "--enable-logging=stderr", f"--user-data-dir={folder}/profile"]
    done = subprocess.run([program, *common, *options, page.as_uri()], capture_output=True, text=True, check=True)
    return done.stdout, done.stderr


if __name__ == "__main__":
    main()
