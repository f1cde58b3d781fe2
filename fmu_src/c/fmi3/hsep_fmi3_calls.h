/* Legal FMI 3.0 calls in each state of an instance: the standard's table of the co-simulation state machine.
 *
 * There is no Event Mode, no intermediate update and no early return: modelDescription.xml says
 * so, and the functions for them are in hsep_fmi3_absent.c.
 */
#ifndef HSEP_FMI3_CALLS_H
#define HSEP_FMI3_CALLS_H

#include "hsep_calls.h"
#include "hsep_fmu.h" /* before the importer's header: it names FMI3_FUNCTION_PREFIX */

#include "fmi3Functions.h"

/* The calls that belong to an instance: CALL(constant, name, states in which it is legal).
 * I: instantiated, C: Configuration Mode, M: Initialization Mode, S: Step Mode, T: terminated */
/* clang-format off */
#define HSEP_FMI3_CALLS(CALL) \
    CALL(SET_DEBUG_LOGGING,         "fmi3SetDebugLogging",         HSEP_I | HSEP_C | HSEP_M | HSEP_S | HSEP_T) \
    CALL(ENTER_CONFIGURATION_MODE,  "fmi3EnterConfigurationMode",  HSEP_I) \
    CALL(EXIT_CONFIGURATION_MODE,   "fmi3ExitConfigurationMode",   HSEP_C) \
    CALL(ENTER_INITIALIZATION_MODE, "fmi3EnterInitializationMode", HSEP_I) \
    CALL(EXIT_INITIALIZATION_MODE,  "fmi3ExitInitializationMode",           HSEP_M) \
    CALL(TERMINATE,                 "fmi3Terminate",                                 HSEP_S) \
    CALL(RESET,                     "fmi3Reset",                   HSEP_I | HSEP_C | HSEP_M | HSEP_S | HSEP_T) \
    CALL(GET_FLOAT64,               "fmi3GetFloat64",              HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(GET_INT32,                 "fmi3GetInt32",                HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(GET_INT64,                 "fmi3GetInt64",                HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(GET_BOOLEAN,               "fmi3GetBoolean",              HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(GET_FLOAT32,               "fmi3GetFloat32",              HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(GET_INT8,                  "fmi3GetInt8",                 HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(GET_UINT8,                 "fmi3GetUInt8",                HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(GET_INT16,                 "fmi3GetInt16",                HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(GET_UINT16,                "fmi3GetUInt16",               HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(GET_UINT32,                "fmi3GetUInt32",               HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(GET_UINT64,                "fmi3GetUInt64",               HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(GET_STRING,                "fmi3GetString",               HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(GET_BINARY,                "fmi3GetBinary",               HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(SET_FLOAT64,               "fmi3SetFloat64",              HSEP_I | HSEP_M | HSEP_S) \
    CALL(SET_INT32,                 "fmi3SetInt32",                HSEP_I | HSEP_M | HSEP_S) \
    CALL(SET_INT64,                 "fmi3SetInt64",                HSEP_I | HSEP_M | HSEP_S) \
    CALL(SET_BOOLEAN,               "fmi3SetBoolean",              HSEP_I | HSEP_M | HSEP_S) \
    CALL(SET_FLOAT32,               "fmi3SetFloat32",              HSEP_I | HSEP_M | HSEP_S) \
    CALL(SET_INT8,                  "fmi3SetInt8",                 HSEP_I | HSEP_M | HSEP_S) \
    CALL(SET_UINT8,                 "fmi3SetUInt8",                HSEP_I | HSEP_M | HSEP_S) \
    CALL(SET_INT16,                 "fmi3SetInt16",                HSEP_I | HSEP_M | HSEP_S) \
    CALL(SET_UINT16,                "fmi3SetUInt16",               HSEP_I | HSEP_M | HSEP_S) \
    CALL(SET_UINT32,                "fmi3SetUInt32",               HSEP_I | HSEP_M | HSEP_S) \
    CALL(SET_UINT64,                "fmi3SetUInt64",               HSEP_I | HSEP_C) \
    CALL(SET_STRING,                "fmi3SetString",               HSEP_I | HSEP_M | HSEP_S) \
    CALL(SET_BINARY,                "fmi3SetBinary",               HSEP_I | HSEP_M | HSEP_S) \
    CALL(GET_DIRECTIONAL_DERIVATIVE, "fmi3GetDirectionalDerivative",        HSEP_M | HSEP_S) \
    CALL(GET_FMU_STATE,             "fmi3GetFMUState",             HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(SET_FMU_STATE,             "fmi3SetFMUState",             HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(FREE_FMU_STATE,            "fmi3FreeFMUState",            HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(SERIALIZED_FMU_STATE_SIZE, "fmi3SerializedFMUStateSize",  HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(SERIALIZE_FMU_STATE,       "fmi3SerializeFMUState",       HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(DESERIALIZE_FMU_STATE,     "fmi3DeserializeFMUState",     HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(DO_STEP,                   "fmi3DoStep",                                    HSEP_S)
/* clang-format on */

#define HSEP_FMI3_CONSTANT(constant, name, legal) HSEP_FMI3_##constant,
#define HSEP_FMI3_ROW(constant, name, legal) {name, legal},

enum { HSEP_FMI3_CALLS(HSEP_FMI3_CONSTANT) };

static const hsep_call hsep_fmi3_calls[] = {HSEP_FMI3_CALLS(HSEP_FMI3_ROW)};

#define HSEP_FMI3(constant) (&hsep_fmi3_calls[HSEP_FMI3_##constant])

/* The words of FMI 3.0. */
HSEP_API const hsep_fmi_names *hsep_fmi3_names(void);

/* A status as FMI 3.0 has it. */
HSEP_API fmi3Status hsep_fmi3_status(hsep_status status);

#endif
