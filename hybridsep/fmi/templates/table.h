/* What fmi${fmi}Functions.h may put before the names of the FMI functions. */
#ifndef FMI${fmi}_FUNCTION_PREFIX
#define FMI${fmi}_FUNCTION_PREFIX ${name}_
#endif

#define HSEP_GUID $guid
#define HSEP_N_MODES $n_modes
#define HSEP_WINDOW $window /* samples in each window, 0 where they are left out */
#define HSEP_N_STARTS (HSEP_N_SCALARS + HSEP_MODE_NUMBERS * HSEP_N_MODES + HSEP_N_LAST)
#define HSEP_N_VARIABLES (HSEP_N_STARTS + HSEP_N_WINDOWS * HSEP_WINDOW)
#define HSEP_N_VALUES (HSEP_N_VARIABLES + HSEP_N_INTERPOLATED)

static const double hsep_starts[HSEP_N_STARTS] = {
$starts};

${learned}static const hsep_context hsep_table = {
    .variables = hsep_variables,
    .n_scalars = HSEP_N_SCALARS,
    .n_modes = HSEP_N_MODES,
    .n_last = HSEP_N_LAST,
    .window = HSEP_WINDOW,
    .n_variables = HSEP_N_VARIABLES,
    .starts = hsep_starts,
    .guid = HSEP_GUID,
    .angular = $angular$embedded};
