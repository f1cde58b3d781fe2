"""Recorded logs of an axis: commanded and measured positions at a fixed sampling interval.

CSV, NumPy ``.npz`` and MATLAB v5 ``.mat`` files hold the columns ``t`` (s), ``x_d`` and ``x_meas`` or ``x``
(positions), under these names or others. :func:`~hybridsep.logs.log.read_log` gives the whole log,
:func:`~hybridsep.logs.log.open_log` the same log chunk by chunk in bounded memory; both run the same checks, and every
problem is a :class:`~hybridsep.base.errors.LogError` that names the file, the place as a user counts it, what was
expected and what came.
"""
