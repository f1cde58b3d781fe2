"""mypy plugin: kinds of errors that NumPy before 2.3, the last for Python 3.10, gives where there is no fault.

Its stubs have other types of arrays and scalars. With a newer NumPy, as on any newer Python, they are checked.
"""

from importlib.metadata import version

from mypy import errorcodes
from mypy.options import Options
from mypy.plugin import Plugin

_KINDS = {
    errorcodes.ARG_TYPE,
    errorcodes.ASSIGNMENT,
    errorcodes.CALL_OVERLOAD,
    errorcodes.DICT_ITEM,
    errorcodes.NO_ANY_RETURN,
    errorcodes.NO_UNTYPED_CALL,
    errorcodes.OPERATOR,
    errorcodes.RETURN_VALUE,
    errorcodes.TYPE_ARG,
}


class _OfOldNumPy(Plugin):
    def __init__(self, options: Options) -> None:
        super().__init__(options)
        if tuple(map(int, version("numpy").split(".")[:2])) < (2, 3):
            options.disabled_error_codes |= _KINDS
            options.warn_unused_ignores = False  # of errors of these kinds


def plugin(_version: str) -> type[Plugin]:
    """Return the plugin's class, as mypy asks for it."""
    return _OfOldNumPy
