/* Reading and writing variables. A call is checked as a whole first: if one variable is refused, none is touched. */
#include "hsep_fmi3_calls.h"

#define FMI3_GET(getter, c_type, get) \
    fmi3Status getter( \
        fmi3Instance instance, const fmi3ValueReference references[], size_t n, c_type values[], size_t n_values) \
    { \
        HSEP_GET(instance, &hsep_fmi3_calls[HSEP_FMI3_##getter], references, n, values, n_values, get) \
        return (self == NULL) ? fmi3Error : fmi3OK; \
    }

#define FMI3_SET(setter, c_type, set) \
    fmi3Status setter( \
        fmi3Instance instance, const fmi3ValueReference references[], size_t n, const c_type values[], \
        size_t n_values) \
    { \
        HSEP_SET(instance, &hsep_fmi3_calls[HSEP_FMI3_##setter], references, n, values, n_values, c_type, set) \
        return (self == NULL) ? fmi3Error : fmi3OK; \
    }

FMI3_GET(fmi3GetFloat64, fmi3Float64, number)
FMI3_SET(fmi3SetFloat64, fmi3Float64, number)
FMI3_GET(fmi3GetInt32, fmi3Int32, hsep_values_integer(number))
FMI3_SET(fmi3SetInt32, fmi3Int32, (double)number)
FMI3_GET(fmi3GetInt64, fmi3Int64, hsep_values_integer(number))
FMI3_SET(fmi3SetInt64, fmi3Int64, (double)number)
FMI3_GET(fmi3GetBoolean, fmi3Boolean, number != 0.0)
FMI3_SET(fmi3SetBoolean, fmi3Boolean, number ? 1.0 : 0.0)
FMI3_GET(fmi3GetUInt64, fmi3UInt64, (fmi3UInt64)number)

/* Np alone is of this type: arrays take their new size at once, in Configuration Mode, or as soon as the instance is
 * there, for importers that know no Configuration Mode. */
fmi3Status fmi3SetUInt64(
    fmi3Instance instance, const fmi3ValueReference references[], size_t n, const fmi3UInt64 values[], size_t n_values)
{
    const hsep_call *call = HSEP_FMI3(fmi3SetUInt64);
    char message[HSEP_MESSAGE_SIZE] = "";
    hsep_instance *self = hsep_call_access(instance, call, references, n, values, n_values);
    for (size_t i = 0; self != NULL && i < n; i++) {
        self = hsep_call_tune(self, call, references[i], (double)values[i]);
    }
    if (self != NULL && n > 0 && hsep_instance_resize(self, call->name, (size_t)values[n - 1], message) != HSEP_OK) {
        return fmi3_status(hsep_refuse(self, "%s", message));
    }
    return (self == NULL) ? fmi3Error : fmi3OK;
}

/* Access to types that no variable has: with references, it is refused by name. */
#define FMI3_NO_VARIABLE(function, c_type) \
    fmi3Status function( \
        fmi3Instance instance, const fmi3ValueReference references[], size_t n, c_type values[], size_t n_values) \
    { \
        const hsep_call *call = &hsep_fmi3_calls[HSEP_FMI3_##function]; \
        return hsep_call_access(instance, call, references, n, values, n_values) == NULL ? fmi3Error : fmi3OK; \
    }

FMI3_NO_VARIABLE(fmi3GetFloat32, fmi3Float32)
FMI3_NO_VARIABLE(fmi3SetFloat32, const fmi3Float32)
FMI3_NO_VARIABLE(fmi3GetInt8, fmi3Int8)
FMI3_NO_VARIABLE(fmi3SetInt8, const fmi3Int8)
FMI3_NO_VARIABLE(fmi3GetUInt8, fmi3UInt8)
FMI3_NO_VARIABLE(fmi3SetUInt8, const fmi3UInt8)
FMI3_NO_VARIABLE(fmi3GetInt16, fmi3Int16)
FMI3_NO_VARIABLE(fmi3SetInt16, const fmi3Int16)
FMI3_NO_VARIABLE(fmi3GetUInt16, fmi3UInt16)
FMI3_NO_VARIABLE(fmi3SetUInt16, const fmi3UInt16)
FMI3_NO_VARIABLE(fmi3GetUInt32, fmi3UInt32)
FMI3_NO_VARIABLE(fmi3SetUInt32, const fmi3UInt32)
FMI3_NO_VARIABLE(fmi3GetString, fmi3String)
FMI3_NO_VARIABLE(fmi3SetString, const fmi3String)

fmi3Status fmi3GetBinary(
    fmi3Instance instance, const fmi3ValueReference references[], size_t n, size_t sizes[], fmi3Binary values[],
    size_t n_values)
{
    const hsep_call *call = HSEP_FMI3(fmi3GetBinary);
    (void)sizes;
    return hsep_call_access(instance, call, references, n, values, n_values) == NULL ? fmi3Error : fmi3OK;
}

fmi3Status fmi3SetBinary(
    fmi3Instance instance, const fmi3ValueReference references[], size_t n, const size_t sizes[],
    const fmi3Binary values[], size_t n_values)
{
    const hsep_call *call = HSEP_FMI3(fmi3SetBinary);
    (void)sizes;
    return hsep_call_access(instance, call, references, n, values, n_values) == NULL ? fmi3Error : fmi3OK;
}
