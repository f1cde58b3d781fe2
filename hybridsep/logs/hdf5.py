"""HDF5 files, MATLAB's version 7.3 among them, read by h5py."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from .arrays import ArraysSource

__all__ = ["Hdf5Source"]

_SIGNATURE = b"\x89HDF\r\n\x1a\n"


class Hdf5Source(ArraysSource):
    """The vectors of an HDF5 file; in groups or structs they are called ``group.name``."""

    format = "MATLAB v7.3 (HDF5)"
    endings = (".mat", ".h5", ".hdf5")
    library = "h5py"

    @staticmethod
    def items(file: str) -> Iterator[tuple[str, Any]]:
        """Yield data sets, groups by dots; MATLAB's own bookkeeping aside."""
        import h5py
        import numpy as np

        found: list[tuple[str, Any]] = []

        def visit(name: str, item: Any) -> None:
            if isinstance(item, h5py.Dataset) and not name.startswith("#"):
                # MATLAB stores the shape of what is empty, and text as numbers.
                empty, text = item.attrs.get("MATLAB_empty", 0), item.attrs.get("MATLAB_class") in (b"char", "char")
                value = np.empty((0, 0)) if empty else "" if text else item[()]
                found.append((name.replace("/", "."), value))

        with h5py.File(file, "r") as content:
            content.visititems(visit)
        yield from found

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it begins with HDF5's signature, or with MATLAB 7.3's before it."""
        return head.startswith((_SIGNATURE, b"MATLAB 7.3 MAT-file"))

    def without_library(self) -> str:
        """Return what to do where h5py is not installed."""
        stem = self.path.stem
        return (
            f"is a {self.format} file, which needs the extra hdf5: pip install 'hybridsep[hdf5]'; or save it with "
            f"'-v7' in MATLAB: load('{self.path.name}'); save('{stem}_v7.mat', '-v7')"
        )
