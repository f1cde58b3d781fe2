/* FMI 2.0's words; a value reference is the place of one value. */
#include "hsep_fmi2_calls.h"

static size_t fmi2_n_variables(const hsep_context *context) { return context->n_variables; }

static hsep_found fmi2_find(const hsep_context *context, size_t reference)
{
    const hsep_variable *row = hsep_table_row(context, reference);
    return (hsep_found){.row = row, .kind = row->kind, .place = reference, .count = 1};
}

/* Enumerations are read and written as integers. */
static const char fmi2_integer[] = "Integer";

static const hsep_fmi_names fmi2_names = {
    .instantiate = "fmi2Instantiate",
    .reset = "fmi2Reset",
    .token = "fmuGUID",
    .location = "fmuResourceLocation",
    .location_form = "a file: URI",
    .references = "vr",
    .n_references = "nvr",
    .values = "value",
    .n_values = "nvr",
    .phases = {"instantiated", "Initialization Mode", "stepping (after fmi2ExitInitializationMode)", "terminated"},
    .types =
        {[HSEP_REAL] = "Real",
         [HSEP_INTEGER] = fmi2_integer,
         [HSEP_ENUMERATION] = fmi2_integer,
         [HSEP_BOOLEAN] = "Boolean"},
    .n_variables = fmi2_n_variables,
    .find = fmi2_find,
    .name = hsep_table_name};

HSEP_API const hsep_fmi_names *hsep_fmi2_names(void) { return &fmi2_names; }

HSEP_API fmi2Status hsep_fmi2_status(hsep_status status) { return (status == HSEP_REFUSED) ? fmi2Error : fmi2OK; }
