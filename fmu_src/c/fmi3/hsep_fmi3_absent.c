/* What modelDescription.xml says is absent: clocks, events, derivatives, dependencies of single elements, and the other
 * kinds of FMUs. The functions are there, since importers look them all up; they are refused in every state. */
#include "hsep_calls.h" /* before the importer's header: it names FMI3_FUNCTION_PREFIX */

#include "fmi3Functions.h"

#if defined(__GNUC__) || defined(__clang__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter" /* they read nothing but the instance */
#endif
#ifdef _MSC_VER
#pragma warning(push)
#pragma warning(disable : 4100)
#endif

static fmi3Status fmi3_absent(fmi3Instance instance, const char *name, const char *why)
{
    if (instance != NULL) {
        (void)hsep_refuse(instance, "%s is not supported: %s in modelDescription.xml", name, why);
    }
    return fmi3Error;
}

static const char fmi3_no_clock[] = "there is no clock";
static const char fmi3_no_event_mode[] = "hasEventMode is false";
static const char fmi3_no_dependencies[] = "providesPerElementDependencies is false";
static const char fmi3_no_model_exchange[] = "there is no ModelExchange";

/* A function with these parameters, of which the first one is the instance. */
#define FMI3_ABSENT(function, why, ...) \
    fmi3Status fmi3##function(__VA_ARGS__) { return fmi3_absent(instance, "fmi3" #function, why); }

/* clang-format off */
FMI3_ABSENT(EnterEventMode, fmi3_no_event_mode, fmi3Instance instance)
FMI3_ABSENT(EnterStepMode, fmi3_no_event_mode, fmi3Instance instance)
FMI3_ABSENT(EvaluateDiscreteStates, "providesEvaluateDiscreteStates is false", fmi3Instance instance)
FMI3_ABSENT(UpdateDiscreteStates, fmi3_no_event_mode, fmi3Instance instance, fmi3Boolean *again,
    fmi3Boolean *terminate, fmi3Boolean *nominals, fmi3Boolean *states, fmi3Boolean *defined, fmi3Float64 *next)

#define FMI3_CLOCKS fmi3Instance instance, const fmi3ValueReference clocks[], size_t n
FMI3_ABSENT(GetClock, fmi3_no_clock, FMI3_CLOCKS, fmi3Clock values[])
FMI3_ABSENT(SetClock, fmi3_no_clock, FMI3_CLOCKS, const fmi3Clock values[])
FMI3_ABSENT(GetIntervalDecimal, fmi3_no_clock, FMI3_CLOCKS, fmi3Float64 intervals[],
    fmi3IntervalQualifier qualifiers[])
FMI3_ABSENT(GetIntervalFraction, fmi3_no_clock, FMI3_CLOCKS, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
    fmi3IntervalQualifier qualifiers[])
FMI3_ABSENT(GetShiftDecimal, fmi3_no_clock, FMI3_CLOCKS, fmi3Float64 shifts[])
FMI3_ABSENT(GetShiftFraction, fmi3_no_clock, FMI3_CLOCKS, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
FMI3_ABSENT(SetIntervalDecimal, fmi3_no_clock, FMI3_CLOCKS, const fmi3Float64 intervals[])
FMI3_ABSENT(SetIntervalFraction, fmi3_no_clock, FMI3_CLOCKS, const fmi3UInt64 counters[],
    const fmi3UInt64 resolutions[])
FMI3_ABSENT(SetShiftDecimal, fmi3_no_clock, FMI3_CLOCKS, const fmi3Float64 shifts[])
FMI3_ABSENT(SetShiftFraction, fmi3_no_clock, FMI3_CLOCKS, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
FMI3_ABSENT(ActivateModelPartition, "there is no ScheduledExecution", fmi3Instance instance, fmi3ValueReference clock,
    fmi3Float64 time)

FMI3_ABSENT(GetNumberOfVariableDependencies, fmi3_no_dependencies, fmi3Instance instance, fmi3ValueReference dependent,
    size_t *n)
FMI3_ABSENT(GetVariableDependencies, fmi3_no_dependencies, fmi3Instance instance, fmi3ValueReference dependent,
    size_t elements[], fmi3ValueReference independents[], size_t others[], fmi3DependencyKind kinds[], size_t n)
#define FMI3_DERIVATIVE fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns, \
    const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed, \
    fmi3Float64 sensitivity[], size_t nSensitivity
FMI3_ABSENT(GetAdjointDerivative, "providesAdjointDerivatives is false", FMI3_DERIVATIVE)
FMI3_ABSENT(GetDirectionalDerivative, "providesDirectionalDerivatives is false", FMI3_DERIVATIVE)
FMI3_ABSENT(GetOutputDerivatives, "maxOutputDerivativeOrder is 0", fmi3Instance instance,
    const fmi3ValueReference outputs[], size_t n, const fmi3Int32 orders[], fmi3Float64 values[], size_t nValues)

FMI3_ABSENT(EnterContinuousTimeMode, fmi3_no_model_exchange, fmi3Instance instance)
FMI3_ABSENT(CompletedIntegratorStep, fmi3_no_model_exchange, fmi3Instance instance, fmi3Boolean kept,
    fmi3Boolean *event, fmi3Boolean *terminate)
FMI3_ABSENT(SetTime, fmi3_no_model_exchange, fmi3Instance instance, fmi3Float64 time)
FMI3_ABSENT(SetContinuousStates, fmi3_no_model_exchange, fmi3Instance instance, const fmi3Float64 states[], size_t n)
FMI3_ABSENT(GetContinuousStateDerivatives, fmi3_no_model_exchange, fmi3Instance instance,
    fmi3Float64 slopes[], size_t n)
FMI3_ABSENT(GetEventIndicators, fmi3_no_model_exchange, fmi3Instance instance, fmi3Float64 indicators[], size_t n)
FMI3_ABSENT(GetContinuousStates, fmi3_no_model_exchange, fmi3Instance instance, fmi3Float64 states[], size_t n)
FMI3_ABSENT(GetNominalsOfContinuousStates, fmi3_no_model_exchange, fmi3Instance instance,
    fmi3Float64 states[], size_t n)
FMI3_ABSENT(GetNumberOfEventIndicators, fmi3_no_model_exchange, fmi3Instance instance, size_t *n)
FMI3_ABSENT(GetNumberOfContinuousStates, fmi3_no_model_exchange, fmi3Instance instance, size_t *n)

/* Another kind of FMU, with these parameters after all kinds' own, logger one of them: there is no instance of it.
 */
#define FMI3_NO_INSTANCE(kind, logger, ...) \
    fmi3Instance fmi3Instantiate##kind( \
        fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible, \
        fmi3Boolean loggingOn, fmi3InstanceEnvironment environment, __VA_ARGS__) \
    { \
        if (logger != NULL) { \
            logger(environment, fmi3Error, "logStatusError", "fmi3Instantiate" #kind \
                   " is not supported: there is no " #kind " in modelDescription.xml"); \
        } \
        return NULL; \
    }
FMI3_NO_INSTANCE(ModelExchange, logger, fmi3LogMessageCallback logger)
FMI3_NO_INSTANCE(ScheduledExecution, logger, fmi3LogMessageCallback logger, fmi3ClockUpdateCallback clockUpdate,
    fmi3LockPreemptionCallback lockPreemption, fmi3UnlockPreemptionCallback unlockPreemption)
/* clang-format on */

#if defined(__GNUC__) || defined(__clang__)
#pragma GCC diagnostic pop
#endif
#ifdef _MSC_VER
#pragma warning(pop)
#endif
