/* FMI 2.0 instance, its log categories and messages. */
#ifndef HSEP_FMI2_INSTANCE_H
#define HSEP_FMI2_INSTANCE_H

#include "hsep_api.h"
#include "hsep_fmi2_calls.h"
#include "hsep_fmu.h" /* before the importer's header: it names FMI2_FUNCTION_PREFIX */
#include "hsep_instance.h"

#include "fmi2Functions.h"

#include <stddef.h>

/* The log categories of modelDescription.xml, one bit each. */
typedef enum {
    HSEP_LOG_WARNING = 1,
    HSEP_LOG_DISCARD = 2,
    HSEP_LOG_ERROR = 4,
    HSEP_LOG_FATAL = 8,
    HSEP_LOG_ALL = 16 /* what is neither of the above */
} hsep_category;

/* What an fmi2Component points to; a pointer to its first member is one to it. */
typedef struct {
    hsep_instance instance;
    fmi2CallbackLogger logger; /* may be NULL */
    fmi2ComponentEnvironment environment;
    unsigned categories; /* bits of hsep_category that reach the logger */
    int warned;          /* whether the model has warned of a step */
} hsep_component;

/* The instance if the call is legal now; otherwise NULL, and why not is logged. */
HSEP_API hsep_instance *hsep_begin(fmi2Component component, hsep_call call);

/* Hand a message, formatted as printf does, to the importer's logger if its category is on. */
HSEP_API void hsep_log(hsep_instance *instance, hsep_category category, const char *format, ...);

/* Log an error and return fmi2Error. */
HSEP_API fmi2Status hsep_refuse(hsep_instance *instance, const char *format, ...);

#endif
