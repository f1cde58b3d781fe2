"""Child process that reads a file of arrays for :mod:`hybridsep.logs.arrays`, to contain crashes of the C libraries.

Run as ``python -I _arrays_child.py KIND PATHS FILE FOLDER``: KIND is ``mat`` (SciPy) or ``hdf5`` (h5py), PATHS the
parent's ``sys.path`` as JSON. Arrays of numbers go to ``FOLDER/<i>.npy``, and a JSON object to standard output:
``missing``, true where h5py is not installed; or ``damage``, the library's message; or ``variables``, name → type and,
where it is an array, dtype, shape and, where it is saved, the number ``i``. Fields of structs are ``struct.field``, the
parts of a complex array ``array.real`` and ``array.imag``.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any


def mat(file: str) -> Iterator[tuple[str, Any]]:
    """Yield the variables of a MATLAB file up to version 7 and the fields of its structs."""
    from scipy import io

    for name, value in io.loadmat(file).items():
        if not name.startswith("__"):
            yield from fields(name, value)


def fields(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield a variable, or what is in it if it is a scalar struct."""
    names = getattr(getattr(value, "dtype", None), "names", None)
    if names and value.size == 1:
        for field in names:
            yield from fields(f"{name}.{field}", value[field].reshape(-1)[0])
    else:
        yield name, value
        if getattr(getattr(value, "dtype", None), "kind", "") == "c":
            yield f"{name}.real", value.real
            yield f"{name}.imag", value.imag


def hdf5(file: str) -> Iterator[tuple[str, Any]]:
    """Yield the data sets of an HDF5 file, groups by dots; MATLAB's own bookkeeping aside."""
    import h5py
    import numpy as np

    with h5py.File(file, "r") as content:
        found: list[tuple[str, Any]] = []

        def visit(name: str, item: Any) -> None:
            if isinstance(item, h5py.Dataset) and not name.startswith("#"):
                # MATLAB stores the shape of what is empty, and text as numbers.
                empty, text = item.attrs.get("MATLAB_empty", 0), item.attrs.get("MATLAB_class") in (b"char", "char")
                found.append((name, np.empty((0, 0)) if empty else "" if text else item[()]))

        content.visititems(visit)
        for name, value in found:
            yield name.replace("/", "."), value


def main(kind: str, paths: str, file: str, folder: str) -> dict[str, Any]:
    """Read the file; return the object for the parent."""
    sys.path[:] = json.loads(paths)
    import numpy as np

    variables: dict[str, dict[str, Any]] = {}
    try:
        for i, (name, value) in enumerate({"mat": mat, "hdf5": hdf5}[kind](file)):
            variables[name] = {"type": type(value).__name__}
            if isinstance(value, np.ndarray) and value.dtype.names is not None:
                variables[name] = {"type": "structs"}
            elif isinstance(value, np.ndarray):
                variables[name] |= {"dtype": str(value.dtype), "shape": value.shape}
                if value.dtype.kind in "fiu":
                    np.save(Path(folder) / f"{i}.npy", value)
                    variables[name]["i"] = i
    except ModuleNotFoundError as error:
        return {"missing": error.name}
    except MemoryError:
        raise
    except Exception as error:  # a damaged file makes both libraries fail in nearly every way there is
        name = type(error).__name__
        if name == "error":  # zlib's, struct's
            name = f"{type(error).__module__}.{name}"
        return {"damage": f"{name}: {error}"}
    return {"variables": variables}


if __name__ == "__main__":
    print(json.dumps(main(*sys.argv[1:])))
