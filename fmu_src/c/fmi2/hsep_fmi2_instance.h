/* One FMI 2.0 instance: its values, its state and how it speaks to the importer. */
#ifndef HSEP_FMI2_INSTANCE_H
#define HSEP_FMI2_INSTANCE_H

#include "hsep_api.h"
#include "hsep_fmi2_calls.h"
#include "hsep_fmu.h" /* before the importer's header: it names FMI2_FUNCTION_PREFIX */

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

/* The two of the importer's memory functions, or the C library's. */
typedef void *(*hsep_allocate)(size_t count, size_t size);
typedef void (*hsep_release)(void *block);

typedef struct {
    fmi2CallbackLogger logger; /* may be NULL */
    fmi2ComponentEnvironment environment;
    hsep_allocate allocate;
    hsep_release release;
    char *name;          /* NULL until it is known */
    char *resources;     /* NULL if there is no usable folder */
    unsigned categories; /* bits of hsep_category that reach the logger */
    hsep_phase phase;
    hsep_context context;
    int has_stop_time;
    double start_time; /* s */
    double stop_time;  /* s */
    double time;       /* s, where the last step ended */
    void *state;       /* the model's, NULL before the initialization has ended */
    size_t state_size;
    int warned;                   /* whether the model has warned of a step */
    double values[HSEP_N_VALUES]; /* by value reference, then the time derivatives of inputs */
} hsep_instance;

/* The instance if the call is legal now; otherwise NULL, and why not is logged. */
HSEP_API hsep_instance *hsep_begin(fmi2Component component, hsep_call call);

/* Hand a message, formatted as printf does, to the importer's logger if its category is on. */
HSEP_API void hsep_log(hsep_instance *instance, hsep_category category, const char *format, ...);

/* Log an error and return fmi2Error. */
HSEP_API fmi2Status hsep_refuse(hsep_instance *instance, const char *format, ...);

/* A zeroed block from the importer's memory; NULL if there is none left. */
HSEP_API void *hsep_new(const hsep_instance *instance, size_t size);

/* Give a block back; NULL is fine. */
HSEP_API void hsep_delete(const hsep_instance *instance, void *block);

/* Forget the model's state. */
HSEP_API void hsep_drop_state(hsep_instance *instance);

#endif
