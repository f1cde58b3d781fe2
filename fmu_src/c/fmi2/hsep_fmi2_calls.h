/* Legal FMI 2.0 calls in each state of an instance: the standard's table of the co-simulation state machine. */
#ifndef HSEP_FMI2_CALLS_H
#define HSEP_FMI2_CALLS_H

#include "hsep_calls.h"
#include "hsep_fmu.h" /* before the importer's header: it names FMI2_FUNCTION_PREFIX */

#include "fmi2Functions.h"

/* The calls that belong to an instance: CALL(function, states in which it is legal).
 * I: instantiated, M: Initialization Mode, S: stepping, T: terminated */
/* clang-format off */
#define HSEP_FMI2_ACCESS(CALL, type) \
    CALL(fmi2Get##type,                HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(fmi2Set##type,                HSEP_I | HSEP_M | HSEP_S)
#define HSEP_FMI2_CALLS(CALL) \
    CALL(fmi2SetDebugLogging,          HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(fmi2SetupExperiment,          HSEP_I) \
    CALL(fmi2EnterInitializationMode,  HSEP_I) \
    CALL(fmi2ExitInitializationMode,            HSEP_M) \
    CALL(fmi2Terminate,                                  HSEP_S) \
    CALL(fmi2Reset,                    HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    HSEP_FMI2_ACCESS(CALL, Real) HSEP_FMI2_ACCESS(CALL, Integer) \
    HSEP_FMI2_ACCESS(CALL, Boolean) HSEP_FMI2_ACCESS(CALL, String) \
    CALL(fmi2GetFMUstate,              HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(fmi2SetFMUstate,              HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(fmi2FreeFMUstate,             HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(fmi2SerializedFMUstateSize,   HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(fmi2SerializeFMUstate,        HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(fmi2DeSerializeFMUstate,      HSEP_I | HSEP_M | HSEP_S | HSEP_T) \
    CALL(fmi2GetDirectionalDerivative,          HSEP_M | HSEP_S | HSEP_T) \
    CALL(fmi2SetRealInputDerivatives,  HSEP_I | HSEP_M | HSEP_S) \
    CALL(fmi2GetRealOutputDerivatives,                   HSEP_S | HSEP_T) \
    CALL(fmi2DoStep,                                     HSEP_S) \
    CALL(fmi2CancelStep,               0) \
    CALL(fmi2GetStatus,                                  HSEP_S | HSEP_T) \
    CALL(fmi2GetRealStatus,                              HSEP_S | HSEP_T) \
    CALL(fmi2GetIntegerStatus,                           HSEP_S | HSEP_T) \
    CALL(fmi2GetBooleanStatus,                           HSEP_S | HSEP_T) \
    CALL(fmi2GetStringStatus,                            HSEP_S | HSEP_T)
/* clang-format on */

#define HSEP_FMI2_PLACE(function, legal) HSEP_FMI2_##function,
#define HSEP_FMI2_ROW(function, legal) {#function, legal},

enum { HSEP_FMI2_CALLS(HSEP_FMI2_PLACE) };

static const hsep_call hsep_fmi2_calls[] = {HSEP_FMI2_CALLS(HSEP_FMI2_ROW)};

#define HSEP_FMI2(function) (&hsep_fmi2_calls[HSEP_FMI2_##function])

/* A status as the version has it. */
static inline fmi2Status fmi2_status(hsep_status status) { return (status == HSEP_REFUSED) ? fmi2Error : fmi2OK; }

#endif
