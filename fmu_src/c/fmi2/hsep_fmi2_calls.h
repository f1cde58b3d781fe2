/* Legal FMI 2.0 calls in each state of an instance: the standard's table of the co-simulation state machine. */
#ifndef HSEP_FMI2_CALLS_H
#define HSEP_FMI2_CALLS_H

#include "hsep_calls.h"
#include "hsep_fmu.h" /* before the importer's header: it names FMI2_FUNCTION_PREFIX */

#include "fmi2Functions.h"

/* The calls that belong to an instance: CALL(constant, name, states in which it is legal).
 * I: instantiated, M: Initialization Mode, S: stepping, T: terminated */
/* clang-format off */
#define HSEP_FMI2_CALLS(CALL) \
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

#define HSEP_FMI2_CONSTANT(constant, name, legal) HSEP_FMI2_##constant,
#define HSEP_FMI2_ROW(constant, name, legal) {name, legal},

enum { HSEP_FMI2_CALLS(HSEP_FMI2_CONSTANT) };

static const hsep_call hsep_fmi2_calls[] = {HSEP_FMI2_CALLS(HSEP_FMI2_ROW)};

#define HSEP_FMI2(constant) (&hsep_fmi2_calls[HSEP_FMI2_##constant])

/* The words of FMI 2.0. */
HSEP_API const hsep_fmi_names *hsep_fmi2_names(void);

/* A status as FMI 2.0 has it. */
HSEP_API fmi2Status hsep_fmi2_status(hsep_status status);

#endif
