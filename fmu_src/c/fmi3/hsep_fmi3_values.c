/* Reading and writing variables. A call is checked as a whole first: if one variable is refused, none is touched. */
#include "hsep_fmi3_calls.h"

/* The values of a variable. */
static const double *fmi3_source(const hsep_instance *instance, fmi3ValueReference reference, size_t *count)
{
    const hsep_found found = hsep_fmi3_names()->find(&instance->context, reference);
    *count = found.count;
    return found.row->causality == HSEP_INDEPENDENT ? &instance->experiment.time : &instance->values[found.place];
}

/* The functions that get and set a kind of variables that there are; what is set has one value for each reference, as
 * no array is an input or a parameter. */
#define FMI3_GET(getter, NAME, c_type, kind, get) \
    fmi3Status getter( \
        fmi3Instance instance, const fmi3ValueReference references[], size_t n, c_type values[], size_t n_values) \
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
    }

#define FMI3_SET(setter, NAME, c_type, kind, set) \
    fmi3Status setter( \
        fmi3Instance instance, const fmi3ValueReference references[], size_t n, const c_type values[], \
        size_t n_values) \
    { \
        const char *type = hsep_fmi3_names()->types[kind]; \
        hsep_instance *self = \
            hsep_call_access(instance, HSEP_FMI3(SET_##NAME), 1, type, references, n, values, n_values); \
        for (size_t i = 0; self != NULL && i < n; i++) { \
            const c_type number = values[i]; \
            self = hsep_call_tune(self, HSEP_FMI3(SET_##NAME), references[i], set); \
        } \
        for (size_t i = 0; self != NULL && i < n; i++) { \
            const c_type number = values[i]; \
            self->values[references[i]] = set; \
        } \
        return (self == NULL) ? fmi3Error : fmi3OK; \
    }

FMI3_GET(fmi3GetFloat64, FLOAT64, fmi3Float64, HSEP_REAL, number)
FMI3_SET(fmi3SetFloat64, FLOAT64, fmi3Float64, HSEP_REAL, number)
FMI3_GET(fmi3GetInt32, INT32, fmi3Int32, HSEP_INTEGER, hsep_values_integer(number))
FMI3_SET(fmi3SetInt32, INT32, fmi3Int32, HSEP_INTEGER, (double)number)
FMI3_GET(fmi3GetInt64, INT64, fmi3Int64, HSEP_ENUMERATION, hsep_values_integer(number))
FMI3_SET(fmi3SetInt64, INT64, fmi3Int64, HSEP_ENUMERATION, (double)number)
FMI3_GET(fmi3GetBoolean, BOOLEAN, fmi3Boolean, HSEP_BOOLEAN, number != 0.0)
FMI3_SET(fmi3SetBoolean, BOOLEAN, fmi3Boolean, HSEP_BOOLEAN, number ? 1.0 : 0.0)
FMI3_GET(fmi3GetUInt64, UINT64, fmi3UInt64, HSEP_COUNT, (fmi3UInt64)number)

/* Np alone is of this type: arrays take their new size at once, in Configuration Mode, or as soon as the instance is
 * there, for importers that know no Configuration Mode. */
fmi3Status fmi3SetUInt64(
    fmi3Instance instance, const fmi3ValueReference references[], size_t n, const fmi3UInt64 values[], size_t n_values)
{
    const hsep_call *call = HSEP_FMI3(SET_UINT64);
    char message[HSEP_MESSAGE_SIZE] = "";
    hsep_instance *self =
        hsep_call_access(instance, call, 1, hsep_fmi3_names()->types[HSEP_COUNT], references, n, values, n_values);
    for (size_t i = 0; self != NULL && i < n; i++) {
        self = hsep_call_tune(self, call, references[i], (double)values[i]);
    }
    if (self != NULL && n > 0 && hsep_instance_resize(self, call->name, (size_t)values[n - 1], message) != HSEP_OK) {
        return hsep_fmi3_status(hsep_refuse(self, "%s", message));
    }
    return (self == NULL) ? fmi3Error : fmi3OK;
}

/* Access to types that no variable has: with references, it is refused by name. */
static fmi3Status fmi3_none(
    fmi3Instance instance, const hsep_call *call, int sets, const char *type, const fmi3ValueReference references[],
    size_t n, const void *values, size_t n_values)
{
    const hsep_instance *self = hsep_call_access(instance, call, sets, type, references, n, values, n_values);
    return (self == NULL) ? fmi3Error : fmi3OK;
}

#define FMI3_NO_VARIABLE(function, call, sets, type, ...) \
    fmi3Status function( \
        fmi3Instance instance, const fmi3ValueReference references[], size_t n, __VA_ARGS__ values[], size_t n_values) \
    { \
        return fmi3_none(instance, HSEP_FMI3(call), sets, type, references, n, values, n_values); \
    }

#define FMI3_NO_VARIABLES(getter, setter, NAME, type, c_type) \
    FMI3_NO_VARIABLE(getter, GET_##NAME, 0, type, c_type) \
    FMI3_NO_VARIABLE(setter, SET_##NAME, 1, type, const c_type)

FMI3_NO_VARIABLES(fmi3GetFloat32, fmi3SetFloat32, FLOAT32, "Float32", fmi3Float32)
FMI3_NO_VARIABLES(fmi3GetInt8, fmi3SetInt8, INT8, "Int8", fmi3Int8)
FMI3_NO_VARIABLES(fmi3GetUInt8, fmi3SetUInt8, UINT8, "UInt8", fmi3UInt8)
FMI3_NO_VARIABLES(fmi3GetInt16, fmi3SetInt16, INT16, "Int16", fmi3Int16)
FMI3_NO_VARIABLES(fmi3GetUInt16, fmi3SetUInt16, UINT16, "UInt16", fmi3UInt16)
FMI3_NO_VARIABLES(fmi3GetUInt32, fmi3SetUInt32, UINT32, "UInt32", fmi3UInt32)
FMI3_NO_VARIABLES(fmi3GetString, fmi3SetString, STRING, "String", fmi3String)

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
