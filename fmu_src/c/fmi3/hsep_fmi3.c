/* FMI 3.0 for co-simulation: names, instances, experiments, steps and saved states. Every number comes from the model.
 *
 * Single variables and modes have a value reference for each value, windows one each, then comes the time. Where there
 * are windows, Np is the structural parameter that sizes them.
 */
#include "hsep_fmi3_calls.h"
#include "hsep_text.h"

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
    if (reference < hsep_table_n_starts(context)) {
        return hsep_table_name(context, reference, text);
    }
    hsep_text(text, HSEP_NAME_SIZE, "%.60s", fmi3_find(context, reference).row->name);
    return text;
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

HSEP_COMMON_FUNCTIONS(fmi3, Instance, FMUState, Deserialize, HSEP_FMI3)

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance)
{
    hsep_instance *self = hsep_begin(instance, HSEP_FMI3(fmi3EnterConfigurationMode));
    if (self != NULL && self->context.window == 0) {
        return fmi3_status(
            hsep_refuse(self, "fmi3EnterConfigurationMode: there is no structural parameter in modelDescription.xml"));
    }
    return fmi3_status(hsep_call_phase(instance, HSEP_FMI3(fmi3EnterConfigurationMode), HSEP_CONFIGURATION));
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance)
{
    return fmi3_status(hsep_call_phase(instance, HSEP_FMI3(fmi3ExitConfigurationMode), HSEP_INSTANTIATED));
}

fmi3Status fmi3EnterInitializationMode(
    fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance, fmi3Float64 startTime,
    fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    const hsep_call *call = HSEP_FMI3(fmi3EnterInitializationMode);
    (void)toleranceDefined, (void)tolerance;
    if (hsep_call_experiment(instance, call, startTime, stopTimeDefined, stopTime) != HSEP_OK) {
        return fmi3Error;
    }
    return fmi3_status(hsep_call_phase(instance, call, HSEP_INITIALIZATION));
}

fmi3Status fmi3DoStep(
    fmi3Instance instance, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize,
    fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
    fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    const hsep_call *call = HSEP_FMI3(fmi3DoStep);
    hsep_instance *self = hsep_begin(instance, call);
    (void)noSetFMUStatePriorToCurrentPoint;
    if (self == NULL) {
        return fmi3Error;
    }
    if (eventHandlingNeeded == NULL || terminateSimulation == NULL || earlyReturn == NULL ||
        lastSuccessfulTime == NULL) {
        return fmi3_status(hsep_refuse(self, "fmi3DoStep: a place for what it returns is NULL"));
    }
    const hsep_status status = hsep_call_step(instance, call, currentCommunicationPoint, communicationStepSize);
    *eventHandlingNeeded = *terminateSimulation = *earlyReturn = fmi3False;
    *lastSuccessfulTime = self->experiment.time;
    return fmi3_status(status);
}
