/* Saving, restoring and serialising an instance. */
#include "hsep_fmi2_instance.h"

#include "hsep_saved.h"

/* The instance if the call is legal and the handle is a saved state, which goes to *saved; otherwise NULL, with a
 * message. */
static hsep_instance *hsep_begin_saved(fmi2Component c, hsep_call call, fmi2FMUstate state, hsep_saved **saved)
{
    hsep_instance *instance = hsep_begin(c, call);
    *saved = state;
    if (instance != NULL && state == NULL) {
        (void)hsep_refuse(instance, "%s: FMUstate is NULL", hsep_calls[call].name);
        return NULL;
    }
    if (instance != NULL && !hsep_is_saved(*saved)) {
        (void)hsep_refuse(instance, "%s: FMUstate is no state of this FMU", hsep_calls[call].name);
        return NULL;
    }
    return instance;
}

/* The same where a place for a handle is given, which may hold none. */
static hsep_instance *hsep_begin_place(fmi2Component c, hsep_call call, fmi2FMUstate *place, hsep_saved **saved)
{
    *saved = NULL;
    return place != NULL && *place != NULL ? hsep_begin_saved(c, call, *place, saved) : hsep_begin(c, call);
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    char message[HSEP_MESSAGE_SIZE] = "";
    hsep_saved *saved;
    hsep_instance *instance = hsep_begin_place(c, HSEP_CALL_GET_FMU_STATE, FMUstate, &saved);
    if (instance == NULL) {
        return fmi2Error;
    }
    if (FMUstate == NULL) {
        return hsep_refuse(instance, "fmi2GetFMUstate: FMUstate is NULL");
    }
    if (hsep_save(instance, &saved, message) != HSEP_OK) {
        return hsep_refuse(instance, "fmi2GetFMUstate: %s", message);
    }
    *FMUstate = saved;
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate)
{
    char message[HSEP_MESSAGE_SIZE] = "";
    hsep_saved *saved;
    hsep_instance *instance = hsep_begin_saved(c, HSEP_CALL_SET_FMU_STATE, FMUstate, &saved);
    if (instance == NULL) {
        return fmi2Error;
    }
    if (hsep_restore(instance, saved, message) != HSEP_OK) {
        return hsep_refuse(instance, "fmi2SetFMUstate: %s", message);
    }
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    hsep_saved *saved;
    if (hsep_begin_place(c, HSEP_CALL_FREE_FMU_STATE, FMUstate, &saved) == NULL) {
        return fmi2Error;
    }
    if (saved != NULL) { /* the standard: freeing nothing is fine */
        hsep_free_saved(saved);
        *FMUstate = NULL;
    }
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size)
{
    hsep_saved *saved;
    hsep_instance *instance = hsep_begin_saved(c, HSEP_CALL_SERIALIZED_FMU_STATE_SIZE, FMUstate, &saved);
    if (instance == NULL) {
        return fmi2Error;
    }
    if (size == NULL) {
        return hsep_refuse(instance, "fmi2SerializedFMUstateSize: size is NULL");
    }
    *size = hsep_saved_size(saved);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[], size_t size)
{
    hsep_saved *saved;
    hsep_instance *instance = hsep_begin_saved(c, HSEP_CALL_SERIALIZE_FMU_STATE, FMUstate, &saved);
    if (instance == NULL) {
        return fmi2Error;
    }
    if (serializedState == NULL || size < hsep_saved_size(saved)) {
        return hsep_refuse(
            instance, "fmi2SerializeFMUstate: serializedState must have room for %lu bytes, got %lu%s",
            (unsigned long)hsep_saved_size(saved), (unsigned long)size, serializedState == NULL ? " and NULL" : "");
    }
    hsep_serialise(saved, serializedState);
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(
    fmi2Component c, const fmi2Byte serializedState[], size_t size, fmi2FMUstate *FMUstate)
{
    char message[HSEP_MESSAGE_SIZE] = "";
    hsep_saved *saved;
    hsep_instance *instance = hsep_begin_place(c, HSEP_CALL_DESERIALIZE_FMU_STATE, FMUstate, &saved);
    if (instance == NULL) {
        return fmi2Error;
    }
    if (serializedState == NULL || FMUstate == NULL) {
        return hsep_refuse(
            instance, "fmi2DeSerializeFMUstate: %s is NULL", serializedState == NULL ? "serializedState" : "FMUstate");
    }
    if (hsep_deserialise(instance, serializedState, size, &saved, message) != HSEP_OK) {
        return hsep_refuse(instance, "fmi2DeSerializeFMUstate: %s", message);
    }
    *FMUstate = saved;
    return fmi2OK;
}
