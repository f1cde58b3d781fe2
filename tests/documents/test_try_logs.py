"""What the page `try` reads of a folder of logs: what ``read_log`` reads, to four digits, or nothing."""

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from places import CASES, ROOT, SUPPORT
from programs import output_of

from hybridsep.base.errors import LogError
from hybridsep.base.signals import Array
from hybridsep.logs.checks import checked
from hybridsep.logs.log import read_log

pytestmark = pytest.mark.nightly

N = 600
T = 1e-3 * np.arange(N)
X_D = 120.0 + 40.0 * (1.0 - np.cos(12.0 * T))  # mm
X = np.r_[X_D[:1].repeat(7), X_D[:-7]]

HEADS = (
    "t [s],x_d [mm],x [mm]", "t,x_d (mm),x (mm)", "time / s,x_d / mm,x / mm", "t_s,x_d_mm,x_mm",
    "zeit,x_d [Millimeter],x [mm]", "t_s,x_d mm,x mm",
    "t [s];x_d [mm];x [mm]", "t [s]\tx_d [mm]\tx [mm]", '"t [s]","x_d [mm]","x [mm]"', "t [s],xref [mm],x_meas [mm]",
    "# a log\nt [s],x_d [mm],x [mm]", "t,x_d,x\ns,mm,mm", "\ufefft [s],x_d [mm],x [mm]", "t [s],x_d in mm,x in mm",
)  # fmt: skip
"""Spellings of the same columns."""


def rows(columns: list[Any], form: str = ".6f", mark: str = ",", change: Any = str) -> str:
    return "".join(mark.join(change(format(one, form)) for one in row) + "\n" for row in zip(*columns, strict=True))


def logs() -> Iterator[tuple[str, str]]:
    """Yield names and texts."""
    for i, head in enumerate(HEADS):
        mark = next(one for one in ";\t," if one in head.splitlines()[-1])
        yield f"same_{i}", head + "\n" + rows([T, X_D, X], mark=mark)
    comma: dict[str, Any] = {"mark": ";", "change": lambda text: text.replace(".", ",")}
    yield "decimal_comma", "t [s];x_d [mm];x [mm]\n" + rows([T, X_D, X], **comma)
    yield "mixed_units", "t [s],x_d [mm],x [um]\n" + rows([T, X_D, 1e3 * X])
    yield "milliseconds", "time [msec],x_d [mm],x [mm]\n" + rows([1e3 * T, X_D, X])
    yield "index", "t,x_d [mm],x [mm]\n" + rows([1e3 * T, X_D, X])
    yield "epoch_ms", "t,x_d [mm],x [mm]\n" + rows([1.7e12 + 1e3 * T, X_D, X])
    yield "ten_ms", "t [s],x_d [mm],x [mm]\n" + rows([np.floor(100.0 * T) / 100.0, X_D, X])
    yield "inches", "t [s],x_d [in],x [in]\n" + rows([T, X_D / 25.4, X / 25.4])
    yield "turns", "t [s],x_d [rev],x [turns]\n" + rows([T, X_D, X])
    for unit, turn in (("deg", 360.0), ("rad", 2.0 * np.pi), ("rev", 1.0)):
        positions = [turn * (one / 45.0 % 1.0) for one in (X_D, X)]
        yield f"modulo_{unit}", f"t [s],x_d [{unit}],x [{unit}]\n" + rows([T, *positions], ".9f")
    yield "length_and_angle", "t [s],x_d [mm],x [deg]\n" + rows([T, X_D, X])
    yield "not_moving", "t [s],x_d [mm],x [mm]\n" + rows([T, X_D, 0.0 * X])
    yield "one_column", "t [s],x_d [mm],x [mm]\n" + rows([T, X_D, X_D])
    yield "scale", "t [s],x_d [mm],x [mm]\n" + rows([T, X_D, 1e3 * X])
    yield "a_gap", "t [s],x_d [mm],x [mm]\n" + rows([np.where(T > 0.3, T + 0.1, T), X_D, X])
    yield "missing", ("t [s],x_d [mm],x [mm]\n" + rows([T, X_D, X])).replace(format(X[300], ".6f"), "nan")
    thousands = [1e3 * T, np.round(1e3 * X_D), np.round(1e3 * X)]
    for mark in ";\t":
        texts = "".join(f"{t / 1e3:.3f}{mark}{a:,.0f}{mark}{b:,.0f}\n" for t, a, b in zip(*thousands, strict=True))
        yield f"thousands_{ord(mark)}", f"t [s]{mark}x_d [um]{mark}x [um]\n{texts}"
    whole = "".join(f"{k};{a:,.0f};{b:,.0f}\n" for k, (_, a, b) in enumerate(zip(*thousands, strict=True)))
    yield "thousands_whole", f"t [ms];x_d [um];x [um]\n{whole}"
    yield "points_whole", f"t [ms];x_d [um];x [um]\n{whole.replace(',', '.')}"
    quoted = "".join(f'{t / 1e3:.3f},"{a:,.0f}","{b:,.0f}"\n' for t, a, b in zip(*thousands, strict=True))
    yield "thousands_quoted", f"t [s],x_d [um],x [um]\n{quoted}"
    yield "points_and_commas", "t [s];x_d [mm];x [mm]\n0.000;1,5;1,5\n" + rows([T[1:], X_D[1:], X[1:]], mark=";")
    yield "no_names", rows([T, X_D, X])
    yield "furlongs", "t [s],x_d [furlong],x [furlong]\n" + rows([T, X_D, X])
    yield "fortnights", "t [fortnight],x_d [mm],x [mm]\n" + rows([T, X_D, X])


READ = {
    *(f"same_{i}" for i in range(len(HEADS))), "decimal_comma", "mixed_units", "milliseconds", "inches", "turns",
    "modulo_deg", "modulo_rad", "modulo_rev", "thousands_59", "thousands_9", "thousands_quoted", "thousands_whole",
}  # fmt: skip
"""Logs of which a refusal would be wrong; the library refuses the others too, or they have gaps, as the page says."""


def of_the_library(path: Path) -> tuple[Array, Array, float] | str:
    try:
        log = read_log(path)
        checked(log)
    except LogError as error:
        return str(error)
    return log.x_d, log.x_meas, log.T_s


def test_the_page_reads_what_the_library_reads_or_refuses(tmp_path: Path) -> None:
    node = shutil.which("node")
    assert node, "node is needed"
    files = [tmp_path / f"{name}.csv" for name, _ in logs()]
    for file, (_, text) in zip(files, logs(), strict=True):
        file.write_text(text, encoding="utf-8")
    for folder in (CASES, CASES.parent / "turn6" / "logs"):
        files += sorted(path for path in folder.glob("*.csv*") if "frf" not in path.name)
    lines = output_of(node, SUPPORT / "run_try.js", ROOT / "docs" / "try" / "try.js", *files).splitlines()
    for file, line in zip(files, lines, strict=True):
        page, library = json.loads(line), of_the_library(file)
        if "refused" in page:
            assert file.stem not in READ, (file.name, page["refused"], library)
            said = page["refused"].partition(":")[0]
            in_words = ("rounded too coarsely", "counts samples", "no motion", "same column", "scale")
            for words in (one for one in in_words if one in said):
                assert words in str(library), (file.name, library)
        elif isinstance(library, str):
            assert "columns swapped" in library, (file.name, library)  # which needs more than a page
        else:
            x_d, x, T_s = library
            assert page["n"] == len(x_d), file.name
            assert page["T_s"] == pytest.approx(T_s, rel=1e-4), file.name
            for ours, theirs in ((page["x_d"], x_d), (page["x"], x)):
                np.testing.assert_allclose(ours, theirs[: len(ours)], rtol=1e-4, atol=1e-9, err_msg=file.name)
