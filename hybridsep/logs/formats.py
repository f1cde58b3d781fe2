"""Registry of log formats: which reader a file's content asks for, and how to convert what has none.

A new format is a subclass of :class:`~hybridsep.logs.source.Source` and its entry in :data:`READERS`.
Beside them lies the example log of the package, made by ``examples/example_log.py`` of the repository.
"""

import gzip
from pathlib import Path

from ..base.errors import LogError
from ..base.files import write_whole
from .arrays import MatSource, NpzSource, ParquetSource
from .halscope import HalscopeSource
from .sinumerik import CaptureSource, SinumerikSource
from .source import Source
from .text import TextSource
from .twincat import TwinCatSource

EXAMPLE = Path(__file__).with_name("example_axis.csv.gz")  # the example log, 20 s of a simulated axis at 1 kHz

READERS: tuple[type[Source], ...] = (NpzSource, ParquetSource, MatSource, CaptureSource, SinumerikSource)
READERS += (TwinCatSource, HalscopeSource, TextSource)
"""Readers by precedence; text, which has no mark of its own, is last."""

_SAVE = "save its columns t, x_d and x as CSV"
_PANDAS = "import pandas; pandas.read_{}('{{path}}').to_csv('log.csv', index=False)"
_HDF5 = """these three lines convert it:
import h5py, numpy
with h5py.File('{path}') as f:
    numpy.savez('log.npz', t=f['t'][()].ravel(), x_d=f['x_d'][()].ravel(), x=f['x'][()].ravel())"""
_JSON = _PANDAS.format("json") + " (lines=True where each line is a row)"
_PAGE = "docs/howto/recorders.md has three lines of Python that convert it"

_OTHERS: tuple[tuple[str, tuple[bytes, ...], str], ...] = (
    ("HDF5, or MATLAB 7.3", (b"\x89HDF\r\n\x1a\n", b"MATLAB 7.3 MAT-file"), _HDF5),
    ("ASAM MDF", (b"MDF     ", b"UnFinMF "), _PAGE),
    ("NI TDMS", (b"TDSm",), _PAGE),
    ("Arrow or Feather", (b"ARROW1", b"\xff\xff\xff\xff", b"FEA1"), _PANDAS.format("feather")),
    ("a NumPy .npy array", (b"\x93NUMPY",), "numpy.savez('log.npz', t=a[:, 0], x_d=a[:, 1], x=a[:, 2])"),
    ("a ROS bag", (b"#ROSBAG", b"\x89MCAP0"), "export the joint's topic as CSV, for example by PlotJuggler"),
    ("an old Excel workbook", (b"\xd0\xcf\x11\xe0",), f"{_SAVE} there"),
    ("XML, but no SINUMERIK trace", (b"<?xml", b"\xef\xbb\xbf<?xml"), f"{_SAVE}; a TIA scope exports it itself"),
    ("JSON, but no Siemens Capture", (b'{"', b"{ ", b"{\n", b"{\r", b"[{", b"[[", b"[\n"), _JSON),
    ("compressed", (b"BZh", b"\xfd7zXZ", b"\x28\xb5\x2f\xfd", b"7z\xbc\xaf"), "unpack it, or compress it by gzip"),
    ("an Excel workbook, or another zip archive", (b"PK\x03\x04",), f"{_SAVE} in Excel, or unpack it"),
)
"""Formats without a reader: what they are, how they begin, how to convert them."""


def open_source(path: Path) -> Source:
    """Open a file with the reader that its content asks for.

    LogError if there is no such file, or none of :data:`READERS` for it; the message says how to convert it.
    """
    try:
        if not path.is_file():
            raise LogError(f"{path}: there is no such file" if not path.exists() else f"{path}: is not a file")
        with path.open("rb") as file:
            head = file.read(4096)
        if not head:
            raise LogError(f"{path}: the file is empty")
        return _reader(path, head)(path)
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror or error}") from error


def _reader(path: Path, head: bytes) -> type[Source]:
    for reader in READERS[:-1]:
        if reader.recognises(head):
            return reader
    for name, marks, how in _OTHERS:
        if head.lstrip(b" \r\n\t").startswith(marks):
            raise LogError(f"{path}: is {name}, which is not read; {how.format(path=path.name)}")
    if READERS[-1].recognises(head):
        return READERS[-1]
    named = [reader for reader in READERS[:-1] if path.name.lower().endswith(reader.endings)]
    known = ", ".join(dict.fromkeys(reader.format for reader in READERS))
    if named and path.name.lower().endswith((".csv", ".txt", ".log")):  # of which no other reader says what is damaged
        raise LogError(f"{path}: is binary, though its name says text: none of the formats read ({known}); {_SAVE}")
    if named:
        return named[-1]  # its message says what is damaged
    raise LogError(f"{path}: is in no format that is read ({known}); {_SAVE}")


def write_example(path: Path) -> None:
    """Write the example log as CSV, or compressed where the name ends in ``.gz``."""
    packed = EXAMPLE.read_bytes()
    write_whole(path, packed if path.suffix == ".gz" else gzip.decompress(packed))
