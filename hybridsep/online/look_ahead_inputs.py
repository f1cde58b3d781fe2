"""Sampling of a look-ahead's inputs in communication steps of any size.

Inputs are latched at each instant ``t_k`` within a step and executed in the step that reaches ``t_{k+1}``, so that
outputs change at sampling instants only and stay causal. ``hsep_inputs.c`` is the same for the native FMUs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ..base.clock import SampleClock
from ..base.errors import SignalError
from .look_ahead import LookAhead


class LookAheadInputs:
    """Sample clock of a look-ahead, and the latched inputs of its current sample.

    Parameters
    ----------
    t_start, T_s : float
        Start time and sampling interval, s.
    start : float
        Position where the drive rests, m.

    Raises
    ------
    FmuError
        If samples cannot be counted from ``t_start``.
    """

    def __init__(self, t_start: float, T_s: float, start: float) -> None:
        self.clock = SampleClock.begin(t_start, T_s)
        self._latched = (start, start)

    def advance(
        self,
        look_ahead: LookAhead,
        x_d_ahead: float,
        x_meas: float,
        t: float,
        h: float,
        begin: Callable[[], None] | None = None,
    ) -> dict[str, str]:
        """Execute the samples that the communication step from ``t`` by ``h``, s, reaches.

        Parameters
        ----------
        look_ahead : LookAhead
        x_d_ahead, x_meas : float
            Inputs, m, constant over the step.
        t, h : float
            The step's start and size, s.
        begin : function, optional
            Called when the step is known to be valid, before its first sample; may refuse it.

        Returns
        -------
        warnings : dict of str
            ``late`` where a sampling instant is no communication point, ``moved`` where it was taken at one beside it.

        Raises
        ------
        ParameterError, FmuError, SignalError
            If the step is invalid, or an input that it latches; nothing is changed then.
        """
        if look_ahead.diverged:
            raise SignalError(look_ahead.diverged)
        step = self.clock.stepped(t, h)
        if step.n_latched:
            look_ahead.check(x_d_ahead, x_meas, self.clock.k + self.clock.latched)
        if begin is not None:
            begin()
        pending = self.clock.latched
        for _ in range(step.n_samples):
            if pending:  # the sample that an earlier step latched
                pending = False
            else:
                self._latched = (x_d_ahead, x_meas)
            look_ahead.sample(*self._latched)
        if step.after.latched and not pending:
            self._latched = (x_d_ahead, x_meas)
        inside = step.n_latched > 1 - self.clock.latched  # t_k, where it is not read yet, is the step's start
        self.clock = step.after
        warnings = {"moved": step.warning} if step.warning else {}
        if inside:
            late = min(step.first + (step.n_latched - 1) * self.clock.T_s, h)
            warnings["late"] = (
                f"the step from {t:.9g} s by {h:.9g} s contains sampling instants of T_s = {self.clock.T_s:g} s "
                f"between its ends: x_meas is read up to {late:g} s late, so a closed loop needs steps of T_s"
            )
        return warnings

    def state(self) -> list[float]:
        """Return the fields of the clock, then the inputs."""
        return [*self.clock.state(), *self._latched]

    @classmethod
    def from_state(cls, state: Sequence[float]) -> LookAheadInputs:
        """Return the inputs of a :meth:`state`."""
        *clock, x_d_ahead, x_meas = state
        inputs = cls.__new__(cls)
        inputs.clock, inputs._latched = SampleClock.from_state(clock), (x_d_ahead, x_meas)
        return inputs
