"""One interface to a model in every implementation; what an implementation cannot do stands in :data:`CANNOT`."""

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hybridsep import load_machine, paper_machine
from hybridsep.fmi.spec import table_of
from hybridsep.fmi.variables import FmuTable
from hybridsep.machines.machine import Machine

Array = NDArray[np.float64]
Value = float | int | bool

LIBRARY, CORE, NATIVE = IMPLEMENTATIONS = ("library", "C core", "native FMU")
FMI3 = "FMI 3.0 FMU"  # beside them in the tests of what an adapter does; its values are the native FMU's, bit for bit

PREDICTOR, COMPENSATOR, TRAJECTORY = "HybridPredictor", "SepCompensator", "ReferenceTrajectory"
STAGE_PREDICTOR, STAGE_COMPENSATOR = "HybridPredictor_als25010_x", "SepCompensator_als25010_x"
DRIVE, STAGE = "FeedDrive", "FeedDrive_als25010_x"
LOOK_AHEADS = (PREDICTOR, COMPENSATOR)
PLANTS = (DRIVE, STAGE)
MODELS = (*LOOK_AHEADS, TRAJECTORY, *PLANTS)

CANNOT = {
    (LIBRARY, TRAJECTORY): "an array of positions needs no player",
    (LIBRARY, "slopes"): "its inputs are samples",
    (LIBRARY, "stop time"): "a stop time is the adapter's",
    (CORE, "stop time"): "a stop time is the adapter's",
    (LIBRARY, "setters"): "its settings are changed together, by change(), which checks them",
    (CORE, "setters"): "what is set in a run is checked by the adapter",
    (LIBRARY, "warnings"): "its clock says nothing of where instants lie",
    (CORE, "one warning"): "it warns at each step; what is said once an instance is the adapter's",
    (LIBRARY, "outputs before"): "before its object is made there is nothing to ask",
    (FMI3, "slopes"): "FMI 3.0 has no derivatives of inputs",
    (LIBRARY, "agreement"): "it is what the others are compared with; test_windows.py and the oracle are its truth",
    (LIBRARY, "figures"): "the C core agrees with it to 1e-12 m, and its figures take a tenth of the time",
    (NATIVE, "figures"): "it agrees with the C core, which it is compiled from",
    (CORE, "bad states"): "checksum, GUID and size are the adapter's",
    (LIBRARY, "a plant's time"): "its plants are stepped by an interval, and put to rest wherever asked for",
}
"""(implementation, model or ability): why it is not there."""

OUTPUTS = {
    PREDICTOR: (
        *("x_d", "x_pb", "x_h", "x_h_std", "e_servo", "hybrid_active"),
        *("rms_pb", "rms_h", "rms_hold", "batch", "n_rejected"),
    ),
    COMPENSATOR: (
        *("x_dm", "x_d", "x_pb", "x_h", "x_h_std", "e_servo", "sep_state"),
        *("rms_e", "rms_pb", "rms_h", "rms_hold", "batch", "n_rejected", "no_measurement", "alarm"),
    ),
    TRAJECTORY: ("r",),
    DRIVE: ("x", "v", "x_meas"),
}

WINDOWS = ("x_d_window", "x_pb_window", "x_h_window", "x_h_std_window")  # arrays that a predictor shows


class RefusedStreamError(Exception):
    """An implementation refused a call; the text is its message."""


class Stream(Protocol):
    """One instance of a model in one implementation."""

    model: str

    def initialise(self, values: Mapping[str, Value], *, start: float = 0.0, stop: float | None = None) -> None:
        """Set parameters and start values, and begin at ``start``, s."""

    def outputs_before(self, values: Mapping[str, Value]) -> list[float]:
        """Set parameters and start values, and return the outputs as they are while an FMU initialises."""

    def set(self, name: str, value: Value) -> None:
        """Set an input."""

    def set_slope(self, name: str, slope: float) -> None:
        """Set an input's time derivative for the next step."""

    def step(self, t: float, h: float) -> None:
        """Do one communication step."""

    def outputs(self) -> list[float]:
        """Return the model's :data:`OUTPUTS`."""

    def window(self, name: str) -> Array:
        """Return one of a predictor's :data:`WINDOWS`, ``(Np as built,)``."""

    def save(self) -> bytes:
        """Return the whole state, serialised."""

    def restore(self, blob: bytes) -> None:
        """Take over a state that :meth:`save` returned, whether initialised or not."""

    def reset(self) -> None:
        """Forget everything, parameters included."""

    def warnings(self) -> list[str]:
        """Return the warnings of all steps so far, as far as the implementation keeps them."""

    def close(self) -> None:
        """End the instance."""


def kind_of(model: str) -> str:
    """Return the model without the machine: a key of :data:`OUTPUTS`."""
    return model.partition("_")[0]


def machine_of(model: str) -> Machine:
    """Return the machine of a model; a predictor has the paper's settings, so that averaging is what a test says."""
    name = model.partition("_")[2] or "spring_mass_damper"
    return paper_machine(name) if kind_of(model) == "HybridPredictor" else load_machine(name)


def table_of_model(model: str) -> FmuTable:
    """Return the table of the model's FMU."""
    return table_of(machine_of(model), kind_of(model), model)
