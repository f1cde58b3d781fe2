"""Generators of random drives, by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from benchmarks.random_drives import generator as modal
from benchmarks.random_drives.drive import Drive
from benchmarks.two_mass import generator as two_mass
from hybridsep.base.signals import Array

__all__ = ["GENERATORS", "Generator"]


@dataclass(frozen=True)
class Generator:
    """A generator of random drives.

    Attributes
    ----------
    seed, n, chunk : int
        Seed and number of the drives that figures are given for; drives of one task.
    true_positions : callable
        Returns the true positions, m, of drives, from their indices and ``seed=``.
    drives_at : callable
        Returns drives from their indices, true positions and seed.
    """

    seed: int
    n: int
    chunk: int
    true_positions: Callable[..., list[Array]]
    drives_at: Callable[[Sequence[int], Sequence[Array], int], Sequence[Drive]]


GENERATORS = {
    "modal": Generator(modal.SEED, 1000, modal.CHUNK, modal.true_positions, modal.drives_at),
    "two_mass": Generator(two_mass.SEED, 250, two_mass.CHUNK, two_mass.true_positions, two_mass.drives_at),
}
