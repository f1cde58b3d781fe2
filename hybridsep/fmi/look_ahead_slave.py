"""What the slaves over a look-ahead share: one sample after the other, with inputs that count at its beginning."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

from .._saved import Saved
from .clock import SampleClock
from .slave import TableSlave

__all__ = ["LookAheadSlave"]


class LookAheadSlave(TableSlave):
    """A slave whose core is a look-ahead: it has ``check``, ``sample`` and ``to_bytes``.

    Attributes
    ----------
    look_ahead_type : type
        Has ``from_bytes``.
    """

    look_ahead_type: ClassVar[Any]

    @abstractmethod
    def new_look_ahead(self) -> Any:
        """Make the look-ahead from the parameters as they are now, with what the resources say was learned."""

    def initialise(self) -> None:
        """Make the look-ahead and start the clock."""
        self.look_ahead = self.new_look_ahead()
        self.clock = SampleClock(self.start_time, self.values["T_s"])

    def advance(self, t: float, h: float) -> None:
        """Read the inputs at the first sub-step of a sample, show the outputs after its last one."""
        parts = self.clock.check(t, h)
        if self.clock.done == 0:
            self.inputs = (self.values["x_d_ahead"], self.values["x_meas"])
            self.look_ahead.check(*self.inputs)
        if self.clock.done == parts - 1:
            self.look_ahead.sample(*self.inputs)
        self.clock.advance(parts)

    def core_state(self) -> tuple[dict[str, Any], bytes]:
        """Return the clock with the inputs of the sample in progress, and the look-ahead."""
        return {"clock": self.clock.state(), "inputs": getattr(self, "inputs", None)}, self.look_ahead.to_bytes()

    def restore_core(self, meta: Mapping[str, Any], blob: bytes) -> None:
        """Take over a clock and a look-ahead."""
        state = Saved("look-ahead", meta, {}, {})
        saved = Saved("clock", state.table("clock"), {}, {})
        k, done, parts = (saved.whole(name) for name in ("k", "done", "parts"))
        clock = SampleClock(saved.real("start"), saved.real("T_s"), k, done, parts)
        inputs: Any = None  # as long as no sample has begun
        if state.field("inputs") is not None:
            inputs = tuple(state.numbers("inputs", 2))
        look_ahead = self.look_ahead_type.from_bytes(blob)
        if not (clock.T_s == self.values["T_s"] and k == look_ahead.k and done < parts):
            raise saved.error("it must count the samples of this look-ahead")
        self.look_ahead, self.clock, self.inputs = look_ahead, clock, inputs
