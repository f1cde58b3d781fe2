"""Recorded logs of an axis: commanded and measured positions at a fixed sampling interval.

Text, NumPy ``.npz``, MATLAB ``.mat``, HDF5 and Siemens Capture files hold the columns ``t`` (s), ``x_d`` and ``x_meas``
or ``x`` (positions), under these names or others; :mod:`hybridsep.logs.formats` lists the formats, one file each.
:func:`~hybridsep.logs.log.read_log` returns the whole log, :func:`~hybridsep.logs.log.open_log` reads it chunk by chunk
in bounded memory, with the same checks. A :class:`~hybridsep.base.errors.LogError` names the file, the line or sample,
what was expected and what was found.
"""
