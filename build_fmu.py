"""FMU build script: ``python build_fmu.py [--machine X.toml] [--flavour python] [--fmi 3] [--out dist] [FMU …]``.

A thin front of ``hybridsep build``; without arguments the FMUs of the paper's staircase go to ``dist/``.
"""

from __future__ import annotations

import sys

from hybridsep.__main__ import main

if __name__ == "__main__":
    sys.argv.insert(1, "build")
    main()
