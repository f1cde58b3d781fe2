"""State-space model of ``x − x_d`` by subspace identification, with its Kalman filter.

The state is what the past says of the future beyond the inputs (N4SID: Van Overschee and De Moor, Automatica 30, 1994,
75), here by an ARX model, whose noise need not be white beyond its lags (Jansson, SYSID 2003): in N4SID's own
projection a smooth command leaves nothing of the inputs.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import hankel

from ..base.signals import Array

_LAGS, _ORDERS = 40, range(1, 9)  # samples of the past that the state is of, and orders that are tried
_JUDGING = 5000  # last samples of each record on which the orders are compared
_BLOCK = 4096  # rows that are factorised at once


class StateSpace(NamedTuple):
    """``z(k+1) = A z + B u + K (y − C z − D u)``, ``y(k) = C z + D u``; ``u`` are a step of the command, and 1."""

    A: Array  # (n, n)
    B: Array  # (n, 2)
    C: Array  # (n,)
    D: Array  # (2,)
    K: Array  # (n,): gain of the filter

    def states(self, u: Array, y: Array) -> Array:
        """Return the state before each sample, ``(m + 1, n)``, of inputs ``(m, 2)`` and outputs ``(m,)``.

        Where an output is missing, NaN, the model runs on.
        """
        z, found = np.zeros(len(self.K)), np.zeros((len(y) + 1, len(self.K)))
        known = ~np.isnan(y)
        corrected = self.A - np.outer(self.K, self.C)
        driven = u @ self.B.T + np.where(known, np.nan_to_num(y) - u @ self.D, 0.0)[:, None] * self.K
        for k, (is_known, forced) in enumerate(zip(known.tolist(), driven, strict=True)):
            found[k + 1] = z = (corrected if is_known else self.A).dot(z) + forced  # in half of the time of @
        return found

    def free_run(self, z: Array, u: Array) -> Array:
        """Return the output ``(m,)`` from a state on, under inputs ``(m, 2)``."""
        y = np.empty(len(u))
        for k, forced in enumerate(u @ self.B.T):
            y[k] = self.C.dot(z)
            z = self.A.dot(z) + forced
        return y + u @ self.D


def inputs_of(x_d: Array) -> Array:
    """Return the model's inputs, ``(n, 2)``, of a command ``(n,)``."""
    return np.column_stack((np.diff(x_d, prepend=x_d[0]), np.ones(len(x_d))))


def folded(R: Array, rows: Array) -> Array:
    """Return the triangular factor of all rows so far, ``R`` and then ``rows``."""
    for i in range(0, len(rows), _BLOCK):
        R = np.asarray(np.linalg.qr(np.concatenate((R, rows[i : i + _BLOCK])), mode="r"))
    return R


def identified(records: Sequence[tuple[Array, Array]], Np: int) -> StateSpace | None:
    """Return the model with the least error over windows of ``Np`` samples of records ``(u, y)``; None without any."""
    width, R = _LAGS + 1, np.zeros((0, 2 * _LAGS + 3))
    for u, y in records:
        if len(y) < width:
            continue
        windows = [sliding_window_view(one, width)[:, ::-1] for one in (y, u[:, 0])]
        rows = np.hstack([*windows, np.ones((len(y) - _LAGS, 1))])
        R = folded(R, rows[~np.isnan(rows).any(axis=1)])
    if len(R) < R.shape[1]:
        return None
    n_rows = sum(int((~np.isnan(y)).sum()) for _, y in records)
    judging = [(u[-_JUDGING:], y[-_JUDGING:]) for u, y in records]
    return min(_of_orders(R, n_rows), key=lambda one: _misfit(one, judging, Np), default=None)


def _of_orders(R: Array, n_rows: int) -> list[StateSpace]:
    """Return the models; the rows of ``R``, ``[y(k) … y(k−40), u(k) … u(k−40), 1]``, stand for all samples' rows."""
    y, u = R[:, : _LAGS + 1], R[:, _LAGS + 1 : -1]
    now, past = np.column_stack((u[:, 0], R[:, -1])), np.hstack((y[:, 1:], u[:, 1:]))
    regressors = np.hstack((past, now))
    noise = y[:, 0] - regressors @ np.linalg.lstsq(regressors, y[:, 0])[0]
    # Coefficients are of the order of 1, whatever the command leaves open: a ridge of the noise's variance says so
    ridge = np.sqrt(np.sum(noise**2) / n_rows) * np.eye(regressors.shape[1])
    a_b = np.linalg.lstsq(np.vstack((regressors, ridge)), np.append(y[:, 0], 0.0 * ridge[0]))[0][: 2 * _LAGS]
    # What the past says of the next samples by the ARX model: coefficients of lag i + j for sample i, lag j
    ahead = np.vstack((hankel(a_b[:_LAGS]), hankel(a_b[_LAGS:])))
    before, after = past @ ahead, np.hstack((y[:, :-1], u[:, :-1])) @ ahead
    _, s, modes = np.linalg.svd(before, full_matrices=False)
    found = []
    for n in (order for order in _ORDERS if s[order - 1] > 1e-12 * s[0]):
        state, following = (one @ modes[:n].T / np.sqrt(s[:n]) for one in (before, after))
        output = np.linalg.lstsq(np.hstack((state, now)), y[:, 0])[0]
        innovation = y[:, :1] - np.hstack((state, now)) @ output[:, None]
        step = np.linalg.lstsq(np.hstack((state, now, innovation)), following)[0].T
        found.append(StateSpace(step[:, :n], step[:, n:-1], output[:n], output[n:], step[:, -1]))
    return found


def _misfit(model: StateSpace, records: Sequence[tuple[Array, Array]], Np: int) -> float:
    total = 0.0
    with np.errstate(all="ignore"):
        for u, y in records:
            begins = np.arange(_LAGS, len(y), Np)  # the states are known by then
            z, driven, direct = model.states(u, y)[begins], u @ model.B.T, u @ model.D
            for at in (begins[begins + k < len(y)] + k for k in range(Np)):  # all windows side by side
                z = z[: len(at)]
                total += float(np.nansum((y[at] - z @ model.C - direct[at]) ** 2))
                z = z @ model.A.T + driven[at]
    return total if np.isfinite(total) else np.inf
