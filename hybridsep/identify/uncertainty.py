"""Standard deviations of an output-error fit whose residual is not white: sandwich with batch sums of the scores.

``cov = (JᵀJ)⁻¹ (Σ_b s_b s_bᵀ) (JᵀJ)⁻¹`` with ``s_b = Σ_{k in b} J_k r_k`` over consecutive batches ``b``, which holds
whatever the correlation of the residual within a batch is; friction and the like leave it far from white. The dead
time is a whole number of samples: the deviations of the other parameters hold for the dead time as chosen, its own
deviation with all parameters free.
"""

from collections.abc import Sequence

import numpy as np

from ..base.signals import Array
from .model import Estimate
from .output_error import Fit, Problem, Segment, simulated, without

_BATCHES = 30  # batches of the residual: enough for a variance, and each long beside a servo's memory
_STEP = 1e-5  # relative step of the differences in the delta method


def estimates(fit: Fit, segments: Sequence[Segment], T_s: float, unit: str = "m") -> tuple[tuple[Estimate, ...], float]:
    """Return the parameters with their standard deviations, and the number of samples that tell as much as white ones.

    The fit is one to the segments; ``unit``, m or rad, is the positions'.
    """
    jacobian, residual = _jacobian(fit, segments, T_s)
    scale = np.linalg.norm(jacobian, axis=0)  # columns of unit norm
    scale[scale == 0] = 1.0
    jacobian = jacobian / scale
    edges = np.linspace(0, len(residual), min(_BATCHES, len(residual)) + 1).astype(int)[:-1]
    scores = np.add.reduceat(jacobian * residual[:, None], edges)
    given_delay = [i for i in range(jacobian.shape[1]) if i != jacobian.shape[1] - 2]
    covariance = np.zeros((len(scale), len(scale)))
    covariance[-2, -2] = _sandwich(jacobian, scores)[-2, -2]
    covariance[np.ix_(given_delay, given_delay)] = _sandwich(jacobian[:, given_delay], scores[:, given_delay])
    sums = np.add.reduceat(residual, edges)
    white = float(residual @ residual)
    n_effective = len(residual) * min(1.0, white / max(float(sums @ sums), 1e-300))
    return _named(fit, covariance / np.outer(scale, scale), T_s, unit), n_effective


def _sandwich(jacobian: Array, scores: Array) -> Array:
    bread = np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-12, hermitian=True)
    return np.asarray(bread @ (scores.T @ scores) @ bread * (len(scores) / max(1, len(scores) - 1)))


def _jacobian(fit: Fit, segments: Sequence[Segment], T_s: float) -> tuple[Array, Array]:
    """Return derivatives of the position with respect to θ, linear parameters, dead time and offset, and residual."""
    # What initial states explain is projected out
    problem = Problem(segments, T_s, fit.structure, fit.delay, sum(segment.stop for segment in segments))
    (gains, betas), theta, blocks, residuals = fit.structure.gains(fit.linear), fit.theta.tolist(), [], []
    for i, segment in enumerate(segments):
        free, signals = problem.signals(theta, i)
        slopes = [np.empty((0, len(signals)))]
        for mode, part in enumerate(problem.parts(theta)):
            by_command, _ = problem.slopes_of(i, part)
            slopes.append(np.array([gains[mode], *betas[mode : mode + 1]])[: by_command.shape[1]] @ by_command)
        by_delay = -np.gradient(simulated(fit, segment, T_s))[segment.known]
        residual = signals[:, -1] - signals[:, :-1] @ fit.linear
        block = np.column_stack((np.concatenate(slopes).T, signals[:, :-1], by_delay, np.ones(len(signals)), residual))
        both = without(free[:, 1:], block)
        blocks.append(both[:, :-1])
        residuals.append(without(both[:, -2:-1], both[:, -1:])[:, 0])
    return np.concatenate(blocks), np.concatenate(residuals)


def _named(fit: Fit, covariance: Array, T_s: float, unit: str) -> tuple[Estimate, ...]:
    """Return the estimates in physical units, their deviations by the delta method."""
    n_theta, n_linear = len(fit.theta), len(fit.linear)
    point = np.concatenate((fit.theta, fit.linear))

    def values(parameters: Array) -> Array:
        theta, linear = parameters[:n_theta], parameters[n_theta:]
        gains = fit.structure.gains(linear)[0]
        physical = [gains.sum()]
        if fit.structure.order:
            for mode in fit.structure.modes(theta, linear, T_s)[: fit.structure.n_modes]:
                physical += [mode.f_n, mode.zeta, mode.alpha, mode.beta]
        if fit.structure.lag:
            physical += [np.exp(-theta[-1]), gains[-1]]
        return np.array(physical)

    names, units = [("gain", "1")], {"f_n": "Hz", "zeta": "1", "alpha": "1/s2", "beta": "1/s"}
    for i in range(fit.structure.n_modes):
        names += [(f"mode[{i + 1}].{name}", unit_of) for name, unit_of in units.items()]
    names += [("lag.tau", "s"), ("lag.gain", "1")] * fit.structure.lag
    steps = np.diag(_STEP * np.maximum(np.abs(point), 1.0))  # of central differences
    changes = ((values(point + step) - values(point - step)) / (2 * step.sum()) for step in steps)
    slopes = np.column_stack((np.zeros((len(names), 0)), *changes))
    inner = covariance[: n_theta + n_linear, : n_theta + n_linear]
    deviations = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", slopes, inner, slopes), 0.0))
    found = [
        Estimate(name, float(value), float(deviation), unit_of)
        for (name, unit_of), value, deviation in zip(names, values(point), deviations, strict=True)
    ]
    delay, offset = np.sqrt(np.maximum(np.diag(covariance)[-2:], 0.0))
    found.append(Estimate("dead_time", float(fit.delay.samples), float(delay), "samples"))
    found.append(Estimate("offset", fit.offset, float(offset), unit))
    return tuple(found)
