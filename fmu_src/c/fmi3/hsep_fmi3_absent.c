/* What modelDescription.xml says is absent: clocks, events, derivatives, dependencies of single elements, and
 * the other kinds of FMUs. The functions are there, since importers look them all up; they are refused in every state.
 */
#include "hsep_calls.h"
#include "hsep_fmu.h" /* before the importer's header: it names FMI3_FUNCTION_PREFIX */

#include "fmi3Functions.h"

/* Refuse a call; its further arguments are only named, so that no compiler finds them unused. */
static fmi3Status fmi3_absent(fmi3Instance instance, const char *name, const char *why, ...)
{
    if (instance != NULL) {
        (void)hsep_refuse(instance, "%s is not supported: %s in modelDescription.xml", name, why);
    }
    return fmi3Error;
}

static const char fmi3_no_clock[] = "there is no clock";
static const char fmi3_no_event_mode[] = "hasEventMode is false";
static const char fmi3_no_model_exchange[] = "there is no ModelExchange";
static const char fmi3_no_execution[] = "there is no ScheduledExecution";

#define FMI3_ABSENT(name, why, parameters, ...) \
    fmi3Status name parameters { return fmi3_absent(instance, #name, why, __VA_ARGS__); }

/* clang-format off */
#define FMI3_PLAIN (fmi3Instance instance)
#define FMI3_CLOCKS(...) (fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t n, __VA_ARGS__)
#define FMI3_STATES(...) (fmi3Instance instance, __VA_ARGS__ states[], size_t n)
#define FMI3_COUNT (fmi3Instance instance, size_t *n)

FMI3_ABSENT(fmi3EnterEventMode, fmi3_no_event_mode, FMI3_PLAIN, 0)
FMI3_ABSENT(fmi3EnterStepMode, fmi3_no_event_mode, FMI3_PLAIN, 0)
FMI3_ABSENT(fmi3EvaluateDiscreteStates, "providesEvaluateDiscreteStates is false", FMI3_PLAIN, 0)

FMI3_ABSENT(fmi3GetClock, fmi3_no_clock, FMI3_CLOCKS(fmi3Clock values[]), valueReferences, n, values)
FMI3_ABSENT(fmi3SetClock, fmi3_no_clock, FMI3_CLOCKS(const fmi3Clock values[]), valueReferences, n, values)
FMI3_ABSENT(fmi3GetIntervalDecimal, fmi3_no_clock,
    FMI3_CLOCKS(fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]), valueReferences, n, intervals, qualifiers)
FMI3_ABSENT(fmi3GetIntervalFraction, fmi3_no_clock,
    FMI3_CLOCKS(fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]),
    valueReferences, n, counters, resolutions, qualifiers)
FMI3_ABSENT(fmi3GetShiftDecimal, fmi3_no_clock, FMI3_CLOCKS(fmi3Float64 shifts[]), valueReferences, n, shifts)
FMI3_ABSENT(fmi3GetShiftFraction, fmi3_no_clock, FMI3_CLOCKS(fmi3UInt64 counters[], fmi3UInt64 resolutions[]),
    valueReferences, n, counters, resolutions)
FMI3_ABSENT(fmi3SetIntervalDecimal, fmi3_no_clock, FMI3_CLOCKS(const fmi3Float64 intervals[]),
    valueReferences, n, intervals)
FMI3_ABSENT(fmi3SetIntervalFraction, fmi3_no_clock,
    FMI3_CLOCKS(const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]), valueReferences, n, counters, resolutions)
FMI3_ABSENT(fmi3SetShiftDecimal, fmi3_no_clock, FMI3_CLOCKS(const fmi3Float64 shifts[]), valueReferences, n, shifts)
FMI3_ABSENT(fmi3SetShiftFraction, fmi3_no_clock,
    FMI3_CLOCKS(const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]), valueReferences, n, counters, resolutions)

FMI3_ABSENT(fmi3UpdateDiscreteStates, fmi3_no_event_mode,
    (fmi3Instance instance, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *nominals, fmi3Boolean *states,
     fmi3Boolean *defined, fmi3Float64 *next),
    again, terminate, nominals, states, defined, next)

FMI3_ABSENT(fmi3GetNumberOfVariableDependencies, "providesPerElementDependencies is false",
    (fmi3Instance instance, fmi3ValueReference valueReference, size_t *n), valueReference, n)
FMI3_ABSENT(fmi3GetVariableDependencies, "providesPerElementDependencies is false",
    (fmi3Instance instance, fmi3ValueReference dependent, size_t elements[], fmi3ValueReference independents[],
     size_t others[], fmi3DependencyKind kinds[], size_t n),
    dependent, elements, independents, others, kinds, n)

#define FMI3_ABSENT_DERIVATIVE(name, why) FMI3_ABSENT(name, why, \
    (fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns, const fmi3ValueReference knowns[], \
     size_t nKnowns, const fmi3Float64 seed[], size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity), \
    unknowns, nUnknowns, knowns, nKnowns, seed, nSeed, sensitivity, nSensitivity)
FMI3_ABSENT_DERIVATIVE(fmi3GetAdjointDerivative, "providesAdjointDerivatives is false")
FMI3_ABSENT_DERIVATIVE(fmi3GetDirectionalDerivative, "providesDirectionalDerivatives is false")
FMI3_ABSENT(fmi3GetOutputDerivatives, "maxOutputDerivativeOrder is 0",
    (fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t n, const fmi3Int32 orders[],
     fmi3Float64 values[], size_t nValues),
    valueReferences, n, orders, values, nValues)

FMI3_ABSENT(fmi3EnterContinuousTimeMode, fmi3_no_model_exchange, FMI3_PLAIN, 0)
FMI3_ABSENT(fmi3CompletedIntegratorStep, fmi3_no_model_exchange,
    (fmi3Instance instance, fmi3Boolean kept, fmi3Boolean *event, fmi3Boolean *terminate), kept, event, terminate)
FMI3_ABSENT(fmi3SetTime, fmi3_no_model_exchange, (fmi3Instance instance, fmi3Float64 time), time)
FMI3_ABSENT(fmi3SetContinuousStates, fmi3_no_model_exchange, FMI3_STATES(const fmi3Float64), states, n)
FMI3_ABSENT(fmi3GetContinuousStateDerivatives, fmi3_no_model_exchange, FMI3_STATES(fmi3Float64), states, n)
FMI3_ABSENT(fmi3GetEventIndicators, fmi3_no_model_exchange, FMI3_STATES(fmi3Float64), states, n)
FMI3_ABSENT(fmi3GetContinuousStates, fmi3_no_model_exchange, FMI3_STATES(fmi3Float64), states, n)
FMI3_ABSENT(fmi3GetNominalsOfContinuousStates, fmi3_no_model_exchange, FMI3_STATES(fmi3Float64), states, n)
FMI3_ABSENT(fmi3GetNumberOfEventIndicators, fmi3_no_model_exchange, FMI3_COUNT, n)
FMI3_ABSENT(fmi3GetNumberOfContinuousStates, fmi3_no_model_exchange, FMI3_COUNT, n)

FMI3_ABSENT(fmi3ActivateModelPartition, fmi3_no_execution,
    (fmi3Instance instance, fmi3ValueReference clockReference, fmi3Float64 activationTime),
    clockReference, activationTime)
/* clang-format on */

/* An instance of another kind of FMU is refused, with a message. */
static fmi3Instance fmi3_no_instance(
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger, const char *message, ...)
{
    if (logger != NULL) {
        logger(environment, fmi3Error, "logStatusError", message);
    }
    return NULL;
}

fmi3Instance fmi3InstantiateModelExchange(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible,
    fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage)
{
    return fmi3_no_instance(
        instanceEnvironment, logMessage,
        "fmi3InstantiateModelExchange is not supported: there is no ModelExchange in modelDescription.xml",
        instanceName, instantiationToken, resourcePath, visible, loggingOn);
}

fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible,
    fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage,
    fmi3ClockUpdateCallback clockUpdate, fmi3LockPreemptionCallback lockPreemption,
    fmi3UnlockPreemptionCallback unlockPreemption)
{
    return fmi3_no_instance(
        instanceEnvironment, logMessage,
        "fmi3InstantiateScheduledExecution is not supported: there is no ScheduledExecution in modelDescription.xml",
        instanceName, instantiationToken, resourcePath, visible, loggingOn, clockUpdate, lockPreemption,
        unlockPreemption);
}
