"""What a contributor's run leaves out, and how many examples a property is tried on: a sixth, all of them at night."""

from hypothesis import HealthCheck, settings

LEFT_OUT = ("nightly", "release")  # marks of tests that run where they are named in ``-m``, or by their own names

_all = False


def take_profile(*, all_of_them: bool) -> None:
    """Choose for this process, before test files are imported."""
    global _all
    _all = all_of_them
    # No test fails because something else keeps the cores busy.
    settings.register_profile(
        "patient", deadline=None, suppress_health_check=[HealthCheck.too_slow], max_examples=share(100)
    )
    settings.load_profile("patient")


def share(number: int) -> int:
    """Return how many of a number of examples run."""
    return number if _all else -(-number // 6)


def examples(number: int) -> settings:
    """Return the decorator of a property that is tried on a number of examples, or on a sixth of it."""
    return settings(max_examples=share(number))
