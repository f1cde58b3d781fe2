"""Velocity of a drive whose friction acts on that velocity without delay.

Friction offsets the command by ``f·tanh(v/v_s)``, and modes with ``β ≠ 0`` answer a command with a velocity at once:
``v = w − b f tanh(v/v_s)`` with ``w``, the velocity without friction, and ``b = Σβ``. For ``b f < −v_s`` there are two
stable solutions; the drive stays on the solution of its present direction until it ends: hysteresis.
"""

from __future__ import annotations

import math

__all__ = ["velocity_under_friction"]

_STEPS_MAX = 60
"""Largest number of Newton steps: 4 to 8 usually, one for each bit where the solution is about to end."""


def velocity_under_friction(w: float, gain: float, scale: float, last: float) -> float:
    """Return the solution of ``v = w − gain·tanh(v/scale)``, m/s.

    Parameters
    ----------
    w : float, m/s
        Velocity without friction.
    gain : float, m/s
        Velocity that the whole friction takes away at once.
    scale : float, m/s
        Velocity scale of the friction's change of sign, > 0.
    last : float, m/s
        Velocity before, whose direction is kept where there are two solutions.
    """
    if w == 0.0 and last == 0.0:
        return 0.0
    sign = math.copysign(1.0, w)
    if gain < -scale:
        # v + gain·tanh(v/scale) falls between ± turn: a solution of the other sign than w may be there
        ratio = -gain / scale
        turn = scale * math.log(math.sqrt(ratio) + math.sqrt(ratio - 1.0))  # acosh √ratio
        if last * w < 0.0 and abs(w) <= -turn - gain * math.tanh(turn / scale):
            sign = -sign
    w *= sign
    # Newton from the side where its steps are monotone: v + gain·tanh(v/scale) is concave or convex for v > 0.
    v = max(w - gain, w / (1.0 + gain / scale)) if gain > 0.0 else w - gain
    for _ in range(_STEPS_MAX):
        t = math.tanh(v / scale)
        slope = 1.0 + gain / scale * (1.0 - t * t)
        if not slope > 0.0:
            break
        step = (v + gain * t - w) / slope
        v -= step
        if abs(step) <= 1e-15 * abs(v):
            break
    return sign * v
