"""What is replayed on a target: parameters, samples and weights, as a C header."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from hybridsep.base.parameters import Parameter
from hybridsep.base.settings import PARAMETERS, CompensatorSettings, PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.compensate.compensator import SepCompensator
from hybridsep.fmi.variables import AVERAGING_SETTINGS, COMPENSATOR_SETTINGS, PREDICTOR_SETTINGS
from hybridsep.fmi.weights import weights_file
from hybridsep.machines.machine import load_machine
from hybridsep.online.look_ahead import LookAhead
from hybridsep.plants.plant import Encoder
from hybridsep.plants.trajectory import staircase
from hybridsep.predict.predictor import HybridPredictor

KINDS = ("predictor", "compensator")
SIZES = ((20, 20), (100, 50))
OUTPUTS = {"predictor": ("x_h", "x_h_std"), "compensator": ("x_dm", "predicted.x_h")}
"""What a replay writes of each sample."""
_BLOCK_SIZE = 1_500_000  # room for the block, bytes; data of the program, not of the library


@dataclass(frozen=True)
class Case:
    """A replay."""

    kind: str  # {"predictor", "compensator"}
    # samples of a window, lags
    Np: int
    p: int
    windows: int  # windows that are replayed
    warm: bool = False  # whether it begins with what was learned in a run before
    recall: int = PredictorSettings().recall  # samples of the memory
    late: int = 0  # samples by which measurements are said to be late


def _predictor(case: Case) -> HybridPredictor:
    settings = PredictorSettings(Np=case.Np, p=case.p, q=3, recall=case.recall, measurement_delay=case.late)
    return HybridPredictor(load_machine("spring_mass_damper").model, settings)


def _compensator(case: Case) -> SepCompensator:
    """Return a compensator with the limits of the trajectory: most plans are bounded, which costs most."""
    limits = load_machine("spring_mass_damper").trajectory_limits()
    settings = CompensatorSettings(preview=max(200, 2 * case.Np), spacing=2, change_max=1e-3, limits=limits)
    return SepCompensator(_predictor(case), settings)


@cache
def recorded(case: Case) -> tuple[Array, bytes]:
    """Return the samples ``(x_d_ahead, x_meas)``, (n, 2), m, of a run of the library on the paper's drive, and weights.

    The weights are those that it has learned at the end of its cold run; empty for a cold one. The commands are numbers
    of single precision, so that the library and every replay plan the same motion: the jerk of commands that are
    rounded differs by hundredths of a limit.
    """
    command = np.tile(staircase()[:-1], 3).astype(np.float32).astype(np.float64)
    drive, encoder = load_machine("spring_mass_damper").new_plant(), Encoder(5e-6, 7)
    controller = _predictor(case) if case.kind == "predictor" else _compensator(case)
    predictor = controller if isinstance(controller, HybridPredictor) else controller.predictor
    weights = b""
    for _ in range(1 + case.warm):
        if case.warm and predictor.regression.n_rows:
            weights = weights_file(predictor)
        online, samples = LookAhead(controller, float(command[0])), []
        drive.reset(command[0])
        for x_d_ahead in command[: case.windows * case.Np]:
            x_meas = encoder.measure(drive.x)
            drive.step(online.x_dm if case.kind == "compensator" else online.x_d, predictor.T_s)
            online.sample(x_d_ahead, x_meas)
            samples.append((x_d_ahead, x_meas))
    return np.array(samples), weights


def parameters(case: Case) -> tuple[dict[str, float], dict[str, float]]:
    """Return the settings by their names in C, and the drive's mode."""
    predictor = _predictor(case)
    values = {**predictor.settings.to_fmi(), "dead_time": predictor.model.dead_time}
    if case.kind == "compensator":
        values |= _compensator(case).settings.to_fmi()
    declared = _declared(case)
    found = {name: values[name] for part in declared.values() for name in part}
    numbers = {name: value if _is_real(name) else int(value) for name, value in found.items()}
    mode = predictor.model.modes[0]
    return numbers, {name: float(getattr(mode, name)) for name in ("f_n", "zeta", "alpha", "beta")}


def _declared(case: Case) -> dict[str, Mapping[str, Parameter]]:
    """Return the declarations of the settings that the kind has, by part of hsep_parameters."""
    parts: dict[str, Mapping[str, Parameter]] = {"predictor": PREDICTOR_SETTINGS, "averaging": AVERAGING_SETTINGS}
    return parts | ({"compensator": COMPENSATOR_SETTINGS} if case.kind == "compensator" else {})


def _is_real(name: str) -> bool:
    return PARAMETERS[name].kind is float


def header(case: Case) -> str:
    """Return the text of ``case.h``."""
    samples, weights = recorded(case)
    values, mode = parameters(case)
    lines = [
        f"    parameters->{part}.{name} = {values[name]!r};"
        for part, names in _declared(case).items()
        for name in names
    ]
    numbers = ", ".join(map(repr, mode.values()))
    first, second = OUTPUTS[case.kind]
    rows = ",\n    ".join(f"{{{x_d!r}, {x_meas!r}}}" for x_d, x_meas in samples.tolist())
    content = ", ".join(map(str, weights)) or "0"
    return f"""#include "hsep.h"

#define CASE_BLOCK_SIZE {_BLOCK_SIZE}
#define CASE_TYPE hsep_{case.kind}
#define CASE_OUTPUTS hsep_{case.kind}_outputs
#define CASE_FUNCTION(name) hsep_{case.kind}_##name
#define CASE_FIRST(outputs) (outputs).{first}
#define CASE_SECOND(outputs) (outputs).{second}

static const hsep_mode case_mode = {{{numbers}}};

static void case_parameters(hsep_parameters *parameters)
{{
    hsep_defaults(parameters);
{chr(10).join(lines)}
    parameters->n_modes = 1;
    parameters->modes = &case_mode;
}}

static const unsigned char case_learned[{max(1, len(weights))}] = {{{content}}};
static const void *const case_weights = {"case_learned" if weights else "NULL"};
static const size_t case_weights_size = {len(weights)};

static const hsep_real case_samples[{len(samples)}][2] = {{
    {rows}}};
"""
