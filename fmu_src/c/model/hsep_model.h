/* Interface between a model and an adapter: sizes, initialization, step and values.
 *
 * An adapter (one for each version of FMI) owns one array of values, one place per variable of the table
 * (hsep_context), then the time derivatives of the first HSEP_N_INTERPOLATED of them (hsep_fmu.h), inputs that
 * may change within a step, which it sets to 0 after each step; and one block of memory, the state, whose size
 * follows from the parameters. The state is plain data without pointers: saving, restoring and serialising it is
 * one copy of its bytes. Outputs change only where their sample does, so what an adapter saves is the state together
 * with the values. Numbers lie in memory and in files as a little-endian machine has them.
 *
 * Nothing here allocates. Each function is reentrant; two threads may use two different instances at once. A message is
 * an empty text of HSEP_MESSAGE_SIZE bytes before each call.
 */
#ifndef HSEP_MODEL_H
#define HSEP_MODEL_H

#include "hsep_api.h"

#include <stddef.h>

#ifdef HSEP_FLOAT32
#error "FMUs compute in double precision: HSEP_FLOAT32 is only for the library"
#endif

#define HSEP_MESSAGE_SIZE 512 /* bytes of a message buffer, the final 0 included */

typedef enum {
    HSEP_OK = 0,
    HSEP_REFUSED = 1, /* the call cannot be done; the state is unchanged unless said otherwise, the message says why */
    HSEP_WARNED = 2,  /* the call is done; the message is a warning */
    /* of a step: inputs were read at an instant that is no communication point; one was taken at a point beside it */
    HSEP_WARNED_LATE = 4,
    HSEP_WARNED_MOVED = 8,
    HSEP_WARNED_BOTH = HSEP_WARNED_LATE | HSEP_WARNED_MOVED
} hsep_status;

/* HSEP_COUNT: an integer of the table that sizes arrays of FMI 3.0 */
typedef enum { HSEP_REAL, HSEP_INTEGER, HSEP_ENUMERATION, HSEP_BOOLEAN, HSEP_COUNT, HSEP_N_KINDS } hsep_kind;
typedef enum { HSEP_INPUT, HSEP_OUTPUT, HSEP_PARAMETER, HSEP_LOCAL, HSEP_INDEPENDENT } hsep_causality;

/* One row of the generated table (hsep_table.h). Numbers of every kind are held as double. */
typedef struct {
    const char *name;
    const char *unit;         /* "" if it has none */
    const char *angular_unit; /* the unit for a rotary axis */
    hsep_kind kind;
    hsep_causality causality;
    int tunable;      /* a parameter that may be set while the simulation runs */
    double minimum;   /* -HUGE_VAL if there is none */
    double maximum;   /* HUGE_VAL if there is none */
    double nonzero;   /* least value that is not 0; 0 if there is none */
    double automatic; /* value beside the range that stands for an automatic choice; HUGE_VAL if there is none */
    int learned;      /* a parameter that what was learned depends on */
} hsep_variable;

#define HSEP_MODE_NUMBERS 4 /* of a mode: f_n, zeta, alpha, beta */

/* What stays the same for one instance: the table, what this FMU has of it, and where its resources are. The variables
 * are n_scalars single ones, then the numbers of each mode, then n_last single ones, which came later than the modes'
 * places, then the samples of each window. */
typedef struct {
    const hsep_variable *variables; /* rows: n_scalars, HSEP_MODE_NUMBERS if it has modes, n_last, windows */
    size_t n_scalars;
    size_t n_modes;
    size_t n_last; /* single variables after the modes */
    size_t window; /* samples in each window, 0 where they are left out */
    size_t n_variables;
    /* (n_scalars + HSEP_MODE_NUMBERS n_modes + n_last,), 0 for what is calculated; so are the windows */
    const double *starts;
    const char *guid;
    int angular;           /* whether it is a rotary axis */
    const char *resources; /* folder with a trailing slash, decoded; NULL if there is none */
    const void *weights;   /* content of weights.bin, learned before, in any alignment; NULL: none, start cold */
    size_t weights_size;   /* bytes */
} hsep_context;

/* Check the parameters in values, each and together, and return the size of the state, bytes.
 * Fails with a message that names every parameter that is out of its range, the range and what came.
 * ReferenceTrajectory looks up the number of samples in its resource for that. */
HSEP_API hsep_status hsep_model_size(const hsep_context *context, const double values[], size_t *size, char message[]);

/* Fill the state (size bytes as hsep_model_size told, zeroed, aligned for double) for t_start; outputs of t_start go to
 * values.
 * ReferenceTrajectory reads its resource, as in hsep_model_size and hsep_model_start_values; no step touches a file.
 * HSEP_WARNED: the message says what only the importer knows to be right.
 * Fails if a start value is not finite, the weights are damaged or were learned with other settings, each of which is
 * named, or a resource cannot be read or has changed so that size does not fit. */
HSEP_API hsep_status hsep_model_initialise(
    const hsep_context *context, void *state, size_t size, double values[], double t_start, char message[]);

/* Do one communication step from t by h with the inputs, and the tunable parameters, in range, in values; outputs go to
 * values.
 * Fails, with state and values unchanged, if an input is not finite or t and h do not fit. Fails, with the values
 * unchanged, if an output would not be a finite number, because the learned recursion diverges: every later step fails
 * then, until another state is set or the model is initialised. A drive's step in
 * which the state overflows leaves it unchanged.
 * HSEP_WARNED_LATE or _MOVED: as they say, the message too.
 * Cost: bounded by the parameters and h/T_s, the same at the first and at the 10^9th call; allocates nothing. */
HSEP_API hsep_status
hsep_model_step(const hsep_context *context, void *state, double values[], double t, double h, char message[]);

/* Check the start value of the command: a position, from which outputs and locals follow before initialization. */
HSEP_API hsep_status hsep_model_check_start(const hsep_context *context, const double values[], char message[]);

/* Write outputs and locals as they follow from inputs and parameters before hsep_model_initialise.
 * Cannot fail: parameters that are out of range, and resources that are missing, leave start values. What a model that
 * starts warm has planned for its first window, x_h, e_servo and sep_state of SepCompensator, follows when the
 * initialization ends. */
HSEP_API void hsep_model_start_values(const hsep_context *context, double values[]);

#endif
