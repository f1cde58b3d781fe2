"""Simulated positions of random drives in a file, so that they are simulated once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hybridsep.base.signals import Array

__all__ = ["read_positions", "write_positions"]


def write_positions(path: Path, generator: str, seed: int, positions: Sequence[Array]) -> None:
    """Write the true positions, m, of the first drives of a generator and a seed."""
    np.savez(path, generator=generator, seed=seed, lengths=[len(x) for x in positions], x=np.concatenate(positions))


def read_positions(path: Path, generator: str, seed: int, n: int) -> list[Array] | None:
    """Return the true positions of the first ``n`` drives; None if the file is missing or of others."""
    if not path.exists():
        return None
    with np.load(path) as data:
        made_by = str(data["generator"]), int(data["seed"])
        if made_by != (generator, seed) or len(data["lengths"]) < n:
            return None
        return np.split(data["x"], np.cumsum(data["lengths"])[:-1])[:n]
