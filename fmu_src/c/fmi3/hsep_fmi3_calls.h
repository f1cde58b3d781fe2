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

/* The calls that belong to an instance: CALL(function, states in which it is legal).
 * I: instantiated, C: Configuration Mode, M: Initialization Mode, S: Step Mode, T: terminated */
/* clang-format off */
#define HSEP_FMI3_ACCESS(CALL, type) \
    CALL(fmi3Get##type,                HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(fmi3Set##type,                HSEP_I | HSEP_M | HSEP_S)
#define HSEP_FMI3_CALLS(CALL) \
    CALL(fmi3SetDebugLogging,          HSEP_I | HSEP_C | HSEP_M | HSEP_S | HSEP_T) \
    CALL(fmi3EnterConfigurationMode,   HSEP_I) \
    CALL(fmi3ExitConfigurationMode,             HSEP_C) \
    CALL(fmi3EnterInitializationMode,  HSEP_I) \
    CALL(fmi3ExitInitializationMode,                     HSEP_M) \
    CALL(fmi3Terminate,                                           HSEP_S) \
    CALL(fmi3Reset,                    HSEP_I | HSEP_C | HSEP_M | HSEP_S | HSEP_T) \
    HSEP_FMI3_ACCESS(CALL, Float32) HSEP_FMI3_ACCESS(CALL, Float64) HSEP_FMI3_ACCESS(CALL, Boolean) \
    HSEP_FMI3_ACCESS(CALL, Int8)    HSEP_FMI3_ACCESS(CALL, Int16)   HSEP_FMI3_ACCESS(CALL, Int32) \
    HSEP_FMI3_ACCESS(CALL, UInt8)   HSEP_FMI3_ACCESS(CALL, UInt16)  HSEP_FMI3_ACCESS(CALL, UInt32) \
    HSEP_FMI3_ACCESS(CALL, Int64)   HSEP_FMI3_ACCESS(CALL, String)  HSEP_FMI3_ACCESS(CALL, Binary) \
    CALL(fmi3GetUInt64,                HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(fmi3SetUInt64,                HSEP_I | HSEP_C) \
    CALL(fmi3GetFMUState,              HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(fmi3SetFMUState,              HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(fmi3FreeFMUState,             HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(fmi3SerializedFMUStateSize,   HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(fmi3SerializeFMUState,        HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(fmi3DeserializeFMUState,      HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(fmi3DoStep,                                              HSEP_S)
/* clang-format on */

#define HSEP_FMI3_PLACE(function, legal) HSEP_FMI3_##function,
#define HSEP_FMI3_ROW(function, legal) {#function, legal},

enum { HSEP_FMI3_CALLS(HSEP_FMI3_PLACE) };

static const hsep_call hsep_fmi3_calls[] = {HSEP_FMI3_CALLS(HSEP_FMI3_ROW)};

#define HSEP_FMI3(function) (&hsep_fmi3_calls[HSEP_FMI3_##function])

/* A status as the version has it. */
static inline fmi3Status fmi3_status(hsep_status status) { return (status == HSEP_REFUSED) ? fmi3Error : fmi3OK; }

#endif
