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

/* Do a communication step from t by h, s; the model's warning is logged once an instance, not at each of many steps. */
HSEP_API hsep_status hsep_call_step(void *component, const hsep_call *call, double t, double h);

/* As after the instantiation. */
HSEP_API hsep_status hsep_call_reset(void *component, const hsep_call *call);

/* The instance if variables may be read, or set; otherwise NULL. The call's name goes into access. */
HSEP_API hsep_instance *hsep_call_get(void *component, const hsep_call *call, hsep_access access);
HSEP_API hsep_instance *hsep_call_set(void *component, const hsep_call *call, hsep_access access);

/* Saved states: a handle is a pointer to one, or NULL. */
HSEP_API hsep_status hsep_call_save(void *component, const hsep_call *call, void **state);
HSEP_API hsep_status hsep_call_restore(void *component, const hsep_call *call, void *state);
HSEP_API hsep_status hsep_call_free_state(void *component, const hsep_call *call, void **state);
HSEP_API hsep_status hsep_call_state_size(void *component, const hsep_call *call, void *state, size_t *size);
HSEP_API hsep_status hsep_call_serialise(void *component, const hsep_call *call, void *state, void *bytes, size_t size);
HSEP_API hsep_status
hsep_call_deserialise(void *component, const hsep_call *call, const void *bytes, size_t size, void **state);

#endif
