"""ARX model of the servo error by its definition: rows and free runs sample by sample."""

import numpy as np

from hybridsep.base.signals import Array


def arx_by_definition(x_d: Array, x: Array, n: int, n_fitted: int) -> Array:
    """Return the coefficients from the samples before ``n_fitted``, row by row."""
    y, rows, targets = x - x_d, [], []
    for k in range(n + 1, n_fitted):
        steps = [x_d[k - j] - x_d[k - j - 1] for j in range(n + 1)]
        row = [y[k - i] for i in range(1, n + 1)] + steps + [1.0]
        if not np.isnan([*row, y[k]]).any():
            rows.append(row)
            targets.append(y[k])
    return np.asarray(np.linalg.lstsq(np.array(rows), np.array(targets), rcond=None)[0])


def free_run_by_definition(w: Array, x_d: Array, x: Array, n: int, begin: int, end: int) -> Array:
    """Return the positions predicted from what is measured before ``begin``, sample by sample."""
    y = (x - x_d)[:begin].tolist()
    for k in range(n + 1, end):
        if k >= len(y) or np.isnan(y[k]):
            steps = [x_d[k - j] - x_d[k - j - 1] for j in range(n + 1)]
            value = float(np.dot(w, [y[k - i] for i in range(1, n + 1)] + steps + [1.0]))
            y[k : k + 1] = [value]
    return np.asarray(x_d[begin:end] + np.array(y[begin:end]))
