/* FMI 2.0 for co-simulation. A value reference is the place of one value; every number comes from the model. */
#include "hsep_calls.h" /* before the importer's header: it names FMI2_FUNCTION_PREFIX */

#include "fmi2Functions.h"

/* The calls that belong to an instance: HSEP_LEGAL(function, states in which it is legal); the standard's table of the
 * co-simulation state machine.
 * I: instantiated, M: Initialization Mode, S: stepping, T: terminated */
/* clang-format off */
#define HSEP_FMI2_ACCESS(type) \
    HSEP_LEGAL(fmi2Get##type,                HSEP_I | HSEP_M | HSEP_S | HSEP_T); \
    HSEP_LEGAL(fmi2Set##type,                HSEP_I | HSEP_M | HSEP_S)
HSEP_LEGAL(fmi2SetDebugLogging,          HSEP_I | HSEP_M | HSEP_S | HSEP_T);
HSEP_LEGAL(fmi2SetupExperiment,          HSEP_I);
HSEP_LEGAL(fmi2EnterInitializationMode,  HSEP_I);
HSEP_LEGAL(fmi2ExitInitializationMode,            HSEP_M);
HSEP_LEGAL(fmi2Terminate,                                  HSEP_S);
HSEP_LEGAL(fmi2Reset,                    HSEP_I | HSEP_M | HSEP_S | HSEP_T);
HSEP_FMI2_ACCESS(Real); HSEP_FMI2_ACCESS(Integer);
HSEP_FMI2_ACCESS(Boolean); HSEP_FMI2_ACCESS(String);
HSEP_LEGAL(fmi2GetFMUstate,              HSEP_I | HSEP_M | HSEP_S | HSEP_T);
HSEP_LEGAL(fmi2SetFMUstate,              HSEP_I | HSEP_M | HSEP_S | HSEP_T);
HSEP_LEGAL(fmi2FreeFMUstate,             HSEP_I | HSEP_M | HSEP_S | HSEP_T);
HSEP_LEGAL(fmi2SerializedFMUstateSize,   HSEP_I | HSEP_M | HSEP_S | HSEP_T);
HSEP_LEGAL(fmi2SerializeFMUstate,        HSEP_I | HSEP_M | HSEP_S | HSEP_T);
HSEP_LEGAL(fmi2DeSerializeFMUstate,      HSEP_I | HSEP_M | HSEP_S | HSEP_T);
HSEP_LEGAL(fmi2GetDirectionalDerivative,          HSEP_M | HSEP_S | HSEP_T);
HSEP_LEGAL(fmi2SetRealInputDerivatives,  HSEP_I | HSEP_M | HSEP_S);
HSEP_LEGAL(fmi2GetRealOutputDerivatives,                   HSEP_S | HSEP_T);
HSEP_LEGAL(fmi2DoStep,                                     HSEP_S);
HSEP_LEGAL(fmi2CancelStep,               0);
HSEP_LEGAL(fmi2GetStatus,                                  HSEP_S | HSEP_T);
HSEP_LEGAL(fmi2GetRealStatus,                              HSEP_S | HSEP_T);
HSEP_LEGAL(fmi2GetIntegerStatus,                           HSEP_S | HSEP_T);
HSEP_LEGAL(fmi2GetBooleanStatus,                           HSEP_S | HSEP_T);
HSEP_LEGAL(fmi2GetStringStatus,                            HSEP_S | HSEP_T);
/* clang-format on */

static size_t fmi2_n_variables(const hsep_context *context) { return context->n_variables; }

static hsep_found fmi2_find(const hsep_context *context, size_t reference)
{
    const hsep_variable *row = hsep_table_row(context, reference);
    return (hsep_found){.row = row, .kind = row->kind, .place = reference, .count = 1};
}

static const hsep_fmi_names fmi2_names = {
    .instantiate = "fmi2Instantiate",
    .reset = "fmi2Reset",
    .token = "fmuGUID",
    .location = "fmuResourceLocation",
    .location_form = "a file: URI",
    .references = "vr",
    .n_references = "nvr",
    .values = "value",
    .n_values = "nvr",
    .phases = {"instantiated", "Initialization Mode", "stepping (after fmi2ExitInitializationMode)", "terminated"},
    .types =
        {[HSEP_REAL] = "Real",
         [HSEP_INTEGER] = "Integer",
         [HSEP_ENUMERATION] = "Integer", /* which the standard reads and writes enumerations by */
         [HSEP_BOOLEAN] = "Boolean"},
    .n_variables = fmi2_n_variables,
    .find = fmi2_find,
    .name = hsep_table_name};

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return "2.0"; }

/* The logger reads its message as printf does: a percent sign in ours stands for itself. */
static void fmi2_hand(const hsep_instance *instance, int status, const char *category, const char *text)
{
    const fmi2CallbackLogger logger = (fmi2CallbackLogger)instance->logger;
    char escaped[4 * HSEP_MESSAGE_SIZE]; /* a text is half as long */
    size_t n = 0;
    for (const char *c = text; *c != '\0'; c++) {
        if (*c == '%') {
            escaped[n++] = '%';
        }
        escaped[n++] = *c;
    }
    escaped[n] = '\0';
    const char *name = instance->name;
    logger(instance->environment, (name == NULL) ? HSEP_MODEL_NAME : name, (fmi2Status)status, category, escaped);
}

fmi2Component fmi2Instantiate(
    fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID, fmi2String fmuResourceLocation,
    const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean loggingOn)
{
    const int own_memory = functions == NULL || functions->allocateMemory == NULL || functions->freeMemory == NULL;
    hsep_instance filled = {
        .names = &fmi2_names,
        .hand = fmi2_hand,
        .categories = HSEP_LOG_ERROR,
        .allocate = own_memory ? HSEP_CALLOC : functions->allocateMemory,
        .release = own_memory ? HSEP_FREE : functions->freeMemory};
    (void)visible;
    if (functions != NULL) {
        filled.logger = (void (*)(void))functions->logger;
        filled.environment = functions->componentEnvironment;
    }
    if (fmuType != fmi2CoSimulation) {
        (void)hsep_refuse(&filled, "fmi2Instantiate: fmuType must be fmi2CoSimulation, got %d", (int)fmuType);
        return NULL;
    }
    return hsep_call_instantiate(&filled, instanceName, fmuGUID, fmuResourceLocation, loggingOn);
}

HSEP_COMMON_FUNCTIONS(fmi2, Component, FMUstate, DeSerialize)

HSEP_FUNCTION(
    fmi2, SetupExperiment,
    ((void)toleranceDefined, (void)tolerance, hsep_call_experiment(self, call, startTime, stopTimeDefined, stopTime)),
    fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime, fmi2Boolean stopTimeDefined,
    fmi2Real stopTime)
HSEP_FUNCTION(fmi2, EnterInitializationMode, hsep_call_phase(self, HSEP_INITIALIZATION), fmi2Component c)
HSEP_FUNCTION(
    fmi2, DoStep,
    ((void)noSetFMUStatePriorToCurrentPoint,
     hsep_call_step(self, call, currentCommunicationPoint, communicationStepSize)),
    fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
    fmi2Boolean noSetFMUStatePriorToCurrentPoint)

/* Variables. A call is checked as a whole first: if one is refused, none is touched. */
#define FMI2_ACCESS(type, get, set) \
    fmi2Status fmi2Get##type(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2##type value[]) \
    { \
        HSEP_GET(fmi2, Get##type, c, vr, nvr, value, nvr, get); \
    } \
    fmi2Status fmi2Set##type(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2##type value[]) \
    { \
        HSEP_SET(fmi2, Set##type, c, vr, nvr, value, nvr, fmi2##type, set); \
    }

FMI2_ACCESS(Real, number, number)
FMI2_ACCESS(Integer, hsep_values_integer(number), (double)number)
FMI2_ACCESS(Boolean, number != 0.0, number ? 1.0 : 0.0)

/* There are no variables of type String: with references, the access is refused by name. */
HSEP_FUNCTION(
    fmi2, GetString, hsep_call_access(self, call, vr, nvr, value, nvr), fmi2Component c, const fmi2ValueReference vr[],
    size_t nvr, fmi2String value[])
HSEP_FUNCTION(
    fmi2, SetString, hsep_call_access(self, call, vr, nvr, value, nvr), fmi2Component c, const fmi2ValueReference vr[],
    size_t nvr, const fmi2String value[])

/* The derivatives count only for the next step. Like the values, none is taken if one is refused. */
static hsep_status fmi2_set_derivatives(
    hsep_instance *instance, const hsep_access *access, const fmi2Integer order[], const fmi2Real value[])
{
    const size_t n = access->n_references;
    char input[HSEP_NAME_SIZE];
    if (hsep_values_check(instance, access) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    if (HSEP_N_INTERPOLATED == 0) {
        return hsep_refuse(
            instance, "%s is not supported: canInterpolateInputs is false in modelDescription.xml", access->call);
    }
    if (n > 0 && order == NULL) {
        return hsep_refuse(instance, "%s: order is NULL, but nvr is %lu", access->call, (unsigned long)n);
    }
    for (size_t i = 0; i < n; i++) {
        const char *name = hsep_table_name(&instance->context, access->references[i], input);
        if (access->references[i] + 1 > HSEP_N_INTERPOLATED) {
            return hsep_refuse(
                instance, "%s: %s takes no derivative, only x_d_ahead and x_meas do", access->call, name);
        }
        if (order[i] != 1) {
            return hsep_refuse(instance, "%s: the order of %s must be 1, got %d", access->call, name, (int)order[i]);
        }
        if (!isfinite(value[i])) {
            return hsep_refuse(
                instance, "%s: the derivative of %s must be finite, got %g", access->call, name, value[i]);
        }
    }
    for (size_t i = 0; i < n; i++) {
        instance->values[instance->context.n_variables + access->references[i]] = value[i];
    }
    return HSEP_OK;
}

fmi2Status fmi2SetRealInputDerivatives(
    fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[], const fmi2Real value[])
{
    const hsep_access access = {HSEP_CALL(fmi2, SetRealInputDerivatives)->name, "Real", 0, vr, nvr, value, nvr};
    HSEP_DO(fmi2, SetRealInputDerivatives, c, fmi2_set_derivatives(self, &access, order, value));
}

HSEP_FUNCTION(fmi2, CancelStep, HSEP_REFUSED, fmi2Component c)

/* Refuse a call for what modelDescription.xml says. */
#define FMI2_ABSENT(function, c, why) \
    HSEP_DO(fmi2, function, c, hsep_refuse(self, "%s is not supported: %s in modelDescription.xml", call->name, why))

fmi2Status fmi2GetRealOutputDerivatives(
    fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[], fmi2Real value[])
{
    (void)vr, (void)nvr, (void)order, (void)value;
    FMI2_ABSENT(GetRealOutputDerivatives, c, "maxOutputDerivativeOrder is 0");
}

fmi2Status fmi2GetDirectionalDerivative(
    fmi2Component c, const fmi2ValueReference vUnknown_ref[], size_t nUnknown, const fmi2ValueReference vKnown_ref[],
    size_t nKnown, const fmi2Real dvKnown[], fmi2Real dvUnknown[])
{
    (void)vUnknown_ref, (void)nUnknown, (void)vKnown_ref, (void)nKnown, (void)dvKnown, (void)dvUnknown;
    FMI2_ABSENT(GetDirectionalDerivative, c, "providesDirectionalDerivative is false");
}

/* The functions that get a status: whether that one, s, is known, and its value. */
#define FMI2_STATUS(function, type, known, answer) \
    fmi2Status fmi2##function(fmi2Component c, const fmi2StatusKind s, type *value) \
    { \
        const hsep_call *call = HSEP_CALL(fmi2, function); \
        hsep_instance *self = hsep_instance_for(c, call); \
        (void)s; \
        if (self == NULL) { \
            return fmi2Error; \
        } \
        if (value == NULL) { \
            (void)hsep_refuse(self, "%s: value is NULL", call->name); \
            return fmi2Error; \
        } \
        if (!(known)) { \
            hsep_log( \
                self, HSEP_LOG_DISCARD, "%s: this status does not exist, because no step is ever pending", \
                call->name); \
            return fmi2Discard; \
        } \
        *value = answer; \
        return fmi2OK; \
    }

FMI2_STATUS(GetStatus, fmi2Status, 0, fmi2OK)
FMI2_STATUS(GetRealStatus, fmi2Real, s == fmi2LastSuccessfulTime, self->experiment.time)
FMI2_STATUS(GetIntegerStatus, fmi2Integer, 0, 0)
FMI2_STATUS(GetBooleanStatus, fmi2Boolean, s == fmi2Terminated, fmi2False)
FMI2_STATUS(GetStringStatus, fmi2String, 0, NULL)
