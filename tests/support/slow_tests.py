"""The tests that ``pytest -m "not slow"`` leaves out, as each takes seconds on an idle machine."""

from __future__ import annotations

import re

SLOW = (
    # All platforms' compilers, sanitizers and programs that are compiled for one test
    r"fmi/test_native_fmu\.py::test_all_platforms",
    r"fmi/test_native_fmu\.py::test_the_archive_without_binaries_can_be_compiled",
    r"fmi/test_weights\.py::test_build_takes_weights_and_targets",
    r"fmi/test_weights\.py::test_no_mutation",
    r"fmi/test_fmi2_random\.py",
    r"fmi/test_foreign\.py",
    r"c/test_c_memory\.py",
    r"c/test_c_sources\.py",
    r"c/test_static_linking\.py",
    # Whole trajectories, or every parameter
    r"fmi/test_native_cosimulation\.py::(?!test_every_pairing_agrees_with_the_library_on_the_staircase\[native-native)",
    r"fmi/test_reference_result\.py",
    r"c/test_c_agreement\.py",
    r"compensate/test_interior\.py",
    r"compensate/test_compensator\.py::test_trouble",
    r"compensate/test_path_direction\.py",
    r"compensate/test_plans\.py::test_limits_hold",
    r"fmi/test_native_fmu\.py::test_checkers_have_no_finding\[\w+_(als|emps)",
    r"cosim/test_predictor_fmus\.py::test_(spiral|staircase)_error_reduction",
    r"cosim/test_compensator_fmus\.py::test_(the_direction_and|recommended_settings|staircase_tracking)",
    r"predict/test_predictor_with_reference_features\.py::test_friction_is_predicted_better",
    r"test_machine\.py::test_the_stages_friction_is_calibrated",
    r"suite/test_rollback\.py::test_a_state_goes_on_in_a_second_instance\[(19|21|57|203)-",
    r"suite/test_agreement\.py::test_plants_move_as_the_librarys_do\[0\.00(25|025)-",
    r"suite/test_agreement\.py::test_every_parameter",
    r"suite/test_agreement\.py::test_the_stage",
    r"suite/test_agreement\.py::test_a_held_sensor",
    r"suite/test_agreement\.py::test_the_staircase_is_\w+_as_by_the_library\[(100|0\.1)",
    r"suite/test_timing\.py::test_outputs_are_those_of_the_last_instant\[(?!mixture-0)",
    r"suite/test_timing\.py::test_a_time_that_accumulates",
    r"suite/test_timing\.py::test_plants_move_the_same_in_any_steps\[(?!3\.7)",
    r"suite/test_windows\.py::test_the_staircase",
    r"suite/test_windows\.py::test_an_offset",
    r"suite/test_refusals\.py::test_an_input_that_is_no_position\w*\[(?!nan)",
    # Random inputs in great number
    r"predict/test_extremes\.py",
    r"fmi/test_hostile_states\.py",
    r"cosim/test_instances\.py",
    # Other programs: importers, demonstrations, documents
    r"app/test_demo\.py",
    r"app/test_cli\.py::test_(cosim_with|weights_for_a)_compensat",
    r"cosim/test_importers\.py",
    r"documents/",
)
"""Beginnings of their names below tests/, as regular expressions."""


def is_slow(nodeid: str) -> bool:
    """Return whether a test, named as pytest names it, is one of them."""
    return any(re.match(pattern, nodeid.removeprefix("tests/")) for pattern in SLOW)
