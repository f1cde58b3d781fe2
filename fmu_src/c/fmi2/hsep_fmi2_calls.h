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

/* The calls that belong to an instance: CALL(constant, name, states in which it is legal).
 * I: instantiated, M: Initialization Mode, S: stepping, T: terminated */
/* clang-format off */
#define HSEP_CALLS(CALL) \
    CALL(SET_DEBUG_LOGGING,           "fmi2SetDebugLogging",          HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(SETUP_EXPERIMENT,            "fmi2SetupExperiment",          HSEP_I) \
    CALL(ENTER_INITIALIZATION_MODE,   "fmi2EnterInitializationMode",  HSEP_I) \
    CALL(EXIT_INITIALIZATION_MODE,    "fmi2ExitInitializationMode",            HSEP_M) \
    CALL(TERMINATE,                   "fmi2Terminate",                                  HSEP_S) \
    CALL(RESET,                       "fmi2Reset",                    HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(GET_REAL,                    "fmi2GetReal",                  HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(GET_INTEGER,                 "fmi2GetInteger",               HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(GET_BOOLEAN,                 "fmi2GetBoolean",               HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(GET_STRING,                  "fmi2GetString",                HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(SET_REAL,                    "fmi2SetReal",                  HSEP_I | HSEP_M | HSEP_S) \
    CALL(SET_INTEGER,                 "fmi2SetInteger",               HSEP_I | HSEP_M | HSEP_S) \
    CALL(SET_BOOLEAN,                 "fmi2SetBoolean",               HSEP_I | HSEP_M | HSEP_S) \
    CALL(SET_STRING,                  "fmi2SetString",                HSEP_I | HSEP_M | HSEP_S) \
    CALL(GET_FMU_STATE,               "fmi2GetFMUstate",              HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(SET_FMU_STATE,               "fmi2SetFMUstate",              HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(FREE_FMU_STATE,              "fmi2FreeFMUstate",             HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(SERIALIZED_FMU_STATE_SIZE,   "fmi2SerializedFMUstateSize",   HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(SERIALIZE_FMU_STATE,         "fmi2SerializeFMUstate",        HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(DESERIALIZE_FMU_STATE,       "fmi2DeSerializeFMUstate",      HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(GET_DIRECTIONAL_DERIVATIVE,  "fmi2GetDirectionalDerivative",          HSEP_M | HSEP_S | HSEP_T) \
    CALL(SET_REAL_INPUT_DERIVATIVES,  "fmi2SetRealInputDerivatives",  HSEP_I | HSEP_M | HSEP_S) \
    CALL(GET_REAL_OUTPUT_DERIVATIVES, "fmi2GetRealOutputDerivatives",                   HSEP_S | HSEP_T) \
    CALL(DO_STEP,                     "fmi2DoStep",                                     HSEP_S) \
    CALL(CANCEL_STEP,                 "fmi2CancelStep",               0) \
    CALL(GET_STATUS,                  "fmi2GetStatus",                                  HSEP_S | HSEP_T) \
    CALL(GET_REAL_STATUS,             "fmi2GetRealStatus",                              HSEP_S | HSEP_T) \
    CALL(GET_INTEGER_STATUS,          "fmi2GetIntegerStatus",                           HSEP_S | HSEP_T) \
    CALL(GET_BOOLEAN_STATUS,          "fmi2GetBooleanStatus",                           HSEP_S | HSEP_T) \
    CALL(GET_STRING_STATUS,           "fmi2GetStringStatus",                            HSEP_S | HSEP_T)
/* clang-format on */

#define HSEP_CALL_CONSTANT(constant, name, legal) HSEP_CALL_##constant,
#define HSEP_CALL_ROW(constant, name, legal) {name, legal},

typedef enum { HSEP_CALLS(HSEP_CALL_CONSTANT) } hsep_call;

typedef struct {
    const char *name;
    unsigned legal;
} hsep_call_row;

static const hsep_call_row hsep_calls[] = {HSEP_CALLS(HSEP_CALL_ROW)};

#endif
