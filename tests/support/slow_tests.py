"""The tests that ``pytest -m "not slow"`` leaves out, as each takes seconds on an idle machine; the longest files."""

from __future__ import annotations

import re

SLOW = (
    # The documentation: its command lines, one page after the other, and its site; the archives of a release
    r"documents/test_commands\.py::test_the_pages",
    r"documents/test_site\.py",
    r"release/test_wheel\.py",
    # The types of all files
    r"test_types\.py",
    # All platforms' compilers, sanitizers and programs that are compiled for one test
    r"fmi/test_native_fmu\.py::test_all_platforms",
    r"fmi/test_tables\.py::test_(mutated_tables|the_fuzzer|a_table_is_what_the_header_is)",
    r"cosim/test_systems\.py",
    r"fmi/test_native_fmu\.py::test_the_archive_without_binaries_can_be_compiled",
    r"fmi/test_weights\.py::test_build_takes_weights_and_targets",
    r"fmi/test_weights\.py::test_no_mutation",
    r"fmi/test_weights\.py::test_the_weights_are_in_the_resources_and_in_the_guid\[native",
    r"fmi/test_native_fmu\.py::test_(archives_are_reproducible|another_machine_has_another_guid)",
    r"suite/test_warm_start\.py::\w+\[native",
    r"fmi/test_python_sep_fmu\.py::test_each_fmu_carries_what_it_needs",
    r"fmi/test_fmi2_random\.py",
    r"fmi/test_fmi3_(agreement|description)\.py::\w+\[\w+_(als|emps)",
    r"fmi/test_foreign\.py",
    r"app/test_fmi_versions\.py::test_(fit_writes|the_demo_runs)",
    r"c/test_c_memory\.py",
    r"c/test_c_sources\.py",
    r"c/test_static_linking\.py",
    # FMUs of other machines, which differ from the default one's in modes and settings; of the stage, the X drive stays
    r"fmi/test_(native_fmu|python_fmu|model_description)\.py::\w+\[\w+_(als25010_y|emps)",
    r"fmi/test_(native_fmu|python_fmu|model_description)\.py::\w+\[(HybridPredictor|SepCompensator)(Py)?_als25010_x",
    r"suite/test_\w+\.py::.*(HybridPredictor|SepCompensator|FMU-FeedDrive)_als25010_x\]",
    # Whole trajectories, or every parameter
    r"fmi/test_native_cosimulation\.py::(?!test_every_pairing_agrees_with_the_library_on_the_staircase\[native-native)",
    r"fmi/test_reference_result\.py",
    r"c/test_c_agreement\.py",
    r"compensate/test_interior\.py",
    r"compensate/test_compensator\.py::test_trouble",
    r"compensate/test_path_direction\.py",
    r"compensate/test_trusted_plan\.py::(?!test_(without|a_plan))",
    r"plants/test_motion_friction\.py::test_the_error_on_the_x_axis",
    r"compensate/test_plans\.py::test_limits_hold",
    r"fmi/test_native_fmu\.py::test_checkers_have_no_finding\[\w+_(als|emps)",
    r"cosim/test_compensator_fmus\.py::test_(the_direction_can|recommended_settings|staircase_tracking|\w+\[python)",
    r"plants/test_plant\.py::test_fast_modes_are_resolved\[5000",
    r"app/test_identify_command\.py::test_a_log",
    r"identify/test_frequency_response\.py::test_table_1_is_found_within",
    r"identify/test_identification_peers\.py::test_poles_are_among",
    r"identify/test_operation\.py::test_(the_recorded_axis|recordings_get|a_half_at_rest|two_modes)",
    r"predict/test_trusted_figures\.py::test_(spiral|recorded)",
    r"random_drives/test_trusted_drives\.py",
    r"random_drives/test_two_mass_drives\.py::test_internal_steps",
    r"random_drives/test_two_mass_loops\.py::test_(off|the_physics|command)",
    r"random_drives/test_replay\.py::test_command_line",
    r"app/test_fit\.py::test_(a_rotary|a_second|a_gap|the_command_line|the_figures)",
    r"cosim/test_loop\.py::test_library_and_fmu_take_each_others_place\[Sep",
    r"c/test_c_states\.py::test_damaged_states_with_trust",
    r"machines/test_machine\.py::test_the_stages_friction_is_calibrated",
    r"predict/test_regression\.py::test_weights_after_the_staircase_against_extended_precision\[100",
    r"suite/test_rollback\.py::test_a_state_goes_on_in_a_second_instance\[(19|21|57|203)-",
    r"suite/test_agreement\.py::test_plants_move_as_the_librarys_do\[0\.00(25|025)-",
    r"suite/test_agreement\.py::test_every_parameter",
    r"suite/test_agreement\.py::test_the_stage",
    r"suite/test_conditions\.py::test_a_late",
    r"suite/test_agreement\.py::test_a_held_sensor",
    r"suite/test_agreement\.py::test_the_staircase_is_\w+_as_by_the_library\[(100|0\.1)",
    r"suite/test_timing\.py::test_outputs_are_those_of_the_last_instant\[(?!mixture-0)",
    r"suite/test_timing\.py::test_a_time_that_accumulates",
    r"suite/test_timing\.py::test_plants_move_the_same_in_any_steps\[(?!3\.7)",
    r"suite/test_warm_start\.py::test_a_warm_run_is_the_librarys_second_run\[(library|C core|pythonfmu)",
    r"suite/test_side_by_side\.py::test_instances_side_by_side_do_what_each_does_alone\[(pythonfmu|native)",
    r"suite/test_start_and_stop\.py::test_any_start_time_gives_the_same\[(pythonfmu|native)",
    r"suite/test_windows\.py::test_commands_are_those_of_plans_made_window_by_window\[(?!170-0\.1)",
    r"suite/test_warm_start\.py::test_a_warm_state_is_saved_and_an_instance_reset\[(pythonfmu|library)",
    r"suite/test_refusals\.py::test_bad_parameters_are_named_and_others_live_on\[native FMU-(Sep|Hybrid)",
    r"suite/test_windows\.py::test_the_staircase",
    r"suite/test_windows\.py::test_an_offset",
    r"suite/test_refusals\.py::test_an_input_that_is_no_position\w*\[(?!nan)",
    # Random inputs in great number, long streams
    r"base/test_threads\.py::test_results_do_not_depend_on_the_number_of_threads",
    r"c/test_c_regression\.py::test_the_weights_keep_their_digits_over_a_million_samples",
    r"evaluate/test_backtest\.py::test_memory_does_not_grow_with_the_stream",
    r"logs/test_logs\.py::test_memory_does_not_grow_with_the_log\[\.csv",
    r"predict/test_divergence\.py::test_whatever_a_state_holds_outputs_are_finite\[compensator",
    r"predict/test_extremes\.py",
    r"fmi/test_hostile_states\.py",
    r"cosim/test_instances\.py",
    r"app/test_hostile_input\.py::test_damaged",
    # Other programs and processes: importers, demonstrations, documents, the child that reads .mat files
    r"intake/test_intake\.py::test_a_good_log_is_not_accused\[(random|stage)",
    r"intake/test_intake\.py::test_a_delay_is_measured_against_the_model\[.*stage",
    r"app/test_example_log\.py::test_it_is_what",
    r"suite/test_rollback\.py::test_states_go_on_in_another_process",
    r"logs/test_log_errors\.py::test_(missing_columns|millimetres|too_short|truncated)\w*\[.*\.mat",
    r"logs/test_logs\.py::test_(chunks|which_column)\w*\[.*\.mat\]",
    r"logs/test_logs\.py::test_types_and_orientations\[shape1-.*\.mat\]",
    r"base/test_output\.py::test_a_full_tmpfs_costs_the_new_file_only",
    r"app/test_cli_interrupts\.py::test_ctrl_c_(during_a_build|in_a_terminal)",
    r"tune/test_joint\.py::test_the_result_is_the_same_for_any_number_of_processes\[True",
    r"app/test_cli_failures\.py::test_a_(reader_that_has_gone|full_standard_output)",
    r"app/test_demo\.py",
    r"app/test_cli\.py::test_(cosim_with|weights_for_a)_compensat",
    r"cosim/test_importers\.py",
    r"documents/",
)
"""Beginnings of their names below tests/, as regular expressions."""

_ANY = re.compile("|".join(SLOW))


LONGEST = (
    "fmi/test_native_fmu.py",  # where no compiler has run yet, two minutes for Windows' C library alone
    "suite/test_agreement.py",
    "app/test_demo.py",
    "test_types.py",
    "documents/test_commands.py",
    "random_drives/test_trusted_drives.py",
    "suite/test_conditions.py",
    "suite/test_rollback.py",
    "suite/test_timing.py",
    "cosim/test_importers.py",
    "fmi/test_fmi2_random.py",
    "release/test_wheel.py",
    "cosim/test_compensator_fmus.py",
    "compensate/test_trusted_plan.py",
    "fmi/test_hostile_states.py",
    "app/test_fit.py",
    "app/test_hostile_input.py",
    "documents/test_site.py",
    "documents/test_readme.py",
    "c/test_c_memory.py",
    "c/test_c_agreement.py",
)
"""Files below tests/ that run first: with one of them last, all workers but one would wait for it."""


def runs_before(nodeid: str) -> int:
    """Return where a test's file stands among those that run first; the others come after them, as they are."""
    file = nodeid.removeprefix("tests/").partition("::")[0]
    return LONGEST.index(file) if file in LONGEST else len(LONGEST)


def is_slow(nodeid: str) -> bool:
    """Return whether a test, named as pytest names it, is one of them."""
    return _ANY.match(nodeid.removeprefix("tests/")) is not None
