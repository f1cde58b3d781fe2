/* Legal FMI 2.0 calls in each state of an instance: the standard's table of the co-simulation state machine.
 *
 * Steps are done when fmi2DoStep returns, so the standard's stepInProgress and stepCanceled never occur. A call that is
 * refused (fmi2Error) changes nothing, not even the state of the instance: the importer may free, reset or restore it,
 * as the standard asks, and may also correct what was wrong and call again.
 * One thing more than the standard: values may be read before the initialization; they are the start values then.
 */
#ifndef HSEP_FMI2_CALLS_H
#define HSEP_FMI2_CALLS_H

#include "hsep_instance.h"

/* The states, short, for the columns of the table below. */
enum { HSEP_I = HSEP_INSTANTIATED, HSEP_M = HSEP_INITIALIZATION, HSEP_S = HSEP_STEPPING, HSEP_T = HSEP_TERMINATED };

/* The calls that belong to an instance. */
typedef enum {
    HSEP_CALL_SET_DEBUG_LOGGING,
    HSEP_CALL_SETUP_EXPERIMENT,
    HSEP_CALL_ENTER_INITIALIZATION_MODE,
    HSEP_CALL_EXIT_INITIALIZATION_MODE,
    HSEP_CALL_TERMINATE,
    HSEP_CALL_RESET,
    HSEP_CALL_GET_REAL,
    HSEP_CALL_GET_INTEGER,
    HSEP_CALL_GET_BOOLEAN,
    HSEP_CALL_GET_STRING,
    HSEP_CALL_SET_REAL,
    HSEP_CALL_SET_INTEGER,
    HSEP_CALL_SET_BOOLEAN,
    HSEP_CALL_SET_STRING,
    HSEP_CALL_GET_FMU_STATE,
    HSEP_CALL_SET_FMU_STATE,
    HSEP_CALL_FREE_FMU_STATE,
    HSEP_CALL_SERIALIZED_FMU_STATE_SIZE,
    HSEP_CALL_SERIALIZE_FMU_STATE,
    HSEP_CALL_DESERIALIZE_FMU_STATE,
    HSEP_CALL_GET_DIRECTIONAL_DERIVATIVE,
    HSEP_CALL_SET_REAL_INPUT_DERIVATIVES,
    HSEP_CALL_GET_REAL_OUTPUT_DERIVATIVES,
    HSEP_CALL_DO_STEP,
    HSEP_CALL_CANCEL_STEP,
    HSEP_CALL_GET_STATUS,
    HSEP_CALL_GET_REAL_STATUS,
    HSEP_CALL_GET_INTEGER_STATUS,
    HSEP_CALL_GET_BOOLEAN_STATUS,
    HSEP_CALL_GET_STRING_STATUS
} hsep_call;

typedef struct {
    const char *name;
    unsigned legal;
} hsep_call_row;

/* clang-format off */
static const hsep_call_row hsep_calls[] = {
    /* I: instantiated, M: Initialization Mode, S: stepping, T: terminated */
    [HSEP_CALL_SET_DEBUG_LOGGING] = {"fmi2SetDebugLogging",                 HSEP_I | HSEP_M | HSEP_S | HSEP_T},
    [HSEP_CALL_SETUP_EXPERIMENT] = {"fmi2SetupExperiment",                  HSEP_I},
    [HSEP_CALL_ENTER_INITIALIZATION_MODE] = {"fmi2EnterInitializationMode", HSEP_I},
    [HSEP_CALL_EXIT_INITIALIZATION_MODE] = {"fmi2ExitInitializationMode",            HSEP_M},
    [HSEP_CALL_TERMINATE] = {"fmi2Terminate",                                                 HSEP_S},
    [HSEP_CALL_RESET] = {"fmi2Reset",                                       HSEP_I | HSEP_M | HSEP_S | HSEP_T},
    [HSEP_CALL_GET_REAL] = {"fmi2GetReal",                                  HSEP_I | HSEP_M | HSEP_S | HSEP_T},
    [HSEP_CALL_GET_INTEGER] = {"fmi2GetInteger",                            HSEP_I | HSEP_M | HSEP_S | HSEP_T},
    [HSEP_CALL_GET_BOOLEAN] = {"fmi2GetBoolean",                            HSEP_I | HSEP_M | HSEP_S | HSEP_T},
    [HSEP_CALL_GET_STRING] = {"fmi2GetString",                              HSEP_I | HSEP_M | HSEP_S | HSEP_T},
    [HSEP_CALL_SET_REAL] = {"fmi2SetReal",                                  HSEP_I | HSEP_M | HSEP_S},
    [HSEP_CALL_SET_INTEGER] = {"fmi2SetInteger",                            HSEP_I | HSEP_M | HSEP_S},
    [HSEP_CALL_SET_BOOLEAN] = {"fmi2SetBoolean",                            HSEP_I | HSEP_M | HSEP_S},
    [HSEP_CALL_SET_STRING] = {"fmi2SetString",                              HSEP_I | HSEP_M | HSEP_S},
    [HSEP_CALL_GET_FMU_STATE] = {"fmi2GetFMUstate",                         HSEP_I | HSEP_M | HSEP_S | HSEP_T},
    [HSEP_CALL_SET_FMU_STATE] = {"fmi2SetFMUstate",                         HSEP_I | HSEP_M | HSEP_S | HSEP_T},
    [HSEP_CALL_FREE_FMU_STATE] = {"fmi2FreeFMUstate",                       HSEP_I | HSEP_M | HSEP_S | HSEP_T},
    [HSEP_CALL_SERIALIZED_FMU_STATE_SIZE] = {"fmi2SerializedFMUstateSize",  HSEP_I | HSEP_M | HSEP_S | HSEP_T},
    [HSEP_CALL_SERIALIZE_FMU_STATE] = {"fmi2SerializeFMUstate",             HSEP_I | HSEP_M | HSEP_S | HSEP_T},
    [HSEP_CALL_DESERIALIZE_FMU_STATE] = {"fmi2DeSerializeFMUstate",         HSEP_I | HSEP_M | HSEP_S | HSEP_T},
    [HSEP_CALL_GET_DIRECTIONAL_DERIVATIVE] = {"fmi2GetDirectionalDerivative",         HSEP_M | HSEP_S | HSEP_T},
    [HSEP_CALL_SET_REAL_INPUT_DERIVATIVES] = {"fmi2SetRealInputDerivatives",HSEP_I | HSEP_M | HSEP_S},
    [HSEP_CALL_GET_REAL_OUTPUT_DERIVATIVES] = {"fmi2GetRealOutputDerivatives",                  HSEP_S | HSEP_T},
    [HSEP_CALL_DO_STEP] = {"fmi2DoStep",                                                      HSEP_S},
    [HSEP_CALL_CANCEL_STEP] = {"fmi2CancelStep",                            0},
    [HSEP_CALL_GET_STATUS] = {"fmi2GetStatus",                                                HSEP_S | HSEP_T},
    [HSEP_CALL_GET_REAL_STATUS] = {"fmi2GetRealStatus",                                       HSEP_S | HSEP_T},
    [HSEP_CALL_GET_INTEGER_STATUS] = {"fmi2GetIntegerStatus",                                 HSEP_S | HSEP_T},
    [HSEP_CALL_GET_BOOLEAN_STATUS] = {"fmi2GetBooleanStatus",                                 HSEP_S | HSEP_T},
    [HSEP_CALL_GET_STRING_STATUS] = {"fmi2GetStringStatus",                                   HSEP_S | HSEP_T}
};
/* clang-format on */

#endif
