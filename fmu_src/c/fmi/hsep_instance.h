/* An instance of an FMU in any version of FMI: memory, values, state, experiment; no arithmetic.
 *
 * What can fail returns HSEP_REFUSED, changes nothing unless said otherwise, and adds the reason to a message of
 * HSEP_MESSAGE_SIZE bytes, which an adapter hands to its importer; call is the name in what is not the model's own.
 * Memory is taken from the importer when an instance is made, initialised or saved; a step takes none.
 */
#ifndef HSEP_INSTANCE_H
#define HSEP_INSTANCE_H

#include "hsep_fmu.h"
#include "hsep_table.h"

#define HSEP_N_PHASES 5

/* The variable of a value reference: its row, its kind in this version, and the place and number of its values. */
typedef struct {
    const hsep_variable *row;
    hsep_kind kind;
    size_t place;
    size_t count;
} hsep_found;

/* What a version of FMI calls things, and how it counts variables: all that messages and value references need. */
typedef struct {
    const char *instantiate; /* functions */
    const char *reset;
    const char *token; /* arguments */
    const char *location;
    const char *location_form;
    const char *references;
    const char *n_references;
    const char *values;
    const char *n_values;
    const char *phases[HSEP_N_PHASES];
    const char *types[HSEP_N_KINDS]; /* whose functions read and write a kind */
    /* Number of value references, which count from 0; */
    size_t (*n_variables)(const hsep_context *context);
    /* the variable of one of them, */
    hsep_found (*find)(const hsep_context *context, size_t reference);
    /* and its name, as hsep_table_name. */
    const char *(*name)(const hsep_context *context, size_t reference, char text[HSEP_NAME_SIZE]);
} hsep_fmi_names;

/* The states of a co-simulation whose steps are done when the call returns. */
typedef enum {
    HSEP_INSTANTIATED = 1,
    HSEP_INITIALIZATION = 2,
    HSEP_STEPPING = 4,
    HSEP_TERMINATED = 8,
    HSEP_CONFIGURATION = 16 /* FMI 3.0's; no state is saved in it */
} hsep_phase;

#define HSEP_GUID_SIZE 48 /* a GUID in braces, padded with zeros */

/* The importer's memory functions, or the C library's. */
typedef void *(*hsep_allocate)(size_t count, size_t size);
typedef void (*hsep_release)(void *block);

#ifdef HSEP_NO_MALLOC
/* The target's own, as calloc and free, for what is compiled without them. */
void *hsep_target_calloc(size_t count, size_t size);
void hsep_target_free(void *block);
#define HSEP_CALLOC hsep_target_calloc
#define HSEP_FREE hsep_target_free
#else
#include <stdlib.h>
#define HSEP_CALLOC calloc
#define HSEP_FREE free
#endif

/* Where a simulation is. */
typedef struct {
    uint32_t phase; /* hsep_phase */
    uint32_t has_stop_time;
    double start_time; /* s */
    double stop_time;  /* s */
    double time;       /* s, where the last step ended */
} hsep_experiment;
HSEP_ASSERT_WORDS(hsep_experiment, 4);

/* Hands a message to the importer's logger, which is not NULL; the numbers of statuses are the same in all versions. */
typedef struct hsep_instance hsep_instance;
typedef void (*hsep_hand)(const hsep_instance *instance, int status, const char *category, const char *text);

/* What an importer's handle points to. */
struct hsep_instance {
    const hsep_fmi_names *names;
    hsep_hand hand;
    void (*logger)(void); /* the importer's, of the type of the version; may be NULL */
    void *environment;
    unsigned categories; /* bits of hsep_category that reach the logger */
    unsigned warned;     /* bits of hsep_status: what the model has warned of in steps */
    hsep_allocate allocate;
    hsep_release release;
    char *name;      /* NULL until it is known */
    char *resources; /* NULL if there is no usable folder */
    void *table;     /* what the context points to, where it was read from the resources; else NULL */
    void *weights;   /* likewise */
    hsep_context context;
    hsep_experiment experiment;
    void *state; /* the model's, NULL before the initialization has ended */
    size_t state_size;
    double *values; /* by place, then the time derivatives of inputs */
    size_t room;    /* samples of each window that values has room for, at least as many as the table has */
};

/* A zeroed block from the importer's memory; NULL if there is none left. */
HSEP_API void *hsep_new(const hsep_instance *instance, size_t size);

/* Give a block back; NULL is fine. */
HSEP_API void hsep_delete(const hsep_instance *instance, void *block);

/* Keep name and resources, a URI, a path or NULL, and take the table of the FMU's variables and what was learned: from
 * the header, or from variables.bin and weights.bin of the resources, which are the resources beside the library where
 * the location leads to none. Fails if there is no memory, or no table, or it is not one of this binary, damaged or out
 * of a range; HSEP_WARNED: the location is not used. */
HSEP_API hsep_status hsep_open(hsep_instance *instance, const char *name, const char *resources, char message[]);

/* Forget the model's state. */
HSEP_API void hsep_instance_drop_state(hsep_instance *instance);

/* Number of values, the time derivatives of inputs included. */
HSEP_API size_t hsep_instance_n_values(const hsep_instance *instance);

/* Give each window this many samples, which Np becomes; before the initialization. Fails if there is no memory. */
HSEP_API hsep_status hsep_instance_resize(hsep_instance *instance, const char *call, size_t window, char message[]);

/* As after the instantiation: start values, no experiment, no state. */
HSEP_API void hsep_instance_reset(hsep_instance *instance);

/* Take all memory of the simulation and fill it. If the parameters do not fit, they may be corrected and it called
 * again. HSEP_WARNED: it is done, and the message is a warning. */
HSEP_API hsep_status hsep_instance_initialise(hsep_instance *instance, const char *call, char message[]);

/* Give all memory back, the instance's too; NULL is fine. */
HSEP_API void hsep_instance_free(hsep_instance *instance);

#endif
