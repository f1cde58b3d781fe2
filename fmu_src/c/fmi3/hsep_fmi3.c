/* FMI 3.0 for co-simulation. Every number comes from the model.
 *
 * Single variables and modes have a value reference for each value, windows one each, then comes the time. Where there
 * are windows, Np is the structural parameter that sizes them.
 */
#include "hsep_calls.h" /* before the importer's header: it names FMI3_FUNCTION_PREFIX */

#include "fmi3Functions.h"

/* The calls that belong to an instance: HSEP_LEGAL(function, states in which it is legal); the standard's table of the
 * co-simulation state machine, without Event Mode, as modelDescription.xml says (hsep_fmi3_absent.c).
 * I: instantiated, C: Configuration Mode, M: Initialization Mode, S: Step Mode, T: terminated */
/* clang-format off */
#define HSEP_FMI3_ACCESS(type) \
    HSEP_LEGAL(fmi3Get##type,                HSEP_I | HSEP_M | HSEP_S | HSEP_T); \
    HSEP_LEGAL(fmi3Set##type,                HSEP_I | HSEP_M | HSEP_S)
HSEP_LEGAL(fmi3SetDebugLogging,          HSEP_I | HSEP_C | HSEP_M | HSEP_S | HSEP_T);
HSEP_LEGAL(fmi3EnterConfigurationMode,   HSEP_I);
HSEP_LEGAL(fmi3ExitConfigurationMode,             HSEP_C);
HSEP_LEGAL(fmi3EnterInitializationMode,  HSEP_I);
HSEP_LEGAL(fmi3ExitInitializationMode,                     HSEP_M);
HSEP_LEGAL(fmi3Terminate,                                           HSEP_S);
HSEP_LEGAL(fmi3Reset,                    HSEP_I | HSEP_C | HSEP_M | HSEP_S | HSEP_T);
HSEP_FMI3_ACCESS(Float32); HSEP_FMI3_ACCESS(Float64); HSEP_FMI3_ACCESS(Boolean);
HSEP_FMI3_ACCESS(Int8); HSEP_FMI3_ACCESS(Int16); HSEP_FMI3_ACCESS(Int32);
HSEP_FMI3_ACCESS(UInt8); HSEP_FMI3_ACCESS(UInt16); HSEP_FMI3_ACCESS(UInt32);
HSEP_FMI3_ACCESS(Int64); HSEP_FMI3_ACCESS(String); HSEP_FMI3_ACCESS(Binary);
HSEP_LEGAL(fmi3GetUInt64,                HSEP_I | HSEP_M | HSEP_S | HSEP_T);
HSEP_LEGAL(fmi3SetUInt64,                HSEP_I | HSEP_C);
HSEP_LEGAL(fmi3GetFMUState,              HSEP_I | HSEP_M | HSEP_S | HSEP_T);
HSEP_LEGAL(fmi3SetFMUState,              HSEP_I | HSEP_M | HSEP_S | HSEP_T);
HSEP_LEGAL(fmi3FreeFMUState,             HSEP_I | HSEP_M | HSEP_S | HSEP_T);
HSEP_LEGAL(fmi3SerializedFMUStateSize,   HSEP_I | HSEP_M | HSEP_S | HSEP_T);
HSEP_LEGAL(fmi3SerializeFMUState,        HSEP_I | HSEP_M | HSEP_S | HSEP_T);
HSEP_LEGAL(fmi3DeserializeFMUState,      HSEP_I | HSEP_M | HSEP_S | HSEP_T);
HSEP_LEGAL(fmi3DoStep,                                              HSEP_S);
/* clang-format on */

static size_t fmi3_n_windows(const hsep_context *context) { return context->window > 0 ? HSEP_N_WINDOWS : 0; }

static size_t fmi3_n_variables(const hsep_context *context)
{
    return hsep_table_n_starts(context) + fmi3_n_windows(context) + 1;
}

/* The time has no place: its value is the experiment's. */
static const hsep_variable fmi3_time = {
    .name = "time", .unit = "s", .angular_unit = "s", .kind = HSEP_REAL, .causality = HSEP_INDEPENDENT};

static hsep_found fmi3_find(const hsep_context *context, size_t reference)
{
    const size_t before = hsep_table_n_starts(context);
    if (reference < before) {
        const hsep_variable *row = hsep_table_row(context, reference);
        const hsep_kind kind = context->window > 0 && reference == HSEP_VR_LENGTH ? HSEP_COUNT : row->kind;
        return (hsep_found){.row = row, .kind = kind, .place = reference, .count = 1};
    }
    if (reference == before + fmi3_n_windows(context)) {
        return (hsep_found){.row = &fmi3_time, .kind = HSEP_REAL, .place = context->n_variables, .count = 1};
    }
    const size_t place = before + (reference - before) * context->window;
    return (hsep_found){
        .row = hsep_table_row(context, place), .kind = HSEP_REAL, .place = place, .count = context->window};
}

static const char *fmi3_name(const hsep_context *context, size_t reference, char text[HSEP_NAME_SIZE])
{
    const int is_single = reference < hsep_table_n_starts(context);
    return is_single ? hsep_table_name(context, reference, text) : fmi3_find(context, reference).row->name;
}

static const hsep_fmi_names fmi3_names = {
    .instantiate = "fmi3InstantiateCoSimulation",
    .reset = "fmi3Reset",
    .token = "instantiationToken",
    .location = "resourcePath",
    .location_form = "a folder",
    .references = "valueReferences",
    .n_references = "nValueReferences",
    .values = "values",
    .n_values = "nValues",
    .phases = {"instantiated", "Initialization Mode", "Step Mode", "terminated", "Configuration Mode"},
    .types =
        {[HSEP_REAL] = "Float64",
         [HSEP_INTEGER] = "Int32",
         [HSEP_ENUMERATION] = "Int64", /* which the standard reads and writes enumerations by */
         [HSEP_BOOLEAN] = "Boolean",
         [HSEP_COUNT] = "UInt64"},
    .n_variables = fmi3_n_variables,
    .find = fmi3_find,
    .name = fmi3_name};

const char *fmi3GetVersion(void) { return "3.0"; }

static void fmi3_hand(const hsep_instance *instance, int status, const char *category, const char *text)
{
    const fmi3LogMessageCallback logger = (fmi3LogMessageCallback)instance->logger;
    logger(instance->environment, (fmi3Status)status, category, text);
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible,
    fmi3Boolean loggingOn, fmi3Boolean eventModeUsed, fmi3Boolean earlyReturnAllowed,
    const fmi3ValueReference requiredIntermediateVariables[], size_t nRequiredIntermediateVariables,
    fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage,
    fmi3IntermediateUpdateCallback intermediateUpdate)
{
    const hsep_instance filled = {
        .names = &fmi3_names,
        .hand = fmi3_hand,
        .logger = (void (*)(void))logMessage,
        .environment = instanceEnvironment,
        .categories = HSEP_LOG_ERROR,
        .allocate = HSEP_CALLOC,
        .release = HSEP_FREE};
    /* An early return is allowed, never needed; without intermediate updates there is nothing to ask for in them. */
    (void)visible, (void)earlyReturnAllowed, (void)requiredIntermediateVariables, (void)intermediateUpdate;
    if (eventModeUsed) {
        (void)hsep_refuse(
            &filled, "fmi3InstantiateCoSimulation: eventModeUsed must be false, as hasEventMode is in "
                     "modelDescription.xml");
        return NULL;
    }
    if (nRequiredIntermediateVariables > 0) {
        (void)hsep_refuse(
            &filled,
            "fmi3InstantiateCoSimulation: nRequiredIntermediateVariables must be 0, as providesIntermediateUpdate is "
            "false in modelDescription.xml, got %lu",
            (unsigned long)nRequiredIntermediateVariables);
        return NULL;
    }
    return hsep_call_instantiate(&filled, instanceName, instantiationToken, resourcePath, loggingOn);
}

HSEP_COMMON_FUNCTIONS(fmi3, Instance, FMUState, Deserialize)

HSEP_FUNCTION(
    fmi3, EnterConfigurationMode,
    self->context.window > 0
        ? hsep_call_phase(self, HSEP_CONFIGURATION)
        : hsep_refuse(self, "%s: there is no structural parameter in modelDescription.xml", call->name),
    fmi3Instance c)
HSEP_FUNCTION(fmi3, ExitConfigurationMode, hsep_call_phase(self, HSEP_INSTANTIATED), fmi3Instance c)

fmi3Status fmi3EnterInitializationMode(
    fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance, fmi3Float64 startTime,
    fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    (void)toleranceDefined, (void)tolerance;
    HSEP_DO(
        fmi3, EnterInitializationMode, instance,
        hsep_call_experiment(self, call, startTime, stopTimeDefined, stopTime) == HSEP_OK
            ? hsep_call_phase(self, HSEP_INITIALIZATION)
            : HSEP_REFUSED);
}

fmi3Status fmi3DoStep(
    fmi3Instance instance, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize,
    fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
    fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    const hsep_call *call = HSEP_CALL(fmi3, DoStep);
    hsep_instance *self = hsep_instance_for(instance, call);
    (void)noSetFMUStatePriorToCurrentPoint;
    if (self == NULL) {
        return fmi3Error;
    }
    if (eventHandlingNeeded == NULL || terminateSimulation == NULL || earlyReturn == NULL ||
        lastSuccessfulTime == NULL) {
        (void)hsep_refuse(self, "fmi3DoStep: a place for what it returns is NULL");
        return fmi3Error;
    }
    const hsep_status status = hsep_call_step(self, call, currentCommunicationPoint, communicationStepSize);
    *eventHandlingNeeded = *terminateSimulation = *earlyReturn = fmi3False;
    *lastSuccessfulTime = self->experiment.time;
    return status == HSEP_OK ? fmi3OK : fmi3Error;
}

/* Reading and writing variables. A call is checked as a whole first: if one variable is refused, none is touched. */
#define FMI3_GET(type, get) \
    fmi3Status fmi3Get##type( \
        fmi3Instance instance, const fmi3ValueReference references[], size_t n, fmi3##type values[], size_t n_values) \
    { \
        HSEP_GET(fmi3, Get##type, instance, references, n, values, n_values, get); \
    }

#define FMI3_ACCESS(type, get, set) \
    FMI3_GET(type, get) \
    fmi3Status fmi3Set##type( \
        fmi3Instance instance, const fmi3ValueReference references[], size_t n, const fmi3##type values[], \
        size_t n_values) \
    { \
        HSEP_SET(fmi3, Set##type, instance, references, n, values, n_values, fmi3##type, set); \
    }

FMI3_ACCESS(Float64, number, number)
FMI3_ACCESS(Int32, hsep_values_integer(number), (double)number)
FMI3_ACCESS(Int64, hsep_values_integer(number), (double)number)
FMI3_ACCESS(Boolean, number != 0.0, number ? 1.0 : 0.0)
FMI3_GET(UInt64, (fmi3UInt64)number)

/* Only Np is of this type: arrays take their new size at once, in Configuration Mode, or as soon as the instance is
 * there, for importers that know no Configuration Mode. */
fmi3Status fmi3SetUInt64(
    fmi3Instance instance, const fmi3ValueReference references[], size_t n, const fmi3UInt64 values[], size_t n_values)
{
    HSEP_ACCESS_OR_RETURN(fmi3, SetUInt64, instance, references, n, values, n_values)
    char message[HSEP_MESSAGE_SIZE] = "";
    for (size_t i = 0; i < n; i++) {
        if (hsep_call_tune(self, call, references[i], (double)values[i]) != HSEP_OK) {
            return fmi3Error;
        }
    }
    if (n > 0 && hsep_instance_resize(self, call->name, (size_t)values[n - 1], message) != HSEP_OK) {
        (void)hsep_refuse(self, "%s", message);
        return fmi3Error;
    }
    return fmi3OK;
}

/* Access to types that no variable has: with references, it is refused by name. */
#define FMI3_REFUSED(name, c_type) \
    HSEP_FUNCTION( \
        fmi3, name, hsep_call_access(self, call, references, n, values, n_values), fmi3Instance c, \
        const fmi3ValueReference references[], size_t n, c_type values[], size_t n_values)
#define FMI3_NO_VARIABLE(type) \
    FMI3_REFUSED(Get##type, fmi3##type) \
    FMI3_REFUSED(Set##type, const fmi3##type)

FMI3_NO_VARIABLE(Float32)
FMI3_NO_VARIABLE(Int8)
FMI3_NO_VARIABLE(UInt8)
FMI3_NO_VARIABLE(Int16)
FMI3_NO_VARIABLE(UInt16)
FMI3_NO_VARIABLE(UInt32)
FMI3_NO_VARIABLE(String)

HSEP_FUNCTION(
    fmi3, GetBinary, ((void)sizes, hsep_call_access(self, call, references, n, values, n_values)), fmi3Instance c,
    const fmi3ValueReference references[], size_t n, size_t sizes[], fmi3Binary values[], size_t n_values)
HSEP_FUNCTION(
    fmi3, SetBinary, ((void)sizes, hsep_call_access(self, call, references, n, values, n_values)), fmi3Instance c,
    const fmi3ValueReference references[], size_t n, const size_t sizes[], const fmi3Binary values[], size_t n_values)
