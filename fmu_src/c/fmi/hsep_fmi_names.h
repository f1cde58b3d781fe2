/* What a version of FMI calls things, and how it counts variables: all that messages and value references need. */
#ifndef HSEP_FMI_NAMES_H
#define HSEP_FMI_NAMES_H

#include "hsep_api.h"
#include "hsep_model.h"
#include "hsep_table.h"

#include <stddef.h>

#define HSEP_N_PHASES 5

/* The variable of a value reference: its row, its kind in this version, and the place and number of its values. */
typedef struct {
    const hsep_variable *row;
    hsep_kind kind;
    size_t place;
    size_t count;
} hsep_found;

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
    const char *types[HSEP_N_KINDS]; /* whose functions read and write a kind; one address for each type */
    /* Number of value references, which count from 0; */
    size_t (*n_variables)(const hsep_context *context);
    /* the variable of one of them, */
    hsep_found (*find)(const hsep_context *context, size_t reference);
    /* and its name, in text. */
    const char *(*name)(const hsep_context *context, size_t reference, char text[HSEP_NAME_SIZE]);
} hsep_fmi_names;

#endif
