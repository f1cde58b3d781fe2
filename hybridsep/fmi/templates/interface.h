#define HSEP_MODEL_NAME $model
#define HSEP_N_INTERPOLATED $n_interpolated /* the first variables, inputs with a time derivative */
#define HSEP_N_SCALARS $n_scalars
#define HSEP_HAS_MODES $has_modes
#define HSEP_N_LAST $n_last /* single variables after the modes */
#define HSEP_N_WINDOWS $n_windows
#define HSEP_VR_LENGTH $length /* of the samples in each window, where there are some */

/* Value references; of the modes' numbers the first one. */
enum {
$references
};
$macros
/* Rows of the table: single variables, the numbers of a mode, single variables again, windows. */
static const hsep_variable hsep_variables[$n_rows] = {
$rows
};
