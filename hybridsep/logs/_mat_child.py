"""Child process that reads a ``.mat`` file for :mod:`hybridsep.logs.mat`, to contain crashes of SciPy's reader.

Run as ``python -I _mat_child.py PATHS FILE FOLDER``: PATHS is the parent's ``sys.path`` as JSON. Arrays of numbers go
to ``FOLDER/<i>.npy``, and a JSON object to standard output: ``hdf5``, true for a file of version 7.3; or ``damage``,
SciPy's message; or ``variables``, name → type and, where it is an array, dtype, shape and, where it is saved, the
number ``i``.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any


def main(paths: str, file: str, folder: str) -> dict[str, Any]:
    """Read the file; return the object for the parent."""
    sys.path[:] = json.loads(paths)
    import numpy as np
    from scipy import io

    try:
        content = io.loadmat(file)
    except NotImplementedError:
        return {"hdf5": True}
    except Exception as error:  # a damaged file makes SciPy's reader fail in nearly every way there is
        return {"damage": f"{type(error).__name__}: {error}"}
    variables: dict[str, dict[str, Any]] = {}
    for i, (name, value) in enumerate(content.items()):
        if name.startswith("__"):
            continue
        variables[name] = {"type": type(value).__name__}
        if isinstance(value, np.ndarray):
            variables[name] |= {"dtype": str(value.dtype), "shape": value.shape}
            if value.dtype.kind in "fiu":
                np.save(Path(folder) / f"{i}.npy", value)
                variables[name]["i"] = i
    return {"variables": variables}


if __name__ == "__main__":
    print(json.dumps(main(*sys.argv[1:])))
