"""Recorded logs of an axis: commanded and measured positions at a fixed sampling interval.

Text, NumPy ``.npz``, MATLAB ``.mat``, Parquet and controllers' files hold the columns ``t`` (s), ``x_d`` and ``x_meas``
or ``x`` (positions), under these names or others; :mod:`hybridsep.logs.formats` lists the formats. Arrays come from
:func:`~hybridsep.logs.log.read_log` as they were recorded; :func:`~hybridsep.logs.checks.check` asks what they mean. A
:class:`~hybridsep.base.errors.LogError` names the file, the line or sample, what was expected and what was found.
"""
