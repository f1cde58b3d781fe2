/* The calls of any version of FMI: which are legal now, what they do, and the log.
 *
 * Steps are done when the call returns, so no version's states of a step in progress occur. A call that is refused
 * changes nothing, not even the state of the instance: it logs why, and the importer may free, reset or restore it, as
 * the standard asks, and may also correct what was wrong and call again.
 * One thing more than the standard: values may be read before the initialization; they are the start values then.
 */
#ifndef HSEP_CALLS_H
#define HSEP_CALLS_H

#include "hsep_instance.h"

/* The log categories of modelDescription.xml, one bit each. */
typedef enum {
    HSEP_LOG_WARNING = 1,
    HSEP_LOG_DISCARD = 2,
    HSEP_LOG_ERROR = 4,
    HSEP_LOG_FATAL = 8,
    HSEP_LOG_ALL = 16 /* what is neither of the above */
} hsep_category;

/* A call that belongs to an instance, and the bits of the phases in which it is legal. */
typedef struct {
    const char *name;
    unsigned legal;
} hsep_call;

/* HSEP_LEGAL defines a row as fmi2Reset_call; HSEP_CALL(fmi2, Reset) is its address. */
#define HSEP_LEGAL(function, legal) static const hsep_call function##_call = {#function, legal}
#define HSEP_CALL(v, function) (&v##function##_call)

/* The phases, short, for the columns of a table of calls. */
enum {
    HSEP_I = HSEP_INSTANTIATED,
    HSEP_C = HSEP_CONFIGURATION,
    HSEP_M = HSEP_INITIALIZATION,
    HSEP_S = HSEP_STEPPING,
    HSEP_T = HSEP_TERMINATED
};

/* Make an instance. filled: its names, memory functions, hand, logger and environment; token: must equal the token of
 * modelDescription.xml; resources: as hsep_open takes them. On refusal return NULL and log why. */
HSEP_API hsep_instance *hsep_call_instantiate(
    const hsep_instance *filled, const char *name, const char *token, const char *resources, int logging_on);

/* The instance if the call is legal now; otherwise NULL, and why not is logged. */
HSEP_API hsep_instance *hsep_instance_for(void *handle, const hsep_call *call);

/* Body of a version's function: it declares call and self, and does an action, a hsep_status, if the call is legal. */
#define HSEP_DO(v, function, handle, action) \
    const hsep_call *call = HSEP_CALL(v, function); \
    hsep_instance *self = hsep_instance_for(handle, call); \
    return self != NULL && (action) != HSEP_REFUSED ? v##OK : v##Error

/* Hand a message, formatted as printf does, to the importer's logger if its category is on. */
HSEP_API void hsep_log(const hsep_instance *instance, hsep_category category, const char *format, ...);

/* Log an error; the value is HSEP_REFUSED. */
#define hsep_refuse(instance, ...) (hsep_log(instance, HSEP_LOG_ERROR, __VA_ARGS__), (hsep_status)HSEP_REFUSED)

/* What calls do once they are legal.
 *
 * Logging: with names, only these categories are switched on, or these off; a name that is not ours changes nothing.
 * Without names, on means everything and off the state after instantiation without logging: warnings and errors. */
HSEP_API hsep_status
hsep_call_logging(hsep_instance *instance, const hsep_call *call, int on, size_t n, const char *const names[]);

/* Set the experiment, s. */
HSEP_API hsep_status hsep_call_experiment(
    hsep_instance *instance, const hsep_call *call, double start_time, int has_stop_time, double stop_time);

/* Move on to a phase that needs nothing else. */
HSEP_API hsep_status hsep_call_phase(hsep_instance *instance, hsep_phase phase);

/* End the initialization. */
HSEP_API hsep_status hsep_call_initialise(hsep_instance *instance, const hsep_call *call);

/* Do a communication step from t by h, s; each kind of the model's warnings is logged once an instance. */
HSEP_API hsep_status hsep_call_step(hsep_instance *instance, const hsep_call *call, double t, double h);

/* Saved states, hsep_saved.c: a handle is a pointer to one, or NULL. */
HSEP_API hsep_status hsep_call_save(hsep_instance *instance, const hsep_call *call, void **state);
HSEP_API hsep_status hsep_call_restore(hsep_instance *instance, const hsep_call *call, void *state);
HSEP_API hsep_status hsep_call_free_state(hsep_instance *instance, const hsep_call *call, void **state);
HSEP_API hsep_status hsep_call_state_size(hsep_instance *instance, const hsep_call *call, void *state, size_t *size);
HSEP_API hsep_status
hsep_call_serialise(hsep_instance *instance, const hsep_call *call, void *state, void *bytes, size_t size);
HSEP_API hsep_status
hsep_call_deserialise(hsep_instance *instance, const hsep_call *call, const void *bytes, size_t size, void **state);

/* What an importer gives to read or write variables by value reference. */
typedef struct {
    const char *call;
    const char *type; /* as the version's functions are called */
    int sets;         /* whether they have to be such as may be set now */
    const unsigned *references;
    size_t n_references;
    const void *values;
    size_t n_values;
} hsep_access;

/* Check that all references are of that type, with a place for each value: if one is refused, none is touched. */
HSEP_API hsep_status hsep_values_check(const hsep_instance *instance, const hsep_access *access);

/* Check that n variables may be read, or set, of a type, as the call's name says: fmi2GetReal. Inputs may be set at any
 * time, parameters until the initialization has ended, tunable ones later too. */
HSEP_API hsep_status hsep_call_access(
    hsep_instance *instance, const hsep_call *call, const unsigned references[], size_t n, const void *values,
    size_t n_values);

/* The values of a variable, and their number. */
HSEP_API const double *hsep_values_source(const hsep_instance *instance, unsigned reference, size_t *count);

/* Check that a variable may have a value: a parameter is checked when it is set in a run, one that sizes arrays always;
 * before a run the others when the initialization ends. */
HSEP_API hsep_status
hsep_call_tune(const hsep_instance *instance, const hsep_call *call, unsigned reference, double value);

/* A value as a whole number of 32 bits. */
HSEP_API int hsep_values_integer(double number);

/* Beginning of a version's function that gets or sets n variables: it declares call and self, or returns. */
#define HSEP_ACCESS_OR_RETURN(v, function, handle, references, n, values, n_values) \
    const hsep_call *call = HSEP_CALL(v, function); \
    hsep_instance *self = hsep_instance_for(handle, call); \
    if (self == NULL || hsep_call_access(self, call, references, n, values, n_values) != HSEP_OK) { \
        return v##Error; \
    }

/* Bodies of these functions. get: the function's value of a double, number; set: the double of its value, number. What
 * is set has one value for each reference, as no array is an input or a parameter; if one is refused, none is set. */
#define HSEP_GET(v, function, handle, references, n, to, n_values, get) \
    HSEP_ACCESS_OR_RETURN(v, function, handle, references, n, to, n_values) \
    for (size_t i = 0; i < n; i++) { \
        size_t count = 0; \
        const double *source = hsep_values_source(self, references[i], &count); \
        while (count-- > 0) { \
            const double number = *source++; \
            *to++ = get; \
        } \
    } \
    return v##OK

#define HSEP_SET(v, function, handle, references, n, from, n_values, type, set) \
    HSEP_ACCESS_OR_RETURN(v, function, handle, references, n, from, n_values) \
    for (size_t i = 0; i < n; i++) { \
        const type number = from[i]; \
        if (hsep_call_tune(self, call, references[i], set) != HSEP_OK) { \
            return v##Error; \
        } \
    } \
    for (size_t i = 0; i < n; i++) { \
        const type number = from[i]; \
        self->values[references[i]] = set; \
    } \
    return v##OK

/* A function of a version that does an action (HSEP_DO), with these parameters, of which c is the handle. */
#define HSEP_FUNCTION(v, function, action, ...) \
    v##Status v##function(__VA_ARGS__) { HSEP_DO(v, function, c, action); }

/* The functions of a version that others have by other names: of a handle's type, v##Handle, of a state's, v##State,
 * whose reading is spelt De (DeSerialize). */
#define HSEP_COMMON_FUNCTIONS(v, Handle, State, De) \
    void v##FreeInstance(v##Handle c) { hsep_instance_free(c); } \
    HSEP_FUNCTION( \
        v, SetDebugLogging, hsep_call_logging(self, call, on, n, categories), v##Handle c, v##Boolean on, size_t n, \
        const v##String categories[]) \
    HSEP_FUNCTION(v, ExitInitializationMode, hsep_call_initialise(self, call), v##Handle c) \
    HSEP_FUNCTION(v, Terminate, hsep_call_phase(self, HSEP_TERMINATED), v##Handle c) \
    HSEP_FUNCTION(v, Reset, (hsep_instance_reset(self), HSEP_OK), v##Handle c) \
    HSEP_FUNCTION(v, Get##State, hsep_call_save(self, call, state), v##Handle c, v##State *state) \
    HSEP_FUNCTION(v, Set##State, hsep_call_restore(self, call, state), v##Handle c, v##State state) \
    HSEP_FUNCTION(v, Free##State, hsep_call_free_state(self, call, state), v##Handle c, v##State *state) \
    HSEP_FUNCTION( \
        v, Serialized##State##Size, hsep_call_state_size(self, call, state, size), v##Handle c, v##State state, \
        size_t *size) \
    HSEP_FUNCTION( \
        v, Serialize##State, hsep_call_serialise(self, call, state, bytes, size), v##Handle c, v##State state, \
        v##Byte bytes[], size_t size) \
    HSEP_FUNCTION( \
        v, De##State, hsep_call_deserialise(self, call, bytes, size, state), v##Handle c, const v##Byte bytes[], \
        size_t size, v##State *state)

#endif
