/* Reading and writing variables. A call is checked as a whole first: if one variable is refused, none is touched. */
#include "hsep_fmi3_calls.h"

/* The values of a variable. */
static const double *fmi3_source(const hsep_instance *instance, fmi3ValueReference reference, size_t *count)
{
    const hsep_found found = hsep_fmi3_names()->find(&instance->context, reference);
    *count = found.count;
    return found.row->causality == HSEP_INDEPENDENT ? &instance->experiment.time : &instance->values[found.place];
}

/* fmi3Get… and fmi3Set… of a kind of variables that there are; what is set has one value for each reference, as no
 * array is an input or a parameter. */
#define FMI3_ACCESS(name, NAME, kind, get, set) \
    fmi3Status fmi3Get##name( \
        fmi3Instance instance, const fmi3ValueReference references[], size_t n, fmi3##name values[], size_t n_values) \
    { \
        const char *type = hsep_fmi3_names()->types[kind]; \
        const hsep_instance *self = \
            hsep_call_access(instance, HSEP_FMI3(GET_##NAME), 0, type, references, n, values, n_values); \
        for (size_t i = 0; self != NULL && i < n; i++) { \
            size_t count = 0; \
            const double *source = fmi3_source(self, references[i], &count); \
            while (count-- > 0) { \
                const double number = *source++; \
                *values++ = get; \
            } \
        } \
        return (self == NULL) ? fmi3Error : fmi3OK; \
    } \
    fmi3Status fmi3Set##name( \
        fmi3Instance instance, const fmi3ValueReference references[], size_t n, const fmi3##name values[], \
        size_t n_values) \
    { \
        const char *type = hsep_fmi3_names()->types[kind]; \
        hsep_instance *self = \
            hsep_call_access(instance, HSEP_FMI3(SET_##NAME), 1, type, references, n, values, n_values); \
        for (size_t i = 0; self != NULL && i < n; i++) { \
            const fmi3##name number = values[i]; \
            self = hsep_call_tune(self, HSEP_FMI3(SET_##NAME), references[i], set); \
        } \
        for (size_t i = 0; self != NULL && i < n; i++) { \
            const fmi3##name number = values[i]; \
            self->values[references[i]] = set; \
        } \
        return (self == NULL) ? fmi3Error : fmi3OK; \
    }

FMI3_ACCESS(Float64, FLOAT64, HSEP_REAL, number, number)
FMI3_ACCESS(Int32, INT32, HSEP_INTEGER, hsep_values_integer(number), (double)number)
FMI3_ACCESS(Int64, INT64, HSEP_ENUMERATION, hsep_values_integer(number), (double)number)
FMI3_ACCESS(Boolean, BOOLEAN, HSEP_BOOLEAN, number != 0.0, number ? 1.0 : 0.0)

/* Access to types that no variable has: with references, it is refused by name. */
static fmi3Status fmi3_none(
    fmi3Instance instance, const hsep_call *call, int sets, const char *type, const fmi3ValueReference references[],
    size_t n, const void *values, size_t n_values)
{
    const hsep_instance *self = hsep_call_access(instance, call, sets, type, references, n, values, n_values);
    return (self == NULL) ? fmi3Error : fmi3OK;
}

#define FMI3_NO_VARIABLE(verb, VERB, sets, name, NAME, ...) \
    fmi3Status fmi3##verb##name( \
        fmi3Instance instance, const fmi3ValueReference references[], size_t n, __VA_ARGS__ values[], size_t n_values) \
    { \
        return fmi3_none(instance, HSEP_FMI3(VERB##_##NAME), sets, #name, references, n, values, n_values); \
    }

#define FMI3_NO_VARIABLES(name, NAME) \
    FMI3_NO_VARIABLE(Get, GET, 0, name, NAME, fmi3##name) \
    FMI3_NO_VARIABLE(Set, SET, 1, name, NAME, const fmi3##name)

FMI3_NO_VARIABLES(Float32, FLOAT32)
FMI3_NO_VARIABLES(Int8, INT8)
FMI3_NO_VARIABLES(UInt8, UINT8)
FMI3_NO_VARIABLES(Int16, INT16)
FMI3_NO_VARIABLES(UInt16, UINT16)
FMI3_NO_VARIABLES(UInt32, UINT32)
FMI3_NO_VARIABLES(UInt64, UINT64)
FMI3_NO_VARIABLES(String, STRING)

fmi3Status fmi3GetBinary(
    fmi3Instance instance, const fmi3ValueReference references[], size_t n, size_t sizes[], fmi3Binary values[],
    size_t n_values)
{
    (void)sizes;
    return fmi3_none(instance, HSEP_FMI3(GET_BINARY), 0, "Binary", references, n, values, n_values);
}

fmi3Status fmi3SetBinary(
    fmi3Instance instance, const fmi3ValueReference references[], size_t n, const size_t sizes[],
    const fmi3Binary values[], size_t n_values)
{
    (void)sizes;
    return fmi3_none(instance, HSEP_FMI3(SET_BINARY), 1, "Binary", references, n, values, n_values);
}
