"""Logs whose times are clock timestamps: the same log as with seconds, midnight, and what is refused."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from log_files import refused, write_csv
from properties import examples

from hybridsep.base.errors import LogError
from hybridsep.logs.formats import open_source
from hybridsep.logs.log import read_log

SECOND = 1_000_000_000  # in nanoseconds, in which the truth is computed


@dataclass(frozen=True)
class Spelling:
    """One way in which a recorder writes timestamps: date, time of day and end as ``strftime`` takes them, decimals."""

    date: str
    time: str
    end: str
    digits: int
    mark: str
    delimiter: str

    def __call__(self, ns: int) -> str:
        """Return nanoseconds since 1970, a multiple of the last digit, as a timestamp."""
        whole = np.datetime64(ns // SECOND, "s").item()
        decimals = f"{ns % SECOND:09d}"[: self.digits]
        stamp = whole.strftime(self.date + self.time) + (self.mark + decimals if self.digits else "")
        return stamp + whole.strftime(self.end)

    def log(self, times: Sequence[int]) -> str:
        """Return a log of these times, ns since 1970, with the numbers in the same style."""
        return table(map(self, times), self.delimiter, self.mark)


def table(times: Iterable[str], delimiter: str = ",", mark: str = ".") -> str:
    rows = [["t", "x_d", "x"]]
    rows += [[time, f"{i % 10}{mark}25", f"-{i % 10}{mark}5"] for i, time in enumerate(times)]
    return "".join(delimiter.join(row) + "\n" for row in rows)


def in_seconds(times: Sequence[int]) -> str:
    text = table(f"{(ns - times[0]) // SECOND}.{(ns - times[0]) % SECOND:09d}" for ns in times)
    return text.replace("t", "t [s]", 1)


def spelled(dates: list[str], time: str, ends: list[str], marks: str) -> st.SearchStrategy[Spelling]:
    of, digits = st.sampled_from, st.integers(0, 9)
    return st.builds(Spelling, of(dates), st.just(time), of(ends), digits, of(marks), of(";\t"))


DATES = ["%Y-%m-%dT", "%Y-%m-%d ", "%d.%m.%Y ", "%m/%d/%Y ", "%d/%m/%Y ", "%d-%b-%Y ", "%Y%m%dT", "%d.%m.%y  "]
SPELLINGS = spelled(DATES, "%H:%M:%S", ["", "Z", "+00:00", " -0000", " UTC", " "], ".,")
SPELLINGS |= spelled(["%m/%d/%Y ", "%m/%d/%Y, ", "%Y-%m-%d "], "%I:%M:%S", [" %p", "%p"], ".")
START = st.integers(0, 2**31 * SECOND)  # 1970 to 2038


# The same log as with seconds


@given(spelling=SPELLINGS, start=START, steps=st.lists(st.integers(1, 40 * SECOND), min_size=1, max_size=30))
@examples(150)
def test_stamps_are_seconds_since_the_first(
    spelling: Spelling, start: int, steps: list[int], tmp_path_factory: pytest.TempPathFactory
) -> None:
    last = 10 ** (9 - spelling.digits)
    times = [start // last * last]
    for step in steps:
        times.append(times[-1] + -(-step // last) * last)
    folder = tmp_path_factory.mktemp("stamps")
    log = read_log(write_csv(folder / "log.csv", spelling.log(times)))
    truth = read_log(write_csv(folder / "seconds.csv", in_seconds(times)))
    np.testing.assert_array_equal(log.t, truth.t)
    np.testing.assert_array_equal(log.x_d, truth.x_d)
    np.testing.assert_array_equal(log.x_meas, truth.x_meas)
    assert log.T_s == truth.T_s


@given(start=START, n=st.integers(2, 60), step=st.integers(1, 11 * 3600 * SECOND), block=st.integers(1, 20))
@examples(50)
@pytest.mark.parametrize("date", ["", "%d.%m.%Y ", "%d/%m/%Y ", "%m/%d/%y "])
def test_midnights_in_blocks_of_any_size(
    date: str, start: int, n: int, step: int, block: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """A time of day passes midnight where it falls by more than half a day, whatever its date."""
    spelling = Spelling(date, "%H:%M:%S", "", 9, ".", ";")
    times = [start + i * step for i in range(n)]
    source = open_source(write_csv(tmp_path_factory.mktemp("midnight") / "log.csv", spelling.log(times)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hybridsep.logs.text._BLOCK", block)
        (t,) = source.read(["t"]).columns
    np.testing.assert_array_equal(t, (np.array(times) - start) / 1e9)


@pytest.mark.parametrize(
    "text",
    [
        "t,x_d,x\n2026-03-05T10:20:30.5Z,1,2\n2026-03-05T10:20:31.5Z,3,4\n",
        "t,x_d,x\n10:20:30.5,1,2\n10:20:31.500,3,4\n",
        "t,x_d,x\n10:20:30:500,1,2\n10:20:31:500,3,4\n",
        "t,x_d,x\n0 days 00:00:30,1,2\n0 days 00:00:31,3,4\n",
        't,x_d,x\n"10:20:30,5","1,0",2\n"10:20:31,5",3,4\n',
        "t,x_d,x\n'9:59:59','1',2\n'10:00:00',3,4\n",
        "# t x_d x\n2026-03-05 10:20:30.25 1 2\n2026-03-05 10:20:31.25 3 4\n",
        "Axis;A 12\nStart;2026-03-05 10:20:30\n\nt;x_d;x\n10:20:30,000;1,0;2\n10:20:31,000;3,0;4\n",
        "t;x_d;x\nhh:mm:ss;mm;um\n10:20:30;1000;2e6\n10:20:31;3000;4e6\n",
        "Time [UTC];x_d [mm];x\n10:20:30;1000;2\n10:20:31;3000;4\n",
        "t,note,x_d,x\n10:20:30,on,1,2\n10:20:31,off,3,4\n",
        "t,x_d,x\n11:59:59 a.m.,1,2\n12:00:00 p.m.,3,4\n",
        "t,x_d,x\n3:59:59\xa0AM,1,2\n4:00:00\xa0AM,3,4\n",
        # Dates in a column of their own, on either side
        "Date;Time;x_d;x\n05.03.2026;23:59:59,5;1;2\n06.03.2026;00:00:00,5;3;4\n",
        "Time,Date,x_d,x\n23:59:59.5,3/9/26,1,2\n00:00:00.5,3/10/26,3,4\n",
        "Date Time x_d x\n2026-03-05 10:20:30 1 2\n2026-03-05 10:20:31 3 4\n",
        "t,x_d,x\n00:59:59+01:00,1,2\n01:00:00+01,3,4\n",
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-16"])
def test_layouts(tmp_path: Path, text: str, encoding: str) -> None:
    log = read_log(write_csv(tmp_path / "log", text, encoding))
    np.testing.assert_allclose([log.t, log.x_d, log.x_meas], [[0, 1], [1, 3], [2, 4]], rtol=1e-15)
    assert (log.T_s, log.unit, log.remarks) == (1.0, "m", ())


def test_a_blank_that_is_no_latin_1(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "log.csv", "t,x_d,x\n3:59:59\u202fPM,1,2\n4:00:00\u202fPM,3,4\n")
    assert read_log(path).t.tolist() == [0.0, 1.0]


def test_seconds_that_count_up_are_no_index(tmp_path: Path) -> None:
    rows = [f"2026-03-05 10:20:{30 + i}" for i in range(20)]
    log = read_log(write_csv(tmp_path / "log.csv", table(rows)))
    assert (log.T_s, log.t[-1]) == (1.0, 19.0)


# Which column


def test_the_only_column_of_timestamps_is_the_time(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "log.csv", "recorded,x_d,x\n10:20:30,1,2\n10:20:31,3,4\n")
    assert read_log(path).t.tolist() == [0.0, 1.0]
    assert read_log(path).remarks == ("column 'recorded' is read as the time; columns (--t) names another",)
    assert read_log(path, columns={"t": "recorded"}).remarks == ()
    refused("T_s = 0.5 s was given, but column 'recorded' has an interval of 1 s", path, T_s=0.5)
    both = "begun,ended,x_d,x\n10:20:30,10:20:31,1,2\n10:20:31,10:20:32,3,4\n"
    refused(r"column 't' is missing, the file has 'begun', 'ended', 'x_d', 'x'; name it", write_csv(path, both))
    assert read_log(path, columns={"t": "ended"}).t.tolist() == [0.0, 1.0]


def test_numbers_are_read_where_there_are_both(tmp_path: Path) -> None:
    text = "recorded,t,x_d,x\n10:20:30,0.5,1,2\n10:20:30,0.75,3,4\n"
    assert read_log(write_csv(tmp_path / "log.csv", text)).t.tolist() == [0.5, 0.75]


# What is refused


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        ("", r" \(up to 9 decimals\), got nothing$"),
        ("0.5", r"got '0\.5'$"),
        ("nan", "got 'nan'$"),
        ("2026-03-05 24:20:00", r"got '2026-03-05 24:20:00'"),
        ("2026-03-05 10:60:00", "got '2026-03-05 10:60:00'"),
        ("2026-03-05 10:20:00.0123456789", "got '.*0123456789'$"),
        ("2026-03-05 10:20:00 CET", "got '2026-03-05 10:20:00 CET'"),
    ],
)
@pytest.mark.parametrize("at", [1, 7])
def test_what_is_no_timestamp_is_refused_with_its_line(tmp_path: Path, cell: str, message: str, at: int) -> None:
    rows = [f"2026-03-05 10:20:{i:02d}.5" for i in range(10)]
    rows[at] = cell
    path = write_csv(tmp_path / "log.csv", table(rows))
    refused(rf"log\.csv, line {at + 2}: column 't' must be a time of day.*{message}", path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("2026-03-05 10:20:30,001,1,2\n", "line 2: column 't' must be a number.*; write times of day as"),
        ("2026-03-05,1,2\n2026-03-06,3,4\n", "line 2: column 't' must be a number, got '2026-03-05'"),
        ("0,1,2\n10:20:30,1,2\n", "line 3: column 't' must be a number, got '10:20:30'; write times of day"),
        ("20:30.5,1,2\n20:31.5,1,2\n", r"line 2: column 't' must be a number, got '20:30\.5'; write times of day"),
        ("0,10:20:30,2\n1,10:20:31,2\n", "column 'x_d' must be a position, it holds timestamps; name another"),
        ("10:20:31,1,2\n10:20:30,3,4\n", "time 't' must increase, it never does"),
        ("-,1,2\n10:20:31,1,2\n10:20:32,3,4\n", "line 2: column 't' must be a time of day such as .* got '-'"),
    ],
)
def test_refused_times(tmp_path: Path, text: str, message: str) -> None:
    refused(message, write_csv(tmp_path / "log.csv", "t,x_d,x\n" + text))


@given(cells=st.lists(st.text("0123456789:./-, TZAPMapm+'", max_size=24), min_size=1, max_size=8))
@examples(300)
def test_any_text_is_read_or_refused(cells: list[str], tmp_path_factory: pytest.TempPathFactory) -> None:
    rows = [*(f"2026-03-05 10:20:{i:02d}" for i in range(12)), *(cell.strip() for cell in cells)]
    path = write_csv(tmp_path_factory.mktemp("any") / "log.csv", table(rows, ";"))
    try:
        log = read_log(path)
    except LogError as error:
        assert "log.csv" in str(error)  # noqa: PT017
    else:
        assert np.isfinite(log.t).all()
