/* FMI 3.0's words; single variables and modes have a value reference for each value, windows one each, then comes the
 * time. Where there are windows, Np is the structural parameter that sizes them. */
#include "hsep_fmi3_calls.h"
#include "hsep_text.h"

/* Value references before the windows, which are the places of the values. */
static size_t fmi3_before_windows(const hsep_context *context)
{
    return context->n_scalars + HSEP_MODE_NUMBERS * context->n_modes;
}

static size_t fmi3_n_windows(const hsep_context *context) { return context->window > 0 ? HSEP_N_WINDOWS : 0; }

static size_t fmi3_n_variables(const hsep_context *context)
{
    return fmi3_before_windows(context) + fmi3_n_windows(context) + 1;
}

/* The time has no place: its value is the experiment's. */
static const hsep_variable fmi3_time = {
    .name = "time", .unit = "s", .angular_unit = "s", .kind = HSEP_REAL, .causality = HSEP_INDEPENDENT};

static hsep_found fmi3_find(const hsep_context *context, size_t reference)
{
    const size_t before = fmi3_before_windows(context);
    if (reference < before) {
        const hsep_variable *row = hsep_table_row(context, reference);
        const hsep_kind kind = context->window > 0 && reference == HSEP_VR_LENGTH ? HSEP_COUNT : row->kind;
        return (hsep_found){.row = row, .kind = kind, .place = reference, .count = 1};
    }
    if (reference == before + fmi3_n_windows(context)) {
        return (hsep_found){.row = &fmi3_time, .kind = HSEP_REAL, .place = context->n_variables, .count = 1};
    }
    const size_t place = before + (reference - before) * context->window;
    return (hsep_found){
        .row = hsep_table_row(context, place), .kind = HSEP_REAL, .place = place, .count = context->window};
}

static const char *fmi3_name(const hsep_context *context, size_t reference, char text[HSEP_NAME_SIZE])
{
    if (reference < fmi3_before_windows(context)) {
        return hsep_table_name(context, reference, text);
    }
    hsep_text(text, HSEP_NAME_SIZE, "%.60s", fmi3_find(context, reference).row->name);
    return text;
}

static const hsep_fmi_names fmi3_names = {
    .instantiate = "fmi3InstantiateCoSimulation",
    .reset = "fmi3Reset",
    .token = "instantiationToken",
    .location = "resourcePath",
    .location_form = "a folder",
    .references = "valueReferences",
    .n_references = "nValueReferences",
    .values = "values",
    .n_values = "nValues",
    .phases = {"instantiated", "Initialization Mode", "Step Mode", "terminated", "Configuration Mode"},
    .types =
        {[HSEP_REAL] = "Float64",
         [HSEP_INTEGER] = "Int32",
         [HSEP_ENUMERATION] = "Int64", /* which the standard reads and writes enumerations by */
         [HSEP_BOOLEAN] = "Boolean",
         [HSEP_COUNT] = "UInt64"},
    .n_variables = fmi3_n_variables,
    .find = fmi3_find,
    .name = fmi3_name};

HSEP_API const hsep_fmi_names *hsep_fmi3_names(void) { return &fmi3_names; }

HSEP_API fmi3Status hsep_fmi3_status(hsep_status status) { return (status == HSEP_REFUSED) ? fmi3Error : fmi3OK; }
