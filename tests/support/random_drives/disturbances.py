"""Random nonlinearities of a drive: friction, backlash, cubic stiffness, cogging, drift."""

from dataclasses import dataclass

from random_drives.drive import Draws

PRESLIDING_SLOPE = 2.0
"""Largest stiffness of the presliding friction relative to the drive's: rolling guides are below 1."""

CUBIC_SHARE = 0.05  # largest effect of the cubic stiffness relative to the stroke
COGGING_SLOPE = 0.05  # largest amplitude of the cogging relative to its pitch: a stiffness of 0.3 of the drive's


@dataclass(frozen=True)
class Disturbances:
    """Nonlinearities as equivalent offsets of the command, m; zero where there is none."""

    # whether they offset the command, and so pass through its zeros, or act as a force on the modes
    at_command: bool = False
    coulomb: float = 0.0  # m: sliding friction
    static: float = 1.0  # friction at low velocity (Stribeck), relative to the sliding friction
    v_stribeck: float = 1e-3  # m/s
    presliding: float = 1e-5  # m: distance over which friction builds up (Dahl)
    bristle: float = 0.0  # deflection at the start, relative to its limit
    # m: offset at ``range`` from ``centre``; positions relative to the start
    cubic: float = 0.0
    range: float = 1e-3
    centre: float = 0.0
    # m: amplitude and period
    cogging: float = 0.0
    pitch: float = 1e-2
    phase: float = 0.0  # of the cogging at the start, periods
    drift: float = 0.0  # m: final drift of the position
    time_constant: float = 1.0  # s: of the drift
    # m: backlash after the drive and before it
    play: float = 0.0
    command_play: float = 0.0
    play_start: float = 0.0  # place within the backlash at the start, −1 to 1


def random_disturbances(draws: Draws, stroke: float, in_antiphase: bool) -> Disturbances:
    """Return a random mixture; one in ten drives is linear.

    ``stroke``, m: of the trajectory; ``in_antiphase``: whether modes are in antiphase. A stiffness that offsets the
    command would make such a drive oscillate by itself, so it acts as a force there.
    """
    if draws.chance(0.1):
        return Disturbances()
    level = draws.log_uniform(1e-7, 4e-4)
    values: dict[str, float] = {}

    def size() -> float:
        return level * draws.log_uniform(0.3, 1.0)

    if draws.chance(0.7):
        coulomb = size()
        values |= {
            "coulomb": coulomb,
            "static": draws.uniform(1.0, 1.6),
            "v_stribeck": draws.log_uniform(5e-4, 2e-2),
            "presliding": max(draws.log_uniform(1e-6, 5e-5), coulomb / PRESLIDING_SLOPE),
            "bristle": draws.uniform(-1.0, 1.0) if draws.chance(0.5) else 0.0,
        }
    if draws.chance(0.3):
        after = draws.chance(0.5)
        values |= {"play" if after else "command_play": min(size(), 1e-4), "play_start": draws.uniform(-1.0, 1.0)}
    if draws.chance(0.3):
        values |= {
            "cubic": draws.sign() * min(size(), CUBIC_SHARE * stroke),
            "range": stroke,
            "centre": draws.uniform(-1.0, 1.0) * stroke,
        }
    if draws.chance(0.35):
        pitch = draws.log_uniform(1e-3, 3e-2)
        values |= {"cogging": min(size(), COGGING_SLOPE * pitch), "pitch": pitch, "phase": draws.uniform(0.0, 1.0)}
    if draws.chance(0.3):
        values |= {"drift": draws.sign() * min(size(), 1e-4), "time_constant": draws.log_uniform(2.0, 100.0)}
    at_command = draws.chance(0.5) and not in_antiphase
    return Disturbances(at_command=at_command, **values)
