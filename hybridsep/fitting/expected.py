"""Tracking error to be expected of a compensator on recorded commands: an estimate before anything is compensated.

The drive is taken for ``x = G_pb x_dm + r``: the identified model, and the residual ``r`` as it was recorded. The
compensator plans and learns on it in closed loop. In truth ``r`` would change with the command, as friction does where
a modified command turns elsewhere; this is neglected.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from ..base.errors import FmuError
from ..base.settings import CompensatorSettings, PredictorSettings
from ..base.signals import Array
from ..base.threads import one_blas_thread
from ..compensate.compensator import SepCompensator
from ..cosim.loop import FmuController, LibraryController
from ..fmi.archive import build_here
from ..fmi.compile import host_target, kept
from ..machines.machine import Machine
from ..predict.predictor import HybridPredictor

_BINDS, _SAID = 0.99, 0.001
"""Share of a limit from which on a sample of a command counts as bound by it, and share of the samples from which on a
limit counts: fewer cost nothing that could be seen."""


def limits_that_bind(x_d: Array, x_dm: Array, T_s: float, settings: CompensatorSettings) -> dict[str, float]:
    """Return which limits bind a modified command ``(n,)``, m: the share of the samples, 0 … 1, by the limit's name.

    Names are as in FMUs, such as ``change_max``; limits that bind in fewer than 0.1 % are left out.
    """
    limits = () if settings.limits is None else settings.limits.to_fmi().items()
    sizes = [(name, np.abs(np.diff(x_dm, i)) / T_s**i, limit) for i, (name, limit) in enumerate(limits, start=1)]
    if settings.change_max is not None:
        sizes.append(("change_max", np.abs(x_dm - x_d), settings.change_max))
    shares = {name: np.count_nonzero(size >= _BINDS * limit) / len(x_d) for name, size, limit in sizes}
    return {name: share for name, share in shares.items() if share >= _SAID}


class Expected(NamedTuple):
    """Errors without and with compensation, and the commands of the latter."""

    without: Array  # (n,), m: commanded minus measured position, as the next
    compensated: Array
    x_d: Array  # (n,), m: commanded position, and the modified one
    x_dm: Array


@dataclass(frozen=True)
class Trial:
    """A machine whose compensator is tried, by its native FMU, which is ten times as fast, or else by the library."""

    machine: Machine
    fmu: Path | None = None

    @classmethod
    @contextmanager
    def of(cls, machine: Machine) -> "Iterator[Trial]":
        """Give a machine's trial; by the library where this machine has no compiled one ready that it can load."""
        with TemporaryDirectory() as folder:
            fmu = None
            with suppress(FmuError, OSError):  # the disk's, too
                if kept(("SepCompensator", host_target())) is not None:
                    with FmuController(one := build_here(machine, "SepCompensator", Path(folder), reference=False), {}):
                        fmu = one
            yield cls(machine, fmu)

    @one_blas_thread
    def expected(
        self, known: PredictorSettings, settings: CompensatorSettings, recordings: Sequence[tuple[Array, Array]]
    ) -> list[Expected]:
        """Return the tracking errors to be expected of one recording each.

        ``known``: settings of the compensator's predictor; ``recordings``: sequence of pairs ``(x_d, x)`` of (n,), m:
        ``x`` as it arrives, with the ``measurement_delay`` of the settings; NaN where it is missing. The errors of what
        has not arrived at its end are left out. What was learned is kept from one recording to the next.

        SignalError or FmuError if a plan diverges.
        """
        model, late = self.machine.model, known.n_late
        known, discrete = replace(known, measurement_delay=late), model.discretise(known.T_s, known.input_hold)
        own = SepCompensator(HybridPredictor(model, known), settings)
        found, in_fmu = [], None if len(recordings) > 1 else self.fmu  # an FMU keeps nothing for the next run
        for i, (x_d, x) in enumerate(recordings):
            n, start, delay = len(x_d) - late, float(x_d[0]), own.preview
            if n < 1:
                continue
            residual = x[late:] - discrete.forced_response(discrete.rest(), x_d - start)[0][:n] - start
            at_rest = np.append(residual[~np.isnan(residual)], 0.0)[0]
            residual = np.pad(residual, (delay, late), constant_values=(at_rest, 0.0))
            # After its end the command goes on, as plans would see a stop in it that never comes
            further = x_d[-1] + np.diff(x_d[-2:]).sum() * np.arange(1, delay + 1)
            command, drive, on_the_way = np.append(x_d, further), discrete.stepper(), deque([start] * late)
            x_dm, true = np.empty((2, delay + len(x_d)))
            with ExitStack() as stack:
                ahead: FmuController | LibraryController = LibraryController(own, 0.0 if i else None)
                if in_fmu is not None:
                    ahead = FmuController(in_fmu, {**known.to_fmi(), **own.settings.to_fmi()})
                    stack.enter_context(ahead)
                ahead.initialise(start)
                x_dm_now = ahead.fmu.reader(["x_dm"]) if isinstance(ahead, FmuController) else None
                for k, (x_d_ahead, r) in enumerate(zip(command.tolist(), residual.tolist(), strict=True)):
                    x_dm[k] = sent = (x_dm_now() if x_dm_now else ahead.outputs()[0])[0]
                    true[k] = x_meas = drive(sent - start) + start + r
                    on_the_way.append(x_meas)
                    ahead.step(k, x_d_ahead, on_the_way.popleft())
            x_dm, true = x_dm[delay:][:n], true[delay:][:n]
            found.append(Expected(x_d[:n] - x[late:], x_d[:n] - true, x_d[:n], x_dm))
        return found
