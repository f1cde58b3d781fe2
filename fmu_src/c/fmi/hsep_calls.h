/* Calls that every version of FMI has, by other names: each checks that it is legal now, and if it fails logs why,
 * changes nothing and returns HSEP_REFUSED; otherwise HSEP_OK. */
#ifndef HSEP_CALLS_H
#define HSEP_CALLS_H

#include "hsep_api.h"
#include "hsep_component.h"
#include "hsep_values.h"

#include <stddef.h>

/* Set the experiment, s. */
HSEP_API hsep_status
hsep_call_experiment(void *component, const hsep_call *call, double start_time, int has_stop_time, double stop_time);

/* Move on to a phase that needs nothing else. */
HSEP_API hsep_status hsep_call_phase(void *component, const hsep_call *call, hsep_phase phase);

/* End the initialization. */
HSEP_API hsep_status hsep_call_initialise(void *component, const hsep_call *call);

/* Do a communication step from t by h, s; the model's warnings are logged once an instance, each kind, not at every
 * step. */
HSEP_API hsep_status hsep_call_step(void *component, const hsep_call *call, double t, double h);

/* As after the instantiation. */
HSEP_API hsep_status hsep_call_reset(void *component, const hsep_call *call);

/* The instance if n variables of a type may be read, or set; otherwise NULL. */
HSEP_API hsep_instance *hsep_call_access(
    void *component, const hsep_call *call, int sets, const char *type, const unsigned references[], size_t n,
    const void *values, size_t n_values);

/* The instance if a variable may have a value: a parameter is checked when it is set in a run, one that sizes arrays
 * always; before a run the others when the initialization ends. Otherwise NULL. */
HSEP_API hsep_instance *hsep_call_tune(
    hsep_instance *instance, const hsep_call *call, unsigned reference, double value);

/* Saved states: a handle is a pointer to one, or NULL. */
HSEP_API hsep_status hsep_call_save(void *component, const hsep_call *call, void **state);
HSEP_API hsep_status hsep_call_restore(void *component, const hsep_call *call, void *state);
HSEP_API hsep_status hsep_call_free_state(void *component, const hsep_call *call, void **state);
HSEP_API hsep_status hsep_call_state_size(void *component, const hsep_call *call, void *state, size_t *size);
HSEP_API hsep_status hsep_call_serialise(void *component, const hsep_call *call, void *state, void *bytes, size_t size);
HSEP_API hsep_status
hsep_call_deserialise(void *component, const hsep_call *call, const void *bytes, size_t size, void **state);

/* The functions of a version, v (fmi2), that others have by other names: of a handle's type, v##Handle, of a state's,
 * v##State, whose reading is spelt De (DeSerialize). CALL: what the version's table has of a call. */
#define HSEP_COMMON_FUNCTIONS(v, Handle, State, De, CALL) \
    void v##FreeInstance(v##Handle c) \
    { \
        if (c != NULL) { \
            hsep_instance_free(c); \
        } \
    } \
    v##Status v##SetDebugLogging(v##Handle c, v##Boolean on, size_t n, const v##String categories[]) \
    { \
        return hsep_##v##_status(hsep_call_logging(c, CALL(SET_DEBUG_LOGGING), on, n, categories)); \
    } \
    v##Status v##ExitInitializationMode(v##Handle c) \
    { \
        return hsep_##v##_status(hsep_call_initialise(c, CALL(EXIT_INITIALIZATION_MODE))); \
    } \
    v##Status v##Terminate(v##Handle c) \
    { \
        return hsep_##v##_status(hsep_call_phase(c, CALL(TERMINATE), HSEP_TERMINATED)); \
    } \
    v##Status v##Reset(v##Handle c) { return hsep_##v##_status(hsep_call_reset(c, CALL(RESET))); } \
    v##Status v##Get##State(v##Handle c, v##State *state) \
    { \
        return hsep_##v##_status(hsep_call_save(c, CALL(GET_FMU_STATE), state)); \
    } \
    v##Status v##Set##State(v##Handle c, v##State state) \
    { \
        return hsep_##v##_status(hsep_call_restore(c, CALL(SET_FMU_STATE), state)); \
    } \
    v##Status v##Free##State(v##Handle c, v##State *state) \
    { \
        return hsep_##v##_status(hsep_call_free_state(c, CALL(FREE_FMU_STATE), state)); \
    } \
    v##Status v##Serialized##State##Size(v##Handle c, v##State state, size_t *size) \
    { \
        return hsep_##v##_status(hsep_call_state_size(c, CALL(SERIALIZED_FMU_STATE_SIZE), state, size)); \
    } \
    v##Status v##Serialize##State(v##Handle c, v##State state, v##Byte bytes[], size_t size) \
    { \
        return hsep_##v##_status(hsep_call_serialise(c, CALL(SERIALIZE_FMU_STATE), state, bytes, size)); \
    } \
    v##Status v##De##State(v##Handle c, const v##Byte bytes[], size_t size, v##State *state) \
    { \
        return hsep_##v##_status(hsep_call_deserialise(c, CALL(DESERIALIZE_FMU_STATE), bytes, size, state)); \
    }

#endif
