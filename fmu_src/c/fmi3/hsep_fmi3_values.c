/* Reading and writing variables. A call is checked as a whole first: if one variable is refused, none is touched. */
#include "hsep_fmi3_calls.h"

/* The values of a variable. */
static const double *fmi3_source(const hsep_instance *instance, fmi3ValueReference reference, size_t *count)
{
    const hsep_found found = hsep_fmi3_words()->find(&instance->context, reference);
    *count = found.count;
    return found.row->causality == HSEP_INDEPENDENT ? &instance->experiment.time : &instance->values[found.place];
}

/* fmi3Get… and fmi3Set… of a kind of variables that there are; what is set has one value for each reference, as no
 * array is an input or a parameter. */
#define FMI3_ACCESS(name, NAME, kind, get, set) \
    fmi3Status fmi3Get##name( \
        fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, \
        fmi3##name values[], size_t nValues) \
    { \
        const hsep_access access = { \
            .type = hsep_fmi3_words()->types[kind], \
            .references = valueReferences, \
            .n_references = nValueReferences, \
            .values = values, \
            .n_values = nValues}; \
        const hsep_instance *self = hsep_call_get(instance, HSEP_FMI3(GET_##NAME), access); \
        for (size_t i = 0; self != NULL && i < nValueReferences; i++) { \
            size_t count = 0; \
            const double *source = fmi3_source(self, valueReferences[i], &count); \
            while (count-- > 0) { \
                const double number = *source++; \
                *values++ = get; \
            } \
        } \
        return (self == NULL) ? fmi3Error : fmi3OK; \
    } \
    fmi3Status fmi3Set##name( \
        fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, \
        const fmi3##name values[], size_t nValues) \
    { \
        const hsep_access access = { \
            .type = hsep_fmi3_words()->types[kind], \
            .references = valueReferences, \
            .n_references = nValueReferences, \
            .values = values, \
            .n_values = nValues}; \
        hsep_instance *self = hsep_call_set(instance, HSEP_FMI3(SET_##NAME), access); \
        for (size_t i = 0; self != NULL && i < nValueReferences; i++) { \
            const fmi3##name number = values[i]; \
            self->values[valueReferences[i]] = set; \
        } \
        return (self == NULL) ? fmi3Error : fmi3OK; \
    }

FMI3_ACCESS(Float64, FLOAT64, HSEP_REAL, number, number)
FMI3_ACCESS(Int32, INT32, HSEP_INTEGER, hsep_values_integer(number), (double)number)
FMI3_ACCESS(Int64, INT64, HSEP_ENUMERATION, hsep_values_integer(number), (double)number)
FMI3_ACCESS(Boolean, BOOLEAN, HSEP_BOOLEAN, number != 0.0, number ? 1.0 : 0.0)

/* The same of types that no variable has: with references, the access is refused by name. */
static fmi3Status fmi3_no_variable(
    fmi3Instance instance, const hsep_call *call, int sets, const char *type, const fmi3ValueReference references[],
    size_t n_references, const void *values, size_t n_values)
{
    const hsep_access access = {
        .type = type, .references = references, .n_references = n_references, .values = values, .n_values = n_values};
    hsep_instance *self = sets ? hsep_call_set(instance, call, access) : hsep_call_get(instance, call, access);
    return (self == NULL) ? fmi3Error : fmi3OK;
}

#define FMI3_NO_VARIABLE(name, NAME) \
    fmi3Status fmi3Get##name( \
        fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, \
        fmi3##name values[], size_t nValues) \
    { \
        return fmi3_no_variable( \
            instance, HSEP_FMI3(GET_##NAME), 0, #name, valueReferences, nValueReferences, values, nValues); \
    } \
    fmi3Status fmi3Set##name( \
        fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, \
        const fmi3##name values[], size_t nValues) \
    { \
        return fmi3_no_variable( \
            instance, HSEP_FMI3(SET_##NAME), 1, #name, valueReferences, nValueReferences, values, nValues); \
    }

FMI3_NO_VARIABLE(Float32, FLOAT32)
FMI3_NO_VARIABLE(Int8, INT8)
FMI3_NO_VARIABLE(UInt8, UINT8)
FMI3_NO_VARIABLE(Int16, INT16)
FMI3_NO_VARIABLE(UInt16, UINT16)
FMI3_NO_VARIABLE(UInt32, UINT32)
FMI3_NO_VARIABLE(UInt64, UINT64)
FMI3_NO_VARIABLE(String, STRING)

fmi3Status fmi3GetBinary(
    fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, size_t valueSizes[],
    fmi3Binary values[], size_t nValues)
{
    (void)valueSizes;
    return fmi3_no_variable(
        instance, HSEP_FMI3(GET_BINARY), 0, "Binary", valueReferences, nValueReferences, values, nValues);
}

fmi3Status fmi3SetBinary(
    fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
    const size_t valueSizes[], const fmi3Binary values[], size_t nValues)
{
    (void)valueSizes;
    return fmi3_no_variable(
        instance, HSEP_FMI3(SET_BINARY), 1, "Binary", valueReferences, nValueReferences, values, nValues);
}
