/* What an importer's handle points to in any version of FMI: an instance, its log, and the calls that are legal now.
 *
 * Steps are done when the call returns, so no version's states of a step in progress occur. A call that is refused
 * changes nothing, not even the state of the instance: the importer may free, reset or restore it, as the standard
 * asks, and may also correct what was wrong and call again.
 * One thing more than the standard: values may be read before the initialization; they are the start values then.
 */
#ifndef HSEP_COMPONENT_H
#define HSEP_COMPONENT_H

#include "hsep_api.h"
#include "hsep_instance.h"

#include <stddef.h>

/* The log categories of modelDescription.xml, one bit each. */
typedef enum {
    HSEP_LOG_WARNING = 1,
    HSEP_LOG_DISCARD = 2,
    HSEP_LOG_ERROR = 4,
    HSEP_LOG_FATAL = 8,
    HSEP_LOG_ALL = 16 /* what is neither of the above */
} hsep_category;

typedef struct hsep_component hsep_component;

/* Hands a message to the importer's logger, which is not NULL; the numbers of statuses are the same in all versions. */
typedef void (*hsep_hand)(const hsep_component *component, int status, const char *category, const char *text);

/* A pointer to its first member is one to it. */
struct hsep_component {
    hsep_instance instance;
    hsep_hand hand;
    void (*logger)(void); /* the importer's, of the type of the version; may be NULL */
    void *environment;
    unsigned categories; /* bits of hsep_category that reach the logger */
    unsigned warned;     /* bits of hsep_status: what the model has warned of in steps */
};

/* A call that belongs to an instance, and the bits of the phases in which it is legal. */
typedef struct {
    const char *name;
    unsigned legal;
} hsep_call;

/* The phases, short, for the columns of a table of calls. */
enum {
    HSEP_I = HSEP_INSTANTIATED,
    HSEP_C = HSEP_CONFIGURATION,
    HSEP_M = HSEP_INITIALIZATION,
    HSEP_S = HSEP_STEPPING,
    HSEP_T = HSEP_TERMINATED
};

/* Make an instance. filled: its words, memory functions, hand, logger and environment; token: must equal the token of
 * modelDescription.xml; resources: as hsep_open takes them. On refusal return NULL and log why. */
HSEP_API hsep_component *hsep_component_new(
    const hsep_component *filled, const char *name, const char *token, const char *resources, int logging_on);

/* The instance if the call is legal now; otherwise NULL, and why not is logged. */
HSEP_API hsep_instance *hsep_begin(void *component, const hsep_call *call);

/* Hand a message, formatted as printf does, to the importer's logger if its category is on. */
HSEP_API void hsep_log(hsep_instance *instance, hsep_category category, const char *format, ...);

/* Log an error and return HSEP_REFUSED. */
HSEP_API hsep_status hsep_refuse(hsep_instance *instance, const char *format, ...);

/* With names, these categories alone are switched on, or these off; a name that is not ours changes nothing. Without
 * names, on means everything and off the state after instantiation without logging: warnings and errors. */
HSEP_API hsep_status
hsep_call_logging(void *component, const hsep_call *call, int on, size_t n, const char *const names[]);

#endif
