/* Reading and writing variables. A call is checked as a whole first: if one variable is refused, none is touched. */
#include "hsep_fmi3_calls.h"

#define FMI3_GET(type, get) \
    fmi3Status fmi3Get##type( \
        fmi3Instance instance, const fmi3ValueReference references[], size_t n, fmi3##type values[], size_t n_values) \
    { \
        HSEP_GET(instance, &hsep_fmi3_calls[HSEP_FMI3_fmi3Get##type], references, n, values, n_values, get) \
        return (self == NULL) ? fmi3Error : fmi3OK; \
    }

#define FMI3_ACCESS(type, get, set) \
    FMI3_GET(type, get) \
    fmi3Status fmi3Set##type( \
        fmi3Instance instance, const fmi3ValueReference references[], size_t n, const fmi3##type values[], \
        size_t n_values) \
    { \
        const hsep_call *call = &hsep_fmi3_calls[HSEP_FMI3_fmi3Set##type]; \
        HSEP_SET(instance, call, references, n, values, n_values, fmi3##type, set) \
        return (self == NULL) ? fmi3Error : fmi3OK; \
    }

FMI3_ACCESS(Float64, number, number)
FMI3_ACCESS(Int32, hsep_values_integer(number), (double)number)
FMI3_ACCESS(Int64, hsep_values_integer(number), (double)number)
FMI3_ACCESS(Boolean, number != 0.0, number ? 1.0 : 0.0)
FMI3_GET(UInt64, (fmi3UInt64)number)

/* Only Np is of this type: arrays take their new size at once, in Configuration Mode, or as soon as the instance is
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
#define FMI3_REFUSED(function, c_type) \
    fmi3Status fmi3##function( \
        fmi3Instance instance, const fmi3ValueReference references[], size_t n, c_type values[], size_t n_values) \
    { \
        const hsep_call *call = &hsep_fmi3_calls[HSEP_FMI3_fmi3##function]; \
        return hsep_call_access(instance, call, references, n, values, n_values) == NULL ? fmi3Error : fmi3OK; \
    }
#define FMI3_NO_VARIABLE(type) \
    FMI3_REFUSED(Get##type, fmi3##type) \
    FMI3_REFUSED(Set##type, const fmi3##type)

FMI3_NO_VARIABLE(Float32)
FMI3_NO_VARIABLE(Int8)
FMI3_NO_VARIABLE(UInt8)
FMI3_NO_VARIABLE(Int16)
FMI3_NO_VARIABLE(UInt16)
FMI3_NO_VARIABLE(UInt32)
FMI3_NO_VARIABLE(String)

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
